// DYNAMIXEL Protocol 2.0 frames, byte by byte: parser with CRC, stuffing. Keeps no bytes and knows no port.
//
//   FF FF FD 00 | id | length u16 | instruction | parameters ... | CRC u16     (ROBOTIS e-manual, Protocol 2.0)
//
// The length counts what follows it. All state is in the structures: any number of parsers can run side by side.
#ifndef FRAME_H
#define FRAME_H

#include <stdint.h>

// Where calling would cost as much as what is called.
#define ALWAYS_INLINE inline __attribute__((always_inline))

// Header, id and length: what the length does not count.
const uint8_t FRAME_HEAD = 7;

// The longest frame taken for one, the same line as dynamixel-sdk draws (RXPACKET_MAX_LEN).
const uint16_t FRAME_MAX_LENGTH = 1024 - FRAME_HEAD;

// Instruction and CRC.
const uint16_t FRAME_MIN_LENGTH = 3;

const uint8_t BROADCAST_ID = 0xFE;

enum Instruction : uint8_t {
    DXL_PING = 0x01,
    DXL_READ = 0x02,
    DXL_WRITE = 0x03,
    DXL_REG_WRITE = 0x04,
    DXL_ACTION = 0x05,
    DXL_REBOOT = 0x08,
    DXL_STATUS = 0x55,
    DXL_SYNC_READ = 0x82,
    DXL_SYNC_WRITE = 0x83,
    DXL_FAST_SYNC_READ = 0x8A,
    DXL_BULK_READ = 0x92,
    DXL_BULK_WRITE = 0x93,
    DXL_FAST_BULK_READ = 0x9A,
};

// Error numbers of a status (e-manual, Protocol 2.0, "Error").
enum Error : uint8_t {
    NO_ERROR = 0,
    RESULT_FAIL = 1,
    INSTRUCTION_ERROR = 2,
    CRC_ERROR = 3,
    RANGE_ERROR = 4,
    LENGTH_ERROR = 5,
    LIMIT_ERROR = 6,
    ACCESS_ERROR = 7,
};

const uint8_t ALERT = 0x80;

enum Event : uint8_t {
    EVENT_NONE,
    EVENT_HEAD,        // id and length have come and are possible
    EVENT_FRAME,       // whole, CRC right
    EVENT_BAD_CRC,     // whole, CRC wrong
    EVENT_IMPOSSIBLE,  // an id or a length that no frame has
};

// What the next byte is. Those from AT_ID on belong to a frame.
enum At : uint8_t {
    AT_START,
    AT_FF,
    AT_FD,
    AT_ZERO,
    AT_ID,
    AT_LENGTH_LOW,
    AT_LENGTH_HIGH,
    AT_INSTRUCTION,
    AT_FIRST,
    AT_BODY,
    AT_CRC_LOW,
    AT_CRC_HIGH,
};

struct Parser {
    uint8_t at;
    uint8_t id;
    uint8_t instruction;
    uint8_t first;  // first parameter: the error byte of a status
    uint8_t length_low;
    uint8_t length_high;
    uint8_t left_low;    // bytes before the CRC, modulo 256,
    uint8_t left_blocks; // and how many times left_low has to reach 0
    uint8_t crc_low;
    uint8_t crc_high;
};

inline uint16_t frame_length(const Parser& parser) {
    return parser.length_low | static_cast<uint16_t>(parser.length_high) << 8;
}

extern const uint16_t CRC_TABLE[256];

// What the header FF FF FD 00 leaves behind.
const uint8_t HEADER_CRC_LOW = 0x28;
const uint8_t HEADER_CRC_HIGH = 0x0E;

// CRC of one more byte; for those who have time.
inline uint16_t crc_add(uint16_t crc, uint8_t byte) {
    return static_cast<uint16_t>(crc << 8) ^ CRC_TABLE[static_cast<uint8_t>((crc >> 8) ^ byte)];
}

// In bytes: the compiler makes twice the code of words.
ALWAYS_INLINE void parser_add_crc(Parser& parser, uint8_t byte) {
    const uint16_t left_behind = CRC_TABLE[static_cast<uint8_t>(parser.crc_high ^ byte)];
    parser.crc_high = parser.crc_low ^ static_cast<uint8_t>(left_behind >> 8);
    parser.crc_low = static_cast<uint8_t>(left_behind);
}

