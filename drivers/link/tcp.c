/* The TCP link: a listener and up to max_sessions clients.
 *
 * A session is over when its peer shuts down its sending side, resets, or vanishes (keep-alive, about 25 s).
 * A client that finds all sessions taken is accepted and closed at once, so that it is told and not left
 * waiting. */
#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "drivers/link/link_util.h"
#include "drivers/link/socket.h"

enum { SEND_BUFFER_BYTES = 1 << 20, BACKLOG = 128 };

enum tcp_state { TCP_FREE, TCP_OPEN, TCP_ENDED /* LINK_CLOSED is still to be told */ };

struct tcp_session {
    enum tcp_state state;
    int fd;
    char peer[64];
};

struct tcp_link {
    int listener;
    int reserve_fd; /* given up for a moment to turn a client away when descriptors run out */
    int n_sessions;
    char name[80];
    struct tcp_session session[LINK_MAX_SESSIONS];
};

static int tcp_listen(const struct addrinfo *at)
{
    const int one = 1, size = SEND_BUFFER_BYTES;
    int fd = socket(at->ai_family, at->ai_socktype | SOCK_NONBLOCK | SOCK_CLOEXEC, at->ai_protocol);
    if (fd < 0) return -1;
    setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
    setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &size, sizeof size); /* inherited by what is accepted */
    if (bind(fd, at->ai_addr, at->ai_addrlen) == 0 && listen(fd, BACKLOG) == 0) return fd;
    int error = errno;
    close(fd);
    errno = error;
    return -1;
}

static int tcp_listen_any(const char *host, int port, int *out, struct sh_err *err)
{
    char service[8];
    snprintf(service, sizeof service, "%u", (unsigned)port & 0xffffu);
    struct addrinfo hints = {.ai_socktype = SOCK_STREAM, .ai_flags = AI_PASSIVE | AI_NUMERICSERV}, *list = NULL;
    int rc = getaddrinfo(host, service, &hints, &list);
    if (rc != 0)
        return sh_fail(err, SH_EINPUT, "link tcp:%s:%d: no such address: %s", host, port,
                       rc == EAI_SYSTEM ? strerror(errno) : gai_strerror(rc));
    int fd = -1, error = 0;
    for (const struct addrinfo *at = list; at != NULL && fd < 0; at = at->ai_next) {
        fd = tcp_listen(at);
        error = errno;
    }
    freeaddrinfo(list);
    if (fd >= 0) {
        *out = fd;
        return SH_OK;
    }
    int code = error == EACCES ? SH_EPERM : error == EADDRINUSE || error == EADDRNOTAVAIL ? SH_EINPUT : SH_EIO;
    return sh_fail(err, code, "link tcp:%s:%d: cannot listen: %s%s", host, port, strerror(error),
                   error == EADDRINUSE ? "; port 0 lets the system choose" : "");
}

static int tcp_open(const struct link_spec *spec, void **link, struct sh_err *err)
{
    const char *host = spec->address[0] != '\0' ? spec->address : "127.0.0.1";
    if (spec->port < 0 || spec->port > 65535)
        return sh_fail(err, SH_EINPUT, "link tcp:%s:%d: allowed ports are 0 to 65535", host, spec->port);
    if (spec->max_sessions < 1 || spec->max_sessions > LINK_MAX_SESSIONS)
        return sh_fail(err, SH_EINPUT, "link tcp:%s:%d: %d sessions; allowed are 1 to %d", host, spec->port,
                       spec->max_sessions, LINK_MAX_SESSIONS);
    struct tcp_link *tcp = calloc(1, sizeof *tcp);
    if (tcp == NULL) return sh_fail(err, SH_ENOMEM, "link tcp:%s:%d: no memory", host, spec->port);
    int rc = tcp_listen_any(host, spec->port, &tcp->listener, err);
    if (rc != SH_OK) {
        free(tcp);
        return rc;
    }
    struct sockaddr_storage at;
    socklen_t len = sizeof at;
    char text[72];
    getsockname(tcp->listener, (struct sockaddr *)&at, &len);
    link_address_text((struct sockaddr *)&at, len, text, sizeof text);
    snprintf(tcp->name, sizeof tcp->name, "tcp:%s", text);
    tcp->n_sessions = spec->max_sessions;
    tcp->reserve_fd = open("/dev/null", O_RDONLY | O_CLOEXEC);
    *link = tcp;
    return SH_OK;
}

static void tcp_endpoint(const void *link, char *buf, size_t len)
{
    const struct tcp_link *tcp = link;
    snprintf(buf, len, "%s", tcp->name);
}

static double tcp_capacity(const void *link)
{
    (void)link;
    return 0;
}

/* Without a free descriptor accept fails and the listener stays readable: poll would spin. */
static int tcp_accept(struct tcp_link *tcp, struct sockaddr_storage *from, socklen_t *len, int *starved)
{
    struct sockaddr *at = (struct sockaddr *)from;
    int fd = accept4(tcp->listener, at, len, SOCK_NONBLOCK | SOCK_CLOEXEC);
    *starved = fd < 0 && (errno == EMFILE || errno == ENFILE) && tcp->reserve_fd >= 0;
    if (!*starved) return fd;
    close(tcp->reserve_fd);
    fd = accept4(tcp->listener, at, len, SOCK_CLOEXEC);
    if (fd >= 0) close(fd);
    tcp->reserve_fd = open("/dev/null", O_RDONLY | O_CLOEXEC);
    return fd;
}

