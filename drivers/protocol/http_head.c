/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/http_head.h"

#include <string.h>
#include <strings.h>

int http_text_is(struct http_text text, const char *word)
{
    return text.len == strlen(word) && strncasecmp(text.s, word, text.len) == 0;
}

static struct http_text trimmed(struct http_text t)
{
    for (; t.len > 0 && (*t.s == ' ' || *t.s == '\t'); t.len--)
        t.s++;
    while (t.len > 0 && (t.s[t.len - 1] == ' ' || t.s[t.len - 1] == '\t'))
        t.len--;
    return t;
}

int http_list_has(struct http_text list, const char *word)
{
    if (list.len == 0) return 0; /* a field that is missing has no text at all */
    for (size_t at = 0, n; at <= list.len; at += n + 1) {
        for (n = 0; at + n < list.len && list.s[at + n] != ','; n++)
            continue;
        if (http_text_is(trimmed((struct http_text){list.s + at, n}), word)) return 1;
    }
    return 0;
}

static int is_alnum(char c)
{
    return (c >= '0' && c <= '9') || ((c | 32) >= 'a' && (c | 32) <= 'z');
}

static int is_one_of(char c, const char *set)
{
    return c != '\0' && strchr(set, c) != NULL;
}

static int is_token(struct http_text t)
{
    for (size_t i = 0; i < t.len; i++)
        if (!is_alnum(t.s[i]) && !is_one_of(t.s[i], "!#$%&'*+-.^_`|~")) return 0;
    return t.len > 0;
}

static int is_text(struct http_text t)
{
    for (size_t i = 0; i < t.len; i++)
        if (((unsigned char)t.s[i] < 32 && t.s[i] != '\t') || t.s[i] == 127) return 0;
    return 1;
}

/* Cuts a text at its first mark, and leaves that one out. `after` may have more. Returns 0 where there is no mark. */
static int cut(struct http_text t, char mark, struct http_text *before, struct http_text *after)
{
    const char *at = t.len > 0 ? memchr(t.s, mark, t.len) : NULL;
    if (at == NULL) return 0;
    const size_t n = (size_t)(at - t.s);
    *before = (struct http_text){t.s, n};
    *after = (struct http_text){at + 1, t.len - n - 1};
    return 1;
}

int http_read_line(struct http_text line, struct http_line *out)
{
    struct http_text rest, version;
    if (!cut(line, ' ', &out->method, &rest) || !is_token(out->method)) return 400;
    if (!cut(rest, ' ', &out->target, &version) || out->target.len == 0 || !is_text(out->target)) return 400;
    const char *v = version.s;
    if (version.len != 8 || memcmp(v, "HTTP/", 5) != 0 || v[6] != '.') return 400;
    if (v[5] != '1' || v[7] < '0' || v[7] > '9') return 505;
    out->minor = v[7] - '0';
    return 0;
}

int http_read_field(struct http_text line, struct http_field *out)
{
    if (!cut(line, ':', &out->name, &out->value) || !is_token(out->name) || !is_text(out->value)) return 400;
    out->value = trimmed(out->value);
    return 0;
}

struct http_text http_next_line(const char *head, size_t len, size_t *at)
{
    const char *begin = head + *at, *end = memchr(begin, '\n', len - *at);
    const size_t n = end != NULL ? (size_t)(end - begin) : len - *at;
    *at += n + (end != NULL);
    return (struct http_text){begin, n > 0 && begin[n - 1] == '\r' ? n - 1 : n};
}

/* Whether a line's beginning can still become a correct line. */
static int may_become_line(struct http_text begin, int is_first)
{
    struct http_text name, rest;
    if (begin.len > 0 && begin.s[begin.len - 1] == '\r') begin.len--;
    if (begin.len == 0) return 1;
    if (!cut(begin, is_first ? ' ' : ':', &name, &rest)) return is_token(begin);
    return is_token(name) && is_text(rest);
}

int http_scan_head(struct http_scan *scan, const char *bytes, size_t len)
{
    while (scan->at < len && memchr(bytes + scan->at, '\n', len - scan->at) != NULL) {
        struct http_line first;
        struct http_field field;
        const struct http_text line = http_next_line(bytes, len, &scan->at);
        if (scan->n_lines > 0 && line.len == 0) return HTTP_SCAN_WHOLE;
        const int status = scan->n_lines == 0 ? http_read_line(line, &first) : http_read_field(line, &field);
        if (status != 0) return status;
        scan->n_lines++;
    }
    const struct http_text begin = {bytes + scan->at, len - scan->at};
    return may_become_line(begin, scan->n_lines == 0) ? HTTP_SCAN_MORE : 400;
}

