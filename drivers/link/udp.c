/* SPDX-License-Identifier: MIT */
/* The UDP link: one session, open from the start. Each write is one datagram to the receiver.
 *
 * The link sends unicast to any address, but broadcast only from an interface that the configuration names: to that
 * interface's own broadcast address, or to 255.255.255.255. The packets' source is then the interface's address, unless
 * the link names its source. But the system's routes choose the interface for packets to 255.255.255.255,
 * whatever their source is. So such packets are sent to the named interface's own broadcast address instead.
 * (SO_BINDTODEVICE would direct them, but takes a privilege.)
 * Multicast, too, goes out only on an interface that is named.
 *
 * A source port may be one that a receiver on this machine listens on, too. So addresses are shared (SO_REUSEADDR), and
 * the socket is connected: it gets only what its receiver sends back. The socket never has its receiver's own address
 * and port, since it would get its own packets. On the loopback, with the receiver's port as the source port, the
 * source is the next address: 127.0.0.2 for a receiver at 127.0.0.1. A receiver on this machine that doesn't share its
 * port (MRPT, PCL) could not listen while the link has that port. So for a receiver on this machine the usual source
 * port of a protocol is not used, unless the link names its source or its interface.
 *
 * A receiver that is not there is no failure: datagrams to it are lost, as are those that the system has no route or no
 * memory for. Both losses are counted. While the socket's buffer is full, udp_write takes nothing. A refused datagram
 * counts when its refusal comes; several may share one refusal. Datagrams that arrive at the socket can be read. */
#include <arpa/inet.h>
#include <errno.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netdb.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "drivers/link/link_poll.h"
#include "drivers/socket/socket.h"

enum { SEND_BUFFER_BYTES = 1 << 20, DRAIN_READS = 4096 };

struct udp_link {
    struct link_base base;
    int fd;
    int unplugged;
    int is_silent; /* its cable is pulled */
    int closing;   /* LINK_CLOSED is to be reported */
    uint64_t refused;
    char notice[200]; /* to be reported; empty: none */
};

static const char *host_of(const struct link_spec *spec)
{
    return spec->address[0] != '\0' ? spec->address : "127.0.0.1";
}

/* A name with addresses of IPv4 and IPv6, such as localhost, leads to the IPv4 one. Receivers of datagrams often listen
 * on IPv4 alone. They send no answer that would show on which address they listen. */
static int find_receiver(const struct link_spec *spec, struct sockaddr_storage *to, socklen_t *len, struct sh_err *err)
{
    struct addrinfo *list;
    if (spec->port < 1 || spec->port > 65535)
        return sh_fail(err, SH_EINPUT, "link udp:%s:%d: allowed ports are 1 to 65535", host_of(spec), spec->port);
    const int rc = socket_resolve("link udp", host_of(spec), spec->port, SOCK_DGRAM, &list, err);
    if (rc != SH_OK) return rc;
    const struct addrinfo *chosen = list;
    while (chosen != NULL && chosen->ai_family != AF_INET)
        chosen = chosen->ai_next;
    if (chosen == NULL) chosen = list;
    memcpy(to, chosen->ai_addr, chosen->ai_addrlen);
    *len = chosen->ai_addrlen;
    freeaddrinfo(list);
    return SH_OK;
}

static in_addr_t ipv4_of(const struct sockaddr *at)
{
    return ((const struct sockaddr_in *)(const void *)at)->sin_addr.s_addr;
}

/* An interface, as far as the link needs it. */
struct network {
    int found, has_broadcast;
    struct sockaddr_storage own; /* its address, of the receiver's family */
    socklen_t own_len;
    in_addr_t broadcast;
};

static int is_in_network(const struct ifaddrs *i, const struct sockaddr *to)
{
    return to->sa_family == AF_INET && i->ifa_netmask != NULL &&
           ((ipv4_of(i->ifa_addr) ^ ipv4_of(to)) & ipv4_of(i->ifa_netmask)) == 0;
}

/* name: of the interface; NULL: any that has `to` as its broadcast address. Where the interface has several addresses,
 * that of the receiver's network is taken, else the first. */
