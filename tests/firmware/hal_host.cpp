// The board's registers on a PC. Time goes on by half a microsecond with each look at a UART, about what a look costs there.
#include "hal_host.h"

#include <stdio.h>

#include <deque>

#include "played.h"

static const uint64_t BYTE_TICKS = 20;  // ten bits at 1 Mbaud

struct Arrival {
    uint64_t at;
    uint8_t byte;
};

struct Uart {
    std::deque<Arrival> coming;
    uint64_t last_arrival;
    uint64_t sent_until;
    bool overrun;
};

static Uart host;
static Uart bus;
static std::deque<std::deque<uint8_t> > replies;
static uint64_t reply_delay;
static bool driving_pin;
static bool wrist_ok;
static uint8_t pins;
static bool captured;
static uint64_t captured_at;
uint64_t played_now;

void played_restart() {
    host = Uart();
    bus = Uart();
    host.sent_until = bus.sent_until = played_now;
    replies.clear();
    driving_pin = wrist_ok = captured = false;
}

static void arrive(Uart& uart, uint64_t from, uint8_t byte) {
    const uint64_t start = from > uart.last_arrival ? from : uart.last_arrival;
    uart.last_arrival = start + BYTE_TICKS;
    uart.coming.push_back(Arrival{uart.last_arrival, byte});
}

void played_from_host(uint8_t byte) { arrive(host, played_now, byte); }
void played_from_bus(uint8_t byte) { arrive(bus, played_now, byte); }
void played_overrun(bool of_bus) { (of_bus ? bus : host).overrun = true; }

void played_reply(const std::deque<uint8_t>& bytes, uint64_t delay_ticks) {
    replies.push_back(bytes);
    reply_delay = delay_ticks;
}

void played_pin(uint8_t mask, bool high) {
    if (mask == HAL_KNOT && high != ((pins & HAL_KNOT) != 0)) {
        captured = true;
        captured_at = played_now;
    }
    pins = high ? pins | mask : pins & ~mask;
}

static uint8_t status(Uart& uart) {
    ++played_now;
    uint8_t flags = 0;
    if (!uart.coming.empty() && uart.coming.front().at <= played_now) flags |= HAL_RECEIVED;
    if (uart.sent_until < played_now + BYTE_TICKS) flags |= HAL_READY;
    if (uart.sent_until <= played_now) flags |= HAL_SENT;
    if (uart.overrun) flags |= HAL_OVERRUN;
    return flags;
}

static uint8_t take(Uart& uart) {
    uart.overrun = false;
    const uint8_t byte = uart.coming.front().byte;
    uart.coming.pop_front();
    return byte;
}

static void send(Uart& uart, char name, uint8_t byte) {
    if (uart.sent_until >= played_now + BYTE_TICKS) played_event('!', 0);
    uart.sent_until = (uart.sent_until > played_now ? uart.sent_until : played_now) + BYTE_TICKS;
    played_event(name, byte);
}

void hal_start() {}
void hal_reset() { throw Reset(); }
uint16_t hal_resets() { return 1; }
uint16_t hal_reset_cause() { return 0x02; }
uint16_t hal_stack_free() { return 4000; }
void hal_alive() {}
uint16_t hal_ticks() { return static_cast<uint16_t>(++played_now); }
uint8_t hal_host_status() { return status(host); }
uint8_t hal_host_read() { return take(host); }
void hal_host_write(uint8_t byte) { send(host, 'h', byte); }
uint8_t hal_bus_status() { return status(bus); }
uint8_t hal_bus_read() { return take(bus); }

void hal_bus_write(uint8_t byte) {
    if (!driving_pin) played_event('!', 1);
    send(bus, 'b', byte);
}

void hal_bus_drive() {
    driving_pin = true;
    played_event('d', 1);
}

void hal_bus_release() {
    if (bus.sent_until > played_now) played_event('!', 2);
    driving_pin = false;
    played_event('d', 0);
    if (replies.empty()) return;
    for (uint8_t byte : replies.front()) arrive(bus, played_now + reply_delay, byte);
    replies.pop_front();
}

uint8_t hal_lines() { return pins; }

void hal_wrist_ok(bool on) {
    if (on != wrist_ok) played_event('w', on);
    wrist_ok = on;
}

bool hal_captured() { return captured; }

uint16_t hal_capture() {
    captured = false;
    return static_cast<uint16_t>(captured_at);
}
