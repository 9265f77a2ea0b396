/* SPDX-License-Identifier: MIT */
/* Reads a request of the web link, and decides whether its client may ask it. */
#include <arpa/inet.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

#include "drivers/link/web_inside.h"
#include "drivers/link/web_pages.h"

static int is_number(const char *host)
{
    unsigned char address[16];
    char inner[64];
    if (sscanf(host, "[%63[^]]", inner) == 1) return inet_pton(AF_INET6, inner, address) == 1;
    return inet_pton(AF_INET, host, address) == 1;
}

/* Whether Host is a name of this machine: a number, localhost, the name in the configuration or the machine's own. Its
 * port must be that of the link. */
static int is_own_host(const struct web_link *web, const struct http_place *place)
{
    char host[300], own[256] = "";
    if (place->port != web->port || place->host.len == 0 || place->host.len >= sizeof host) return 0;
    memcpy(host, place->host.s, place->host.len);
    host[place->host.len] = '\0';
    if (gethostname(own, sizeof own - 1) != 0) own[0] = '\0';
    return is_number(host) || strcasecmp(host, "localhost") == 0 || strcasecmp(host, web->host) == 0 ||
           (own[0] != '\0' && strcasecmp(host, own) == 0);
}

/* For an image or a script in another site's page a browser sends no Origin. Its Sec-Fetch-Site then says that the page
 * is another site's. Links from other sites to the page's own files work. */
static int is_foreign_part(const struct http_fields *f, const char *path)
{
    struct web_page page;
    return (http_text_is(f->site, "cross-site") || http_text_is(f->site, "same-site")) && !web_page_at(path, &page);
}

/* Decodes %41 and the like. Returns 0; 1 if the text is cut; or the status 400. */
static int web_request_decode(struct http_text in, char *out, size_t room)
{
    size_t n = 0;
    for (size_t i = 0; i < in.len; i++) {
        int c = (unsigned char)in.s[i];
        if (c == '%') {
            if (in.len - i < 3 || http_hex_digit(in.s[i + 1]) < 0 || http_hex_digit(in.s[i + 2]) < 0) return 400;
            c = http_hex_digit(in.s[i + 1]) * 16 + http_hex_digit(in.s[i + 2]);
            i += 2;
            if (c == 0) return 400;
        }
        if (n < room) out[n] = (char)c;
        n++;
    }
    out[n < room ? n : room - 1] = '\0';
    return n >= room;
}

/* Whether a key is 16 bytes as base64. */
static int is_key(struct http_text key)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (size_t i = 0; i < key.len; i++)
        if (i < 22 ? key.s[i] == '\0' || strchr(digits, key.s[i]) == NULL : key.s[i] != '=') return 0;
    return key.len == 24;
}

/* Checks the fields that ask for a WebSocket (RFC 6455 4.2.1). */
static int read_upgrade(const struct http_fields *f, struct web_request *out, const char **words)
{
    *words = "/ws takes only a WebSocket of version 13, subprotocol scanhead-native-1";
    if (!f->is_upgrade || !http_list_has(f->upgrade, "websocket") || !http_text_is(f->version, "13")) return 426;
    *words = "Sec-WebSocket-Key must be 16 bytes as base64";
    if (!is_key(f->key)) return 400;
    *words = "the subprotocol must be scanhead-native-1, or not given";
    if (f->protocol.s != NULL && !http_list_has(f->protocol, "scanhead-native-1")) return 400;
    snprintf(out->key, sizeof out->key, "%.*s", (int)f->key.len, f->key.s);
    out->names_protocol = f->protocol.s != NULL;
    return 0;
}

int web_request_read(const struct web_link *web, const char *head, size_t len, struct web_request *out,
                     const char **words)
{
    struct http_fields f;
    struct http_line line;
    struct http_target target;
    struct http_place place;
    size_t at = 0;
    memset(out, 0, sizeof *out);
    *words = "this is not a request of HTTP/1.1";
    int status = http_read_line(http_next_line(head, len, &at), &line);
    if (status == 0) status = http_read_fields(head, len, at, &f);
    if (status != 0) return status;
    http_split_target(line.target, &target);
    out->head_only = http_text_is(line.method, "HEAD");
    *words = "a request must have one Host, the address that scanhead printed, and at most one Origin";
    if (http_find_place(&f, line.minor, target.place, &place) != 0) return 400;
    if (f.n_origin > 0 && !http_is_own_origin(&f)) return WEB_FOREIGN;
    *words = "only GET and HEAD are answered; commands go over the WebSocket at /ws";
    if (!out->head_only && !http_text_is(line.method, "GET")) return 405;
    *words = "the Host of this request is not this head; use the address that scanhead printed";
    if (!is_own_host(web, &place)) return 421;
    *words = "only Expect: 100-continue is supported";
    if (f.expects_other) return 417;
    *words = "a request must not have content here";
    if (f.has_coding || f.length > 0) return f.has_coding && f.n_length > 0 ? 400 : 413;
    *words = "a path must begin with /, and %XX in it must be a byte in hexadecimal, but not 0";
    if (target.path.len == 0 || target.path.s[0] != '/') return 400;
    if (web_request_decode(target.path, out->path, sizeof out->path) == 400) return 400;
    if (is_foreign_part(&f, out->path)) return WEB_FOREIGN;
    const int query = web_request_decode(target.query, out->query, sizeof out->query);
    if (query == 400) return 400;
    out->query_long = query == 1;
    f.is_upgrade &= !out->head_only && line.minor > 0; /* RFC 6455 4.1: only a GET of HTTP/1.1 is one */
    return strcmp(out->path, "/ws") == 0 ? read_upgrade(&f, out, words) : 0;
}
