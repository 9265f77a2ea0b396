/* SPDX-License-Identifier: MIT */
/* Serves connections until their request is whole. The request is judged here as it comes, without taking it out of the
 * socket. A line that HTTP does not allow is answered at its first wrong byte. Other wrong requests are answered once
 * they are whole; one from another site's page gets no byte. libwebsockets sees no wrong request. For a correct request
 * libwebsockets gets a new request with only the fields that it needs, and no byte from after the request. Given the
 * client's own request, libwebsockets would act on fields that we don't support (h2c). It would also close the
 * connection without an answer if the request had more fields or arguments than it has room for. */
#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "drivers/link/web_inside.h"
#include "drivers/socket/socket.h"

struct lws *web_wait_for(struct web_link *web, int fd, struct web_conn *conn)
{
    const lws_adopt_desc_t info = {.vh = web->vhost,
                                   .type = LWS_ADOPT_RAW_FILE_DESC,
                                   .fd = {.filefd = fd},
                                   .vh_prot_name = WEB_BARE,
                                   .opaque = conn};
    struct lws *wsi = web_lws.lws_adopt_descriptor_vhost_via_info(&info);
    if (wsi == NULL) close(fd);
    return wsi;
}

/* The socket is not reported as readable again before it has more than `have` bytes. */
static int wait_for_more(int fd, int have)
{
    const int low = have + 1;
    return setsockopt(fd, SOL_SOCKET, SO_RCVLOWAT, &low, sizeof low);
}

/* Takes what a client goes on to send. Else the system would reset the connection, and the answer would be lost. -1:
 * the client has ended. */
static int drain(int fd)
{
    char rest[WEB_MAX_REQUEST];
    ssize_t n = 1;
    for (int i = 0; i < 16 && n > 0; i++)
        n = socket_read(fd, rest, sizeof rest);
    return n < 0 ? -1 : 0;
}

/* Sends a short answer. The socket takes it at once, since nothing was sent before. */
static void web_accept_say(int fd, int status, const char *words, int head_only)
{
    char text[WEB_TEXT_ROOM];
    drain(fd);
    socket_write(fd, text, (size_t)web_http_words(text, sizeof text, status, words, head_only));
}

static int linger(struct web_conn *conn)
{
    const int fd = web_lws.lws_get_socket_fd(conn->wsi);
    shutdown(fd, SHUT_WR);
    wait_for_more(fd, 0);
    web_set_phase(conn, WEB_LINGERING);
    web_lws.lws_set_timer_usecs(conn->wsi, WEB_GOODBYE_MS * LWS_US_PER_MS);
    return drain(fd);
}

/* The descriptor is duplicated for a new wsi, so that libwebsockets may close its own. */
void web_linger(struct web_link *web, struct web_conn *conn)
{
    const int fd = dup(web_lws.lws_get_socket_fd(conn->wsi));
    web_lws.lws_set_opaque_user_data(conn->wsi, NULL);
    conn->wsi = fd >= 0 ? web_wait_for(web, fd, conn) : NULL;
    if (conn->wsi == NULL)
        web_conn_end(conn);
    else
        linger(conn);
}

/* ---- clients that come */

/* A client with half a request gets the reason; others get nothing. A client without a whole answer counts as
 * refused. */
static void web_accept_make_room(struct web_link *web, struct web_conn *conn)
{
    if (conn->place.phase == WEB_ASKING || conn->place.phase == WEB_ANSWERING) web_refused(web, conn->peer);
    if (conn->place.phase == WEB_ASKING && conn->n_seen > 0)
        web_accept_say(web_lws.lws_get_socket_fd(conn->wsi), 408, "other clients wait; send the whole request at once",
                       0);
    web_lws.lws_set_opaque_user_data(conn->wsi, NULL);
    web_lws.lws_set_timeout(conn->wsi, PENDING_TIMEOUT_SHUTDOWN_FLUSH, LWS_TO_KILL_ASYNC);
    web_conn_end(conn);
}

static void web_accept_welcome(struct web_link *web, int fd, const struct sockaddr_storage *from, const char *peer)
{
    const int size = WEB_SEND_BUFFER;
    unsigned char address[sizeof web->conn->place.address];
    web_address(from, address);
    const int at = web_places_take((struct web_places){&web->conn[0].place, sizeof web->conn[0]}, address,
                                   web_lws.lws_now_usecs());
    if (at < 0) {
        web_accept_say(fd, 503, "all connections of this link are taken", 0);
        close(fd);
        web_refused(web, peer);
        return;
    }
    struct web_conn *conn = &web->conn[at];
    if (conn->place.phase != WEB_NOBODY) web_accept_make_room(web, conn);
    socket_tune(fd);
    setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &size, sizeof size);
    memset(conn, 0, sizeof *conn);
    conn->wsi = web_wait_for(web, fd, conn);
    if (conn->wsi == NULL) {
        web_refused(web, peer);
        return;
    }
    memcpy(conn->place.address, address, sizeof address);
    snprintf(conn->peer, sizeof conn->peer, "%s", peer);
    web_set_phase(conn, WEB_ASKING);
    web_lws.lws_set_timer_usecs(conn->wsi, WEB_PATIENCE_S * LWS_USEC_PER_SEC);
}

