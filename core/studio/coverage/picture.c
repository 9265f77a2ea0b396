/* SPDX-License-Identifier: MIT */
/* The cells as a coloured mesh. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/angle.h"
#include "core/colour.h"
#include "core/studio/coverage/cut.h"
#include "core/studio/coverage/inside.h"
#include "core/studio/mesh.h"

enum { CORNER_BYTES = 24 + 3 + 2 + 3 * 4 + 8, FACE_BYTES = 12 };
static const float NOT_THERE = -1.0f;
static const uint8_t BY_NONE[3] = {206, 52, 44}, BY_ONE[3] = {236, 200, 58}, BY_SEVERAL[3] = {62, 156, 78};

/* ---- the pieces in their order */

/* Returns the end of the rows from `first` on that belong to one cell. */
static uint32_t rows_alike(const uint32_t *piece, uint32_t first, uint32_t rows)
{
    uint32_t end = first + 1;
    while (end < rows && piece[end] == piece[first])
        end++;
    return end;
}

void coverage_pieces(const struct coverage *coverage, coverage_piece *piece, void *ctx)
{
    for (uint32_t t = 0; t < coverage->scene->n_triangles; t++) {
        double corner[3][3], at[4][3];
        struct cut cut;
        if (coverage->first[t] == NO_CELL) continue;
        scene_corners(coverage->scene, t, corner);
        cut_set_up((const double(*)[3])corner, coverage->spec.cell_m, &cut);
        for (uint32_t k = 0; k < cut_columns(&cut); k++) {
            const uint32_t *of = coverage->piece + coverage->column[coverage->first[t] + k], rows = cut_rows(&cut, k);
            for (uint32_t r = 0, end; r < rows; r = end) {
                end = rows_alike(of, r, rows);
                const int n = cut_corners(&cut, (const double(*)[3])corner, k, r, end, at);
                piece(ctx, of[r], n, (const double(*)[3])at);
            }
        }
    }
}

/* ---- colours */

struct paint {
    const struct coverage *c;
    enum coverage_colour colour;
    double low, high; /* of density, log10 */
};

static int picture_set_up(struct paint *p, struct sh_err *err)
{
    struct coverage_sums sums;
    p->high = 1.0;
    if (p->colour != COVERAGE_DENSITY) return SH_OK;
    int rc = coverage_sum(p->c, &sums, err);
    if (rc != SH_OK || isnan(sums.density_1_m2.p05)) return rc;
    p->low = log10(sums.density_1_m2.p05);
    p->high = fmax(log10(sums.density_1_m2.p95), p->low + 1e-6);
    return SH_OK;
}

static void paint(const struct paint *p, const struct coverage_cell *cell, uint8_t rgb[3])
{
    const uint8_t *flat = cell->stations == 0 ? BY_NONE : cell->stations == 1 ? BY_ONE : BY_SEVERAL;
    const double stations = p->c->n_stations > 0 ? p->c->n_stations : 1.0;
    if (p->colour == COVERAGE_SEEN)
        memcpy(rgb, flat, 3);
    else if (p->colour == COVERAGE_COUNT)
        colour_ramp(cell->stations / stations, rgb);
    else if (cell->stations == 0)
        memcpy(rgb, colour_grey, 3);
    else if (p->colour == COVERAGE_DENSITY)
        colour_ramp((log10(cell->pulses / cell->area_m2) - p->low) / (p->high - p->low), rgb);
    else
        colour_ramp(cell->incidence_rad / M_PI_2, rgb);
}

/* ---- the mesh */

struct cell_mesh {
    struct paint paint;
    uint64_t vertices, faces; /* that there will be */
    uint32_t n, n_faces;      /* that there are */
    double (*xyz_m)[3];
    uint8_t (*rgb)[3];
    uint32_t (*face)[3];
    uint16_t *stations;
    float *density, *incidence_deg, *range_m;
    double *cell;
};

static void count_face(void *ctx, uint32_t cell, int n, const double corner[4][3])
{
    struct cell_mesh *p = ctx;
    (void)cell;
    (void)corner;
    p->vertices += (uint32_t)n;
    p->faces += (uint32_t)n - 2;
}

static float or_not(double value)
{
    return isfinite(value) ? (float)value : NOT_THERE;
}

