/* SPDX-License-Identifier: MIT */
/* /next gives the place that adds most to the surface that the stations of a trial see (as `scanhead coverage
 * --next`, with coarse scans). /reach gives the surface that can be seen from at least one place of the grid. */
#include "firmware_sim/app/studio/coverage/next.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/angle.h"
#include "core/bytes.h"
#include "firmware_sim/app/studio/page_json.h"
#include "firmware_sim/app/studio/preview/inside.h"
#include "firmware_sim/config/profile.h"

/* The grid has about PLACES places. The places are compared by rays RAYS_DEG apart, and the best SCANS of them are
 * scanned. */
static const double PLACES = 250.0, LEAST_GRID_M = 0.25, RAYS_DEG = 3.0;
enum { SCANS = 3, REACH_HEAD_BYTES = 16, REACH_VERSION = 1 };

static void put_next(struct json *json, const void *ctx)
{
    const struct coverage_next *next = ctx;
    json_open_object(json, NULL);
    json_uint(json, "places", next->n - next->within);
    if (next->n_rounds == 0)
        json_string(json, "place", NULL);
    else {
        const struct coverage_next_round *round = &next->round[0];
        const struct coverage_next_place *place = &next->place[round->tried[0].place];
        json_open_object(json, "place");
        json_double(json, "x_m", place->position_m[0]);
        json_double(json, "y_m", place->position_m[1]);
        json_double(json, "z_m", place->position_m[2]);
        json_double(json, "heading_deg", place->heading_deg);
        json_close_object(json);
        json_double(json, "gain_m2", round->tried[0].gain_m2);
        json_double(json, "none_m2", round->none_m2);
    }
    json_close_object(json);
}

static double grid_of(const struct scene *scene)
{
    const double area_m2 = (scene->max_m[0] - scene->min_m[0]) * (scene->max_m[1] - scene->min_m[1]);
    return fmax(LEAST_GRID_M, sqrt(area_m2 / PLACES));
}

/* Marks as seen the cells that the previews see, and sums the previews' hits. The stations' own ones don't count. */
static void keep_seen(struct coverage *coverage, const struct preview_seen *seen, uint32_t n,
                      struct coverage_pulses *sum)
{
    coverage_forget(coverage);
    for (uint32_t i = 0; i < n; i++) {
        coverage_keep_cells(coverage, seen[i].cells);
        sum->hits += seen[i].hits;
        sum->front += seen[i].front;
    }
}

/* ---- a section of the scene */

struct middles {
    double (*sum_m)[3]; /* by cell, of its pieces' middles */
    uint32_t *n;
};

static void add_middle(void *ctx, uint32_t cell, int n, const double corner[4][3])
{
    const struct middles *m = ctx;
    for (int i = 0; i < 3; i++)
        m->sum_m[cell][i] += (corner[0][i] + corner[1][i] + corner[2][i] + corner[n - 1][i]) / 4;
    m->n[cell]++;
}

static int is_within(const struct preview_section *s, const double sum_m[3], uint32_t n)
{
    const double c = cos(angle_rad(s->heading_deg)), sine = sin(angle_rad(s->heading_deg));
    const double dx = sum_m[0] / n - s->middle_m[0], dy = sum_m[1] / n - s->middle_m[1];
    return fabs(c * dx - sine * dy) <= s->half_m[0] && fabs(sine * dx + c * dy) <= s->half_m[1] &&
           fabs(sum_m[2] / n - s->middle_m[2]) <= s->half_m[2];
}

static int has_section(const struct preview_section *s)
{
    return isfinite(s->half_m[0]) || isfinite(s->half_m[1]) || isfinite(s->half_m[2]);
}

/* Cells outside of the section are kept as seen, so that nothing is gained by them. The page counts by the same middles
 * (middlesOf in previews.js). */
static int keep_outside(struct coverage *coverage, const struct preview_section *section, struct sh_err *err)
{
    const uint32_t n = coverage_cells(coverage);
    struct middles m = {calloc(n, sizeof *m.sum_m), calloc(n, sizeof *m.n)};
    uint64_t *outside = calloc(preview_words(coverage), sizeof *outside);
    const int rc = m.sum_m != NULL && m.n != NULL && outside != NULL
                       ? SH_OK
                       : sh_fail(err, SH_ENOMEM, "no memory for the cells of a section");
    if (rc == SH_OK) coverage_pieces(coverage, add_middle, &m);
    for (uint32_t i = 0; i < n && rc == SH_OK; i++)
        if (!is_within(section, m.sum_m[i], m.n[i])) outside[i / 64] |= UINT64_C(1) << i % 64;
    if (rc == SH_OK) coverage_keep_cells(coverage, outside);
    free(m.sum_m);
    free(m.n);
    free(outside);
    return rc;
}

/* This has the places to stand on, and the rays that they are compared by. */
struct stand {
    struct preview_site *scanner;
    struct coverage_next_options options;
    struct coverage_result result;
    struct coverage_next next;
    struct coverage_finder finder;
};

