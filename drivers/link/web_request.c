/* SPDX-License-Identifier: MIT */
/* Reads a request of the web link, and decides whether its client may ask it. */
#include <arpa/inet.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

#include "drivers/link/web_inside.h"
#include "drivers/link/web_pages.h"

struct fields {
    struct http_text host, origin, site, key, version, protocol, upgrade;
    int n_host, n_origin, n_length, has_coding, has_protocol, is_upgrade, expects_other;
    size_t length;
};

static int read_field(struct fields *all, struct http_text line)
{
    struct http_field f;
    if (http_read_field(line, &f) != 0) return 400;
    if (http_text_is(f.name, "host"))
        all->host = f.value, all->n_host++;
    else if (http_text_is(f.name, "origin"))
        all->origin = f.value, all->n_origin++;
    else if (http_text_is(f.name, "sec-fetch-site"))
        all->site = f.value;
    else if (http_text_is(f.name, "sec-websocket-key"))
        all->key = f.value;
    else if (http_text_is(f.name, "sec-websocket-version"))
        all->version = f.value;
    else if (http_text_is(f.name, "sec-websocket-protocol"))
        all->protocol = f.value, all->has_protocol = 1;
    else if (http_text_is(f.name, "upgrade"))
        all->upgrade = f.value;
    else if (http_text_is(f.name, "connection"))
        all->is_upgrade |= http_list_has(f.value, "upgrade");
    else if (http_text_is(f.name, "transfer-encoding"))
        all->has_coding = 1;
    else if (http_text_is(f.name, "expect"))
        all->expects_other |= !http_text_is(f.value, "100-continue");
    else if (http_text_is(f.name, "content-length"))
        return all->n_length++ != 0 ? 400 : http_read_length(f.value, &all->length);
    return 0;
}

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

static int is_own_origin(const struct fields *f)
{
    static const char scheme[] = "http://";
    const size_t n = sizeof scheme - 1;
    return f->host.len != 0 && f->origin.len == n + f->host.len && strncasecmp(f->origin.s, scheme, n) == 0 &&
           strncasecmp(f->origin.s + n, f->host.s, f->host.len) == 0;
}

/* An image or a script of another site's page is asked for without an Origin, but browsers then say in Sec-Fetch-Site
 * where it is from. Links from other sites to the page's own files work. */
static int is_foreign_part(const struct fields *f, const char *path)
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
static int read_upgrade(const struct fields *f, struct web_request *out, const char **words)
{
    *words = "/ws takes only a WebSocket of version 13, subprotocol scanhead-native-1";
    if (!f->is_upgrade || !http_list_has(f->upgrade, "websocket") || !http_text_is(f->version, "13")) return 426;
    *words = "Sec-WebSocket-Key must be 16 bytes as base64";
    if (!is_key(f->key)) return 400;
    *words = "the subprotocol must be scanhead-native-1, or not given";
    if (f->has_protocol && !http_list_has(f->protocol, "scanhead-native-1")) return 400;
    snprintf(out->key, sizeof out->key, "%.*s", (int)f->key.len, f->key.s);
    out->names_protocol = f->has_protocol;
    return 0;
}

/* Checks Host and Origin. */
static int check_asker(struct fields *f, int minor, struct http_text place_of_target, struct http_place *place)
{
    if (f->n_host > 1 || f->n_origin > 1 || (f->n_host == 0 && minor > 0)) return 400;
    if (place_of_target.s != NULL) f->host = place_of_target; /* RFC 9112 3.2.2 */
    if (http_read_place(f->host, place) != 0) return 400;
    return f->n_origin > 0 && !is_own_origin(f) ? WEB_FOREIGN : 0;
}

static int read_all(const char *head, size_t len, struct http_line *line, struct fields *f)
{
    size_t at = 0;
    struct http_text text = http_next_line(head, len, &at);
    int status = http_read_line(text, line);
    while (status == 0 && (text = http_next_line(head, len, &at)).len != 0)
        status = read_field(f, text);
    return status;
}

int web_request_read(const struct web_link *web, const char *head, size_t len, struct web_request *out,
                     const char **words)
{
    struct fields f = {.n_host = 0};
    struct http_line line;
    struct http_target target;
    struct http_place place;
    memset(out, 0, sizeof *out);
    *words = "this is not a request of HTTP/1.1";
    int status = read_all(head, len, &line, &f);
    if (status != 0) return status;
    http_split_target(line.target, &target);
    out->head_only = http_text_is(line.method, "HEAD");
    *words = "a request must have one Host, the address that scanhead printed, and at most one Origin";
    if ((status = check_asker(&f, line.minor, target.place, &place)) != 0) return status;
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
