/* SPDX-License-Identifier: MIT */
/* Stream sockets, for links and USB back ends: opening, settings, bytes in and out. Nothing here waits, with three
 * exceptions: socket_resolve waits for names, socket_open_at for a connection, and socket_open for both.
 *
 * Errors: SH_E; where there is an err, its text names the socket by socket_place.what. Any thread. */
#ifndef DRIVERS_SOCKET_SOCKET_H
#define DRIVERS_SOCKET_SOCKET_H

#include <stddef.h>
#include <sys/socket.h>
#include <sys/types.h>

#include "core/err.h"

/* Where a TCP socket listens or connects to. */
struct socket_place {
    const char *what; /* "usbip", for errors */
    const char *host; /* numeric or name; empty: 127.0.0.1 */
    int port;         /* 0: the system chooses */
    int connecting;   /* 1: connects, 0: listens */
};

/* Looks up the addresses of a host and port, and waits for them. type: SOCK_STREAM or SOCK_DGRAM. *list is not empty;
 * freeaddrinfo releases it. SH_EINPUT. */
struct addrinfo;
int socket_resolve(const char *what, const char *host, int port, int type, struct addrinfo **list, struct sh_err *err);
/* Whether an address of IPv4 or IPv6 is that of a multicast group. */
int socket_is_group(const struct sockaddr *address);

/* Opens a listening or connected socket, which does not block. Waits for names and for the connection. name gets its
 * own address or, where it connects, that of its peer, as "127.0.0.1:40123" or "[::1]:40123". SH_EPERM, SH_EINPUT (the
 * address), SH_EIO. */
int socket_open(const struct socket_place *place, int *fd, char *name, size_t len, struct sh_err *err);
/* Does the same at a known address of any family. Returns a descriptor, or -1 with errno. */
int socket_open_at(const struct sockaddr *at, socklen_t len, int connecting);
/* Listens again at the address of a listener whose socket is closed by now. The name is not looked up again, since it
 * may lead to another address. Returns a descriptor, or -1 with errno. */
struct socket_address {
    struct sockaddr_storage at;
    socklen_t len;
};
int socket_listen_again(const struct socket_address *at);
/* Fills in the address of a listener, for socket_listen_again. */
void socket_note_address(int listener, struct socket_address *at);
/* Whether a socket is connected to itself. TCP does that where nobody listens on a port of this machine, and the system
 * gives that same port to the socket that connects to it. */
int socket_is_own_end(int fd);
/* Returns the SH_E for an errno of opening, binding or connecting a socket. */
int socket_error_code(int error);

/* Returns a descriptor in reserve, which socket_accept closes for a moment when no other is left; -1: none is left. */
int socket_reserve(void);
/* Accepts a listener's next client. Returns 0: there is none. 1: *fd is its descriptor, which does not block, or -1 if
 * the process or the system had no descriptor left. A client without a descriptor is turned away, since it would wake
 * the listener's thread again and again otherwise. reserve: socket_reserve()'s; its owner closes it. from may be NULL.
 * Listeners in several threads take turns. */
int socket_accept(int listener, int *reserve, int *fd, struct sockaddr_storage *from, socklen_t *len);

/* Writes an address as "127.0.0.1:40123" or "[::1]:40123"; that of a Unix socket's client as "a local client". */
void socket_address_text(const struct sockaddr *address, socklen_t len, char *text, size_t size);

/* Sets up a connected TCP socket; others stay as they are. Small packets leave at once. A peer that has vanished
 * without a word ends the connection after about 25 s. With bytes under way to the peer, the end takes until the
 * system gives up repeating them (Linux: some 15 minutes). */
void socket_tune(int fd);
/* After socket_tune, for a peer that always reads: the connection ends after about 25 s with bytes under way, too.
 * This limit also cuts off a peer that only pauses for so long. */
void socket_tune_impatient(int fd);

/* socket_read and socket_write move bytes of a connected socket, and never block or raise SIGPIPE. They return how many
 * bytes; 0: none now; SH_ECLOSED: end of stream, reset or any other failure. */
ssize_t socket_read(int fd, void *buf, size_t len);
ssize_t socket_write(int fd, const void *buf, size_t len);
/* As socket_write, but when the peer has gone it returns 0 until all that the peer sent is read. So the last request of
 * a client that left is not lost. Only for callers that read whenever poll says so. */
ssize_t socket_write_heard(int fd, const void *buf, size_t len);
/* Breaks a connected TCP socket: its peer sees a reset, and loses what it has not taken. The descriptor stays. */
void socket_break(int fd);
/* Reads and throws away what has come, so that closing the socket does not reset the connection. A peer that sends
 * faster than socket_drain reads is not waited for. */
void socket_drain(int fd);

/* The state of a connected socket, from the events of poll(2). */
enum socket_state {
    SOCKET_OPEN,  /* bytes may come, or are there */
    SOCKET_SHUT,  /* the peer sends nothing more, and all of it was read; the peer may still read. On Linux a peer that
                   * has closed its TCP socket looks the same until something is written to it */
    SOCKET_ENDED, /* the peer is gone and nothing is left to read */
};
enum socket_state socket_state(int fd, short revents);

#endif
