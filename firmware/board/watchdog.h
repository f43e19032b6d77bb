// The watch on the host, item BUS_WATCHDOG. Not the microcontroller's own watchdog, which is in the hal.
#ifndef WATCHDOG_H
#define WATCHDOG_H

#include <stdint.h>

#include "device.h"

// The XL430 reads -1 after a trip (e-manual, XL430-W250, "Bus Watchdog").
const uint8_t WATCHDOG_TRIPPED = 0xFF;

void watchdog_start();

// A valid frame came from the host.
void watchdog_feed();

// To be called after BUS_WATCHDOG was written.
void watchdog_set();

// Trips when the host has been silent too long.
void watchdog_step();

// After a trip and after a reset, until 0 is written: no goal passes to the servos, wrist ok is off.
inline bool in_safe_state() { return table.bus_watchdog == WATCHDOG_TRIPPED; }

#endif
