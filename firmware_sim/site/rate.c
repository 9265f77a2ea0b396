/* SPDX-License-Identifier: MIT */
#include "firmware_sim/site/plan_rows.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "core/rng.h"
#include "drivers/protocol/native_encode.h"
#include "firmware_sim/base/clock.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/site/look.h"
#include "firmware_sim/site/waves.h"

/* Processor time for warming the caches, and for measuring. Runs are short, so that even a run of the most expensive
 * pulses (1,027 sub-rays each) ends within a few milliseconds. */
static const int64_t WARM_NS = 2000000, MEASURE_NS = 6000000;
enum { RUN = 64, TRIES = 4096, LEAST_RUNS = 2, MOST_RUNS = 4096 };
enum { MAX_DT_NS = (1 << 24) - 1 };   /* a point's time within its frame has 24 bits */
static const double MOST_SHARE = 0.8; /* above it a run gets a warning */

struct rate {
    double pulse_ns;          /* processor time for one cast pulse; NaN: no pulse is cast */
    double fired_hz, cast_hz; /* of the configured rate: with the blind part of the sweep, and without */
    unsigned processors;      /* processors that casting threads run on */
    double share;             /* share of these processors that cast_hz needs; 1: all of their time */
};

struct gauge {
    struct site_look look;
    struct caster *caster;
    struct line_block block;
    uint8_t *frame;
    size_t frame_bytes;
    uint64_t key, drawn;
    uint64_t fired, cast; /* pulses of the lines that were drawn */
};

static int open_gauge(struct gauge *g, const struct site *site, struct sh_err *err)
{
    const uint32_t n_points = RUN * site_points_per_pulse(site);
    *g = (struct gauge){.key = rng_key(1, RNG_PLAN)};
    site_look_open(&g->look, site);
    const struct site_wave_room room = site_wave_room(site, RUN);
    g->frame_bytes = native_points_bound(n_points) + native_attributes_bound(n_points) +
                     native_colours_bound(n_points) + native_waves_bound(n_points, room.windows, room.samples);
    g->frame = malloc(g->frame_bytes);
    int rc = g->frame != NULL ? caster_create(&g->caster, err) : sh_fail(err, SH_ENOMEM, "no memory");
    return rc == SH_OK ? site_make_block(site, RUN, n_points, g->caster, &g->block, err) : rc;
}

static void close_gauge(struct gauge *g)
{
    caster_free(g->caster);
    line_block_free(&g->block);
    free(g->frame);
}

/* Draws some pulses of a line, within the part that is cast. Returns 0 where none is found. */
static int draw(struct gauge *g, struct plan_place **place, struct schedule_run *run)
{
    for (int i = 0; i < TRIES; i++) {
        struct plan_place *p = *place = &g->look.place[g->drawn % g->look.n];
        uint64_t number = rng_u64(g->key, g->drawn++), k = p->segment.k0 + number % p->pulses;
        struct schedule_line line;
        schedule_get_line(&p->segment, schedule_line_of(&p->segment, k), &line);
        g->fired += line.pulse_end - line.pulse0;
        if (line.cast0 >= line.cast_end) continue;
        uint64_t n = line.cast_end - line.cast0, first = line.cast0 + number % n;
        g->cast += n;
        uint64_t room = schedule_longest_run(&p->segment, MAX_DT_NS), left = line.cast_end - first;
        if (left > room) left = room > 1 ? room : 1;
        schedule_get_run(&p->segment, &line, first, (uint32_t)(left < RUN ? left : RUN), run);
        return 1;
    }
    return 0;
}

static uint32_t cast(struct gauge *g)
{
    struct plan_place *place;
    struct schedule_run run;
    if (!draw(g, &place, &run)) return 0;
    if (place->enter != NULL) place->enter(place->ctx, run.t0_ns, &place->setup);
    caster_cast(g->caster, &place->setup, &run, &g->block);
    native_encode_points(g->frame, g->frame_bytes, &g->block, 0);
    return run.n;
}

/* Processor time per pulse; NaN where none is cast. */
static double measure_ns(struct gauge *g)
{
    int64_t begin_ns = clock_thread_ns(), spent_ns = 0;
    for (uint32_t n = 1; n != 0 && spent_ns < WARM_NS; spent_ns = clock_thread_ns() - begin_ns)
        n = cast(g);
    uint64_t pulses = 0;
    begin_ns = clock_thread_ns();
    spent_ns = 0;
    for (uint32_t i = 0, n = 1; n != 0 && i < MOST_RUNS && (i < LEAST_RUNS || spent_ns < MEASURE_NS); i++) {
        pulses += n = cast(g);
        spent_ns = clock_thread_ns() - begin_ns;
    }
    return pulses != 0 ? (double)spent_ns / (double)pulses : (double)NAN;
}

static int measure_rate(const struct site *site, struct rate *rate, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    struct gauge g;
    long online = sysconf(_SC_NPROCESSORS_ONLN);
    unsigned threads = cfg->loop.threads, processors = online > 0 ? (unsigned)online : 1;
    *rate = (struct rate){.fired_hz = 1e-6 * (double)cfg->head.settings.prr_uhz,
                          .processors = threads != 0 && threads < processors ? threads : processors};
    int rc = open_gauge(&g, site, err);
    if (rc == SH_OK) {
        rate->pulse_ns = measure_ns(&g);
        rate->cast_hz = rate->fired_hz * (double)g.cast / (double)g.fired;
        if (!isnan(rate->pulse_ns)) rate->share = rate->cast_hz * 1e-9 * rate->pulse_ns / rate->processors;
    }
    close_gauge(&g);
    return rc;
}

int site_rate_row(const struct site *site, struct plan_row *row, struct sh_err *err)
{
    char why[sizeof row->why];
    struct rate rate;
    int rc = measure_rate(site, &rate, err);
    if (rc != SH_OK) return rc;
    if (isnan(rate.pulse_ns))
        snprintf(why, sizeof why, "no pulse of the configured sweep is cast");
    else
        snprintf(
            why, sizeof why,
            "%u processor%s compute%s %.3g million pulses/s; the configuration has %.3g million/s; %.3g million of "
            "them are cast and need %.3g %% of the processor time",
            rate.processors, rate.processors > 1 ? "s" : "", rate.processors > 1 ? "" : "s",
            1e3 * rate.processors / rate.pulse_ns, 1e-6 * rate.fired_hz, 1e-6 * rate.cast_hz, 100.0 * rate.share);
    plan_say(row, "total", "measured", (double)NAN, rate.pulse_ns, why);
    row->echo_share = (double)NAN;
    return SH_OK;
}

int site_warn_rate(const struct site *site, const struct sh_report *report, struct sh_err *err)
{
    struct rate rate;
    if (site->cfg->loop.pace != PACE_REALTIME) return SH_OK;
    int rc = measure_rate(site, &rate, err);
    if (rc == SH_OK && rate.share > MOST_SHARE)
        sh_warn(
            report,
            "%s: head.prr_hz: casting %.3g million pulses/s needs about %.0f %% of %u processors: pulses may be lost; "
            "this machine computes up to %.3g million/s",
            site->cfg->file, 1e-6 * rate.cast_hz, 100.0 * rate.share, rate.processors,
            1e3 * rate.processors / rate.pulse_ns);
    return rc;
}
