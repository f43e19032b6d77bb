// The echo by receive and data-register-empty interrupts, and a count of transmit-complete ones; '2'
// is sent twice. INT0 (PD0, falling) raises PB7 by the shortest handler there is.
#include <avr/interrupt.h>
#include "sketch.h"

static volatile uint8_t ring[256], first, end;

ISR(USART0_RX_vect) {
    uint8_t value = UDR0;
    ring[end++] = value;
    if (value == '2') {
        ring[end++] = value;
    }
    UCSR0B |= _BV(UDRIE0);
}

ISR(USART0_UDRE_vect) {
    if (first == end) {
        UCSR0B &= ~_BV(UDRIE0);
    } else {
        UDR0 = ring[first++];
    }
}

ISR(USART0_TX_vect) {
    GPIOR0 = GPIOR0 + 1;
}

ISR(INT0_vect, ISR_NAKED) {
    asm volatile("sbi %0, %1\n\treti" ::"I"(_SFR_IO_ADDR(PORTB)), "I"(PB7));
}

int main() {
    open_uarts();
    DDRB |= _BV(PB7);
    EICRA = _BV(ISC01);
    EIMSK = _BV(INT0);
    UCSR0B |= _BV(RXCIE0) | _BV(TXCIE0);
    sei();
    for (;;) {
    }
}
