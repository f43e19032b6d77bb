// The lines to the KRC4: knot, arm moving and emergency stop in, wrist ok out. Decides when wrist ok is on.
#ifndef LINES_H
#define LINES_H

#include <stdint.h>

#include "frame.h"
#include "hal.h"

void lines_start();

// One step each: all levels, a captured edge of knot, the three inputs, the output. The edge is asked for between levels and knot:
// then one that the levels show has the captured time.
void lines_sample();
void lines_edge();
ALWAYS_INLINE void lines_capture() {
    if (hal_captured()) lines_edge();
}
void lines_knot();
void lines_moving();
void lines_stop();
void lines_output();

// What keeps wrist ok off, HINDRANCES_... in the table.
uint8_t lines_hindrances();

#endif
