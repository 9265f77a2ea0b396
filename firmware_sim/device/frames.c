/* SPDX-License-Identifier: MIT */
/* Fills the frames in which the device describes itself: descriptor, emitter, anchor. */
#include <math.h>
#include <string.h>

#include "drivers/protocol/native.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/device/device.h"
#include "firmware_sim/device/frames.h"
#include "firmware_sim/site/site.h"

void device_fill_descriptor(const struct device_scan *scan, const char *idn, uint32_t waves,
                            struct native_descriptor *d)
{
    const struct site *site = scan->site;
    const struct config *cfg = site->cfg;
    const struct schedule_spec *spec = &scan->segment.spec;
    struct cast_setup setup;
    site_cast_setup(site, scan->station, &setup);
    site_set_program(site, scan->prr_uhz, &setup);
    memset(d, 0, sizeof *d);
    memcpy(d->idn, idn, sizeof d->idn);
    memcpy(d->profile, cfg->profile.name, sizeof d->profile);
    d->layout = cfg->output.layout == LINE_GEO ? NATIVE_GEO : NATIVE_POLAR;
    d->isa = bvh_get_info(setup.bvh)->packet;
    d->prr_uhz = (uint64_t)scan->prr_uhz;
    d->lines_uhz = (uint64_t)scan->lines_uhz;
    d->pan_udeg_s = (uint64_t)spec->pan_udeg_s;
    d->fov_min_udeg = spec->fov_min_udeg;
    d->sweep_udeg = spec->sweep_udeg;
    d->line_start_udeg = spec->line_start_udeg;
    d->line_stop_udeg = spec->line_stop_udeg;
    d->pan_start_udeg = spec->pan_start_udeg;
    d->pan_stop_udeg = spec->pan_stop_udeg;
    d->mirror_counts_per_turn = setup.mirror_counts;
    d->pan_counts_per_turn = setup.pan_counts;
    d->range_scale_m = setup.range_scale_m;
    d->range_min_m = setup.range_min_m;
    d->range_max_m = setup.range_max_m;
    d->max_echoes = setup.max_echoes;
    d->n_surfaces = site->n_surfaces;
    d->frames = spec->frames;
    d->scan = scan->number;
    d->seed = cfg->noise.seed;
    d->content = cfg->output.attributes ? (uint32_t)NATIVE_HAS_ATTRIBUTES : 0;
    if (cfg->output.colour != COLOUR_NONE) d->content |= NATIVE_HAS_COLOURS;
    if (waves != 0) d->content |= NATIVE_HAS_WAVES;
    if (cfg->output.attributes && cfg->waveform.echoes != WAVE_ECHOES_MODEL) d->content |= NATIVE_HAS_DEVIATIONS;
}

_Static_assert((int)BEAM_ALL == (int)NATIVE_ECHOES_ALL && (int)BEAM_FIRST == (int)NATIVE_ECHOES_FIRST &&
                   (int)BEAM_LAST == (int)NATIVE_ECHOES_LAST && (int)BEAM_STRONGEST == (int)NATIVE_ECHOES_STRONGEST,
               "the stream numbers choices of echoes as heads do");
_Static_assert((int)GEOREF_LOCAL == (int)NATIVE_CRS_LOCAL && (int)GEOREF_ECEF == (int)NATIVE_CRS_ECEF &&
                   (int)GEOREF_UTM == (int)NATIVE_CRS_UTM && (int)GEOREF_GEODETIC == (int)NATIVE_CRS_GEODETIC,
               "the stream numbers coordinate reference systems as configurations do");

/* Uses the rate that is set: with a slow mirror the segment has another one. */
static void set_sequence(const struct device_scan *scan, struct native_emitter *e)
{
    struct schedule_spec spec = scan->segment.spec;
    struct schedule_segment seg;
    spec.prr_uhz = scan->prr_uhz;
    spec.lines_uhz = scan->lines_uhz;
    schedule_start(&seg, &spec);
    schedule_sequence_ns(&seg, &e->sequence_ns_num, &e->sequence_ns_den);
}

void device_fill_emitter(const struct device_scan *scan, uint32_t echoes, struct native_emitter *e,
                         struct native_beam *beam)
{
    const struct emitter *from = scan->segment.spec.emitter;
    memset(e, 0, sizeof *e);
    if (from == NULL) return;
    config_describe_emitter(from, e, beam);
    e->front_step = (int32_t)scan->segment.front_step;
    e->rings = from->rings;
    e->echoes = echoes;
    set_sequence(scan, e);
    if (from->kind == EMITTER_SPHERE) {
        e->first_ring_udeg = llround(360e6 * emitter_ring_turn(from, 0));
        e->gaps = from->rings != from->gaps + 1 ? from->gaps : 0;
    }
}

void device_fill_anchor(const struct site *site, uint32_t station, size_t stretch, struct native_anchor *a)
{
    const struct site_station *s = &site->station[station];
    const double *centre_m, *scale;
    const struct georef *georef = site_georef(site, station, stretch, &centre_m, &scale);
    memset(a, 0, sizeof *a);
    a->crs = site->cfg->output.crs;
    a->epsg = (uint32_t)georef_epsg(georef);
    a->station = station + 1;
    georef_anchor(georef, a->anchor);
    a->scale_m = site->scale_m;
    a->lat_deg = s->at.place.lat_deg;
    a->lon_deg = s->at.place.lon_deg;
    a->height_m = s->at.place.height_m;
    memcpy(a->station_m, s->at.position_m, sizeof a->station_m);
    memcpy(a->rotation, s->at.rotation, sizeof a->rotation);
    a->moving = site->moving ? NATIVE_MOVING : site->stop != NULL ? NATIVE_STOP : 0;
    a->frame = s->frame;
    memcpy(a->scale, scale, sizeof a->scale);
    georef_axes(georef, a->axes);
    const int64_t until_ms = s->on_stretch != NULL ? site->stretch[stretch].until_ns / 1000000 : INT64_MAX;
    if (until_ms <= UINT32_MAX) a->until_ms = (uint32_t)until_ms; /* later than 49 days: the next anchor ends it */
    a->heights = georef_has_geoid(georef) ? NATIVE_HEIGHTS_GEOID : NATIVE_HEIGHTS_ELLIPSOID;
}
