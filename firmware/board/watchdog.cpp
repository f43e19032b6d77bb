// The watch on the host.
#include "watchdog.h"

#include "clock.h"
#include "host.h"
#include "lines.h"
#include "router.h"

static const uint16_t UNIT_US = 20000;  // e-manual, XL430-W250, "Bus Watchdog"

static bool fed;
static uint32_t since;
static uint32_t limit_us;

void watchdog_start() {
    fed = false;
    since = 0;
    limit_us = 0;
}

void watchdog_feed() { fed = true; }

void watchdog_set() {
    limit_us = static_cast<uint32_t>(table.bus_watchdog) * UNIT_US;
    fed = true;
}

static void trip() {
    table.bus_watchdog = WATCHDOG_TRIPPED;
    table.outputs = 0;
    lines_output();
    poll();
    ++table.watchdog_trips;
    router_hold();
}

void watchdog_step() {
    // As the XL430 with torque off, it counts only while armed.
    const bool counts = table.arm && table.bus_watchdog != 0 && table.bus_watchdog != WATCHDOG_TRIPPED;
    poll_bus();
    if (fed || !counts) {
        fed = false;
        clock_update();  // a clock that lags would trip early
        poll_bus();
        since = table.board_clock;
    } else {
        const uint32_t silent_us = table.board_clock - since;
        poll_bus();
        if (silent_us > limit_us) trip();
    }
}
