/* SPDX-License-Identifier: MIT */
/* /preview is the scan of a station from another place. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/bytes.h"
#include "core/grow.h"
#include "firmware_sim/app/studio/coverage/coverage.h"
#include "firmware_sim/app/studio/preview/inside.h"
#include "firmware_sim/config/places.h"
#include "firmware_sim/config/profile.h"
#include "firmware_sim/site/placement.h"

enum { PLACE_VERSION = 1, POINT_BYTES = 12 + 4 + 2 };

/* ---- the scanner's settings */

static int64_t udeg_or(double deg, int64_t otherwise_udeg)
{
    return isinf(deg) ? otherwise_udeg : llround(1e6 * deg);
}

/* Sets the windows of the lines and of the pan that the request gives. A window for a head that does not scan lines is
 * refused. */
static int set_windows(const struct preview_request *r, const struct config_profile *p, struct head_settings *s,
                       struct sh_err *err)
{
    s->line_start_udeg = udeg_or(r->line_deg[0], s->line_start_udeg);
    s->line_stop_udeg = udeg_or(r->line_deg[1], s->line_stop_udeg);
    s->pan_start_udeg = udeg_or(r->pan_deg[0], s->pan_start_udeg);
    s->pan_stop_udeg = udeg_or(r->pan_deg[1], s->pan_stop_udeg);
    const int given =
        !isinf(r->line_deg[0]) || !isinf(r->line_deg[1]) || !isinf(r->pan_deg[0]) || !isinf(r->pan_deg[1]);
    if (!given) return SH_OK;
    if (p->emitter.kind != EMITTER_LINE)
        return sh_fail(err, SH_EINPUT, "line0_deg, line1_deg, pan0_deg, pan1_deg: allowed for heads that scan lines");
    if (!(s->line_start_udeg < s->line_stop_udeg && s->line_start_udeg >= p->fov_min_udeg &&
          s->line_stop_udeg <= p->fov_max_udeg))
        return sh_fail(err, SH_EINPUT,
                       "lines from %g to %g deg: allowed is a part of %g to %g deg, the lower one first",
                       1e-6 * (double)s->line_start_udeg, 1e-6 * (double)s->line_stop_udeg,
                       1e-6 * (double)p->fov_min_udeg, 1e-6 * (double)p->fov_max_udeg);
    if (s->pan_start_udeg <= s->pan_stop_udeg && s->pan_stop_udeg - s->pan_start_udeg <= 360000000 &&
        s->pan_start_udeg >= p->pan_min_udeg && s->pan_stop_udeg <= p->pan_max_udeg)
        return SH_OK;
    return sh_fail(err, SH_EINPUT,
                   "pan from %g to %g deg: allowed is a part of %g to %g deg, at most a turn, the lower one first",
                   1e-6 * (double)s->pan_start_udeg, 1e-6 * (double)s->pan_stop_udeg, 1e-6 * (double)p->pan_min_udeg,
                   1e-6 * (double)p->pan_max_udeg);
}

/* Sets the rates that give a step (command/step.c has the formulas). A head with a fixed pattern keeps it. */
static void set_step(const struct site *site, double step_deg, struct head_settings *s)
{
    struct schedule_spec spec;
    const int64_t step_udeg = llround(1e6 * step_deg);
    site_fill_spec(site, s, &spec);
    if (spec.emitter == NULL) {
        s->lines_uhz = llround((double)s->prr_uhz * (double)step_udeg / (double)spec.sweep_udeg);
        if (s->pan_udeg_s > 0) s->pan_udeg_s = llround(1e-6 * (double)step_udeg * (double)s->lines_uhz);
    } else if (spec.emitter->kind == EMITTER_SPHERE) {
        s->step_udeg = step_udeg;
        s->prr_uhz = emitter_sphere_steps(step_udeg) * s->lines_uhz;
    }
}

