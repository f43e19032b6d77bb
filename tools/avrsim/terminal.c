/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * A pseudo-terminal as the serial port of a board: rate, DTR reset at opening, loss without reader.
 *
 * A pseudo-terminal has no modem lines. Linux raises DTR when a port is opened and drops it at the
 * last close if HUPCL is set; that edge resets an Arduino, and both instants can be seen from the
 * master side as POLLHUP ending and beginning.
 */
#include "avrsim.h"

#include <fcntl.h>
#include <poll.h>
#include <pty.h>
#include <stdio.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

enum { READ_BYTES = 4096 };

static const struct { speed_t code; int baud; } RATES[] = {
    {B9600, 9600},       {B19200, 19200},     {B57600, 57600},     {B115200, 115200},
    {B230400, 230400},   {B460800, 460800},   {B500000, 500000},   {B921600, 921600},
    {B1000000, 1000000}, {B2000000, 2000000}, {B3000000, 3000000}, {B4000000, 4000000},
};

static bool set_link(terminal *tty) {
    unlink(tty->link); /* a stale one; anything but a link was refused before us */
    if (symlink(tty->path, tty->link) != 0) {
        perror(tty->link);
        return false;
    }
    return true;
}

bool terminal_make(terminal *tty, machine *sim, int number, const char *link, bool resets) {
    int slave;
    struct termios mode;
    *tty = (terminal){.sim = sim, .port = &sim->usarts[number], .link = link, .resets = resets};
    if (openpty(&tty->master, &slave, tty->path, NULL, NULL) != 0) {
        perror("pseudo-terminal");
        return false;
    }
    tcgetattr(slave, &mode);
    cfmakeraw(&mode);
    mode.c_cflag |= HUPCL | CLOCAL | CREAD; /* as a serial port comes; a new pty lacks HUPCL */
    tcsetattr(slave, TCSANOW, &mode);
    close(slave); /* from now on POLLHUP says that nobody has it open */
    fcntl(tty->master, F_SETFL, O_NONBLOCK);
    fcntl(tty->master, F_SETFD, FD_CLOEXEC);
    return !link || set_link(tty);
}

/* The rate that the client has set; 0 for the default of a fresh pty and for ones unknown. */
static int64_t host_bit(const terminal *tty, tcflag_t *flags) {
    struct termios mode;
    if (tcgetattr(tty->master, &mode) != 0) {
        return 0;
    }
    *flags = mode.c_cflag;
    speed_t code = cfgetospeed(&mode);
    for (size_t i = 0; i < sizeof RATES / sizeof RATES[0]; i++) {
        if (RATES[i].code == code) {
            return (int64_t)CLOCK_HZ * WIRE_PER_CYCLE / RATES[i].baud;
        }
    }
    return 0;
}

static void note_open(terminal *tty, bool open) {
    tcflag_t flags = 0;
    host_bit(tty, &flags);
    if (open != tty->open) {
        report("client %d %llu %d\n", tty->port->number,
               (unsigned long long)tty->sim->avr->cycle, open);
    }
    if (open && !tty->open) {
        tty->opens++;
        if (tty->resets && !tty->line_raised) {
            machine_reset(tty->sim);
        }
        tty->line_raised = true;
    } else if (!open && tty->open) {
        tty->line_raised = !(flags & HUPCL);
    }
    tty->open = open;
}

/* Take in what the client has done: opened, closed, sent. Its bytes start on the wire now. */
void terminal_serve(terminal *tty, uint64_t now_cycle) {
    struct pollfd state = {.fd = tty->master, .events = POLLIN};
    uint8_t bytes[READ_BYTES];
    tcflag_t flags = 0;
    if (poll(&state, 1, 0) < 0) {
        return;
    }
    bool readable = state.revents & POLLIN;
    if (readable || !(state.revents & POLLHUP)) {
        note_open(tty, true);
    }
    ssize_t count = readable ? read(tty->master, bytes, sizeof bytes) : 0;
    tty->port->host_bit = host_bit(tty, &flags);
    for (ssize_t i = 0; i < count; i++) {
        usart_put(tty->port, now_cycle, bytes[i]);
    }
    if (state.revents & POLLHUP && !readable) {
        note_open(tty, false);
    }
}

/* A byte from the firmware, as a host at its own rate reads it; lost while nobody listens. */
void terminal_send(terminal *tty, uint8_t value) {
    int64_t sent_bit = usart_bit(tty->port);
    int64_t read_bit = tty->port->host_bit ? tty->port->host_bit : sent_bit;
    uint8_t read = line_resample(value, sent_bit, read_bit);
    if (!tty->open || write(tty->master, &read, 1) != 1) {
        tty->dropped++;
    }
}

void terminal_close(terminal *tty) {
    char target[64];
    close(tty->master);
    if (tty->link) {
        ssize_t length = readlink(tty->link, target, sizeof target - 1);
        if (length > 0 && strncmp(target, tty->path, (size_t)length) == 0) {
            unlink(tty->link);
        }
    }
}
