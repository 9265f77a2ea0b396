#include "core/scene/ply_header.h"

#include <string.h>

const uint8_t ply_type_size[8] = {1, 1, 2, 2, 4, 4, 4, 8};

static bool is(const char *word, size_t len, const char *name)
{
    return strlen(name) == len && memcmp(word, name, len) == 0;
}

static int fail(struct text *t, struct scene_build *b, struct sh_err *err, const char *what, const char *word,
                size_t len)
{
    b->line = t->line;
    return build_fail(b, SH_EINPUT, err, "%s '%.*s'", what, len < 40 ? (int)len : 40, word);
}

static int read_format(struct ply_header *h, struct text *t, struct scene_build *b, struct sh_err *err)
{
    static const char *const names[] = {"ascii", "binary_little_endian", "binary_big_endian"};
    const char *word, *version;
    size_t len = text_word(t, &word), version_len = text_word(t, &version);
    if (!is(version, version_len, "1.0"))
        return fail(t, b, err, "format version has to be 1.0, not", version, version_len);
    for (unsigned i = 0; i < 3; i++) {
        if (!is(word, len, names[i])) continue;
        h->format = (enum ply_format)i;
        return SH_OK;
    }
    return fail(t, b, err, "format has to be ascii, binary_little_endian or binary_big_endian, not", word,
                len);
}

static int read_element(struct ply_header *h, struct text *t, struct scene_build *b, struct sh_err *err)
{
    const char *name;
    size_t len = text_word(t, &name);
    int64_t count;
    text_skip_blanks(t);
    bool ok = text_integer(t, &count) && count >= 0;
    text_skip_blanks(t);
    if (len == 0 || !ok || !text_at_line_end(t))
        return fail(t, b, err, "element takes a name and a count; this one is", name, len);
    if (h->n_elements == PLY_MAX_ELEMENTS)
        return build_fail(b, SH_EINPUT, err, "more than %d elements", PLY_MAX_ELEMENTS);
    struct ply_element *e = &h->element[h->n_elements++];
    *e = (struct ply_element){.count = (uint64_t)count, .first = h->n_properties};
    memcpy(e->name, name, len < sizeof e->name ? len : sizeof e->name - 1);
    e->kind = is(name, len, "vertex") ? PLY_VERTEX : is(name, len, "face") ? PLY_FACE : PLY_OTHER;
    return SH_OK;
}

static int read_type(struct text *t, enum ply_type *type, const char *word, size_t len, struct scene_build *b,
                     struct sh_err *err)
{
    static const char *const names[] = {"char",  "uchar",  "short",   "ushort", "int",   "uint",
                                        "float", "double", "int8",    "uint8",  "int16", "uint16",
                                        "int32", "uint32", "float32", "float64"};
    for (unsigned i = 0; i < 16; i++) {
        if (!is(word, len, names[i])) continue;
        *type = (enum ply_type)(i % 8);
        return SH_OK;
    }
    return fail(t, b, err, "unknown property type", word, len);
}

static enum ply_use use_of(const struct ply_element *e, const struct ply_property *p, const char *name,
                           size_t len)
{
    if (e->kind == PLY_VERTEX && !p->is_list && len == 1 && *name >= 'x' && *name <= 'z')
        return PLY_X + (enum ply_use)(*name - 'x');
    if (e->kind == PLY_FACE && p->is_list &&
        (is(name, len, "vertex_indices") || is(name, len, "vertex_index")))
        return PLY_CORNERS;
    return PLY_SKIP;
}

