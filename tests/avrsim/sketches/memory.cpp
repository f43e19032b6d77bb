// EEPROM: 'w' and a byte stores it at address 5, 'r' sends it. 's' uses 500 bytes of stack.
#include <avr/eeprom.h>
#include "sketch.h"

static uint8_t next() {
    while (!(UCSR0A & _BV(RXC0))) {
    }
    return UDR0;
}

static void __attribute__((noinline)) use_stack() {
    volatile uint8_t room[500];
    for (uint16_t i = 0; i < sizeof room; i++) {
        room[i] = i & 1;
    }
}

int main() {
    open_uarts();
    for (;;) {
        switch (next()) {
        case 'w':
            eeprom_update_byte(reinterpret_cast<uint8_t *>(5), next());
            send_host('k');
            break;
        case 'r':
            send_host(eeprom_read_byte(reinterpret_cast<const uint8_t *>(5)));
            break;
        case 's':
            use_stack();
            send_host('k');
            break;
        }
    }
}
