/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * The wire to a receiver as levels over time, so that a wrong rate garbles bytes as it really does.
 */
#include "avrsim.h"

static const line_byte *at_index(const line *wire, unsigned index) {
    return &wire->bytes[index % LINE_BYTES];
}

static int bit_of(uint8_t value, int64_t index) {
    if (index == 0) {
        return 0;
    }
    return index <= 8 ? value >> (index - 1) & 1 : 1;
}

bool line_put(line *wire, int64_t start, int64_t bit, uint8_t value) {
    if (wire->end - wire->first == LINE_BYTES) {
        return false;
    }
    if (start < wire->free_from) {
        start = wire->free_from;
    }
    wire->bytes[wire->end++ % LINE_BYTES] = (line_byte){start, bit, value};
    wire->free_from = start + BITS_PER_BYTE * bit;
    return true;
}

bool line_empty(const line *wire) {
    return wire->first == wire->end;
}

/* The level at an instant: high where nobody sends. */
int line_level(const line *wire, int64_t at) {
    for (unsigned i = wire->first; i != wire->end; i++) {
        const line_byte *byte = at_index(wire, i);
        if (at < byte->start) {
            return 1;
        }
        if (at < byte->start + BITS_PER_BYTE * byte->bit) {
            return bit_of(byte->value, (at - byte->start) / byte->bit);
        }
    }
    return 1;
}

/* The first falling edge at `from` or later; a start bit always falls, as a stop bit is high. */
int64_t line_fall(const line *wire, int64_t from) {
    for (unsigned i = wire->first; i != wire->end; i++) {
        const line_byte *byte = at_index(wire, i);
        for (int k = 0; k < BITS_PER_BYTE - 1; k++) {
            int before = k == 0 ? 1 : bit_of(byte->value, k - 1);
            int64_t edge = byte->start + k * byte->bit;
            if (edge >= from && before == 1 && bit_of(byte->value, k) == 0) {
                return edge;
            }
        }
    }
    return NEVER;
}

/* Drop frames that have ended by `until`. */
void line_forget(line *wire, int64_t until) {
    while (wire->first != wire->end) {
        const line_byte *byte = at_index(wire, wire->first);
        if (byte->start + BITS_PER_BYTE * byte->bit > until) {
            return;
        }
        wire->first++;
    }
}

/* What a receiver with bits of `read_bit` makes of one byte sent with bits of `sent_bit`. */
uint8_t line_resample(uint8_t value, int64_t sent_bit, int64_t read_bit) {
    uint8_t read = 0;
    for (int k = 1; k <= 8; k++) {
        int64_t at = (2 * k + 1) * read_bit / 2;
        read |= (uint8_t)(bit_of(value, at / sent_bit) << (k - 1));
    }
    return read;
}
