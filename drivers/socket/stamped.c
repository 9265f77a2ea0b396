/* SPDX-License-Identifier: MIT */
#include "drivers/socket/stamped.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/sock_diag.h>
#include <net/if.h>
#include <netdb.h>
#include <netinet/in.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "drivers/socket/socket.h"

enum { RECEIVE_BUFFER_BYTES = 16 << 20, MAX_HOST = 128 };

int64_t stamped_now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_REALTIME, &t);
    return t.tv_sec * INT64_C(1000000000) + t.tv_nsec;
}

void stamped_enable(int fd)
{
    const int one = 1;
    setsockopt(fd, SOL_SOCKET, SO_TIMESTAMPNS, &one, sizeof one);
}

/* Returns the time in a control message: when the kernel received the bytes. Until the kernel stamps what it receives
 * (stamped_begin waits for that), it is the time at which the bytes were read. */
static int64_t time_of(const struct cmsghdr *c)
{
    struct timespec t;
    memcpy(&t, CMSG_DATA(c), sizeof t);
    return t.tv_sec * INT64_C(1000000000) + t.tv_nsec;
}

static int is_time(const struct cmsghdr *c)
{
    return c->cmsg_level == SOL_SOCKET && c->cmsg_type == SCM_TIMESTAMPNS;
}

/* ---- datagrams */

static struct sockaddr_in *v4(void *address)
{
    return address;
}

static struct sockaddr_in6 *v6(void *address)
{
    return address;
}

static int is_broadcast(struct sockaddr_storage *at)
{
    return at->ss_family == AF_INET && v4(at)->sin_addr.s_addr == htonl(INADDR_BROADCAST);
}

/* Joins the group at `at`, on an interface by its number; 0: on the one that the route leads to. */
static int join(int fd, struct sockaddr_storage *at, unsigned interface)
{
    const int no = 0;
    if (at->ss_family == AF_INET6) {
        const struct ipv6_mreq group = {.ipv6mr_multiaddr = v6(at)->sin6_addr,
                                        .ipv6mr_interface = interface != 0 ? interface : v6(at)->sin6_scope_id};
        return setsockopt(fd, IPPROTO_IPV6, IPV6_ADD_MEMBERSHIP, &group, sizeof group);
    }
    const struct ip_mreqn group = {.imr_multiaddr = v4(at)->sin_addr, .imr_ifindex = (int)interface};
    setsockopt(fd, IPPROTO_IP, IP_MULTICAST_ALL, &no, sizeof no);
    return setsockopt(fd, IPPROTO_IP, IP_ADD_MEMBERSHIP, &group, sizeof group);
}

static int stamped_start(int fd, struct sockaddr_storage *at, socklen_t len, unsigned interface)
{
    const int one = 1, size = RECEIVE_BUFFER_BYTES, is_group = socket_is_group((const struct sockaddr *)at);
    if (setsockopt(fd, SOL_SOCKET, SO_RCVBUFFORCE, &size, sizeof size) != 0) /* needs CAP_NET_ADMIN */
        setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &size, sizeof size);           /* up to net.core.rmem_max */
    stamped_enable(fd);
    setsockopt(fd, SOL_SOCKET, SO_RXQ_OVFL, &one, sizeof one);
    if (is_group || is_broadcast(at)) setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
    if (at->ss_family == AF_INET6) {
        setsockopt(fd, IPPROTO_IPV6, IPV6_V6ONLY, &one, sizeof one);
        setsockopt(fd, IPPROTO_IPV6, IPV6_RECVPKTINFO, &one, sizeof one);
    } else {
        setsockopt(fd, IPPROTO_IP, IP_PKTINFO, &one, sizeof one);
    }
    if (bind(fd, (const struct sockaddr *)at, len) != 0) return -1;
    return is_group ? join(fd, at, interface) : 0;
}

