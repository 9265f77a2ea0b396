/* SPDX-License-Identifier: MIT */
/* Private to web*.c: a web link, its connections and sessions. */
#ifndef DRIVERS_LINK_WEB_INSIDE_H
#define DRIVERS_LINK_WEB_INSIDE_H

#include <libwebsockets.h>

#include "core/late.h"
#include "drivers/link/link_listen.h"
#include "drivers/link/link_poll.h"
#include "drivers/link/web.h"
#include "drivers/link/web_places.h"
#include "drivers/protocol/http_head.h"

#define WEBSOCKETS_CALLS(CALL)                \
    CALL(lws_adopt_descriptor_vhost_via_info) \
    CALL(lws_adopt_socket_vhost_readbuf)      \
    CALL(lws_callback_on_writable)            \
    CALL(lws_close_reason)                    \
    CALL(lws_context_destroy)                 \
    CALL(lws_context_user)                    \
    CALL(lws_create_context)                  \
    CALL(lws_create_vhost)                    \
    CALL(lws_frame_is_binary)                 \
    CALL(lws_get_close_length)                \
    CALL(lws_get_context)                     \
    CALL(lws_get_opaque_user_data)            \
    CALL(lws_get_socket_fd)                   \
    CALL(lws_is_final_fragment)               \
    CALL(lws_is_first_fragment)               \
    CALL(lws_now_usecs)                       \
    CALL(lws_remaining_packet_payload)        \
    CALL(lws_rx_flow_control)                 \
    CALL(lws_service)                         \
    CALL(lws_set_log_level)                   \
    CALL(lws_set_opaque_user_data)            \
    CALL(lws_set_timeout)                     \
    CALL(lws_set_timer_usecs)                 \
    CALL(lws_sul_schedule)                    \
    CALL(lws_write)

LATE_LIBRARY(websockets, WEBSOCKETS_CALLS)

/* The functions of libwebsockets. The library is loaded when the first link opens, since it brings OpenSSL
 * (core/late.h). The functions are global since libwebsockets' callbacks need them to find their link. */
extern struct websockets_lib web_lws;

enum {
    WEB_MAX_REQUEST = 8192,    /* bytes of a request's line and fields; a longer request: 413 */
    WEB_MAX_MESSAGE = 4096,    /* of commands, in one WebSocket message */
    WEB_IN_ROOM = 32768,       /* of commands that the owner has not read */
    WEB_SEND_BUFFER = 1 << 20, /* as a TCP link has */
    WEB_CHUNK = 65536,
    WEB_TEXT_ROOM = 2048, /* an answer's head, and some words */
    WEB_AT_A_TIME = 16,   /* accepted before the connections that are there are looked at again */
    WEB_PATIENCE_S = 20,  /* for a whole request; for an answer, since the client last took some of it */
    WEB_TRY_LATER = 1013, /* RFC 6455's registry of close codes */
    WEB_FOREIGN = 1,      /* not a status: another site's page asks, and gets no byte */
};

enum web_state {
    WEB_FREE,
    WEB_OPENING, /* LINK_OPENED is to be reported */
    WEB_OPEN,
    WEB_LEAVING, /* the link is closed: what waits goes out */
};

struct web_session {
    enum web_state state;
    struct lws *wsi;    /* NULL: the client is gone, and LINK_CLOSED is to be reported */
    size_t message_len; /* of the message that is coming in */
    size_t in_len, out_len, out_room;
    size_t whole_len; /* of in: what belongs to whole messages; the rest is void if the client goes now */
    unsigned char in[WEB_IN_ROOM];
    unsigned char *out; /* LWS_PRE bytes, then the message that is to go out */
    char peer[64];
};

/* A request that has been judged. */
struct web_request {
    char path[256], query[1024];
    int head_only, query_long; /* the latter: what follows the ? has been cut */
    char key[32];              /* of a WebSocket; "": none is asked for */
    int names_protocol;
};

