// The board's clock in microseconds, stretched from timer 4. Brought up to date by whoever needs it, at least every 16 ms.
#ifndef CLOCK_H
#define CLOCK_H

#include <stdint.h>

void clock_start();
void clock_update();

// Counts milliseconds and seconds; at most one per call.
void clock_count();

// The board clock at a captured count of the timer, at most 16 ms before the last update.
uint32_t clock_at(uint16_t ticks);

#endif
