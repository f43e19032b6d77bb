// The link to the host, UART0: stores frames until they are whole and checked; sends the servos' bytes and the board's answers.
#ifndef HOST_H
#define HOST_H

#include <stdint.h>

#include "bus.h"
#include "device.h"
#include "frame.h"
#include "hal.h"

// A stored frame: state, FF FF FD 00, id, length u16, instruction, parameters, CRC u16.
const uint8_t STORED_HEADER = 1;
const uint8_t STORED_ID = 5;
const uint8_t STORED_LENGTH = 6;
const uint8_t STORED_INSTRUCTION = 8;
const uint8_t STORED_PARAMETERS = 9;

inline uint16_t stored_length(const uint8_t* frame) {
    return frame[STORED_LENGTH] | static_cast<uint16_t>(frame[STORED_LENGTH + 1]) << 8;
}

const uint8_t STORED_GOOD = 0;
const uint8_t STORED_DAMAGED = 1;  // a frame to the board whose CRC is wrong: it is answered, not obeyed

// The longest status: the whole table, all of it stuffed, head and CRC.
const uint16_t REPLY_SIZE = 300;

void host_start();

// What the host says at present; AT_START between its frames.
extern Parser host_parser;

// Bytes that have come and have not been looked at; the indices wrap with the ring, one place stays free.
extern uint8_t got[256];
extern uint8_t got_end;
extern uint8_t got_parsed;

// Takes a byte; inline where the frames are looked at, called elsewhere.
ALWAYS_INLINE void host_keep_inline(uint8_t status) {
    const uint8_t byte = hal_host_read();
    const uint8_t end = got_end;
    const uint8_t next = end + 1;
    if ((status & HAL_OVERRUN) || next == got_parsed) ++table.host_overruns;
    if (next == got_parsed) return;
    got[end] = byte;
    got_end = next;
}
void host_keep(uint8_t status);

// Takes what has come. The receiver holds two bytes: 20 us may pass between two calls.
ALWAYS_INLINE void poll_host() {
    uint8_t status;
    while ((status = hal_host_status()) & HAL_RECEIVED) host_keep(status);
}

// To be called between any two pieces of work, and in the middle of longer ones.
ALWAYS_INLINE void poll() {
    poll_bus();
    poll_host();
}

// Looks at what has come, at a few bytes but for the end of a frame. The last bytes of a frame are waited for, so that no
// other work comes before the first bit on the bus.
void host_take();

ALWAYS_INLINE bool host_waiting() { return got_parsed != got_end || host_parser.at >= AT_CRC_LOW; }

// A status of the board is being sent: bytes of the servos wait.
extern bool replying;

// Sends one byte that waits for the host, if the transmitter has room for it.
void host_send();

// Drops a frame whose rest does not come.
void host_timeout();

// The oldest stored frame, in one piece; null when there is none.
const uint8_t* host_frame();
void host_release();

// A status of the board: begin, any number of data bytes, end; then it is on its way.
void reply_begin(uint8_t id, uint8_t error);
void reply_add(uint8_t byte);
void reply_end();

// Nothing is left to send: neither bytes of the servos nor a status.
inline bool host_idle() { return !replying && heard_sent == heard_end; }

#endif
