/* Requests by HTTP: who may ask, what there is, and its way out in pieces. */
#include <arpa/inet.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

#include "drivers/link/web_inside.h"
#include "drivers/link/web_pages.h"

enum { HEADER_ROOM = 2048, FIELD_ROOM = 300 };

/* A field's text; "": the request has none, or one that is too long to be right (then *present is 1). */
static void field(struct lws *wsi, enum lws_token_indexes token, char *text, size_t room, int *present)
{
    *present = lws_hdr_total_length(wsi, token) > 0;
    if (!*present || lws_hdr_copy(wsi, text, (int)room, token) < 0) text[0] = '\0';
}

static int is_number(const char *host)
{
    unsigned char address[16];
    size_t len = strlen(host);
    char inner[FIELD_ROOM];
    if (len > 2 && host[0] == '[' && host[len - 1] == ']') {
        memcpy(inner, host + 1, len - 2);
        inner[len - 2] = '\0';
        return inet_pton(AF_INET6, inner, address) == 1;
    }
    return inet_pton(AF_INET, host, address) == 1;
}

/* "host:port" of the address bar: a number, localhost, the name that the configuration has or the machine's own. */
static int is_own_host(const struct web_link *web, const char *text)
{
    char host[FIELD_ROOM], own[256] = "";
    const char *colon = strrchr(text, ':'), *bracket = strrchr(text, ']');
    if (colon != NULL && bracket != NULL && colon < bracket) colon = NULL;
    const int port = colon != NULL ? atoi(colon + 1) : 80;
    const size_t len = colon != NULL ? (size_t)(colon - text) : strlen(text);
    if (port != web->port || len == 0 || len >= sizeof host) return 0;
    memcpy(host, text, len);
    host[len] = '\0';
    if (gethostname(own, sizeof own - 1) != 0) own[0] = '\0';
    return is_number(host) || strcasecmp(host, "localhost") == 0 || strcasecmp(host, web->host) == 0 ||
           (own[0] != '\0' && strcasecmp(host, own) == 0);
}

enum asker { ASKER_OWN, ASKER_FOREIGN, ASKER_LOST };

static enum asker who_asks(const struct web_link *web, struct lws *wsi)
{
    char host[FIELD_ROOM], origin[FIELD_ROOM];
    int has_host, has_origin;
    field(wsi, WSI_TOKEN_HOST, host, sizeof host, &has_host);
    field(wsi, WSI_TOKEN_ORIGIN, origin, sizeof origin, &has_origin);
    if (has_origin && (strncasecmp(origin, "http://", 7) != 0 || strcasecmp(origin + 7, host) != 0))
        return ASKER_FOREIGN;
    return is_own_host(web, host) ? ASKER_OWN : ASKER_LOST;
}

int web_may_upgrade(const struct web_link *web, struct lws *wsi)
{
    char path[8];
    int present;
    field(wsi, WSI_TOKEN_GET_URI, path, sizeof path, &present);
    return who_asks(web, wsi) == ASKER_OWN && strcmp(path, "/ws") == 0;
}

static int put_headers(struct lws *wsi, unsigned status, const char *type, size_t len)
{
    static const char *const fields[][2] = {{"content-security-policy:", "default-src 'self'; frame-ancestors 'none'"},
                                            {"cross-origin-resource-policy:", "same-origin"},
                                            {"x-content-type-options:", "nosniff"},
                                            {"referrer-policy:", "no-referrer"},
                                            {"cache-control:", "no-store"},
                                            {"connection:", "close"}};
    unsigned char buffer[LWS_PRE + HEADER_ROOM], *p = buffer + LWS_PRE, *const start = p;
    unsigned char *const end = buffer + sizeof buffer - 1;
    int failed = lws_add_http_common_headers(wsi, status, type, len, &p, end);
    for (size_t i = 0; i < sizeof fields / sizeof *fields && !failed; i++)
        failed = lws_add_http_header_by_name(wsi, (const unsigned char *)fields[i][0],
                                             (const unsigned char *)fields[i][1], (int)strlen(fields[i][1]), &p, end);
    return failed || lws_finalize_write_http_header(wsi, start, &p, end) ? -1 : 0;
}

/* One request, one connection: libwebsockets 4.1 never returns from a request with a body that was sent before the
 * one ahead of it was answered. What is still to be sent goes out before it closes. */
enum { DONE = -1 };

