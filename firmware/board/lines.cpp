// The lines to the KRC4, debounced by the board's clock.
#include "lines.h"

#include "clock.h"
#include "device.h"
#include "hal.h"
#include "host.h"
#include "watchdog.h"

// The KRC4 holds its outputs for a 12 ms cycle at least; optocouplers settle in microseconds.
static const uint16_t DEBOUNCE_US = 2000;

// Long enough for a spike on a 24 V line, short enough that wrist ok falls within 1 ms.
static const uint16_t STOP_US = 250;

// An input that changes when its new level has lasted; `first` is when it first left the old one.
struct Filter {
    uint8_t mask;
    uint8_t raw;
    bool open;
    uint16_t since;
    uint32_t first;
};

static Filter knot;
static Filter moving;
static Filter stop;

// The lines as bits of INPUTS: 24 V pulls a pin low through its optocoupler, the stop's open contact leaves it high.
static uint8_t sample() {
    const uint8_t pins = hal_lines();
    uint8_t inputs = 0;
    if (!(pins & HAL_KNOT)) inputs |= INPUTS_KNOT;
    if (!(pins & HAL_MOVING)) inputs |= INPUTS_MOVING;
    if (pins & HAL_STOP) inputs |= INPUTS_STOP;
    return inputs;
}

static void leave(Filter& filter, uint32_t when) {
    filter.since = static_cast<uint16_t>(table.board_clock);
    if (filter.open) return;
    filter.open = true;
    filter.first = when;
}

// Follows the input; true when its debounced bit has just changed.
static bool follow(Filter& filter, uint8_t inputs, uint16_t wait_us) {
    poll_bus();
    const uint8_t raw = inputs & filter.mask;
    if (raw != filter.raw) {
        filter.raw = raw;
        leave(filter, table.board_clock);
    }
    if (!filter.open) return false;
    poll_bus();
    if (static_cast<uint16_t>(static_cast<uint16_t>(table.board_clock) - filter.since) < wait_us) return false;
    filter.open = false;
    if (raw == (table.inputs & filter.mask)) return false;
    table.inputs ^= filter.mask;
    return true;
}

static void start(Filter& filter, uint8_t mask, uint8_t inputs) {
    filter.mask = mask;
    filter.raw = inputs & mask;
    filter.open = false;
}

static void press() {
    table.faults |= FAULTS_STOP;
    table.arm = 0;
    table.outputs = 0;
    lines_output();
}

void lines_start() {
    const uint8_t inputs = sample();
    table.inputs = inputs;
    table.inputs_raw = inputs;
    start(knot, INPUTS_KNOT, inputs);
    start(moving, INPUTS_MOVING, inputs);
    start(stop, INPUTS_STOP, inputs);
    if (inputs & INPUTS_STOP) press();
    lines_output();
}

void lines_edge() {
    const uint16_t ticks = hal_capture();
    poll();
    clock_update();
    poll();
    table.knot_raw_stamp = clock_at(ticks);
    poll();
    ++table.knot_raw_edges;
    leave(knot, table.knot_raw_stamp);
    poll();
}

void lines_sample() { table.inputs_raw = sample(); }

void lines_knot() {
    if (!follow(knot, table.inputs_raw, DEBOUNCE_US)) return;
    const uint16_t edge = table.knot_edges + 1;
    table.knot_edges = edge;
    switch (edge & 3) {
        case 0:
            table.knot_stamp_0 = knot.first;
            break;
        case 1:
            table.knot_stamp_1 = knot.first;
            break;
        case 2:
            table.knot_stamp_2 = knot.first;
            break;
        default:
            table.knot_stamp_3 = knot.first;
    }
}

void lines_moving() {
    if (!follow(moving, table.inputs_raw, DEBOUNCE_US)) return;
    ++table.moving_edges;
    table.moving_stamp = moving.first;
}

void lines_stop() {
    const uint8_t inputs = table.inputs_raw;
    if (!follow(stop, inputs, inputs & INPUTS_STOP ? STOP_US : DEBOUNCE_US)) return;
    if (!(inputs & INPUTS_STOP)) return;
    table.stop_stamp = stop.first;
    press();
}

uint8_t lines_hindrances() {
    uint8_t hindrances = 0;
    if (!table.arm) hindrances |= HINDRANCES_NOT_ARMED;
    if (!(table.outputs & OUTPUTS_WRIST_OK)) hindrances |= HINDRANCES_NOT_ASKED;
    poll_bus();
    if (table.bus_watchdog == 0) hindrances |= HINDRANCES_NO_WATCHDOG;
    if (table.bus_watchdog == WATCHDOG_TRIPPED) hindrances |= HINDRANCES_SAFE_STATE;
    if (table.faults & FAULTS_STOP) hindrances |= HINDRANCES_STOP;
    if (table.faults & FAULTS_SERVO) hindrances |= HINDRANCES_SERVO;
    return hindrances;
}

void lines_output() {
    const uint8_t hindrances = lines_hindrances();
    poll_bus();
    hal_wrist_ok(hindrances == 0);
    table.hindrances = hindrances;
    table.output_state = hindrances == 0 ? OUTPUT_STATE_WRIST_OK : 0;
}
