/* SPDX-License-Identifier: MIT */
/* Carries the bytes of a pty link to and from a client whose bit rate may differ from the head's. Private to the link.
 *
 * Where both rates are the same, or the head has none, bytes pass through unchanged. Else the receiver gets what its
 * UART reads of these bytes (uart.h). The bytes of one write follow each other without a pause, as do those that one
 * read takes. Before and after them the line rests. */
#ifndef DRIVERS_LINK_PTY_LINE_H
#define DRIVERS_LINK_PTY_LINE_H

#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

struct pty_line {
    uint32_t baud; /* of the head; 0: any rate will do */
    uint8_t *out;  /* what the client's UART reads of a write, as far as the terminal has not taken it; to be freed */
    size_t n_out;  /* to be set to 0 when the client has gone */
    size_t out_room;
};

/* pty_line_read and pty_line_write work as read(2) and write(2) on the master, with errno. Where the rates differ, a
 * byte may be read as up to UART_MOST_PER_BYTE bytes: with less room than that, pty_line_read returns 0. pty_line_write
 * returns 0 while bytes of an earlier write wait, or where there is no memory. */
ssize_t pty_line_read(const struct pty_line *line, int master, void *buf, size_t len);
ssize_t pty_line_write(struct pty_line *line, int master, const void *buf, size_t len);
/* Writes what waits. 1: nothing waits any more. */
int pty_line_flush(struct pty_line *line, int master);

#endif
