/* SPDX-License-Identifier: MIT */
#include "drivers/record/mesh_grid.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/grow.h"
#include "drivers/protocol/native.h"

/* The last line borders on the first one where they are at most so many steps of the pan apart. */
static const double CLOSES_STEPS = 1.5;
/* A ring so near to a pole is a pole, since elevations are rounded to 1e-6 degrees. */
static const double POLE_DEG = 1e-5;

int mesh_grid_check(const struct track *t, struct sh_err *err)
{
    const int kind = t->emitter.kind;
    if (kind == SCANHEAD_EMIT_BEAMS || kind == SCANHEAD_EMIT_DIRECTIONS)
        return sh_fail(
            err, SH_EFORMAT,
            "%s: a mesh needs rows and columns, but this head fires %s; allowed are .ply (without --mesh and "
            "--sparse) .las .e57 .poses.csv .waves.csv .shs .pcapng",
            t->path, kind == SCANHEAD_EMIT_BEAMS ? "beams in turn" : "along a list");
    const int is_flat = kind == SCANHEAD_EMIT_PLANAR || (kind == SCANHEAD_EMIT_LINE && !(t->info.pan_deg_s > 0)) ||
                        (kind == SCANHEAD_EMIT_SPHERE && t->emitter.rings <= 1);
    if (!t->info.moving && is_flat)
        return sh_fail(
            err, SH_EFORMAT,
            "%s: a mesh needs a surface, but this head scans a single line: it neither pans nor moves, and has one "
            "ring; allowed are .ply (without --mesh and --sparse) .las .ptx .e57 .poses.csv .waves.csv .shs .pcapng",
            t->path);
    if (t->info.moving && t->info.geo && t->info.crs != NATIVE_CRS_LOCAL)
        return sh_fail(
            err, SH_EFORMAT,
            "%s: a mesh faces the head, but the places of a moving head are known only in the scene's frame; allowed "
            "output.crs: local, or output.layout: polar",
            t->path);
    return SH_OK;
}

void mesh_grid_begin(struct mesh_grid *g, const struct track *t, uint32_t first)
{
    const struct scanhead_info *info = &t->info;
    g->first = first;
    g->n = g->n_columns = 0;
    g->sweep = t->sweep;
    g->station = info->station;
    g->scan = info->scan;
    g->kind = t->emitter.kind;
    g->rings = t->emitter.rings;
    g->first_ring_deg = t->emitter.first_ring_deg;
    g->ring_step_deg = t->emitter.ring_step_deg;
    g->moving = info->moving;
    memcpy(g->head_m, t->pose.shift_m, sizeof g->head_m);
    g->rows_per_turn = 0;
    if (g->kind == SCANHEAD_EMIT_SPHERE || (g->kind == SCANHEAD_EMIT_PLANAR && t->emitter.first_step == 0 &&
                                            (uint32_t)t->emitter.last_step + 1 == t->emitter.steps))
        g->rows_per_turn = t->emitter.steps;
    g->lines_per_turn = g->kind == SCANHEAD_EMIT_LINE && !info->moving && info->pan_deg_s > 0
                            ? 360 * info->lines_hz / info->pan_deg_s
                            : 0;
}

/* Returns whether each sweep is a grid of its own. A planar head, a circle and a head that does not pan have sweeps of
 * one line, which are lines of one grid. */
static int has_sweeps(const struct mesh_grid *g, const struct track *t)
{
    return (g->kind == SCANHEAD_EMIT_SPHERE && g->rings > 1) ||
           (g->kind == SCANHEAD_EMIT_LINE && t->info.pan_deg_s > 0);
}

int mesh_grid_takes(const struct mesh_grid *g, const struct track *t, int i)
{
    if (has_sweeps(g, t) && t->sweep != g->sweep) return 0;
    if (g->n == 0) return 1;
    const uint32_t last = g->line[g->n - 1];
    return t->line > last || (t->line == last && t->row[i] > g->row[g->n - 1]);
}

int mesh_grid_is_pole(const struct mesh_grid *g, uint32_t line)
{
    if (g->kind != SCANHEAD_EMIT_SPHERE || g->rings <= 1) return 0;
    return fabs(g->first_ring_deg + g->ring_step_deg * (line % g->rings)) > 90 - POLE_DEG;
}

static int fail_memory(const struct track *t, uint32_t n, struct sh_err *err)
{
    return sh_fail(err, SH_ENOMEM, "%s: no memory for more than %u points of a grid", t->path, n);
}

int mesh_grid_add(struct mesh_grid *g, struct track *t, int i, const double xyz_m[3], struct sh_err *err)
{
    const uint32_t n = g->n, row = t->row[i];
    const int is_new = n == 0 || t->line != g->line[n - 1];
    struct scanhead_pose pose;
    if (!grow(&g->row, &g->room_row, n + 1, sizeof *g->row) || !grow(&g->line, &g->room_line, n + 1, sizeof *g->line) ||
        (g->moving && !grow(&g->to_head_m, &g->room_head, n + 1, sizeof *g->to_head_m)) ||
        (is_new && !grow(&g->column, &g->room_column, g->n_columns + 1, sizeof *g->column)))
        return fail_memory(t, n, err);
    if (g->moving) {
        if (scanhead_pose(t->sh, t->points.t_ns[i], &pose) != SCANHEAD_OK) return 0;
        for (int k = 0; k < 3; k++)
            g->to_head_m[n][k] = (float)(pose.position_m[k] - xyz_m[k]);
    }
    if (is_new) g->column[g->n_columns++] = (struct scan_column){t->line, n, mesh_grid_is_pole(g, t->line)};
    if (n == 0 || row < g->row_min) g->row_min = row;
    if (n == 0 || row > g->row_max) g->row_max = row;
    if (n == 0) g->line_min = t->line;
    g->line_max = t->line;
    g->row[n] = row;
    g->line[n] = t->line;
    g->n++;
    return 1;
}

struct scan_grid mesh_grid_of(const struct mesh_grid *g, const double (*xyz_m)[3], double long_edge)
{
    const double gap = g->lines_per_turn - ((double)g->line_max - g->line_min);
    struct scan_grid grid = {
        .n_points = g->n,
        .n_columns = g->n_columns,
        .xyz_m = xyz_m + g->first,
        .row = g->row,
        .column = g->column,
        .to_head_m = g->moving ? (const float(*)[3])g->to_head_m : NULL,
        .rows_per_turn = g->rows_per_turn,
        .closes = g->lines_per_turn > 0 && gap > 0 && gap <= CLOSES_STEPS,
        .long_edge = long_edge,
    };
    memcpy(grid.head_m, g->head_m, sizeof grid.head_m);
    return grid;
}

void mesh_grid_free(struct mesh_grid *g)
{
    free(g->row);
    free(g->line);
    free(g->to_head_m);
    free(g->column);
    memset(g, 0, sizeof *g);
}
