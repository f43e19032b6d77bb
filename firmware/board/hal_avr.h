// Registers of the ATmega2560 at 16 MHz, one short inline function for each use. Knows pins, not what they mean.
//
// No interrupt is ever enabled: each pass of the main loop asks the flags, so that the time of a pass has a bound.
// Section numbers are those of the data sheet (Microchip 40002211, ATmega640/1280/1281/2560/2561).
#ifndef HAL_AVR_H
#define HAL_AVR_H

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/wdt.h>
#include <stdint.h>

#ifndef F_CPU
#define F_CPU 16000000UL
#endif

// To the host. 1 Mbaud is exact at 16 MHz and as fast as the servo bus; a build setting.
#ifndef BOARD_HOST_BAUD
#define BOARD_HOST_BAUD 1000000UL
#endif

// To the servos, where BAUD_RATE in the table says 3.
#define BOARD_BUS_BAUD 1000000UL

// Double speed halves the rounding error (section 22.3.2, U2Xn).
#define HAL_UBRR(baud) ((F_CPU / 4 / (baud)-1) / 2)
#define HAL_BAUD(baud) (F_CPU / 8 / (HAL_UBRR(baud) + 1))
static_assert(HAL_BAUD(BOARD_HOST_BAUD) * 40 < BOARD_HOST_BAUD * 41 && HAL_BAUD(BOARD_HOST_BAUD) * 40 > BOARD_HOST_BAUD * 39,
              "BOARD_HOST_BAUD is more than 2.5 % off what 16 MHz can give");

// Timer 4 counts half microseconds (clock / 8).
const uint8_t TICKS_PER_US = 2;

// Pins: direction PE4 (D2), high = drive. Inputs on port L with pull-up: knot PL0 (D49, ICP4), moving PL1 (D48),
// stop PL2 (D47). Output wrist ok PL3 (D46).
const uint8_t HAL_KNOT = 1 << PL0;
const uint8_t HAL_MOVING = 1 << PL1;
const uint8_t HAL_STOP = 1 << PL2;
const uint8_t HAL_WRIST_OK = 1 << PL3;

void hal_start();
[[noreturn]] void hal_reset();

// Kept over a reset: see hal_avr.cpp.
uint16_t hal_resets();
uint16_t hal_reset_cause();

// One step of the search for the lowest byte the stack has reached; bytes never reached in the last whole search.
uint16_t hal_stack_free();

// Status of a UART, one read for all flags. Overrun has to be looked at before the byte is read.
const uint8_t HAL_RECEIVED = 1 << RXC0;
const uint8_t HAL_SENT = 1 << TXC0;
const uint8_t HAL_READY = 1 << UDRE0;
const uint8_t HAL_OVERRUN = 1 << DOR0;

inline void hal_alive() { wdt_reset(); }
inline uint16_t hal_ticks() { return TCNT4; }

// Host: UART0.
inline uint8_t hal_host_status() { return UCSR0A; }
inline uint8_t hal_host_read() { return UDR0; }
inline void hal_host_write(uint8_t byte) { UDR0 = byte; }

// Bus: UART1, half duplex.
inline uint8_t hal_bus_status() { return UCSR1A; }
inline uint8_t hal_bus_read() { return UDR1; }
inline void hal_bus_write(uint8_t byte) {
    UDR1 = byte;
    // Cleared after the write: this byte cannot have left within two cycles, an earlier one may have.
    UCSR1A = (1 << U2X1) | (1 << TXC1);
}
inline void hal_bus_drive() {
    // The receiver is off meanwhile: an adapter that echoes cannot be taken for a servo.
    UCSR1B = 1 << TXEN1;
    PORTE |= 1 << PE4;
}
inline void hal_bus_release() {
    PORTE &= ~(1 << PE4);
    UCSR1B = (1 << TXEN1) | (1 << RXEN1);
}

inline uint8_t hal_lines() { return PINL; }
inline void hal_wrist_ok(bool on) {
    if (on) {
        PORTL |= HAL_WRIST_OK;
    } else {
        PORTL &= ~HAL_WRIST_OK;
    }
}

// An edge of knot has been captured.
inline bool hal_captured() { return TIFR4 & (1 << ICF4); }

// Its time; then waits for the opposite one.
inline uint16_t hal_capture() {
    const uint16_t ticks = ICR4;
    uint8_t level;
    do {
        level = PINL & HAL_KNOT;
        if (level) {
            TCCR4B &= ~(1 << ICES4);
        } else {
            TCCR4B |= 1 << ICES4;
        }
        TIFR4 = 1 << ICF4;  // changing the edge may set the flag (section 17.6.3)
    } while ((PINL & HAL_KNOT) != level);
    return ticks;
}

#endif
