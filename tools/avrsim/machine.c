/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * The chip as a whole: power, resets and their causes, runs to an exact cycle, memories.
 */
#include "avrsim.h"

#include <simavr/avr_eeprom.h>
#include <simavr/avr_extint.h>
#include <stdio.h>
#include <string.h>

enum {
    MCUSR = 0x54,         /* data address */
    RAM_START = 0x200,    /* data sheet, figure 8-2 */
    PAINT = 0xC5,         /* RAM at power-up, to see afterwards how deep the stack went */
    PAINT_RUN = 32,       /* so many painted bytes in a row were never used */
    VECTORS = 57,         /* data sheet, table 14-1 */
    ENTRY_CYCLES = 5,     /* interrupt entry with a 22-bit program counter, data sheet 7.8.1 */
    RUN_CYCLES = 1000,    /* cycles in one call of the core; 1, its default, is 1.5 times slower */
    EXTERNAL_INTERRUPTS = 8,
};

static avr_cycle_count_t on_target(avr_t *avr, avr_cycle_count_t when, void *param) {
    (void)avr;
    (void)when;
    (void)param;
    return 0; /* its being there is enough: the core stops at timers */
}

static void leave_run(machine *sim) {
    sim->stop = true;
    sim->avr->run_cycle_count = 0;
}

static avr_cycle_count_t on_attention(avr_t *avr, avr_cycle_count_t when, void *param) {
    machine *sim = param;
    (void)avr;
    (void)when;
    sim->attention_at = 0;
    sim->attention = true;
    if (sim->stops_early) {
        leave_run(sim);
    }
    return 0;
}

/* Let the caller look at `at_cycle`; a later instant asked for replaces an earlier one. */
void machine_attend(machine *sim, uint64_t at_cycle) {
    uint64_t now = sim->avr->cycle;
    if (at_cycle <= now) {
        on_attention(sim->avr, now, sim);
        return;
    }
    sim->attention_at = at_cycle;
    avr_cycle_timer_register(sim->avr, at_cycle - now, on_attention, sim);
}

/* Libsimavr enters an interrupt in no time. */
static void on_interrupt(avr_irq_t *irq, uint32_t value, void *param) {
    machine *sim = param;
    (void)irq;
    if (value) {
        avr_t *avr = sim->avr;
        avr->cycle += ENTRY_CYCLES;
        bool room = avr->run_cycle_count > ENTRY_CYCLES;
        avr->run_cycle_count = room ? avr->run_cycle_count - ENTRY_CYCLES : 0;
    }
}

static void write_reset_flags(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    machine *sim = param;
    sim->reset_flags &= value; /* flags are cleared by writing 0, and cannot be set */
    avr->data[address] = sim->reset_flags;
}

/* Called by libsimavr in the middle of every reset; `finish_reset` does the rest after it. */
static void (*stock_reset)(avr_t *avr);
static machine *resetting;

static void note_reset(avr_t *avr) {
    if (stock_reset) {
        stock_reset(avr);
    }
    resetting->was_reset = true;
}

static void stay_awake(avr_t *avr, avr_cycle_count_t cycles) {
    (void)avr;
    (void)cycles; /* the caller paces, the simulator never waits */
}

static void log_nothing(avr_t *avr, const int level, const char *format, va_list values) {
    (void)avr;
    (void)level;
    (void)format;
    (void)values;
}

/* Undo what a reset of libsimavr sets back or gets wrong. */
static void finish_reset(machine *sim) {
    avr_t *avr = sim->avr;
    sim->was_reset = false;
    sim->resets++;
    sim->reset_flags |= sim->reset_cause;
    avr->data[MCUSR] = sim->reset_flags;
    avr->run_cycle_limit = RUN_CYCLES;
    avr->run_cycle_count = 1;
    for (uint8_t i = 0; i < EXTERNAL_INTERRUPTS; i++) {
        /* Otherwise a low pin starts a callback every cycle, interrupt enabled or not. */
        avr_extint_set_strict_lvl_trig(avr, i, 0);
    }
    for (int i = 0; i < USARTS; i++) {
        usart_reset(&sim->usarts[i]);
    }
    report("reset %llu %d\n", (unsigned long long)avr->cycle, sim->reset_cause);
    pins_reset(sim);
    if (sim->attention_at > avr->cycle) {
        machine_attend(sim, sim->attention_at);
    }
    if (sim->target > avr->cycle) {
        avr_cycle_timer_register(avr, sim->target - avr->cycle, on_target, sim);
    }
    sim->reset_cause = CAUSE_WATCHDOG; /* the only reset that comes from inside */
}

