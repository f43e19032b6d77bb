/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Time: held until told, or after the monotonic clock.
 */
#include <poll.h>
#include <time.h>
#include <unistd.h>

#include "program.h"

enum {
    BUSY_US = 100,       /* slice of paced time while something is going on */
    IDLE_US = 1000,      /* ... and when nothing was for BUSY_FOR_US: 1000 wake-ups a second */
    BUSY_FOR_US = 5000,
    SLIP_US = 50000,     /* further behind real time than this is given up, and counted */
    ACKNOWLEDGE_MS = 50, /* how long a run waits for the servos' side before it goes on without */
};

static int64_t monotonic_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

static uint64_t due_cycle(void) {
    int64_t ns = monotonic_ns() - it.origin_ns;
    return ns > 0 ? (uint64_t)ns * CYCLES_PER_US / 1000 : 0;
}

void run_held(void) {
    while (!it.quit && !told_to_stop) {
        take_commands();
    }
}

/* Give up what cannot be caught up: the machine stood still, as a clock that was stopped. */
static void slip_if_late(void) {
    uint64_t due = due_cycle(), now = cycle_now();
    if (due > now + SLIP_US * CYCLES_PER_US) {
        it.slips++;
        it.origin_ns += (int64_t)(due - now) * 1000 / CYCLES_PER_US;
        report("origin %lld\n", (long long)it.origin_ns);
    }
}

/* Hold simulated time until the other side has seen what the bus did, so that its answer is not
 * late by however long it took to think. */
static void wait_for_acknowledgement(void) {
    int64_t until = monotonic_ns() + (int64_t)ACKNOWLEDGE_MS * 1000000;
    it.acknowledged = false;
    report("sync %llu\n", (unsigned long long)cycle_now());
    report_flush();
    while (!it.acknowledged && !it.quit && !told_to_stop) {
        int64_t left_ns = until - monotonic_ns();
        struct pollfd input = {.fd = STDIN_FILENO, .events = POLLIN};
        if (left_ns <= 0) {
            it.late_acknowledgements++;
            return;
        }
        if (poll(&input, 1, (int)(left_ns / 1000000) + 1) > 0) {
            take_commands();
        }
    }
}

static void catch_up(void) {
    uint64_t due = due_cycle();
    it.sim.stops_early = it.synchronous;
    while (cycle_now() < due && !it.quit && !told_to_stop && !it.sim.dead) {
        machine_run(&it.sim, due);
        if (it.sim.attention) {
            it.sim.attention = false;
            if (it.synchronous) {
                wait_for_acknowledgement();
            }
        }
    }
    report_flush();
}

static bool is_busy(void) {
    static uint64_t bytes_before, busy_until;
    uint64_t bytes = 0;
    bool waiting = false;
    for (int i = 0; i < USARTS; i++) {
        const usart *port = &it.sim.usarts[i];
        bytes += port->counts.rx_bytes + port->counts.tx_bytes;
        waiting = waiting || !line_empty(&port->wire) || port->sending;
    }
    if (waiting || bytes != bytes_before) {
        busy_until = cycle_now() + BUSY_FOR_US * CYCLES_PER_US;
    }
    bytes_before = bytes;
    return cycle_now() < busy_until;
}

/* Sleep to the end of the slice, or until somebody sends something. */
static void wait_for_slice(void) {
    uint64_t slice = (uint64_t)(is_busy() ? BUSY_US : IDLE_US) * CYCLES_PER_US;
    int64_t end_ns = it.origin_ns + (int64_t)(cycle_now() + slice) * 1000 / CYCLES_PER_US;
    int64_t left_ns = end_ns - monotonic_ns();
    struct timespec left = {0, left_ns > 0 ? left_ns : 0};
    struct pollfd inputs[1 + USARTS] = {{.fd = STDIN_FILENO, .events = POLLIN}};
    for (int i = 0; i < USARTS; i++) {
        bool open = it.has_terminal[i] && it.terminals[i].open; /* a closed one is always "ready" */
        inputs[1 + i] = (struct pollfd){.fd = open ? it.terminals[i].master : -1, .events = POLLIN};
    }
    if (ppoll(inputs, 1 + USARTS, &left, NULL) > 0 && inputs[0].revents) {
        take_commands();
    }
}

void run_paced(void) {
    it.origin_ns = monotonic_ns() - (int64_t)(cycle_now() * 1000 / CYCLES_PER_US);
    report("origin %lld\n", (long long)it.origin_ns);
    report_flush();
    while (!it.quit && !told_to_stop) {
        wait_for_slice();
        slip_if_late();
        for (int i = 0; i < USARTS; i++) {
            if (it.has_terminal[i]) {
                terminal_serve(&it.terminals[i], due_cycle());
            }
        }
        catch_up();
    }
}

