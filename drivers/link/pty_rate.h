/* SPDX-License-Identifier: MIT */
/* Reads the rates that a terminal's client has set. Private to the pty link. The code has a file of its own, since
 * <asm/termbits.h>, whose struct termios2 holds rates of any number, can't be included together with <termios.h>. */
#ifndef DRIVERS_LINK_PTY_RATE_H
#define DRIVERS_LINK_PTY_RATE_H

#include "drivers/link/uart.h"

/* Returns whether the receiver reads other bytes than were sent, since the client's rate differs from baud, the head's.
 * to_client: 1 for bytes to the client, 0 for bytes from it. *uart gets what uart_read needs. baud 0: the head takes
 * any rate. A client that has set rate 0 (hang up), or whose rate can't be read, counts as one with the head's rate. */
int pty_rate_differs(int master, uint32_t baud, int to_client, struct uart *uart);

#endif
