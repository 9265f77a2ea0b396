/* SPDX-License-Identifier: MIT */
#include "core/ply.h"

#include <string.h>

static int ply_read_header_fail(const struct text *t, struct sh_err *err, const char *what, struct text_span word)
{
    return text_fail(t, t->line, SH_EINPUT, err, "%s '%.*s'", what, word.n < 40 ? (int)word.n : 40, word.p);
}

static int read_format(struct ply_header *h, struct text *t, struct sh_err *err)
{
    static const char *const names[] = {"ascii", "binary_little_endian", "binary_big_endian"};
    struct text_span word = text_word(t), version = text_word(t);
    if (!text_is(version, "1.0")) return ply_read_header_fail(t, err, "the format version must be 1.0, not", version);
    for (unsigned i = 0; i < 3; i++) {
        if (!text_is(word, names[i])) continue;
        h->format = (enum ply_format)i;
        return SH_OK;
    }
    return ply_read_header_fail(t, err, "the format must be ascii, binary_little_endian or binary_big_endian, not",
                                word);
}

static int read_element(struct ply_header *h, struct text *t, struct sh_err *err)
{
    struct text_span name = text_word(t);
    int64_t count;
    text_skip_blanks(t);
    bool ok = text_integer(t, &count) && count >= 0;
    text_skip_blanks(t);
    if (name.n == 0 || !ok || !text_at_line_end(t))
        return ply_read_header_fail(t, err, "an element must have a name and a count; this one is", name);
    if (h->n_elements == PLY_MAX_ELEMENTS)
        return text_fail(t, t->line, SH_EINPUT, err, "more than %d elements", PLY_MAX_ELEMENTS);
    struct ply_element *e = &h->element[h->n_elements++];
    *e = (struct ply_element){.count = (uint64_t)count, .first = h->n_properties};
    memcpy(e->name, name.p, name.n < sizeof e->name ? name.n : sizeof e->name - 1);
    e->kind = text_is(name, "vertex")      ? PLY_VERTEX
              : text_is(name, "face")      ? PLY_FACE
              : text_is(name, "tristrips") ? PLY_STRIPS
                                           : PLY_OTHER;
    return SH_OK;
}

static int read_type(struct text *t, enum number_type *type, struct text_span word, struct sh_err *err)
{
    static const char *const names[] = {"char", "uchar", "short", "ushort", "int",   "uint",   "float",   "double",
                                        "int8", "uint8", "int16", "uint16", "int32", "uint32", "float32", "float64"};
    for (unsigned i = 0; i < 16; i++) {
        if (!text_is(word, names[i])) continue;
        *type = (enum number_type)(i % 8);
        return SH_OK;
    }
    return ply_read_header_fail(t, err, "unknown property type", word);
}

const char *const ply_scalar_name[PLY_SCALARS] = {[PLY_X] = "x",
                                                  [PLY_Y] = "y",
                                                  [PLY_Z] = "z",
                                                  [PLY_STATION] = "station",
                                                  [PLY_ECHO] = "echo",
                                                  [PLY_LABEL] = "label",
                                                  [PLY_TIME] = "time",
                                                  [PLY_RANGE] = "range",
                                                  [PLY_REFLECTANCE] = "reflectance",
                                                  [PLY_ECHO_COUNT] = "echo_count",
                                                  [PLY_AMPLITUDE] = "amplitude",
                                                  [PLY_RED] = "red",
                                                  [PLY_GREEN] = "green",
                                                  [PLY_BLUE] = "blue",
                                                  [PLY_U] = "s",
                                                  [PLY_V] = "t",
                                                  [PLY_TEXNUMBER] = "texnumber"};

/* Other names for the same uses. */
static const struct {
    const char *name;
    enum ply_use use;
} synonyms[] = {{"diffuse_red", PLY_RED},
                {"diffuse_green", PLY_GREEN},
                {"diffuse_blue", PLY_BLUE},
                {"texture_u", PLY_U},
                {"texture_v", PLY_V},
                {"u", PLY_U},
                {"v", PLY_V}};

static enum ply_use scalar_of(struct text_span name)
{
    for (unsigned i = PLY_X; i < PLY_SCALARS; i++)
        if (text_is(name, ply_scalar_name[i])) return (enum ply_use)i;
    for (size_t i = 0; i < sizeof synonyms / sizeof synonyms[0]; i++)
        if (text_is(name, synonyms[i].name)) return synonyms[i].use;
    return PLY_SKIP;
}

static enum ply_use face_use_of(const struct ply_property *p, struct text_span name)
{
    if (p->is_list)
        return text_is(name, "vertex_indices") || text_is(name, "vertex_index") ? PLY_CORNERS
               : text_is(name, "texcoord")                                      ? PLY_TEXCOORDS
                                                                                : PLY_SKIP;
    const enum ply_use use = scalar_of(name);
    return use == PLY_TEXNUMBER || (use >= PLY_RED && use <= PLY_BLUE) ? use : PLY_SKIP;
}

