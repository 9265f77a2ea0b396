/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/cola_telegram.h"

#include <string.h>

#include "core/bytes.h"
#include "drivers/protocol/protocol.h"

enum { STX = 2, ETX = 3, B_HEAD = 8, B_MARKS = 4 };

/* ---- reading */

static uint32_t cola_telegram_fail(struct cola_args *args, enum cola_error error)
{
    if (args->error == COLA_OK) args->error = error;
    return 0;
}

static uint32_t most(unsigned bytes)
{
    return bytes >= 4 ? UINT32_MAX : (1u << 8 * bytes) - 1;
}

static int digit(uint8_t c)
{
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    return 16;
}

/* The number at args->at: *sign is '+', '-', or 0 for hexadecimal. */
static uint32_t read_number(struct cola_args *args, uint8_t *sign)
{
    uint64_t v = 0;
    while (args->at < args->end && *args->at == ' ')
        args->at++;
    *sign = 0;
    if (args->at < args->end && (*args->at == '+' || *args->at == '-')) *sign = *args->at++;
    const int base = *sign != 0 ? 10 : 16;
    if (args->at == args->end || *args->at == ' ') return cola_telegram_fail(args, COLA_TOO_SHORT);
    for (; args->at < args->end && *args->at != ' '; args->at++) {
        const int d = digit(*args->at);
        if (d >= base) return cola_telegram_fail(args, COLA_CHARACTER);
        v = v * (uint64_t)base + (uint64_t)d;
        if (v > UINT32_MAX) return cola_telegram_fail(args, COLA_OVERFLOW);
    }
    return (uint32_t)v;
}

static uint32_t read_bytes(struct cola_args *args, unsigned bytes)
{
    uint32_t v = 0;
    if ((size_t)(args->end - args->at) < bytes) return cola_telegram_fail(args, COLA_TOO_SHORT);
    for (unsigned i = 0; i < bytes; i++)
        v = v << 8 | *args->at++;
    return v;
}

uint32_t cola_arg_u(struct cola_args *args, unsigned bytes)
{
    uint8_t sign;
    if (args->error != COLA_OK) return 0;
    if (args->form == COLA_B) return read_bytes(args, bytes);
    const uint32_t v = read_number(args, &sign);
    if (v > most(bytes) || (sign == '-' && v != 0)) return cola_telegram_fail(args, COLA_OVERFLOW);
    return v;
}

/* The value of v as two's complement of 1, 2 or 4 bytes. */
static int32_t extend(uint32_t v, unsigned bytes)
{
    const uint32_t half = most(bytes) / 2 + 1;
    return (int32_t)((int64_t)v - (v >= half ? 2 * (int64_t)half : 0));
}

int32_t cola_arg_i(struct cola_args *args, unsigned bytes)
{
    uint8_t sign;
    if (args->error != COLA_OK) return 0;
    if (args->form == COLA_B) return extend(read_bytes(args, bytes), bytes);
    const uint32_t v = read_number(args, &sign), half = most(bytes) / 2 + 1;
    if (v > (sign == '+' ? half - 1 : sign == '-' ? half : most(bytes)))
        return (int32_t)cola_telegram_fail(args, COLA_OVERFLOW);
    return sign == '-' ? (int32_t)(0 - (int64_t)v) : extend(v, bytes);
}

float cola_arg_float(struct cola_args *args)
{
    return bits_float(cola_arg_u(args, 4));
}

void cola_arg_text(struct cola_args *args, char *dst, size_t cap)
{
    const size_t len = cola_arg_u(args, 2);
    dst[0] = 0;
    if (args->error != COLA_OK) return;
    if (args->form == COLA_A && len != 0 && args->at < args->end) args->at++; /* the blank after the length */
    args->error = (size_t)(args->end - args->at) < len ? COLA_TOO_SHORT
                  : len >= cap                         ? COLA_OVERFLOW
                  : memchr(args->at, 0, len) != NULL   ? COLA_INVALID_DATA
                                                       : COLA_OK;
    if (args->error != COLA_OK) return;
    memcpy(dst, args->at, len);
    dst[len] = 0;
    args->at += len;
}

enum cola_error cola_args_end(const struct cola_args *args)
{
    const uint8_t *at = args->at;
    if (args->error != COLA_OK) return args->error;
    while (args->form == COLA_A && at < args->end && *at == ' ')
        at++;
    return at < args->end ? COLA_TOO_LONG : COLA_OK;
}

/* ---- writing */

static void cola_telegram_put(struct cola_out *out, const void *bytes, size_t len)
{
    if (out->cap - out->len < len) {
        out->full = 1;
        return;
    }
    memcpy(out->buf + out->len, bytes, len);
    out->len += len;
}

void cola_begin(struct cola_out *out, enum cola_form form, const char *head)
{
    static const uint8_t marks[B_HEAD] = {STX, STX, STX, STX};
    out->form = form;
    out->len = 0;
    out->full = 0;
    cola_telegram_put(out, marks, form == COLA_B ? B_HEAD : 1);
    cola_telegram_put(out, head, strlen(head));
    if (form == COLA_B && strchr(head, ' ') != NULL) cola_telegram_put(out, " ", 1);
}

