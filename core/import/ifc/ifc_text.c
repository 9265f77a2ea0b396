/* SPDX-License-Identifier: MIT */
/* Texts of STEP files (ISO 10303-21, 6.4.3) as UTF-8. */
#include "core/import/ifc/ifc_text.h"

#include <stdlib.h>
#include <string.h>

#include "core/utf8.h"

static int hex(const char *p, const char *end, int digits, uint32_t *value)
{
    *value = 0;
    if (end - p < digits) return 0;
    for (int i = 0; i < digits; i++) {
        const int digit = text_hex_digit(p[i]);
        if (digit < 0) return 0;
        *value = 16 * *value + (uint32_t)digit;
    }
    return 1;
}

static char *ifc_text_put(char *out, uint32_t code)
{
    if (code > 0x10ffff || (code >= 0xd800 && code < 0xe000)) code = 0xfffd;
    if (code < 0x80) {
        *out++ = (char)code;
    } else if (code < 0x800) {
        *out++ = (char)(0xc0 | code >> 6);
        *out++ = (char)(0x80 | (code & 0x3f));
    } else {
        if (code < 0x10000) {
            *out++ = (char)(0xe0 | code >> 12);
        } else {
            *out++ = (char)(0xf0 | code >> 18);
            *out++ = (char)(0x80 | (code >> 12 & 0x3f));
        }
        *out++ = (char)(0x80 | (code >> 6 & 0x3f));
        *out++ = (char)(0x80 | (code & 0x3f));
    }
    return out;
}

/* Reads \X2\ (4 digits a character, with pairs of UTF-16) or \X4\ (8 digits), up to \X0\. Returns the
 * place after it. */
static const char *wide(const char *p, const char *end, int digits, char **out)
{
    uint32_t code, low;
    while (hex(p, end, digits, &code)) {
        p += digits;
        if (digits == 4 && code >= 0xd800 && code < 0xdc00 && hex(p, end, 4, &low) && low >= 0xdc00 && low < 0xe000) {
            code = 0x10000 + ((code - 0xd800) << 10) + (low - 0xdc00);
            p += 4;
        }
        *out = ifc_text_put(*out, code);
    }
    return end - p >= 4 && memcmp(p, "\\X0\\", 4) == 0 ? p + 4 : p;
}

/* Reads an escape at p, which is a backslash. Returns the place after it; p: it is no escape. */
static const char *escape(const char *p, const char *end, char **out)
{
    uint32_t code;
    if (end - p >= 4 && memcmp(p, "\\X2\\", 4) == 0) return wide(p + 4, end, 4, out);
    if (end - p >= 4 && memcmp(p, "\\X4\\", 4) == 0) return wide(p + 4, end, 8, out);
    if (end - p >= 5 && memcmp(p, "\\X\\", 3) == 0 && hex(p + 3, end, 2, &code)) {
        *out = ifc_text_put(*out, code);
        return p + 5;
    }
    if (end - p >= 4 && memcmp(p, "\\S\\", 3) == 0) {
        *out = ifc_text_put(*out, (uint32_t)(unsigned char)p[3] + 0x80);
        return p + 4;
    }
    if (end - p >= 4 && p[1] == 'P' && p[3] == '\\') return p + 4; /* a code page is skipped: \S\ means Latin-1 */
    if (end - p >= 2 && p[1] == '\\') {
        *out = ifc_text_put(*out, '\\');
        return p + 2;
    }
    return p;
}

char *ifc_text(struct text_span quoted)
{
    const bool is_text = quoted.n >= 2 && quoted.p[0] == '\'' && quoted.p[quoted.n - 1] == '\'';
    const char *p = quoted.p + 1, *end = is_text ? quoted.p + quoted.n - 1 : p;
    char *text = malloc(2 * quoted.n + 1), *out = text; /* a byte of Latin-1 becomes two */
    while (text != NULL && p < end) {
        const char *next = *p == '\\' ? escape(p, end, &out) : p;
        if (next == p) {
            const int n = utf8_len(p, (size_t)(end - p)); /* some programs write Latin-1 */
            if (n == 0) {
                out = ifc_text_put(out, (unsigned char)*p);
            } else {
                memcpy(out, p, (size_t)n);
                out += n;
            }
            next = p + (n > 0 ? n : 1);
            if (*p == '\'' && next < end && *next == '\'') next++;
        }
        p = next;
    }
    if (text != NULL) *out = '\0';
    return text;
}
