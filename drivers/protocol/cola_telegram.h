/* SPDX-License-Identifier: MIT */
/* CoLa telegrams: numbers and texts of both forms, and the marks around them.
 *
 * CoLa-A:  02  sRA Name value value ...                03
 *              numbers as hexadecimal without 0x, or as decimal with a sign; blanks between
 * CoLa-B:  02 02 02 02  u32 length  sRA Name values    XOR of what the length counts
 *              numbers big-endian, directly after each other; one blank after the name
 *
 * The same calls write and read both, so a telegram is described once. Pure; nothing is allocated. */
#ifndef DRIVERS_PROTOCOL_COLA_TELEGRAM_H
#define DRIVERS_PROTOCOL_COLA_TELEGRAM_H

#include <stddef.h>
#include <stdint.h>

enum cola_form { COLA_A, COLA_B };

/* Errors in an `sFA`, by SICK's numbers (COLA.md has the list and its sources). */
enum cola_error {
    COLA_LATER = -1, /* no error: the answer comes later */
    COLA_OK = 0,
    COLA_METHOD_DENIED = 1,
    COLA_METHOD_UNKNOWN = 2,
    COLA_VARIABLE_UNKNOWN = 3,
    COLA_CONDITION = 4,
    COLA_INVALID_DATA = 5,
    COLA_TOO_LONG = 7,
    COLA_TOO_SHORT = 8,
    COLA_WRITE_DENIED = 10,
    COLA_COMMAND_UNKNOWN = 12,
    COLA_EVENT_UNKNOWN = 15,
    COLA_OVERFLOW = 16,
    COLA_CHARACTER = 17,
};

/* ---- reading the values of a request. The first error stays; after it every value is 0. */
struct cola_args {
    enum cola_form form;
    const uint8_t *at, *end;
    enum cola_error error;
};
/* bytes: 1, 2 or 4, the value's width in CoLa-B and its limit in CoLa-A. */
uint32_t cola_arg_u(struct cola_args *args, unsigned bytes);
int32_t cola_arg_i(struct cola_args *args, unsigned bytes);
float cola_arg_float(struct cola_args *args);
/* Length (CoLa-B: u16) and characters; dst gets them with a NUL. COLA_OVERFLOW where cap is too small,
 * COLA_INVALID_DATA where there is a NUL among them. */
void cola_arg_text(struct cola_args *args, char *dst, size_t cap);
/* The error so far; COLA_TOO_LONG where values are left. */
enum cola_error cola_args_end(const struct cola_args *args);

/* ---- writing a telegram. Values without room are left out, and cola_end says so. */
struct cola_out {
    uint8_t *buf;
    size_t cap, len;
    enum cola_form form;
    int full;
};
/* head: "sRA FirmwareVersion". In CoLa-B a blank follows it, unless it is only a verb ("sFA"). */
void cola_begin(struct cola_out *out, enum cola_form form, const char *head);
void cola_put_u(struct cola_out *out, unsigned bytes, uint32_t v);
void cola_put_i(struct cola_out *out, unsigned bytes, int32_t v);
void cola_put_float(struct cola_out *out, float v);
void cola_put_text(struct cola_out *out, const char *text); /* length and characters */
void cola_put_word(struct cola_out *out, const char *word); /* characters alone */
/* Closes the telegram. Returns its length, or 0: it had no room. */
size_t cola_end(struct cola_out *out);

/* ---- bytes of a client into telegrams, in both forms as they come. */
enum { COLA_MAX_REQUEST = 1024 }; /* bytes between the telegram's marks */
struct cola_input {
    uint8_t buf[COLA_MAX_REQUEST + 9];
    size_t len, used; /* used: by the telegram found last */
};
struct cola_request {
    enum cola_form form;
    const uint8_t *payload;
    size_t len;
};
/* Takes as many of the bytes as there is room for; at least one after cola_input_next() has returned 0. */
size_t cola_input_add(struct cola_input *in, const uint8_t *bytes, size_t len);
/* 1: a telegram, valid until the next call; 0: more bytes are needed; -1: one in CoLa-A was too long, and is gone.
 * Bytes that were thrown away are added to *lost. Bytes outside of telegrams are skipped. Where a check byte is
 * wrong, the search for a telegram goes on at the second byte. */
int cola_input_next(struct cola_input *in, struct cola_request *out, uint64_t *lost);

#endif
