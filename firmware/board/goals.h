// Tells frames that could move a servo: what the safe state keeps from the bus.
#ifndef GOALS_H
#define GOALS_H

#include <stdint.h>

// Whether the stored frame writes a goal, or may do so.
bool carries_goal(const uint8_t* frame);

#endif
