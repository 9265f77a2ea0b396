/* SPDX-License-Identifier: MIT */
/* .ptx: one grid per scan, a column per line and a row per shot. Points are in the head's frame; the pose
 * takes them to the recording's coordinate frame (station_pose.h). A shot without echo is "0 0 0 0.5". So is a
 * place of the grid without a shot: lines may have been lost, and lines differ by a pulse where the pulse rate is
 * no multiple of the line rate.
 *
 * The grid of a planar head has a column per turn and a row per step; the first row is the first step that is cast.
 * The grid of a sphere has a column per ring; the column of a pole has one shot. Beams and lists of directions have
 * no rows and columns: they are refused.
 *
 * With colours each text line of a point ends in red, green and blue, 0 to 255. Colours are 0 for a place without a
 * point.
 *
 * A PTX grid has one point per shot: the first echo. Intensity is the reflectance as a fraction: 1 for a
 * white Lambertian target and for what is brighter, 0.5 where not modelled. Echoes without room in the
 * grid are counted and reported at the end.
 *
 * Places without a shot are bounded, so that a small stream never makes a huge file. A grid has no more lines,
 * and pulses in a line, than the descriptor says a scan can have. All grids of a recording together, also in
 * files of their own, are filled up by PADDING_FREE places and PADDING_PER_SHOT more for each shot. Where more
 * is missing, or line numbers go back, another grid begins with the same pose: no point is lost, and the grids are
 * reported. */
#include <math.h>
#include <string.h>

#include "drivers/record/ptx_text.h"
#include "drivers/record/recorder.h"

enum {
    PADDING_FREE = 1 << 24, /* 160 MiB of text, 256 MiB with colours: a grid of 4,500 x 3,700 with one shot */
    PADDING_PER_SHOT = 8,
    N_KNOWN = 1024, /* intensities that are kept, by the stream's steps of 0.01 dB */
};

/* An intensity that was computed before. Scans have few different reflectances, and pow() takes long. */
struct known {
    double reflectance_db;
    float intensity;
};

struct ptx {
    struct recorder base;
    struct ptx_grid grid;
    struct known known[N_KNOWN];
    struct station_pose pose;     /* of the scan in the grid */
    uint32_t last_line, last_row; /* of the grid's last shot */
    uint64_t n_left_out, n_too_bright;
    uint64_t n_padded; /* places in this file */
    uint64_t n_split;  /* grids that go on with the scan of the one before */
    struct recorder_padding own, *padding;
};

static int ptx_begin(void *rec, struct sh_err *err)
{
    struct ptx *ptx = rec;
    ptx->padding = ptx->base.options.padding != NULL ? ptx->base.options.padding : &ptx->own;
    ptx->known[0].intensity = 1; /* of 0 dB */
    ptx->base.track.spared = TRACK_RANGE | TRACK_TIME | TRACK_LABEL;
    return ptx_grid_open(&ptx->grid, ptx->base.file.path, err);
}

static int end_scan(struct ptx *ptx, struct sh_err *err)
{
    struct ptx_grid *g = &ptx->grid;
    if (g->n_shots == 0) return 0;
    uint64_t columns = (uint64_t)g->column_max - g->column_min + 1, rows = (uint64_t)g->row_max - g->row_min + 1;
    ptx->n_padded += columns * rows - g->n_shots;
    ptx->padding->n_places += columns * rows - g->n_shots;
    ptx->padding->n_shots += g->n_shots;
    struct ptx_text text = {.file = &ptx->base.file,
                            .grid = g,
                            .pose = &ptx->pose,
                            .coloured = ptx->base.track.has_colours,
                            .report = ptx->base.options.report};
    int rc = ptx_text_put(&text, err);
    /* A repair makes a missing text from the cells. So the text goes to the file before the cells are deleted. */
    if (rc == 0) rc = outfile_flush(&ptx->base.file, err);
    if (rc == 0) rc = ptx_grid_clear(g, err);
    ptx->base.has_failed |= rc != 0; /* the text of the grid may be shorter than its header says */
    return rc;
}

/* Returns whether the n points of the present batch, which are of one line, belong into the grid as it is. */
static int has_room(const struct ptx *ptx, uint32_t n)
{
    const struct ptx_grid *g = &ptx->grid;
    const struct track *t = &ptx->base.track;
    const uint32_t first = t->row[0], last = t->row[n - 1];
    if (g->n_shots == 0) return 1;
    const uint32_t after = ptx->last_row + (t->points.echo[0] <= 1); /* later echoes belong to the last shot */
    if (t->line < ptx->last_line || (t->line == ptx->last_line && first < after)) return 0;
    const uint64_t columns = (uint64_t)t->line - g->column_min + 1;
    const uint64_t rows =
        (uint64_t)(last > g->row_max ? last : g->row_max) - (first < g->row_min ? first : g->row_min) + 1;
    const uint64_t shots = g->n_shots + n;
    return columns <= t->max_lines && rows <= t->max_pulses && rows <= PTX_ROWS_MAX &&
           ptx->padding->n_places + columns * rows <=
               PADDING_FREE + shots + PADDING_PER_SHOT * (ptx->padding->n_shots + shots);
}

