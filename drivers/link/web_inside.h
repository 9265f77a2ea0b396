/* Private to web*.c: a web link, its connections and sessions. */
#ifndef DRIVERS_LINK_WEB_INSIDE_H
#define DRIVERS_LINK_WEB_INSIDE_H

#include <libwebsockets.h>

#include "drivers/link/link.h"
#include "drivers/link/web.h"

enum {
    WEB_MAX_CONNECTIONS = 48,  /* of browsers and whatever else; one more is closed at once */
    WEB_MAX_REQUEST = 8192,    /* a request's line and fields; one more: 413 */
    WEB_MAX_MESSAGE = 4096,    /* of commands, in one WebSocket message */
    WEB_IN_ROOM = 32768,       /* of commands that the owner has not read */
    WEB_SEND_BUFFER = 1 << 20, /* as a TCP link has */
    WEB_CHUNK = 65536,
    WEB_PATIENCE_S = 20,
    WEB_GOODBYE_MS = 2000, /* at the end, to take what was written */
    WEB_TRY_LATER = 1013,  /* RFC 6455's registry of close codes */
};

enum web_state {
    WEB_FREE,
    WEB_OPENING, /* LINK_OPENED is to be reported */
    WEB_OPEN,
    WEB_LEAVING, /* the link is closed: what waits goes out */
    WEB_ENDED,   /* LINK_CLOSED is to be reported */
};

struct web_session {
    enum web_state state;
    struct lws *wsi;
    size_t message_len; /* of the message that is coming in */
    size_t in_len, out_len, out_room;
    unsigned char in[WEB_IN_ROOM];
    unsigned char *out; /* LWS_PRE bytes, then the message that is to go out */
    char peer[64];
};

/* Of each connection: a session, or the answer that is on its way. */
struct web_conn {
    struct web_session *session;
    const char *bytes;
    size_t len, sent;
    char *owned; /* freed at the end; NULL: built in */
};

struct web_link {
    struct lws_context *context;
    struct lws_vhost *vhost;
    struct lws *listening, *wake; /* listening NULL: unplugged */
    lws_sorted_usec_list_t timer;
    int listener, wake_fd, woken;
    int reserve_fd; /* given up when there are no more, to turn a connection away; -1: none */
    int port, n_sessions, n_refused;
    int n_connections; /* that libwebsockets has: listening and wake among them */
    char refused[64];  /* who came last in vain */
    char at[72];       /* "127.0.0.1:40123" */
    char host[64];     /* as the user named it */
    const struct web_source *source;
    struct web_session session[LINK_MAX_SESSIONS];
};

static inline struct web_link *web_link_of(struct lws *wsi)
{
    return lws_context_user(lws_get_context(wsi));
}

/* web_accept.c: the protocol of descriptors that are not HTTP yet, or never: the listening socket, the owner's wake-up,
 * connections whose request has not come whole. */
#define WEB_BARE "bare"
int web_bare_callback(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in, size_t len);
/* Gives a descriptor to lws_service to wait for. It is closed with the context, or at once where NULL comes back. */
struct lws *web_wait_for(struct web_link *web, int fd);

/* web.c: breaks the connection, or the listening socket, at once; libwebsockets closes it when it finds out. */
void web_break(struct lws *wsi);

/* web_http.c. As libwebsockets' callbacks: 0, or -1 to close the connection. */
int web_http_begin(struct web_link *web, struct web_conn *conn, struct lws *wsi, const char *path);
int web_http_go_on(struct web_conn *conn, struct lws *wsi);
void web_http_end(struct web_conn *conn);
/* A WebSocket is asked for: 1 when it is at /ws and from where it may be. */
int web_may_upgrade(const struct web_link *web, struct lws *wsi);

#endif
