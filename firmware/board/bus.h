// The servo bus, UART1: half duplex with a direction pin. Sends one frame at a time; sends on to the host each byte it hears, and
// follows what the servos say.
#ifndef BUS_H
#define BUS_H

#include <stdint.h>

#include "frame.h"
#include "hal.h"

void bus_start();

// From bus_send on, until the last stop bit has gone and the pin has been released.
extern bool driving;

// Begins to send the bytes from `begin` to `end`, which have to stay.
void bus_send(const uint8_t* begin, const uint8_t* end);

// What the servos say at present; AT_START between their frames.
extern Parser bus_parser;

// Bytes heard, until they have gone to the host and have been looked at. The indices wrap with the ring, one place stays free.
extern uint8_t heard_end;
extern uint8_t heard_sent;
extern uint8_t heard_parsed;

// In the middle of a servo's frame, or not known yet.
ALWAYS_INLINE bool bus_hearing() { return bus_parser.at > AT_ID || heard_parsed != heard_end; }

void bus_transmit();
void bus_take(uint8_t status);

// Sends a byte, or takes those that have come. One heard may wait 5 us for it, less what sending it on takes.
ALWAYS_INLINE void poll_bus() {
    if (driving) {
        bus_transmit();
        return;
    }
    uint8_t status;
    while ((status = hal_bus_status()) & HAL_RECEIVED) bus_take(status);
}

// Looks at the oldest byte heard that has not been looked at.
void bus_parse();

// Sends on the oldest byte that the host has not got.
void bus_forward();

// Measures the silence; gives up a frame of a servo whose rest does not come.
void bus_timeout();

// Microseconds of silence on the bus, as of the last call of bus_timeout.
extern uint16_t bus_quiet_us;

#endif
