/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/http_request.h"

#include <string.h>

size_t http_reader_add(struct http_reader *r, const uint8_t *bytes, size_t len)
{
    const size_t room = sizeof r->bytes - 1 - r->len;
    if (len > room) len = room;
    memcpy(r->bytes + r->len, bytes, len);
    r->len += len;
    return len;
}

/* Forgets n bytes at the front. */
static void forget(struct http_reader *r, size_t n)
{
    r->len -= n;
    memmove(r->bytes, r->bytes + n, r->len);
    r->head_len = 0;
    memset(&r->scan, 0, sizeof r->scan);
    r->continued = 0;
}

void http_reader_drop(struct http_reader *r)
{
    forget(r, r->head_len + r->request.body_len);
}

static void set_text(char *to, size_t room, struct http_text text)
{
    const size_t len = text.len < room ? text.len : room - 1;
    memcpy(to, text.s, len);
    to[len] = '\0';
}

/* 0, or a status. */
static int read_request_line(struct http_request *q, struct http_target *target, struct http_text text)
{
    struct http_line line;
    const int status = http_read_line(text, &line);
    if (status != 0) return status;
    if (line.method.len >= sizeof q->method) return 501;
    http_split_target(line.target, target);
    set_text(q->method, sizeof q->method, line.method);
    set_text(q->path, sizeof q->path, target->path);
    q->minor = line.minor;
    return 0;
}

/* A site may let its own name point to this machine (DNS rebinding). It can't do so with addresses, nor with names
 * without a dot, which are local. */
static int may_be_rebound(struct http_text host)
{
    size_t i = 0;
    while (i < host.len && ((host.s[i] >= '0' && host.s[i] <= '9') || host.s[i] == '.'))
        i++;
    return i < host.len && host.s[0] != '[' && memchr(host.s, '.', host.len) != NULL;
}

static int is_foreign(const struct http_fields *f, struct http_text host)
{
    return f->n_origin != 0 && (host.len == 0 || may_be_rebound(host) || !http_is_own_origin(f));
}

/* 0, or the status of a head that is broken. */
static int read_head(struct http_reader *r, struct http_fields *f)
{
    struct http_request *q = &r->request;
    struct http_target target;
    struct http_place place;
    size_t at = 0;
    int status = read_request_line(q, &target, http_next_line(r->bytes, r->head_len, &at));
    if (status == 0) status = http_read_fields(r->bytes, r->head_len, at, f);
    if (status == 0) status = http_find_place(f, q->minor, target.place, &place);
    if (status != 0) return status;
    if (f->has_coding) return 411;
    if (f->length > HTTP_MAX_BODY) return 413;
    if (f->expects_other) return 417;
    q->keep_alive = !f->closes && (q->minor > 0 || f->keeps_alive);
    q->foreign = is_foreign(f, place.host);
    q->body_len = f->length;
    return 0;
}

/* Sets head_len once the empty line that ends the head has come. Returns 0, or a status where the head is wrong. Empty
 * lines before a request are skipped. */
static int find_head(struct http_reader *r)
{
    size_t empty = 0;
    while (r->scan.n_lines == 0 && empty < r->len && (r->bytes[empty] == '\r' || r->bytes[empty] == '\n'))
        empty++;
    if (empty != 0) forget(r, empty);
    const int result = http_scan_head(&r->scan, r->bytes, r->len < HTTP_MAX_HEAD ? r->len : HTTP_MAX_HEAD);
    const char *line_end = memchr(r->bytes, '\n', r->len);
    size_t line_len = line_end != NULL ? (size_t)(line_end - r->bytes) : r->len;
    if (line_len != 0 && r->bytes[line_len - 1] == '\r') line_len--;
    if (line_len > HTTP_MAX_LINE) return 414;
    if (result == HTTP_SCAN_MORE) return r->len > HTTP_MAX_HEAD ? 431 : 0;
    if (result != HTTP_SCAN_WHOLE) return result;
    r->head_len = r->scan.at;
    return 0;
}

int http_reader_next(struct http_reader *r)
{
    struct http_fields fields;
    int status = r->head_len == 0 ? find_head(r) : 0;
    if (status != 0) return status;
    if (r->head_len == 0) return HTTP_MORE;
    status = read_head(r, &fields);
    if (status != 0) return status;
    if (r->len - r->head_len < r->request.body_len) {
        if (!fields.expects || r->continued || r->request.minor == 0) return HTTP_MORE;
        r->continued = 1;
        return HTTP_CONTINUE;
    }
    r->request.body = r->bytes + r->head_len;
    return HTTP_REQUEST;
}