int http_read_length(struct http_text text, size_t *out)
{
    *out = 0;
    for (size_t i = 0; i < text.len; i++) {
        if (text.s[i] < '0' || text.s[i] > '9') return 400;
        if (*out < 1000000) *out = *out * 10 + (size_t)(text.s[i] - '0');
    }
    return text.len > 0 ? 0 : 400;
}

static int take_field(struct http_fields *all, const struct http_field *f)
{
    if (http_text_is(f->name, "host")) {
        all->host = f->value;
        all->n_host++;
    } else if (http_text_is(f->name, "origin")) {
        all->origin = f->value;
        all->n_origin++;
    } else if (http_text_is(f->name, "sec-fetch-site")) {
        all->site = f->value;
    } else if (http_text_is(f->name, "sec-websocket-key")) {
        all->key = f->value;
    } else if (http_text_is(f->name, "sec-websocket-version")) {
        all->version = f->value;
    } else if (http_text_is(f->name, "sec-websocket-protocol")) {
        all->protocol = f->value;
    } else if (http_text_is(f->name, "upgrade")) {
        all->upgrade = f->value;
    } else if (http_text_is(f->name, "connection")) {
        all->closes |= http_list_has(f->value, "close");
        all->keeps_alive |= http_list_has(f->value, "keep-alive");
        all->is_upgrade |= http_list_has(f->value, "upgrade");
    } else if (http_text_is(f->name, "transfer-encoding")) {
        all->has_coding = 1;
    } else if (http_text_is(f->name, "expect")) {
        all->expects = http_text_is(f->value, "100-continue");
        all->expects_other |= !all->expects;
    } else if (http_text_is(f->name, "content-length")) {
        return all->n_length++ != 0 ? 400 : http_read_length(f->value, &all->length);
    }
    return 0;
}

int http_read_fields(const char *head, size_t len, size_t at, struct http_fields *out)
{
    struct http_text line;
    struct http_field field;
    int status = 0;
    memset(out, 0, sizeof *out);
    while (status == 0 && (line = http_next_line(head, len, &at)).len != 0)
        status = http_read_field(line, &field) != 0 ? 400 : take_field(out, &field);
    return status;
}

int http_read_place(struct http_text text, struct http_place *out)
{
    const char *end = text.len > 0 && *text.s == '[' ? memchr(text.s, ']', text.len) : NULL;
    struct http_text port = {NULL, 0};
    size_t n = end != NULL ? (size_t)(end + 1 - text.s) : 0, value = 80;
    for (; n < text.len && text.s[n] != ':'; n++)
        if (end != NULL || (!is_alnum(text.s[n]) && !is_one_of(text.s[n], "-._~%!$&'()*+,;="))) return 400;
    for (size_t i = 1; end != NULL && i + 1 < n; i++)
        if (!is_alnum(text.s[i]) && !is_one_of(text.s[i], ".:%")) return 400;
    if (n < text.len) port = (struct http_text){text.s + n + 1, text.len - n - 1};
    if (port.len > 0 && (http_read_length(port, &value) != 0 || value > 65535)) return 400;
    *out = (struct http_place){{text.s, n}, (int)value};
    return 0;
}

static const char scheme[] = "http://";

void http_split_target(struct http_text target, struct http_target *out)
{
    const size_t n = sizeof scheme - 1;
    struct http_text path = target;
    *out = (struct http_target){.place = {NULL, 0}};
    if (target.len >= n && strncasecmp(target.s, scheme, n) == 0) {
        size_t end = n;
        while (end < target.len && target.s[end] != '/' && target.s[end] != '?')
            end++;
        out->place = (struct http_text){target.s + n, end - n};
        path = (struct http_text){target.s + end, target.len - end};
    }
    if (!cut(path, '?', &out->path, &out->query)) out->path = path;
    if (out->place.s != NULL && out->path.len == 0) out->path = (struct http_text){"/", 1};
}

int http_find_place(struct http_fields *fields, int minor, struct http_text target_place, struct http_place *out)
{
    if (fields->n_host > 1 || fields->n_origin > 1 || (fields->n_host == 0 && minor > 0)) return 400;
    if (target_place.s != NULL) fields->host = target_place;
    return http_read_place(fields->host, out);
}

int http_is_own_origin(const struct http_fields *fields)
{
    const struct http_text host = fields->host, origin = fields->origin;
    const size_t n = sizeof scheme - 1;
    return host.len != 0 && origin.len == n + host.len && strncasecmp(origin.s, scheme, n) == 0 &&
           strncasecmp(origin.s + n, host.s, host.len) == 0;
}
