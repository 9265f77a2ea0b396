/* SPDX-License-Identifier: MIT */
/* For injected faults: marks the values of LMDscandata, and corrects the check byte of any CoLa-B telegram (CoLa-A has
 * none). COLA.md draws the telegram. */
#include <string.h>

#include "core/bytes.h"
#include "drivers/protocol/cola.h"

enum { B_HEAD = 8, CHANNEL_NAME = 5 };
static const char SCAN[] = "LMDscandata ";
enum { SCAN_LEN = sizeof SCAN - 1 };

/* ---- CoLa-B: places of the values, by the widths of what stands before them */

enum { AT_NAME = B_HEAD + 4, AT_ENCODERS = 60, ENCODER_LEN = 6, CHANNEL_HEAD = CHANNEL_NAME + 4 + 4 + 4 + 2 };

static size_t get16(const uint8_t *unit, size_t len, size_t at)
{
    return at + 2 <= len ? be_get16(unit + at) : 0;
}

/* Marks the values of the channels of one width. The number of channels stands at `at`, and the channels follow it.
 * Returns where they end. */
static size_t mark_channels(const uint8_t *unit, size_t len, size_t at, size_t width, uint8_t *mask)
{
    size_t n = get16(unit, len, at);
    for (at += 2; n > 0 && at < len; n--) {
        const size_t values = get16(unit, len, at + CHANNEL_HEAD) * width;
        at += CHANNEL_HEAD + 2;
        if (at + values >= len) return len; /* cut off */
        memset(mask + at, 0xff, values);
        at += values;
    }
    return at;
}

static void mark_b(const uint8_t *unit, size_t len, uint8_t *mask)
{
    if (len < AT_ENCODERS || memcmp(unit + AT_NAME, SCAN, SCAN_LEN) != 0) return;
    size_t at = AT_ENCODERS + 2 + ENCODER_LEN * get16(unit, len, AT_ENCODERS);
    at = mark_channels(unit, len, at, 2, mask);
    mark_channels(unit, len, at, 1, mask);
}

/* ---- CoLa-A: words with one blank between them */

enum { WORDS_TO_COUNT = 5 }; /* from a channel's name to the number of its values */

struct word {
    size_t at, len;
};

static int next_word(const uint8_t *unit, size_t len, struct word *word)
{
    const size_t at = word->at + word->len + 1;
    size_t end = at;
    while (end < len && unit[end] > ' ' && unit[end] <= '~')
        end++;
    *word = (struct word){at, end - at};
    return end < len && end > at;
}

static size_t hex_of(const uint8_t *digits, size_t len)
{
    size_t v = 0;
    for (size_t i = 0; i < len && i < 8; i++)
        v = v << 4 | ((digits[i] <= '9' ? digits[i] : digits[i] - 'A' + 10U) & 15U);
    return v;
}

static int is_channel(const uint8_t *text)
{
    return memcmp(text, "DIST", 4) == 0 || memcmp(text, "RSSI", 4) == 0;
}

static void mark_a(const uint8_t *unit, size_t len, uint8_t *mask)
{
    enum { NAME_AT = 5 }; /* after STX, "sSN" or "sRA", and a blank */
    struct word word = {.at = 0};
    if (len < NAME_AT + SCAN_LEN || memcmp(unit + NAME_AT, SCAN, SCAN_LEN) != 0) return;
    while (next_word(unit, len, &word)) {
        if (word.len != CHANNEL_NAME || !is_channel(unit + word.at)) continue;
        for (int i = 0; i < WORDS_TO_COUNT && next_word(unit, len, &word); i++)
            continue;
        size_t n = hex_of(unit + word.at, word.len);
        for (; n > 0 && next_word(unit, len, &word); n--)
            for (size_t i = word.at; i < word.at + word.len; i++)
                mask[i] = protocol_digit_bits(unit[i]);
    }
}

static int is_b(const uint8_t *unit, size_t len)
{
    return len > B_HEAD && memcmp(unit, "\2\2\2\2", 4) == 0;
}

void cola_content(const uint8_t *unit, size_t len, uint8_t *mask)
{
    if (is_b(unit, len))
        mark_b(unit, len, mask);
    else
        mark_a(unit, len, mask);
}

void cola_reseal(uint8_t *unit, size_t len)
{
    if (is_b(unit, len)) unit[len - 1] = protocol_xor(unit + B_HEAD, len - 1 - B_HEAD);
}