bool machine_make(machine *sim) {
    avr_global_logger_set(log_nothing);
    sim->avr = avr_make_mcu_by_name("atmega2560");
    if (!sim->avr || avr_init(sim->avr) != 0) {
        fprintf(stderr, "libsimavr has no ATmega2560\n");
        return false;
    }
    avr_t *avr = sim->avr;
    avr->frequency = CLOCK_HZ;
    avr->log = LOG_NONE;
    avr->sleep = stay_awake;
    avr->codeend = avr->flashend;
    stock_reset = avr->reset;
    resetting = sim;
    avr->reset = note_reset;
    avr->io[AVR_DATA_TO_IO(MCUSR)].w.c = write_reset_flags;
    avr->io[AVR_DATA_TO_IO(MCUSR)].w.param = sim;
    for (uint8_t vector = 1; vector < VECTORS; vector++) {
        avr_irq_t *irq = avr_get_interrupt_irq(avr, vector);
        if (irq) {
            avr_irq_register_notify(irq + AVR_INT_IRQ_RUNNING, on_interrupt, sim);
        }
    }
    for (int i = 0; i < USARTS; i++) {
        usart_attach(sim, &sim->usarts[i], i);
    }
    pins_attach(sim);
    return true;
}

static void reset_by(machine *sim, uint8_t cause) {
    sim->reset_cause = cause;
    avr_reset(sim->avr);
    finish_reset(sim);
}

void machine_power_up(machine *sim) {
    memset(sim->avr->data + RAM_START, PAINT, sim->avr->ramend + 1 - RAM_START);
    reset_by(sim, CAUSE_POWER);
    sim->resets = 0;
}

void machine_reset(machine *sim) {
    reset_by(sim, CAUSE_EXTERNAL);
}

/* Run to a cycle, landing on it or on the end of the instruction that spans it. */
void machine_run(machine *sim, uint64_t target_cycle) {
    avr_t *avr = sim->avr;
    sim->stop = sim->attention && sim->stops_early;
    if (sim->dead || avr->cycle >= target_cycle || sim->stop) {
        return;
    }
    sim->target = target_cycle;
    avr_cycle_timer_register(avr, target_cycle - avr->cycle, on_target, sim);
    avr->run_cycle_count = 1;
    while (avr->cycle < target_cycle && !sim->stop) {
        int state = avr_run(avr);
        if (sim->was_reset) {
            finish_reset(sim);
        }
        if (state == cpu_Done || state == cpu_Crashed || state == cpu_Stopped) {
            sim->dead = true;
            report("dead %llu %x\n", (unsigned long long)avr->cycle, avr->pc);
            return;
        }
    }
    avr_cycle_timer_cancel(avr, on_target, sim);
}

/* Bytes at the top of RAM that have been used since power-up. */
int machine_stack_bytes(const machine *sim) {
    const uint8_t *data = sim->avr->data;
    int painted = 0;
    for (int at = sim->avr->ramend; at >= RAM_START; at--) {
        painted = data[at] == PAINT ? painted + 1 : 0;
        if (painted == PAINT_RUN) {
            return sim->avr->ramend + 1 - at - PAINT_RUN;
        }
    }
    return sim->avr->ramend + 1 - RAM_START;
}

/* A missing file is a new chip, whose bytes are FF. */
bool machine_load_eeprom(machine *sim, const char *path) {
    uint8_t bytes[4096];
    FILE *file = fopen(path, "rb");
    if (!file) {
        return true;
    }
    size_t count = fread(bytes, 1, sizeof bytes, file);
    fclose(file);
    if (count != sizeof bytes) {
        fprintf(stderr, "%s: has %zu bytes, an EEPROM image has %zu\n", path, count, sizeof bytes);
        return false;
    }
    avr_eeprom_desc_t image = {.ee = bytes, .offset = 0, .size = sizeof bytes};
    avr_ioctl(sim->avr, AVR_IOCTL_EEPROM_SET, &image);
    return true;
}

bool machine_save_eeprom(machine *sim, const char *path) {
    uint8_t bytes[4096];
    avr_eeprom_desc_t image = {.ee = bytes, .offset = 0, .size = sizeof bytes};
    avr_ioctl(sim->avr, AVR_IOCTL_EEPROM_GET, &image);
    FILE *file = fopen(path, "wb");
    if (!file) {
        perror(path);
        return false;
    }
    bool whole = fwrite(bytes, 1, sizeof bytes, file) == sizeof bytes;
    return fclose(file) == 0 && whole;
}