/* Takes "GROUP%INTERFACE" of IPv4 apart, which getaddrinfo does not know. */
static int split_interface(const char *host, char address[MAX_HOST], unsigned *interface, struct sh_err *err)
{
    const char *percent = strchr(host, '%');
    *interface = 0;
    snprintf(address, MAX_HOST, "%s", host);
    if (percent == NULL || strchr(host, ':') != NULL || percent - host >= MAX_HOST) return SH_OK;
    address[percent - host] = '\0';
    *interface = if_nametoindex(percent + 1);
    return *interface != 0 ? SH_OK : sh_fail(err, SH_EINPUT, "udp:%s: there is no interface %s", host, percent + 1);
}

int stamped_open(const char *host, int port, struct stamped_socket *out, struct sh_err *err)
{
    char address[MAX_HOST];
    unsigned interface;
    struct addrinfo *list;
    *out = (struct stamped_socket){.fd = -1, .own_len = sizeof out->own};
    int rc = split_interface(host, address, &interface, err);
    if (rc == SH_OK) rc = socket_resolve("udp", address, port, SOCK_DGRAM, &list, err);
    if (rc != SH_OK) return rc;
    memcpy(&out->own, list->ai_addr, list->ai_addrlen);
    out->fd = socket(list->ai_family, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (out->fd < 0 || stamped_start(out->fd, &out->own, list->ai_addrlen, interface) != 0 ||
        getsockname(out->fd, (struct sockaddr *)&out->own, &out->own_len) != 0) {
        const int error = errno;
        rc = sh_fail(err, error == ENODEV ? SH_EINPUT : socket_error_code(error), "udp:%s:%d: %s%s", host, port,
                     strerror(error),
                     error == EADDRINUSE      ? "; another program reads it"
                     : error == EADDRNOTAVAIL ? "; allowed are this machine's addresses, 0.0.0.0, broadcasts and groups"
                     : error == ENODEV        ? "; there is no route to this group: allowed GROUP%INTERFACE"
                                              : "");
        stamped_close(out);
    }
    freeaddrinfo(list);
    return rc;
}

/* Reads the datagram's destination, its time, and how many were thrown away before it. */
static void read_notes(struct msghdr *m, struct stamped_datagram *out)
{
    for (struct cmsghdr *c = CMSG_FIRSTHDR(m); c != NULL; c = CMSG_NXTHDR(m, c)) {
        struct in_pktinfo to;
        struct in6_pktinfo to6;
        if (is_time(c)) out->t_ns = time_of(c);
        if (c->cmsg_level == SOL_SOCKET && c->cmsg_type == SO_RXQ_OVFL)
            memcpy(&out->dropped, CMSG_DATA(c), sizeof out->dropped);
        if (c->cmsg_level == IPPROTO_IP && c->cmsg_type == IP_PKTINFO) {
            memcpy(&to, CMSG_DATA(c), sizeof to);
            v4(&out->to)->sin_addr = to.ipi_addr;
        }
        if (c->cmsg_level == IPPROTO_IPV6 && c->cmsg_type == IPV6_PKTINFO) {
            memcpy(&to6, CMSG_DATA(c), sizeof to6);
            v6(&out->to)->sin6_addr = to6.ipi6_addr;
        }
    }
}

int stamped_take(const struct stamped_socket *socket, void *buf, size_t room, struct stamped_datagram *out,
                 struct sh_err *err)
{
    _Alignas(struct cmsghdr) char notes[256];
    struct iovec piece = {buf, room};
    struct msghdr m = {.msg_name = &out->from,
                       .msg_namelen = sizeof out->from,
                       .msg_iov = &piece,
                       .msg_iovlen = 1,
                       .msg_control = notes,
                       .msg_controllen = sizeof notes};
    const ssize_t n = recvmsg(socket->fd, &m, MSG_DONTWAIT);
    if (n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR || errno == ECONNREFUSED)) return 0;
    if (n < 0) return sh_fail(err, SH_EIO, "udp: %s", strerror(errno));
    out->t_ns = out->dropped = 0;
    out->to = socket->own;
    out->len = (size_t)n;
    read_notes(&m, out);
    if (out->t_ns == 0) out->t_ns = stamped_now_ns();
    return 1;
}

