/* SPDX-License-Identifier: MIT */
/* PCD 0.7 of the Point Cloud Library: as text, binary, and binary_compressed. In the last one the bytes are packed by
 * LZF, and one field of all points comes before the next field. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/bytes.h"
#include "core/studio/analysis/cloud_readers.h"
#include "core/text.h"

enum { MAX_FIELDS = 64, MAX_VALUES = 4096 };

struct pcd_field {
    int axis; /* 0 to 2: x, y, z; -1: another one */
    unsigned size, count;
    char type;
    size_t at; /* in a point's record */
};

struct pcd {
    struct text t;
    struct cloud *cloud;
    struct pcd_field field[MAX_FIELDS];
    unsigned n_fields;
    uint64_t n; /* points */
    uint64_t width, height;
    bool has_points;   /* the header's line */
    bool has_more;     /* there is something after the last point */
    size_t record_len; /* bytes of a point, uncompressed */
    char data[24];     /* ascii, binary or binary_compressed */
};

static int pcd_fail(const struct pcd *g, struct sh_err *err, const char *what)
{
    return text_fail(&g->t, 0, SH_EINPUT, err, "%s", what);
}

/* ---- the header */

static void name_field(struct pcd_field *f, struct text_span word)
{
    f->axis = text_is(word, "x") ? 0 : text_is(word, "y") ? 1 : text_is(word, "z") ? 2 : -1;
    f->count = 1;
}

static int read_entry(struct pcd *g, struct text_span key, unsigned i, struct sh_err *err)
{
    struct pcd_field *f = &g->field[i];
    int64_t number = 0;
    if (text_is(key, "FIELDS")) {
        name_field(f, text_word(&g->t));
        g->n_fields = i + 1;
    } else if (text_is(key, "TYPE")) {
        f->type = *text_word(&g->t).p;
    } else if (!text_integer(&g->t, &number) || number < 1 || number > MAX_VALUES) {
        return text_fail(&g->t, g->t.line, SH_EINPUT, err, "a size or count is not a number from 1 to %d", MAX_VALUES);
    } else if (text_is(key, "SIZE")) {
        f->size = (unsigned)number;
    } else {
        f->count = (unsigned)number;
    }
    return SH_OK;
}

static int read_fields(struct pcd *g, struct text_span key, struct sh_err *err)
{
    int rc = SH_OK;
    text_skip_blanks(&g->t);
    for (unsigned i = 0; rc == SH_OK && !text_at_line_end(&g->t); i++) {
        if (i == MAX_FIELDS) return pcd_fail(g, err, "more than 64 fields");
        rc = read_entry(g, key, i, err);
        text_skip_blanks(&g->t);
    }
    return rc;
}

/* Reads one line. *done: it was DATA, the header's last. */
static int read_header_line(struct pcd *g, bool *done, struct sh_err *err)
{
    const struct text_span key = text_word(&g->t);
    int64_t number;
    if (text_is(key, "FIELDS") || text_is(key, "SIZE") || text_is(key, "TYPE") || text_is(key, "COUNT"))
        return read_fields(g, key, err);
    text_skip_blanks(&g->t);
    if (text_is(key, "POINTS") || text_is(key, "WIDTH") || text_is(key, "HEIGHT")) {
        if (!text_integer(&g->t, &number) || number < 0)
            return pcd_fail(g, err, "POINTS, WIDTH or HEIGHT is not a whole number");
        *(text_is(key, "POINTS") ? &g->n : text_is(key, "WIDTH") ? &g->width : &g->height) = (uint64_t)number;
        g->has_points |= text_is(key, "POINTS");
    } else if (text_is(key, "DATA")) {
        const struct text_span word = text_word(&g->t);
        snprintf(g->data, sizeof g->data, "%.*s", (int)word.n, word.p);
        *done = true;
    }
    return SH_OK;
}