static int stand_open(const struct preview_work *work, const struct preview_request *r, const struct preview_seen *seen,
                      struct stand *s, struct sh_err *err)
{
    *s = (struct stand){
        .options = {.stations = 1, .height_m = r->height_m, .step_deg = RAYS_DEG, .scans = SCANS, .of_page = 1},
        .result = {.base = r->station, .cell_m = work->options->cell_m}};
    if (coverage_cells(work->coverage) == 0)
        return sh_fail(err, SH_ESTATE, "the scene has too many triangles for coverage, so no place can be suggested");
    int rc = preview_site_open(work, r, &s->scanner, err);
    if (rc != SH_OK) return rc;
    for (int i = 0; i < 3; i++)
        s->options.area_m[0][i] = s->options.area_m[1][i] = (double)NAN;
    s->options.grid_m = grid_of(s->scanner->site.scene);
    s->result.site = &s->scanner->site;
    s->result.station = calloc(s->scanner->site.n_stations, sizeof *s->result.station);
    if (s->result.station == NULL) return sh_fail(err, SH_ENOMEM, "no memory for places to stand");
    keep_seen(work->coverage, seen, r->n_named, &s->result.station[0].pulses);
    if (has_section(&r->section)) rc = keep_outside(work->coverage, &r->section, err);
    if (rc != SH_OK) return rc;
    return coverage_next_open(&s->options, &s->result, &work->stop, &s->next, &s->finder, err);
}

static void stand_close(const struct preview_work *work, struct stand *s)
{
    coverage_forget(work->coverage);
    coverage_next_free(&s->next, &s->finder);
    free(s->result.station);
    free(s->scanner);
}

int preview_next(const struct preview_work *work, const struct preview_request *r, const struct preview_seen *seen,
                 struct web_body *out, struct sh_err *err)
{
    struct stand s;
    int rc = stand_open(work, r, seen, &s, err);
    if (rc == SH_OK) rc = coverage_next_find(&s.finder, work->coverage, err);
    if (rc == SH_OK) rc = page_json(put_next, &s.next, out, err);
    stand_close(work, &s);
    return rc;
}

/* ---- what can be seen at all */

/* Adds the cells that each place sees. If the previews see fronts, a place that sees backs lies within a body, and
 * is left out. Returns the number of places that count, or an error. */
static int mark_reach(const struct preview_work *work, const struct stand *s, uint64_t *reach, struct sh_err *err)
{
    const struct coverage *coverage = work->coverage;
    const struct coverage_finder *f = &s->finder;
    const struct config_profile *profile = site_profile(f->site);
    const struct coverage_pulses *sum = &s->result.station[0].pulses;
    const struct coverage_directions directions = {f->n_dir, (const double(*)[3])f->dir, f->each_sr,
                                                   profile->range_min_m, profile->range_max_m};
    const size_t words = preview_words(coverage);
    _Atomic uint64_t *cells = malloc((words + 1) * sizeof *cells);
    int rc = cells != NULL ? SH_OK : sh_fail(err, SH_ENOMEM, "no memory for the cells of places"), n = 0;
    for (uint32_t i = 0; i < s->next.n && rc == SH_OK; i++) {
        const struct coverage_places place = {1, &s->next.place[i].position_m, cells};
        struct coverage_gain gain;
        for (size_t k = 0; k < words; k++)
            atomic_init(&cells[k], 0);
        rc = coverage_gains(coverage, &directions, &place, &work->stop, &gain, err);
        if (rc != SH_OK || (2 * sum->front >= sum->hits && !(gain.front >= 0.5))) continue;
        n++;
        for (size_t k = 0; k < words; k++)
            reach[k] |= atomic_load_explicit(&cells[k], memory_order_relaxed);
    }
    free(cells);
    return rc == SH_OK ? n : rc;
}

int preview_reach(const struct preview_work *work, const struct preview_request *r, const struct preview_seen *seen,
                  struct web_body *out, struct sh_err *err)
{
    struct stand s;
    const size_t words = preview_words(work->coverage);
    uint64_t *reach = calloc(words + 1, sizeof *reach);
    int n = stand_open(work, r, seen, &s, err);
    if (n == SH_OK)
        n = reach != NULL ? mark_reach(work, &s, reach, err)
                          : sh_fail(err, SH_ENOMEM, "no memory for what can be seen");
    stand_close(work, &s);
    *out = (struct web_body){"application/octet-stream", n >= 0 ? malloc(REACH_HEAD_BYTES + 8 * words) : NULL,
                             REACH_HEAD_BYTES + 8 * words};
    if (out->bytes != NULL) {
        memcpy(out->bytes, "SHRE", 4);
        le_put32(out->bytes + 4, REACH_VERSION);
        le_put32(out->bytes + 8, coverage_cells(work->coverage));
        le_put32(out->bytes + 12, (uint32_t)n);
        for (size_t k = 0; k < words; k++)
            le_put64(out->bytes + REACH_HEAD_BYTES + 8 * k, reach[k]);
    }
    free(reach);
    if (n < 0) return n;
    return out->bytes != NULL ? SH_OK : sh_fail(err, SH_ENOMEM, "no memory for what can be seen");
}
