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

static bool touches(uint16_t begin, uint16_t size) {
    for (const Range& range : GOALS) {
        if (begin < range.end && static_cast<uint32_t>(begin) + size > range.begin) return true;
    }
    return false;
}

bool carries_goal(const uint8_t* frame) {
    const uint8_t* parameters = frame + STORED_PARAMETERS;
    switch (frame[STORED_INSTRUCTION]) {
        case DXL_WRITE:
        case DXL_REG_WRITE:
            // Stuffing only makes the range longer than it is.
            return touches(word(parameters), stored_length(frame) - FRAME_MIN_LENGTH - 2);
        case DXL_SYNC_WRITE:
            return touches(word(parameters), word(parameters + 2));
        case DXL_ACTION:
        case DXL_BULK_WRITE:
            // What was registered, or is listed, is not looked into.
            return true;
        default:
            return false;
    }
}