static void put_hex(struct cola_out *out, uint32_t v, unsigned least)
{
    char text[10];
    size_t at = sizeof text;
    for (unsigned n = 0; v != 0 || n < least; v >>= 4, n++)
        text[--at] = "0123456789ABCDEF"[v & 15u];
    text[--at] = ' ';
    cola_telegram_put(out, text + at, sizeof text - at);
}

void cola_put_u(struct cola_out *out, unsigned bytes, uint32_t v)
{
    if (out->form == COLA_A) {
        put_hex(out, v & most(bytes), 1);
        return;
    }
    uint8_t wire[4];
    be_put32(wire, v);
    cola_telegram_put(out, wire + 4 - bytes, bytes);
}

void cola_put_i(struct cola_out *out, unsigned bytes, int32_t v)
{
    cola_put_u(out, bytes, (uint32_t)v);
}

void cola_put_float(struct cola_out *out, float v)
{
    if (out->form == COLA_A)
        put_hex(out, float_bits(v), 8);
    else
        cola_put_u(out, 4, float_bits(v));
}

void cola_put_word(struct cola_out *out, const char *word)
{
    if (out->form == COLA_A) cola_telegram_put(out, " ", 1);
    cola_telegram_put(out, word, strlen(word));
}

void cola_put_text(struct cola_out *out, const char *text)
{
    cola_put_u(out, 2, (uint32_t)strlen(text));
    if (text[0] != 0) cola_put_word(out, text);
}

size_t cola_end(struct cola_out *out)
{
    uint8_t check = ETX;
    if (out->form == COLA_B) {
        be_put32(out->buf + B_MARKS, (uint32_t)(out->len - B_HEAD));
        check = protocol_xor(out->buf + B_HEAD, out->len - B_HEAD);
    }
    cola_telegram_put(out, &check, 1);
    return out->full ? 0 : out->len;
}

/* ---- bytes into telegrams */

size_t cola_input_add(struct cola_input *in, const uint8_t *bytes, size_t len)
{
    const size_t room = sizeof in->buf - in->len, n = len < room ? len : room;
    memcpy(in->buf + in->len, bytes, n);
    in->len += n;
    return n;
}

static void drop(struct cola_input *in, size_t n)
{
    in->len -= n;
    memmove(in->buf, in->buf + n, in->len);
}

static size_t count_marks(const struct cola_input *in)
{
    size_t n = 0;
    while (n < in->len && n < B_MARKS && in->buf[n] == STX)
        n++;
    return n;
}

enum found { FOUND, NEED_MORE, NOT_HERE, OVERLONG };

static enum found find_b(struct cola_input *in, struct cola_request *out)
{
    if (in->len < B_HEAD) return NEED_MORE;
    const uint32_t len = be_get32(in->buf + B_MARKS);
    if (len == 0 || len > COLA_MAX_REQUEST) return NOT_HERE;
    if (in->len < B_HEAD + len + 1) return NEED_MORE;
    if (protocol_xor(in->buf + B_HEAD, len + 1) != 0) return NOT_HERE; /* the check byte is among them */
    *out = (struct cola_request){COLA_B, in->buf + B_HEAD, len};
    in->used = B_HEAD + len + 1;
    return FOUND;
}

/* *skip: bytes to drop where no telegram is. */
static enum found find_a(struct cola_input *in, struct cola_request *out, size_t *skip)
{
    size_t i = 1;
    while (i < in->len && in->buf[i] >= ' ' && in->buf[i] <= '~')
        i++;
    *skip = i;
    if (i > COLA_MAX_REQUEST + 1) return OVERLONG;
    if (i == in->len) return NEED_MORE;
    if (in->buf[i] != ETX) return NOT_HERE;
    *out = (struct cola_request){COLA_A, in->buf + 1, i - 1};
    in->used = i + 1;
    return FOUND;
}

int cola_input_next(struct cola_input *in, struct cola_request *out, uint64_t *lost)
{
    drop(in, in->used);
    in->used = 0;
    for (;;) {
        const uint8_t *stx = memchr(in->buf, STX, in->len);
        size_t skip = stx == NULL ? in->len : (size_t)(stx - in->buf);
        *lost += skip;
        drop(in, skip);
        const size_t marks = count_marks(in);
        if (marks == in->len && marks < B_MARKS) return 0;
        enum found found;
        if (marks == B_MARKS) {
            found = find_b(in, out);
            skip = 1;
        } else {
            drop(in, marks - 1);
            *lost += marks - 1;
            found = find_a(in, out, &skip);
        }
        if (found == FOUND) return 1;
        if (found == NEED_MORE) return 0;
        *lost += skip;
        drop(in, skip);
        if (found == OVERLONG) return -1;
    }
}
