/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Lines on standard output, written in one piece when the reader is to look.
 */
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <unistd.h>

#include "avrsim.h"

enum { BUFFER_BYTES = 65536, LINE_ROOM = 8192 };

static char buffer[BUFFER_BYTES];
static size_t used;

void report_flush(void) {
    size_t done = 0;
    while (done < used) {
        ssize_t written = write(STDOUT_FILENO, buffer + done, used - done);
        if (written < 0 && errno != EINTR) {
            break; /* nobody reads any more; the end of standard input is about to end us */
        }
        done += written > 0 ? (size_t)written : 0;
    }
    used = 0;
}

void report(const char *format, ...) {
    if (used + LINE_ROOM > BUFFER_BYTES) {
        report_flush();
    }
    va_list values;
    va_start(values, format);
    int length = vsnprintf(buffer + used, LINE_ROOM, format, values);
    va_end(values);
    used += length > 0 ? (size_t)length : 0;
}
