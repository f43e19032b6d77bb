/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Lines on standard input; README.md has them all.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "program.h"

static bool do_put(const char *text) {
    int number, length = 0;
    unsigned long long cycle;
    if (sscanf(text, "%d %llu %n", &number, &cycle, &length) != 2 || number < 0 ||
        number >= USARTS || !length) {
        return false;
    }
    for (const char *at = text + length; at[0] && at[1]; at += 2) {
        char pair[3] = {at[0], at[1], '\0'};
        usart_put(&it.sim.usarts[number], cycle, (uint8_t)strtoul(pair, NULL, 16));
    }
    return true;
}

static bool do_rate(const char *text) {
    int number;
    long long baud;
    if (sscanf(text, "%d %lld", &number, &baud) != 2 || number < 0 || number >= USARTS || baud < 0) {
        return false;
    }
    it.sim.usarts[number].host_bit = baud ? (int64_t)CLOCK_HZ * WIRE_PER_CYCLE / baud : 0;
    return true;
}

static bool do_drive(const char *text) {
    char name[4];
    int level;
    unsigned long long cycle;
    if (sscanf(text, "%3s %d %llu", name, &level, &cycle) != 3 || level < -1 || level > 1) {
        return false;
    }
    pin *which = pin_named(&it.sim, name);
    return which && pin_drive(which, level, cycle);
}

static bool do_watch(const char *text) {
    pin *which = pin_named(&it.sim, text);
    if (which) {
        pin_watch(which);
    }
    return which;
}

static bool do_run(const char *text, bool stops_early) {
    unsigned long long target;
    if (sscanf(text, "%llu", &target) != 1 || it.paced) {
        return false;
    }
    it.sim.stops_early = stops_early;
    machine_run(&it.sim, target);
    it.sim.attention = false;
    report("at %llu\n", (unsigned long long)cycle_now());
    return true;
}

static bool do_memory(const char *text) {
    unsigned address, count;
    if (sscanf(text, "%u %u", &address, &count) != 2 || count > 1024 ||
        address + count > it.sim.avr->ramend + 1u) {
        return false;
    }
    char hex[2 * 1024 + 1] = "";
    for (unsigned i = 0; i < count; i++) {
        snprintf(hex + 2 * i, 3, "%02x", it.sim.avr->data[address + i]);
    }
    report("memory %s\n", hex);
    return true;
}

static void do_stats(void) {
    report("stats cycle=%llu resets=%llu slips=%llu late_acknowledgements=%llu stack_bytes=%d",
           (unsigned long long)cycle_now(), (unsigned long long)it.sim.resets,
           (unsigned long long)it.slips, (unsigned long long)it.late_acknowledgements,
           machine_stack_bytes(&it.sim));
    for (int i = 0; i < USARTS; i++) {
        const usart_counts *n = &it.sim.usarts[i].counts;
        const struct { const char *name; uint64_t value; } FIELDS[] = {
            {"rx_bytes", n->rx_bytes},     {"tx_bytes", n->tx_bytes},
            {"overruns", n->overruns},     {"framing", n->framing},
            {"collisions", n->collisions}, {"tx_lost", n->tx_lost},
            {"tx_ignored", n->tx_ignored}, {"line_full", n->line_full},
            {"opens", it.terminals[i].opens}, {"dropped", it.terminals[i].dropped},
        };
        for (size_t k = 0; k < sizeof FIELDS / sizeof FIELDS[0]; k++) {
            report(" %s%d=%llu", FIELDS[k].name, i, (unsigned long long)FIELDS[k].value);
        }
    }
    report("\n");
}

/* Obey one line; false when it makes no sense. */
static bool obey(const char *text) {
    if (strncmp(text, "to ", 3) == 0) {
        return do_run(text + 3, true);
    } else if (strncmp(text, "through ", 8) == 0) {
        return do_run(text + 8, false);
    } else if (strncmp(text, "put ", 4) == 0) {
        return do_put(text + 4);
    } else if (strncmp(text, "rate ", 5) == 0) {
        return do_rate(text + 5);
    } else if (strncmp(text, "drive ", 6) == 0) {
        return do_drive(text + 6);
    } else if (strncmp(text, "watch ", 6) == 0) {
        return do_watch(text + 6);
    } else if (strncmp(text, "memory ", 7) == 0) {
        return do_memory(text + 7);
    } else if (strcmp(text, "reset") == 0) {
        machine_reset(&it.sim);
    } else if (strcmp(text, "stats") == 0) {
        do_stats();
    } else if (strcmp(text, "ack") == 0) {
        it.acknowledged = true;
    } else if (strcmp(text, "quit") == 0) {
        it.quit = true;
    } else {
        return false;
    }
    return true;
}

static void obey_lines(void) {
    char *start = it.command, *end;
    it.command[it.command_used] = '\0';
    while ((end = strchr(start, '\n'))) {
        *end = '\0';
        if (!obey(start)) {
            report("wrong %s\n", start);
        }
        start = end + 1;
    }
    it.command_used -= (size_t)(start - it.command);
    memmove(it.command, start, it.command_used);
}

/* Read and obey what has come on standard input; its end, or a line without end, ends it all. */
void take_commands(void) {
    size_t room = COMMAND_BYTES - 1 - it.command_used;
    ssize_t count = read(STDIN_FILENO, it.command + it.command_used, room);
    if (count > 0) {
        it.command_used += (size_t)count;
        obey_lines();
        report_flush();
    } else if (count == 0 || errno != EINTR) {
        it.quit = true;
    }
}