/* Old files have no line POINTS, but the sides of their grid. */
static int find_count(struct pcd *g, struct sh_err *err)
{
    if (g->has_points) return SH_OK;
    if (g->width == 0 || g->height == 0)
        return pcd_fail(g, err, "its header has no line POINTS, and no WIDTH and HEIGHT");
    if (g->height > UINT64_MAX / g->width)
        return pcd_fail(g, err, "the file is cut off: it can't hold the points its header counts");
    g->n = g->width * g->height;
    return SH_OK;
}

static int check_fields(struct pcd *g, struct sh_err *err)
{
    unsigned axes = 0;
    for (unsigned i = 0; i < g->n_fields; i++) {
        struct pcd_field *f = &g->field[i];
        if (f->size == 0) return pcd_fail(g, err, "its header has fewer numbers in SIZE than names in FIELDS");
        f->at = g->record_len;
        g->record_len += (size_t)f->size * f->count;
        if (f->axis < 0) continue;
        axes |= 1U << f->axis;
        if (f->type != 'F' || (f->size != 4 && f->size != 8) || f->count != 1)
            return pcd_fail(g, err, "x, y and z are not TYPE F of SIZE 4 or 8 and COUNT 1, the only form allowed");
    }
    if (axes != 7) return pcd_fail(g, err, "it has no fields x, y and z");
    if (g->n > g->t.size && strcmp(g->data, "binary_compressed") != 0) /* a point takes a byte at least */
        return pcd_fail(g, err, "the file is cut off: it can't hold the points its header counts");
    return SH_OK;
}

static int pcd_read_header(struct pcd *g, struct sh_err *err)
{
    bool done = false;
    while (!done && g->t.p < g->t.end) {
        const int rc = read_header_line(g, &done, err);
        if (rc != SH_OK) return rc;
        text_next_line(&g->t);
    }
    const int rc = done ? find_count(g, err) : pcd_fail(g, err, "its header has no line DATA");
    return rc == SH_OK ? check_fields(g, err) : rc;
}

/* ---- points */

static int keep_position(const struct pcd *g, size_t i, struct sh_err *err)
{
    return cloud_check_position(&g->t, 0, g->cloud->xyz_m[i], err);
}

/* Reads points from `len` bytes, where field f of point i stands at start + i * step. */
static int take_binary(struct pcd *g, const uint8_t *data, size_t len, bool by_field, struct sh_err *err)
{
    if (g->n > len / g->record_len)
        return pcd_fail(g, err, "the file is cut off: it can't hold the points its header counts");
    g->has_more = len > g->n * g->record_len;
    for (unsigned k = 0; k < g->n_fields; k++) {
        const struct pcd_field *f = &g->field[k];
        const uint8_t *p = data + (by_field ? f->at * g->n : f->at);
        const size_t step = by_field ? f->size : g->record_len;
        if (f->axis < 0) continue;
        for (size_t i = 0; i < g->n; i++, p += step)
            g->cloud->xyz_m[i][f->axis] = f->size == 4 ? (double)le_get_float(p) : le_get_double(p);
    }
    int rc = SH_OK;
    for (size_t i = 0; i < g->n && rc == SH_OK; i++)
        rc = keep_position(g, i, err);
    return rc;
}

/* Returns whether `in` gives exactly out_len bytes. A control byte below 32 says how many bytes follow as they are;
 * another one has the length and distance of bytes that came before. */
static bool unpack_lzf(const uint8_t *in, size_t in_len, uint8_t *out, size_t out_len)
{
    size_t at = 0, to = 0;
    while (at < in_len) {
        const unsigned control = in[at++];
        size_t n = control < 32 ? control + 1U : control >> 5;
        if (control < 32) {
            if (n > in_len - at || n > out_len - to) return false;
            memcpy(out + to, in + at, n);
            at += n;
            to += n;
            continue;
        }
        if (n == 7 && at < in_len) n += in[at++];
        if (at == in_len) return false;
        const size_t back = ((size_t)(control & 31) << 8) + in[at++] + 1;
        n += 2;
        if (back > to || n > out_len - to) return false;
        for (; n > 0; n--, to++)
            out[to] = out[to - back];
    }
    return to == out_len;
}

