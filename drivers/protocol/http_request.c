#include "drivers/protocol/http_request.h"

#include <string.h>
#include <strings.h>

void http_reader_init(struct http_reader *r)
{
    memset(r, 0, sizeof *r);
}

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
    r->looked = r->head_len = 0;
    r->continued = 0;
}

void http_reader_drop(struct http_reader *r)
{
    forget(r, r->head_len + r->request.body_len);
}

/* What a field of the head is cut into while it is read. */
struct head {
    const char *host, *origin;
    size_t host_len, origin_len;
    int n_host, n_length, n_coding, expects, expects_other, close, keep_alive;
    size_t length;
};

static int is_token(const char *s, size_t len)
{
    for (size_t i = 0; i < len; i++) {
        const int alnum = (s[i] >= '0' && s[i] <= '9') || ((s[i] | 32) >= 'a' && (s[i] | 32) <= 'z');
        if (!alnum && (s[i] == 0 || strchr("!#$%&'*+-.^_`|~", s[i]) == NULL)) return 0;
    }
    return len > 0;
}

static int is_text(const char *s, size_t len)
{
    for (size_t i = 0; i < len; i++)
        if (((unsigned char)s[i] < 32 && s[i] != '\t') || s[i] == 127) return 0;
    return 1;
}

static int same_word(const char *s, size_t len, const char *word)
{
    return len == strlen(word) && strncasecmp(s, word, len) == 0;
}

/* Whether a comma-separated list has the word. */
static int has_word(const char *s, size_t len, const char *word)
{
    for (size_t at = 0, n; at <= len; at += n + 1) {
        for (n = 0; at + n < len && s[at + n] != ','; n++)
            continue;
        size_t from = at, to = at + n;
        while (from < to && (s[from] == ' ' || s[from] == '\t'))
            from++;
        while (to > from && (s[to - 1] == ' ' || s[to - 1] == '\t'))
            to--;
        if (same_word(s + from, to - from, word)) return 1;
    }
    return 0;
}

/* "POST /cgi/setting?x HTTP/1.1": 0, or a status. */
static int read_request_line(struct http_request *q, const char *line, size_t len)
{
    const char *blank = memchr(line, ' ', len);
    if (blank == NULL || !is_token(line, (size_t)(blank - line))) return 400;
    const size_t method_len = (size_t)(blank - line);
    const char *target = blank + 1, *end = memchr(target, ' ', len - method_len - 1);
    if (end == NULL || end == target || !is_text(target, (size_t)(end - target))) return 400;
    const char *version = end + 1;
    if (len - (size_t)(version - line) != 8 || memcmp(version, "HTTP/", 5) != 0 || version[6] != '.') return 400;
    if (version[5] != '1' || version[7] < '0' || version[7] > '9') return 505;
    if (method_len >= sizeof q->method) return 501;
    const char *query = memchr(target, '?', (size_t)(end - target));
    size_t path_len = (size_t)((query != NULL ? query : end) - target);
    if (path_len >= sizeof q->path) path_len = sizeof q->path - 1;
    memcpy(q->method, line, method_len);
    memcpy(q->path, target, path_len);
    q->minor = version[7] - '0';
    return 0;
}

/* Decimal digits alone; more than any limit: 413. */
static int read_length(const char *s, size_t len, size_t *out)
{
    *out = 0;
    if (len == 0) return 400;
    for (size_t i = 0; i < len; i++) {
        if (s[i] < '0' || s[i] > '9') return 400;
        if (*out < 1000000) *out = *out * 10 + (size_t)(s[i] - '0');
    }
    return 0;
}