static int ptx_scan(void *rec, struct sh_err *err)
{
    struct ptx *ptx = rec;
    const int kind = ptx->base.track.emitter.kind;
    if (kind == SCANHEAD_EMIT_BEAMS || kind == SCANHEAD_EMIT_DIRECTIONS)
        return sh_fail(err, SH_EFORMAT,
                       "%s: a PTX grid has rows and columns, but this head fires %s; allowed are .ply .las .e57 "
                       ".poses.csv .waves.csv .shs .pcapng",
                       ptx->base.track.path, kind == SCANHEAD_EMIT_BEAMS ? "beams in turn" : "along a list");
    int rc = end_scan(ptx, err);
    ptx->pose = ptx->base.track.pose;
    return rc;
}

static float intensity(struct ptx *ptx, double reflectance_db)
{
    if (isnan(reflectance_db)) return 0.5f;
    if (reflectance_db > 0) {
        ptx->n_too_bright++;
        return 1.0f;
    }
    struct known *known = &ptx->known[(unsigned long)lrint(-100 * reflectance_db) % N_KNOWN];
    if (known->reflectance_db != reflectance_db)
        *known = (struct known){reflectance_db, (float)pow(10, reflectance_db / 10)};
    return known->intensity;
}

/* Makes the cell of the batch's point i. Returns 1, or 0 for a shot without echo. */
static int make_cell(struct ptx *ptx, int i, struct ptx_cell *cell)
{
    struct track *t = &ptx->base.track;
    const struct track_points *p = &t->points;
    *cell = (struct ptx_cell){.column = t->line, .row = t->row[i], .intensity = -1};
    if (p->echo_count[i] == 0) return 0;
    double p_socs[3] = {p->x[i], p->y[i], p->z[i]};
    if (t->info.geo) station_pose_reverse(&t->pose, p_socs);
    if (track_is_nowhere(t, p_socs[0], p_socs[1], p_socs[2])) return 0;
    cell->intensity = intensity(ptx, p->reflectance_db[i]);
    memcpy(cell->p_socs, p_socs, sizeof p_socs);
    if (t->has_colours) memcpy(cell->rgb, t->rgb[i], sizeof cell->rgb);
    return 1;
}

/* Writes an empty grid where the text will be. So a killed recorder leaves a FILE.part that is not empty: an empty one
 * would count as holding no data (outfile_check_left), and would not be repaired. */
static int begin_grid(struct ptx *ptx, struct sh_err *err)
{
    static const char text[] = "0\n0\n";
    struct outfile *file = &ptx->base.file;
    int rc = outfile_flush(file, err);
    if (rc == 0) rc = ptx_grid_begin(&ptx->grid, file->written, &ptx->pose, ptx->base.track.has_colours, err);
    return rc == 0 ? outfile_patch(file, file->written, text, sizeof text - 1, err) : rc;
}

/* Takes the batch's point i. Returns 1 if a cell was made of it, else 0. */
static int take_shot(struct ptx *ptx, int i, struct ptx_cell *cell)
{
    const struct track *t = &ptx->base.track;
    if (t->points.echo[i] > 1) {
        ptx->n_left_out++;
        return 0;
    }
    ptx->last_line = t->line;
    ptx->last_row = t->row[i];
    const int is_larger = ptx_grid_shot(&ptx->grid, t->line, t->row[i]);
    return make_cell(ptx, i, cell) || is_larger; /* so that the cells alone say how large the grid is */
}

static int take_shots(struct ptx *ptx, int first, int n, struct sh_err *err)
{
    struct ptx_cell cell[TRACK_BATCH];
    int n_cells = 0;
    for (int i = first; i < n; i++)
        n_cells += take_shot(ptx, i, &cell[n_cells]);
    return ptx_grid_cells(&ptx->grid, cell, n_cells, err);
}

static int ptx_points(void *rec, int n, struct sh_err *err)
{
    struct ptx *ptx = rec;
    int rc = 0, first = 0;
    if (n > 0 && !has_room(ptx, (uint32_t)n)) {
        rc = end_scan(ptx, err);
        if (rc != 0) return rc;
        ptx->n_split++;
    }
    for (; ptx->grid.n_shots == 0 && first < n && ptx->base.track.points.echo[first] > 1; first++)
        ptx->n_left_out++;
    if (first == n) return 0;
    if (ptx->grid.n_shots == 0) rc = begin_grid(ptx, err);
    return rc == 0 ? take_shots(ptx, first, n, err) : rc;
}

static int ptx_finish(void *rec, struct sh_err *err)
{
    struct ptx *ptx = rec;
    int rc = end_scan(ptx, err);
    if (rc != 0) return rc;
    recorder_report(rec, ptx->n_left_out, "echoes left out; a PTX grid holds the first of a shot");
    recorder_report(rec, ptx->n_too_bright, "echoes brighter than a white target, which PTX writes as 1");
    recorder_report(
        rec, ptx->n_split,
        "additional grids begun within a scan, since too many places were missing to fill up, or lines went back");
    recorder_report(rec, ptx->n_padded, "places of the grid without a shot, filled like shots without echo");
    return 0;
}

static int ptx_save(void *rec, struct sh_err *err)
{
    struct ptx *ptx = rec;
    return ptx_grid_save(&ptx->grid, err); /* the text of earlier grids is on the disk */
}

static void ptx_release(void *rec)
{
    ptx_grid_close(&((struct ptx *)rec)->grid);
}

const struct recorder_ops recorder_ptx = {
    .ending = ".ptx",
    .size = sizeof(struct ptx),
    .track = {.scan = ptx_scan, .points = ptx_points, .metres = 1, .grid = 1, .wants_colours = 1},
    .begin = ptx_begin,
    .finish = ptx_finish,
    .save = ptx_save,
    .repair = ptx_repair,
    .release = ptx_release,
};
