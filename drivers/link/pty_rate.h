/* SPDX-License-Identifier: MIT */
/* Reads the rates that a terminal's client has set. Private to the pty link. It has a file of its own, since the
 * kernel's struct with rates of any number can't be had beside termios.h. */
#ifndef DRIVERS_LINK_PTY_RATE_H
#define DRIVERS_LINK_PTY_RATE_H

#include "drivers/link/uart.h"

/* Whether bytes to the client, or from it, are read as others, since its rate differs from the head's; baud 0: from no
 * other. uart then has how they are read. A client that has set rate 0 (hang up), or whose rate can't be had, has the
 * head's. */
int pty_rate_differs(int master, uint32_t baud, int to_client, struct uart *uart);

#endif
