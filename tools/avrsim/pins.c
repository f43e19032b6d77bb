/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Pins: edges out with their cycle, levels in at their cycle, and both right across resets.
 */
#include <simavr/avr_ioport.h>
#include <string.h>

#include "avrsim.h"

static const char PORT_NAMES[PORTS + 1] = "ABCDEFGHJKL";

/* Data address of PINx; data sheet, register summary. DDRx and PORTx follow it. */
static const uint16_t PIN_ADDRESS[PORTS] = {0x20, 0x23, 0x26, 0x29, 0x2C, 0x2F,
                                            0x32, 0x100, 0x103, 0x106, 0x109};

static avr_cycle_count_t on_drive(avr_t *avr, avr_cycle_count_t when, void *param);

static int port_index(char name) {
    const char *found = name ? strchr(PORT_NAMES, name) : NULL;
    return found ? (int)(found - PORT_NAMES) : -1;
}

/* The pin called, say, "E4"; NULL when there is none. */
pin *pin_named(machine *sim, const char *name) {
    int port = port_index(name[0]);
    bool valid = port >= 0 && name[1] >= '0' && name[1] <= '7' && name[2] == '\0';
    return valid ? &sim->pins[port][name[1] - '0'] : NULL;
}

static void changed(pin *which, int level) {
    machine *sim = which->sim;
    if (level == which->level) {
        return;
    }
    which->level = level;
    if (which == sim->direction) {
        sim->direction_since = sim->avr->cycle;
    }
    if (which->watched) {
        report("pin %c%d %llu %d\n", which->port, which->bit,
               (unsigned long long)sim->avr->cycle, level);
        machine_attend(sim, sim->avr->cycle);
    }
}

static void on_level(avr_irq_t *irq, uint32_t value, void *param) {
    pin *which = param;
    (void)irq;
    if (which->driven < 0) {
        changed(which, value & 1);
    }
}

/* Keep up with the level that the firmware gives a pin. */
void pin_follow(pin *which) {
    if (!which->hooked) {
        which->hooked = true;
        avr_irq_register_notify(which->irq, on_level, which);
    }
}

/* Report each edge that the firmware makes. */
void pin_watch(pin *which) {
    which->watched = true;
    pin_follow(which);
}

void pins_attach(machine *sim) {
    for (int port = 0; port < PORTS; port++) {
        for (int bit = 0; bit < 8; bit++) {
            pin *which = &sim->pins[port][bit];
            char name = PORT_NAMES[port];
            avr_irq_t *irq = avr_io_getirq(sim->avr, AVR_IOCTL_IOPORT_GETIRQ(name), bit);
            *which = (pin){.sim = sim, .port = name, .bit = bit, .irq = irq, .driven = -1};
        }
    }
}

/* What the port reads at pins that are inputs: driven from outside, and not pulled up over that. */
static void tell_port(machine *sim, int port) {
    avr_ioport_external_t outside = {.name = (unsigned char)PORT_NAMES[port] & 0x7F};
    unsigned mask = 0, value = 0;
    for (int bit = 0; bit < 8; bit++) {
        int level = sim->pins[port][bit].driven;
        mask |= (unsigned)(level >= 0) << bit;
        value |= (unsigned)(level == 1) << bit;
    }
    outside.mask = mask & 0xFF;
    outside.value = value & 0xFF;
    avr_ioctl(sim->avr, AVR_IOCTL_IOPORT_SET_EXTERNAL(PORT_NAMES[port]), &outside);
}

static void apply(pin *which, int level) {
    machine *sim = which->sim;
    int port = port_index(which->port);
    const uint8_t *data = sim->avr->data;
    which->driven = level;
    tell_port(sim, port);
    if (level < 0) {
        /* Let go: PORTx decides, be it as output or as pull-up; else the circuit pulls it low. */
        level = data[PIN_ADDRESS[port] + 2] >> which->bit & 1;
    }
    avr_raise_irq(which->irq, (uint32_t)level);
}

/* Libsimavr has cleared PINx, but its filtered signals still hold the old levels: set both. */
void pins_reset(machine *sim) {
    for (int port = 0; port < PORTS; port++) {
        for (int bit = 0; bit < 8; bit++) {
            pin *which = &sim->pins[port][bit];
            int level = which->driven > 0;
            uint8_t *seen = &sim->avr->data[PIN_ADDRESS[port]];
            *seen = (uint8_t)((*seen & ~(1 << bit)) | level << bit);
            if (which->irq) {
                which->irq->value = (uint32_t)level;
            }
            if (which->driven < 0) {
                changed(which, 0); /* every pin floats; the circuit pulls it low */
            }
        }
    }
    if (sim->drive_count) {
        avr_cycle_timer_register(sim->avr, 0, on_drive, sim);
    }
}

static avr_cycle_count_t on_drive(avr_t *avr, avr_cycle_count_t when, void *param) {
    machine *sim = param;
    (void)when;
    while (sim->drive_count && sim->drives[0].at_cycle <= avr->cycle) {
        drive next = sim->drives[0];
        memmove(&sim->drives[0], &sim->drives[1], (size_t)--sim->drive_count * sizeof next);
        apply(next.which, next.level);
    }
    return sim->drive_count ? sim->drives[0].at_cycle : 0;
}

/* Set a level from outside: 0, 1, or -1 to let go. False when too many wait. */
bool pin_drive(pin *which, int level, uint64_t at_cycle) {
    machine *sim = which->sim;
    uint64_t now = sim->avr->cycle;
    if (at_cycle <= now) {
        apply(which, level);
        return true;
    }
    if (sim->drive_count == DRIVES) {
        return false;
    }
    int place = sim->drive_count++;
    for (; place > 0 && sim->drives[place - 1].at_cycle > at_cycle; place--) {
        sim->drives[place] = sim->drives[place - 1];
    }
    sim->drives[place] = (drive){at_cycle, which, level};
    avr_cycle_timer_register(sim->avr, sim->drives[0].at_cycle - now, on_drive, sim);
    return true;
}
