/* SPDX-License-Identifier: MIT */
/* The web link: the page and its owner's resources by HTTP, the stream and commands by WebSocket, on one port.
 *
 * A session is a WebSocket at /ws. The bytes that the owner writes in one call go out as one message: text if the first
 * byte is ASCII (replies), else binary (frames). Messages of clients are text, whose lines are commands; the last line
 * of a message need not have an end. So frames, replies and commands are those of the protocol, and none is cut.
 *
 * libwebsockets does HTTP and WebSocket, and waits (lws_service) for its connections. It also waits for the listening
 * socket and for the owner's wake-up, which it gets as plain descriptors. All is done in the owner's thread.
 *
 * Another site's page must not read or command a head on somebody's machine. A browser sends Host, the name in its
 * address bar, and Origin, the page that asks. So a Host that is neither a number nor a name of this machine is
 * refused: it may be a name of the other site that leads here (DNS rebinding). An Origin that is not this link gets no
 * byte. Programs that aren't browsers have no Origin. */
#include <fcntl.h>
#include <libwebsockets.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "drivers/link/web_inside.h"

struct websockets_lib web_lws;

void web_refused(struct web_link *web, const char *peer)
{
    const int at = web->n_refused < WEB_AT_A_TIME ? web->n_refused : WEB_AT_A_TIME - 1;
    snprintf(web->refused[at], sizeof web->refused[at], "%s", peer);
    web->n_refused++;
}

static int web_callback(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in, size_t len);

static const struct lws_protocols protocols[] = {
    {"http", web_callback, 0, WEB_IN_ROOM / 4, 0, NULL, 0},
    {"scanhead-native-1", web_callback, 0, WEB_IN_ROOM / 4, 0, NULL, 0},
    {WEB_BARE, web_bare_callback, 0, 0, 0, NULL, 0},
    {NULL, NULL, 0, 0, 0, NULL, 0},
};

static int open_context(struct web_link *web)
{
    struct lws_context_creation_info info;
    memset(&info, 0, sizeof info);
    web_lws.lws_set_log_level(0, NULL);
    info.port = CONTEXT_PORT_NO_LISTEN_SERVER;
    info.protocols = protocols;
    info.user = web;
    info.options = LWS_SERVER_OPTION_EXPLICIT_VHOSTS | LWS_SERVER_OPTION_SKIP_SERVER_CANONICAL_NAME |
                   LWS_SERVER_OPTION_VALIDATE_UTF8;
    info.max_http_header_pool = WEB_PLACES + WEB_AT_A_TIME; /* connections closed to make room end a little later */
    info.fd_limit_per_thread = info.max_http_header_pool + 8;
    info.timeout_secs = WEB_PATIENCE_S;
    info.keepalive_timeout = WEB_PATIENCE_S;
    info.alpn = "http/1.1";
    web->context = web_lws.lws_create_context(&info);
    if (web->context == NULL) return -1;
    web->vhost = web_lws.lws_create_vhost(web->context, &info);
    return web->vhost != NULL ? 0 : -1;
}

/* The wake-up's place among the descriptors, from the start on: at the first poll there may be none left. The context
 * closes it. */
static struct lws *wait_for_owner(struct web_link *web)
{
    const int fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    web->wake_fd = -1;
    return fd >= 0 ? web_wait_for(web, fd, NULL) : NULL;
}

static int web_open(const struct link_spec *spec, void **link, struct sh_err *err)
{
    int rc = websockets_lib_load(&web_lws, err);
    if (rc != SH_OK) return rc;
    struct web_link *web = link_new(sizeof *web, err, "web");
    if (web == NULL) return SH_ENOMEM;
    rc = link_listen("link web", spec, &web->listener, err);
    if (rc != SH_OK) {
        free(web);
        return rc;
    }
    snprintf(web->base.name, sizeof web->base.name, "http://%s/", web->listener.at);
    snprintf(web->host, sizeof web->host, "%s", spec->address);
    web->port = atoi(strrchr(web->listener.at, ':') + 1);
    web->n_sessions = spec->max_sessions;
    web->source = spec->web;
    if (open_context(web) == 0) web->listening = web_wait_for(web, web->listener.fd, NULL);
    if (web->listening != NULL) web->wake = wait_for_owner(web);
    if (web->wake == NULL) {
        rc = sh_fail(err, SH_ENOMEM, "link web:%s: libwebsockets has too little memory or too few file descriptors",
                     web->listener.at);
        if (web->vhost == NULL) close(web->listener.fd);
        if (web->context != NULL) web_lws.lws_context_destroy(web->context);
        if (web->listener.reserve_fd >= 0) close(web->listener.reserve_fd);
        free(web);
        return rc;
    }
    *link = web;
    return SH_OK;
}

