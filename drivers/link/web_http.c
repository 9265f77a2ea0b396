/* SPDX-License-Identifier: MIT */
/* Answers requests by HTTP, in pieces. A connection ends after its first answer. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/link/web_inside.h"
#include "drivers/link/web_pages.h"

static const char *reason_of(int status)
{
    static const struct {
        int status;
        const char *words;
    } all[] = {{200, "OK"},
               {400, "Bad Request"},
               {404, "Not Found"},
               {405, "Method Not Allowed"},
               {408, "Request Timeout"},
               {413, "Content Too Large"},
               {417, "Expectation Failed"},
               {421, "Misdirected Request"},
               {426, "Upgrade Required"},
               {503, "Service Unavailable"},
               {505, "HTTP Version Not Supported"}};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        if (all[i].status == status) return all[i].words;
    return "Error";
}

/* Writes and returns as snprintf. The fields forbid a browser to load anything from elsewhere, to show the page within
 * another site's page, and to guess a type. */
static int write_head(char *to, size_t room, int status, const char *type, size_t len)
{
    const char *more = status == 405   ? "allow: GET, HEAD\r\n"
                       : status == 426 ? "upgrade: websocket\r\nsec-websocket-version: 13\r\n"
                                       : "";
    return snprintf(to, room,
                    "HTTP/1.1 %d %s\r\ncontent-type: %s\r\ncontent-length: %zu\r\n"
                    "content-security-policy: default-src 'self'; frame-ancestors 'none'\r\n"
                    "cross-origin-resource-policy: same-origin\r\nx-content-type-options: nosniff\r\n"
                    "referrer-policy: no-referrer\r\ncache-control: no-store\r\n%sconnection: %s\r\n\r\n",
                    status, reason_of(status), type, len, more, status == 426 ? "close, upgrade" : "close");
}

static const char plain[] = "text/plain; charset=utf-8";

int web_http_words(char *to, size_t room, int status, const char *words, int head_only)
{
    const int n = write_head(to, room, status, plain, strlen(words) + 1);
    return head_only ? n : n + snprintf(to + n, room - (size_t)n, "%s\n", words);
}

/* Answers with the content that conn has. */
static int web_http_answer(struct web_conn *conn, int status, const char *type)
{
    unsigned char text[LWS_PRE + WEB_TEXT_ROOM], *head = text + LWS_PRE;
    const int n = write_head((char *)head, WEB_TEXT_ROOM, status, type, conn->len);
    if (n >= WEB_TEXT_ROOM || web_lws.lws_write(conn->wsi, head, (size_t)n, LWS_WRITE_HTTP_HEADERS) != n) return -1;
    if (conn->request.head_only) conn->len = 0;
    web_lws.lws_callback_on_writable(conn->wsi);
    return 0;
}

static int web_http_say(struct web_conn *conn, int status, const char *words)
{
    conn->len = strlen(words) + 1;
    conn->bytes = conn->owned = malloc(conn->len + 1);
    if (conn->owned == NULL) return -1;
    snprintf(conn->owned, conn->len + 1, "%s\n", words);
    return web_http_answer(conn, status, plain);
}

int web_http_begin(struct web_link *web, struct web_conn *conn)
{
    const struct web_request *asked = &conn->request;
    struct web_page page;
    struct web_body body = {NULL, NULL, 0};
    struct sh_err err = {0, ""};
    if (web_page_at(asked->path, &page)) {
        conn->bytes = page.bytes;
        conn->len = page.len;
        return web_http_answer(conn, 200, page.type);
    }
    if (asked->query_long) return web_http_say(conn, 400, "the query after ? has more than 1023 bytes");
    int rc = SH_EINPUT;
    if (web->source != NULL) rc = web->source->get(web->source->ctx, asked->path, asked->query, &body, &err);
    if (rc == SH_EINPUT && err.text[0] == '\0') return web_http_say(conn, 404, "there is nothing at this path");
    if (rc != SH_OK) return web_http_say(conn, rc == SH_EINPUT ? 400 : 503, err.text);
    conn->bytes = conn->owned = body.bytes;
    conn->lender = web->source;
    conn->len = body.len;
    return web_http_answer(conn, 200, body.type);
}

/* libwebsockets calls this when the socket has taken the whole previous piece. */
int web_http_go_on(struct web_link *web, struct web_conn *conn)
{
    unsigned char chunk[LWS_PRE + WEB_CHUNK];
    size_t n = conn->len - conn->sent;
    if (n == 0) {
        web_linger(web, conn);
        return -1;
    }
    if (n > WEB_CHUNK) n = WEB_CHUNK;
    memcpy(chunk + LWS_PRE, conn->bytes + conn->sent, n);
    if (web_lws.lws_write(conn->wsi, chunk + LWS_PRE, n, LWS_WRITE_HTTP) != (int)n) return -1;
    conn->sent += n;
    web_set_phase(conn, WEB_ANSWERING);
    web_lws.lws_set_timeout(conn->wsi, PENDING_TIMEOUT_HTTP_CONTENT, WEB_PATIENCE_S);
    web_lws.lws_callback_on_writable(conn->wsi);
    return 0;
}
