// Where each frame of the host goes.
#include "router.h"

#include "bus.h"
#include "device.h"
#include "goals.h"
#include "hal.h"
#include "host.h"
#include "lines.h"
#include "request.h"
#include "watchdog.h"

// An XL430 begins its status 508 us after an instruction at the latest (e-manual, "Return Delay Time" 254) and pauses
// 1.5 ms at most within one; three milliseconds of silence mean that nothing more comes.
static const uint16_t STATUS_US = 3000;

// After a broadcast Ping the servos answer in turn; dynamixel-sdk allows each id 3 ms.
static const uint16_t PING_US = 5000;

// Two bytes at 57,600 baud, which UART0 may still hold when nothing is left to send.
static const uint16_t LAST_BYTES_TICKS = 350 * TICKS_PER_US;

// Bytes collected in one step.
static const uint8_t BYTES_A_STEP = 4;

// A servo that goes on talking does not keep a Reboot waiting for longer.
static const uint16_t RESET_TICKS = 20000u * TICKS_PER_US;

// Unit of Return Delay Time (e-manual, XL430-W250).
static const uint8_t DELAY_TICKS = 2 * TICKS_PER_US;

// Broadcast Write of Bus Watchdog = 1: each servo with torque on stops 20 ms later and refuses goals
// until 0 is written there. CRC by dynamixel-sdk.
static const uint8_t HOLD[] = {0xFF, 0xFF, 0xFD, 0x00, 0xFE, 0x06, 0x00, 0x03, 0x62, 0x00, 0x01, 0x83, 0x94};

enum State : uint8_t { IDLE, HOLDING, WORKING, ANSWERING, COPYING, SENDING, RESETTING };

static uint8_t state;
static bool hold_due;
bool router_due;
static bool idle;  // no frame in work or waiting
static const uint8_t* frame;
static bool sent;  // the frame that came last is on its way to the bus already
static bool collecting;
static bool to_board;
static bool until_quiet;  // statuses of unknown number: a broadcast Ping
static uint8_t expected;  // statuses to the frame on the bus
static uint8_t came;  // of these; may be known before they are expected
static uint16_t began;
static uint16_t reset_asked;
static Request request;
static Collector collector;
static Answer answer;

void router_start() {
    state = IDLE;
    hold_due = false;
    router_due = false;
    idle = true;
    sent = false;
}

void router_hold() { hold_due = router_due = true; }

void router_silence() {
    if (state == WORKING && bus_quiet_us >= STATUS_US) router_due = true;
}

void router_frame_stored() {
    router_due = true;
    idle = false;
}

void router_status(uint8_t id, uint8_t error) {
    if (++came >= expected) router_due = true;
    if (!(error & ALERT) || (table.faults & FAULTS_SERVO)) return;
    table.faults |= FAULTS_SERVO;
    table.alert_id = id;
    table.outputs = 0;  // wrist ok follows with the next lines_output
}

static void begin_reset() {
    state = RESETTING;
    began = reset_asked = hal_ticks();
}

static void finish() {
    poll();
    host_release();
    state = IDLE;
    router_due = hold_due || host_frame() != nullptr;
    idle = !router_due;
}

static void send_to_bus(uint8_t statuses) {
    expected = statuses;
    if (!sent) {
        came = 0;
        bus_send(frame + STORED_HEADER, frame + STORED_INSTRUCTION + stored_length(frame));
    }
    sent = false;
}

static void take_for_board() {
    poll();
    to_board = true;
    collecting = true;
    collect_begin(collector, request, frame);
}

// A goal while in the safe state: answered as a servo whose Bus Watchdog has tripped would, with error 4.
static void refuse(uint8_t id) {
    ++table.refused_frames;
    sent = false;
    if (id == BROADCAST_ID) {
        finish();
        return;
    }
    answer.wanted = true;
    answer.reboot = false;
    answer.error = RANGE_ERROR;
    answer.data_size = 0;
    answer.begin = answer.end = 0;
    request.answered = false;  // not in the board's own name
    began = hal_ticks();
    state = ANSWERING;
}

// Statuses that servos owe for a broadcast, by the number of ids it lists. Where the board is listed among servos its
// place in the turn stays silent.
static uint8_t statuses_of_list(uint8_t instruction) {
    const uint16_t parameters = stored_length(frame) - FRAME_MIN_LENGTH;
    switch (instruction) {
        case DXL_SYNC_READ:
            return parameters > 4 ? parameters - 4 : 0;
        case DXL_BULK_READ: {
            uint8_t count = 0;
            for (uint16_t left = parameters; left >= 5; left -= 5) ++count;
            return count;
        }
        case DXL_FAST_SYNC_READ:
        case DXL_FAST_BULK_READ:
            return 1;
        default:
            return 0;
    }
}

// address u16 | size u16 | one id
static bool lists_one(uint8_t instruction, uint16_t length) {
    return instruction == DXL_SYNC_READ && length == FRAME_MIN_LENGTH + 5;
}

static bool lists_board_alone(uint8_t instruction) {
    return lists_one(instruction, stored_length(frame)) && frame[STORED_PARAMETERS + 4] == BOARD_ID;
}

// Whether the board can be listed at all, which takes less time to find out than whether it is.
static bool mentions_board() {
    const uint8_t* at = frame + STORED_PARAMETERS;
    const uint8_t* const end = frame + STORED_INSTRUCTION + stored_length(frame);
    while (at != end) {
        if (*at++ == BOARD_ID) return true;
        if ((reinterpret_cast<uintptr_t>(at) & 3) == 0) poll();
    }
    return false;
}

