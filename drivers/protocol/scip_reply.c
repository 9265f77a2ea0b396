/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/scip_reply.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

static char sum_char(uint32_t sum)
{
    return (char)((sum & 0x3f) + 0x30);
}

static void scip_reply_put(struct scip_reply *r, const char *text, size_t len)
{
    memcpy(r->bytes + r->len, text, len);
    r->len += len;
}

char scip_sum(const void *text, size_t len)
{
    uint32_t sum = 0;
    for (size_t i = 0; i < len; i++)
        sum += ((const uint8_t *)text)[i];
    return sum_char(sum);
}

void scip_reply_line(struct scip_reply *r, const char *text, size_t len)
{
    const char tail[2] = {scip_sum(text, len), '\n'};
    scip_reply_put(r, text, len);
    scip_reply_put(r, tail, sizeof tail);
}

void scip_reply_begin(struct scip_reply *r, const char *echo, size_t len, const char *status)
{
    r->len = r->block = 0;
    r->sum = 0;
    scip_reply_put(r, echo, len);
    scip_reply_put(r, "\n", 1);
    scip_reply_line(r, status, 2);
}

void scip_reply_key(struct scip_reply *r, const char *key, const char *fmt, ...)
{
    char line[SCIP_MAX_TEXT - 1];
    const int n_key = snprintf(line, sizeof line, "%s:", key);
    va_list args;
    va_start(args, fmt);
    vsnprintf(line + n_key, sizeof line - (size_t)n_key, fmt, args);
    va_end(args);
    const size_t len = strlen(line);
    const char tail[3] = {';', scip_sum(line, len), '\n'};
    scip_reply_put(r, line, len);
    scip_reply_put(r, tail, sizeof tail);
}

enum { MOST_CHARS = 4, TIME_US_CHARS = 11 };

/* most: the size of dst. n_chars is never larger, but without this limit gcc for ARM warns of writes beyond dst. */
static void encode(char *dst, int most, uint64_t value, int n_chars)
{
    for (int i = 0; i < n_chars && i < most; i++)
        dst[i] = (char)((value >> 6 * (n_chars - 1 - i) & 0x3f) + 0x30);
}

void scip_encode4(char dst[4], uint32_t value)
{
    encode(dst, MOST_CHARS, value, MOST_CHARS);
}

void scip_reply_time(struct scip_reply *r, uint32_t ms)
{
    char text[MOST_CHARS];
    encode(text, MOST_CHARS, ms, MOST_CHARS);
    scip_reply_line(r, text, sizeof text);
}

void scip_reply_time_us(struct scip_reply *r, uint64_t us)
{
    char text[TIME_US_CHARS];
    encode(text, TIME_US_CHARS, us, TIME_US_CHARS);
    scip_reply_line(r, text, sizeof text);
}

static void close_block(struct scip_reply *r)
{
    const char tail[2] = {sum_char(r->sum), '\n'};
    if (r->block == 0) return;
    scip_reply_put(r, tail, sizeof tail);
    r->block = 0;
    r->sum = 0;
}

void scip_reply_mark(struct scip_reply *r, char mark)
{
    r->bytes[r->len++] = mark;
    r->sum += (uint8_t)mark;
    if (++r->block == SCIP_BLOCK) close_block(r);
}

void scip_reply_value(struct scip_reply *r, uint32_t value, int n_chars)
{
    const uint32_t most = (1u << 6 * n_chars) - 1;
    char text[MOST_CHARS];
    encode(text, MOST_CHARS, value < most ? value : most, n_chars);
    for (int i = 0; i < n_chars; i++)
        scip_reply_mark(r, text[i]);
}

void scip_reply_end(struct scip_reply *r)
{
    close_block(r);
    scip_reply_put(r, "\n", 1);
}
