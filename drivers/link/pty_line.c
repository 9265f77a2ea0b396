/* SPDX-License-Identifier: MIT */
#include "drivers/link/pty_line.h"

#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "drivers/link/pty_rate.h"

ssize_t pty_line_read(const struct pty_line *line, int master, void *buf, size_t len)
{
    struct uart uart;
    uint8_t sent[4096];
    if (!pty_rate_differs(master, line->baud, 0, &uart)) return read(master, buf, len);
    if (len > sizeof sent * UART_MOST_PER_BYTE) len = sizeof sent * UART_MOST_PER_BYTE;
    if (len < UART_MOST_PER_BYTE) return 0; /* the caller has no room now */
    const ssize_t n = read(master, sent, len / UART_MOST_PER_BYTE);
    return n > 0 ? (ssize_t)uart_read(&uart, sent, (size_t)n, buf) : n;
}

int pty_line_flush(struct pty_line *line, int master)
{
    const ssize_t n = line->n_out != 0 ? write(master, line->out, line->n_out) : 0;
    if (n > 0) memmove(line->out, line->out + n, line->n_out -= (size_t)n);
    return line->n_out == 0;
}

ssize_t pty_line_write(struct pty_line *line, int master, const void *buf, size_t len)
{
    struct uart uart;
    if (!pty_line_flush(line, master)) return 0;
    if (!pty_rate_differs(master, line->baud, 1, &uart)) return write(master, buf, len);
    if (line->out_room < len * UART_MOST_PER_BYTE) {
        uint8_t *out = realloc(line->out, len * UART_MOST_PER_BYTE);
        if (out == NULL) return 0; /* the reader loses frames, which is counted */
        line->out = out;
        line->out_room = len * UART_MOST_PER_BYTE;
    }
    line->n_out = uart_read(&uart, buf, len, line->out);
    pty_line_flush(line, master);
    return (ssize_t)len;
}
