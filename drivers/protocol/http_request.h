/* SPDX-License-Identifier: MIT */
/* Reads requests of HTTP/1.0 and 1.1 from a stream of bytes: the part of RFC 9112 that a small device needs,
 * with bounded memory.
 *
 * Bytes go in, in pieces of any size. Requests come out one after the other, or the status that answers a
 * broken one; after a broken one the connection can't go on. Bodies have a Content-Length; without one a
 * request has no body (RFC 9112, 6.3). Chunked ones are refused. Pure; allocates nothing; any thread. */
#ifndef DRIVERS_PROTOCOL_HTTP_REQUEST_H
#define DRIVERS_PROTOCOL_HTTP_REQUEST_H

#include <stddef.h>
#include <stdint.h>

#include "drivers/protocol/http_head.h"

enum {
    HTTP_MAX_LINE = 512,  /* request line without its end: 414 */
    HTTP_MAX_HEAD = 4096, /* request line and fields, with the empty line: 431 */
    HTTP_MAX_BODY = 1024, /* 413 */
};

enum http_result {
    HTTP_MORE = 0,       /* bytes are missing */
    HTTP_REQUEST = 1,    /* one is whole */
    HTTP_CONTINUE = 100, /* bytes are missing, and the client waits for 100 Continue before it sends them; once */
    /* 400 and more: the status of the answer, which is the last one */
};

struct http_request {
    char method[8], path[64]; /* the path without its query; a path that is too long is cut, and so unknown */
    int minor;                /* of HTTP/1.x */
    int keep_alive;
    int foreign; /* it has an Origin that is, or may be, another server: a browser sends it for a page from there */
    const char *body; /* body_len bytes */
    size_t body_len;
};

struct http_reader { /* begins as zeros */
    char bytes[HTTP_MAX_HEAD + HTTP_MAX_BODY + 1];
    size_t len;      /* in bytes */
    size_t head_len; /* 0: the end of the head has not come */
    struct http_scan scan;
    int continued;
    struct http_request request;
};

/* Takes what there is room for, and returns how much. After HTTP_MORE or HTTP_CONTINUE that is at least one
 * byte. */
size_t http_reader_add(struct http_reader *r, const uint8_t *bytes, size_t len);
/* An http_result. HTTP_REQUEST: r->request holds until http_reader_drop, which has to come before the next
 * call. */
int http_reader_next(struct http_reader *r);
void http_reader_drop(struct http_reader *r);

#endif
