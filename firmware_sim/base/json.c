/* SPDX-License-Identifier: MIT */
#include "firmware_sim/base/json.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/utf8.h"

void json_begin(struct json *json, FILE *out)
{
    memset(json, 0, sizeof *json);
    json->out = out;
}

void json_begin_one_line(struct json *json, FILE *out)
{
    json_begin(json, out);
    json->one_line = 1;
}

static void put_string(FILE *out, const char *text)
{
    fputc('"', out);
    for (const char *p = text; *p != '\0';) {
        const int len = utf8_len(p, 4);
        if (len == 0)
            fputs("\\ufffd", out);
        else if (*p == '"' || *p == '\\')
            fprintf(out, "\\%c", *p);
        else if ((unsigned char)*p < 0x20)
            fprintf(out, "\\u%04x", (unsigned)*p);
        else
            fwrite(p, 1, (size_t)len, out);
        p += len == 0 ? 1 : len;
    }
    fputc('"', out);
}

static void new_line(struct json *json, int levels)
{
    if (!json->one_line) fprintf(json->out, "\n%*s", 2 * levels, "");
}

/* Writes the comma, the line's indent and the key before a value. */
static void put_key(struct json *json, const char *key)
{
    const int in_object = json->depth > 0 && json->closer[json->depth - 1] == '}';
    if (in_object != (key != NULL)) json->misused = 1;
    if (json->depth > 0) {
        if (json->has_one[json->depth - 1]) fputc(',', json->out);
        json->has_one[json->depth - 1] = 1;
        new_line(json, json->depth);
    } else if (json->closer[0] != '\0') {
        json->misused = 1; /* a second value at the top */
    } else {
        json->closer[0] = '.';
    }
    if (key != NULL) {
        put_string(json->out, key);
        fputs(json->one_line ? ":" : ": ", json->out);
    }
}

static void open_level(struct json *json, const char *key, char opener, char closer)
{
    put_key(json, key);
    if (json->depth == JSON_MAX_DEPTH) {
        json->misused = 1;
        return;
    }
    fputc(opener, json->out);
    json->closer[json->depth] = closer;
    json->has_one[json->depth] = 0;
    json->depth++;
}

static void close_level(struct json *json, char closer)
{
    if (json->depth == 0 || json->closer[json->depth - 1] != closer) {
        json->misused = 1;
        return;
    }
    json->depth--;
    if (json->has_one[json->depth]) new_line(json, json->depth);
    fputc(closer, json->out);
}

void json_open_object(struct json *json, const char *key)
{
    open_level(json, key, '{', '}');
}

void json_close_object(struct json *json)
{
    close_level(json, '}');
}

void json_open_array(struct json *json, const char *key)
{
    open_level(json, key, '[', ']');
}

void json_close_array(struct json *json)
{
    close_level(json, ']');
}

void json_string(struct json *json, const char *key, const char *value)
{
    put_key(json, key);
    if (value == NULL)
        fputs("null", json->out);
    else
        put_string(json->out, value);
}

void json_int(struct json *json, const char *key, int64_t value)
{
    put_key(json, key);
    fprintf(json->out, "%" PRId64, value);
}

void json_uint(struct json *json, const char *key, uint64_t value)
{
    put_key(json, key);
    fprintf(json->out, "%" PRIu64, value);
}

void json_double(struct json *json, const char *key, double value)
{
    char text[32] = "null";
    put_key(json, key);
    /* 15 digits keep any decimal that a person wrote (DBL_DIG), 17 any double. */
    for (int digits = 15; isfinite(value) && digits <= 17; digits++) {
        snprintf(text, sizeof text, "%.*g", digits, value);
        if (strtod(text, NULL) == value) break;
    }
    fputs(text, json->out);
}

void json_bool(struct json *json, const char *key, int value)
{
    put_key(json, key);
    fputs(value ? "true" : "false", json->out);
}

int json_end(struct json *json, struct sh_err *err)
{
    fputc('\n', json->out);
    if (json->depth != 0 || json->closer[0] == '\0' || json->misused)
        return sh_fail(err, SH_ESTATE, "json: keys, objects and arrays do not nest");
    errno = 0; /* only a failure of fflush sets errno again; the reason of an earlier failure is not known */
    if (fflush(json->out) != 0 || ferror(json->out))
        return sh_fail(err, SH_EIO, "%s", errno != 0 ? strerror(errno) : "writing failed");
    return SH_OK;
}
