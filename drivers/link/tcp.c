/* SPDX-License-Identifier: MIT */
/* The TCP link: a listener and up to max_sessions clients.
 *
 * A session is over when its peer resets the connection, has closed its socket, or vanishes. Keep-alive finds a
 * vanished peer after about 25 s. With bytes under way to the peer, the session ends when the system gives up
 * repeating them (socket_tune). A peer that shuts down its sending side is reported as LINK_SHUT, and goes on reading.
 * A peer that has closed its socket looks the same until something is written to it.
 * A client that finds all sessions taken is accepted and closed at once, so that it does not wait. Where
 * clients come for one request, the session that has been silent for longest ends instead. Where a client has shut down
 * its sending side, the session of that client ends instead, once the owner has read what the client sent. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "drivers/link/link_listen.h"
#include "drivers/link/link_poll.h"
#include "drivers/socket/silence.h"

enum { SEND_BUFFER_BYTES = 1 << 20 };

enum tcp_state { TCP_FREE, TCP_OPEN, TCP_ENDED /* LINK_CLOSED is still to be reported */ };

struct tcp_session {
    enum tcp_state state;
    int shut; /* LINK_SHUT was reported */
    int fd;
    uint64_t turn; /* number of the last connection, read or write, in order of time over all sessions */
    char peer[64];
};

struct tcp_link {
    struct link_base base;
    struct link_listener listener;
    int is_silent; /* its cable is pulled */
    int n_sessions, brief;
    uint64_t turns;
    struct tcp_session session[LINK_MAX_SESSIONS];
};

static int tcp_open(const struct link_spec *spec, void **link, struct sh_err *err)
{
    struct tcp_link *tcp = link_new(sizeof *tcp, err, "tcp");
    if (tcp == NULL) return SH_ENOMEM;
    const int rc = link_listen("link tcp", spec, &tcp->listener, err);
    if (rc != SH_OK) {
        free(tcp);
        return rc;
    }
    snprintf(tcp->base.name, sizeof tcp->base.name, "tcp:%s", tcp->listener.at);
    tcp->n_sessions = spec->max_sessions;
    tcp->brief = spec->brief;
    *link = tcp;
    return SH_OK;
}

static int free_slot(const struct tcp_link *tcp)
{
    int slot = 0;
    while (slot < tcp->n_sessions && tcp->session[slot].state != TCP_FREE)
        slot++;
    return slot;
}

/* Ends the first session whose LINK_SHUT the owner has got. */
static void give_up_one(struct tcp_link *tcp)
{
    for (int s = 0; s < tcp->n_sessions; s++) {
        struct tcp_session *session = &tcp->session[s];
        if (session->state != TCP_OPEN || !session->shut) continue;
        session->state = TCP_ENDED;
        return;
    }
}

/* Whether some session's client has gone, or sends no more. The owner may not have heard of it yet. */
static int is_any_ending(const struct tcp_link *tcp)
{
    struct pollfd fds[LINK_MAX_SESSIONS];
    int ending = 0;
    for (int s = 0; s < tcp->n_sessions; s++) {
        ending |= tcp->session[s].state == TCP_ENDED;
        fds[s] =
            (struct pollfd){.fd = tcp->session[s].state == TCP_OPEN ? tcp->session[s].fd : -1, .events = POLLRDHUP};
    }
    return ending || poll(fds, (nfds_t)tcp->n_sessions, 0) > 0;
}

/* Ends the session that has been silent for longest, if a client waits for its place. A session whose bytes wait for
 * the owner is not silent. */
static void tcp_make_room(struct tcp_link *tcp)
{
    struct pollfd waiting = {.fd = tcp->listener.fd, .events = POLLIN};
    struct tcp_session *oldest = NULL;
    if (!tcp->brief || poll(&waiting, 1, 0) <= 0) return;
    for (int i = 0; i < tcp->n_sessions; i++) {
        struct pollfd slot = {.fd = tcp->session[i].fd, .events = POLLIN};
        if (poll(&slot, 1, 0) == 0 && (oldest == NULL || tcp->session[i].turn < oldest->turn))
            oldest = &tcp->session[i];
    }
    if (oldest != NULL) oldest->state = TCP_ENDED;
}

