/* SPDX-License-Identifier: MIT */
/* Opens the listening socket of a link: tcp, web. Private. */
#ifndef DRIVERS_LINK_LINK_LISTEN_H
#define DRIVERS_LINK_LINK_LISTEN_H

#include "drivers/link/link.h"
#include "drivers/socket/socket.h"

struct link_listener {
    int fd;         /* -1: unplugged */
    int reserve_fd; /* given up for a moment to turn a client away when descriptors run out; -1: none */
    struct socket_address address;
    char at[72]; /* the same as text: "127.0.0.1:40123" */
};

/* Checks port and sessions of the spec, and listens at its address. what: "link tcp", for errors. SH_EPERM, SH_EINPUT,
 * SH_EIO. */
int link_listen(const char *what, const struct link_spec *spec, struct link_listener *out, struct sh_err *err);

#endif