/* ---- sessions */

static void session_open(struct web_link *web, struct web_conn *conn)
{
    int slot = 0;
    while (slot < web->n_sessions && web->session[slot].state != WEB_FREE)
        slot++;
    if (slot == web->n_sessions) {
        web_refused(web, conn->peer);
        web_set_phase(conn, WEB_PARTING);
        web_lws.lws_callback_on_writable(conn->wsi);
        return;
    }
    struct web_session *s = &web->session[slot];
    web_set_phase(conn, WEB_TALKING);
    s->state = WEB_OPENING;
    s->wsi = conn->wsi;
    s->in_len = s->whole_len = s->out_len = 0;
    snprintf(s->peer, sizeof s->peer, "%s", conn->peer);
    conn->session = s;
}

/* Turns away a browser for which no session is free, with these words as the reason of the WebSocket's end. */
static int turn_away(struct web_link *web, struct lws *wsi)
{
    unsigned char why[80];
    int n = web->n_sessions == 1
                ? snprintf((char *)why, sizeof why, "the only session of this link is taken")
                : snprintf((char *)why, sizeof why, "all %d sessions of this link are taken", web->n_sessions);
    web_lws.lws_close_reason(wsi, (enum lws_close_status)WEB_TRY_LATER, why, (size_t)n);
    return -1;
}

void web_session_gone(struct web_conn *conn)
{
    struct web_session *s = conn->session;
    if (s == NULL) return;
    s->wsi = NULL;
    s->in_len = s->whole_len;
    /* An owner that has not heard of the session need not hear of its end, unless it has something to read. */
    if (s->state == WEB_OPENING && s->in_len == 0) s->state = WEB_FREE;
    conn->session = NULL;
    web_set_phase(conn, WEB_PARTING);
}

void web_conn_end(struct web_conn *conn)
{
    web_session_gone(conn);
    if (conn->owned != NULL && conn->lender != NULL && conn->lender->release != NULL)
        conn->lender->release(conn->lender->ctx, conn->owned);
    else
        free(conn->owned);
    conn->owned = NULL;
    conn->lender = NULL;
    conn->wsi = NULL;
    conn->place.phase = WEB_NOBODY;
}

/* Ends a session whose client breaks the rules: nothing more goes out but the reason. */
static int close_for(struct web_conn *conn, enum lws_close_status status, const char *why)
{
    web_session_gone(conn);
    /* The library only reads it. */
    web_lws.lws_close_reason(conn->wsi, status, (unsigned char *)(uintptr_t)why, strlen(why));
    return -1;
}

/* Whether a close frame waits or was sent: ours, or that of libwebsockets, which reports the end seconds later. */
static int is_closing(struct lws *wsi)
{
    return web_lws.lws_get_close_length(wsi) > 0;
}

static int web_take_text(struct web_conn *conn, struct lws *wsi, const void *in, size_t len)
{
    struct web_session *s = conn->session;
    if (web_lws.lws_frame_is_binary(wsi))
        return close_for(conn, LWS_CLOSE_STATUS_UNACCEPTABLE_OPCODE, "a command must be a text message");
    if (web_lws.lws_is_first_fragment(wsi)) s->message_len = 0;
    s->message_len += len;
    if (s->message_len + web_lws.lws_remaining_packet_payload(wsi) > WEB_MAX_MESSAGE ||
        len + 1 > WEB_IN_ROOM - s->in_len)
        return close_for(conn, LWS_CLOSE_STATUS_MESSAGE_TOO_LARGE, "a message must have at most 4096 bytes");
    memcpy(s->in + s->in_len, in, len);
    s->in_len += len;
    if (web_lws.lws_is_final_fragment(wsi)) {
        if (s->in_len > 0 && s->in[s->in_len - 1] != '\n') s->in[s->in_len++] = '\n';
        s->whole_len = s->in_len;
    }
    if (s->in_len > WEB_IN_ROOM / 2) web_lws.lws_rx_flow_control(wsi, 0);
    return 0;
}

static int send_message(struct web_session *s, struct lws *wsi)
{
    if (s->out_len == 0 && s->state == WEB_LEAVING) { /* all has gone out */
        static unsigned char why[] = "the head has ended";
        web_lws.lws_close_reason(wsi, LWS_CLOSE_STATUS_GOINGAWAY, why, sizeof why - 1);
        return -1;
    }
    if (s->out_len == 0) return 0;
    unsigned char *from = s->out + LWS_PRE;
    int n = web_lws.lws_write(wsi, from, s->out_len, (from[0] & 0x80) != 0 ? LWS_WRITE_BINARY : LWS_WRITE_TEXT);
    s->out_len = 0; /* what the socket did not take, libwebsockets holds; it calls again after that */
    if (s->state == WEB_LEAVING) web_lws.lws_callback_on_writable(wsi);
    return n < 0 ? -1 : 0;
}