static void tcp_welcome(struct tcp_link *tcp, struct link_events *events)
{
    const int size = SEND_BUFFER_BYTES;
    while (events->n < events->max) {
        struct sockaddr_storage from;
        socklen_t len = sizeof from;
        char peer[64];
        int fd;
        const int slot = free_slot(tcp);
        if (slot == tcp->n_sessions && !is_any_ending(tcp)) tcp_make_room(tcp);
        if (slot == tcp->n_sessions && is_any_ending(tcp)) { /* a later tcp_poll takes the client */
            give_up_one(tcp);
            return;
        }
        if (slot == tcp->n_sessions && tcp->brief) return; /* all have asked something, and are answered soon */
        if (!socket_accept(tcp->listener.fd, &tcp->listener.reserve_fd, &fd, &from, &len))
            return; /* no client waits, or the client has gone before it was accepted */
        socket_address_text((struct sockaddr *)&from, len, peer, sizeof peer);
        if (fd < 0 || slot == tcp->n_sessions) {
            if (fd >= 0) close(fd);
            link_events_push(events, LINK_REFUSED, 0, peer);
            continue;
        }
        socket_tune(fd);
        setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &size, sizeof size);
        struct tcp_session *session = &tcp->session[slot];
        session->state = TCP_OPEN;
        session->shut = 0;
        session->fd = fd;
        session->turn = ++tcp->turns;
        snprintf(session->peer, sizeof session->peer, "%s", peer);
        link_events_push(events, LINK_OPENED, slot, peer);
    }
}

static void tcp_report_closed(struct tcp_session *session, int slot, struct link_events *events)
{
    session->state = TCP_ENDED; /* until there is room for the event */
    if (!link_events_push(events, LINK_CLOSED, slot, session->peer)) return;
    close(session->fd);
    session->state = TCP_FREE;
}

/* Returns a session's entry for poll(2). */
static struct pollfd tcp_slot(const struct tcp_session *session, int want_write)
{
    const int events = (session->shut ? 0 : POLLIN) | (want_write ? POLLOUT : 0);
    return (struct pollfd){.fd = session->state == TCP_OPEN ? session->fd : -1, .events = (short)events};
}

/* Turns the events of a session into those of the link. */
static void tcp_report(struct tcp_session *session, int slot, short revents, struct link_events *events)
{
    const enum socket_state state = socket_state(session->fd, revents);
    if (state == SOCKET_ENDED) {
        tcp_report_closed(session, slot, events);
        return;
    }
    if (state == SOCKET_SHUT)
        session->shut |= link_events_push(events, LINK_SHUT, slot, session->peer);
    else if ((revents & POLLIN) != 0)
        link_events_push(events, LINK_READABLE, slot, NULL);
    if ((revents & POLLOUT) != 0) link_events_push(events, LINK_WRITABLE, slot, NULL);
}

static int tcp_poll(void *link, int wake_fd, uint32_t want_write, int timeout_ms, struct link_event *event, int max)
{
    struct tcp_link *tcp = link;
    struct link_events events = {event, 0, max};
    struct pollfd fds[2 + LINK_MAX_SESSIONS];
    if (tcp->is_silent) return link_poll_sink(wake_fd, 0, timeout_ms, &events);
    fds[0] = (struct pollfd){.fd = wake_fd, .events = POLLIN};
    fds[1] = (struct pollfd){.fd = tcp->listener.fd, .events = POLLIN};
    for (int s = 0; s < tcp->n_sessions; s++) {
        struct tcp_session *session = &tcp->session[s];
        if (session->state == TCP_ENDED) tcp_report_closed(session, s, &events);
        fds[2 + s] = tcp_slot(session, (want_write >> s & 1u) != 0);
    }
    int rc = link_wait(fds, (nfds_t)(2 + tcp->n_sessions), events.n > 0 ? 0 : timeout_ms);
    if (rc != SH_OK) return rc;
    link_take_wake(&fds[0], &events);
    for (int s = 0; s < tcp->n_sessions; s++)
        if (fds[2 + s].fd >= 0) tcp_report(&tcp->session[s], s, fds[2 + s].revents, &events);
    if ((fds[1].revents & POLLIN) != 0) tcp_welcome(tcp, &events);
    return events.n;
}

static struct tcp_session *tcp_session(struct tcp_link *tcp, int session)
{
    if (session < 0 || session >= tcp->n_sessions || tcp->session[session].state != TCP_OPEN) return NULL;
    return &tcp->session[session];
}

/* Notes that a call has moved n bytes for the session; below 0: that it has ended. */
static ssize_t moved(struct tcp_link *tcp, struct tcp_session *session, ssize_t n)
{
    if (n < 0) session->state = TCP_ENDED;
    if (n > 0) session->turn = ++tcp->turns;
    return n;
}

static ssize_t tcp_read(void *link, int session, void *buf, size_t len)
{
    struct tcp_session *self = tcp_session(link, session);
    if (self == NULL) return SH_ECLOSED;
    const ssize_t n = socket_read(self->fd, buf, len);
    struct pollfd now = {.fd = self->fd, .events = POLLIN};
    if (n < 0 && poll(&now, 1, 0) > 0 && socket_state(self->fd, now.revents) == SOCKET_SHUT)
        return 0; /* tcp_poll reports LINK_SHUT */
    return moved(link, self, n);
}

