// What drives the played registers: the other ends of the wires.
#ifndef PLAYED_H
#define PLAYED_H

#include <stdint.h>

#include <deque>

struct Reset {};

// Half microseconds.
extern uint64_t played_now;

void played_restart();
void played_from_host(uint8_t byte);
void played_from_bus(uint8_t byte);

// Queued for the next time the board releases the bus.
void played_reply(const std::deque<uint8_t>& bytes, uint64_t delay_ticks);
void played_overrun(bool of_bus);
void played_pin(uint8_t mask, bool high);

// In the driver: h byte to the host, b byte to the bus, d direction, w wrist ok, ! something no board may do.
void played_event(char what, uint8_t value);

#endif
