/* SPDX-License-Identifier: MIT */
#include "drivers/socket/socket.h"

#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

enum { BACKLOG = 128, IDLE_S = 10, INTERVAL_S = 5, PROBES = 3, DRAIN_READS = 256 /* 1 MiB */ };

int socket_error_code(int error)
{
    return error == EACCES || error == EPERM                                                           ? SH_EPERM
           : error == EADDRINUSE || error == EADDRNOTAVAIL || error == ENOENT || error == ECONNREFUSED ? SH_EINPUT
                                                                                                       : SH_EIO;
}

int socket_resolve(const char *what, const char *host, int port, int type, struct addrinfo **list, struct sh_err *err)
{
    char service[8];
    snprintf(service, sizeof service, "%u", (unsigned)port & 0xffffu);
    const struct addrinfo hints = {.ai_socktype = type, .ai_flags = AI_NUMERICSERV};
    const int rc = getaddrinfo(host, service, &hints, list);
    if (rc == 0) return SH_OK;
    return sh_fail(err, SH_EINPUT, "%s:%s:%d: no such address: %s", what, host, port,
                   rc == EAI_SYSTEM ? strerror(errno) : gai_strerror(rc));
}

int socket_is_group(const struct sockaddr *address)
{
    const struct sockaddr_in *v4 = (const void *)address;
    const struct sockaddr_in6 *v6 = (const void *)address;
    return address->sa_family == AF_INET6 ? IN6_IS_ADDR_MULTICAST(&v6->sin6_addr)
                                          : IN_MULTICAST(ntohl(v4->sin_addr.s_addr));
}

static int socket_start(int fd, const struct sockaddr *at, socklen_t len, int connecting)
{
    const int one = 1;
    if (connecting) return connect(fd, at, len);
    setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
    return bind(fd, at, len) == 0 ? listen(fd, BACKLOG) : -1;
}

int socket_is_own_end(int fd)
{
    struct sockaddr_storage own = {0}, peer = {0};
    socklen_t own_len = sizeof own, peer_len = sizeof peer;
    return getsockname(fd, (struct sockaddr *)&own, &own_len) == 0 &&
           getpeername(fd, (struct sockaddr *)&peer, &peer_len) == 0 && own.ss_family != AF_UNIX &&
           own_len == peer_len && memcmp(&own, &peer, own_len) == 0;
}

/* connect() blocks, since the other end is on this machine or near. The socket does not block afterwards. */
int socket_open_at(const struct sockaddr *at, socklen_t len, int connecting)
{
    int fd = socket(at->sa_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd < 0) return -1;
    const int is_open = socket_start(fd, at, len, connecting) == 0 && fcntl(fd, F_SETFL, O_NONBLOCK) == 0;
    const int is_own = is_open && connecting && socket_is_own_end(fd);
    if (is_open && !is_own) return fd;
    int error = is_own ? ECONNREFUSED : errno;
    close(fd);
    errno = error;
    return -1;
}

void socket_note_address(int listener, struct socket_address *at)
{
    at->len = sizeof at->at;
    if (getsockname(listener, (struct sockaddr *)&at->at, &at->len) != 0) at->len = 0; /* then it can't listen again */
}

int socket_listen_again(const struct socket_address *at)
{
    return socket_open_at((const struct sockaddr *)&at->at, at->len, 0);
}

int socket_reserve(void)
{
    return open("/dev/null", O_RDONLY | O_CLOEXEC);
}

static int accept_next(int listener, int *reserve, int *fd, struct sockaddr *at, socklen_t *len)
{
    if (*reserve < 0) *reserve = socket_reserve(); /* none could be opened last time */
    *fd = accept4(listener, at, len, SOCK_NONBLOCK | SOCK_CLOEXEC);
    const int starved = *fd < 0 && (errno == EMFILE || errno == ENFILE) && *reserve >= 0;
    if (!starved) return *fd >= 0;
    close(*reserve);
    const int waste = accept4(listener, at, len, SOCK_CLOEXEC);
    if (waste >= 0) close(waste);
    *reserve = socket_reserve();
    return waste >= 0;
}

int socket_accept(int listener, int *reserve, int *fd, struct sockaddr_storage *from, socklen_t *len)
{
    /* One link at a time: else another link's client could take the descriptor that is given up for a moment. */
    static pthread_mutex_t turn = PTHREAD_MUTEX_INITIALIZER;
    pthread_mutex_lock(&turn);
    const int came = accept_next(listener, reserve, fd, (struct sockaddr *)from, len);
    pthread_mutex_unlock(&turn);
    return came;
}

void socket_address_text(const struct sockaddr *address, socklen_t len, char *text, size_t size)
{
    char host[64], port[8];
    if (address->sa_family == AF_UNIX) /* a client has no name, and accept writes none */
        snprintf(text, size, "a local client");
    else if (getnameinfo(address, len, host, sizeof host, port, sizeof port, NI_NUMERICHOST | NI_NUMERICSERV) != 0)
        snprintf(text, size, "unknown address");
    else
        snprintf(text, size, strchr(host, ':') != NULL ? "[%s]:%s" : "%s:%s", host, port);
}