static int read_property(struct ply_header *h, struct text *t, struct scene_build *b, struct sh_err *err)
{
    const char *word;
    size_t len = text_word(t, &word);
    if (h->n_elements == 0) return build_fail(b, SH_EINPUT, err, "property before any element");
    if (h->n_properties == PLY_MAX_PROPERTIES)
        return build_fail(b, SH_EINPUT, err, "more than %d properties", PLY_MAX_PROPERTIES);
    struct ply_element *e = &h->element[h->n_elements - 1];
    struct ply_property *p = &h->property[h->n_properties++];
    *p = (struct ply_property){.is_list = is(word, len, "list")};
    e->n_properties++;
    int rc = SH_OK;
    if (p->is_list) {
        len = text_word(t, &word);
        rc = read_type(t, &p->count_type, word, len, b, err);
        if (rc == SH_OK && (p->count_type == PLY_FLOAT || p->count_type == PLY_DOUBLE))
            return fail(t, b, err, "a list's count can't be of type", word, len);
        len = text_word(t, &word);
    }
    if (rc == SH_OK) rc = read_type(t, &p->type, word, len, b, err);
    if (rc != SH_OK) return rc;
    len = text_word(t, &word);
    if (len == 0) return build_fail(b, SH_EINPUT, err, "a property has no name");
    p->use = use_of(e, p, word, len);
    for (int i = e->first; i < h->n_properties - 1; i++)
        if (p->use != PLY_SKIP && h->property[i].use == p->use)
            return fail(t, b, err, "property is there twice:", word, len);
    return SH_OK;
}

/* Whether the element that comes has what it needs. */
static int check_element(const struct ply_element *e, const struct ply_header *h, struct scene_build *b,
                         struct sh_err *err)
{
    int uses[PLY_CORNERS + 1] = {0};
    for (int i = 0; i < e->n_properties; i++)
        uses[h->property[e->first + i].use]++;
    if (e->n_properties == 0 && e->count > 0)
        return build_fail(b, SH_EINPUT, err, "element %s has no properties", e->name);
    if (e->kind == PLY_VERTEX && !(uses[PLY_X] && uses[PLY_Y] && uses[PLY_Z]))
        return build_fail(b, SH_EINPUT, err, "element vertex lacks one of the properties x, y, z");
    if (e->kind == PLY_FACE && !uses[PLY_CORNERS])
        return build_fail(b, SH_EINPUT, err, "element face lacks the list vertex_indices");
    return SH_OK;
}

static int check_header(const struct ply_header *h, struct scene_build *b, struct sh_err *err)
{
    int n[3] = {0, 0, 0};
    for (int i = 0; i < h->n_elements; i++) {
        const struct ply_element *e = &h->element[i];
        if (e->kind == PLY_FACE && n[PLY_VERTEX] == 0)
            return build_fail(b, SH_EINPUT, err, "element face comes before element vertex");
        if (++n[e->kind] > 1 && e->kind != PLY_OTHER)
            return build_fail(b, SH_EINPUT, err, "element %s is there twice", e->name);
        int rc = check_element(e, h, b, err);
        if (rc != SH_OK) return rc;
    }
    if (n[PLY_FACE] == 0) return build_fail(b, SH_EINPUT, err, "no element face: points are not a mesh");
    return SH_OK;
}

int ply_header_read(struct ply_header *h, struct text *t, struct scene_build *b, struct sh_err *err)
{
    *h = (struct ply_header){0};
    const char *word;
    size_t len = text_word(t, &word);
    text_skip_blanks(t);
    if (!is(word, len, "ply") || !text_at_line_end(t))
        return build_fail(b, SH_EINPUT, err, "not a PLY file: the first line has to be 'ply'");
    bool has_format = false;
    for (;;) {
        text_next_line(t);
        b->line = t->line;
        if (t->p >= t->end) return build_fail(b, SH_EINPUT, err, "the file ends within the header");
        int rc = SH_OK;
        len = text_word(t, &word);
        if (is(word, len, "end_header")) break;
        if (is(word, len, "format")) {
            has_format = true;
            rc = read_format(h, t, b, err);
        } else if (is(word, len, "element")) {
            rc = read_element(h, t, b, err);
        } else if (is(word, len, "property")) {
            rc = read_property(h, t, b, err);
        } else if (len > 0 && !is(word, len, "comment") && !is(word, len, "obj_info")) {
            rc = fail(t, b, err, "unknown word in the header", word, len);
        }
        if (rc != SH_OK) return rc;
    }
    if (!has_format) return build_fail(b, SH_EINPUT, err, "the header has no format");
    text_next_line(t);
    return check_header(h, b, err);
}