int preview_site_open(const struct preview_work *work, const struct preview_request *r, struct preview_site **out,
                      struct sh_err *err)
{
    const struct site *from = sites_of(work->sites, r->station);
    *out = NULL;
    if (from == NULL || !config_serves(from->cfg, r->station) || from->bvh != work->options->site->bvh)
        return sh_fail(err, SH_EINPUT, "station %u has a scanner that can't be previewed", r->station + 1);
    struct preview_site *p = *out = malloc(sizeof *p);
    if (p == NULL) return sh_fail(err, SH_ENOMEM, "no memory for a preview");
    memcpy(&p->site, from, sizeof p->site);
    memcpy(&p->cfg, from->cfg, sizeof p->cfg);
    struct head_settings s = from->cfg->head.settings;
    s.frames = 1;
    if (!isinf(r->far_m)) s.range_max_nm = llround(1e9 * r->far_m);
    if (s.range_max_nm <= s.range_min_nm)
        return sh_fail(err, SH_EINPUT, "far_m=%g: allowed is more than %g", r->far_m, 1e-9 * (double)s.range_min_nm);
    int rc = set_windows(r, &p->cfg.profile, &s, err);
    if (rc != SH_OK) return rc;
    set_step(from, r->step_deg, &s);
    rc = config_apply_settings(&p->cfg, &s, err);
    p->site.cfg = &p->cfg;
    if (p->cfg.profile.emitter.kind == EMITTER_SPHERE) p->site.emitter = p->cfg.profile.emitter;
    return rc;
}

/* ---- the scan */

/* The points are kept as they come. */
struct points {
    const struct site *site;
    double origin_m[3];
    int wanted, failed;
    size_t room[3];
    uint32_t n;
    float (*xyz_m)[3], *range_m;
    uint16_t *label;
};

static uint16_t label_of(const struct site *site, const struct cast_hit *h)
{
    if (h->body == CAST_MAX_MOVERS + 1) return (uint16_t)site->legs_label;
    const struct scene *scene = h->body == 0 ? site->scene : site->mover[h->body - 1].scene;
    return scene->label[h->triangle];
}

static void take_hits(void *ctx, const struct cast_hit *hit, uint32_t n)
{
    struct points *p = ctx;
    if (!p->wanted || p->failed) return;
    p->failed = !grow(&p->xyz_m, &p->room[0], p->n + n, sizeof *p->xyz_m) ||
                !grow(&p->range_m, &p->room[1], p->n + n, sizeof *p->range_m) ||
                !grow(&p->label, &p->room[2], p->n + n, sizeof *p->label);
    for (uint32_t i = 0; i < n && !p->failed; i++, p->n++) {
        for (int k = 0; k < 3; k++)
            p->xyz_m[p->n][k] = (float)(hit[i].p_m[k] - p->origin_m[k]);
        p->range_m[p->n] = (float)hit[i].range_m;
        p->label[p->n] = label_of(p->site, &hit[i]);
    }
}

static int check_pulses(const struct schedule_segment *seg, double step_deg, struct sh_err *err)
{
    const uint64_t n = seg->end_pulse - seg->k0;
    if (n <= PREVIEW_MOST_PULSES) return SH_OK;
    return sh_fail(err, SH_EINPUT, "step_deg=%g: a scan of %llu pulses; allowed are %d, so take a larger step",
                   step_deg, (unsigned long long)n, PREVIEW_MOST_PULSES);
}

/* Places the station as if its keys said so. */
static int place_station(struct preview_site *p, const struct preview_request *r, struct coverage_scan_at *at,
                         struct site_tripod *tripod, struct sh_err *err)
{
    struct config_station *s = &p->cfg.station[r->station];
    struct placement placement;
    if (p->site.anchor.known) s->place = PLACE_NONE;
    s->has_position = 1;
    s->has_instrument_height = 0;
    memcpy(s->position_m, r->place.position_m, sizeof s->position_m);
    s->heading_deg = r->place.heading_deg;
    s->pitch_deg = r->place.pitch_deg;
    s->roll_deg = r->place.roll_deg;
    int rc = placement_find(&p->cfg, r->station, &p->site.anchor, p->site.bvh, &placement, err);
    if (rc == SH_OK) rc = site_tripod_at(&p->site, r->station, placement.position_m, tripod, err);
    if (rc != SH_OK) return rc;
    memcpy(at->scan.setup.station_m, placement.position_m, sizeof at->scan.setup.station_m);
    memcpy(at->scan.setup.rotation, placement.rotation, sizeof at->scan.setup.rotation);
    at->scan.setup.sight = NULL;
    at->scan.setup.tripod = tripod->from != NULL ? &tripod->cast : NULL;
    return SH_OK;
}

