/* PLY in double: ASCII and binary of either byte order, any types, polygons. One surface per file. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "core/ply.h"
#include "core/scene/build.h"

struct ply {
    struct scene_build *b;
    struct ply_rows r;
    uint16_t label;
    struct build_weld weld; /* number NULL: vertices are taken as they come */
};

static int check_mesh(const struct ply *y, struct sh_err *err)
{
    const struct ply_header *h = &y->r.h;
    bool vertices = false, faces = false;
    for (int i = 0; i < h->n_elements; i++) {
        const struct ply_element *e = &h->element[i];
        vertices |= e->kind == PLY_VERTEX;
        if (e->kind != PLY_FACE) continue;
        faces = true;
        if (!vertices) return build_fail(y->b, SH_EINPUT, err, "element face comes before element vertex");
        if (ply_find(h, e, PLY_CORNERS) == NULL)
            return build_fail(y->b, SH_EINPUT, err, "element face lacks the list vertex_indices");
    }
    if (!faces) return build_fail(y->b, SH_EINPUT, err, "no element face: points are not a mesh");
    return SH_OK;
}

static int check_corners(struct ply *y, struct sh_err *err)
{
    const uint32_t *number = y->weld.number, n = y->b->scene->n_vertices - y->b->vertex0 + y->b->n_welded;
    int rc = build_corners(y->b, y->r.n_corners, err);
    if (rc != SH_OK) return rc;
    for (size_t i = 0; i < y->r.n_corners; i++) {
        double index = y->r.corner[i];
        if (!(index >= 0 && index < n) || index != floor(index)) {
            char what[96];
            snprintf(what, sizeof what, "index %.17g out of range; there are %u vertices", index, n);
            return ply_fail(&y->r, err, what);
        }
        y->b->corner[i] = number != NULL ? number[(uint32_t)index] : y->b->vertex0 + (uint32_t)index;
    }
    return SH_OK;
}

static int use_row(void *ply, struct sh_err *err)
{
    struct ply *y = ply;
    y->b->line = ply_line(&y->r);
    if (y->r.element->kind == PLY_VERTEX)
        return y->weld.number != NULL ? build_weld_vertex(y->b, &y->weld, &y->r.scalar[PLY_X], err)
                                      : build_vertex(y->b, &y->r.scalar[PLY_X], err);
    if (y->r.element->kind != PLY_FACE) return SH_OK;
    int rc = check_corners(y, err);
    if (rc != SH_OK) return rc;
    if (y->r.n_corners >= 3) return build_polygon(y->b, y->r.n_corners, y->label, err);
    if (y->r.n_corners == 0) return ply_fail(&y->r, err, "it has no corners");
    y->b->counts.not_triangles++;
    return SH_OK;
}

/* What they stood for was rounded when the file was written: nothing can be done about that here. */
static int note_rounding(const struct ply *y, struct sh_err *err)
{
    const struct scene_build *b = y->b;
    double largest = 0;
    for (uint32_t i = b->vertex0; i < b->scene->n_vertices; i++)
        for (int k = 0; k < 3; k++)
            largest = fmax(largest, fabs(b->scene->vertex_m[i][k] - b->spec->offset_m[k]));
    largest /= b->spec->scale;
    return build_single(y->b, largest, largest * BUILD_SINGLE_ROUNDING, false, err);
}

/* More vertices than faces: faces hardly share any. Where they do, there are half as many. */
static bool is_torn(const struct ply *y, uint64_t vertices)
{
    for (int i = 0; i < y->r.h.n_elements; i++)
        if (y->r.h.element[i].kind == PLY_FACE) return vertices > y->r.h.element[i].count && vertices < UINT32_MAX;
    return false;
}

static int begin_element(void *ply, struct sh_err *err)
{
    struct ply *y = ply;
    const struct ply_element *e = y->r.element;
    y->b->line = 0;
    if (e->kind == PLY_VERTEX && is_torn(y, e->count)) return build_weld_begin(y->b, &y->weld, e->count, err);
    return build_reserve(y->b, e->kind == PLY_VERTEX ? e->count : 0, e->kind == PLY_FACE ? e->count : 0, err);
}

static int read_body(struct ply *y, struct sh_err *err)
{
    const struct ply_user user = {y, begin_element, use_row, y->b->report, .has_faces = true};
    int rc = build_label(y->b, build_base_name(y->b), (struct text_span){"", 0}, &y->label, err);
    if (rc == SH_OK) rc = ply_walk(&y->r, &user, err);
    if (rc == SH_OK && y->r.is_single) rc = note_rounding(y, err);
    y->b->scene->n_meshes++;
    return rc;
}

int read_ply(struct scene_build *b, struct sh_err *err)
{
    struct ply *y = calloc(1, sizeof *y);
    if (y == NULL) return build_fail(b, SH_ENOMEM, err, "no memory");
    y->b = b;
    int rc = ply_open(&y->r, b->spec->file, build_progress, b, err);
    if (rc == SH_OK) rc = check_mesh(y, err);
    if (rc == SH_OK) rc = read_body(y, err);
    ply_close(&y->r);
    build_weld_free(&y->weld);
    free(y);
    return rc;
}
