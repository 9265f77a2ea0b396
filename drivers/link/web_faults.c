/* SPDX-License-Identifier: MIT */
/* Injected faults of a web link: clients that are cut off, a link that is unplugged, a cable that is pulled. */
#include <sys/socket.h>

#include "drivers/link/web_inside.h"
#include "drivers/socket/silence.h"

/* Breaks the connection, or the listening socket, at once; libwebsockets closes the socket when it notices. */
static void web_break(struct lws *wsi)
{
    const int fd = web_lws.lws_get_socket_fd(wsi);
    if (wsi == web_link_of(wsi)->listening)
        shutdown(fd, SHUT_RDWR); /* no client is accepted any more, and those that wait are turned away */
    else
        socket_break(fd);
}

/* Cuts a session off. The session's client gets no close frame, and none of the bytes that wait for it. */
static int web_cut(struct web_link *web, int session)
{
    struct web_session *s = web_session(web, session);
    if (s == NULL) return SH_ESTATE;
    s->in_len = s->whole_len = 0;
    if (s->wsi == NULL) return SH_ESTATE;
    web_break(s->wsi);
    web_session_gone(web_lws.lws_get_opaque_user_data(s->wsi));
    return SH_OK;
}

static void web_break_all(struct web_link *web)
{
    for (int s = 0; s < web->n_sessions; s++)
        web_cut(web, s);
    for (int i = 0; i < WEB_PLACES; i++)
        if (web->conn[i].wsi != NULL) web_break(web->conn[i].wsi);
}

/* Collects the sockets of all clients of the link. */
static void web_sockets(const struct web_link *web, int fds[WEB_PLACES])
{
    for (int i = 0; i < WEB_PLACES; i++)
        fds[i] = web->conn[i].wsi != NULL ? web_lws.lws_get_socket_fd(web->conn[i].wsi) : -1;
}

/* libwebsockets rests meanwhile (web_poll), so that it writes nothing either. */
static int web_silence(struct web_link *web)
{
    int fds[WEB_PLACES];
    if (web->listening == NULL || web->is_silent) return SH_ESTATE;
    web_sockets(web, fds);
    const int rc = sockets_silence(web->listener.fd, fds, WEB_PLACES);
    web->is_silent = rc == SH_OK;
    return rc;
}

void web_speak(struct web_link *web, int resets)
{
    int fds[WEB_PLACES];
    if (!web->is_silent) return;
    web_sockets(web, fds);
    sockets_speak(web->listener.fd, fds, WEB_PLACES);
    web->is_silent = 0;
    if (resets) web_break_all(web);
}

static int web_unplug(struct web_link *web)
{
    if (web->listening == NULL) return SH_ESTATE;
    web->is_silent = 0;        /* the silent sockets end below */
    web_break(web->listening); /* first, so that a client that is cut off can't come back at once */
    web_break_all(web);
    web->listening = NULL;
    return SH_OK;
}

static int web_plug(struct web_link *web, int resets)
{
    web_speak(web, resets);
    if (web->listening != NULL) return SH_OK;
    web->listener.fd = socket_listen_again(&web->listener.address);
    if (web->listener.fd >= 0) web->listening = web_wait_for(web, web->listener.fd, NULL);
    return web->listening != NULL ? SH_OK : SH_ESTATE;
}

int web_fault(void *link, enum link_fault what, int session, uint32_t n, double for_ms)
{
    (void)for_ms;
    switch (what) {
    case LINK_FAULT_DISCONNECT:
    case LINK_FAULT_REFUSE:
        return web_cut(link, session);
    case LINK_FAULT_UNPLUG:
        return web_unplug(link);
    case LINK_FAULT_CABLE:
        return web_silence(link);
    case LINK_FAULT_PLUG:
        return web_plug(link, (int)n);
    default:
        return SH_ESTATE;
    }
}
