// Where each frame of the host goes: to the bus, to the board itself, or both; one after the other, never two answers at once.
#ifndef ROUTER_H
#define ROUTER_H

#include <stdint.h>

#include "frame.h"

void router_start();

// Only then router_step has anything to do: not while it waits for statuses.
extern bool router_due;

// One step of the frame in work: send, wait for statuses, carry out, answer.
void router_step();

// A whole frame has come from the host and is about to be stored: begins to send it when it can go straight to the bus, since
// the time from here to its first bit is what the host waits for.
void router_arrived(const Parser& parser, const uint8_t* begin, const uint8_t* end);

// It has been stored.
void router_frame_stored();

// The silence on the bus has been measured anew.
void router_silence();

// A servo's status has come in, with its error byte.
void router_status(uint8_t id, uint8_t error);

// The servos are to hold: as soon as the bus is free.
void router_hold();

#endif
