/* PLY in double: ASCII and binary of either byte order, any types, polygons. One surface per file. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/scene/ply_header.h"

struct ply {
    struct scene_build *b;
    struct text t;
    struct ply_header h;
    const struct ply_element *element; /* being read */
    uint64_t row;                      /* of it */
    uint32_t *corner;                  /* of one face */
    size_t n_corners, cap_corners;
    uint16_t label;
    double xyz[3];
};

/* Where a text goes wrong is its line; in a binary it is the byte. */
static int fail_here(struct ply *y, struct sh_err *err, const char *what)
{
    char place[64] = "";
    if (y->h.format == PLY_ASCII)
        y->b->line = y->t.line;
    else
        snprintf(place, sizeof place, ", byte %zu", (size_t)(y->t.p - y->t.data));
    return build_fail(y->b, SH_EINPUT, err, "%s %llu of %llu%s: %s", y->element->name,
                      (unsigned long long)y->row + 1, (unsigned long long)y->element->count, place, what);
}

static double load_binary(const unsigned char *p, enum ply_type type, bool big)
{
    uint64_t bits = 0;
    unsigned size = ply_type_size[type];
    for (unsigned i = 0; i < size; i++)
        bits = bits << 8 | p[big ? i : size - 1 - i];
    switch (type) {
    case PLY_INT8:
        return (int8_t)bits;
    case PLY_INT16:
        return (int16_t)bits;
    case PLY_INT32:
        return (int32_t)bits;
    case PLY_FLOAT: {
        uint32_t low = (uint32_t)bits;
        float f;
        memcpy(&f, &low, sizeof f);
        return (double)f;
    }
    case PLY_DOUBLE: {
        double d;
        memcpy(&d, &bits, sizeof d);
        return d;
    }
    default:
        return (double)bits;
    }
}

static int read_scalar(struct ply *y, enum ply_type type, double *value, struct sh_err *err)
{
    if (y->h.format == PLY_ASCII) {
        text_skip_blanks(&y->t);
        if (text_number(&y->t, value)) return SH_OK;
        return fail_here(y, err, text_at_line_end(&y->t) ? "a value is missing" : "a value is not a number");
    }
    if ((size_t)(y->t.end - y->t.p) < ply_type_size[type])
        return fail_here(y, err, "the file ends within it");
    *value = load_binary((const unsigned char *)y->t.p, type, y->h.format == PLY_BIG);
    y->t.p += ply_type_size[type];
    return SH_OK;
}

static int keep_corner(struct ply *y, double index, struct sh_err *err)
{
    uint32_t n = y->b->scene->n_vertices - y->b->vertex0;
    if (!(index >= 0 && index < n) || index != floor(index)) {
        char what[96];
        snprintf(what, sizeof what, "index %.17g out of range; there are %u vertices", index, n);
        return fail_here(y, err, what);
    }
    if (y->n_corners == y->cap_corners) {
        size_t cap = y->cap_corners * 2 + 16;
        void *corner = realloc(y->corner, cap * sizeof *y->corner);
        if (corner == NULL) return build_fail(y->b, SH_ENOMEM, err, "no memory for a face");
        y->corner = corner;
        y->cap_corners = cap;
    }
    y->corner[y->n_corners++] = y->b->vertex0 + (uint32_t)index;
    return SH_OK;
}

static int read_list(struct ply *y, const struct ply_property *p, struct sh_err *err)
{
    double count;
    int rc = read_scalar(y, p->count_type, &count, err);
    if (rc != SH_OK) return rc;
    if (!(count >= 0 && count <= UINT32_MAX) || count != floor(count))
        return fail_here(y, err, "a list's count is not a whole number from 0");
    for (uint64_t i = 0; i < (uint64_t)count && rc == SH_OK; i++) {
        double value;
        rc = read_scalar(y, p->type, &value, err);
        if (rc == SH_OK && p->use == PLY_CORNERS) rc = keep_corner(y, value, err);
    }
    return rc;
}

static int read_row(struct ply *y, struct sh_err *err)
{
    const struct ply_element *e = y->element;
    y->n_corners = 0;
    if (y->h.format == PLY_ASCII) {
        for (text_skip_blanks(&y->t); y->t.p < y->t.end && text_at_line_end(&y->t); text_skip_blanks(&y->t))
            text_next_line(&y->t);
        if (y->t.p >= y->t.end) return fail_here(y, err, "the file ends before it");
    }
    int rc = SH_OK;
    for (int i = 0; i < e->n_properties && rc == SH_OK; i++) {
        const struct ply_property *p = &y->h.property[e->first + i];
        double value;
        if (p->is_list) {
            rc = read_list(y, p, err);
            continue;
        }
        rc = read_scalar(y, p->type, &value, err);
        if (rc == SH_OK && p->use != PLY_SKIP) y->xyz[p->use - PLY_X] = value;
    }
    if (rc != SH_OK || y->h.format != PLY_ASCII) return rc;
    text_skip_blanks(&y->t);
    return text_at_line_end(&y->t) ? SH_OK : fail_here(y, err, "there are more values than the header says");
}

