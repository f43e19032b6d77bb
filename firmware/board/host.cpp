// The link to the host.
#include "host.h"

#include "device.h"
#include "hal.h"
#include "router.h"
#include "watchdog.h"

// A USB adapter may cut a frame; its packets follow each other within a few 1 ms frames of USB.
static const uint16_t PAUSE_US = 5000;

// Bytes looked at in one turn. A pass has seven turns, and wrist ok has to fall within 1 ms.
static const uint8_t BYTES_A_TURN = 12;

// Bytes before the CRC with which the end of a frame begins.
static const uint8_t LAST_BYTES = 8;

// Looks at the receiver in two byte times.
static const uint8_t LOOKS = 16;

// A frame of 1024 bytes and the cycle's frames behind it.
static const uint16_t STORE_SIZE = 2048;

Parser host_parser;
uint8_t got[256];
uint8_t got_end;
uint8_t got_parsed;

// Whole frames, each in one piece: one that does not fit before the end lies at the beginning.
static uint8_t store[STORE_SIZE];
static uint8_t* const STORE_BACK = store + STORE_SIZE;
static uint8_t frames;
static uint8_t* oldest;
static uint8_t* newest_end;
static uint8_t* turn;  // where the frames before those at the beginning end; null when none lie there

// The frame that comes at present.
static uint8_t* coming;
static uint8_t* store_at;

static uint8_t got_seen;  // got_end at the last look
static uint16_t active_us;

static uint8_t reply[REPLY_SIZE];
static uint16_t reply_size;
static uint16_t reply_at;
static uint16_t reply_crc;
static Stuffing reply_stuffing;
bool replying;

void host_start() {
    host_parser.at = AT_START;
    got_end = got_parsed = 0;
    frames = 0;
    turn = nullptr;
    got_seen = 0;
    replying = false;
    active_us = 0;
}

// A place for so many bytes, or null.
static uint8_t* place(uint16_t size) {
    if (frames == 0) return store;
    if (newest_end < oldest) return oldest - newest_end > static_cast<int16_t>(size) ? newest_end : nullptr;
    if (STORE_BACK - newest_end >= static_cast<int16_t>(size)) return newest_end;
    return oldest - store > static_cast<int16_t>(size) ? store : nullptr;
}

static void begin_frame() {
    coming = frames == UINT8_MAX ? nullptr : place(frame_length(host_parser) + STORED_INSTRUCTION);
    if (coming == nullptr) {
        ++table.host_overruns;
        host_parser.at = AT_START;
        return;
    }
    coming[STORED_HEADER] = coming[STORED_HEADER + 1] = 0xFF;
    coming[STORED_HEADER + 2] = 0xFD;
    coming[STORED_HEADER + 3] = 0x00;
    coming[STORED_ID] = host_parser.id;
    coming[STORED_LENGTH] = host_parser.length_low;
    coming[STORED_LENGTH + 1] = host_parser.length_high;
    store_at = coming + STORED_INSTRUCTION;
}

static void keep(uint8_t state) {
    coming[0] = state;
    if (frames == 0) {
        oldest = coming;
    } else if (coming != newest_end) {
        turn = newest_end;
    }
    newest_end = store_at;
    ++frames;
    router_frame_stored();
}

static void handle(uint8_t event) {
    switch (event) {
        case EVENT_HEAD:
            begin_frame();
            break;
        case EVENT_FRAME:
            watchdog_feed();
            keep(STORED_GOOD);
            break;
        case EVENT_BAD_CRC:
            ++table.host_crc_errors;
            if (host_parser.id == BOARD_ID && host_parser.instruction != DXL_STATUS) {
                keep(STORED_DAMAGED);
            }
            break;
        default:
            ++table.host_torn_frames;
    }
}

void host_keep(uint8_t status) { host_keep_inline(status); }

ALWAYS_INLINE void poll_inline() {
    poll_bus();
    uint8_t status;
    while ((status = hal_host_status()) & HAL_RECEIVED) host_keep_inline(status);
}

