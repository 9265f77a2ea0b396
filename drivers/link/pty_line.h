/* SPDX-License-Identifier: MIT */
/* Carries the bytes of a pty link to and from a client whose bit rate may differ from the head's. Private to the link.
 *
 * Where both rates are the same, or the head has none, bytes only pass through. Else they are what a UART reads of them
 * (uart.h): each write, and all bytes that are read together, are sent one after the other, and the line rests before
 * and after. */
#ifndef DRIVERS_LINK_PTY_LINE_H
#define DRIVERS_LINK_PTY_LINE_H

#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

struct pty_line {
    uint32_t baud; /* of the head; 0: any rate will do */
    uint8_t *out;  /* bytes of a write that the terminal has not taken yet, as they are read there; to be freed */
    size_t n_out;  /* to be set to 0 when the client has gone */
    size_t out_room;
};

/* As read(2) and write(2) on the master, with errno. Where the rates differ, a byte that was sent may be read as up to
 * UART_MOST_PER_BYTE bytes: with less room than that, pty_line_read returns 0. */
ssize_t pty_line_read(const struct pty_line *line, int master, void *buf, size_t len);
ssize_t pty_line_write(struct pty_line *line, int master, const void *buf, size_t len);
/* Writes what waits. 1: nothing waits any more. */
int pty_line_flush(struct pty_line *line, int master);

#endif
