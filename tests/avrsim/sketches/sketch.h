// What the test sketches share: both USARTs at 1 Mbaud, 8N1, and the direction pin PE4, high = drive.
#pragma once
#include <avr/io.h>

static inline void open_uarts(uint16_t host_divider = 1) {
    UCSR0A = _BV(U2X0);
    UBRR0 = host_divider;
    UCSR0B = _BV(RXEN0) | _BV(TXEN0);
    UCSR1A = _BV(U2X1);
    UBRR1 = 1;
    UCSR1B = _BV(RXEN1) | _BV(TXEN1);
    DDRE |= _BV(PE4);
}

static inline void send_host(uint8_t value) {
    while (!(UCSR0A & _BV(UDRE0))) {
    }
    UDR0 = value;
}
