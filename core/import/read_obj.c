/* SPDX-License-Identifier: MIT */
/* Wavefront OBJ in double: v with its colour, f, o, g, usemtl, mtllib. Points and lines are counted; statements that
 * have no part in a shape are ignored. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/grow.h"
#include "core/import/readers.h"
#include "core/scene/build_surfaces.h"
#include "core/text.h"

/* A face that uses vertices, or texture coordinates, which come later in the file. */
struct later {
    const char *p;
    uint64_t line;
    uint32_t n_vertices;
    size_t n_uv;
    uint16_t label;
};

struct obj {
    struct scene_build *b;
    struct text t;
    float (*uv)[2]; /* all vt so far */
    size_t n_uv, cap_uv;
    uint8_t (*rgb)[4]; /* of the vertices so far, where they have colours and these are wanted */
    uint32_t n_rgb;
    size_t cap_rgb;
    double rgb_scale; /* 0: not known yet */
    struct later *later;
    size_t n_later, cap_later;
    const struct later *again; /* the face that is read again now, after all statements; NULL before */
    struct text_span object, material;
    struct mtl_line *library; /* lines that name libraries */
    size_t n_libraries, cap_libraries;
    uint16_t label;
    bool label_known;
    uint64_t n_unknown, unknown_line;
    char unknown[32];
    uint64_t n_calls, call_line;
    struct text_span call; /* the first file that is called */
};

static int fail_at(struct obj *o, struct sh_err *err, const char *what)
{
    struct text_span word = text_word(&o->t);
    o->b->line = o->t.line;
    if (word.n == 0) return build_fail(o->b, SH_EINPUT, err, "%s, found the end of the line", what);
    return build_fail(o->b, SH_EINPUT, err, "%s, found '%.*s'", what, word.n < 40 ? (int)word.n : 40, word.p);
}

/* A comment may also follow on a line of numbers. */
static bool at_statement_end(struct obj *o)
{
    text_skip_blanks(&o->t);
    return text_at_line_end(&o->t) || *o->t.p == '#';
}

/* Reads `least` to `most` numbers up to the statement's end, else fails with `what`. Elements of `number` that the
 * statement lacks keep their values. */
static int read_numbers(struct obj *o, int least, int most, double *number, const char *what, struct sh_err *err)
{
    int n = 0;
    for (; !at_statement_end(o); n++)
        if (n == most || !text_number(&o->t, &number[n])) return fail_at(o, err, what);
    return n >= least ? SH_OK : fail_at(o, err, what);
}

/* Colours are numbers up to 1, or up to 255: all of them together decide which. */
static double find_rgb_scale(const struct obj *o)
{
    struct text t = o->t;
    struct build_rgb_range range = {0};
    for (t.p = t.data; t.p < t.end; text_next_line(&t)) {
        double v[6];
        int n = 0;
        if (!text_is(text_word(&t), "v")) continue;
        for (text_skip_blanks(&t); n < 6 && text_number(&t, &v[n]); text_skip_blanks(&t))
            n++;
        for (int k = 3; k < n && n == 6; k++)
            build_rgb_look(&range, v[k]);
    }
    return build_rgb_scale(&range);
}

static int keep_rgb(struct obj *o, const double rgb[3], struct sh_err *err)
{
    const uint32_t at = o->b->scene->n_vertices - o->b->vertex0 - 1;
    if (o->rgb_scale == 0.0) o->rgb_scale = find_rgb_scale(o);
    if (!grow(&o->rgb, &o->cap_rgb, at + 1, sizeof *o->rgb))
        return build_fail(o->b, SH_ENOMEM, err, "no memory for colours");
    memset(o->rgb[o->n_rgb], 0, (at - o->n_rgb) * sizeof *o->rgb); /* for vertices in between without colours */
    build_rgb(o->b, rgb, o->rgb_scale, o->rgb[at]);
    o->n_rgb = at + 1;
    return SH_OK;
}

/* Reads x y z and up to five further numbers. Where there are three or more of these, the first three are a colour. All
 * others are ignored, also the weight w, which only curves use. */
static int read_vertex(struct obj *o, struct sh_err *err)
{
    double v[8] = {[5] = NAN};
    int rc = read_numbers(o, 3, 8, v, "v must have 3 to 8 numbers", err);
    o->b->line = o->t.line;
    if (rc == SH_OK) rc = build_vertex(o->b, v, err);
    if (rc != SH_OK || !build_wants_colours(o->b) || isnan(v[5])) return rc;
    return keep_rgb(o, &v[3], err);
}

/* vt u [v [w]] */
static int read_uv(struct obj *o, struct sh_err *err)
{
    double number[3] = {0.0, 0.0, 0.0};
    int rc = read_numbers(o, 1, 3, number, "vt must have 1 to 3 numbers", err);
    if (rc != SH_OK) return rc;
    if (!grow(&o->uv, &o->cap_uv, o->n_uv + 1, sizeof *o->uv))
        return build_fail(o->b, SH_ENOMEM, err, "no memory for texture coordinates");
    o->uv[o->n_uv][0] = (float)number[0];
    o->uv[o->n_uv++][1] = (float)number[1];
    return SH_OK;
}

