// The board's part of a stored frame.
#include "request.h"

#include "host.h"

void collect_begin(Collector& collector, Request& request, const uint8_t* frame) {
    const uint16_t length = stored_length(frame);
    const uint8_t instruction = frame[STORED_INSTRUCTION];
    collector.at = frame + STORED_PARAMETERS;
    collector.left = length - FRAME_MIN_LENGTH;
    collector.count = 0;
    collector.stuffing.run = 0;
    request.answered = frame[STORED_ID] == BOARD_ID;
    collector.sync = instruction == DXL_SYNC_WRITE && !request.answered;
    collector.listed = false;
    collector.size = 0;
    collector.in_entry = 0;
    collector.ours = false;
    request.instruction = collector.sync ? static_cast<uint8_t>(DXL_WRITE) : instruction;
    request.damaged = frame[0] == STORED_DAMAGED;
    request.size = 0;
}

static void add(Request& request, uint8_t byte) {
    if (request.size < REQUEST_DATA) request.data[request.size] = byte;
    ++request.size;
}

// address u16 | size u16 | {id | data}... (e-manual, Protocol 2.0, "Sync Write"): the Write it means for the board.
static void add_of_sync(Collector& collector, Request& request, uint8_t byte) {
    switch (collector.count) {
        case 0:
        case 1:
            add(request, byte);
            return;
        case 2:
            collector.size = byte;
            return;
        case 3:
            collector.size |= static_cast<uint16_t>(byte) << 8;
            return;
        default:
            break;
    }
    if (collector.in_entry == 0) {
        // An id only counts once.
        collector.ours = byte == BOARD_ID && !collector.listed;
        collector.listed = collector.listed || collector.ours;
    } else if (collector.ours) {
        add(request, byte);
    }
    collector.in_entry = collector.in_entry == collector.size ? 0 : collector.in_entry + 1;
}

bool collect_step(Collector& collector, Request& request) {
    if (collector.left == 0) return false;
    const uint8_t byte = *collector.at++;
    --collector.left;
    if (stuffing_drops(collector.stuffing, byte)) return true;
    if (collector.sync) {
        add_of_sync(collector, request, byte);
    } else {
        add(request, byte);
    }
    ++collector.count;
    return true;
}
