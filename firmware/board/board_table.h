// Control table of the board. Written by tools/make_board_table.py; do not edit.
#ifndef BOARD_TABLE_H
#define BOARD_TABLE_H

#include <stddef.h>
#include <stdint.h>

const uint8_t BOARD_ID = 200;
const uint16_t BOARD_MODEL = 60200;
const uint8_t BOARD_FIRMWARE = 1;
const uint16_t BOARD_PROTOCOL = 0x53CF;
const uint8_t TABLE_SIZE = 200;

const uint8_t ADDR_MODEL_NUMBER = 0;
const uint8_t ADDR_BUILD_HASH = 2;
const uint8_t ADDR_FIRMWARE_VERSION = 6;
const uint8_t ADDR_ID = 7;
const uint8_t ADDR_BAUD_RATE = 8;
const uint8_t ADDR_RETURN_DELAY_TIME = 9;
const uint8_t ADDR_PROTOCOL_TYPE = 13;
const uint8_t ADDR_PROTOCOL_VERSION = 14;
const uint8_t ADDR_ARM = 64;
const uint8_t ADDR_STATUS_RETURN_LEVEL = 68;
const uint8_t ADDR_REGISTERED_INSTRUCTION = 69;
const uint8_t ADDR_FAULTS = 70;
const uint8_t ADDR_BUS_WATCHDOG = 98;
const uint8_t ADDR_OUTPUTS = 116;
const uint8_t ADDR_OUTPUT_STATE = 117;
const uint8_t ADDR_HINDRANCES = 118;
const uint8_t ADDR_ALERT_ID = 119;
const uint8_t ADDR_REALTIME_TICK = 120;
const uint8_t ADDR_INPUTS = 122;
const uint8_t ADDR_INPUTS_RAW = 123;
const uint8_t ADDR_BOARD_CLOCK = 124;
const uint8_t ADDR_KNOT_EDGES = 128;
const uint8_t ADDR_MOVING_EDGES = 130;
const uint8_t ADDR_KNOT_STAMP_0 = 132;
const uint8_t ADDR_KNOT_STAMP_1 = 136;
const uint8_t ADDR_KNOT_STAMP_2 = 140;
const uint8_t ADDR_KNOT_STAMP_3 = 144;
const uint8_t ADDR_MOVING_STAMP = 148;
const uint8_t ADDR_STOP_STAMP = 152;
const uint8_t ADDR_KNOT_RAW_STAMP = 156;
const uint8_t ADDR_KNOT_RAW_EDGES = 160;
const uint8_t ADDR_HOST_CRC_ERRORS = 162;
const uint8_t ADDR_HOST_TORN_FRAMES = 164;
const uint8_t ADDR_HOST_OVERRUNS = 166;
const uint8_t ADDR_BUS_CRC_ERRORS = 168;
const uint8_t ADDR_BUS_TORN_FRAMES = 170;
const uint8_t ADDR_BUS_OVERRUNS = 172;
const uint8_t ADDR_BUS_TIMEOUTS = 174;
const uint8_t ADDR_WATCHDOG_TRIPS = 176;
const uint8_t ADDR_REFUSED_FRAMES = 178;
const uint8_t ADDR_RESETS = 180;
const uint8_t ADDR_RESET_CAUSE = 182;
const uint8_t ADDR_LONGEST_PASS = 184;
const uint8_t ADDR_STACK_FREE = 186;
const uint8_t ADDR_FRAMES_DOWN = 188;
const uint8_t ADDR_FRAMES_UP = 192;
const uint8_t ADDR_UPTIME = 196;

