// Frames that could move a servo.
#include "goals.h"

#include "frame.h"
#include "host.h"

struct Range {
    uint16_t begin;
    uint16_t end;
};

// Goal PWM to Goal Position, and the indirect data by which they can be reached too (e-manual, XL430-W250, "Control Table").
static const Range GOALS[] = {{100, 120}, {224, 252}, {634, 662}};

static uint16_t word(const uint8_t* at) { return at[0] | static_cast<uint16_t>(at[1]) << 8; }

// Address and size of a write.
static const uint8_t WRITE_HEAD = 2;
static const uint8_t SYNC_WRITE_HEAD = 4;

static const uint16_t TORQUE_ENABLE = 64;

static bool covers(uint16_t begin, uint16_t size, uint16_t address) {
    return begin <= address && static_cast<uint32_t>(begin) + size > address;
}

static bool touches_goal(uint16_t begin, uint16_t size) {
    for (const Range& range : GOALS) {
        if (begin < range.end && static_cast<uint32_t>(begin) + size > range.begin) return true;
    }
    return false;
}

// Torque may go off but not on: a servo may still have a goal far from where it is.
static bool writes_goal(const uint8_t* parameters, uint16_t count) {
    // Stuffing only makes the range longer than it is.
    const uint16_t begin = word(parameters);
    const uint16_t size = count - WRITE_HEAD;
    if (touches_goal(begin, size)) return true;
    return covers(begin, size, TORQUE_ENABLE) && (size != 1 || parameters[WRITE_HEAD] != 0);
}

static bool sync_writes_goal(const uint8_t* parameters, uint16_t count) {
    const uint16_t begin = word(parameters);
    const uint16_t size = word(parameters + 2);
    if (touches_goal(begin, size)) return true;
    if (!covers(begin, size, TORQUE_ENABLE)) return false;
    if (size != 1) return true;
    for (uint16_t at = SYNC_WRITE_HEAD + 1; at < count; at += 2) {
        if (parameters[at] != 0) return true;
    }
    return false;
}

bool carries_goal(const uint8_t* frame) {
    const uint8_t* parameters = frame + STORED_PARAMETERS;
    const uint16_t count = stored_length(frame) - FRAME_MIN_LENGTH;
    switch (frame[STORED_INSTRUCTION]) {
        case DXL_WRITE:
        case DXL_REG_WRITE:
            // One without an address writes nothing.
            return count >= WRITE_HEAD && writes_goal(parameters, count);
        case DXL_SYNC_WRITE:
            return count >= SYNC_WRITE_HEAD && sync_writes_goal(parameters, count);
        case DXL_ACTION:
        case DXL_BULK_WRITE:
            // What was registered, or is listed, is not looked into.
            return true;
        default:
            return false;
    }
}