/* Handles libwebsockets' calls for HTTP and WebSocket. The request has been read before: conn->request. */
static int web_serve_client(struct web_conn *conn, enum lws_callback_reasons reason, void *in, size_t len)
{
    struct lws *wsi = conn->wsi;
    struct web_link *web = web_link_of(wsi);
    switch (reason) {
    case LWS_CALLBACK_HTTP:
        return web_http_begin(web, conn);
    case LWS_CALLBACK_HTTP_WRITEABLE:
        return web_http_go_on(web, conn);
    case LWS_CALLBACK_ESTABLISHED:
        session_open(web, conn);
        return 0;
    case LWS_CALLBACK_RECEIVE:
        return conn->session != NULL ? web_take_text(conn, wsi, in, len) : 0;
    case LWS_CALLBACK_SERVER_WRITEABLE:
        if (is_closing(wsi)) return 0; /* a close frame is the last one */
        return conn->session != NULL ? send_message(conn->session, wsi) : turn_away(web, wsi);
    case LWS_CALLBACK_CLOSED:
        web_session_gone(conn);
        return 0;
    case LWS_CALLBACK_WSI_DESTROY:
        web_conn_end(conn);
        return 0;
    default:
        return 0;
    }
}

static int web_callback(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in, size_t len)
{
    (void)user;
    if (reason == LWS_CALLBACK_SERVER_NEW_CLIENT_INSTANTIATED) {
        struct web_conn *entering = web_link_of(wsi)->entering;
        web_lws.lws_set_opaque_user_data(wsi, entering);
        entering->wsi = wsi;
    }
    struct web_conn *conn = web_lws.lws_get_opaque_user_data(wsi);
    return conn != NULL && conn->wsi == wsi ? web_serve_client(conn, reason, in, len) : 0;
}

/* ---- the owner's side */

/* The owner gives the same descriptor to each poll, so it is taken once. It comes in place of that from open, which is
 * why no new descriptor is needed. */
static int take_wake_fd(struct web_link *web, int wake_fd)
{
    if (web->wake_fd >= 0 || wake_fd < 0) return SH_OK;
    if (dup3(wake_fd, web_lws.lws_get_socket_fd(web->wake), O_CLOEXEC) < 0) return SH_EIO;
    web->wake_fd = wake_fd;
    return SH_OK;
}

static void report_session(struct web_session *s, int slot, uint32_t want_write, struct link_events *events)
{
    if (s->wsi != NULL && is_closing(s->wsi)) web_session_gone(web_lws.lws_get_opaque_user_data(s->wsi));
    if (s->state == WEB_OPENING && link_events_push(events, LINK_OPENED, slot, s->peer)) s->state = WEB_OPEN;
    if (s->state != WEB_OPEN) return;
    if (s->in_len > 0) link_events_push(events, LINK_READABLE, slot, NULL);
    if (s->wsi != NULL && (want_write >> slot & 1u) != 0 && s->out_len == 0)
        link_events_push(events, LINK_WRITABLE, slot, NULL);
    /* The commands of a client that sent them and left are read first. */
    if (s->wsi == NULL && s->in_len == 0 && link_events_push(events, LINK_CLOSED, slot, s->peer)) s->state = WEB_FREE;
}

static void web_report(struct web_link *web, uint32_t want_write, struct link_events *events)
{
    if (web->woken && link_events_push(events, LINK_WOKEN, 0, NULL)) web->woken = 0;
    for (int s = 0; s < web->n_sessions; s++) /* first: a crowd that is turned away would take all the room */
        report_session(&web->session[s], s, want_write, events);
    for (; web->n_refused > 0 && link_events_push(events, LINK_REFUSED, 0, web->refused[0]); web->n_refused--)
        memmove(web->refused[0], web->refused[1], sizeof web->refused - sizeof web->refused[0]);
}

static void time_is_over(lws_sorted_usec_list_t *timer)
{
    (void)timer; /* lws_service returns */
}

