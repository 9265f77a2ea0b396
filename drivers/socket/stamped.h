/* SPDX-License-Identifier: MIT */
/* Sockets that report when bytes came: datagrams and TCP streams with the time at which the kernel received them.
 *
 * Times are UTC, in ns since 1970. Only stamped_begin and stamped_connect wait, and stamped_open for a name. Errors:
 * SH_E, as socket.h has them. Any thread. */
#ifndef DRIVERS_SOCKET_STAMPED_H
#define DRIVERS_SOCKET_STAMPED_H

#include <stddef.h>
#include <stdint.h>
#include <sys/socket.h>
#include <sys/types.h>

#include "core/err.h"

/* ---- datagrams */

struct stamped_socket {
    int fd;
    struct sockaddr_storage own; /* with the port that it has */
    socklen_t own_len;
};

/* Opens a socket. host: an address of this machine, 0.0.0.0 or :: for all of them, a broadcast, or a group; a group may
 * have %INTERFACE where its route leads elsewhere. Other programs may read groups and 255.255.255.255 at the same time.
 * port 0: the system chooses. SH_EINPUT (the address is wrong, or the port is taken), SH_EPERM, SH_EIO. */
int stamped_open(const char *host, int port, struct stamped_socket *out, struct sh_err *err);

struct stamped_datagram {
    int64_t t_ns;
    struct sockaddr_storage from, to; /* to: as the datagram has it; the port is the socket's */
    size_t len;
    uint32_t dropped; /* how many the kernel had thrown away before it, modulo 2^32 */
};

/* Takes the next datagram. Returns 1, 0 if there is none, or SH_EIO. A room of 65535 bytes holds any datagram. */
int stamped_take(const struct stamped_socket *socket, void *buf, size_t room, struct stamped_datagram *out,
                 struct sh_err *err);
/* Returns how many datagrams the kernel threw away so far: it had no room, or their checksum was wrong. */
uint64_t stamped_dropped(const struct stamped_socket *socket);
void stamped_close(struct stamped_socket *socket);

/* Waits until the kernel stamps what comes, for about a second at most. The kernel begins to do so some time after a
 * first socket asked for it; until then bytes get the time at which they are read. While `keeper` is open the kernel
 * goes on stamping. Without a loopback interface this does not wait. */
void stamped_begin(struct stamped_socket *keeper);

/* ---- streams */

/* Connects. Waits for at most timeout_ms (0: as long as the system does), or until a signal comes. *fd does not block
 * from then on. */
int stamped_connect(const char *host, int port, int timeout_ms, int *fd, struct sh_err *err);
/* From now on the kernel stamps what a socket of socket.h receives, for stamped_read. */
void stamped_enable(int fd);
/* Returns how many bytes were read; *t_ns: when the last of them came. 0: none now. SH_ECLOSED: the end of the stream.
 * SH_ERESET: the connection broke. */
ssize_t stamped_read(int fd, void *buf, size_t room, int64_t *t_ns);

/* Returns UTC now. */
int64_t stamped_now_ns(void);

#endif
