// PB7 rises for exactly PULSE_CYCLES at a byte from the host; 'p' sends back what PINB and PINL read;
// 'r' lets the watchdog bite.
#include <avr/wdt.h>
#include <util/delay.h>
#include "sketch.h"

int main() {
    uint8_t cause = MCUSR;
    MCUSR = 0;
    wdt_disable();
    GPIOR0 = cause;
    open_uarts();
    DDRB |= _BV(PB7);
    PORTB |= _BV(PB0);  // pull-up
    for (;;) {
        if (!(UCSR0A & _BV(RXC0))) {
            continue;
        }
        switch (UDR0) {
        case 'u':
            PORTB |= _BV(PB7);
            __builtin_avr_delay_cycles(PULSE_CYCLES - 2);  // and the two cycles of SBI itself
            PORTB &= ~_BV(PB7);
            break;
        case 'p':
            send_host(PINB);
            send_host(PINL);
            break;
        case 'c':
            send_host(cause);
            break;
        case 'r':
            wdt_enable(WDTO_15MS);
            for (;;) {
            }
        }
    }
}