static enum ply_use use_of(const struct ply_element *e, const struct ply_property *p, struct text_span name)
{
    if (e->kind == PLY_FACE || e->kind == PLY_STRIPS) return face_use_of(p, name);
    if (e->kind != PLY_VERTEX || p->is_list) return PLY_SKIP;
    static const char prefix[] = "scalar_"; /* CloudCompare's */
    const size_t n = sizeof prefix - 1;
    if (name.n > n && memcmp(name.p, prefix, n) == 0) name = (struct text_span){name.p + n, name.n - n};
    return scalar_of(name);
}

/* comment TextureFile NAME */
static int read_comment(struct ply_header *h, struct text *t, struct sh_err *err)
{
    if (!text_is(text_word(t), "TextureFile")) return SH_OK;
    const struct text_span name = text_rest(t);
    if (name.n == 0) return SH_OK;
    if (h->n_textures == PLY_MAX_TEXTURES)
        return text_fail(t, t->line, SH_EINPUT, err, "more than %d textures", PLY_MAX_TEXTURES);
    h->texture[h->n_textures] = name;
    h->texture_line[h->n_textures++] = t->line;
    return SH_OK;
}

static int read_property(struct ply_header *h, struct text *t, struct sh_err *err)
{
    struct text_span word = text_word(t);
    if (h->n_elements == 0) return text_fail(t, t->line, SH_EINPUT, err, "property before any element");
    if (h->n_properties == PLY_MAX_PROPERTIES)
        return text_fail(t, t->line, SH_EINPUT, err, "more than %d properties", PLY_MAX_PROPERTIES);
    struct ply_element *e = &h->element[h->n_elements - 1];
    struct ply_property *p = &h->property[h->n_properties++];
    *p = (struct ply_property){.is_list = text_is(word, "list")};
    e->n_properties++;
    int rc = SH_OK;
    if (p->is_list) {
        word = text_word(t);
        rc = read_type(t, &p->count_type, word, err);
        if (rc == SH_OK && (p->count_type == NUMBER_FLOAT || p->count_type == NUMBER_DOUBLE))
            return ply_read_header_fail(t, err, "a list's count can't be of type", word);
        word = text_word(t);
    }
    if (rc == SH_OK) rc = read_type(t, &p->type, word, err);
    if (rc != SH_OK) return rc;
    word = text_word(t);
    if (word.n == 0) return text_fail(t, t->line, SH_EINPUT, err, "a property has no name");
    p->use = use_of(e, p, word);
    for (int i = e->first; i < h->n_properties - 1; i++) {
        if (p->use == PLY_SKIP || h->property[i].use != p->use) continue;
        if (p->use < PLY_TIME || p->use >= PLY_SCALARS)
            return ply_read_header_fail(t, err, "a property is given twice:", word);
        p->use = PLY_SKIP; /* where there are two times, ranges, colours and the like, the first one counts */
    }
    return SH_OK;
}

const struct ply_property *ply_find(const struct ply_header *h, const struct ply_element *e, enum ply_use use)
{
    for (int i = e->first; i < e->first + e->n_properties; i++)
        if (h->property[i].use == use) return &h->property[i];
    return NULL;
}

/* Checks that hold for meshes and point clouds alike. */
static int check_header(const struct ply_header *h, const struct text *t, struct sh_err *err)
{
    int n[4] = {0, 0, 0, 0};
    for (int i = 0; i < h->n_elements; i++) {
        const struct ply_element *e = &h->element[i];
        if (++n[e->kind] > 1 && e->kind != PLY_OTHER)
            return text_fail(t, t->line, SH_EINPUT, err, "element %s is given twice", e->name);
        if (e->n_properties == 0 && e->count > 0)
            return text_fail(t, t->line, SH_EINPUT, err, "element %s has no properties", e->name);
        if (e->kind == PLY_VERTEX && !(ply_find(h, e, PLY_X) && ply_find(h, e, PLY_Y) && ply_find(h, e, PLY_Z)))
            return text_fail(t, t->line, SH_EINPUT, err, "element vertex lacks one of the properties x, y, z");
    }
    return SH_OK;
}

int ply_read_header(struct ply_header *h, struct text *t, struct sh_err *err)
{
    *h = (struct ply_header){0};
    struct text_span word = text_word(t);
    text_skip_blanks(t);
    if (!text_is(word, "ply") || !text_at_line_end(t))
        return text_fail(t, t->line, SH_EINPUT, err, "not a PLY file: the first line must be 'ply'");
    bool has_format = false;
    for (;;) {
        text_next_line(t);
        if (t->p >= t->end) return text_fail(t, t->line, SH_EINPUT, err, "the file ends in the header");
        int rc = SH_OK;
        word = text_word(t);
        if (text_is(word, "end_header")) break;
        if (text_is(word, "format")) {
            has_format = true;
            rc = read_format(h, t, err);
        } else if (text_is(word, "element")) {
            rc = read_element(h, t, err);
        } else if (text_is(word, "property")) {
            rc = read_property(h, t, err);
        } else if (text_is(word, "comment")) {
            rc = read_comment(h, t, err);
        } else if (word.n > 0 && !text_is(word, "obj_info")) {
            rc = ply_read_header_fail(t, err, "unknown word in the header", word);
        }
        if (rc != SH_OK) return rc;
    }
    if (!has_format) return text_fail(t, t->line, SH_EINPUT, err, "the header has no format");
    int rc = check_header(h, t, err);
    text_next_line(t);
    return rc;
}