static void name_socket(int fd, int connecting, char *name, size_t len)
{
    struct sockaddr_storage at;
    socklen_t at_len = sizeof at;
    int rc = connecting ? getpeername(fd, (struct sockaddr *)&at, &at_len)
                        : getsockname(fd, (struct sockaddr *)&at, &at_len);
    if (rc == 0) socket_address_text((struct sockaddr *)&at, at_len, name, len);
}

int socket_open(const struct socket_place *place, int *fd, char *name, size_t len, struct sh_err *err)
{
    const char *host = place->host[0] != '\0' ? place->host : "127.0.0.1";
    struct addrinfo *list;
    const int rc = socket_resolve(place->what, host, place->port, SOCK_STREAM, &list, err);
    if (rc != SH_OK) return rc;
    *fd = -1;
    errno = 0;
    for (const struct addrinfo *at = list; at != NULL && *fd < 0 && errno != EINTR; at = at->ai_next)
        *fd = socket_open_at(at->ai_addr, at->ai_addrlen, place->connecting);
    int error = errno;
    freeaddrinfo(list);
    if (*fd < 0)
        return sh_fail(err, socket_error_code(error), "%s:%s:%d: cannot %s: %s%s", place->what, host, place->port,
                       place->connecting ? "connect" : "listen", strerror(error),
                       error == EADDRINUSE ? "; port 0 lets the system choose"
                       : error == EACCES && !place->connecting
                           ? "; ports below 1024 need CAP_NET_BIND_SERVICE (or root, "
                             "or a lower net.ipv4.ip_unprivileged_port_start)"
                           : "");
    name_socket(*fd, place->connecting, name, len);
    return SH_OK;
}

void socket_tune(int fd)
{
    const int one = 1, idle_s = IDLE_S, interval_s = INTERVAL_S, probes = PROBES;
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
    setsockopt(fd, SOL_SOCKET, SO_KEEPALIVE, &one, sizeof one);
    setsockopt(fd, IPPROTO_TCP, TCP_KEEPIDLE, &idle_s, sizeof idle_s);
    setsockopt(fd, IPPROTO_TCP, TCP_KEEPINTVL, &interval_s, sizeof interval_s);
    setsockopt(fd, IPPROTO_TCP, TCP_KEEPCNT, &probes, sizeof probes);
}

void socket_tune_impatient(int fd)
{
    const unsigned timeout_ms = (IDLE_S + INTERVAL_S * PROBES) * 1000;
    setsockopt(fd, IPPROTO_TCP, TCP_USER_TIMEOUT, &timeout_ms, sizeof timeout_ms);
}

ssize_t socket_read(int fd, void *buf, size_t len)
{
    if (len == 0) return 0;
    ssize_t n = recv(fd, buf, len, MSG_DONTWAIT);
    if (n > 0) return n;
    if (n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR)) return 0;
    return SH_ECLOSED;
}

ssize_t socket_write(int fd, const void *buf, size_t len)
{
    ssize_t n = send(fd, buf, len, MSG_DONTWAIT | MSG_NOSIGNAL);
    if (n >= 0) return n;
    /* ENOBUFS and ENOMEM: the system is short of memory for now, the connection is sound. */
    if (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR || errno == ENOBUFS || errno == ENOMEM) return 0;
    return SH_ECLOSED;
}

ssize_t socket_write_heard(int fd, const void *buf, size_t len)
{
    char byte;
    const ssize_t n = socket_write(fd, buf, len);
    return n < 0 && recv(fd, &byte, 1, MSG_DONTWAIT | MSG_PEEK) > 0 ? 0 : n;
}

/* On Linux connecting to AF_UNSPEC resets the connection. */
void socket_break(int fd)
{
    const struct sockaddr none = {.sa_family = AF_UNSPEC};
    connect(fd, &none, sizeof none);
}

void socket_drain(int fd)
{
    char nothing[4096];
    for (int i = 0; i < DRAIN_READS && socket_read(fd, nothing, sizeof nothing) > 0; i++)
        continue;
}

enum socket_state socket_state(int fd, short revents)
{
    if ((revents & (POLLIN | POLLHUP | POLLERR | POLLNVAL)) == 0) return SOCKET_OPEN;
    char byte;
    ssize_t n = recv(fd, &byte, 1, MSG_DONTWAIT | MSG_PEEK);
    if (n == 0)
        return (revents & (POLLHUP | POLLERR)) != 0 ? SOCKET_ENDED : SOCKET_SHUT; /* POLLHUP: both sides are shut */
    return n < 0 && errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR ? SOCKET_ENDED : SOCKET_OPEN;
}