/* A vertex may come later in the file than the face that names it. */
enum { LATER = 1 };

/* Sets the corner's texture coordinates. Index 0: it has none. */
static int set_corner_uv(struct obj *o, int64_t index, float uv[2], struct sh_err *err)
{
    const size_t seen = o->again != NULL ? o->again->n_uv : o->n_uv;
    int64_t number = index < 0 ? (int64_t)seen + index : index - 1;
    if (number >= (int64_t)o->n_uv && o->again == NULL) return LATER;
    if (index != 0 && (number < 0 || number >= (int64_t)o->n_uv)) {
        o->b->line = o->t.line;
        return build_fail(o->b, SH_EINPUT, err, "vt index %lld out of range; there are %zu", (long long)index, o->n_uv);
    }
    for (int k = 0; k < 2; k++)
        uv[k] = index != 0 ? o->uv[number][k] : (float)NAN;
    return SH_OK;
}

/* Reads one v, v/vt, v//vn or v/vt/vn. vn is not used; vt is used where textures are asked for. */
static int read_corner(struct obj *o, uint32_t *corner, float uv[2], uint8_t rgb[4], struct sh_err *err)
{
    struct text at = o->t;
    int64_t index, other, texture = 0;
    bool ok = text_integer(&o->t, &index);
    for (int slash = 0; ok && slash < 2 && *o->t.p == '/'; slash++) {
        o->t.p++;
        if (text_at_word_end(&o->t) || (slash == 0 && *o->t.p == '/')) continue; /* 1// and 1/ name vertices alone */
        ok = text_integer(&o->t, slash == 0 ? &texture : &other);
    }
    if (!ok || !text_at_word_end(&o->t)) {
        o->t = at;
        return fail_at(o, err, "f must have corners of the form v, v/vt, v//vn or v/vt/vn");
    }
    int64_t n = o->b->scene->n_vertices - o->b->vertex0;
    int64_t number = index < 0 ? (o->again != NULL ? o->again->n_vertices : n) + index : index - 1;
    if (index != 0 && number >= n && o->again == NULL) return LATER;
    if (index == 0 || number < 0 || number >= n) {
        o->b->line = o->t.line;
        return build_fail(o->b, SH_EINPUT, err, "index %lld out of range; there are %lld vertices", (long long)index,
                          (long long)n);
    }
    if (number < o->n_rgb)
        memcpy(rgb, o->rgb[number], 4);
    else
        memset(rgb, 0, 4);
    *corner = o->b->vertex0 + (uint32_t)number;
    return uv != NULL ? set_corner_uv(o, texture, uv, err) : SH_OK;
}

static int use_label(struct obj *o, struct sh_err *err)
{
    if (o->again != NULL) o->label = o->again->label;
    if (o->again != NULL || o->label_known) return SH_OK;
    o->label_known = true;
    return build_label(o->b, o->object, o->material, &o->label, err);
}

/* Returns how many words there were. */
static uint64_t skip_statement(struct obj *o)
{
    uint64_t n = 0;
    for (; !at_statement_end(o); n++)
        text_word(&o->t);
    return n;
}

static int keep_for_later(struct obj *o, const struct text *at, struct sh_err *err)
{
    int rc = use_label(o, err);
    if (rc != SH_OK) return rc;
    if (!grow(&o->later, &o->cap_later, o->n_later + 1, sizeof *o->later))
        return build_fail(o->b, SH_ENOMEM, err, "no memory for faces whose vertices come later");
    o->later[o->n_later++] =
        (struct later){at->p, at->line, o->b->scene->n_vertices - o->b->vertex0, o->n_uv, o->label};
    skip_statement(o);
    return SH_OK;
}

static int read_face(struct obj *o, struct sh_err *err)
{
    struct scene_build *b = o->b;
    const struct text at = o->t;
    size_t n = 0;
    while (!at_statement_end(o)) {
        int rc = build_corners(b, n + 1, err);
        if (rc == SH_OK)
            rc = read_corner(o, &b->corner[n], build_wants_textures(b) ? b->corner_uv[n] : NULL, b->corner_rgb[n], err);
        if (rc == LATER) return keep_for_later(o, &at, err);
        if (rc != SH_OK) return rc;
        n++;
    }
    if (n == 0) return fail_at(o, err, "f must have three corners or more");
    b->line = o->t.line;
    if (n < 3) {
        b->counts.not_triangles++;
        return SH_OK;
    }
    b->has_uv = o->n_uv > 0;
    b->has_rgb = o->n_rgb > 0;
    int rc = use_label(o, err);
    return rc == SH_OK ? build_polygon(b, n, o->label, err) : rc;
}

static int read_name(struct obj *o, struct text_span *name)
{
    *name = text_rest(&o->t);
    o->label_known = false;
    return SH_OK;
}

static int read_library(struct obj *o, struct sh_err *err)
{
    if (!grow(&o->library, &o->cap_libraries, o->n_libraries + 1, sizeof *o->library))
        return build_fail(o->b, SH_ENOMEM, err, "no memory for names of libraries");
    o->library[o->n_libraries++] = (struct mtl_line){text_rest(&o->t), o->t.line};
    return SH_OK;
}