static void tcp_welcome(struct tcp_link *tcp, struct link_events *events)
{
    while (events->n < events->max) {
        struct sockaddr_storage from;
        socklen_t len = sizeof from;
        char peer[64];
        int starved, slot = 0;
        int fd = tcp_accept(tcp, &from, &len, &starved);
        if (fd < 0) return; /* none left, or one that gave up before we came */
        link_address_text((struct sockaddr *)&from, len, peer, sizeof peer);
        while (slot < tcp->n_sessions && tcp->session[slot].state != TCP_FREE)
            slot++;
        if (starved || slot == tcp->n_sessions) {
            if (!starved) close(fd);
            link_events_push(events, LINK_REFUSED, 0, peer);
            continue;
        }
        socket_tune(fd);
        struct tcp_session *session = &tcp->session[slot];
        session->state = TCP_OPEN;
        session->fd = fd;
        snprintf(session->peer, sizeof session->peer, "%s", peer);
        link_events_push(events, LINK_OPENED, slot, peer);
    }
}

/* Returns 1 when the slot is free now. */
static int tcp_tell_closed(struct tcp_session *session, int slot, struct link_events *events)
{
    session->state = TCP_ENDED;
    if (!link_events_push(events, LINK_CLOSED, slot, session->peer)) return 0;
    close(session->fd);
    session->state = TCP_FREE;
    return 1;
}

static int tcp_poll(void *link, int wake_fd, uint32_t want_write, int timeout_ms, struct link_event *event, int max)
{
    struct tcp_link *tcp = link;
    struct link_events events = {event, 0, max};
    struct pollfd fds[2 + LINK_MAX_SESSIONS];
    fds[0] = (struct pollfd){.fd = wake_fd, .events = POLLIN};
    fds[1] = (struct pollfd){.fd = tcp->listener, .events = POLLIN};
    for (int s = 0; s < tcp->n_sessions; s++) {
        struct tcp_session *session = &tcp->session[s];
        if (session->state == TCP_ENDED) tcp_tell_closed(session, s, &events);
        fds[2 + s] = (struct pollfd){.fd = session->state == TCP_OPEN ? session->fd : -1, .events = POLLIN};
        if ((want_write >> s & 1u) != 0) fds[2 + s].events = POLLIN | POLLOUT;
    }
    int rc = link_wait(fds, (nfds_t)(2 + tcp->n_sessions), events.n > 0 ? 0 : timeout_ms);
    if (rc != SH_OK) return rc;
    link_take_wake(&fds[0], &events);
    for (int s = 0; s < tcp->n_sessions; s++) {
        short revents = fds[2 + s].fd >= 0 ? fds[2 + s].revents : 0;
        if (link_stream_ended(fds[2 + s].fd, revents)) {
            tcp_tell_closed(&tcp->session[s], s, &events);
            continue;
        }
        if ((revents & POLLIN) != 0) link_events_push(&events, LINK_READABLE, s, NULL);
        if ((revents & POLLOUT) != 0) link_events_push(&events, LINK_WRITABLE, s, NULL);
    }
    if ((fds[1].revents & POLLIN) != 0) tcp_welcome(tcp, &events);
    return events.n;
}

static struct tcp_session *tcp_session(struct tcp_link *tcp, int session)
{
    if (session < 0 || session >= tcp->n_sessions || tcp->session[session].state != TCP_OPEN) return NULL;
    return &tcp->session[session];
}

static ssize_t tcp_read(void *link, int session, void *buf, size_t len)
{
    struct tcp_session *self = tcp_session(link, session);
    if (self == NULL) return SH_ECLOSED;
    ssize_t n = link_stream_read(self->fd, buf, len);
    if (n < 0) self->state = TCP_ENDED;
    return n;
}

static ssize_t tcp_write(void *link, int session, const void *buf, size_t len)
{
    struct tcp_session *self = tcp_session(link, session);
    if (self == NULL) return SH_ECLOSED;
    ssize_t n = link_stream_write(self->fd, buf, len);
    if (n < 0) self->state = TCP_ENDED;
    return n;
}

static void tcp_close(void *link)
{
    struct tcp_link *tcp = link;
    for (int s = 0; s < tcp->n_sessions; s++)
        if (tcp->session[s].state != TCP_FREE) close(tcp->session[s].fd);
    if (tcp->reserve_fd >= 0) close(tcp->reserve_fd);
    close(tcp->listener);
    free(tcp);
}

const struct link_ops link_tcp = {
    .name = "tcp",
    .open = tcp_open,
    .endpoint = tcp_endpoint,
    .capacity = tcp_capacity,
    .poll = tcp_poll,
    .read = tcp_read,
    .write = tcp_write,
    .close = tcp_close,
};