const uint8_t FAULTS_STOP = 0x01;
const uint8_t FAULTS_SERVO = 0x02;
const uint8_t OUTPUTS_WRIST_OK = 0x01;
const uint8_t OUTPUT_STATE_WRIST_OK = 0x01;
const uint8_t HINDRANCES_NOT_ARMED = 0x01;
const uint8_t HINDRANCES_NOT_ASKED = 0x02;
const uint8_t HINDRANCES_NO_WATCHDOG = 0x04;
const uint8_t HINDRANCES_SAFE_STATE = 0x08;
const uint8_t HINDRANCES_STOP = 0x10;
const uint8_t HINDRANCES_SERVO = 0x20;
const uint8_t INPUTS_KNOT = 0x01;
const uint8_t INPUTS_MOVING = 0x02;
const uint8_t INPUTS_STOP = 0x04;
const uint8_t RESET_CAUSE_POWER = 0x01;
const uint8_t RESET_CAUSE_EXTERNAL = 0x02;
const uint8_t RESET_CAUSE_BROWN_OUT = 0x04;
const uint8_t RESET_CAUSE_HARDWARE_WATCHDOG = 0x08;
const uint8_t RESET_CAUSE_JTAG = 0x10;
const uint8_t RESET_CAUSE_ASKED = 0x80;

struct __attribute__((packed)) BoardTable {
    uint16_t model_number;
    uint32_t build_hash;
    uint8_t firmware_version;
    uint8_t id;
    uint8_t baud_rate;
    uint8_t return_delay_time;
    uint8_t gap_10[3];
    uint8_t protocol_type;
    uint16_t protocol_version;
    uint8_t gap_16[48];
    uint8_t arm;
    uint8_t gap_65[3];
    uint8_t status_return_level;
    uint8_t registered_instruction;
    uint8_t faults;
    uint8_t gap_71[27];
    uint8_t bus_watchdog;
    uint8_t gap_99[17];
    uint8_t outputs;
    uint8_t output_state;
    uint8_t hindrances;
    uint8_t alert_id;
    uint16_t realtime_tick;
    uint8_t inputs;
    uint8_t inputs_raw;
    uint32_t board_clock;
    uint16_t knot_edges;
    uint16_t moving_edges;
    uint32_t knot_stamp_0;
    uint32_t knot_stamp_1;
    uint32_t knot_stamp_2;
    uint32_t knot_stamp_3;
    uint32_t moving_stamp;
    uint32_t stop_stamp;
    uint32_t knot_raw_stamp;
    uint16_t knot_raw_edges;
    uint16_t host_crc_errors;
    uint16_t host_torn_frames;
    uint16_t host_overruns;
    uint16_t bus_crc_errors;
    uint16_t bus_torn_frames;
    uint16_t bus_overruns;
    uint16_t bus_timeouts;
    uint16_t watchdog_trips;
    uint16_t refused_frames;
    uint16_t resets;
    uint16_t reset_cause;
    uint16_t longest_pass;
    uint16_t stack_free;
    uint32_t frames_down;
    uint32_t frames_up;
    uint32_t uptime;
};