static int read_field(struct head *h, const char *line, size_t len)
{
    const char *colon = memchr(line, ':', len);
    if (colon == NULL || !is_token(line, (size_t)(colon - line)) || !is_text(line, len)) return 400;
    const size_t name_len = (size_t)(colon - line);
    const char *value = colon + 1;
    size_t value_len = len - name_len - 1;
    for (; value_len > 0 && (*value == ' ' || *value == '\t'); value_len--)
        value++;
    while (value_len > 0 && (value[value_len - 1] == ' ' || value[value_len - 1] == '\t'))
        value_len--;
    if (same_word(line, name_len, "host")) {
        h->n_host++;
        h->host = value;
        h->host_len = value_len;
    } else if (same_word(line, name_len, "origin")) {
        h->origin = value;
        h->origin_len = value_len;
    } else if (same_word(line, name_len, "transfer-encoding")) {
        h->n_coding++;
    } else if (same_word(line, name_len, "connection")) {
        h->close |= has_word(value, value_len, "close");
        h->keep_alive |= has_word(value, value_len, "keep-alive");
    } else if (same_word(line, name_len, "expect")) {
        h->expects = same_word(value, value_len, "100-continue");
        h->expects_other = !h->expects;
    } else if (same_word(line, name_len, "content-length")) {
        if (h->n_length++ != 0) return 400;
        return read_length(value, value_len, &h->length);
    }
    return 0;
}

/* Lines of the head: the next one without its end, from *at on. */
static size_t next_line(const struct http_reader *r, size_t *at, const char **line)
{
    *line = r->bytes + *at;
    size_t len = (size_t)((const char *)memchr(*line, '\n', r->head_len - *at) - *line);
    *at += len + 1;
    return len > 0 && (*line)[len - 1] == '\r' ? len - 1 : len;
}

static int is_foreign(const struct head *h)
{
    static const char http[] = "http://";
    const size_t n = sizeof http - 1;
    if (h->origin == NULL) return 0;
    return h->origin_len != n + h->host_len || strncasecmp(h->origin, http, n) != 0 ||
           strncasecmp(h->origin + n, h->host, h->host_len) != 0;
}

/* 0, or the status of a head that is broken. */
static int read_head(struct http_reader *r, struct head *h)
{
    struct http_request *q = &r->request;
    const char *line;
    size_t at = 0, len = next_line(r, &at, &line);
    memset(q, 0, sizeof *q);
    memset(h, 0, sizeof *h);
    int status = read_request_line(q, line, len);
    while (status == 0 && (len = next_line(r, &at, &line)) != 0)
        status = read_field(h, line, len);
    if (status != 0) return status;
    if (h->n_host > 1 || (h->n_host == 0 && q->minor > 0)) return 400;
    if (h->n_coding != 0 || (h->n_length == 0 && strcmp(q->method, "POST") == 0)) return 411;
    if (h->length > HTTP_MAX_BODY) return 413;
    if (h->expects_other) return 417;
    q->keep_alive = !h->close && (q->minor > 0 || h->keep_alive);
    q->foreign = is_foreign(h);
    q->body_len = h->length;
    return 0;
}

/* Whether the empty line that ends the head has come; or a status. Empty lines before a request are skipped. */
static int find_head(struct http_reader *r)
{
    size_t empty = 0;
    while (r->looked == 0 && empty < r->len && (r->bytes[empty] == '\r' || r->bytes[empty] == '\n'))
        empty++;
    if (empty != 0) forget(r, empty);
    for (size_t i = r->looked; i < r->len; i++) {
        r->looked = i + 1;
        if (i >= HTTP_MAX_HEAD) return 431;
        if (r->bytes[i] != '\n') continue;
        const int ends =
            i > 0 && (r->bytes[i - 1] == '\n' || (i > 1 && r->bytes[i - 1] == '\r' && r->bytes[i - 2] == '\n'));
        if (!ends) continue;
        r->head_len = i + 1;
        break;
    }
    const char *line_end = memchr(r->bytes, '\n', r->len);
    const size_t line_len = line_end != NULL ? (size_t)(line_end - r->bytes) : r->len;
    return line_len > HTTP_MAX_LINE ? 414 : 0;
}

int http_reader_next(struct http_reader *r)
{
    struct head h;
    int status = r->head_len == 0 ? find_head(r) : 0;
    if (status != 0) return status;
    if (r->head_len == 0) return HTTP_MORE;
    status = read_head(r, &h);
    if (status != 0) return status;
    if (r->len - r->head_len < r->request.body_len) {
        if (!h.expects || r->continued || r->request.minor == 0) return HTTP_MORE;
        r->continued = 1;
        return HTTP_CONTINUE;
    }
    r->request.body = r->bytes + r->head_len;
    return HTTP_REQUEST;
}