static int find_network(const char *name, const struct sockaddr *to, struct network *out, struct sh_err *err)
{
    struct ifaddrs *list;
    int is_near = 0;
    memset(out, 0, sizeof *out);
    if (getifaddrs(&list) != 0) return sh_fail(err, SH_EIO, "link udp: the interfaces: %s", strerror(errno));
    for (const struct ifaddrs *i = list; i != NULL && !is_near; i = i->ifa_next) {
        if (i->ifa_addr == NULL || i->ifa_addr->sa_family != to->sa_family) continue;
        int is_v4 = to->sa_family == AF_INET;
        int broadcasts = is_v4 && (i->ifa_flags & IFF_BROADCAST) != 0 && i->ifa_broadaddr != NULL;
        if (name != NULL ? strcmp(i->ifa_name, name) != 0 : !broadcasts || ipv4_of(i->ifa_broadaddr) != ipv4_of(to))
            continue;
        is_near = is_in_network(i, to);
        if (out->found && !is_near) continue;
        out->found = 1;
        out->own_len = is_v4 ? sizeof(struct sockaddr_in) : sizeof(struct sockaddr_in6);
        memcpy(&out->own, i->ifa_addr, out->own_len);
        out->has_broadcast = broadcasts;
        if (broadcasts) out->broadcast = ipv4_of(i->ifa_broadaddr);
    }
    freeifaddrs(list);
    return SH_OK;
}

/* Broadcasts go out on the interface that is named, and on no other. Where `to` is 255.255.255.255, it becomes that
 * interface's broadcast address. *broadcast: whether `to` is a broadcast address. */
static int check_receiver(const struct link_spec *spec, struct sockaddr *to, struct network *net, int *broadcast,
                          struct sh_err *err)
{
    const char *host = host_of(spec);
    const int named = spec->interface[0] != '\0', to_all = to->sa_family == AF_INET && ipv4_of(to) == INADDR_BROADCAST;
    if (socket_is_group(to) && !named)
        return sh_fail(err, SH_EINPUT, "link udp:%s:%d: multicast needs the key interface: the interface that sends it",
                       host, spec->port);
    int rc = find_network(named ? spec->interface : NULL, to, net, err);
    if (rc != SH_OK) return rc;
    if (named && !net->found)
        return sh_fail(err, SH_EINPUT,
                       "link udp:%s:%d: interface %s doesn't exist, or has no address of the receiver's family", host,
                       spec->port, spec->interface);
    *broadcast = to_all || (net->has_broadcast && ipv4_of(to) == net->broadcast);
    if (*broadcast && !named)
        return sh_fail(err, SH_EINPUT,
                       "link udp:%s:%d: a broadcast needs the key interface: the interface that sends it", host,
                       spec->port);
    if (*broadcast && !net->has_broadcast)
        return sh_fail(err, SH_EINPUT,
                       "link udp:%s:%d: interface %s has no broadcast address; allowed is an interface that has one",
                       host, spec->port, spec->interface);
    if (to_all) ((struct sockaddr_in *)(void *)to)->sin_addr.s_addr = net->broadcast;
    return SH_OK;
}

/* Sets the TTL of packets, and the interface that packets to a group go out on. */
static int set_way(int fd, const struct link_spec *spec, const struct sockaddr *to)
{
    const int ttl = spec->ttl, is_v4 = to->sa_family == AF_INET;
    const int level = is_v4 ? IPPROTO_IP : IPPROTO_IPV6;
    if (!socket_is_group(to))
        return ttl == 0 ? 0 : setsockopt(fd, level, is_v4 ? IP_TTL : IPV6_UNICAST_HOPS, &ttl, sizeof ttl);
    const int number = (int)if_nametoindex(spec->interface), hops = ttl != 0 ? ttl : 1;
    const struct ip_mreqn out = {.imr_ifindex = number};
    if (setsockopt(fd, level, is_v4 ? IP_MULTICAST_TTL : IPV6_MULTICAST_HOPS, &hops, sizeof hops) != 0) return -1;
    return is_v4 ? setsockopt(fd, level, IP_MULTICAST_IF, &out, sizeof out)
                 : setsockopt(fd, level, IPV6_MULTICAST_IF, &number, sizeof number);
}

static in_port_t *port_of(struct sockaddr_storage *at)
{
    return at->ss_family == AF_INET ? &((struct sockaddr_in *)(void *)at)->sin_port
                                    : &((struct sockaddr_in6 *)(void *)at)->sin6_port;
}

