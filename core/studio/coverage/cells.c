/* SPDX-License-Identifier: MIT */
/* The surface as cells: triangles are cut into pieces, and pieces become cells. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/studio/coverage/cut.h"
#include "core/studio/coverage/inside.h"
#include "core/studio/mesh/numbering.h"
#include "core/grow.h"
#include "core/huge_pages.h"
#include "core/vec3.h"

/* The most memory that a piece takes, where each piece is a cell and a column of its own: entries, the cell's key of 16
 * bytes, places of the table, and the spare room of arrays that grow. */
enum { PIECE_BYTES = 4 + 2 * (4 + sizeof(struct cell) + 16) + sizeof(struct cell_hits) + 16 };
enum { TRIANGLE_BYTES = 4 };
static const double MAX_PIECES = 4e9; /* they are numbered in 32 bits */
enum { REPORT_EVERY = 1 << 16 };
/* The cubes begin this share of a cell before the scene's bounds. So walls at round coordinates don't lie on a side
 * between two cubes, where rounding would divide their pieces between both. */
static const double ASIDE = 0.38196601125010515;

struct build {
    struct coverage *c;
    struct numbering cells; /* by cube, label and side */
    size_t cell_room;
    uint32_t at; /* piece */
    uint32_t label_side;
    double piece_m2;
    struct sh_err *err;
    int rc;
};

static float float_of(uint32_t bits)
{
    float f;
    memcpy(&f, &bits, sizeof f);
    return f;
}

uint32_t coverage_bits(double value)
{
    const float f = (float)value;
    uint32_t bits;
    memcpy(&bits, &f, sizeof bits);
    return bits;
}

/* Returns the largest component and its sign as one number, 0..5. */
static uint32_t side_of(const double n[3])
{
    int axis = fabs(n[1]) > fabs(n[0]) ? 1 : 0;
    if (fabs(n[2]) > fabs(n[axis])) axis = 2;
    return 2 * (uint32_t)axis + (n[axis] < 0.0);
}

/* ---- how many pieces there are */

static int is_silent(const struct coverage *c, uint32_t t)
{
    return c->spec.silent != NULL && c->spec.silent[c->scene->label[t]];
}

static int has_cells(const struct coverage *c, uint32_t t)
{
    return !is_silent(c, t) && (c->duplicate[t / 64] >> t % 64 & 1) == 0;
}

static double count_pieces(const struct coverage *c, double cell_m)
{
    double pieces = 0.0;
    for (uint32_t t = 0; t < c->scene->n_triangles; t++) {
        double corner[3][3];
        if (!has_cells(c, t)) continue;
        scene_corners(c->scene, t, corner);
        pieces += cut_count((const double(*)[3])corner, cell_m);
    }
    return pieces;
}

static double mib_of(const struct coverage *c, double pieces)
{
    return (pieces * PIECE_BYTES + (double)c->scene->n_triangles * TRIANGLE_BYTES) / 0x1p20;
}

static int refuse(const struct coverage *c, double pieces, struct sh_err *err)
{
    char named[32]; /* the cell as the message rounds it: this size is tried */
    double cell_m = c->spec.cell_m;
    int tries = 0;
    do {
        snprintf(named, sizeof named, "%.2g", 1.5 * cell_m);
        cell_m = strtod(named, NULL);
    } while (mib_of(c, count_pieces(c, cell_m)) > c->spec.memory_mib && ++tries < 100);
    if (tries == 100)
        return sh_fail(err, SH_EINPUT,
                       "%u triangles need %.0f MiB for coverage even in the largest cells, and %.0f MiB are allowed",
                       c->scene->n_triangles, mib_of(c, c->scene->n_triangles), c->spec.memory_mib);
    return sh_fail(
        err, SH_EINPUT,
        "cells of %g m cut the surface into %.3g pieces, which take up to %.0f MiB, and %.0f MiB are allowed; use a "
        "cell of at least %s m",
        c->spec.cell_m, pieces, mib_of(c, pieces), c->spec.memory_mib, named);
}

/* ---- pieces become cells */

