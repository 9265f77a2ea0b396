/* SPDX-License-Identifier: MIT */
/* Blocks with and without a sight are the same, byte by byte, whatever else a setup has. So are those with and without
 * hits that were found ahead. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/rng.h"
#include "tests/accuracy/seen_room.h"
#include "tests/common/thorough.h"

enum { PULSES = ROOM_LINES * ROOM_PULSES };

/* The settings of a setup beside rays. */
struct asked {
    struct instrument instrument;
    struct detect_signal signal;
    struct detect_ball ball;
    struct cast_detect detect;
    struct pose_knot knot[3];
};

static void plain(struct seen_room *r, struct cast_setup *s, struct asked *a)
{
    (void)r, (void)s, (void)a;
}

static void geo(struct seen_room *r, struct cast_setup *s, struct asked *a)
{
    (void)r, (void)a;
    s->layout = LINE_GEO;
}

static void noise(struct seen_room *r, struct cast_setup *s, struct asked *a)
{
    (void)r, (void)a;
    s->noise_on = 1;
    s->range_sigma_m = 0.003;
    s->range_sigma_ppm = 10.0;
    s->noise_key = rng_key(1, RNG_RANGE);
}

static void short_range(struct seen_room *r, struct cast_setup *s, struct asked *a)
{
    (void)r, (void)a;
    s->range_min_m = 1.8;
    s->range_max_m = 4.0;
}

static void signal(struct seen_room *r, struct cast_setup *s, struct asked *a)
{
    const struct detect_signal_spec spec = {.n_reaches = 1,
                                            .reach = {{0.2, 5.0}},
                                            .threshold_snr = 8.0,
                                            .sigma_m = 0.002,
                                            .sigma_at_m = 4.0,
                                            .sigma_reflectance = 0.5,
                                            .seed = 5};
    struct sh_err err;
    assert_int_equal(detect_signal_set_up(&spec, &a->signal, &err), 0);
    a->detect = (struct cast_detect){.surfaces = &r->table,
                                     .signal = &a->signal,
                                     .noise_by_signal = 1,
                                     .ghost_label = ROOM_LABELS,
                                     .max_echoes = 4,
                                     .ambiguity = DETECT_FOLDED};
    s->detect = &a->detect;
}

/* The axes are bent and their noise is on; beams begin at the station. */
static void bent(struct seen_room *r, struct cast_setup *s, struct asked *a)
{
    (void)r;
    a->instrument = (struct instrument){.collimation_rad = 2e-3,
                                        .trunnion_rad = -1e-3,
                                        .mirror = {.index_rad = 1e-3, .eccentricity_rad = 5e-4},
                                        .pan = {.scale = 1e-5},
                                        .range_offset_m = 0.01,
                                        .mirror_sigma_rad = 1e-3,
                                        .pan_sigma_rad = 1e-3,
                                        .mirror_key = 7,
                                        .pan_key = 9};
    a->detect = (struct cast_detect){.instrument = &a->instrument, .max_echoes = 1};
    s->detect = &a->detect;
    s->layout = LINE_GEO;
}

static void offset(struct seen_room *r, struct cast_setup *s, struct asked *a)
{
    bent(r, s, a);
    a->instrument.transit_offset_m = 0.02;
}

static void optics(struct seen_room *r, struct cast_setup *s, struct asked *a)
{
    a->detect = (struct cast_detect){.surfaces = &r->table,
                                     .depth = CAST_MAX_DEPTH,
                                     .ghost_label = ROOM_LABELS,
                                     .max_echoes = 3,
                                     .separation_m = 0.5};
    s->detect = &a->detect;
}

static void optics_short(struct seen_room *r, struct cast_setup *s, struct asked *a)
{
    optics(r, s, a);
    short_range(r, s, a);
}

static void ball(struct seen_room *r, struct cast_setup *s, struct asked *a)
{
    (void)r;
    a->ball = (struct detect_ball){.radius_m = 0.01, .factor = {1.0, 2.0, 0.5}};
    detect_ball_keys(&a->ball, 11);
    a->detect = (struct cast_detect){.ball = &a->ball, .max_echoes = 1};
    s->detect = &a->detect;
}

/* Two bodies that hide each other and some of the room, turned. */
static void movers(struct seen_room *r, struct cast_setup *s, struct asked *a)
{
    (void)a;
    s->n_movers = 2;
    for (int k = 0; k < 2; k++) {
        struct cast_mover *m = &s->mover[k];
        double turned[3];
        m->bvh = r->body;
        for (int i = 0; i < 3; i++)
            m->centre_m[i] = s->station_m[i] + 0.4 * (i != 1) + 0.25 * (i == 1);
        m->radius_m = 1.0;
        pose_heading(0.5 + k, m->rotation);
        for (int i = 0; i < 3; i++) {
            turned[i] = 0.0;
            for (int j = 0; j < 3; j++)
                turned[i] += m->rotation[3 * i + j] * m->centre_m[j];
            m->shift_m[i] = m->centre_m[i] + (i == k ? 1.9 : 0.4) - turned[i];
        }
    }
}