/* Sends what conn has: begins with its header. */
static int answer(struct web_conn *conn, struct lws *wsi, unsigned status, const char *type, int head_only)
{
    conn->sent = 0;
    if (put_headers(wsi, status, type, conn->len) != 0) return -1;
    if (head_only || conn->len == 0) {
        web_http_end(conn);
        return DONE;
    }
    return web_http_go_on(conn, wsi); /* at once: libwebsockets 4.3 closes at what stands behind the request */
}

static int say(struct web_conn *conn, struct lws *wsi, unsigned status, const char *words)
{
    size_t len = strlen(words) + 1;
    conn->owned = malloc(len + 1);
    if (conn->owned == NULL) return -1;
    conn->len = (size_t)snprintf(conn->owned, len + 1, "%s\n", words);
    conn->bytes = conn->owned;
    const int head_only = lws_hdr_total_length(wsi, WSI_TOKEN_HEAD_URI) > 0;
    return answer(conn, wsi, status, "text/plain; charset=utf-8", head_only);
}

/* What follows the path's '?', which libwebsockets has cut at each '&'. 0: it is too long. */
static int query_of(struct lws *wsi, char *text, size_t room)
{
    size_t at = 0;
    text[0] = '\0';
    for (int i = 0; lws_hdr_fragment_length(wsi, WSI_TOKEN_HTTP_URI_ARGS, i) > 0; i++) {
        if (i > 0 && at + 1 < room) text[at++] = '&';
        int n = lws_hdr_copy_fragment(wsi, text + at, (int)(room - at), WSI_TOKEN_HTTP_URI_ARGS, i);
        if (n < 0) return 0;
        at += (size_t)n;
    }
    return 1;
}

/* What the link's owner has at that path. */
static int answer_of_owner(struct web_link *web, struct web_conn *conn, struct lws *wsi, const char *path,
                           int head_only)
{
    char query[1024];
    struct web_body body = {NULL, NULL, 0};
    struct sh_err err = {0, ""};
    if (!query_of(wsi, query, sizeof query)) return say(conn, wsi, 400, "what follows the ? has more than 1,023 bytes");
    int rc = web->source != NULL ? web->source->get(web->source->ctx, path, query, &body, &err) : SH_EINPUT;
    if (rc == SH_EINPUT && err.text[0] == '\0') return say(conn, wsi, 404, "there is nothing at this path");
    if (rc != SH_OK) return say(conn, wsi, rc == SH_EINPUT ? 400 : 503, err.text);
    conn->bytes = conn->owned = body.bytes;
    conn->len = body.len;
    return answer(conn, wsi, 200, body.type, head_only);
}

int web_http_begin(struct web_link *web, struct web_conn *conn, struct lws *wsi, const char *path)
{
    struct web_page page;
    const int is_head = lws_hdr_total_length(wsi, WSI_TOKEN_HEAD_URI) > 0;
    memset(conn, 0, sizeof *conn);
    switch (who_asks(web, wsi)) {
    case ASKER_FOREIGN:
        return -1;
    case ASKER_LOST:
        return say(conn, wsi, 421, "this is not the host that was asked for; use the address that scanhead printed");
    case ASKER_OWN:
        break;
    }
    if (!is_head && lws_hdr_total_length(wsi, WSI_TOKEN_GET_URI) <= 0)
        return say(conn, wsi, 405, "only GET and HEAD are answered; commands go over the WebSocket at /ws");
    if (strcmp(path, "/ws") == 0) return say(conn, wsi, 426, "this is a WebSocket, subprotocol scanhead-native-1");
    if (!web_page_at(path, &page)) return answer_of_owner(web, conn, wsi, path, is_head);
    conn->bytes = page.bytes;
    conn->len = page.len;
    return answer(conn, wsi, 200, page.type, is_head);
}

int web_http_go_on(struct web_conn *conn, struct lws *wsi)
{
    unsigned char chunk[LWS_PRE + WEB_CHUNK];
    size_t n = conn->len - conn->sent;
    if (conn->bytes == NULL) return 0;
    const int last = n <= WEB_CHUNK;
    if (!last) n = WEB_CHUNK;
    memcpy(chunk + LWS_PRE, conn->bytes + conn->sent, n);
    if (lws_write(wsi, chunk + LWS_PRE, n, last ? LWS_WRITE_HTTP_FINAL : LWS_WRITE_HTTP) != (int)n) return -1;
    conn->sent += n;
    if (!last) {
        lws_callback_on_writable(wsi);
        return 0;
    }
    web_http_end(conn);
    return DONE;
}

void web_http_end(struct web_conn *conn)
{
    free(conn->owned);
    conn->owned = NULL;
    conn->bytes = NULL;
}