uint64_t stamped_dropped(const struct stamped_socket *socket)
{
    uint32_t info[SK_MEMINFO_VARS] = {0};
    socklen_t len = sizeof info;
    if (socket->fd < 0 || getsockopt(socket->fd, SOL_SOCKET, SO_MEMINFO, info, &len) != 0) return 0;
    return info[SK_MEMINFO_DROPS];
}

void stamped_close(struct stamped_socket *socket)
{
    if (socket->fd >= 0) close(socket->fd);
    socket->fd = -1;
}

void stamped_begin(struct stamped_socket *keeper)
{
    enum { TRIES = 1000 };
    struct stamped_datagram got;
    struct sh_err err;
    char byte = 0;
    if (stamped_open("127.0.0.1", 0, keeper, &err) != SH_OK) return;
    for (int i = 0; i < TRIES; i++) {
        if (sendto(keeper->fd, &byte, 1, 0, (struct sockaddr *)&keeper->own, keeper->own_len) != 1) return;
        const int64_t sent_ns = stamped_now_ns();
        poll(NULL, 0, 1); /* so if the byte is stamped only when it is read, its time is after sent_ns */
        if (stamped_take(keeper, &byte, 1, &got, &err) != 1 || got.t_ns <= sent_ns) return;
    }
}

/* ---- streams */

static int connect_at(const struct addrinfo *at, int timeout_ms)
{
    const struct timeval limit = {.tv_sec = timeout_ms / 1000, .tv_usec = timeout_ms % 1000 * 1000};
    const int fd = socket(at->ai_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd < 0) return -1;
    setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &limit, sizeof limit);
    stamped_enable(fd);
    const int is_open = connect(fd, at->ai_addr, at->ai_addrlen) == 0;
    const int is_own = is_open && socket_is_own_end(fd);
    if (is_open && !is_own && fcntl(fd, F_SETFL, O_NONBLOCK) == 0) return fd;
    const int error = is_own ? ECONNREFUSED : errno == EINPROGRESS ? ETIMEDOUT : errno;
    close(fd);
    errno = error;
    return -1;
}

int stamped_connect(const char *host, int port, int timeout_ms, int *fd, struct sh_err *err)
{
    struct addrinfo *list;
    const int rc = socket_resolve("tcp", host, port, SOCK_STREAM, &list, err);
    if (rc != SH_OK) return rc;
    *fd = -1;
    errno = 0;
    for (const struct addrinfo *at = list; at != NULL && *fd < 0 && errno != EINTR; at = at->ai_next)
        *fd = connect_at(at, timeout_ms);
    const int error = errno;
    freeaddrinfo(list);
    if (*fd < 0) return sh_fail(err, SH_EIO, "tcp:%s:%d: cannot connect: %s", host, port, strerror(error));
    socket_tune(*fd);
    return SH_OK;
}

ssize_t stamped_read(int fd, void *buf, size_t room, int64_t *t_ns)
{
    _Alignas(struct cmsghdr) char notes[256];
    struct iovec piece = {buf, room};
    struct msghdr m = {.msg_iov = &piece, .msg_iovlen = 1, .msg_control = notes, .msg_controllen = sizeof notes};
    const ssize_t n = recvmsg(fd, &m, MSG_DONTWAIT);
    if (n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR)) return 0;
    *t_ns = stamped_now_ns();
    if (n == 0) return SH_ECLOSED;
    if (n < 0) return SH_ERESET;
    for (struct cmsghdr *c = CMSG_FIRSTHDR(&m); c != NULL; c = CMSG_NXTHDR(&m, c))
        if (is_time(c)) *t_ns = time_of(c);
    return n;
}
