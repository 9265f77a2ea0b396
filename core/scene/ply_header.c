#include "core/scene/ply_header.h"

#include <string.h>

const uint8_t ply_type_size[8] = {1, 1, 2, 2, 4, 4, 4, 8};

static bool is(const char *word, size_t len, const char *name)
{
    return strlen(name) == len && memcmp(word, name, len) == 0;
}

static int fail(const struct text *t, struct sh_err *err, const char *what, const char *word, size_t len)
{
    return text_fail(t, t->line, SH_EINPUT, err, "%s '%.*s'", what, len < 40 ? (int)len : 40, word);
}

static int read_format(struct ply_header *h, struct text *t, struct sh_err *err)
{
    static const char *const names[] = {"ascii", "binary_little_endian", "binary_big_endian"};
    const char *word, *version;
    size_t len = text_word(t, &word), version_len = text_word(t, &version);
    if (!is(version, version_len, "1.0"))
        return fail(t, err, "format version has to be 1.0, not", version, version_len);
    for (unsigned i = 0; i < 3; i++) {
        if (!is(word, len, names[i])) continue;
        h->format = (enum ply_format)i;
        return SH_OK;
    }
    return fail(t, err, "format has to be ascii, binary_little_endian or binary_big_endian, not", word, len);
}

static int read_element(struct ply_header *h, struct text *t, struct sh_err *err)
{
    const char *name;
    size_t len = text_word(t, &name);
    int64_t count;
    text_skip_blanks(t);
    bool ok = text_integer(t, &count) && count >= 0;
    text_skip_blanks(t);
    if (len == 0 || !ok || !text_at_line_end(t))
        return fail(t, err, "element takes a name and a count; this one is", name, len);
    if (h->n_elements == PLY_MAX_ELEMENTS)
        return text_fail(t, t->line, SH_EINPUT, err, "more than %d elements", PLY_MAX_ELEMENTS);
    struct ply_element *e = &h->element[h->n_elements++];
    *e = (struct ply_element){.count = (uint64_t)count, .first = h->n_properties};
    memcpy(e->name, name, len < sizeof e->name ? len : sizeof e->name - 1);
    e->kind = is(name, len, "vertex") ? PLY_VERTEX : is(name, len, "face") ? PLY_FACE : PLY_OTHER;
    return SH_OK;
}

static int read_type(struct text *t, enum ply_type *type, const char *word, size_t len, struct sh_err *err)
{
    static const char *const names[] = {"char", "uchar", "short", "ushort", "int",   "uint",   "float",   "double",
                                        "int8", "uint8", "int16", "uint16", "int32", "uint32", "float32", "float64"};
    for (unsigned i = 0; i < 16; i++) {
        if (!is(word, len, names[i])) continue;
        *type = (enum ply_type)(i % 8);
        return SH_OK;
    }
    return fail(t, err, "unknown property type", word, len);
}

static enum ply_use use_of(const struct ply_element *e, const struct ply_property *p, const char *name, size_t len)
{
    static const char *const scalar[PLY_SCALARS] = {
        [PLY_X] = "x",       [PLY_Y] = "y",        [PLY_Z] = "z", [PLY_STATION] = "station",
        [PLY_ECHO] = "echo", [PLY_LABEL] = "label"};
    if (e->kind == PLY_FACE && p->is_list && (is(name, len, "vertex_indices") || is(name, len, "vertex_index")))
        return PLY_CORNERS;
    if (e->kind != PLY_VERTEX || p->is_list) return PLY_SKIP;
    for (unsigned i = PLY_X; i < PLY_SCALARS; i++)
        if (is(name, len, scalar[i])) return (enum ply_use)i;
    return PLY_SKIP;
}

