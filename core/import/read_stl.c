/* SPDX-License-Identifier: MIT */
/* STL, text and binary, in double. A binary file is recognised by its size, 84 bytes and 50 for each triangle, since
 * many begin with "solid", too. Normals are ignored: the order of the corners says which side is outside. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/bytes.h"
#include "core/import/readers.h"
#include "core/scene/build_surfaces.h"
#include "core/scene/weld.h"
#include "core/text.h"

enum { HEAD = 84, FACET = 50, COUNT_AT = 80 };

struct stl {
    struct scene_build *b;
    struct text t;
    struct build_weld weld; /* each triangle has corners of its own */
    uint16_t label;
    double largest;
};

/* Takes a vertex as corner `at` of the next triangle. */
static int take_vertex(struct stl *s, size_t at, const double v[3], struct sh_err *err)
{
    int rc = build_corners(s->b, at + 1, err);
    const double p[3] = {v[0] + 0.0, v[1] + 0.0, v[2] + 0.0}; /* -0 is the same place as 0 */
    if (rc == SH_OK) rc = build_weld_vertex(s->b, &s->weld, p, err);
    if (rc != SH_OK) return rc;
    s->b->corner[at] = s->weld.number[0];
    s->weld.n = 0; /* earlier numbers are not needed again */
    for (int k = 0; k < 3; k++)
        s->largest = fmax(s->largest, fabs(v[k]));
    return SH_OK;
}

static int begin_solid(struct stl *s, struct text_span name, struct sh_err *err)
{
    s->b->scene->n_meshes++;
    return build_label(s->b, name.n > 0 ? name : build_base_name(s->b), (struct text_span){"", 0}, &s->label, err);
}

/* ---- binary */

static uint64_t binary_size(const struct text *t)
{
    return t->size >= HEAD ? HEAD + FACET * (uint64_t)le_get32(t->data + COUNT_AT) : UINT64_MAX;
}

static int read_facet(struct stl *s, const char *p, struct sh_err *err)
{
    int rc = SH_OK;
    for (size_t c = 0; c < 3 && rc == SH_OK; c++) {
        const char *at = p + 12 * (c + 1); /* after the normal */
        const double v[3] = {(double)le_get_float(at), (double)le_get_float(at + 4), (double)le_get_float(at + 8)};
        rc = take_vertex(s, c, v, err);
    }
    return rc == SH_OK ? build_polygon(s->b, 3, s->label, err) : rc;
}

/* Corners are floats, which were rounded when the file was written. They are taken as they are. */
static int read_binary(struct stl *s, struct sh_err *err)
{
    const uint32_t n = le_get32(s->t.data + COUNT_AT);
    const uint64_t size = binary_size(&s->t); /* taken before text_drop_read frees the count */
    int rc = begin_solid(s, (struct text_span){"", 0}, err);
    if (rc == SH_OK) rc = build_weld_begin(s->b, &s->weld, 3 * (uint64_t)n + 1, err);
    if (rc == SH_OK) rc = build_reserve(s->b, 0, n, err);
    for (uint32_t i = 0; i < n && rc == SH_OK; i++) {
        s->t.p = s->t.data + HEAD + FACET * (size_t)i;
        if ((i & 0xffff) == 0) rc = build_progress(s->b, (double)i / n, err);
        if ((i & 0xffff) == 0) text_drop_read(&s->t);
        if (rc == SH_OK) rc = read_facet(s, s->t.p, err);
    }
    if (rc == SH_OK) rc = build_single(s->b, s->largest, s->largest * BUILD_SINGLE_ROUNDING, false, err);
    if (rc == SH_OK && s->t.size > size)
        build_warn(s->b, "%llu bytes after the last of its %u triangles ignored",
                   (unsigned long long)(s->t.size - size), n);
    return rc;
}

/* ---- text */

static int fail_at(struct stl *s, struct text_span word, const char *expected, struct sh_err *err)
{
    s->b->line = s->t.line;
    if (word.n == 0 && s->t.p >= s->t.end)
        return build_fail(s->b, SH_EINPUT, err, "cut off: the file ends where %s is expected", expected);
    return build_fail(s->b, SH_EINPUT, err, "'%.*s' is found where %s is expected", (int)(word.n < 40 ? word.n : 40),
                      word.p, expected);
}

/* Words may stand in any lines. */
static struct text_span next_word(struct text *t)
{
    struct text_span word = text_word(t);
    while (word.n == 0 && t->p < t->end) {
        text_next_line(t);
        word = text_word(t);
    }
    return word;
}