/* ---- the answer */

static void put_floats(char **to, const float *v, size_t n)
{
    for (size_t i = 0; i < n; i++, *to += 4)
        le_put_float(*to, v[i]);
}

/* Writes the head's height above the ground, the radius of the ground that the tripod's cone hides, and how far its
 * feet reach. Without a tripod these are NaN, 0 and 0. */
static void put_tripod(char *to, const struct site_tripod *t)
{
    const int stands = t->from != NULL, hides = stands && t->cast.cos_opening < 1.0 && !isnan(t->head_m);
    le_put_float(to, stands ? (float)t->head_m : NAN);
    le_put_float(to + 4, hides ? (float)(t->head_m * tan(t->opening_rad)) : 0.0f);
    le_put_float(to + 8, stands ? (float)(t->from->leg_m * sin(t->opening_rad)) : 0.0f);
    le_put32(to + 12, 0);
}

static int put_place(const struct preview_work *work, uint32_t number, const struct points *points,
                     const struct coverage_pulses *pulses, struct web_body *out)
{
    struct coverage *coverage = work->coverage;
    const size_t words = preview_words(coverage);
    uint64_t *cells = malloc((words + 1) * sizeof *cells);
    *out = (struct web_body){"application/octet-stream", NULL,
                             PREVIEW_HEAD_BYTES + 8 * words + (size_t)points->n * POINT_BYTES};
    char *to = out->bytes = malloc(out->len);
    if (cells == NULL || to == NULL) {
        free(cells);
        return SH_ENOMEM;
    }
    memcpy(to, "SHPV", 4);
    le_put32(to + 4, PLACE_VERSION);
    le_put32(to + 8, number);
    le_put32(to + 12, coverage_cells(coverage));
    le_put32(to + 16, points->n);
    le_put32(to + 20, (uint32_t)pulses->cast);
    le_put32(to + PREVIEW_HITS_AT, (uint32_t)pulses->hits);
    le_put32(to + PREVIEW_FRONT_AT, (uint32_t)pulses->front);
    for (int i = 0; i < 3; i++)
        le_put_double(to + 32 + 8 * i, points->origin_m[i]);
    coverage_waiting_cells(coverage, cells);
    to += PREVIEW_CELLS_AT;
    for (size_t i = 0; i < words; i++, to += 8)
        le_put64(to, cells[i]);
    free(cells);
    if (points->n > 0) put_floats(&to, points->xyz_m[0], 3 * (size_t)points->n);
    put_floats(&to, points->range_m, points->n);
    for (uint32_t i = 0; i < points->n; i++, to += 2)
        le_put16(to, points->label[i]);
    return SH_OK;
}

int preview_look(const struct preview_work *work, const struct preview_request *r, uint32_t number,
                 struct web_body *out, struct sh_err *err)
{
    struct preview_site *p = NULL;
    struct coverage_scan_at *at = malloc(sizeof *at);
    struct site_tripod tripod = {.from = NULL};
    struct points points = {.wanted = r->points};
    struct coverage_pulses pulses;
    int rc = at != NULL ? preview_site_open(work, r, &p, err) : sh_fail(err, SH_ENOMEM, "no memory for a preview");
    if (rc == SH_OK) {
        coverage_scan_of(&p->site, r->station, at);
        rc = check_pulses(&at->scan.segment, r->step_deg, err);
    }
    if (rc == SH_OK) rc = place_station(p, r, at, &tripod, err);
    if (rc == SH_OK) {
        points.site = &p->site;
        memcpy(points.origin_m, at->scan.setup.station_m, sizeof points.origin_m);
        at->scan.take = take_hits;
        at->scan.take_ctx = &points;
        rc = coverage_look(work->coverage, &at->scan, "preview", &work->stop, &pulses, err);
    }
    if (rc == SH_OK && (points.failed || put_place(work, number, &points, &pulses, out) != SH_OK))
        rc = sh_fail(err, SH_ENOMEM, "no memory for the points of a preview");
    if (rc == SH_OK) put_tripod(out->bytes + 56, &tripod);
    coverage_drop(work->coverage);
    site_free_tripod(&tripod);
    free(points.xyz_m);
    free(points.range_m);
    free(points.label);
    free(p);
    free(at);
    return rc;
}