static int is_same_place(const struct sockaddr_storage *a, const struct sockaddr_storage *b)
{
    char text[2][72];
    socket_address_text((const struct sockaddr *)a, sizeof *a, text[0], sizeof text[0]);
    socket_address_text((const struct sockaddr *)b, sizeof *b, text[1], sizeof text[1]);
    return strcmp(text[0], text[1]) == 0;
}

/* Asks the system for the source that it would choose. */
static int ask_source(const struct sockaddr_storage *to, socklen_t len, struct sockaddr_storage *from)
{
    socklen_t from_len = sizeof *from;
    const int fd = socket(to->ss_family, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    const int ok = fd >= 0 && connect(fd, (const struct sockaddr *)to, len) == 0 &&
                   getsockname(fd, (struct sockaddr *)from, &from_len) == 0;
    if (fd >= 0) close(fd);
    return ok ? 0 : -1;
}

/* Returns whether a receiver is on this machine. The system sends packets to it from the address `from`. */
static int is_own_machine(const struct sockaddr_storage *to, const struct sockaddr_storage *from)
{
    struct sockaddr_storage a = *to, b = *from;
    *port_of(&a) = *port_of(&b) = 0;
    return is_same_place(&a, &b) ||
           (b.ss_family == AF_INET && ntohl(ipv4_of((struct sockaddr *)&b)) >> 24 == IN_LOOPBACKNET);
}

/* Whether the address can be that of one machine: not a group, a broadcast or "all addresses". */
static int is_of_one(const struct sockaddr_storage *at)
{
    struct ifaddrs *list;
    if (socket_is_group((const struct sockaddr *)at)) return 0;
    if (at->ss_family != AF_INET)
        return !IN6_IS_ADDR_UNSPECIFIED(&((const struct sockaddr_in6 *)(const void *)at)->sin6_addr);
    const in_addr_t own = ipv4_of((const struct sockaddr *)at);
    int ok = own != INADDR_ANY && own != INADDR_BROADCAST;
    if (!ok || getifaddrs(&list) != 0) return ok;
    for (const struct ifaddrs *i = list; i != NULL; i = i->ifa_next) {
        if (i->ifa_addr == NULL || i->ifa_netmask == NULL || i->ifa_addr->sa_family != AF_INET) continue;
        const in_addr_t mask = ipv4_of(i->ifa_netmask);
        if (mask != INADDR_BROADCAST && (own | mask) == INADDR_BROADCAST &&
            is_in_network(i, (const struct sockaddr *)at))
            ok = 0;
    }
    freeifaddrs(list);
    return ok;
}

/* Finds the source of packets, with its port. Returns 0: the system chooses it; 1: it is *from; -1: errno. */
static int find_source(const struct link_spec *spec, const struct sockaddr_storage *to, socklen_t len,
                       const struct network *net, struct sockaddr_storage *from)
{
    memset(from, 0, sizeof *from);
    from->ss_family = to->ss_family;
    if (spec->source[0] != '\0') {
        struct sockaddr_in *v4 = (struct sockaddr_in *)(void *)from;
        struct sockaddr_in6 *v6 = (struct sockaddr_in6 *)(void *)from;
        errno = EADDRNOTAVAIL;
        if (to->ss_family == AF_INET ? inet_pton(AF_INET, spec->source, &v4->sin_addr) != 1
                                     : inet_pton(AF_INET6, spec->source, &v6->sin6_addr) != 1)
            return -1;
        if (!is_of_one(from)) return -1;
    } else if (net->found && spec->interface[0] != '\0') {
        memcpy(from, &net->own, net->own_len);
    } else if (spec->source_port == 0) {
        return 0;
    } else if (ask_source(to, len, from) != 0) {
        return -1;
    } else if (spec->usual_port && is_own_machine(to, from)) {
        return 0;
    }
    *port_of(from) = htons((uint16_t)spec->source_port);
    if (spec->source[0] == '\0' && is_same_place(from, to) && from->ss_family == AF_INET) {
        struct in_addr *at = &((struct sockaddr_in *)(void *)from)->sin_addr;
        if (ntohl(at->s_addr) >> 24 == IN_LOOPBACKNET) at->s_addr = htonl(ntohl(at->s_addr) + 1);
    }
    return 1;
}

/* Binds to the source. Where its port can't be had and another will do, the system chooses one. */
static int bind_source(int fd, const struct link_spec *spec, const struct sockaddr_storage *to, socklen_t len,
                       struct sockaddr_storage *from, char notice[200])
{
    const int one = 1;
    const int own = spec->source_port != 0 && is_same_place(from, to);
    errno = EADDRINUSE; /* if the receiver has this very address, bind() is not tried */
    if (spec->source_port != 0) setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
    if (!own && bind(fd, (struct sockaddr *)from, len) == 0) return 0;
    if (spec->source_port == 0 || !spec->usual_port || errno != EADDRINUSE) return -1;
    const int zero = 0;
    *port_of(from) = 0;
    setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &zero, sizeof zero);
    if (bind(fd, (struct sockaddr *)from, len) != 0) return -1;
    snprintf(
        notice, 200,
        "port %d can't be used as the source: %s; set source to another address, or source_port: 0 to hide this notice",
        spec->source_port, own ? "the receiver has the same address and port" : "another program uses it exclusively");
    return 0;
}