static int read_property(struct ply_header *h, struct text *t, struct sh_err *err)
{
    const char *word;
    size_t len = text_word(t, &word);
    if (h->n_elements == 0) return text_fail(t, t->line, SH_EINPUT, err, "property before any element");
    if (h->n_properties == PLY_MAX_PROPERTIES)
        return text_fail(t, t->line, SH_EINPUT, err, "more than %d properties", PLY_MAX_PROPERTIES);
    struct ply_element *e = &h->element[h->n_elements - 1];
    struct ply_property *p = &h->property[h->n_properties++];
    *p = (struct ply_property){.is_list = is(word, len, "list")};
    e->n_properties++;
    int rc = SH_OK;
    if (p->is_list) {
        len = text_word(t, &word);
        rc = read_type(t, &p->count_type, word, len, err);
        if (rc == SH_OK && (p->count_type == PLY_FLOAT || p->count_type == PLY_DOUBLE))
            return fail(t, err, "a list's count can't be of type", word, len);
        len = text_word(t, &word);
    }
    if (rc == SH_OK) rc = read_type(t, &p->type, word, len, err);
    if (rc != SH_OK) return rc;
    len = text_word(t, &word);
    if (len == 0) return text_fail(t, t->line, SH_EINPUT, err, "a property has no name");
    p->use = use_of(e, p, word, len);
    for (int i = e->first; i < h->n_properties - 1; i++)
        if (p->use != PLY_SKIP && h->property[i].use == p->use)
            return fail(t, err, "property is there twice:", word, len);
    return SH_OK;
}

const struct ply_property *ply_find(const struct ply_header *h, const struct ply_element *e, enum ply_use use)
{
    for (int i = e->first; i < e->first + e->n_properties; i++)
        if (h->property[i].use == use) return &h->property[i];
    return NULL;
}

/* What holds for meshes and point clouds alike. */
static int check_header(const struct ply_header *h, const struct text *t, struct sh_err *err)
{
    int n[3] = {0, 0, 0};
    for (int i = 0; i < h->n_elements; i++) {
        const struct ply_element *e = &h->element[i];
        if (++n[e->kind] > 1 && e->kind != PLY_OTHER)
            return text_fail(t, t->line, SH_EINPUT, err, "element %s is there twice", e->name);
        if (e->n_properties == 0 && e->count > 0)
            return text_fail(t, t->line, SH_EINPUT, err, "element %s has no properties", e->name);
        if (e->kind == PLY_VERTEX && !(ply_find(h, e, PLY_X) && ply_find(h, e, PLY_Y) && ply_find(h, e, PLY_Z)))
            return text_fail(t, t->line, SH_EINPUT, err, "element vertex lacks one of the properties x, y, z");
    }
    return SH_OK;
}

int ply_header_read(struct ply_header *h, struct text *t, struct sh_err *err)
{
    *h = (struct ply_header){0};
    const char *word;
    size_t len = text_word(t, &word);
    text_skip_blanks(t);
    if (!is(word, len, "ply") || !text_at_line_end(t))
        return text_fail(t, t->line, SH_EINPUT, err, "not a PLY file: the first line has to be 'ply'");
    bool has_format = false;
    for (;;) {
        text_next_line(t);
        if (t->p >= t->end) return text_fail(t, t->line, SH_EINPUT, err, "the file ends within the header");
        int rc = SH_OK;
        len = text_word(t, &word);
        if (is(word, len, "end_header")) break;
        if (is(word, len, "format")) {
            has_format = true;
            rc = read_format(h, t, err);
        } else if (is(word, len, "element")) {
            rc = read_element(h, t, err);
        } else if (is(word, len, "property")) {
            rc = read_property(h, t, err);
        } else if (len > 0 && !is(word, len, "comment") && !is(word, len, "obj_info")) {
            rc = fail(t, err, "unknown word in the header", word, len);
        }
        if (rc != SH_OK) return rc;
    }
    if (!has_format) return text_fail(t, t->line, SH_EINPUT, err, "the header has no format");
    int rc = check_header(h, t, err);
    text_next_line(t);
    return rc;
}
