/* SPDX-License-Identifier: MIT */
#include <stdio.h>
#include <string.h>

#include "drivers/protocol/http_request.h"
#include "drivers/protocol/native.h"
#include "drivers/protocol/velodyne.h"
#include "drivers/protocol/velodyne_pages.h"
#include "drivers/protocol/velodyne_settings.h"

enum { MAX_BODY = 2048, MAX_ANSWER = 512 + MAX_BODY };
/* A link has few sessions. A client without a request, or with half of one, must not keep them from others for ever. */
static const int64_t IDLE_NS = 30000000000;

struct server {
    struct protocol_spec spec;
    int64_t t_ns;     /* device time of the last tick */
    int64_t until_ns; /* for the next request */
    int over;         /* the last answer is given */
    int no_body;      /* the answer is to HEAD: it says how long its body is, and has none */
    struct http_reader reader;
    char body[MAX_BODY], answer[MAX_ANSWER];
};

static const struct status {
    int number;
    const char *words, *text; /* where nothing more exact is known */
} statuses[] = {
    {200, "OK", ""},
    {400, "Bad Request", "this is not a request of HTTP/1.1"},
    {403, "Forbidden", "settings are refused to pages of another origin"},
    {404, "Not Found", "no such path"},
    {405, "Method Not Allowed", "this path allows another method"},
    {408, "Request Timeout", "a request must be complete within 30 s"},
    {409, "Conflict", ""},
    {411, "Length Required", "chunked bodies are not supported; a body must have a Content-Length"},
    {413, "Content Too Large", "a body must have at most 1024 bytes"},
    {414, "URI Too Long", "a request line must have at most 512 bytes"},
    {417, "Expectation Failed", "only Expect: 100-continue is supported"},
    {431, "Request Header Fields Too Large", "the header of a request must have at most 4096 bytes"},
    {501, "Not Implemented", "only GET, HEAD and POST are supported"},
    {503, "Service Unavailable", ""},
    {505, "HTTP Version Not Supported", "only HTTP/1.0 and HTTP/1.1 are supported"},
};

static const struct status *status_of(int number)
{
    size_t i = 0;
    while (i + 1 < sizeof statuses / sizeof statuses[0] && statuses[i].number != number)
        i++;
    return &statuses[i];
}

/* Sends one answer, with a body of len bytes. No answer repeats a text that came from the client. Where the head
 * refuses a setting, the answer has the command line that was made of it. */
static void answer(struct server *s, int number, const char *type, const char *body, size_t len, const char *more)
{
    const struct status *status = status_of(number);
    const int n = snprintf(s->answer, sizeof s->answer,
                           "HTTP/1.1 %d %s\r\nConnection: %s\r\nCache-Control: no-store\r\n%sContent-Type: %s\r\n"
                           "X-Content-Type-Options: nosniff\r\nContent-Length: %zu\r\n\r\n%.*s",
                           status->number, status->words, s->over ? "close" : "keep-alive", more, type, len,
                           s->no_body ? 0 : (int)len, body);
    s->spec.host.send(s->spec.host.ctx, s->answer, (size_t)n);
    if (number >= 400) s->spec.host.count(s->spec.host.ctx, PROTOCOL_WRONG, 1);
    if (s->over) s->spec.host.hang_up(s->spec.host.ctx);
}

static const char plain[] = "text/plain; charset=us-ascii";

/* Answers with a line of plain text; NULL: that of the table. */
static void answer_error(struct server *s, int number, const char *text, const char *more)
{
    const int n = snprintf(s->body, sizeof s->body, "%s\n", text != NULL ? text : status_of(number)->text);
    answer(s, number, plain, s->body, (size_t)n, more);
}

static void carry_out(struct server *s, const struct http_request *q)
{
    const int takes = velodyne_takes_forms(q->path), shows = velodyne_has_page(q->path);
    char text[VELODYNE_TEXT] = "";
    s->no_body = strcmp(q->method, "HEAD") == 0;
    if (!takes && !shows) {
        answer_error(s, 404, NULL, "");
    } else if (strcmp(q->method, takes ? "POST" : "GET") != 0 && !(shows && s->no_body)) {
        answer_error(s, 405, NULL, takes ? "Allow: POST\r\n" : "Allow: GET, HEAD\r\n");
    } else if (takes && q->foreign) {
        answer_error(s, 403, NULL, "");
    } else if (takes) {
        /* The device answers 204. MRPT 2.5.8 takes 200 alone, other clients take both. */
        const int status = velodyne_post(&s->spec, q->path, q->body, q->body_len, text);
        if (status == 200)
            answer(s, 200, plain, "", 0, "");
        else
            answer_error(s, status, text, "");
    } else {
        const size_t len = velodyne_page(&s->spec, q->path, s->t_ns, s->body, sizeof s->body);
        answer(s, 200, "application/json", s->body, len, "");
    }
}

static void give_time(struct server *s)
{
    s->until_ns = s->spec.waits ? INT64_MAX : s->t_ns + IDLE_NS;
}

/* Answers all requests that are whole. */
static void serve(struct server *s)
{
    static const char go_on[] = "HTTP/1.1 100 Continue\r\n\r\n";
    int result = HTTP_REQUEST;
    while (!s->over && result == HTTP_REQUEST) {
        result = http_reader_next(&s->reader);
        if (result == HTTP_CONTINUE) s->spec.host.send(s->spec.host.ctx, go_on, sizeof go_on - 1);
        if (result >= 400) {
            s->over = 1;
            s->no_body = 0;
            answer_error(s, result, NULL, "");
        }
        if (result == HTTP_REQUEST) {
            s->over = !s->reader.request.keep_alive;
            carry_out(s, &s->reader.request);
            give_time(s);
            http_reader_drop(&s->reader);
        }
    }
}

static void velodyne_http_input(void *protocol, const uint8_t *bytes, size_t len)
{
    struct server *s = protocol;
    while (len > 0 && !s->over) {
        const size_t n = http_reader_add(&s->reader, bytes, len);
        bytes += n;
        len -= n;
        serve(s);
    }
    if (!s->over) return;
    len += s->reader.len;
    s->reader.len = 0;
    if (len > 0) s->spec.host.count(s->spec.host.ctx, PROTOCOL_INPUT_LOST, len);
}

static void open_at(void *protocol, int64_t t_ns)
{
    struct server *s = protocol;
    s->t_ns = t_ns;
    give_time(s);
}

static void at_time(void *protocol, int64_t t_ns)
{
    struct server *s = protocol;
    s->t_ns = t_ns;
    if (s->over || t_ns < s->until_ns) return;
    s->over = 1;
    s->no_body = 0;
    if (s->reader.len > 0)
        answer_error(s, 408, NULL, "");
    else
        s->spec.host.hang_up(s->spec.host.ctx);
}

static int64_t next_ns(const void *protocol)
{
    const struct server *s = protocol;
    return s->over ? INT64_MAX : s->until_ns;
}

/* Each request is answered at once. */
static int owes(const void *protocol)
{
    (void)protocol;
    return 0;
}

const struct protocol_ops protocol_velodyne_http = {
    .name = "velodyne-http",
    .emitters = 1u << NATIVE_EMIT_BEAMS,
    .n_beams = VELODYNE_BEAMS,
    .max_unit = MAX_ANSWER,
    .brief = 1,
    .size = sizeof(struct server),
    .open = open_at,
    .time = at_time,
    .input = velodyne_http_input,
    .owes = owes,
    .next_ns = next_ns,
};