static void movers_and_optics(struct seen_room *r, struct cast_setup *s, struct asked *a)
{
    optics(r, s, a);
    movers(r, s, a);
}

/* A head that moves has no sight. A sight that is given is not asked. */
static void moving(struct seen_room *r, struct cast_setup *s, struct asked *a)
{
    (void)r;
    for (int k = 0; k < 3; k++) {
        a->knot[k] = (struct pose_knot){.t_ns = 120000000 * (int64_t)k};
        memcpy(a->knot[k].pose.position_m, s->station_m, sizeof s->station_m);
        a->knot[k].pose.position_m[0] += 0.2 * k;
        pose_from_angles(0.3 * k, 0.0, 0.1 * k, a->knot[k].pose.quat);
    }
    s->n_knots = 3;
    s->knot = a->knot;
}

static void adaptive(struct seen_room *r, struct cast_setup *s, struct asked *a)
{
    (void)a;
    s->beam = &r->beam;
    s->pulse_m = r->beam.beam.resolution_m;
}

static void adaptive_short(struct seen_room *r, struct cast_setup *s, struct asked *a)
{
    adaptive(r, s, a);
    short_range(r, s, a);
}

static void adaptive_signal(struct seen_room *r, struct cast_setup *s, struct asked *a)
{
    adaptive(r, s, a);
    signal(r, s, a);
    noise(r, s, a);
    s->layout = LINE_GEO;
}

static void adaptive_optics(struct seen_room *r, struct cast_setup *s, struct asked *a)
{
    adaptive(r, s, a);
    optics(r, s, a);
    bent(r, s, a);
    a->detect.surfaces = &r->table;
    a->detect.depth = 2;
    a->detect.ghost_label = ROOM_LABELS;
    a->detect.max_echoes = 4;
}

static void rings(struct seen_room *r, struct cast_setup *s, struct asked *a)
{
    adaptive(r, s, a);
    r->beam.mode = BEAM_RINGS;
}

struct variant {
    const char *name;
    void (*ask)(struct seen_room *room, struct cast_setup *setup, struct asked *asked);
    int from_station; /* rays begin there, at least those of the pulses' centres */
};
static const struct variant VARIANTS[] = {{"plain", plain, 1},
                                          {"geo", geo, 1},
                                          {"noise", noise, 1},
                                          {"short range", short_range, 1},
                                          {"signal", signal, 1},
                                          {"bent axes", bent, 1},
                                          {"offset", offset, 0},
                                          {"optics", optics, 1},
                                          {"optics, short range", optics_short, 1},
                                          {"ball", ball, 1},
                                          {"movers", movers, 1},
                                          {"movers and optics", movers_and_optics, 1},
                                          {"moving", moving, 0},
                                          {"adaptive", adaptive, 1},
                                          {"adaptive, short range", adaptive_short, 1},
                                          {"adaptive, signal", adaptive_signal, 1},
                                          {"adaptive, optics", adaptive_optics, 1},
                                          {"rings", rings, 0}};

static void compare(struct seen_room *r, const struct variant *v)
{
    struct asked asked;
    struct cast_counters before, after;
    struct cast_setup without = r->setup, with;
    memset(&asked, 0, sizeof asked);
    r->beam.mode = BEAM_ADAPTIVE;
    v->ask(r, &without, &asked);
    with = without;
    with.sight = r->sight;
    caster_get_counters(r->caster[1], &before);
    uint64_t echoes = seen_room_compare(r, &without, &with);
    caster_get_counters(r->caster[1], &after);
    const double few = (double)(after.few - before.few) / PULSES, ask = (double)(after.asked - before.asked) / PULSES;
    printf("%-22s %6.3f echoes a pulse; few %.3f, asked %.3f\n", v->name, (double)echoes / PULSES, few, ask);
    assert_true(echoes > PULSES / 20);
    if (!v->from_station) assert_true(few == 0.0 && ask == 0.0);
    if (v->from_station) assert_true(few > 0.05 && few + ask < 0.4); /* most see one triangle */
    assert_int_equal(seen_room_compare_ahead(r, &without), v->from_station);
}

static void everything_the_same(void **state)
{
    static const double places[3][3] = {{0.0, 0.0, 0.0}, {12.25, -3.1, 0.7}, {413021.37, 5812345.11, 34.2}};
    (void)state;
    const size_t step = (size_t)thorough(1, 3); /* all variants at each place, or one place each */
    for (size_t k = 0; k < 3; k++) {
        struct seen_room *r = malloc(sizeof *r);
        assert_non_null(r);
        seen_room_open(r, 20 + k, places[k]);
        for (size_t v = k % step; v < sizeof VARIANTS / sizeof VARIANTS[0]; v += step)
            compare(r, &VARIANTS[v]);
        seen_room_close(r);
        free(r);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(everything_the_same)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
