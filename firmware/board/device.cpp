// Device 200: Ping, Read, Write, Reg Write, Action, Reboot. The links are looked after in between: a Write takes 30 us.
#include "device.h"

#include "clock.h"
#include "host.h"
#include "lines.h"
#include "watchdog.h"

// First four bytes of the SHA-256 over sources and settings, as build.toml says; the Arduino IDE does not set it.
#ifndef BOARD_BUILD_HASH
#define BOARD_BUILD_HASH 0
#endif

BoardTable table;

static Request registered;

void device_start() {
    uint8_t* bytes = reinterpret_cast<uint8_t*>(&table);
    for (uint8_t i = 0; i < TABLE_SIZE; ++i) bytes[i] = 0;
    table_defaults(table);
    table.build_hash = BOARD_BUILD_HASH;
}

static uint16_t word(const Request& request, uint8_t at) {
    return request.data[at] | static_cast<uint16_t>(request.data[at + 1]) << 8;
}

static const Writable* find(uint16_t address) {
    for (uint8_t i = 0; i < WRITABLE_COUNT; ++i) {
        if (WRITABLE[i].address == address) return &WRITABLE[i];
    }
    return nullptr;
}

// What the present state forbids, over and above the item's range.
static uint8_t check_state(uint8_t address, uint8_t value) {
    switch (address) {
        case ADDR_BUS_WATCHDOG:
            return in_safe_state() && value != 0 ? RANGE_ERROR : NO_ERROR;
        case ADDR_ARM:
            return value != 0 && table.faults != 0 ? LIMIT_ERROR : NO_ERROR;
        case ADDR_OUTPUTS:
            // As the XL430's goals: refused whatever the value.
            if (in_safe_state()) return RANGE_ERROR;
            return value != 0 && (lines_hindrances() & ~HINDRANCES_NOT_ASKED) ? LIMIT_ERROR : NO_ERROR;
        case ADDR_FAULTS:
            return table.inputs & INPUTS_STOP ? RESULT_FAIL : NO_ERROR;
        default:
            return NO_ERROR;
    }
}

// One item at most: what follows a writable item in the table is not writable.
static uint8_t check_write(const Request& request) {
    if (request.size < 3) return LENGTH_ERROR;
    const Writable* item = find(word(request, 0));
    if (item == nullptr) return ACCESS_ERROR;
    const uint16_t size = request.size - 2;
    if (size < item->size) return LENGTH_ERROR;
    if (size > item->size) return ACCESS_ERROR;
    const uint8_t value = request.data[2];
    if (value < item->low || value > item->high) return RANGE_ERROR;
    if (item->size == 2 && request.data[3] != 0) return RANGE_ERROR;
    return check_state(item->address, value);
}

static void settle(uint8_t address, uint8_t value) {
    switch (address) {
        case ADDR_BUS_WATCHDOG:
            watchdog_set();
            break;
        case ADDR_ARM:
            if (value == 0) table.outputs = 0;
            break;
        case ADDR_FAULTS:
            table.alert_id = 255;
            break;
        default:
            break;
    }
    poll();
    // Nothing may bring the output back but the host asking anew.
    if (lines_hindrances() & ~HINDRANCES_NOT_ASKED) table.outputs = 0;
    lines_output();
}

static uint8_t carry_out(const Request& request) {
    const uint8_t error = check_write(request);
    poll();
    if (error != NO_ERROR) return error;
    const uint8_t address = request.data[0];
    uint8_t* bytes = reinterpret_cast<uint8_t*>(&table);
    for (uint8_t i = 2; i < request.size; ++i) bytes[address + i - 2] = request.data[i];
    poll();
    settle(address, request.data[2]);
    return NO_ERROR;
}

static uint8_t read(const Request& request, Answer& answer) {
    if (request.size != 4) return LENGTH_ERROR;
    const uint16_t begin = word(request, 0);
    const uint16_t size = word(request, 2);
    if (size == 0) return LENGTH_ERROR;
    for (uint8_t i = 0; i < STRETCH_COUNT; ++i) {
        if (begin < STRETCHES[i].begin || begin >= STRETCHES[i].end) continue;
        if (size > static_cast<uint16_t>(STRETCHES[i].end - begin)) return ACCESS_ERROR;
        poll();
        clock_update();
        answer.begin = begin;
        answer.end = begin + size;
        return NO_ERROR;
    }
    return ACCESS_ERROR;
}

static uint8_t enter(const Request& request) {
    const uint8_t error = check_write(request);
    if (error != NO_ERROR) return error;
    registered = request;
    table.registered_instruction = 1;
    return NO_ERROR;
}

static uint8_t act() {
    if (!table.registered_instruction) return INSTRUCTION_ERROR;
    table.registered_instruction = 0;
    return carry_out(registered);
}

static void ping(Answer& answer) {
    answer.data[0] = static_cast<uint8_t>(BOARD_MODEL);
    answer.data[1] = static_cast<uint8_t>(BOARD_MODEL >> 8);
    answer.data[2] = BOARD_FIRMWARE;
    answer.data_size = 3;
}

static uint8_t obey(const Request& request, Answer& answer) {
    if (request.damaged) return CRC_ERROR;
    switch (request.instruction) {
        case DXL_PING:
            ping(answer);
            return NO_ERROR;
        case DXL_READ:
            return read(request, answer);
        case DXL_WRITE:
            return carry_out(request);
        case DXL_REG_WRITE:
            return enter(request);
        case DXL_ACTION:
            return act();
        case DXL_REBOOT:
            answer.reboot = true;
            return NO_ERROR;
        default:
            return INSTRUCTION_ERROR;
    }
}

void device_execute(const Request& request, Answer& answer) {
    // Which instructions are answered (e-manual, XL430-W250, "Status Return Level"), before this one changes it.
    uint8_t level = 2;
    if (!request.damaged && request.instruction == DXL_PING) level = 0;
    if (!request.damaged && request.instruction == DXL_READ) level = 1;
    answer.wanted = request.answered && table.status_return_level >= level;
    answer.reboot = false;
    answer.data_size = 0;
    answer.begin = answer.end = 0;
    answer.error = obey(request, answer);
    if (answer.error != NO_ERROR) answer.data_size = 0;
    if (table.faults != 0) answer.error |= ALERT;
}
