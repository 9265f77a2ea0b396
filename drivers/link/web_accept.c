/* Connections until their first request is whole. libwebsockets closes a connection whose request is longer than its
 * room without a word; so the request is looked at first, without taking it out of the socket, and the connection is
 * given to libwebsockets once the request has its end. A longer one that comes later on the same connection closes it. */
#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "drivers/link/web_inside.h"
#include "drivers/socket/socket.h"

struct lws *web_wait_for(struct web_link *web, int fd)
{
    lws_sock_file_fd_type desc = {.filefd = fd};
    struct lws *wsi = lws_adopt_descriptor_vhost(web->vhost, LWS_ADOPT_RAW_FILE_DESC, desc, WEB_BARE, NULL);
    if (wsi == NULL) close(fd);
    return wsi;
}

static void refuse(struct web_link *web, const struct sockaddr_storage *from, socklen_t len)
{
    socket_address_text((const struct sockaddr *)from, len, web->refused, sizeof web->refused);
    web->n_refused++;
}

static void accept_all(struct web_link *web)
{
    for (int i = 0; i < WEB_MAX_CONNECTIONS; i++) {
        struct sockaddr_storage from;
        socklen_t len = sizeof from;
        int fd;
        if (!socket_accept(web->listener, &web->reserve_fd, &fd, &from, &len)) return;
        if (fd < 0) { /* no descriptor is left */
            refuse(web, &from, len);
            continue;
        }
        const int size = WEB_SEND_BUFFER;
        socket_tune(fd);
        setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &size, sizeof size);
        const int own = (web->listening != NULL) + (web->wake != NULL);
        if (web->n_connections >= WEB_MAX_CONNECTIONS + own) {
            close(fd);
            continue;
        }
        struct lws *wsi = web_wait_for(web, fd);
        if (wsi == NULL) continue;
        lws_set_timer_usecs(wsi, WEB_PATIENCE_S * LWS_USEC_PER_SEC);
    }
}

/* The bytes that the socket must have before it is looked at again: one more than it has. */
static int wait_for_more(int fd, int have)
{
    const int low = have + 1;
    return setsockopt(fd, SOL_SOCKET, SO_RCVLOWAT, &low, sizeof low);
}

static void refuse_long(int fd)
{
    static const char words[] = "HTTP/1.1 413 Content Too Large\r\nconnection: close\r\ncontent-type: text/plain\r\n"
                                "content-length: 37\r\n\r\na request has at most 8192 bytes here";
    if (socket_write(fd, words, sizeof words - 1) < 0) return;
    shutdown(fd, SHUT_WR);
    socket_drain(fd);
}

/* 0: wait on; -1: this descriptor is done with. */
static int look_at_request(struct web_link *web, int fd)
{
    char request[WEB_MAX_REQUEST];
    struct pollfd peer = {.fd = fd, .events = POLLRDHUP};
    const int ended = poll(&peer, 1, 0) > 0; /* before looking: then nothing comes after what is seen */
    ssize_t n = recv(fd, request, sizeof request, MSG_PEEK);
    if (n < 0 && (errno == EAGAIN || errno == EINTR)) return 0;
    if (n <= 0) return -1;
    if (memmem(request, (size_t)n, "\r\n\r\n", 4) == NULL && memmem(request, (size_t)n, "\n\n", 2) == NULL) {
        if (n < WEB_MAX_REQUEST && ended) return -1;
        if (n < WEB_MAX_REQUEST) return wait_for_more(fd, (int)n);
        refuse_long(fd);
        return -1;
    }
    int own = dup(fd); /* the one at hand goes with what it was waited for by */
    if (own < 0) return -1;
    wait_for_more(own, 0);
    lws_adopt_socket_vhost(web->vhost, own); /* which closes it when it fails */
    return -1;
}

int web_bare_callback(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in, size_t len)
{
    struct web_link *web = web_link_of(wsi);
    uint64_t count;
    (void)user, (void)in, (void)len;
    if (reason == LWS_CALLBACK_FILTER_PROTOCOL_CONNECTION) return -1; /* a WebSocket that asks for it by its name */
    if (reason == LWS_CALLBACK_TIMER) return -1;
    if (reason == LWS_CALLBACK_USER && wsi != web->wake) web_break(wsi);
    if (reason != LWS_CALLBACK_RAW_RX_FILE) return 0;
    if (wsi == web->listening)
        accept_all(web);
    else if (wsi != web->wake)
        return look_at_request(web, lws_get_socket_fd(wsi));
    else if (read(web->wake_fd, &count, sizeof count) == sizeof count)
        web->woken = 1;
    return 0;
}
