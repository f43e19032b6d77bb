/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Intel hex files: data (0), end (1), extended segment (2) and linear (4) addresses; start
 * addresses (3, 5) mean nothing to an AVR.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "avrsim.h"

enum { RECORD_BYTES = 5 + 255 }; /* count, address, type, data, check sum */

/* The bytes of a line `:..`, or -1. */
static int read_record(const char *text, uint8_t *bytes) {
    size_t digits = strspn(text + 1, "0123456789abcdefABCDEF");
    if (text[0] != ':' || digits % 2 || digits < 10 || digits / 2 > RECORD_BYTES) {
        return -1;
    }
    uint8_t sum = 0;
    int count = (int)digits / 2;
    for (int i = 0; i < count; i++) {
        char pair[3] = {text[1 + 2 * i], text[2 + 2 * i], '\0'};
        bytes[i] = (uint8_t)strtoul(pair, NULL, 16);
        sum = (uint8_t)(sum + bytes[i]);
    }
    return sum == 0 && bytes[0] == count - 5 ? count : -1;
}

static int64_t load_records(FILE *file, const char *path, uint8_t *memory, size_t size) {
    char text[2 * RECORD_BYTES + 8];
    uint8_t bytes[RECORD_BYTES];
    uint32_t base = 0;
    int64_t lowest = -1;
    for (int number = 1; fgets(text, sizeof text, file); number++) {
        if (read_record(text, bytes) < 0) {
            fprintf(stderr, "%s:%d: not a record of an Intel hex file\n", path, number);
            return -1;
        }
        uint32_t word = (uint32_t)(bytes[4] << 8 | bytes[5]);
        uint32_t address = base + (uint32_t)(bytes[1] << 8 | bytes[2]);
        if (bytes[3] == 1) {
            return lowest;
        } else if (bytes[3] == 2) {
            base = word << 4;
        } else if (bytes[3] == 4) {
            base = word << 16;
        } else if (bytes[3] == 0) {
            if (address + bytes[0] > size) {
                fprintf(stderr, "%s:%d: address 0x%X is beyond the flash\n", path, number, address);
                return -1;
            }
            memcpy(memory + address, bytes + 4, bytes[0]);
            lowest = lowest < 0 || address < lowest ? address : lowest;
        }
    }
    fprintf(stderr, "%s: cut off, no end record\n", path);
    return -1;
}

int64_t hex_load(const char *path, uint8_t *memory, size_t size) {
    FILE *file = fopen(path, "r");
    if (!file) {
        perror(path);
        return -1;
    }
    int64_t lowest = load_records(file, path, memory, size);
    fclose(file);
    return lowest;
}
