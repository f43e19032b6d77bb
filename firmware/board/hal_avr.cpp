// Start of the ATmega2560: what has to happen before main, the peripherals, what survives a reset.
#ifdef __AVR__
#include "hal_avr.h"

// 60 ms is a thousand passes, and shorter than any watchdog that a host should set.
#define HAL_WATCHDOG WDTO_60MS

static const uint8_t PAINT = 0xC5;
static const uint16_t MARK = 0x5A17;
static const uint16_t ASKED = 0xA5E8;
static const uint16_t CAUSE_ASKED = 0x80;

extern "C" uint8_t _end;

// Not cleared at start. The mark tells contents from chance; a bootloader's variables may lie here and break it.
static struct {
    uint16_t mark;
    uint16_t resets;
    uint16_t asked;
} kept __attribute__((section(".noinit")));
static uint8_t first_mcusr __attribute__((section(".noinit")));
static uint16_t cause;
static const uint8_t* stack_at;
static uint16_t stack_free;

// Before anything else: after a watchdog reset the watchdog runs on at 16 ms (section 12.4). Then the paint by which
// the use of the stack is measured.
extern "C" void hal_early(void) __attribute__((naked, used, section(".init3")));
extern "C" void hal_early(void) {
    first_mcusr = MCUSR;
    MCUSR = 0;
    wdt_disable();
    for (uint8_t* at = &_end; at < reinterpret_cast<uint8_t*>(SP); ++at) *at = PAINT;
}

static void start_memory() {
    const bool whole = kept.mark == MARK && !(first_mcusr & (1 << PORF));
    cause = first_mcusr & 0x1F;
    if (whole && kept.asked == ASKED) cause |= CAUSE_ASKED;
    kept.resets = whole ? kept.resets + 1 : 1;
    kept.mark = MARK;
    kept.asked = 0;
    stack_at = &_end;
}

static void start_pins() {
    PORTE &= ~(1 << PE4);
    DDRE |= 1 << PE4;
    // Pull-ups on the inputs; the output low before it is one.
    PORTL = HAL_KNOT | HAL_MOVING | HAL_STOP;
    DDRL = HAL_WRIST_OK;
    // The receivers' idle level when nobody drives them.
    PORTE |= 1 << PE0;
    PORTD |= 1 << PD2;
}

static void start_timer() {
    // Normal mode, clock / 8, capture through the noise canceler (4 cycles), opposite of the present level.
    TCCR4A = 0;
    TCCR4B = (1 << ICNC4) | (1 << CS41) | (PINL & HAL_KNOT ? 0 : 1 << ICES4);
    TIFR4 = 1 << ICF4;
}

static void start_uarts() {
    UBRR0 = HAL_UBRR(BOARD_HOST_BAUD);
    UCSR0A = 1 << U2X0;
    UCSR0C = (1 << UCSZ01) | (1 << UCSZ00);
    UCSR0B = (1 << TXEN0) | (1 << RXEN0);
    UBRR1 = HAL_UBRR(BOARD_BUS_BAUD);
    UCSR1A = 1 << U2X1;
    UCSR1C = (1 << UCSZ11) | (1 << UCSZ10);
    hal_bus_release();
}

void hal_start() {
    cli();  // the Arduino core has enabled its timer's
    start_pins();
    start_memory();
    start_timer();
    start_uarts();
    wdt_enable(HAL_WATCHDOG);
}

void hal_reset() {
    kept.asked = ASKED;
    wdt_enable(WDTO_15MS);
    for (;;) {
    }
}

uint16_t hal_resets() { return kept.resets; }
uint16_t hal_reset_cause() { return cause; }

uint16_t hal_stack_free() {
    if (*stack_at == PAINT) {
        ++stack_at;
    } else {
        stack_free = stack_at - &_end;
        stack_at = &_end;
    }
    return stack_free;
}

#endif