static uint32_t find_cell(struct build *b, const int32_t cube[3])
{
    struct coverage *c = b->c;
    const uint64_t key[2] = {(uint64_t)(uint32_t)cube[0] << 32 | (uint32_t)cube[1],
                             (uint64_t)(uint32_t)cube[2] << 32 | b->label_side};
    const uint32_t cell = numbering_of(&b->cells, key);
    if (cell == NUMBERING_NONE || !grow(&c->cell, &b->cell_room, (size_t)cell + 1, sizeof *c->cell)) {
        b->rc = sh_fail(b->err, SH_ENOMEM, "no memory for the cells of coverage");
        return NO_CELL;
    }
    if (cell == c->n_cells) c->cell[c->n_cells++] = (struct cell){.label = (uint16_t)(b->label_side >> 3)};
    return cell;
}

static void add_piece(struct build *b, const double corner[4][3], int n)
{
    int32_t cube[3];
    for (int i = 0; i < 3; i++) {
        double sum_m = 0.0;
        for (int k = 0; k < n; k++)
            sum_m += corner[k][i];
        const double centre_m = sum_m / n;
        cube[i] = (int32_t)floor((centre_m - b->c->origin_m[i]) / b->c->spec.cell_m);
    }
    const uint32_t cell = find_cell(b, cube);
    if (cell == NO_CELL) return;
    b->c->cell[cell].area_m2 += b->piece_m2;
    b->c->piece[b->at++] = cell;
}

static void cut_triangle(struct build *b, uint32_t t)
{
    struct coverage *c = b->c;
    double corner[3][3], n[3];
    struct cut cut;
    scene_corners(c->scene, t, corner);
    vec3_normal(corner[0], corner[1], corner[2], n);
    const double area_m2 = 0.5 * vec3_length(n);
    if (c->first[t] == NO_CELL) {
        *(is_silent(c, t) ? &c->silent_m2 : &c->duplicate_m2) += area_m2;
        return;
    }
    b->label_side = (uint32_t)(c->scene->label[t] - c->scene->label0) << 3 | side_of(n);
    cut_set_up((const double(*)[3])corner, c->spec.cell_m, &cut);
    for (uint32_t k = 0; k < cut_columns(&cut); k++) {
        const uint32_t rows = cut_rows(&cut, k);
        b->piece_m2 = area_m2 * cut_share(&cut, k);
        for (uint32_t r = 0; r < rows && b->rc == SH_OK; r++) {
            double at[4][3];
            const int corners = cut_corners(&cut, (const double(*)[3])corner, k, r, r + 1, at);
            add_piece(b, (const double(*)[3])at, corners);
        }
    }
}

static int build(struct coverage *c, const struct sh_report *report, struct sh_err *err)
{
    struct build b = {.c = c, .err = err};
    for (uint32_t t = 0; t < c->scene->n_triangles && b.rc == SH_OK; t++) {
        if (t % REPORT_EVERY == 0) sh_progress(report, "cutting the surface", (double)b.at / (double)c->n_pieces);
        if (t % 1024 == 0) b.rc = sh_check_stop(report, err);
        if (b.rc == SH_OK) cut_triangle(&b, t);
    }
    numbering_free(&b.cells);
    if (b.rc != SH_OK) return b.rc;
    c->hits = calloc(c->n_cells, sizeof *c->hits);
    return c->hits != NULL ? SH_OK : sh_fail(err, SH_ENOMEM, "no memory for the cells of coverage");
}

static int cells_set_up(struct coverage *c, struct sh_err *err)
{
    double span_m = 0.0;
    for (int i = 0; i < 3; i++) {
        c->origin_m[i] = c->scene->min_m[i] - ASIDE * c->spec.cell_m;
        span_m = fmax(span_m, c->scene->max_m[i] - c->scene->min_m[i]);
    }
    if (span_m / c->spec.cell_m > 1e9)
        return sh_fail(err, SH_EINPUT, "cells of %g m in a scene of %.3g m; allowed is a cell of at least %.2g m",
                       c->spec.cell_m, span_m, 1.05e-9 * span_m); /* 5 % more, since two digits may round it down */
    const double pieces = count_pieces(c, c->spec.cell_m);
    return mib_of(c, pieces) > c->spec.memory_mib || !(pieces < MAX_PIECES) ? refuse(c, pieces, err) : SH_OK;
}

