// The board's clock, tick and uptime, which the table shows.
#include "clock.h"

#include "device.h"
#include "hal.h"
#include "bus.h"

static const uint16_t TICK_WRAP = 0x8000;  // as the XL430's Realtime Tick

static uint16_t last_ticks;
static uint16_t last_ms;
static uint16_t ms_of_second;

void clock_start() {
    last_ticks = hal_ticks();
    last_ms = 0;
    ms_of_second = 0;
}

void clock_update() {
    // An odd count stays for the next time.
    const uint16_t passed = (hal_ticks() - last_ticks) & ~1u;
    last_ticks += passed;
    poll_bus();
    table.board_clock += passed / TICKS_PER_US;
}

void clock_count() {
    const uint16_t passed = static_cast<uint16_t>(table.board_clock) - last_ms;
    if (passed < 1000) return;
    poll_bus();
    last_ms += 1000;
    table.realtime_tick = (table.realtime_tick + 1) & (TICK_WRAP - 1);
    poll_bus();
    if (++ms_of_second == 1000) {
        ms_of_second = 0;
        ++table.uptime;
    }
}

uint32_t clock_at(uint16_t ticks) {
    // Signed: the clock may be half a microsecond behind the capture.
    const int16_t ago = static_cast<int16_t>(last_ticks - ticks);
    return table.board_clock - ago / TICKS_PER_US;
}
