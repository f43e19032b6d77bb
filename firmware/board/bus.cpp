// The servo bus.
#include "bus.h"

#include "device.h"
#include "frame.h"
#include "hal.h"
#include "host.h"
#include "router.h"

// The longest pause inside a frame (e-manual, Protocol 2.0, "Instruction Packet").
static const uint16_t PAUSE_US = 1500;

// The last two bytes take 20 us, some 40 looks; more would be a dead transmitter, and waiting for ever would hold up wrist ok.
static const uint8_t LAST_BYTES_LOOKS = 120;

bool driving;
Parser bus_parser;
uint8_t heard_end;
uint8_t heard_sent;
uint8_t heard_parsed;
uint16_t bus_quiet_us;

static uint8_t heard[256];
static const uint8_t* source;
static const uint8_t* source_end;
static uint8_t heard_seen;  // heard_end at the last look
static uint16_t active_us;

void bus_start() {
    bus_parser.at = AT_START;
    driving = false;
    heard_seen = 0;
    heard_end = heard_sent = heard_parsed = 0;
    active_us = 0;
    bus_quiet_us = 0;
}

void bus_send(const uint8_t* begin, const uint8_t* end) {
    hal_bus_drive();
    hal_bus_write(*begin);
    driving = true;
    source = begin + 1;
    source_end = end;
    bus_parser.at = AT_START;
}

// Waiting for the end of the last byte here makes the pin exact.
static void finish() {
    for (uint8_t looks = LAST_BYTES_LOOKS; looks != 0 && !(hal_bus_status() & HAL_SENT); --looks) poll_host();
    hal_bus_release();
    driving = false;
    active_us = static_cast<uint16_t>(table.board_clock);
    bus_quiet_us = 0;
    ++table.frames_down;
}

void bus_transmit() {
    if (!(hal_bus_status() & HAL_READY)) return;
    const uint8_t* next = source;
    hal_bus_write(*next++);
    source = next;
    if (next == source_end) finish();
}

static void handle(uint8_t event) {
    switch (event) {
        case EVENT_FRAME:
            ++table.frames_up;
            if (bus_parser.instruction == DXL_STATUS) router_status(bus_parser.id, bus_parser.first);
            break;
        case EVENT_BAD_CRC:
            ++table.bus_crc_errors;
            break;
        case EVENT_IMPOSSIBLE:
            ++table.bus_torn_frames;
            break;
        default:
            break;
    }
}

ALWAYS_INLINE void parse() {
    const uint8_t event = parser_push(bus_parser, heard[heard_parsed++]);
    if (event != EVENT_NONE) handle(event);
}

void bus_take(uint8_t status) {
    if (status & HAL_OVERRUN) ++table.bus_overruns;
    const uint8_t byte = hal_bus_read();
    const uint8_t end = heard_end;
    const uint8_t next = end + 1;
    const uint8_t host = hal_host_status();
    const bool ready = (host & HAL_READY) && !replying;
    // The oldest byte goes, which is nearly always this one.
    if (heard_sent == end && ready) {
        hal_host_write(byte);
        heard_sent = next;
    } else if (next == heard_sent) {
        ++table.bus_overruns;
        return;
    } else if (ready && heard_sent != end) {
        bus_forward();
    }
    heard[end] = byte;
    heard_end = next;
    if (next == heard_parsed) {
        // What cannot be followed is at least sent on; the parser finds the next frame.
        ++heard_parsed;
        ++table.bus_overruns;
    }
    if (host & HAL_RECEIVED) {
        host_keep(host);
    } else if (got_parsed == got_end) {
        // The host does not send, and the next byte is far away: time to look at the oldest.
        parse();
    }
}

void bus_parse() { parse(); }

void bus_forward() { hal_host_write(heard[heard_sent++]); }

void bus_timeout() {
    const uint16_t now_us = static_cast<uint16_t>(table.board_clock);
    if (heard_seen != heard_end || driving || heard_parsed != heard_end) {
        heard_seen = heard_end;
        active_us = now_us;
    }
    bus_quiet_us = now_us - active_us;
    poll_bus();
    router_silence();
    poll_bus();
    if (bus_parser.at == AT_START || bus_quiet_us < PAUSE_US) return;
    if (bus_parser.at > AT_ID) ++table.bus_torn_frames;
    bus_parser.at = AT_START;
}
