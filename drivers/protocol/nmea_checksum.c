/* SPDX-License-Identifier: MIT */
/* For injected faults in sentences: marks the bits of decimals, which a fault may flip, and corrects checksums. */
#include <string.h>

#include "drivers/protocol/protocol.h"

enum { TAIL_LEN = 3 }; /* "*hh" */

/* Finds the next sentence from *at on: *at is its "$", *star its "*", which two bytes follow. 0: there is none. */
static int next_sentence(const uint8_t *bytes, size_t len, size_t *at, size_t *star)
{
    while (*at < len) {
        const uint8_t *begin = memchr(bytes + *at, '$', len - *at);
        if (begin == NULL) return 0;
        *at = (size_t)(begin - bytes);
        *star = *at + 1;
        while (*star < len && bytes[*star] >= ' ' && bytes[*star] <= '~' && bytes[*star] != '*' && bytes[*star] != '$')
            ++*star;
        if (*star + TAIL_LEN <= len && bytes[*star] == '*') return 1;
        *at = *star;
    }
    return 0;
}

void nmea_content(const uint8_t *bytes, size_t len, uint8_t *mask)
{
    for (size_t at = 0, star; next_sentence(bytes, len, &at, &star); at = star) {
        int is_decimal = 0;
        for (size_t i = at; i < star; i++) {
            is_decimal = bytes[i] == '.' || (is_decimal && bytes[i] >= '0' && bytes[i] <= '9');
            if (is_decimal) mask[i] = protocol_digit_bits(bytes[i]);
        }
    }
}

void nmea_reseal(uint8_t *bytes, size_t len)
{
    static const char hex[] = "0123456789ABCDEF";
    for (size_t at = 0, star; next_sentence(bytes, len, &at, &star); at = star) {
        const uint8_t sum = protocol_xor(bytes + at + 1, star - at - 1);
        bytes[star + 1] = (uint8_t)hex[sum >> 4];
        bytes[star + 2] = (uint8_t)hex[sum & 15];
    }
}
