/* SPDX-License-Identifier: MIT */
/* Reads the rates that a terminal's client has set. Private to the pty link. It has a file of its own, since the
 * kernel's struct with rates of any number can't be had beside termios.h. */
#ifndef DRIVERS_LINK_PTY_RATE_H
#define DRIVERS_LINK_PTY_RATE_H

#include "drivers/link/uart.h"

/* Fill in how bytes from the client, and to the client, are read where the head has a rate. A client that has set rate
 * 0 (hang up) has the head's. Return 0, or SH_EIO. */
int pty_rate_from_client(int master, uint32_t baud, struct uart *uart);
int pty_rate_to_client(int master, uint32_t baud, struct uart *uart);

#endif
