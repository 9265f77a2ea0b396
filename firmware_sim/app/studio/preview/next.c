/* SPDX-License-Identifier: MIT */
/* /next: the place that adds most to what stations of a trial see (`scanhead coverage --next`, with coarse scans). */
#include "firmware_sim/app/studio/coverage/next.h"

#include <math.h>
#include <stdlib.h>

#include "firmware_sim/app/studio/page_json.h"
#include "firmware_sim/app/studio/preview/inside.h"

/* Places of the grid, about; the ray step they are compared by; how many of the best are scanned. */
static const double PLACES = 250.0, LEAST_GRID_M = 0.25, RAYS_DEG = 3.0;
enum { SCANS = 3 };

struct answer {
    const struct coverage_next *next;
};

static void put_next(struct json *json, const void *ctx)
{
    const struct coverage_next *next = ((const struct answer *)ctx)->next;
    json_open_object(json, NULL);
    json_uint(json, "places", next->n - next->within);
    if (next->n_rounds == 0)
        json_string(json, "place", NULL);
    else {
        const struct coverage_next_round *round = &next->round[0];
        const struct coverage_next_place *place = &next->place[round->place];
        json_open_object(json, "place");
        json_double(json, "x_m", place->position_m[0]);
        json_double(json, "y_m", place->position_m[1]);
        json_double(json, "z_m", place->position_m[2]);
        json_double(json, "heading_deg", place->heading_deg);
        json_close_object(json);
        json_double(json, "gain_m2", round->gain_m2[0]);
        json_double(json, "none_m2", round->none_m2);
    }
    json_close_object(json);
}

static double grid_of(const struct scene *scene)
{
    const double area_m2 = (scene->max_m[0] - scene->min_m[0]) * (scene->max_m[1] - scene->min_m[1]);
    return fmax(LEAST_GRID_M, sqrt(area_m2 / PLACES));
}

/* The hits of all previews stand for those of the stations. */
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

int preview_next(const struct preview_work *work, const struct preview_request *r, const struct preview_seen *seen,
                 struct web_body *out, struct sh_err *err)
{
    struct coverage *coverage = work->options->coverage;
    struct coverage_next_options o = {
        .stations = 1, .height_m = r->height_m, .step_deg = RAYS_DEG, .scans = SCANS, .grid_m = 0.0};
    struct coverage_next next = {.n = 0};
    struct coverage_finder finder = {.n_dir = 0};
    struct coverage_result result = {.base = r->station, .cell_m = work->options->cell_m};
    struct preview_site *p = NULL;
    int rc = preview_site_open(work, r, &p, err);
    if (rc != SH_OK) {
        free(p);
        return rc;
    }
    for (int i = 0; i < 3; i++)
        o.area_m[0][i] = o.area_m[1][i] = (double)NAN;
    o.grid_m = grid_of(p->site.scene);
    result.site = &p->site;
    result.station = calloc(p->site.n_stations, sizeof *result.station);
    rc = result.station != NULL ? SH_OK : sh_fail(err, SH_ENOMEM, "no memory for a suggestion");
    if (rc == SH_OK) keep_seen(coverage, seen, r->n_of, &result.station[0].pulses);
    if (rc == SH_OK) rc = coverage_next_open(&o, &result, &work->stop, &next, &finder, err);
    if (rc == SH_OK) rc = coverage_next_find(&finder, coverage, err);
    if (rc == SH_OK) rc = page_json(put_next, &(struct answer){&next}, out, err);
    coverage_forget(coverage);
    coverage_next_free(&next, &finder);
    free(result.station);
    free(p);
    return rc;
}