static void add_face(void *ctx, uint32_t cell, int n, const double corner[4][3])
{
    struct cell_mesh *p = ctx;
    struct coverage_cell c;
    uint8_t rgb[3];
    coverage_get(p->paint.c, cell, &c);
    paint(&p->paint, &c, rgb);
    for (int i = 2; i < n; i++) {
        const uint32_t fan[3] = {p->n, p->n + (uint32_t)i - 1, p->n + (uint32_t)i};
        memcpy(p->face[p->n_faces++], fan, sizeof fan);
    }
    for (int i = 0; i < n; i++, p->n++) {
        memcpy(p->xyz_m[p->n], corner[i], sizeof *p->xyz_m);
        memcpy(p->rgb[p->n], rgb, sizeof *p->rgb);
        p->stations[p->n] = (uint16_t)c.stations;
        p->density[p->n] = (float)(c.pulses / c.area_m2);
        p->incidence_deg[p->n] = or_not(angle_deg(c.incidence_rad));
        p->range_m[p->n] = or_not(c.range_m);
        p->cell[p->n] = cell;
    }
}

static int picture_make_room(struct cell_mesh *p, struct sh_err *err)
{
    const struct coverage_spec *spec = &p->paint.c->spec;
    const double mib = ((double)p->vertices * CORNER_BYTES + (double)p->faces * FACE_BYTES) / 0x1p20;
    const double over = fmax(mib / spec->memory_mib, (double)p->vertices / MESH_MAX_VERTICES);
    if (over > 1.0)
        return sh_fail(
            err, SH_EINPUT,
            "a mesh of cells of %g m has %llu corners, which take %.0f MiB; allowed are %.0f MiB and %d corners; use a "
            "cell of at least %.2g m",
            spec->cell_m, (unsigned long long)p->vertices, mib, spec->memory_mib, (int)MESH_MAX_VERTICES,
            spec->cell_m * 1.5 * sqrt(over));
    const size_t n = p->vertices + 1;
    p->xyz_m = malloc(n * sizeof *p->xyz_m);
    p->rgb = malloc(n * sizeof *p->rgb);
    p->face = malloc((p->faces + 1) * sizeof *p->face);
    p->stations = malloc(n * sizeof *p->stations);
    p->density = malloc(n * sizeof *p->density);
    p->incidence_deg = malloc(n * sizeof *p->incidence_deg);
    p->range_m = malloc(n * sizeof *p->range_m);
    p->cell = malloc(n * sizeof *p->cell);
    const int whole = p->xyz_m != NULL && p->rgb != NULL && p->face != NULL && p->stations != NULL &&
                      p->density != NULL && p->incidence_deg != NULL && p->range_m != NULL && p->cell != NULL;
    return whole ? SH_OK
                 : sh_fail(err, SH_ENOMEM, "no memory for a mesh of %llu triangles", (unsigned long long)p->faces);
}

static int write(const struct cell_mesh *p, const char *path, const struct sh_report *report, struct sh_err *err)
{
    const struct mesh_scalar scalar[] = {{"stations", p->stations, MESH_UINT16},
                                         {"density", p->density, MESH_FLOAT},
                                         {"incidence_deg", p->incidence_deg, MESH_FLOAT},
                                         {"range_m", p->range_m, MESH_FLOAT},
                                         {"cell", p->cell, MESH_DOUBLE}};
    static const char *const COMMENTS[] = {
        "stations: how many see the cell; density: points per m2; incidence_deg, range_m: the smallest",
        "-1: the cell is not seen"};
    const struct mesh mesh = {.n_vertices = p->n,
                              .n_faces = p->n_faces,
                              .xyz_m = (const double(*)[3])p->xyz_m,
                              .rgb = (const uint8_t(*)[3])p->rgb,
                              .face = (const uint32_t(*)[3])p->face,
                              .scalar = scalar,
                              .n_scalars = sizeof scalar / sizeof scalar[0],
                              .comment = COMMENTS,
                              .n_comments = 2};
    return mesh_write(path, &mesh, report, err);
}

int coverage_write_mesh(const struct coverage *coverage, const char *path, enum coverage_colour colour,
                        const struct sh_report *report, struct sh_err *err)
{
    struct cell_mesh p = {.paint = {.c = coverage, .colour = colour}};
    coverage_pieces(coverage, count_face, &p);
    int rc = picture_set_up(&p.paint, err);
    if (rc == SH_OK) rc = picture_make_room(&p, err);
    if (rc == SH_OK) {
        coverage_pieces(coverage, add_face, &p);
        rc = write(&p, path, report, err);
    }
    free(p.xyz_m);
    free(p.rgb);
    free(p.face);
    free(p.stations);
    free(p.density);
    free(p.incidence_deg);
    free(p.range_m);
    free(p.cell);
    return rc;
}