static int use_row(struct ply *y, struct sh_err *err)
{
    if (y->h.format == PLY_ASCII) y->b->line = y->t.line;
    if (y->element->kind == PLY_VERTEX) return build_vertex(y->b, y->xyz, err);
    if (y->element->kind != PLY_FACE) return SH_OK;
    if (y->n_corners >= 3) return build_polygon(y->b, y->corner, y->n_corners, y->label, err);
    if (y->n_corners == 0) return fail_here(y, err, "it has no corners");
    y->b->counts.not_triangles++;
    return SH_OK;
}

/* Before anything is allocated: can the rest of the file hold that many rows? */
static int check_count(struct ply *y, struct sh_err *err)
{
    const struct ply_element *e = y->element;
    uint64_t least = 0; /* bytes of a row; in a text, a digit and a separator for each value */
    for (int i = 0; i < e->n_properties; i++) {
        const struct ply_property *p = &y->h.property[e->first + i];
        least += y->h.format == PLY_ASCII ? 2 : ply_type_size[p->is_list ? p->count_type : p->type];
    }
    uint64_t rest = (uint64_t)(y->t.end - y->t.p) + (y->h.format == PLY_ASCII); /* no line end at the end */
    y->b->line = 0;
    if (e->count > 0 && e->count > rest / least)
        return build_fail(
            y->b, SH_EINPUT, err, "%llu of element %s need %llu bytes or more each; %llu are left",
            (unsigned long long)e->count, e->name, (unsigned long long)least, (unsigned long long)rest);
    uint64_t vertices = e->kind == PLY_VERTEX ? e->count : 0, triangles = e->kind == PLY_FACE ? e->count : 0;
    return build_reserve(y->b, vertices, triangles, err);
}

static int read_element_rows(struct ply *y, struct sh_err *err)
{
    int rc = check_count(y, err);
    if (y->element->kind == PLY_OTHER && y->element->count > 0)
        sh_warn(y->b->report, "%s: element '%s' (%llu of it) passed over", y->b->name, y->element->name,
                (unsigned long long)y->element->count);
    for (y->row = 0; y->row < y->element->count && rc == SH_OK; y->row++) {
        rc = read_row(y, err);
        if (rc == SH_OK) rc = use_row(y, err);
        if ((y->row & 0xffff) == 0) build_progress(y->b, (double)(y->t.p - y->t.data) / (double)y->t.size);
    }
    return rc;
}

/* Numbers kept as float in the file are read as they stand, yet what they stood for was rounded. */
static void warn_if_coarse(const struct ply *y)
{
    const struct scene_build *b = y->b;
    bool is_float = false;
    for (int i = 0; i < y->h.n_properties; i++) {
        const struct ply_property *p = &y->h.property[i];
        if (p->use >= PLY_X && p->use <= PLY_Z && p->type == PLY_FLOAT) is_float = true;
    }
    if (!is_float || y->h.format == PLY_ASCII) return;
    double largest = 0;
    for (uint32_t i = b->vertex0; i < b->scene->n_vertices; i++)
        for (int k = 0; k < 3; k++)
            largest = fmax(largest, fabs(b->scene->vertex_m[i][k] - b->spec->offset_m[k]));
    if (largest * 6e-8 > b->tolerance_m)
        sh_warn(b->report, "%s: stored in single precision, so good to %.2g m only", b->name, largest * 6e-8);
}

static int read_body(struct ply *y, struct sh_err *err)
{
    const char *name;
    size_t len;
    build_base_name(y->b, &name, &len);
    int rc = build_label(y->b, name, len, "", 0, &y->label, err);
    for (int i = 0; i < y->h.n_elements && rc == SH_OK; i++) {
        y->element = &y->h.element[i];
        rc = read_element_rows(y, err);
    }
    if (rc != SH_OK) return rc;
    if (y->h.format == PLY_ASCII)
        while (y->t.p < y->t.end && (text_skip_blanks(&y->t), text_at_line_end(&y->t)))
            text_next_line(&y->t);
    if (y->t.p < y->t.end)
        sh_warn(y->b->report, "%s: %zu bytes after the last element passed over", y->b->name,
                (size_t)(y->t.end - y->t.p));
    warn_if_coarse(y);
    y->b->scene->n_meshes++;
    return SH_OK;
}

int read_ply(struct scene_build *b, struct sh_err *err)
{
    struct ply *y = calloc(1, sizeof *y);
    if (y == NULL) return build_fail(b, SH_ENOMEM, err, "no memory");
    y->b = b;
    int rc = text_open(&y->t, b, err);
    if (rc == SH_OK) rc = ply_header_read(&y->h, &y->t, b, err);
    if (rc == SH_OK) rc = read_body(y, err);
    free(y->corner);
    text_close(&y->t);
    free(y);
    return rc;
}