// Counts a byte down; true at the last one.
ALWAYS_INLINE bool parser_count(Parser& parser) { return --parser.left_low == 0 && --parser.left_blocks == 0; }

// The byte is not the one the header has at this place.
ALWAYS_INLINE void parser_restart(Parser& parser, uint8_t byte) {
    if (byte != 0xFF) {
        parser.at = AT_START;
    } else if (parser.at != AT_FD) {
        // It may begin the next header; a third FF leaves two in front of an FD.
        parser.at = AT_FF;
    }
}

ALWAYS_INLINE void parser_take_header(Parser& parser, uint8_t byte) {
    const uint8_t wanted = parser.at == AT_FD ? 0xFD : parser.at == AT_ZERO ? 0x00 : 0xFF;
    if (byte == wanted) {
        ++parser.at;
    } else {
        parser_restart(parser, byte);
    }
}

ALWAYS_INLINE uint8_t parser_take_id(Parser& parser, uint8_t byte) {
    // 253 and 255 are no ids (e-manual, Protocol 2.0, "Packet ID").
    if (byte == 0xFD || byte == 0xFF) {
        parser_restart(parser, byte);
        return EVENT_IMPOSSIBLE;
    }
    parser.crc_low = HEADER_CRC_LOW;
    parser.crc_high = HEADER_CRC_HIGH;
    parser_add_crc(parser, byte);
    parser.id = byte;
    parser.first = 0;
    parser.at = AT_LENGTH_LOW;
    return EVENT_NONE;
}

ALWAYS_INLINE uint8_t parser_take_length(Parser& parser, uint8_t byte) {
    parser_add_crc(parser, byte);
    parser.length_high = byte;
    const uint16_t length = frame_length(parser);
    if (length < FRAME_MIN_LENGTH || length > FRAME_MAX_LENGTH) {
        parser_restart(parser, byte);
        return EVENT_IMPOSSIBLE;
    }
    const uint16_t left = length - 2;
    parser.left_low = static_cast<uint8_t>(left);
    parser.left_blocks = static_cast<uint8_t>((left + 0xFF) >> 8);
    parser.at = AT_INSTRUCTION;
    return EVENT_HEAD;
}

// Each byte comes 160 cycles after the one before, and other work wants some of them: therefore inline, for each parser anew.
ALWAYS_INLINE uint8_t parser_push(Parser& parser, uint8_t byte) {
    const uint8_t at = parser.at;
    if (at == AT_BODY) {
        parser_add_crc(parser, byte);
        if (parser_count(parser)) parser.at = AT_CRC_LOW;
        return EVENT_NONE;
    }
    if (at < AT_ID) {
        parser_take_header(parser, byte);
        return EVENT_NONE;
    }
    switch (at) {
        case AT_ID:
            return parser_take_id(parser, byte);
        case AT_LENGTH_LOW:
            parser_add_crc(parser, byte);
            parser.length_low = byte;
            parser.at = AT_LENGTH_HIGH;
            return EVENT_NONE;
        case AT_LENGTH_HIGH:
            return parser_take_length(parser, byte);
        case AT_CRC_LOW:
            // A difference is remembered in left_low, which is 0 by now.
            parser.left_low = byte ^ parser.crc_low;
            parser.at = AT_CRC_HIGH;
            return EVENT_NONE;
        case AT_CRC_HIGH:
            parser.at = AT_START;
            return parser.left_low == 0 && byte == parser.crc_high ? EVENT_FRAME : EVENT_BAD_CRC;
        case AT_INSTRUCTION:
            parser.instruction = byte;
            parser.at = AT_FIRST;
            break;
        default:
            parser.first = byte;
            parser.at = AT_BODY;
    }
    parser_add_crc(parser, byte);
    if (parser_count(parser)) parser.at = AT_CRC_LOW;
    return EVENT_NONE;
}

// After each FF FF FD from the instruction on the sender stuffs an FD in; `run` starts at 0.
struct Stuffing {
    uint8_t run;
};

// Sender: takes a byte sent; true when an FD has to follow it.
bool stuffing_wanted(Stuffing& stuffing, uint8_t byte);

// Receiver: true when the byte is stuffed and has to be dropped.
bool stuffing_drops(Stuffing& stuffing, uint8_t byte);

#endif
