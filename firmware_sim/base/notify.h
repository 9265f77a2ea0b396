/* SPDX-License-Identifier: MIT */
/* The service manager's notification socket: sd_notify(3) of systemd.
 *
 * In: lines such as READY=1. Out: one datagram to the socket that $NOTIFY_SOCKET names, a path or @NAME of the abstract
 * names. The protocol is this datagram alone, and systemd keeps it stable for programs that do not use its library. */
#ifndef FIRMWARE_SIM_BASE_NOTIFY_H
#define FIRMWARE_SIM_BASE_NOTIFY_H

#include "core/err.h"

/* Whether $NOTIFY_SOCKET names a socket. */
int notify_is_wanted(void);

/* Sends lines with '\n' between them; SH_OK also without a socket. Waits a second at most. SH_EINPUT: the socket's name
 * is invalid; SH_EIO: nobody has that socket, or its owner does not take the datagram. */
int notify_send(const char *lines, struct sh_err *err);

#endif