/* Points count one by one, a line or a free-form curve or surface as one. */
static int count_left_out(struct obj *o, bool points)
{
    uint64_t n = skip_statement(o);
    o->b->counts.not_triangles += points ? n : 1;
    return SH_OK;
}

/* `call` reads the statements of another file, perhaps with faces. */
static int count_call(struct obj *o)
{
    if (o->n_calls++ > 0) return SH_OK;
    o->call_line = o->t.line;
    o->call = text_word(&o->t);
    return SH_OK;
}

static int read_other(struct obj *o, struct text_span word)
{
    static const char *const numbers[] = {"vt",  "vn",  "vp",  "s",    "parm", "trim",   "hole", "scrv", "sp",
                                          "end", "con", "deg", "bmat", "step", "cstype", "mg",   NULL};
    static const char *const texts[] = {"usemap", "maplib", "lod",        "bevel",     "c_interp", "d_interp",
                                        "ctech",  "stech",  "shadow_obj", "trace_obj", "csh",      NULL};
    static const char *const free_form[] = {"l", "curv", "curv2", "surf", NULL};
    if (text_is_one_of(word, free_form)) return count_left_out(o, false);
    if (text_is(word, "call")) return count_call(o);
    if (text_is_one_of(word, numbers)) {
        skip_statement(o);
    } else if (!text_is_one_of(word, texts)) {
        if (o->n_unknown++ == 0) {
            o->unknown_line = o->t.line;
            memcpy(o->unknown, word.p, word.n < sizeof o->unknown ? word.n : sizeof o->unknown - 1);
        }
    }
    return SH_OK; /* the words of other statements are not read: a backslash at the line's end may belong to a path */
}

static int read_statement(struct obj *o, struct sh_err *err)
{
    struct text_span word = text_word(&o->t);
    if (word.n == 0 || *word.p == '#') return SH_OK;
    if (text_is(word, "v")) return read_vertex(o, err);
    if (text_is(word, "f")) return read_face(o, err);
    if (text_is(word, "o") || text_is(word, "g")) return read_name(o, &o->object);
    if (text_is(word, "p")) return count_left_out(o, true);
    if (text_is(word, "vt") && build_wants_textures(o->b)) return read_uv(o, err);
    if (text_is(word, "usemtl")) return read_name(o, &o->material);
    if (text_is(word, "mtllib")) return read_library(o, err);
    return read_other(o, word);
}

static int read_statements(struct obj *o, struct sh_err *err)
{
    const size_t n = (size_t)(o->t.end - o->t.p);
    if (memchr(o->t.p, '\0', n < 512 ? n : 512) != NULL)
        return build_fail(o->b, SH_EINPUT, err, "not a text in UTF-8 or ASCII");
    int rc = SH_OK;
    for (uint64_t i = 0; o->t.p < o->t.end && rc == SH_OK; i++) {
        if ((i & 0xffff) == 0) rc = build_progress(o->b, (double)(o->t.p - o->t.data) / (double)o->t.size, err);
        if (rc == SH_OK) rc = read_statement(o, err);
        text_next_line(&o->t);
    }
    return rc;
}

/* Reads the faces that were kept for later. All vertices are known now. */
static int read_later(struct obj *o, struct sh_err *err)
{
    int rc = SH_OK;
    for (size_t i = 0; i < o->n_later && rc == SH_OK; i++) {
        o->again = &o->later[i];
        o->t.p = o->again->p;
        o->t.line = o->again->line;
        if ((i & 0xffff) == 0) rc = build_progress(o->b, (double)i / (double)o->n_later, err);
        if (rc == SH_OK) rc = read_face(o, err);
    }
    return rc;
}

int read_obj(struct scene_build *b, struct sh_err *err)
{
    struct obj o = {.b = b, .material = {"", 0}};
    uint32_t first_surface = b->scene->n_surfaces;
    o.object = build_base_name(b);
    int rc = text_open(&o.t, b->spec->file, build_progress, b, err);
    o.t.continued = true;
    if (rc == SH_OK) rc = read_statements(&o, err);
    if (rc == SH_OK) rc = read_later(&o, err);
    if (rc == SH_OK && o.n_unknown > 0)
        build_warn(b, "%llu unknown statements ignored; the first is '%s' in line %llu",
                   (unsigned long long)o.n_unknown, o.unknown, (unsigned long long)o.unknown_line);
    if (rc == SH_OK && o.n_calls > 0)
        build_warn(b, "%llu statements call another file, which is not read; the first is '%.*s' in line %llu",
                   (unsigned long long)o.n_calls, o.call.n < 100 ? (int)o.call.n : 100, o.call.p,
                   (unsigned long long)o.call_line);
    if (rc == SH_OK) rc = read_mtl(b, o.library, o.n_libraries, first_surface, err);
    b->scene->n_meshes++;
    free(o.uv);
    free(o.library);
    free(o.rgb);
    free(o.later);
    text_close(&o.t);
    return rc;
}
