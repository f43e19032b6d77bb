// Timer 4 at the full clock stamps both edges at ICP4 (PL0, D49 of a Mega) and sends each stamp.
#include "sketch.h"

int main() {
    open_uarts();
    TCCR4A = 0;
    TCCR4B = _BV(ICES4) | _BV(CS40);
    send_host('!');
    for (;;) {
        if (TIFR4 & _BV(ICF4)) {
            uint16_t stamp = ICR4;
            TCCR4B ^= _BV(ICES4);
            TIFR4 = _BV(ICF4);
            send_host(stamp & 0xFF);
            send_host(stamp >> 8);
        }
    }
}