static int take_compressed(struct pcd *g, struct sh_err *err)
{
    const uint8_t *in = (const uint8_t *)g->t.p;
    const size_t left = (size_t)(g->t.end - g->t.p);
    if (left < 8 || le_get32(in) > left - 8)
        return pcd_fail(g, err, "the file is cut off within its compressed points");
    const size_t len = le_get32(in + 4);
    if (len / 100 > le_get32(in)) return pcd_fail(g, err, "its compressed points are damaged"); /* LZF reaches 1 : 88 */
    uint8_t *out = malloc(len + 1);
    if (out == NULL) return text_fail(&g->t, 0, SH_ENOMEM, err, "no memory for %zu bytes", len);
    int rc = unpack_lzf(in + 8, le_get32(in), out, len) ? SH_OK : pcd_fail(g, err, "its compressed points are damaged");
    if (rc == SH_OK && g->n > len / g->record_len) rc = pcd_fail(g, err, "it has fewer points than its header counts");
    if (rc == SH_OK) rc = cloud_make_room(g->cloud, (size_t)g->n, 0, err);
    if (rc == SH_OK) rc = take_binary(g, out, len, true, err);
    free(out);
    return rc;
}

static int take_text(struct pcd *g, struct sh_err *err)
{
    int rc = SH_OK;
    for (size_t i = 0; i < g->n && rc == SH_OK; i++, text_next_line(&g->t)) {
        for (unsigned k = 0; k < g->n_fields; k++)
            for (unsigned c = 0; c < g->field[k].count; c++) {
                double v;
                text_skip_blanks(&g->t);
                if (!text_number(&g->t, &v))
                    return text_fail(&g->t, g->t.line, SH_EINPUT, err, "not as many numbers as its header counts");
                if (g->field[k].axis >= 0) g->cloud->xyz_m[i][g->field[k].axis] = v;
            }
        rc = keep_position(g, i, err);
    }
    for (text_skip_blanks(&g->t); g->t.p < g->t.end && text_at_line_end(&g->t); text_skip_blanks(&g->t))
        text_next_line(&g->t);
    g->has_more = g->t.p < g->t.end;
    return rc;
}

static bool pcd_is_single(const struct pcd *g)
{
    for (unsigned k = 0; k < g->n_fields; k++)
        if (g->field[k].axis >= 0 && g->field[k].size == 4) return strcmp(g->data, "ascii") != 0;
    return false;
}

static int take_points(struct pcd *g, struct sh_err *err)
{
    if (strcmp(g->data, "binary_compressed") == 0) return take_compressed(g, err);
    const bool is_text = strcmp(g->data, "ascii") == 0;
    if (!is_text && strcmp(g->data, "binary") != 0)
        return pcd_fail(g, err, "DATA is neither ascii, binary nor binary_compressed");
    const int rc = cloud_make_room(g->cloud, (size_t)g->n, 0, err);
    if (rc != SH_OK) return rc;
    g->cloud->is_text = is_text;
    if (is_text) return take_text(g, err);
    return take_binary(g, (const uint8_t *)g->t.p, (size_t)(g->t.end - g->t.p), false, err);
}

int cloud_read_pcd(const char *path, const struct sh_report *report, struct cloud *out, struct sh_err *err)
{
    struct pcd *g = calloc(1, sizeof *g);
    if (g == NULL) return sh_fail(err, SH_ENOMEM, "no memory to read %s", path);
    g->cloud = out;
    int rc = text_open(&g->t, path, NULL, NULL, err);
    if (rc == SH_OK) rc = pcd_read_header(g, err);
    if (rc == SH_OK) rc = take_points(g, err);
    if (rc == SH_OK) out->n = (size_t)g->n;
    if (rc == SH_OK && pcd_is_single(g)) cloud_note_single(out, path, report);
    if (rc == SH_OK && g->has_more)
        sh_warn(report, "%s: it goes on after the %llu points that its header counts; the rest is left out", path,
                (unsigned long long)g->n);
    text_close(&g->t);
    free(g);
    return rc;
}
