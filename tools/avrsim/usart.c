/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * A USART as the ATmega2560 data sheet (chapter 22) has it, in place of libsimavr's own.
 *
 * Asynchronous 8N1 only. Modelled: shift times both ways, double-buffered transmit, the receive
 * buffer of two bytes, overrun, framing error, TXC only when all is sent, the rate of the other
 * side, a half-duplex bus with a direction pin. Not modelled: parity, 9 bits, synchronous mode,
 * the transmitter's wait for its next baud tick.
 */
#include "avrsim.h"

/* Bits of UCSRnA and UCSRnB, data sheet 22.10. */
enum { RXC = 0x80, TXC = 0x40, UDRE = 0x20, FE = 0x10, DOR = 0x08, U2X = 0x02, MPCM = 0x01 };
enum { RXCIE = 0x80, TXCIE = 0x40, UDRIE = 0x20, RXEN = 0x10, TXEN = 0x08 };

/* Where in the frame the receiver has its stop bit: sixth of eight samples of the tenth bit,
 * data sheet 22.8.2, double speed. In quarters of a bit. */
enum { STOP_DECIDED_QUARTERS = 39 };

/* After a byte that nothing follows, how long until the caller is told: 30 us. A servo's earliest
 * answer comes 50 us after the instruction, so the caller still is in time; and bytes that are
 * forwarded one by one, 3 us apart, are told of together. */
enum { SETTLE_CYCLES = 30 * (CLOCK_HZ / 1000000) };

static avr_cycle_count_t on_frame(avr_t *avr, avr_cycle_count_t when, void *param);
static avr_cycle_count_t on_sent(avr_t *avr, avr_cycle_count_t when, void *param);

static uint8_t *registers(const usart *port) {
    return port->sim->avr->data;
}

static void set_flag(usart *port, uint8_t flag, bool on) {
    uint8_t *status = &registers(port)[port->ucsra];
    *status = (uint8_t)(on ? *status | flag : *status & ~flag);
}

static bool flag(const usart *port, uint8_t mask) {
    return registers(port)[port->ucsra] & mask;
}

static bool enabled(const usart *port, uint8_t mask) {
    return registers(port)[port->ucsrb] & mask;
}

static int64_t bit_cycles(const usart *port) {
    const uint8_t *data = registers(port);
    int64_t divider = (data[port->ubrrl] | (data[port->ubrrh] & 0x0F) << 8) + 1;
    return divider * (flag(port, U2X) ? 8 : 16);
}

int64_t usart_bit(const usart *port) {
    return bit_cycles(port) * WIRE_PER_CYCLE;
}

static uint64_t cycle_of(int64_t wire) {
    return (uint64_t)((wire + WIRE_PER_CYCLE - 1) / WIRE_PER_CYCLE);
}

static void at_cycle(usart *port, uint64_t cycle, avr_cycle_timer_t call) {
    avr_t *avr = port->sim->avr;
    avr_cycle_timer_register(avr, cycle > avr->cycle ? cycle - avr->cycle : 0, call, port);
}

/* Raise each interrupt whose flag is up and which is enabled: they are levels, not edges. */
static void offer_interrupts(usart *port) {
    avr_t *avr = port->sim->avr;
    if (flag(port, RXC) && enabled(port, RXCIE)) {
        avr_raise_interrupt(avr, port->rxc);
    }
    if (flag(port, UDRE) && enabled(port, UDRIE)) {
        avr_raise_interrupt(avr, port->udre);
    }
    if (flag(port, TXC) && enabled(port, TXCIE)) {
        avr_raise_interrupt(avr, port->txc);
    }
}

/* Receiver --------------------------------------------------------------------------------- */

static void look_for_start(usart *port) {
    avr_t *avr = port->sim->avr;
    port->frame_start = NEVER;
    line_forget(&port->wire, port->look_from);
    int64_t edge = line_fall(&port->wire, port->look_from);
    if (edge != NEVER) {
        at_cycle(port, cycle_of(edge), on_frame);
    } else {
        avr_cycle_timer_cancel(avr, on_frame, port);
    }
}

static void begin_frame(usart *port, int64_t edge) {
    port->frame_start = edge;
    if (port->waiting) {
        /* Data sheet 22.7.3: buffer full, a frame waits, and a new start bit is detected. */
        port->waiting = false;
        port->counts.overruns++;
        set_flag(port, DOR, true);
        report("overrun %d %llu\n", port->number, (unsigned long long)cycle_of(edge));
    }
    at_cycle(port, cycle_of(edge + STOP_DECIDED_QUARTERS * usart_bit(port) / 4), on_frame);
}

