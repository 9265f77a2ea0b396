/* SPDX-License-Identifier: MIT */
/* PLY in double: ASCII and binary of either byte order, any types, polygons and strips. One surface per file, or per
 * texture where it has several. Colours and textures: read_ply_colours.c. */
#include "core/import/read_ply.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "core/grow.h"
#include "core/scene/weld.h"

static int check_mesh(const struct ply *y, struct sh_err *err)
{
    const struct ply_header *h = &y->r.h;
    bool vertices = false, faces = false;
    for (int i = 0; i < h->n_elements; i++) {
        const struct ply_element *e = &h->element[i];
        vertices |= e->kind == PLY_VERTEX;
        if (e->kind != PLY_FACE && e->kind != PLY_STRIPS) continue;
        faces = true;
        if (ply_find(h, e, PLY_CORNERS) == NULL)
            return build_fail(y->b, SH_EINPUT, err, "element %s lacks the list vertex_indices", e->name);
    }
    if (!faces) return build_fail(y->b, SH_EINPUT, err, "there is no element face: points are not a mesh");
    if (!vertices) return build_fail(y->b, SH_EINPUT, err, "there is no element vertex, so faces have no corners");
    return SH_OK;
}

/* ---- vertices */

static int compare_lost(const void *number, const void *lost)
{
    const uint32_t a = *(const uint32_t *)number, b = ((const struct ply_lost *)lost)->number;
    return (a > b) - (a < b);
}

/* A vertex that is not finite is an error only where a face uses it. Such a vertex keeps its number, so that the others
 * keep theirs. */
static int lose_vertex(struct ply *y, const double v[3], struct sh_err *err)
{
    static const double nowhere[3] = {0.0, 0.0, 0.0};
    if (!grow(&y->lost, &y->cap_lost, y->n_lost + 1, sizeof *y->lost))
        return build_fail(y->b, SH_ENOMEM, err, "no memory for vertices that are not finite");
    y->lost[y->n_lost++] = (struct ply_lost){(uint32_t)y->r.row, y->b->line, {v[0], v[1], v[2]}};
    if (y->weld.number == NULL) return build_vertex(y->b, nowhere, err);
    const int rc = build_weld_flush(y->b, &y->weld, err);
    if (rc != SH_OK) return rc;
    y->weld.number[y->weld.n++] = y->b->vertex0;
    y->b->n_welded++;
    return SH_OK;
}

/* Gives vertices that are not finite a harmless place: they must not widen the scene's bounds. */
static void put_away_lost(struct ply *y)
{
    struct scene *s = y->b->scene;
    for (size_t i = 0; i < y->n_lost && y->weld.number == NULL && s->n_triangles > y->b->triangle0; i++)
        for (int k = 0; k < 3; k++)
            s->vertex_m[y->b->vertex0 + y->lost[i].number][k] = s->vertex_m[s->triangle[y->b->triangle0][0]][k];
    if (y->n_lost > 0) build_warn(y->b, "%zu vertices that are not finite left out; no face uses them", y->n_lost);
}

static int take_vertex(struct ply *y, struct sh_err *err)
{
    const double *v = &y->r.scalar[PLY_X];
    int rc = ply_keep_vertex_colour(y, err);
    if (rc != SH_OK) return rc;
    if (!isfinite(v[0]) || !isfinite(v[1]) || !isfinite(v[2])) return lose_vertex(y, v, err);
    return y->weld.number != NULL ? build_weld_later(y->b, &y->weld, v, err) : build_vertex(y->b, v, err);
}

/* ---- faces */