// The bytes of a body that have come, as parser_push takes them, with all that changes in registers: half the time.
static __attribute__((noinline)) uint8_t take_body(uint8_t bytes) {
    uint8_t at = got_parsed;
    uint8_t* to = store_at;
    uint8_t left = host_parser.left_low;
    uint8_t crc_low = host_parser.crc_low;
    uint8_t crc_high = host_parser.crc_high;
    for (;;) {
        const uint8_t byte = got[at++];
        got_parsed = at;
        *to++ = byte;
        const uint16_t left_behind = CRC_TABLE[static_cast<uint8_t>(crc_high ^ byte)];
        crc_high = crc_low ^ static_cast<uint8_t>(left_behind >> 8);
        crc_low = static_cast<uint8_t>(left_behind);
        if (--left == 0 && --host_parser.left_blocks == 0) {
            host_parser.at = AT_CRC_LOW;
            break;
        }
        poll_inline();
        if (bytes != 0 && --bytes == 0) break;
        if (at == got_end) break;
    }
    store_at = to;
    host_parser.left_low = left;
    host_parser.crc_low = crc_low;
    host_parser.crc_high = crc_high;
    return bytes;
}

ALWAYS_INLINE void parse() {
    const uint8_t at = got_parsed;
    const uint8_t byte = got[at];
    got_parsed = at + 1;
    if (host_parser.at >= AT_INSTRUCTION) *store_at++ = byte;
    const uint8_t event = parser_push(host_parser, byte);
    if (event == EVENT_NONE) return;
    if (event == EVENT_FRAME) router_arrived(host_parser, coming, store_at);
    poll();
    handle(event);
}

void host_take() {
    uint8_t bytes = BYTES_A_TURN;
    uint8_t looks = LOOKS;
    for (;;) {
        poll_inline();
        const uint8_t at = host_parser.at;
        const bool body = at == AT_BODY && host_parser.left_low > LAST_BYTES;
        // Head and end of a frame are not kept waiting.
        if (bytes == 0 && (body || at < AT_ID)) return;
        if (got_parsed == got_end) {
            if (body || at < AT_FD || --looks == 0) return;
        } else if (at == AT_BODY) {
            bytes = take_body(bytes);
        } else {
            if (bytes != 0) --bytes;
            parse();
        }
    }
}

void host_timeout() {
    const uint16_t now_us = static_cast<uint16_t>(table.board_clock);
    if (got_seen != got_end || got_parsed != got_end) {
        got_seen = got_end;
        active_us = now_us;
    }
    if (host_parser.at == AT_START || static_cast<uint16_t>(now_us - active_us) < PAUSE_US) return;
    if (host_parser.at > AT_ID) ++table.host_torn_frames;
    host_parser.at = AT_START;
}

// The length is only known when everything is stuffed, so the CRC is made while sending.
static void send_reply() {
    if (reply_at < reply_size) {
        const uint8_t byte = reply[reply_at];
        reply_crc = crc_add(reply_crc, byte);
        hal_host_write(byte);
    } else if (reply_at == reply_size) {
        hal_host_write(static_cast<uint8_t>(reply_crc));
    } else {
        hal_host_write(static_cast<uint8_t>(reply_crc >> 8));
        replying = false;
    }
    ++reply_at;
}

void host_send() {
    if (!(hal_host_status() & HAL_READY)) return;
    if (replying) {
        send_reply();
    } else if (heard_sent != heard_end) {
        bus_forward();
    }
}

const uint8_t* host_frame() { return frames == 0 ? nullptr : oldest; }

void host_release() {
    oldest += stored_length(oldest) + STORED_INSTRUCTION;
    if (oldest == turn) {
        oldest = store;
        turn = nullptr;
    }
    --frames;
}

void reply_begin(uint8_t id, uint8_t error) {
    reply[0] = reply[1] = 0xFF;
    reply[2] = 0xFD;
    reply[3] = 0x00;
    reply[4] = id;
    reply[7] = DXL_STATUS;
    reply[8] = error;
    reply_size = FRAME_HEAD + 2;
    reply_stuffing.run = 0;
}

void reply_add(uint8_t byte) {
    if (reply_size + 2 > REPLY_SIZE) return;
    reply[reply_size++] = byte;
    if (stuffing_wanted(reply_stuffing, byte)) reply[reply_size++] = 0xFD;
}

void reply_end() {
    const uint16_t length = reply_size - FRAME_HEAD + 2;
    reply[5] = static_cast<uint8_t>(length);
    reply[6] = static_cast<uint8_t>(length >> 8);
    reply_at = 0;
    reply_crc = 0;
    replying = true;
}