static void show_first(usart *port) {
    set_flag(port, RXC, port->fifo_count > 0);
    set_flag(port, FE, port->fifo_count > 0 && port->fifo_framing[0]);
}

static void store(usart *port, uint8_t value, bool framing) {
    if (port->fifo_count == FIFO_BYTES) {
        port->waiting = true;
        port->waiting_value = value;
        port->waiting_framing = framing;
        return;
    }
    port->fifo[port->fifo_count] = value;
    port->fifo_framing[port->fifo_count++] = framing;
    show_first(port);
    offer_interrupts(port);
}

static bool was_driven(const usart *port, uint64_t since) {
    const machine *sim = port->sim;
    return port->half_duplex && (sim->direction->level || sim->direction_since > since);
}

static void end_frame(usart *port) {
    int64_t bit = usart_bit(port), start = port->frame_start;
    uint8_t value = 0;
    for (int k = 0; k < 8; k++) {
        value |= (uint8_t)(line_level(&port->wire, start + (2 * k + 3) * bit / 2) << k);
    }
    bool framing = !line_level(&port->wire, start + 19 * bit / 2);
    bool noise = line_level(&port->wire, start + bit / 2); /* the start bit was none */
    port->look_from = start + (noise ? bit / 2 : 19 * bit / 2);
    if (was_driven(port, cycle_of(start))) {
        port->counts.collisions++;
        report("collision %d %llu %02x\n", port->number,
               (unsigned long long)cycle_of(start), value);
    } else if (!noise) {
        port->counts.rx_bytes++;
        port->counts.framing += framing;
        store(port, value, framing);
    }
    look_for_start(port);
}

/* A start bit falls, or a frame is complete. */
static avr_cycle_count_t on_frame(avr_t *avr, avr_cycle_count_t when, void *param) {
    usart *port = param;
    (void)avr;
    (void)when;
    if (port->frame_start != NEVER) {
        end_frame(port);
        return 0;
    }
    int64_t edge = line_fall(&port->wire, port->look_from);
    if (edge != NEVER && enabled(port, RXEN)) {
        begin_frame(port, edge);
    } else if (edge != NEVER) {
        port->look_from = edge + 1;
        look_for_start(port);
    }
    return 0;
}

static uint8_t read_data(avr_t *avr, avr_io_addr_t address, void *param) {
    usart *port = param;
    uint8_t value = port->fifo[0];
    set_flag(port, DOR, false);
    if (port->fifo_count > 0) {
        port->fifo[0] = port->fifo[1];
        port->fifo_framing[0] = port->fifo_framing[1];
        port->fifo_count--;
    }
    if (port->waiting) {
        port->waiting = false;
        store(port, port->waiting_value, port->waiting_framing);
    }
    show_first(port);
    if (!flag(port, RXC)) {
        avr_clear_interrupt(avr, port->rxc);
    }
    offer_interrupts(port);
    avr->data[address] = value;
    return value;
}

bool usart_put(usart *port, uint64_t at, uint8_t value) {
    int64_t bit = port->host_bit ? port->host_bit : usart_bit(port);
    uint64_t now = port->sim->avr->cycle;
    bool was_quiet = port->frame_start == NEVER;
    int64_t start = (int64_t)(at > now ? at : now) * WIRE_PER_CYCLE;
    if (!line_put(&port->wire, start, bit, value)) {
        port->counts.line_full++;
        return false;
    }
    if (was_quiet) {
        look_for_start(port);
    }
    return true;
}

/* Transmitter ------------------------------------------------------------------------------ */

static void shift_out(usart *port, uint8_t value, uint64_t from) {
    port->sending = true;
    port->shifter = value;
    port->sent_from = from;
    port->sent_until = from + (uint64_t)(BITS_PER_BYTE * bit_cycles(port));
    at_cycle(port, port->sent_until, on_sent);
}

static void deliver(usart *port) {
    machine *sim = port->sim;
    port->counts.tx_bytes++;
    bool heard = !port->half_duplex ||
                 (sim->direction->level && sim->direction_since <= port->sent_from);
    if (!heard) {
        port->counts.tx_lost++;
        report("tx_lost %d %llu %02x\n", port->number, (unsigned long long)port->sent_until,
               port->shifter);
        return;
    }
    sim->sent(sim, port->number, port->sent_until, port->shifter);
    if (port->attended) {
        machine_attend(sim, port->sent_until + SETTLE_CYCLES);
    }
}

/* A stop bit has ended. */
static avr_cycle_count_t on_sent(avr_t *avr, avr_cycle_count_t when, void *param) {
    usart *port = param;
    (void)avr;
    (void)when;
    deliver(port);
    if (port->buffered) {
        port->buffered = false;
        shift_out(port, port->buffer, port->sent_until);
        set_flag(port, UDRE, true);
    } else {
        port->sending = false;
        set_flag(port, TXC, true);
    }
    offer_interrupts(port);
    return 0;
}

