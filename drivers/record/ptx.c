/* .ptx: one grid per scan, a column per line and a row per shot. Points are in the head's frame; the pose
 * takes them to the recording's frame (station_pose.h). A shot without echo is "0 0 0 0.5". So is a place of
 * the grid without a shot: lines differ by a pulse where the pulse rate is no multiple of the line rate, and
 * lines may have been lost.
 *
 * A PTX grid has one point per shot: the first echo. Intensity is the reflectance as a fraction: 1 for a
 * white Lambertian target and for what is brighter, 0.5 where not modelled. What the grid had no room for is
 * reported at the end, with counts. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "drivers/record/ptx_grid.h"
#include "drivers/record/recorder.h"

enum { LINE_MAX_LEN = 512, HEADER_MAX_LEN = 2048 };

struct ptx {
    struct recorder base;
    struct ptx_grid grid;
    struct station_pose pose; /* of the scan in the grid */
    uint64_t n_left_out, n_too_bright, n_padded;
};

static int ptx_begin(void *rec, struct sh_err *err)
{
    struct ptx *ptx = rec;
    return ptx_grid_open(&ptx->grid, ptx->base.file.path, err);
}

/* Vectors are rows in PTX: what stands in the matrix is the rotation's transpose, the shift below it. */
static int put_header(struct ptx *ptx, struct sh_err *err)
{
    const struct ptx_grid *g = &ptx->grid;
    const double *r = ptx->pose.rotation, *s = ptx->pose.shift_m;
    char text[HEADER_MAX_LEN];
    int n =
        snprintf(text, sizeof text, "%" PRIu64 "\n%" PRIu64 "\n%.9f %.9f %.9f\n",
                 (uint64_t)g->column_max - g->column_min + 1, (uint64_t)g->row_max - g->row_min + 1, s[0], s[1], s[2]);
    for (int i = 0; i < 3; i++)
        n += snprintf(text + n, sizeof text - (size_t)n, "%.15f %.15f %.15f\n", r[i], r[3 + i], r[6 + i]);
    for (int i = 0; i < 3; i++)
        n += snprintf(text + n, sizeof text - (size_t)n, "%.15f %.15f %.15f 0\n", r[i], r[3 + i], r[6 + i]);
    n += snprintf(text + n, sizeof text - (size_t)n, "%.9f %.9f %.9f 1\n", s[0], s[1], s[2]);
    if (n >= (int)sizeof text) return recorder_fail_huge(&ptx->base, s, err);
    return outfile_write(&ptx->base.file, text, (size_t)n, err);
}

static int put_column(void *ctx, const struct ptx_cell *column, uint32_t n_rows, struct sh_err *err)
{
    struct ptx *ptx = ctx;
    for (uint32_t i = 0; i < n_rows; i++) {
        char *to = (char *)outfile_room(&ptx->base.file, LINE_MAX_LEN, err);
        if (to == NULL) return SH_EIO;
        const struct ptx_cell *c = &column[i];
        const double *p = c->p_socs;
        int n = c->intensity < 0
                    ? snprintf(to, LINE_MAX_LEN, "0 0 0 0.5\n")
                    : snprintf(to, LINE_MAX_LEN, "%.6f %.6f %.6f %.6f\n", p[0], p[1], p[2], (double)c->intensity);
        if (n >= LINE_MAX_LEN) return recorder_fail_huge(&ptx->base, p, err);
        outfile_used(&ptx->base.file, (size_t)n);
    }
    return 0;
}

static int end_scan(struct ptx *ptx, struct sh_err *err)
{
    struct ptx_grid *g = &ptx->grid;
    if (g->n_shots == 0) return 0;
    uint64_t columns = (uint64_t)g->column_max - g->column_min + 1, rows = (uint64_t)g->row_max - g->row_min + 1;
    ptx->n_padded += columns * rows - g->n_shots;
    int rc = put_header(ptx, err);
    return rc != 0 ? rc : ptx_grid_drain(g, put_column, ptx, err);
}

static int ptx_scan(void *rec, struct sh_err *err)
{
    struct ptx *ptx = rec;
    int rc = end_scan(ptx, err);
    ptx->pose = ptx->base.track.pose;
    return rc;
}

static float intensity(struct ptx *ptx, double reflectance_db)
{
    if (isnan(reflectance_db)) return 0.5f;
    if (reflectance_db > 0) ptx->n_too_bright++;
    return reflectance_db > 0 ? 1.0f : (float)pow(10, reflectance_db / 10);
}

static int ptx_points(void *rec, int n, struct sh_err *err)
{
    struct ptx *ptx = rec;
    const struct track *t = &ptx->base.track;
    for (int i = 0; i < n; i++) {
        const struct scanhead_point *p = &t->point[i];
        if (p->echo > 1) {
            ptx->n_left_out++;
            continue;
        }
        ptx_grid_shot(&ptx->grid, t->line, t->row[i]);
        if (p->echo_count == 0) continue;
        struct ptx_cell cell = {t->line, t->row[i], intensity(ptx, p->reflectance_db), {p->x, p->y, p->z}};
        if (t->info.geo) station_pose_reverse(&t->pose, cell.p_socs);
        int rc = ptx_grid_cell(&ptx->grid, &cell, err);
        if (rc != 0) return rc;
    }
    return 0;
}

static int ptx_finish(void *rec, struct sh_err *err)
{
    struct ptx *ptx = rec;
    int rc = end_scan(ptx, err);
    if (rc != 0) return rc;
    recorder_report(rec, ptx->n_left_out, "echoes left out; a PTX grid holds the first of a shot");
    recorder_report(rec, ptx->n_too_bright, "echoes brighter than a white target, which PTX writes as 1");
    recorder_report(rec, ptx->n_padded, "places of the grid without a shot, filled like shots without echo");
    return 0;
}

static void ptx_release(void *rec)
{
    ptx_grid_close(&((struct ptx *)rec)->grid);
}

const struct recorder_ops recorder_ptx = {
    .ending = ".ptx",
    .size = sizeof(struct ptx),
    .track = {.scan = ptx_scan, .points = ptx_points, .metres = 1},
    .begin = ptx_begin,
    .finish = ptx_finish,
    .release = ptx_release,
};