static_assert(offsetof(BoardTable, model_number) == 0, "MODEL_NUMBER");
static_assert(offsetof(BoardTable, build_hash) == 2, "BUILD_HASH");
static_assert(offsetof(BoardTable, firmware_version) == 6, "FIRMWARE_VERSION");
static_assert(offsetof(BoardTable, id) == 7, "ID");
static_assert(offsetof(BoardTable, baud_rate) == 8, "BAUD_RATE");
static_assert(offsetof(BoardTable, return_delay_time) == 9, "RETURN_DELAY_TIME");
static_assert(offsetof(BoardTable, protocol_type) == 13, "PROTOCOL_TYPE");
static_assert(offsetof(BoardTable, protocol_version) == 14, "PROTOCOL_VERSION");
static_assert(offsetof(BoardTable, arm) == 64, "ARM");
static_assert(offsetof(BoardTable, status_return_level) == 68, "STATUS_RETURN_LEVEL");
static_assert(offsetof(BoardTable, registered_instruction) == 69, "REGISTERED_INSTRUCTION");
static_assert(offsetof(BoardTable, faults) == 70, "FAULTS");
static_assert(offsetof(BoardTable, bus_watchdog) == 98, "BUS_WATCHDOG");
static_assert(offsetof(BoardTable, outputs) == 116, "OUTPUTS");
static_assert(offsetof(BoardTable, output_state) == 117, "OUTPUT_STATE");
static_assert(offsetof(BoardTable, hindrances) == 118, "HINDRANCES");
static_assert(offsetof(BoardTable, alert_id) == 119, "ALERT_ID");
static_assert(offsetof(BoardTable, realtime_tick) == 120, "REALTIME_TICK");
static_assert(offsetof(BoardTable, inputs) == 122, "INPUTS");
static_assert(offsetof(BoardTable, inputs_raw) == 123, "INPUTS_RAW");
static_assert(offsetof(BoardTable, board_clock) == 124, "BOARD_CLOCK");
static_assert(offsetof(BoardTable, knot_edges) == 128, "KNOT_EDGES");
static_assert(offsetof(BoardTable, moving_edges) == 130, "MOVING_EDGES");
static_assert(offsetof(BoardTable, knot_stamp_0) == 132, "KNOT_STAMP_0");
static_assert(offsetof(BoardTable, knot_stamp_1) == 136, "KNOT_STAMP_1");
static_assert(offsetof(BoardTable, knot_stamp_2) == 140, "KNOT_STAMP_2");
static_assert(offsetof(BoardTable, knot_stamp_3) == 144, "KNOT_STAMP_3");
static_assert(offsetof(BoardTable, moving_stamp) == 148, "MOVING_STAMP");
static_assert(offsetof(BoardTable, stop_stamp) == 152, "STOP_STAMP");
static_assert(offsetof(BoardTable, knot_raw_stamp) == 156, "KNOT_RAW_STAMP");
static_assert(offsetof(BoardTable, knot_raw_edges) == 160, "KNOT_RAW_EDGES");
static_assert(offsetof(BoardTable, host_crc_errors) == 162, "HOST_CRC_ERRORS");
static_assert(offsetof(BoardTable, host_torn_frames) == 164, "HOST_TORN_FRAMES");
static_assert(offsetof(BoardTable, host_overruns) == 166, "HOST_OVERRUNS");
static_assert(offsetof(BoardTable, bus_crc_errors) == 168, "BUS_CRC_ERRORS");
static_assert(offsetof(BoardTable, bus_torn_frames) == 170, "BUS_TORN_FRAMES");
static_assert(offsetof(BoardTable, bus_overruns) == 172, "BUS_OVERRUNS");
static_assert(offsetof(BoardTable, bus_timeouts) == 174, "BUS_TIMEOUTS");
static_assert(offsetof(BoardTable, watchdog_trips) == 176, "WATCHDOG_TRIPS");
static_assert(offsetof(BoardTable, refused_frames) == 178, "REFUSED_FRAMES");
static_assert(offsetof(BoardTable, resets) == 180, "RESETS");
static_assert(offsetof(BoardTable, reset_cause) == 182, "RESET_CAUSE");
static_assert(offsetof(BoardTable, longest_pass) == 184, "LONGEST_PASS");
static_assert(offsetof(BoardTable, stack_free) == 186, "STACK_FREE");
static_assert(offsetof(BoardTable, frames_down) == 188, "FRAMES_DOWN");
static_assert(offsetof(BoardTable, frames_up) == 192, "FRAMES_UP");
static_assert(offsetof(BoardTable, uptime) == 196, "UPTIME");
static_assert(sizeof(BoardTable) == TABLE_SIZE, "table");

// Items that do not start at 0.
inline void table_defaults(BoardTable& table) {
    table.model_number = 60200;
    table.firmware_version = 1;
    table.id = 200;
    table.baud_rate = 3;
    table.protocol_type = 2;
    table.status_return_level = 2;
    table.bus_watchdog = 255;
    table.alert_id = 255;
    table.protocol_version = BOARD_PROTOCOL;
}

struct Writable {
    uint8_t address;
    uint8_t size;
    uint8_t low;
    uint8_t high;
};
const uint8_t WRITABLE_COUNT = 7;
const Writable WRITABLE[WRITABLE_COUNT] = {
    {9, 1, 0, 254},
    {64, 1, 0, 1},
    {68, 1, 0, 2},
    {70, 1, 0, 0},
    {98, 1, 0, 127},
    {116, 1, 0, 1},
    {184, 2, 0, 0},
};

// Defined addresses: the first one, the first one behind.
struct Stretch {
    uint8_t begin;
    uint8_t end;
};
const uint8_t STRETCH_COUNT = 6;
const Stretch STRETCHES[STRETCH_COUNT] = {
    {0, 10},
    {13, 16},
    {64, 65},
    {68, 71},
    {98, 99},
    {116, 200},
};

#endif
