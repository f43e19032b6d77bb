/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * What the files of avrsim share: one simulated ATmega2560, its serial ports, its pins, its reports.
 *
 * Instants are counted in cycles of the 16 MHz clock since power-up. Bits on a wire seldom last a
 * whole number of cycles, so that instants of bits ("wire time") are counted in 1/256 cycle.
 */
#ifndef AVRSIM_H
#define AVRSIM_H

#include <simavr/sim_avr.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
    CLOCK_HZ = 16000000,       /* crystal of an Arduino Mega */
    WIRE_PER_CYCLE = 256,      /* wire time: 1/256 cycle, 0.1 % of the bit at 4 Mbaud */
    BITS_PER_BYTE = 10,        /* start bit, eight data bits, stop bit */
    USARTS = 2,                /* 0 is the host's, 1 the servo bus */
    PORTS = 11,                /* A to L without I */
    FIFO_BYTES = 2,            /* receive buffer beside the shift register, data sheet 22.7 */
    LINE_BYTES = 16384,        /* bytes under way to one USART: 160 ms at 1 Mbaud */
    DRIVES = 4096,             /* input levels set for later */
};

#define NEVER INT64_MAX

typedef struct machine machine;

/* Bytes on the wire to a receiver: a queue of frames, each with its own bit length. */
typedef struct {
    int64_t start, bit; /* wire time */
    uint8_t value;
} line_byte;

typedef struct {
    line_byte bytes[LINE_BYTES];
    unsigned first, end;
    int64_t free_from; /* wire time from which on the next byte may start */
} line;

bool line_put(line *wire, int64_t start, int64_t bit, uint8_t value);
int line_level(const line *wire, int64_t at);
int64_t line_fall(const line *wire, int64_t from);
void line_forget(line *wire, int64_t until);
bool line_empty(const line *wire);
uint8_t line_resample(uint8_t value, int64_t sent_bit, int64_t read_bit);

typedef struct {
    uint64_t rx_bytes, tx_bytes;
    uint64_t overruns;   /* frames lost because the firmware did not fetch in time */
    uint64_t framing;    /* frames whose stop bit was low */
    uint64_t collisions; /* frames that came while the firmware drove the bus */
    uint64_t tx_lost;    /* bytes sent while the direction pin did not drive all along */
    uint64_t tx_ignored; /* UDR written while UDRE was off: the chip drops that */
    uint64_t line_full;  /* bytes from outside that found no room: a fault of the caller */
} usart_counts;

/* One USART in asynchronous mode, 8N1; data sheet chapter 22. */
typedef struct {
    machine *sim;
    int number;
    uint16_t udr, ucsra, ucsrb, ucsrc, ubrrl, ubrrh; /* data addresses */
    avr_int_vector_t *rxc, *udre, *txc;
    bool half_duplex;
    bool attended; /* whoever runs us looks at what is sent */

    line wire;
    int64_t host_bit;    /* wire time of a bit of the other side; 0: as long as ours */
    int64_t look_from;   /* wire time from which the receiver looks for a start bit */
    int64_t frame_start; /* wire time of the frame under way, NEVER if none */
    uint8_t fifo[FIFO_BYTES];
    bool fifo_framing[FIFO_BYTES];
    int fifo_count;
    bool waiting; /* a whole frame waits in the shift register */
    uint8_t waiting_value;
    bool waiting_framing;

    bool sending, buffered;
    uint8_t shifter, buffer;
    uint64_t sent_from; /* cycle of the start bit */
    uint64_t sent_until;
    usart_counts counts;
} usart;

void usart_attach(machine *sim, usart *port, int number);
void usart_reset(usart *port);
bool usart_put(usart *port, uint64_t at_cycle, uint8_t value);
int64_t usart_bit(const usart *port);

typedef struct {
    machine *sim;
    char port;
    int bit;
    avr_irq_t *irq;
    int level;
    int driven; /* level from outside; -1: let go */
    bool watched;
    bool hooked;
} pin;

typedef struct {
    uint64_t at_cycle;
    pin *which;
    int level;
} drive;

pin *pin_named(machine *sim, const char *name);
void pins_attach(machine *sim);
void pins_reset(machine *sim);
void pin_follow(pin *which);
void pin_watch(pin *which);
bool pin_drive(pin *which, int level, uint64_t at_cycle);

struct machine {
    avr_t *avr;
    usart usarts[USARTS];
    pin pins[PORTS][8];
    drive drives[DRIVES];
    int drive_count;

    pin *direction; /* drives the half-duplex bus while high; NULL: full duplex */
    uint64_t direction_since;

    void (*sent)(machine *sim, int number, uint64_t end_cycle, uint8_t value);
    bool stop;            /* leave the present run at the next chance */
    bool attention;       /* something was sent or seen that the caller should look at */
    bool stops_early;     /* whether that ends a run */
    uint64_t target;      /* cycle at which the present run ends */
    uint64_t attention_at;
    bool was_reset;
    uint8_t reset_flags;  /* MCUSR as the chip would keep it across resets */
    uint8_t reset_cause;
    uint64_t resets;
    bool dead;            /* asleep for ever or lost in the weeds */
};

/* Bits of MCUSR, data sheet 12.5.1. */
enum { CAUSE_POWER = 1, CAUSE_EXTERNAL = 2, CAUSE_WATCHDOG = 8 };

bool machine_make(machine *sim);
void machine_power_up(machine *sim);
void machine_reset(machine *sim);
void machine_run(machine *sim, uint64_t target_cycle);
void machine_attend(machine *sim, uint64_t at_cycle);
int machine_stack_bytes(const machine *sim);
bool machine_load_eeprom(machine *sim, const char *path);
bool machine_save_eeprom(machine *sim, const char *path);

/* Loads an Intel hex file; returns its lowest address, or -1 after saying what is wrong. */
int64_t hex_load(const char *path, uint8_t *memory, size_t size);

/* Lines to whoever runs us; kept back until report_flush. */
void report(const char *format, ...) __attribute__((format(printf, 1, 2)));
void report_flush(void);

/* A pseudo-terminal as a USART's other end. */
typedef struct {
    machine *sim;
    usart *port;
    int master;
    const char *link;
    char path[64];
    bool open;        /* a client has it open */
    bool line_raised; /* DTR: falls at the last close when HUPCL is set */
    bool resets;      /* whether a rising DTR resets the machine */
    uint64_t opens, dropped;
} terminal;

bool terminal_make(terminal *tty, machine *sim, int number, const char *link, bool resets);
void terminal_serve(terminal *tty, uint64_t now_cycle);
void terminal_send(terminal *tty, uint8_t value);
void terminal_close(terminal *tty);

#endif
