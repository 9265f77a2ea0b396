/* SPDX-License-Identifier: MIT */
/* The head of a request of HTTP/1.x: its lines, as RFC 9112 has them. The web link and the settings of a VLP-16 use it.
 *
 * Bytes from a client go in. Texts within these bytes come out, or the status that answers a broken head. A bare LF
 * ends a line, too. Pure; allocates nothing; any thread. */
#ifndef DRIVERS_PROTOCOL_HTTP_HEAD_H
#define DRIVERS_PROTOCOL_HTTP_HEAD_H

#include <stddef.h>

/* A part of a client's bytes: it has no NUL at its end, and is valid as long as these bytes are. */
struct http_text {
    const char *s;
    size_t len;
};

/* Value of a hexadecimal digit, as in %41: 0 to 15; -1: it is none. */
static inline int http_hex_digit(char c)
{
    return c >= '0' && c <= '9' ? c - '0' : (c | 32) >= 'a' && (c | 32) <= 'f' ? (c | 32) - 'a' + 10 : -1;
}

/* Letters of either case are the same. */
int http_text_is(struct http_text text, const char *word);
/* Whether a comma-separated list has the word. */
int http_list_has(struct http_text list, const char *word);

enum http_scan_result { HTTP_SCAN_MORE = 0, HTTP_SCAN_WHOLE = 1 /* 400 and more: a status */ };

/* How far a head has been looked at. Zeros: not at all. */
struct http_scan {
    size_t at; /* begin of the line that is not whole; after HTTP_SCAN_WHOLE the head's length */
    int n_lines;
};

/* Looks at what has come since the last call. bytes: all of the head so far, from its request line on. A byte that no
 * line may have at its place is found as soon as it is there. Other faults, such as a wrong version, are found at the
 * line's end. Returns an http_scan_result. */
int http_scan_head(struct http_scan *scan, const char *bytes, size_t len);

/* Returns the line at *at of a whole head, without its line end, and moves *at to the next line. An empty line is the
 * head's end. */
struct http_text http_next_line(const char *head, size_t len, size_t *at);

struct http_line {
    struct http_text method, target;
    int minor; /* of HTTP/1.x */
};
/* Reads "POST /cgi/setting?x HTTP/1.1". Returns 0, 400, or 505. */
int http_read_line(struct http_text line, struct http_line *out);

struct http_field {
    struct http_text name, value;
};
/* Reads "Host: localhost". Returns 0 or 400. */
int http_read_field(struct http_text line, struct http_field *out);

/* The fields that a server here looks at. Texts of fields that are missing have no bytes, and s is NULL. */
struct http_fields {
    struct http_text host, origin, site, key, version, protocol, upgrade; /* the last of each name */
    int n_host, n_origin, n_length;                                       /* how often these came */
    int has_coding;
    int expects, expects_other;          /* Expect: 100-continue, and anything else */
    int closes, keeps_alive, is_upgrade; /* words of Connection */
    size_t length;
};
/* Reads the fields of a whole head from the line at `at` on. 0 or 400. */
int http_read_fields(const char *head, size_t len, size_t at, struct http_fields *out);

/* Reads decimal digits. A number of ten million or more comes out as its first seven digits. 0 or 400. */
int http_read_length(struct http_text text, size_t *out);

struct http_place {
    struct http_text host; /* an IPv6 address has its brackets */
    int port;              /* 80 where none is named */
};
/* Reads "localhost:8080", of a Host or a URI. Returns 0 or 400. */
int http_read_place(struct http_text text, struct http_place *out);

/* A target's parts. place.s is NULL where it has none ("/a?b", not "http://localhost/a?b"). query is what follows the
 * first '?'. */
struct http_target {
    struct http_text place, path, query;
};
void http_split_target(struct http_text target, struct http_target *out);

/* Finds the place that a request of HTTP/1.minor is for. A target with a place (target_place.s is not NULL) takes
 * precedence over Host, and is then in fields->host (RFC 9112 3.2.2). 0; or 400, as where Host or Origin came twice. */
int http_find_place(struct http_fields *fields, int minor, struct http_text target_place, struct http_place *out);
/* Whether Origin is http:// and the place of fields->host. */
int http_is_own_origin(const struct http_fields *fields);

#endif
