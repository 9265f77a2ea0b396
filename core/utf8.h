/* SPDX-License-Identifier: MIT */
/* Characters of UTF-8. In: bytes, which may be any. Nothing is allocated; any thread. */
#ifndef CORE_UTF8_H
#define CORE_UTF8_H

#include <stdbool.h>
#include <stddef.h>

/* Returns the length of the character in UTF-8 that begins at p, within n bytes; 0: none does (Unicode 15, table 3-7).
 * Reading stops at the first byte that does not fit. So with n = 4 the function never reads beyond a NUL. */
static inline int utf8_len(const char *p, size_t n)
{
    const unsigned char c = n > 0 ? (unsigned char)p[0] : 0xff;
    const size_t len = c < 0x80                ? 1
                       : c >= 0xc2 && c < 0xe0 ? 2
                       : c >= 0xe0 && c < 0xf0 ? 3
                       : c >= 0xf0 && c < 0xf5 ? 4
                                               : 0;
    /* The second byte may have narrower limits. Below them are codes with a shorter form, above them surrogates and
     * codes beyond U+10FFFF. */
    const unsigned char low = c == 0xe0 ? 0xa0 : c == 0xf0 ? 0x90 : 0x80;
    const unsigned char high = c == 0xed ? 0x9f : c == 0xf4 ? 0x8f : 0xbf;
    for (size_t i = 1; i < len; i++) {
        const unsigned char next = i < n ? (unsigned char)p[i] : 0;
        if (next < (i == 1 ? low : 0x80) || next > (i == 1 ? high : 0xbf)) return 0;
    }
    return (int)len;
}

static inline bool utf8_is_valid(const char *text)
{
    int n = 1;
    for (; *text != '\0' && n > 0; text += n)
        n = utf8_len(text, 4);
    return n > 0;
}

/* Returns the largest number of bytes, up to n, after which the text can be cut without dividing a character. The text
 * has more than n bytes, with its NUL. Where four bytes in a row there begin no character, it is cut at n. */
static inline size_t utf8_cut(const char *text, size_t n)
{
    for (size_t k = 0; k < 4 && k <= n; k++)
        if (((unsigned char)text[n - k] & 0xc0) != 0x80) return n - k;
    return n;
}

#endif
