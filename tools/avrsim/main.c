/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * avrsim: runs the firmware of an Arduino Mega 2560, held (told how far) or paced (in real time).
 *
 * Commands come as lines on standard input, events go as lines to standard output; README.md has
 * both. The end of standard input ends the program.
 */
#include <getopt.h>
#include <stdio.h>
#include <unistd.h>

#include "program.h"

program it;
volatile sig_atomic_t told_to_stop;

static void on_signal(int number) {
    (void)number;
    told_to_stop = 1;
}

uint64_t cycle_now(void) {
    return it.sim.avr->cycle;
}

static void on_byte_sent(machine *sim, int number, uint64_t end_cycle, uint8_t value) {
    if (it.has_terminal[number]) {
        terminal_send(&it.terminals[number], value);
    } else {
        int64_t bit_cycles = usart_bit(&sim->usarts[number]) / WIRE_PER_CYCLE;
        report("byte %d %llu %02x %lld\n", number, (unsigned long long)end_cycle, value,
               (long long)bit_cycles);
    }
}

static const char USAGE[] =
    "avrsim [--paced] [--sync] [--pty N[=LINK]] [--reset-on-open] [--bus PIN] [--boot HEX]\n"
    "       [--eeprom FILE] [HEX]\n";

static bool take_pty(const char *text) {
    int number = text[0] - '0';
    if (number < 0 || number >= USARTS || (text[1] && text[1] != '=')) {
        return false;
    }
    it.has_terminal[number] = true;
    it.links[number] = text[1] ? text + 2 : NULL;
    return true;
}

static const char *bus_pin;

static bool take_options(int count, char **values) {
    static const struct option OPTIONS[] = {
        {"paced", no_argument, NULL, 'p'},          {"sync", no_argument, NULL, 's'},
        {"pty", required_argument, NULL, 't'},      {"reset-on-open", no_argument, NULL, 'r'},
        {"bus", required_argument, NULL, 'b'},      {"boot", required_argument, NULL, 'o'},
        {"eeprom", required_argument, NULL, 'e'},   {NULL, 0, NULL, 0},
    };
    int option;
    while ((option = getopt_long(count, values, "", OPTIONS, NULL)) != -1) {
        switch (option) {
        case 'p': it.paced = true; break;
        case 's': it.synchronous = true; break;
        case 't': if (!take_pty(optarg)) return false; break;
        case 'r': it.resets_on_open = true; break;
        case 'b': bus_pin = optarg; break;
        case 'o': it.boot = optarg; break;
        case 'e': it.eeprom = optarg; break;
        default: return false;
        }
    }
    it.hex = optind < count ? values[optind] : NULL;
    return optind + 1 >= count && (it.hex || it.boot);
}

static bool load_images(void) {
    avr_t *avr = it.sim.avr;
    size_t size = avr->flashend + 1;
    if (it.hex && hex_load(it.hex, avr->flash, size) < 0) {
        return false;
    }
    if (it.boot) {
        int64_t start = hex_load(it.boot, avr->flash, size);
        if (start < 0) {
            return false;
        }
        avr->reset_pc = (avr_flashaddr_t)start; /* fuse BOOTRST programmed */
    }
    return !it.eeprom || machine_load_eeprom(&it.sim, it.eeprom);
}

static bool prepare(void) {
    it.sim.sent = on_byte_sent;
    if (!machine_make(&it.sim) || !load_images()) {
        return false;
    }
    if (bus_pin) {
        it.sim.direction = pin_named(&it.sim, bus_pin);
        if (!it.sim.direction) {
            fprintf(stderr, "--bus %s: no such pin; say, E4\n", bus_pin);
            return false;
        }
        pin_follow(it.sim.direction);
        it.sim.usarts[1].half_duplex = true;
    }
    for (int i = 0; i < USARTS; i++) {
        it.sim.usarts[i].attended = !it.has_terminal[i];
        bool resets = i == 0 && it.resets_on_open;
        if (it.has_terminal[i] &&
            !terminal_make(&it.terminals[i], &it.sim, i, it.links[i], resets)) {
            return false;
        }
    }
    machine_power_up(&it.sim);
    return true;
}

int main(int count, char **values) {
    if (!take_options(count, values)) {
        fputs(USAGE, stderr);
        return 2;
    }
    if (!prepare()) {
        return 3;
    }
    struct sigaction stop = {.sa_handler = on_signal};
    sigaction(SIGTERM, &stop, NULL);
    sigaction(SIGINT, &stop, NULL);
    signal(SIGPIPE, SIG_IGN); /* a reader that went first must not cost the EEPROM */
    report("ready %s %s\n", it.has_terminal[0] ? it.terminals[0].path : "-",
           it.has_terminal[1] ? it.terminals[1].path : "-");
    report_flush();
    if (it.paced) {
        run_paced();
    } else {
        run_held();
    }
    for (int i = 0; i < USARTS; i++) {
        if (it.has_terminal[i]) {
            terminal_close(&it.terminals[i]);
        }
    }
    bool saved = !it.eeprom || machine_save_eeprom(&it.sim, it.eeprom);
    avr_terminate(it.sim.avr);
    return saved ? 0 : 3;
}