static ssize_t tcp_write(void *link, int session, const void *buf, size_t len)
{
    const struct tcp_link *tcp = link;
    struct tcp_session *self = tcp_session(link, session);
    if (self == NULL) return SH_ECLOSED;
    if (tcp->is_silent) return 0;
    return moved(link, self, socket_write_heard(self->fd, buf, len));
}

/* Sends what was written, then the end of the stream, and does not wait for the client's own end. */
static void tcp_end(void *link, int session)
{
    const struct tcp_link *tcp = link;
    struct tcp_session *self = tcp_session(link, session);
    if (self == NULL) return;
    /* While the cable is pulled, no end is sent: tcp_poll closes the socket once the cable is plugged in again. */
    self->state = TCP_ENDED;
    if (tcp->is_silent) return;
    shutdown(self->fd, SHUT_WR);
    socket_drain(self->fd);
}

/* ---- injected faults */

static int tcp_cut(struct tcp_link *tcp, int session)
{
    struct tcp_session *self = tcp_session(tcp, session);
    if (self == NULL) return SH_ESTATE;
    socket_break(self->fd);
    self->state = TCP_ENDED;
    return SH_OK;
}

/* Collects the sockets of the link's sessions. */
static void tcp_sockets(const struct tcp_link *tcp, int fds[LINK_MAX_SESSIONS])
{
    for (int s = 0; s < LINK_MAX_SESSIONS; s++)
        fds[s] = tcp->session[s].state != TCP_FREE ? tcp->session[s].fd : -1;
}

static int tcp_silence(struct tcp_link *tcp)
{
    int fds[LINK_MAX_SESSIONS];
    if (tcp->listener.fd < 0 || tcp->is_silent) return SH_ESTATE;
    tcp_sockets(tcp, fds);
    const int rc = sockets_silence(tcp->listener.fd, fds, LINK_MAX_SESSIONS);
    tcp->is_silent = rc == SH_OK;
    return rc;
}

static void tcp_speak(struct tcp_link *tcp, int resets)
{
    int fds[LINK_MAX_SESSIONS];
    if (!tcp->is_silent) return;
    tcp_sockets(tcp, fds);
    sockets_speak(tcp->listener.fd, fds, LINK_MAX_SESSIONS);
    tcp->is_silent = 0;
    for (int s = 0; s < tcp->n_sessions && resets; s++)
        tcp_cut(tcp, s);
}

static int tcp_unplug(struct tcp_link *tcp)
{
    if (tcp->listener.fd < 0) return SH_ESTATE;
    tcp->is_silent = 0;      /* the silence need not be undone: its sockets end here */
    close(tcp->listener.fd); /* the system turns clients away that wait there */
    tcp->listener.fd = -1;
    for (int s = 0; s < tcp->n_sessions; s++)
        tcp_cut(tcp, s);
    return SH_OK;
}

static int tcp_plug(struct tcp_link *tcp, int resets)
{
    tcp_speak(tcp, resets);
    if (tcp->listener.fd < 0) tcp->listener.fd = socket_listen_again(&tcp->listener.address);
    return tcp->listener.fd >= 0 ? SH_OK : SH_ESTATE;
}

static int tcp_fault(void *link, enum link_fault what, int session, uint32_t n, double for_ms)
{
    (void)for_ms;
    switch (what) {
    case LINK_FAULT_DISCONNECT:
    case LINK_FAULT_REFUSE:
        return tcp_cut(link, session);
    case LINK_FAULT_UNPLUG:
        return tcp_unplug(link);
    case LINK_FAULT_CABLE:
        return tcp_silence(link);
    case LINK_FAULT_PLUG:
        return tcp_plug(link, (int)n);
    default:
        return SH_ESTATE;
    }
}

static void tcp_close(void *link)
{
    struct tcp_link *tcp = link;
    tcp_speak(tcp, 0); /* else its clients would not hear of the end */
    for (int s = 0; s < tcp->n_sessions; s++) {
        tcp_end(tcp, s); /* else a client that has sent something loses bytes that are on their way to it */
        if (tcp->session[s].state != TCP_FREE) close(tcp->session[s].fd);
    }
    if (tcp->listener.reserve_fd >= 0) close(tcp->listener.reserve_fd);
    if (tcp->listener.fd >= 0) close(tcp->listener.fd);
    free(tcp);
}

const struct link_ops link_tcp = {
    .name = "tcp",
    .faults = LINK_FAULT_BIT(LINK_FAULT_DISCONNECT) | LINK_FAULT_BIT(LINK_FAULT_REFUSE) |
              LINK_FAULT_BIT(LINK_FAULT_UNPLUG) | LINK_FAULT_BIT(LINK_FAULT_CABLE),
    .open = tcp_open,
    .endpoint = link_base_endpoint,
    .poll = tcp_poll,
    .read = tcp_read,
    .write = tcp_write,
    .end = tcp_end,
    .fault = tcp_fault,
    .close = tcp_close,
};