/* One client, from its coming to its end. To libwebsockets the client is first a plain descriptor (web_accept.c), then
 * an HTTP answer or a WebSocket, and after an answer a descriptor again; wsi is the present one. */
struct web_conn {
    struct web_place place;
    struct lws *wsi;
    char peer[64];
    int n_seen; /* bytes of a request that has not come whole */
    struct http_scan scan;
    struct web_request request;
    struct web_session *session;
    const char *bytes; /* of the answer that is on its way */
    size_t len, sent;
    char *owned;                     /* released at the end; NULL: built in */
    const struct web_source *lender; /* of owned; NULL: it is freed */
};

struct web_link {
    struct link_base base;
    struct lws_context *context;
    struct lws_vhost *vhost;
    struct lws *listening, *wake; /* listening NULL: unplugged */
    int is_silent;                /* its cable is pulled */
    lws_sorted_usec_list_t timer;
    struct link_listener listener; /* libwebsockets closes its socket */
    int wake_fd, woken;
    int port, n_sessions, n_refused;
    char refused[WEB_AT_A_TIME][64]; /* n_refused clients, to be reported; the last place has the newest one */
    char host[64];                   /* as the user named it */
    const struct web_source *source;
    struct web_conn *entering; /* the one that libwebsockets is being given */
    struct web_conn conn[WEB_PLACES];
    struct web_session session[LINK_MAX_SESSIONS];
};

static inline struct web_link *web_link_of(struct lws *wsi)
{
    return web_lws.lws_context_user(web_lws.lws_get_context(wsi));
}

static inline void web_set_phase(struct web_conn *conn, enum web_phase phase)
{
    conn->place.phase = phase;
    conn->place.since_us = web_lws.lws_now_usecs();
}

/* web.c */
void web_refused(struct web_link *web, const char *peer);
/* Forgets a connection whose wsi has ended or belongs to nobody any more. A second call does nothing. */
void web_conn_end(struct web_conn *conn);
/* Returns the session, if its owner may use it; else NULL. The session's client may be gone, and left something to be
 * read. */
struct web_session *web_session(struct web_link *web, int session);
/* The connection's session is over; LINK_CLOSED is to be reported. */
void web_session_gone(struct web_conn *conn);

/* web_faults.c */
/* The link's fault(). */
int web_fault(void *link, enum link_fault what, int session, uint32_t n, double for_ms);
/* Ends the silence of a pulled cable, if it is pulled. resets: then its connections are reset, too. */
void web_speak(struct web_link *web, int resets);

/* web_accept.c: libwebsockets' "protocol" of plain descriptors: the listening socket, the owner's wake-up, and
 * connections whose request has not come whole or whose answer is out. */
#define WEB_BARE "bare"
int web_bare_callback(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in, size_t len);
/* Makes lws_service wait for a descriptor. The descriptor is closed with the context, or at once if NULL is
 * returned. */
struct lws *web_wait_for(struct web_link *web, int fd, struct web_conn *conn);
/* Takes a connection whose answer is out from libwebsockets' HTTP. Ends its sending side, and gives the client some
 * time to end its own. */
void web_linger(struct web_link *web, struct web_conn *conn);

/* web_request.c: judges a request. Returns 0; the status of a refused request, with *words saying why; or
 * WEB_FOREIGN. head: the lines of the request, len bytes with the empty line. */
int web_request_read(const struct web_link *web, const char *head, size_t len, struct web_request *out,
                     const char **words);

/* web_http.c. web_http_begin and web_http_go_on return as libwebsockets' callbacks do: 0, or -1 to close the
 * connection. */
int web_http_begin(struct web_link *web, struct web_conn *conn);
int web_http_go_on(struct web_link *web, struct web_conn *conn);
/* Writes a whole answer whose content is `words`. Returns its length, as snprintf does. */
int web_http_words(char *to, size_t room, int status, const char *words, int head_only);

#endif
