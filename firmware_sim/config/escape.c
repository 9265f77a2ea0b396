/* SPDX-License-Identifier: MIT */
#include "firmware_sim/config/escape.h"

#include <stdio.h>
#include <string.h>

/* Characters of three bytes that YAML doesn't keep in a scalar, or that are no characters of YAML at all (YAML 1.1,
 * 5.1: those up to U+FFFD are). */
static const struct {
    const char *bytes, *escape;
} wide[] = {{"\xe2\x80\xa8", "\\u2028"},
            {"\xe2\x80\xa9", "\\u2029"},
            {"\xef\xbb\xbf", "\\ufeff"},
            {"\xef\xbf\xbe", "\\ufffe"},
            {"\xef\xbf\xbf", "\\uffff"}};

size_t config_escape(const char *p, char out[CONFIG_ESCAPE_ROOM])
{
    const unsigned char c = (unsigned char)p[0], next = (unsigned char)p[1];
    for (size_t i = 0; i < sizeof wide / sizeof wide[0]; i++) {
        if (strncmp(p, wide[i].bytes, 3) != 0) continue;
        snprintf(out, CONFIG_ESCAPE_ROOM, "%s", wide[i].escape);
        return 3;
    }
    if (c == 0xc2 && next >= 0x80 && next < 0xa0) { /* U+0080 to U+009F: their number is the second byte */
        snprintf(out, CONFIG_ESCAPE_ROOM, "\\x%02x", next);
        return 2;
    }
    if (c < 0x20 || c == 0x7f)
        snprintf(out, CONFIG_ESCAPE_ROOM, "\\x%02x", c);
    else
        snprintf(out, CONFIG_ESCAPE_ROOM, "%s%c", c == '"' || c == '\\' ? "\\" : "", c);
    return 1;
}