static void accept_some(struct web_link *web)
{
    for (int i = 0; i < WEB_AT_A_TIME; i++) {
        struct sockaddr_storage from;
        socklen_t len = sizeof from;
        char peer[64];
        int fd;
        if (!socket_accept(web->listener.fd, &web->listener.reserve_fd, &fd, &from, &len)) return;
        socket_address_text((const struct sockaddr *)&from, len, peer, sizeof peer);
        if (fd >= 0)
            web_accept_welcome(web, fd, &from, peer);
        else /* no descriptor is left */
            web_refused(web, peer);
    }
}

/* ---- requests */

/* Hands the connection to libwebsockets, which reads the new request at once, for its answer or its WebSocket. Without
 * a descriptor for that, the client gets the reason. */
static int hand_over(struct web_link *web, struct web_conn *conn)
{
    char text[400] = "GET / HTTP/1.1\r\n\r\n";
    const int own = web_lws.lws_get_socket_fd(conn->wsi), fd = dup(own); /* libwebsockets closes its own */
    if (fd < 0) {
        web_refused(web, conn->peer);
        web_accept_say(own, 503, "the head has no file descriptor left for this connection", conn->request.head_only);
        return linger(conn);
    }
    if (conn->request.key[0] != '\0')
        snprintf(text, sizeof text,
                 "GET /ws HTTP/1.1\r\nHost: %s\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                 "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: %s\r\n%s\r\n",
                 web->listener.at, conn->request.key,
                 conn->request.names_protocol ? "Sec-WebSocket-Protocol: scanhead-native-1\r\n" : "");
    /* While it answers, libwebsockets does not read, but would wake up again and again. */
    wait_for_more(fd, conn->request.key[0] != '\0' ? 0 : WEB_CHUNK);
    web_lws.lws_set_opaque_user_data(conn->wsi, NULL);
    conn->wsi = NULL;
    web_set_phase(conn, WEB_ANSWERING);
    web->entering = conn;
    web_lws.lws_adopt_socket_vhost_readbuf(web->vhost, fd, text, strlen(text)); /* on failure it has closed fd */
    if (conn->wsi == NULL) web_conn_end(conn);
    return -1;
}

static int web_accept_judge(struct web_link *web, struct web_conn *conn, const char *request, size_t begin, int result)
{
    const int fd = web_lws.lws_get_socket_fd(conn->wsi);
    const char *words =
        result == 505 ? "only HTTP/1.0 and HTTP/1.1 are supported" : "this is not a request of HTTP/1.1";
    if (result == HTTP_SCAN_WHOLE) {
        char taken[WEB_MAX_REQUEST];
        const size_t len = begin + conn->scan.at;
        result = web_request_read(web, request + begin, conn->scan.at, &conn->request, &words);
        if (result == 0) return recv(fd, taken, len, 0) == (ssize_t)len ? hand_over(web, conn) : -1;
    } else if (result == HTTP_SCAN_MORE) {
        result = 413;
        words = "a request must have at most 8192 bytes";
    }
    if (result == WEB_FOREIGN) return -1;
    web_accept_say(fd, result, words, conn->request.head_only);
    return linger(conn);
}

/* 0: wait on; -1: this descriptor is done with. */
static int look_at_request(struct web_link *web, struct web_conn *conn)
{
    char request[WEB_MAX_REQUEST];
    const int fd = web_lws.lws_get_socket_fd(conn->wsi);
    struct pollfd peer = {.fd = fd, .events = POLLRDHUP};
    const int ended = poll(&peer, 1, 0) > 0; /* asked first: if it has ended, recv below sees all that will ever come */
    const ssize_t n = recv(fd, request, sizeof request, MSG_PEEK);
    if (n < 0 && (errno == EAGAIN || errno == EINTR)) return 0;
    if (n <= 0) return -1;
    size_t begin = 0; /* empty lines ahead are skipped */
    while (begin < (size_t)n && (request[begin] == '\r' || request[begin] == '\n'))
        begin++;
    conn->n_seen = (int)n;
    const int result = http_scan_head(&conn->scan, request + begin, (size_t)n - begin);
    if (result != HTTP_SCAN_MORE || n == WEB_MAX_REQUEST) return web_accept_judge(web, conn, request, begin, result);
    return ended ? -1 : wait_for_more(fd, (int)n);
}

/* Ends a connection whose time is over. */
static int give_up(struct web_conn *conn)
{
    if (conn->place.phase != WEB_ASKING || conn->n_seen == 0) return -1;
    web_accept_say(web_lws.lws_get_socket_fd(conn->wsi), 408, "a request must be complete within 20 s", 0);
    return linger(conn);
}

static int web_accept_serve(struct web_link *web, struct web_conn *conn, enum lws_callback_reasons reason)
{
    switch (reason) {
    case LWS_CALLBACK_TIMER:
        return give_up(conn);
    case LWS_CALLBACK_RAW_RX_FILE:
        return conn->place.phase == WEB_ASKING ? look_at_request(web, conn)
                                               : drain(web_lws.lws_get_socket_fd(conn->wsi));
    default:
        return 0;
    }
}

int web_bare_callback(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in, size_t len)
{
    struct web_link *web = web_link_of(wsi);
    struct web_conn *conn = web_lws.lws_get_opaque_user_data(wsi);
    uint64_t count;
    (void)user, (void)in, (void)len;
    if (conn != NULL && conn->wsi == wsi) return web_accept_serve(web, conn, reason);
    if (reason != LWS_CALLBACK_RAW_RX_FILE) return 0;
    if (wsi == web->listening)
        accept_some(web);
    else if (wsi != web->wake)
        return -1; /* the connection of this wsi had to make room */
    else if (read(web->wake_fd, &count, sizeof count) == sizeof count)
        web->woken = 1;
    return 0;
}
