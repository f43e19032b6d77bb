// Host to bus and back byte by byte. EARLY drops the direction pin when the buffer is empty but the
// last byte is still being sent; LATE holds it 300 us too long; STALE clears transmit-complete before
// the write, so that the byte before, if it ends in between, sets it again;
// DIP lets the pin go for an eighth of a microsecond during each byte.
#include <util/delay.h>
#include "sketch.h"

int main() {
    open_uarts();
    for (;;) {
        if (UCSR0A & _BV(RXC0)) {
            uint8_t value = UDR0;
            PORTE |= _BV(PE4);
            while (!(UCSR1A & _BV(UDRE1))) {
            }
#ifdef STALE
            UCSR1A = _BV(U2X1) | _BV(TXC1);
            UDR1 = value;
#else
            UDR1 = value;
            UCSR1A = _BV(U2X1) | _BV(TXC1);
#endif
#ifdef DIP
            PORTE &= ~_BV(PE4);
            PORTE |= _BV(PE4);
#endif
        }
#ifdef EARLY
        if ((PORTE & _BV(PE4)) && (UCSR1A & _BV(UDRE1))) {
            PORTE &= ~_BV(PE4);
        }
#else
        if ((PORTE & _BV(PE4)) && (UCSR1A & _BV(TXC1))) {
#ifdef LATE
            _delay_us(300);
#endif
            PORTE &= ~_BV(PE4);
        }
#endif
        if (UCSR1A & _BV(RXC1)) {
            send_host(UDR1);
        }
    }
}