/* The receiver of packets, and the interface that leads to it. */
struct receiver {
    struct sockaddr_storage at;
    socklen_t len;
    struct network net;
    int broadcast;
};

static int connect_to(int fd, const struct link_spec *spec, const struct receiver *to, char notice[200])
{
    const int one = 1, size = SEND_BUFFER_BYTES;
    struct sockaddr_storage from;
    setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &size, sizeof size);
    if (to->broadcast && setsockopt(fd, SOL_SOCKET, SO_BROADCAST, &one, sizeof one) != 0) return -1;
    if (set_way(fd, spec, (const struct sockaddr *)&to->at) != 0) return -1;
    const int has_source = find_source(spec, &to->at, to->len, &to->net, &from);
    if (has_source < 0) return -1;
    if (has_source && bind_source(fd, spec, &to->at, to->len, &from, notice) != 0) return -1;
    return connect(fd, (const struct sockaddr *)&to->at, to->len);
}

/* Writes ", from 127.0.0.2:2368" or ", from port 2368", for errors. */
static void source_text(const struct link_spec *spec, char *text, size_t size)
{
    text[0] = '\0';
    if (spec->source[0] != '\0')
        snprintf(text, size, ", from %s:%d", spec->source, spec->source_port);
    else if (spec->source_port != 0)
        snprintf(text, size, ", from port %d", spec->source_port);
}

