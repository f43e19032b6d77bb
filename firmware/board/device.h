// The board as a device of its own, id 200: its control table and what the instructions do with it. Knows no port.
#ifndef DEVICE_H
#define DEVICE_H

#include <stdint.h>

#include "board_table.h"
#include "frame.h"

// The live table: modules write their items, a Read copies them.
extern BoardTable table;

// No item has more bytes, and a Write spans one item.
const uint8_t REQUEST_DATA = 8;

// An instruction to the board, unstuffed.
struct Request {
    uint8_t instruction;
    bool damaged;
    bool answered;  // false for a broadcast
    uint8_t data[REQUEST_DATA];
    uint16_t size;  // parameters that came; only REQUEST_DATA are kept
};

// What becomes of it.
struct Answer {
    bool wanted;
    bool reboot;
    uint8_t error;
    uint8_t data[3];    // of a Ping
    uint8_t data_size;
    uint8_t begin;      // of the table, for a Read
    uint8_t end;
};

void device_start();
void device_execute(const Request& request, Answer& answer);

#endif
