// Takes the board's part out of a stored frame: unstuffed parameters, and out of a Sync Write the data of id 200. One byte per step.
#ifndef REQUEST_H
#define REQUEST_H

#include "device.h"
#include "frame.h"

struct Collector {
    const uint8_t* at;  // in the stored frame
    uint16_t left;  // stuffed parameter bytes still to come
    uint16_t count; // unstuffed ones that came
    Stuffing stuffing;
    bool sync;       // a Sync Write, not a Write
    bool listed;     // it lists the board
    uint16_t size;   // bytes for each device of a Sync Write
    uint16_t in_entry;
    bool ours;
};

void collect_begin(Collector& collector, Request& request, const uint8_t* frame);

// Takes one byte; false when all have been taken.
bool collect_step(Collector& collector, Request& request);

#endif
