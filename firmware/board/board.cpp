// The main loop: both links again and again, everything else by turns.
#include "board.h"

#include "bus.h"
#include "clock.h"
#include "device.h"
#include "hal.h"
#include "host.h"
#include "lines.h"
#include "router.h"
#include "watchdog.h"

// Bytes of the servos looked at in one turn, when they could not be at once.
static const uint8_t BYTES_A_TURN = 12;

static uint16_t pass_began;

void board_start() {
    hal_start();
    device_start();
    table.resets = hal_resets();
    table.reset_cause = hal_reset_cause();
    clock_start();
    watchdog_start();
    lines_start();
    host_start();
    bus_start();
    router_start();
    pass_began = hal_ticks();
}

static void measure_pass() {
    poll_bus();
    const uint16_t now = hal_ticks();
    const uint16_t took_us = static_cast<uint16_t>(now - pass_began + 1) / TICKS_PER_US;
    pass_began = now;
    poll_bus();
    if (took_us > table.longest_pass) table.longest_pass = took_us;
}

static void take_from_bus() {
    uint8_t bytes = BYTES_A_TURN;
    while (heard_parsed != heard_end && bytes-- != 0) {
        bus_parse();
        poll();
    }
}

static void links() {
    poll();
    if (host_waiting()) host_take();
    if (heard_parsed != heard_end) take_from_bus();
    if (!host_idle()) host_send();
    poll();
    if (!router_due) return;
    router_step();
    poll();
}

static void look_after() {
    hal_alive();
    poll_bus();
    table.stack_free = hal_stack_free();
}

// A turn: the links, and a piece of other work that looks after the bus at least every 50 cycles.
ALWAYS_INLINE void then(void (*piece)()) {
    links();
    poll();
    lines_capture();
    piece();
    poll();
}

// What may wait for its turn a little longer.
static void other() {
    static uint8_t next;
    const uint8_t now = next;
    next = now == 4 ? 0 : now + 1;
    poll_bus();
    switch (now) {
        case 0:
            lines_moving();
            break;
        case 1:
            host_timeout();
            break;
        case 2:
            bus_timeout();
            break;
        case 3:
            clock_count();
            break;
        default:
            look_after();
    }
}

void board_pass() {
    measure_pass();
    then(clock_update);
    then(lines_sample);
    then(lines_knot);
    then(lines_stop);
    then(watchdog_step);
    then(lines_output);
    then(other);
}