/* Lets libwebsockets work, and wait for most_us at most (below 0: for ever; 0: not at all). Returns 0 or SH_EIO. */
static int web_serve(struct web_link *web, lws_usec_t most_us)
{
    if (most_us > 0) web_lws.lws_sul_schedule(web->context, 0, &web->timer, time_is_over, most_us);
    const int rc = web_lws.lws_service(web->context, most_us == 0 ? -1 : 0);
    web_lws.lws_sul_schedule(web->context, 0, &web->timer, time_is_over, LWS_SET_TIMER_USEC_CANCEL);
    return rc >= 0 ? SH_OK : SH_EIO;
}

static int web_poll(void *link, int wake_fd, uint32_t want_write, int timeout_ms, struct link_event *event, int max)
{
    struct web_link *web = link;
    struct link_events events = {event, 0, max};
    if (web->is_silent) return link_poll_sink(wake_fd, 0, timeout_ms, &events);
    if (take_wake_fd(web, wake_fd) != SH_OK) return SH_EIO;
    web_report(web, want_write, &events);
    if (web_serve(web, events.n > 0 ? 0 : (lws_usec_t)timeout_ms * 1000) != SH_OK) return SH_EIO;
    if (events.n == 0) web_report(web, want_write, &events);
    return events.n;
}

struct web_session *web_session(struct web_link *web, int session)
{
    if (session < 0 || session >= web->n_sessions || web->session[session].state != WEB_OPEN) return NULL;
    struct web_session *s = &web->session[session];
    return s->wsi != NULL || s->in_len > 0 ? s : NULL;
}

static ssize_t web_read(void *link, int session, void *buf, size_t len)
{
    struct web_session *s = web_session(link, session);
    if (s == NULL) return SH_ECLOSED;
    if (len > s->in_len) len = s->in_len;
    memcpy(buf, s->in, len);
    memmove(s->in, s->in + len, s->in_len - len);
    s->in_len -= len;
    s->whole_len -= len < s->whole_len ? len : s->whole_len;
    if (s->wsi != NULL && s->in_len <= WEB_IN_ROOM / 2) web_lws.lws_rx_flow_control(s->wsi, 1);
    return (ssize_t)len;
}

static ssize_t web_write(void *link, int session, const void *buf, size_t len)
{
    struct web_session *s = web_session(link, session);
    if (s == NULL) return SH_ECLOSED;
    if (s->wsi == NULL || s->out_len != 0 || len == 0 || ((const struct web_link *)link)->is_silent) return 0;
    if (len > s->out_room) {
        unsigned char *out = realloc(s->out, LWS_PRE + len);
        if (out == NULL) return 0; /* the reader loses frames, which is counted */
        s->out = out;
        s->out_room = len;
    }
    memcpy(s->out + LWS_PRE, buf, len);
    s->out_len = len;
    web_lws.lws_callback_on_writable(s->wsi);
    return (ssize_t)len;
}

static int any_session(const struct web_link *web)
{
    for (int s = 0; s < web->n_sessions; s++)
        if (web->session[s].wsi != NULL) return 1;
    return 0;
}

/* Sends what was written, and the reason of the end. Waits until clients have taken it, for WEB_GOODBYE_MS at most. */
static void say_goodbye(struct web_link *web)
{
    for (int s = 0; s < web->n_sessions; s++) {
        if (web->session[s].wsi == NULL) continue;
        web->session[s].state = WEB_LEAVING;
        web_lws.lws_callback_on_writable(web->session[s].wsi);
    }
    lws_usec_t end = web_lws.lws_now_usecs() + (lws_usec_t)WEB_GOODBYE_MS * 1000;
    for (lws_usec_t now; any_session(web) && (now = web_lws.lws_now_usecs()) < end;)
        if (web_serve(web, end - now) != SH_OK) return;
}

static void web_close(void *link)
{
    struct web_link *web = link;
    web_speak(web, 0); /* else its clients would not hear of the end */
    say_goodbye(web);
    web_lws.lws_context_destroy(web->context);
    if (web->listener.reserve_fd >= 0) close(web->listener.reserve_fd);
    for (int s = 0; s < LINK_MAX_SESSIONS; s++)
        free(web->session[s].out);
    free(web);
}

const struct link_ops link_web = {
    .name = "web",
    .messages = 1,
    .faults = LINK_FAULT_BIT(LINK_FAULT_DISCONNECT) | LINK_FAULT_BIT(LINK_FAULT_REFUSE) |
              LINK_FAULT_BIT(LINK_FAULT_UNPLUG) | LINK_FAULT_BIT(LINK_FAULT_CABLE),
    .open = web_open,
    .endpoint = link_base_endpoint,
    .poll = web_poll,
    .read = web_read,
    .write = web_write,
    .fault = web_fault,
    .close = web_close,
};
