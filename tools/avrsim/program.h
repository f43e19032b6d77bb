/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * The running program: what main.c sets up, commands.c obeys for and pace.c drives in time.
 */
#ifndef PROGRAM_H
#define PROGRAM_H

#include <signal.h>

#include "avrsim.h"

enum { COMMAND_BYTES = 65536, CYCLES_PER_US = CLOCK_HZ / 1000000 };

typedef struct {
    machine sim;
    terminal terminals[USARTS];
    bool has_terminal[USARTS];
    const char *links[USARTS];
    const char *hex, *boot, *eeprom;
    bool paced, synchronous, resets_on_open, acknowledged, quit;
    int64_t origin_ns; /* monotonic time of cycle 0 */
    uint64_t slips, late_acknowledgements;
    char command[COMMAND_BYTES];
    size_t command_used;
} program;

extern program it;
extern volatile sig_atomic_t told_to_stop;

uint64_t cycle_now(void);
void take_commands(void);
void run_held(void);
void run_paced(void);

#endif
