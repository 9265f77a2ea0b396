/* SPDX-License-Identifier: MIT */
#include "firmware_sim/site/site.h"
#include "firmware_sim/site/view.h"

#include <math.h>
#include <string.h>

#include "core/angle.h"
#include "core/instrument.h"
#include "core/mat3.h"

/* This margin is beyond all known effects that bend or move the beam. */
static const double MARGIN_RAD = 2e-3;
/* Angle noise stays below this many sigmas: rng_normal's largest value is 6.8. */
static const double SIGMAS = 7.0;

enum { DIRECTIONS = 2048 };

static double from_udeg(int64_t udeg)
{
    return angle_rad(1e-6 * (double)udeg);
}

/* Adds the line angles from a to b of a head that pans. Up to 90 deg they are elevations; beyond, the beam looks
 * backward, over the zenith. Each half turn of the line angle is a band. */
static void add_lines(struct site_view *view, double a_rad, double b_rad, double azimuth_rad, double azimuth_to_rad)
{
    for (int k = (int)floor(a_rad / M_PI + 0.5); k * M_PI - M_PI_2 < b_rad && view->n < SITE_VIEW_BANDS; k++) {
        const double low = fmax(a_rad - k * M_PI, -M_PI_2), high = fmin(b_rad - k * M_PI, M_PI_2);
        if (k % 2 == 0)
            view->band[view->n++] = (struct site_band){low, high, azimuth_rad, azimuth_to_rad};
        else
            view->band[view->n++] = (struct site_band){-high, -low, azimuth_rad + M_PI, azimuth_to_rad};
    }
}

/* A pan sweep is a whole number of lines: it may end up to a line beyond the pan's window. */
static void add_sweep(struct site_view *view, const struct head_settings *s)
{
    const int moves = s->pan_udeg_s > 0 && s->pan_stop_udeg > s->pan_start_udeg;
    const double line_udeg = 1e6 * (double)s->pan_udeg_s / (double)s->lines_uhz;
    const double pan_rad = from_udeg(s->pan_start_udeg);
    const double turn_rad = moves ? from_udeg(s->pan_stop_udeg - s->pan_start_udeg) + angle_rad(1e-6 * line_udeg) : 0.0;
    add_lines(view, from_udeg(s->line_start_udeg), from_udeg(s->line_stop_udeg), pan_rad + 0.5 * turn_rad,
              0.5 * turn_rad);
}

/* Adds the elevations from the first ring of a sphere to the last one, over the azimuths of its sector. Close to a pole
 * meets() takes all azimuths. */
static void add_rings(struct site_view *view, const struct emitter *e, const struct head_settings *s)
{
    const double start_rad = from_udeg(s->line_start_udeg), stop_rad = from_udeg(s->line_stop_udeg);
    const double to_rad = start_rad <= stop_rad ? stop_rad - start_rad : stop_rad - start_rad + 2.0 * M_PI;
    view->band[view->n++] = (struct site_band){angle_rad(360.0 * emitter_ring_turn(e, 0)),
                                               angle_rad(360.0 * emitter_ring_turn(e, e->rings - 1)),
                                               start_rad + 0.5 * to_rad, 0.5 * to_rad};
}

/* The window of heads with beams is not used: it would save little. */
static void add_emitter(struct site_view *view, const struct emitter *e, const struct head_settings *s)
{
    if (e->kind == EMITTER_PLANAR) view->band[view->n++] = (struct site_band){0.0, 0.0, 0.0, M_PI};
    for (uint32_t i = 0; e->kind == EMITTER_BEAMS && i < e->n_beams; i++) {
        const double elevation_rad = from_udeg(e->beam[i].elevation_udeg);
        view->band[view->n++] = (struct site_band){elevation_rad, elevation_rad, 0.0, M_PI};
    }
    if (e->kind == EMITTER_SPHERE) add_rings(view, e, s);
    if (e->kind == EMITTER_DIRECTIONS) view->band[view->n++] = (struct site_band){-M_PI_2, M_PI_2, 0.0, M_PI};
}

void site_view_of(const struct site *site, uint32_t station, struct site_view *view)
{
    const struct instrument *k = site->detect.cast.instrument;
    *view = (struct site_view){.margin_rad = MARGIN_RAD};
    for (int i = 0; i < 9; i++)
        view->rotation[i] = site->station[station].at.rotation[i];
    if (k != NULL)
        view->margin_rad +=
            fabs(k->collimation_rad) + fabs(k->trunnion_rad) + SIGMAS * (k->mirror_sigma_rad + k->pan_sigma_rad);
    if (site->emitter.kind == EMITTER_LINE)
        add_sweep(view, site_settings(site));
    else
        add_emitter(view, &site->emitter, site_settings(site));
}

/* Whether a cap meets the band. A cap of radius r around elevation e extends asin(sin r / cos e) to both sides in
 * azimuth, if it holds no pole. */
static int meets(const struct site_band *b, double elevation_rad, double azimuth_rad, double radius_rad)
{
    if (elevation_rad + radius_rad < b->low_rad || elevation_rad - radius_rad > b->high_rad) return 0;
    if (fabs(elevation_rad) + radius_rad >= M_PI_2) return 1;
    const double to_rad = asin(sin(radius_rad) / cos(elevation_rad));
    return fabs(remainder(azimuth_rad - b->azimuth_rad, 2.0 * M_PI)) <= b->azimuth_to_rad + to_rad;
}

int site_view_sees(const void *ctx, const double dir[3], double radius_rad)
{
    const struct site_view *view = ctx;
    double d[3];
    mat3_apply_transposed(view->rotation, dir, d);
    const double elevation_rad = asin(fmax(-1.0, fmin(1.0, d[2]))), azimuth_rad = atan2(d[0], d[1]);
    for (uint32_t i = 0; i < view->n; i++)
        if (meets(&view->band[i], elevation_rad, azimuth_rad, radius_rad + view->margin_rad)) return 1;
    return 0;
}

/* Tries directions on a spiral of the golden angle: they are spread evenly, so each stands for the same area. */
double site_view_share(const struct site_view *view, double radius_rad)
{
    uint32_t seen = 0;
    for (int i = 0; i < DIRECTIONS; i++) {
        const double z = (2.0 * i + 1.0) / DIRECTIONS - 1.0, r = sqrt(1.0 - z * z), turn = i * 2.399963229728653;
        seen += site_view_sees(view, (const double[3]){r * cos(turn), r * sin(turn), z}, radius_rad) != 0;
    }
    return fmax(1.0, seen) / DIRECTIONS;
}

int site_scans(const struct site *site, uint32_t station, const double dir_socs[3])
{
    struct site_view view;
    site_view_of(site, station, &view);
    memcpy(view.rotation, mat3_unit, sizeof view.rotation);
    view.margin_rad = 0.0;
    return site_view_sees(&view, dir_socs, 0.0);
}