/* Numbers the columns of each triangle and the pieces of each column. */
static int number_pieces(struct coverage *c, struct sh_err *err)
{
    const uint32_t n = c->scene->n_triangles;
    size_t room = 0;
    c->first = malloc(n * sizeof *c->first);
    int has_room = c->first != NULL;
    for (uint32_t t = 0; t < n && has_room; t++) {
        double corner[3][3];
        struct cut cut;
        c->first[t] = NO_CELL;
        if (!has_cells(c, t)) continue;
        c->first[t] = (uint32_t)c->n_columns;
        scene_corners(c->scene, t, corner);
        cut_set_up((const double(*)[3])corner, c->spec.cell_m, &cut);
        const uint32_t columns = cut_columns(&cut);
        has_room = grow(&c->column, &room, c->n_columns + columns, sizeof *c->column);
        for (uint32_t k = 0; k < columns && has_room; k++) {
            c->column[c->n_columns++] = (uint32_t)c->n_pieces;
            c->n_pieces += cut_rows(&cut, k);
        }
    }
    if (has_room) has_room = (c->piece = huge_pages_alloc((c->n_pieces + 1) * sizeof *c->piece)) != NULL;
    return has_room ? SH_OK : sh_fail(err, SH_ENOMEM, "no memory for the pieces of %u triangles", n);
}

int coverage_create(const struct coverage_spec *spec, const struct sh_report *report, struct coverage **out,
                    struct sh_err *err)
{
    struct coverage *c = *out = calloc(1, sizeof *c);
    if (c == NULL) return sh_fail(err, SH_ENOMEM, "no memory for coverage");
    c->spec = *spec;
    c->scene = bvh_scene(spec->bvh);
    int rc = scene_find_duplicate_faces(c->scene, report, &c->duplicate, err);
    if (rc == SH_OK) rc = cells_set_up(c, err);
    if (rc == SH_OK) rc = number_pieces(c, err);
    if (rc == SH_OK) rc = build(c, report, err);
    if (rc == SH_OK) return SH_OK;
    coverage_free(c);
    *out = NULL;
    return rc;
}

void coverage_free(struct coverage *coverage)
{
    if (coverage == NULL) return;
    free(coverage->duplicate);
    free(coverage->first);
    free(coverage->column);
    free(coverage->piece);
    free(coverage->cell);
    free(coverage->hits);
    free(coverage);
}

uint32_t coverage_cell_at(const struct coverage *c, uint32_t triangle, const double p_m[3])
{
    if (c->first[triangle] == NO_CELL) return NO_CELL;
    double corner[3][3], n[3], weight[3];
    struct cut cut;
    uint32_t column, row;
    scene_corners(c->scene, triangle, corner);
    vec3_normal(corner[0], corner[1], corner[2], n);
    for (int i = 0; i < 3; i++) { /* a weight is the area of the triangle that the point and the opposite edge make */
        double across[3];
        vec3_normal(corner[(i + 1) % 3], corner[(i + 2) % 3], p_m, across);
        weight[i] = fmax(vec3_dot(n, across), 0.0);
    }
    cut_set_up((const double(*)[3])corner, c->spec.cell_m, &cut);
    cut_find(&cut, weight, &column, &row);
    return c->piece[c->column[c->first[triangle] + column] + row];
}

uint32_t coverage_cells(const struct coverage *coverage)
{
    return coverage->n_cells;
}

void coverage_get(const struct coverage *coverage, uint32_t cell, struct coverage_cell *out)
{
    const struct cell *c = &coverage->cell[cell];
    *out = (struct coverage_cell){.area_m2 = c->area_m2,
                                  .pulses = c->pulses,
                                  .stations = c->stations,
                                  .incidence_rad = (double)NAN,
                                  .range_m = (double)NAN,
                                  .label = c->label,
                                  .first_station = c->first_station};
    if (c->stations == 0) return;
    out->incidence_rad = acos(fmin((double)float_of(c->cosine), 1.0));
    out->range_m = 1.0 / (double)float_of(c->nearness);
}