static int udp_open(const struct link_spec *spec, void **link, struct sh_err *err)
{
    struct receiver to = {.len = 0};
    int rc = find_receiver(spec, &to.at, &to.len, err);
    if (rc == SH_OK) rc = check_receiver(spec, (struct sockaddr *)&to.at, &to.net, &to.broadcast, err);
    if (rc != SH_OK) return rc;
    struct udp_link *udp = link_new(sizeof *udp, err, "udp:%s:%d", host_of(spec), spec->port);
    if (udp == NULL) return SH_ENOMEM;
    udp->fd = socket(to.at.ss_family, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (udp->fd < 0 || connect_to(udp->fd, spec, &to, udp->notice) != 0) {
        const int why = errno;
        char from[96];
        source_text(spec, from, sizeof from);
        rc = sh_fail(
            err, socket_error_code(why), "link udp:%s:%d%s: %s%s", host_of(spec), spec->port, from, strerror(why),
            why == EADDRNOTAVAIL ? "; allowed is a numeric address of this machine, IPv4 or IPv6 as the receiver's"
            : why == EADDRINUSE  ? "; a receiver on this machine with that port must share it (SO_REUSEADDR), and "
                                   "have another address than the source"
                                 : "");
        if (udp->fd >= 0) close(udp->fd);
        free(udp);
        return rc;
    }
    char at[72];
    socket_address_text((struct sockaddr *)&to.at, to.len, at, sizeof at);
    snprintf(udp->base.name, sizeof udp->base.name, "udp:%s", at);
    *link = udp;
    return SH_OK;
}

static int udp_poll(void *link, int wake_fd, uint32_t want_write, int timeout_ms, struct link_event *event, int max)
{
    struct udp_link *udp = link;
    struct link_events events = {event, 0, max};
    if (udp->closing && link_events_push(&events, LINK_CLOSED, 0, udp->base.name))
        udp->base.reported_opened = udp->closing = 0;
    if (!udp->base.reported_opened && !udp->unplugged)
        udp->base.reported_opened = link_events_push(&events, LINK_OPENED, 0, udp->base.name);
    if (udp->notice[0] != '\0' && link_events_push(&events, LINK_NOTICE, 0, udp->notice)) udp->notice[0] = '\0';
    struct pollfd fds[2] = {{.fd = wake_fd, .events = POLLIN},
                            {.fd = udp->unplugged || udp->is_silent ? -1 : udp->fd, .events = POLLIN}};
    if ((want_write & 1u) != 0) fds[1].events = POLLIN | POLLOUT;
    int rc = link_wait(fds, 2, events.n > 0 ? 0 : timeout_ms);
    if (rc != SH_OK) return rc;
    link_take_wake(&fds[0], &events);
    if ((fds[1].revents & POLLIN) != 0) link_events_push(&events, LINK_READABLE, 0, NULL);
    if ((fds[1].revents & POLLOUT) != 0) link_events_push(&events, LINK_WRITABLE, 0, NULL);
    if ((fds[1].revents & POLLERR) != 0) { /* a datagram was refused; reading SO_ERROR clears POLLERR */
        int error;
        socklen_t len = sizeof error;
        if (getsockopt(udp->fd, SOL_SOCKET, SO_ERROR, &error, &len) == 0 && error != 0) udp->refused++;
    }
    return events.n;
}

static ssize_t udp_read(void *link, int session, void *buf, size_t len)
{
    struct udp_link *udp = link;
    if (session != 0 || udp->unplugged || udp->closing) return SH_ECLOSED;
    if (udp->is_silent) return 0;
    ssize_t n = recv(udp->fd, buf, len, MSG_DONTWAIT);
    return n > 0 ? n : 0;
}

/* A refusal of an earlier datagram is reported by the next send, which sends nothing: so it is tried again. */
static ssize_t udp_write(void *link, int session, const void *buf, size_t len)
{
    struct udp_link *udp = link;
    if (session != 0 || udp->unplugged || udp->closing) return SH_ECLOSED;
    for (int tries = 0; tries < 2 && !udp->is_silent; tries++) {
        if (send(udp->fd, buf, len, MSG_DONTWAIT | MSG_NOSIGNAL) >= 0) return (ssize_t)len;
        if (errno == EAGAIN || errno == EWOULDBLOCK) return 0;
        if (errno != ECONNREFUSED && errno != EINTR) break;
        udp->refused += errno == ECONNREFUSED;
    }
    udp->refused++;
    return (ssize_t)len; /* without a cable, a route or memory the datagram is lost, as it may be on any way */
}

/* The socket stays, so that the source of the datagrams stays the same. Datagrams that came meanwhile are dropped. */
static int udp_fault(void *link, enum link_fault what, int session, uint32_t n, double for_ms)
{
    struct udp_link *udp = link;
    char nothing[2048];
    (void)session, (void)n, (void)for_ms;
    if (what == LINK_FAULT_UNPLUG && !udp->unplugged) {
        udp->unplugged = 1;
        udp->closing = udp->base.reported_opened;
        return SH_OK;
    }
    if (what == LINK_FAULT_CABLE && !udp->unplugged && !udp->is_silent) {
        udp->is_silent = 1;
        return SH_OK;
    }
    if (what != LINK_FAULT_PLUG) return SH_ESTATE;
    const int was_away = udp->unplugged || udp->is_silent;
    for (int i = 0; i < DRAIN_READS && was_away && recv(udp->fd, nothing, sizeof nothing, MSG_DONTWAIT) >= 0; i++)
        continue; /* a sender that is faster than this is not waited for */
    udp->unplugged = udp->is_silent = 0;
    return SH_OK;
}

static uint64_t udp_refused(const void *link)
{
    const struct udp_link *udp = link;
    return udp->refused;
}

static void udp_close(void *link)
{
    struct udp_link *udp = link;
    close(udp->fd);
    free(udp);
}

const struct link_ops link_udp = {
    .name = "udp",
    .datagrams = 1,
    .faults = LINK_FAULT_BIT(LINK_FAULT_UNPLUG) | LINK_FAULT_BIT(LINK_FAULT_CABLE),
    .open = udp_open,
    .endpoint = link_base_endpoint,
    .poll = udp_poll,
    .read = udp_read,
    .write = udp_write,
    .refused = udp_refused,
    .fault = udp_fault,
    .close = udp_close,
};
