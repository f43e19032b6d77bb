// Returns each byte at once, polled. HOST_DIVIDER is UBRR0; FETCH_DELAY_US makes it a slow reader.
#include <util/delay.h>
#include "sketch.h"

#ifndef HOST_DIVIDER
#define HOST_DIVIDER 1
#endif
#ifndef FETCH_DELAY_US
#define FETCH_DELAY_US 0
#endif

int main() {
    open_uarts(HOST_DIVIDER);
    for (;;) {
        if (UCSR0A & _BV(RXC0)) {
            uint8_t status = UCSR0A;
            uint8_t value = UDR0;
            (void)status;
            send_host(value);
            if (FETCH_DELAY_US) {
                _delay_us(FETCH_DELAY_US);
            }
        }
    }
}