static void write_data(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    usart *port = param;
    (void)address;
    if (!enabled(port, TXEN)) {
        return;
    }
    if (!flag(port, UDRE)) {
        port->counts.tx_ignored++;
        report("tx_ignored %d %llu %02x\n", port->number, (unsigned long long)avr->cycle, value);
    } else if (port->sending) {
        port->buffered = true;
        port->buffer = value;
        set_flag(port, UDRE, false);
        avr_clear_interrupt(avr, port->udre);
    } else {
        shift_out(port, value, avr->cycle);
    }
}

/* Registers -------------------------------------------------------------------------------- */

static void write_status(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    usart *port = param;
    uint8_t kept = avr->data[address] & (uint8_t) ~(U2X | MPCM);
    if (value & TXC) {
        kept &= (uint8_t)~TXC;
        avr_clear_interrupt(avr, port->txc);
    }
    avr->data[address] = kept | (value & (U2X | MPCM));
}

static void write_control(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    usart *port = param;
    avr->data[address] = value;
    if (!(value & RXEN)) {
        /* Data sheet 22.7.5: the receiver stops at once and its buffer is flushed. */
        port->fifo_count = 0;
        port->waiting = false;
        show_first(port);
        set_flag(port, DOR, false);
        if (port->frame_start != NEVER) {
            port->look_from = port->frame_start + 1;
            look_for_start(port);
        }
    }
    offer_interrupts(port);
}

static void write_plain(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    (void)param;
    avr->data[address] = value;
}

/* At a handler's return its flag may still be up: then it is called again. */
static void on_running(avr_irq_t *irq, uint32_t value, void *param) {
    (void)irq;
    if (value == 0) {
        offer_interrupts(param);
    }
}

static avr_int_vector_t *find_vector(avr_t *avr, int number) {
    for (int i = 0; i < avr->interrupts.vector_count; i++) {
        if (avr->interrupts.vector[i]->vector == number) {
            return avr->interrupts.vector[i];
        }
    }
    return NULL;
}

/* Take the place of libsimavr's handler of a register. */
static void take_over(usart *port, uint16_t address, avr_io_read_t read, avr_io_write_t write) {
    avr_t *avr = port->sim->avr;
    avr_io_addr_t io = AVR_DATA_TO_IO(address);
    avr->io[io].r.c = read;
    avr->io[io].r.param = port;
    avr->io[io].w.c = write;
    avr->io[io].w.param = port;
}

void usart_attach(machine *sim, usart *port, int number) {
    /* Addresses and vectors of the ATmega2560: data sheet, register summary and table 14-1. */
    static const struct { uint16_t base; int vector; } WHERE[USARTS] = {{0xC0, 25}, {0xC8, 36}};
    uint16_t base = WHERE[number].base;
    port->sim = sim;
    port->number = number;
    port->ucsra = base;
    port->ucsrb = base + 1;
    port->ucsrc = base + 2;
    port->ubrrl = base + 4;
    port->ubrrh = base + 5;
    port->udr = base + 6;
    port->rxc = find_vector(sim->avr, WHERE[number].vector);
    port->udre = find_vector(sim->avr, WHERE[number].vector + 1);
    port->txc = find_vector(sim->avr, WHERE[number].vector + 2);
    take_over(port, port->ucsra, NULL, write_status);
    take_over(port, port->ucsrb, NULL, write_control);
    take_over(port, port->ucsrc, NULL, write_plain);
    take_over(port, port->ubrrl, NULL, write_plain);
    take_over(port, port->ubrrh, NULL, write_plain);
    take_over(port, port->udr, read_data, write_data);
    avr_int_vector_t *vectors[] = {port->rxc, port->udre, port->txc};
    for (int i = 0; i < 3; i++) {
        avr_irq_register_notify(vectors[i]->irq + AVR_INT_IRQ_RUNNING, on_running, port);
    }
}

/* As after any reset; what is on the wire to us stays there. */
void usart_reset(usart *port) {
    uint8_t *data = registers(port);
    data[port->ucsra] = UDRE;
    data[port->ucsrb] = 0;
    data[port->ucsrc] = 0x06; /* 8N1 */
    data[port->ubrrl] = data[port->ubrrh] = 0;
    port->fifo_count = 0;
    port->waiting = port->sending = port->buffered = false;
    int64_t now = (int64_t)port->sim->avr->cycle * WIRE_PER_CYCLE;
    if (port->look_from < now) {
        port->look_from = now;
    }
    look_for_start(port);
}