static int expect(struct stl *s, const char *name, struct sh_err *err)
{
    const struct text_span word = next_word(&s->t);
    return text_is_word(word, name) ? SH_OK : fail_at(s, word, name, err);
}

static int read_vertex(struct stl *s, size_t at, struct sh_err *err)
{
    double v[3];
    for (int k = 0; k < 3; k++) {
        text_skip_blanks(&s->t);
        if (!text_number(&s->t, &v[k])) return fail_at(s, text_word(&s->t), "a number of a vertex", err);
    }
    s->b->line = s->t.line;
    return take_vertex(s, at, v, err);
}

/* Reads a facet after its first word. */
static int read_text_facet(struct stl *s, struct sh_err *err)
{
    size_t n = 0;
    struct text_span word = text_word(&s->t);
    while (word.n > 0 && !text_is_word(word, "outer")) /* the normal; "outer loop" may stand on the same line */
        word = text_word(&s->t);
    int rc = word.n > 0 ? SH_OK : expect(s, "outer", err);
    if (rc == SH_OK) rc = expect(s, "loop", err);
    while (rc == SH_OK && text_is_word(word = next_word(&s->t), "vertex"))
        rc = read_vertex(s, n++, err);
    if (rc == SH_OK && !text_is_word(word, "endloop")) rc = fail_at(s, word, n < 3 ? "vertex" : "endloop", err);
    if (rc == SH_OK) rc = expect(s, "endfacet", err);
    if (rc != SH_OK) return rc;
    s->b->counts.not_triangles += n < 3;
    return n < 3 ? SH_OK : build_polygon(s->b, n, s->label, err);
}

/* Reads a solid after its first word. */
static int read_solid(struct stl *s, struct sh_err *err)
{
    struct text_span word = {"", 0};
    int rc = begin_solid(s, text_rest(&s->t), err);
    for (uint64_t i = 0; rc == SH_OK && text_is_word(word = next_word(&s->t), "facet"); i++) {
        if ((i & 0xffff) == 0) rc = build_progress(s->b, (double)(s->t.p - s->t.data) / (double)s->t.size, err);
        if ((i & 0xffff) == 0) text_drop_read(&s->t);
        if (rc == SH_OK) rc = read_text_facet(s, err);
    }
    if (rc != SH_OK) return rc;
    if (!text_is_word(word, "endsolid")) return fail_at(s, word, "facet or endsolid", err);
    text_next_line(&s->t); /* its name again */
    return SH_OK;
}

static int read_text(struct stl *s, struct sh_err *err)
{
    struct text_span word;
    int rc = build_weld_begin(s->b, &s->weld, s->t.size / 64 + 1, err);
    while (rc == SH_OK && (word = next_word(&s->t)).n > 0)
        rc = text_is_word(word, "solid") ? read_solid(s, err) : fail_at(s, word, "solid", err);
    return rc;
}

/* Whether the first word is "solid", and no byte near the beginning is 0. */
static bool is_text(const struct stl *s)
{
    struct text t = s->t;
    return text_is_word(next_word(&t), "solid") &&
           memchr(s->t.data, '\0', s->t.size < 2 * HEAD ? s->t.size : 2 * HEAD) == NULL;
}

static int read_either(struct stl *s, struct sh_err *err)
{
    const uint64_t size = binary_size(&s->t);
    if (size != s->t.size && is_text(s)) return read_text(s, err);
    if (size <= s->t.size) return read_binary(s, err);
    if (size == UINT64_MAX)
        return build_fail(s->b, SH_EINPUT, err, "neither a text that begins with 'solid' nor a binary STL");
    return build_fail(
        s->b, SH_EINPUT, err,
        "cut off: a binary STL of %u triangles has %llu bytes, but the file has %zu; it isn't a text either",
        le_get32(s->t.data + COUNT_AT), (unsigned long long)size, s->t.size);
}

int read_stl(struct scene_build *b, struct sh_err *err)
{
    struct stl *s = calloc(1, sizeof *s);
    if (s == NULL) return build_fail(b, SH_ENOMEM, err, "no memory");
    s->b = b;
    int rc = text_open(&s->t, b->spec->file, build_progress, b, err);
    if (rc == SH_OK) rc = read_either(s, err);
    text_close(&s->t);
    build_weld_free(&s->weld);
    free(s);
    return rc;
}