/* Sets corner `to` of the next polygon to corner `from` of the row. */
static int set_corner(struct ply *y, size_t to, size_t from, struct sh_err *err)
{
    const uint32_t *number = y->weld.number, n = y->b->scene->n_vertices - y->b->vertex0 + y->b->n_welded;
    const double index = y->r.corners.value[from];
    if (!(index >= 0 && index < n) || index != floor(index)) {
        char what[96];
        snprintf(what, sizeof what, "index %.17g out of range; there are %u vertices", index, n);
        return ply_fail(&y->r, err, what);
    }
    const uint32_t at = (uint32_t)index;
    const struct ply_lost *lost =
        y->n_lost > 0 ? bsearch(&at, y->lost, y->n_lost, sizeof *y->lost, compare_lost) : NULL;
    if (lost != NULL) {
        y->b->line = lost->line;
        return build_fail(y->b, SH_EINPUT, err, "vertex %u (%g %g %g) is not finite, and a face uses it", at + 1,
                          lost->v[0], lost->v[1], lost->v[2]);
    }
    y->b->corner[to] = number != NULL ? number[at] : y->b->vertex0 + at;
    ply_set_corner_colour(y, to, from, at);
    return SH_OK;
}

static int take_face(struct ply *y, struct sh_err *err)
{
    const size_t n = y->r.corners.n;
    int rc = build_corners(y->b, n, err);
    if (rc == SH_OK) rc = ply_begin_face(y, err);
    for (size_t i = 0; i < n && rc == SH_OK; i++)
        rc = set_corner(y, i, i, err);
    if (rc != SH_OK) return rc;
    if (n >= 3) return build_polygon(y->b, n, y->label, err);
    y->n_empty += n == 0;
    y->b->counts.not_triangles += n > 0;
    return SH_OK;
}

/* Each vertex from the third on makes a triangle with the two before it; every other one is the other way round. */
static int take_strips(struct ply *y, struct sh_err *err)
{
    size_t first = 0;
    int rc = build_corners(y->b, 3, err);
    if (rc == SH_OK) rc = ply_begin_face(y, err);
    for (size_t i = 0; i < y->r.corners.n && rc == SH_OK; i++) {
        if (y->r.corners.value[i] == -1.0) {
            first = i + 1;
            continue;
        }
        if (i < first + 2) continue;
        const size_t odd = (i - first) % 2;
        rc = set_corner(y, 0, i - 2 + odd, err);
        if (rc == SH_OK) rc = set_corner(y, 1, i - 1 - odd, err);
        if (rc == SH_OK) rc = set_corner(y, 2, i, err);
        if (rc == SH_OK) rc = build_polygon(y->b, 3, y->label, err);
    }
    return rc;
}

static int use_row(void *ply, struct sh_err *err)
{
    struct ply *y = ply;
    y->b->line = ply_line(&y->r);
    switch (y->r.element->kind) {
    case PLY_VERTEX:
        return take_vertex(y, err);
    case PLY_FACE:
        return take_face(y, err);
    case PLY_STRIPS:
        return take_strips(y, err);
    default:
        return SH_OK;
    }
}

/* ---- the file */

/* Notes the rounding of float coordinates, which happened when the file was written. */
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

/* Whether faces hardly share vertices: there are more vertices than faces. A closed mesh of triangles that shares them
 * has half as many vertices as faces. */
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
    ply_begin_colours(y);
    const int rc = build_weld_flush(y->b, &y->weld, err);
    if (rc != SH_OK) return rc;
    if (e->kind == PLY_VERTEX && is_torn(y, e->count)) return build_weld_begin(y->b, &y->weld, e->count, err);
    return build_reserve(y->b, e->kind == PLY_VERTEX ? e->count : 0, e->kind == PLY_FACE ? e->count : 0, err);
}

static int read_body(struct ply *y, struct sh_err *err)
{
    const struct ply_user user = {y, begin_element, use_row, y->b->report, .has_faces = true};
    int rc = ply_begin_textures(y, err);
    if (rc == SH_OK) rc = ply_walk(&y->r, &user, err);
    if (rc == SH_OK) rc = build_weld_flush(y->b, &y->weld, err);
    if (rc == SH_OK) put_away_lost(y);
    if (rc == SH_OK && y->r.is_single) rc = note_rounding(y, err);
    if (rc == SH_OK && y->n_empty > 0)
        build_warn(y->b, "%llu faces without corners left out", (unsigned long long)y->n_empty);
    if (rc == SH_OK) ply_end_textures(y);
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
    free(y->lost);
    ply_free_colours(y);
    free(y);
    return rc;
}
