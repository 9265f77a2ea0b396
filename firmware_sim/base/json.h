/* SPDX-License-Identifier: MIT */
/* The one JSON writer. In: values and their keys, one call each. Out: RFC 8259 text in a FILE, either one
 * member per line with two blanks per level, or all on one line without blanks.
 *
 * Each value takes the key it gets in an object, or NULL in an array and at the top. The FILE stays the
 * caller's. The C locale is assumed: nothing here calls setlocale. One writer belongs to one thread. The writer
 * allocates nothing. */
#ifndef FIRMWARE_SIM_BASE_JSON_H
#define FIRMWARE_SIM_BASE_JSON_H

#include <stdint.h>
#include <stdio.h>

#include "core/err.h"

enum { JSON_MAX_DEPTH = 16 };

struct json {
    FILE *out;
    int one_line;
    int depth;
    char closer[JSON_MAX_DEPTH];  /* what ends each open level */
    char has_one[JSON_MAX_DEPTH]; /* the level has a member: the next needs a comma */
    int misused; /* a key in an array, none in an object, a second value, a level too deep or closed wrongly */
};

void json_begin(struct json *json, FILE *out);
void json_begin_one_line(struct json *json, FILE *out);
void json_open_object(struct json *json, const char *key);
void json_close_object(struct json *json);
void json_open_array(struct json *json, const char *key);
void json_close_array(struct json *json);
/* Bytes that are not UTF-8 become U+FFFD each; NULL becomes null. */
void json_string(struct json *json, const char *key, const char *value);
void json_int(struct json *json, const char *key, int64_t value);
void json_uint(struct json *json, const char *key, uint64_t value);
/* 15 to 17 digits: the fewest that read back as the same double. NaN and the infinities, which JSON lacks,
 * become null. */
void json_double(struct json *json, const char *key, double value);
void json_bool(struct json *json, const char *key, int value);
/* Ends the text with a newline. SH_ESTATE: the calls did not make one whole value; SH_EIO: writing failed, with the
 * system's reason alone as text, since the caller knows the file. */
int json_end(struct json *json, struct sh_err *err);

#endif