// Whatever is begun here, dispatch sends: nothing in between changes what both of them ask.
void router_arrived(const Parser& parser, const uint8_t* begin, const uint8_t* end) {
    if (!idle || hold_due || in_safe_state() || parser.id == BOARD_ID || bus_hearing()) return;
    const uint8_t last_parameter = end[-3];
    if (last_parameter == BOARD_ID && parser.id == BROADCAST_ID && lists_one(parser.instruction, frame_length(parser))) return;
    bus_send(begin + STORED_HEADER, end);
    came = 0;
    sent = true;
}

static void broadcast(uint8_t instruction) {
    if (lists_board_alone(instruction)) {
        take_for_board();
        return;
    }
    send_to_bus(statuses_of_list(instruction));
    poll();
    switch (instruction) {
        case DXL_PING:
            until_quiet = true;
            expected = 1;
            take_for_board();
            break;
        case DXL_WRITE:
        case DXL_REG_WRITE:
        case DXL_ACTION:
        case DXL_REBOOT:
            take_for_board();
            break;
        case DXL_SYNC_WRITE:
            if (mentions_board()) take_for_board();
            break;
        default:
            break;
    }
}

static void dispatch() {
    poll();
    frame = host_frame();
    const uint8_t id = frame[STORED_ID];
    const uint8_t instruction = frame[STORED_INSTRUCTION];
    if (id != BOARD_ID && !driving && bus_hearing()) return;
    expected = 0;
    until_quiet = false;
    collecting = false;
    to_board = false;
    state = WORKING;
    if (id == BOARD_ID) {
        take_for_board();
    } else if (in_safe_state() && carries_goal(frame)) {
        refuse(id);
    } else if (id == BROADCAST_ID) {
        broadcast(instruction);
    } else {
        send_to_bus(instruction == DXL_STATUS ? 0 : 1);
    }
}

static void start_next() {
    if (hold_due) {
        if (driving || bus_hearing()) return;
        hold_due = false;
        expected = 0;
        idle = false;
        bus_send(HOLD, HOLD + sizeof HOLD);
        state = HOLDING;
    } else if (host_frame() != nullptr) {
        dispatch();
    } else {
        router_due = false;
        idle = true;
    }
}

// True while servos may still answer.
static bool waiting() {
    if (expected == 0 || (!until_quiet && came >= expected)) return false;
    if (bus_quiet_us < (until_quiet ? PING_US : STATUS_US)) {
        router_due = collecting;
        return true;
    }
    if (!until_quiet) ++table.bus_timeouts;
    expected = 0;
    return false;
}

static void execute() {
    if (collector.sync && !collector.listed) {
        finish();
        return;
    }
    if (!request.answered && request.instruction == DXL_SYNC_READ) {
        // Only one that lists the board alone comes here: a Read.
        request.instruction = DXL_READ;
        request.size = 4;
        request.answered = true;
    }
    if (request.instruction == DXL_PING) request.answered = true;
    poll();
    device_execute(request, answer);
    poll();
    began = hal_ticks();
    if (answer.wanted) {
        state = ANSWERING;
    } else if (answer.reboot) {
        begin_reset();
    } else {
        finish();
    }
}

static void work() {
    for (uint8_t bytes = BYTES_A_STEP; collecting && bytes != 0; --bytes) {
        collecting = collect_step(collector, request);
        poll();
    }
    if (driving || waiting() || collecting) return;
    if (to_board) {
        execute();
    } else {
        finish();
    }
}

static void begin_answer() {
    const uint16_t wait = request.answered ? table.return_delay_time * DELAY_TICKS : 0;
    if (static_cast<uint16_t>(hal_ticks() - began) < wait || !host_idle()) return;
    reply_begin(request.answered ? BOARD_ID : frame[STORED_ID], answer.error);
    poll();
    for (uint8_t i = 0; i < answer.data_size; ++i) reply_add(answer.data[i]);
    state = COPYING;
}

// Up to the next multiple of four, so that no item is torn.
static void copy() {
    const uint8_t* bytes = reinterpret_cast<const uint8_t*>(&table);
    while (answer.begin != answer.end) {
        reply_add(bytes[answer.begin++]);
        poll();
        if ((answer.begin & 3) == 0) return;
    }
    state = SENDING;
}

static void send_answer() {
    // A servo that speaks late must not have its status cut in two by ours.
    if (bus_parser.at != AT_START || bus_hearing() || !host_idle()) return;
    reply_end();
    if (answer.reboot) {
        begin_reset();
    } else {
        finish();
    }
}

static void reset() {
    table.arm = 0;
    lines_output();
    const uint16_t now = hal_ticks();
    if (!host_idle()) began = now;
    const bool done = static_cast<uint16_t>(now - began) >= LAST_BYTES_TICKS;
    if (done || static_cast<uint16_t>(now - reset_asked) >= RESET_TICKS) hal_reset();
}

void router_step() {
    switch (state) {
        case IDLE:
            start_next();
            break;
        case HOLDING:
            if (!driving) state = IDLE;
            break;
        case WORKING:
            work();
            break;
        case ANSWERING:
            begin_answer();
            break;
        case COPYING:
            copy();
            break;
        case SENDING:
            send_answer();
            break;
        default:
            reset();
    }
}
