/* SPDX-License-Identifier: MIT */
/* URIs of glTF: data within them (RFC 2397), and relative names of files (RFC 3986). */
#include "core/import/gltf/gltf_uri.h"

#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "core/scene/build_say.h"
#include "core/text.h"

bool gltf_uri_is_data(const char *uri)
{
    return strncasecmp(uri, "data:", 5) == 0;
}

/* %XX is one byte; any other % stays as it is. %00 stays, too, since a NUL would end the name. */
char *gltf_uri_name(const char *uri)
{
    char *name = malloc(strlen(uri) + 1), *to = name;
    for (const char *in = uri; name != NULL && *in != '\0'; in++) {
        const int high = *in == '%' ? text_hex_digit(in[1]) : -1, low = high >= 0 ? text_hex_digit(in[2]) : -1;
        if (low >= 0 && high + low > 0) {
            *to++ = (char)(16 * high + low);
            in += 2;
        } else {
            *to++ = *in;
        }
    }
    if (name != NULL) *to = '\0';
    return name;
}

/* The value of a base64 character, in either alphabet of RFC 4648; -1: it is none. */
static int sextet_of(char c)
{
    return c >= 'A' && c <= 'Z'   ? c - 'A'
           : c >= 'a' && c <= 'z' ? c - 'a' + 26
           : c >= '0' && c <= '9' ? c - '0' + 52
           : c == '+' || c == '-' ? 62
           : c == '/' || c == '_' ? 63
                                  : -1;
}

/* Decodes base64 up to the first '=' or the end. Returns the first character that is not base64; NULL: all are. */
static const char *decode_base64(const char *in, uint8_t *out, size_t *n)
{
    uint32_t bits = 0;
    size_t n_sextets = 0;
    *n = 0;
    for (; *in != '\0' && *in != '='; in++) {
        const int sextet = sextet_of(*in);
        if (sextet < 0) return in;
        bits = bits << 6 | (uint32_t)sextet;
        if (++n_sextets % 4 == 1) continue;
        out[(*n)++] = (uint8_t)(bits >> (6 - 2 * ((n_sextets + 3) % 4)));
    }
    return NULL;
}

int gltf_uri_data(struct scene_build *b, const char *uri, const char *at, void **own, struct gltf_bytes *out,
                  struct sh_err *err)
{
    const char *comma = strchr(uri, ','), *wrong;
    if (comma == NULL || comma - uri < 7 || strncasecmp(comma - 7, ";base64", 7) != 0)
        return build_fail(b, SH_EINPUT, err, "%s.uri must have its data in base64", at);
    uint8_t *data = malloc(strlen(comma) + 1);
    if (data == NULL) return build_fail(b, SH_ENOMEM, err, "no memory for %s", at);
    *own = data;
    wrong = decode_base64(comma + 1, data, &out->n);
    out->p = data;
    if (wrong == NULL) return SH_OK;
    return build_fail(b, SH_EINPUT, err, "%s.uri: byte %td is not a base64 character", at, wrong - uri);
}
