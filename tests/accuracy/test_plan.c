/* SPDX-License-Identifier: MIT */
/* Plans against the reference. A configuration's run, with the methods that the plan chose, keeps the plan's figures,
 * on pulses that the plan has not looked at. Footprints are compared with 1,000 sub-rays on a spiral, each cast by
 * itself. All else is compared with a run that takes the deepest way through glass and georeferences point by
 * point. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "firmware_sim/config/config.h"
#include "firmware_sim/config/load.h"
#include "firmware_sim/site/plan_rows.h"
#include "tests/common/aimed.h"
#include "tests/common/beam_reference.h"
#include "tests/common/made.h"
#include "tests/common/thorough.h"

/* SH_SANITIZE: sanitizers are for the code, not for the count. */
#ifdef SH_SANITIZE
#define RUNS 60u
#else
#define RUNS ((uint32_t)thorough(300, 60))
#endif
enum { RUN = 16, ROOM = RUN * (LINE_MAX_ECHOES + 1) };

struct side {
    struct config *cfg;
    struct site *site;
    struct caster *caster;
    struct line_block block;
    struct schedule_segment segment;
};

static void open_side(struct side *side, const char *file, const char *const *sets, int n)
{
    struct sh_err err;
    struct schedule_spec spec;
    struct head_settings settings;
    side->cfg = calloc(1, sizeof *side->cfg);
    if (config_load(file, sets, n, side->cfg, &err) != SH_OK ||
        site_load(side->cfg, NULL, &side->site, &err) != SH_OK || caster_create(&side->caster, &err) != SH_OK ||
        line_block_alloc(&side->block, ROOM, &err) != SH_OK)
        fail_msg("%s", err.text);
    settings = side->cfg->head.settings;
    settings.frames = 1;
    config_fill_spec(&side->cfg->profile, &settings, &spec);
    schedule_start(&side->segment, &spec);
}

static void close_side(struct side *side)
{
    line_block_free(&side->block);
    caster_free(side->caster);
    site_free(side->site);
    free(side->cfg);
}

/* Pulses are spread evenly over the frame, by the golden ratio. Returns 0 for one outside of the field of view. */
static int get_run(const struct side *side, uint32_t j, struct schedule_run *run)
{
    double share = fmod((j + 0.5) * 0.6180339887498949, 1.0);
    uint64_t k = (uint64_t)(share * (double)side->segment.end_pulse);
    struct schedule_line line;
    schedule_get_line(&side->segment, schedule_line_of(&side->segment, k), &line);
    if (k < line.cast0 || k + RUN > line.cast_end) return 0;
    schedule_get_run(&side->segment, &line, k, RUN, run);
    return 1;
}

/* Casts the run as scans of the site do, but with ranges in micrometres and without noise: the plan is not about
 * these. */
static const struct line_block *cast(struct side *side, uint32_t station, const struct schedule_run *run,
                                     enum line_layout layout, double scale[3])
{
    struct cast_setup setup;
    struct cast_detect detect;
    site_cast_setup(side->site, station, &setup);
    const struct plan_methods *methods = &side->site->plan.methods;
    assert_true(methods->beam == BEAM_SINGLE ? setup.beam == NULL : setup.beam->mode == methods->beam);
    setup.layout = layout;
    setup.noise_on = 0;
    if (layout == LINE_POLAR) setup.range_scale_m = 1e-6;
    if (setup.detect != NULL) {
        detect = *setup.detect;
        detect.noise_by_signal = 0;
        setup.detect = &detect;
    }
    if (scale != NULL) memcpy(scale, setup.xyz_scale, sizeof setup.xyz_scale);
    caster_cast(side->caster, &setup, run, &side->block);
    return &side->block;
}

struct tally {
    uint64_t pulses, wrong, several;
    double echoes, sum2, sum4;
};

static void add(struct tally *t, double off)
{
    t->echoes += 1.0;
    t->sum2 += off * off;
    t->sum4 += off * off * off * off;
}

/* If the true share is p, a sample of n may have up to p + 3 sqrt(p / n), which is exceeded one time in a thousand. Its
 * mean square may be up to two standard errors larger. */
static void expect_within(const char *what, const struct tally *t, const struct plan_row *row, const struct config *cfg)
{
    double n = (double)t->pulses, wrong = (double)t->wrong / n, rms = sqrt(t->sum2 / t->echoes);
    printf("# %s: %llu pulses, %.2f %% with several echoes; %s promises %.2g m, %.3g %%; found %.2g m, %.3g %%\n", what,
           (unsigned long long)t->pulses, 100.0 * (double)t->several / n, row->method, row->error_m,
           100.0 * row->echo_share, rms, 100.0 * wrong);
    assert_true(t->pulses >= RUNS);
    assert_true(wrong <= row->echo_share + 3.0 * sqrt(row->echo_share / n));
    assert_true(t->sum2 - 2.0 * sqrt(t->sum4) <= row->error_m * row->error_m * t->echoes + 1e-12 * t->echoes);
    assert_true(wrong <= cfg->plan.echo_share + 3.0 * sqrt(cfg->plan.echo_share / n));
    assert_true(rms <= cfg->plan.range_m);
}

static void compare_beam(struct side *side, uint32_t station, const struct schedule_run *run, const struct beam *beam,
                         struct tally *t)
{
    const struct config_profile *p = &side->cfg->profile;
    const struct line_block *b = cast(side, station, run, LINE_POLAR, NULL);
    struct cast_setup setup;
    double d[3][RUN];
    site_cast_setup(side->site, station, &setup);
    aimed_directions(run, setup.rotation, &(struct vec3_out){d[0], d[1], d[2]});
    for (uint32_t i = 0, at = 0; i < RUN; i++) {
        struct beam_ref ref;
        const double dir[3] = {d[0][i], d[1][i], d[2][i]};
        beam_ref_pulse(side->caster, setup.bvh, beam, setup.station_m, dir, p->range_max_m, &ref);
        uint32_t first = at, n = b->echo[at] >> 4, kept = 0;
        at += n > 1 ? n : 1;
        for (uint32_t k = 0; k < ref.n; k++)
            if (ref.echo[k].range_m >= p->range_min_m && ref.echo[k].range_m <= p->range_max_m)
                ref.echo[kept++] = ref.echo[k];
        t->pulses++;
        t->wrong += kept != n;
        t->several += kept > 1;
        for (uint32_t k = 0; k < n && n == kept; k++)
            add(t, 1e-6 * b->a[first + k] - ref.echo[k].range_m);
    }
}

static void check_beam(const char *file, struct side *side)
{
    const struct config_profile *p = &side->cfg->profile;
    struct tally t = {0};
    struct beam beam;
    struct schedule_run run;
    beam_init(&beam, p->beam_exit_m, p->beam_divergence_rad, 1e-9 * p->pulse_width_ns);
    for (uint32_t j = 0; j < RUNS * 3; j++)
        if (get_run(side, j, &run)) compare_beam(side, j % side->site->n_stations, &run, &beam, &t);
    expect_within(file, &t, &side->site->plan.beam, side->cfg);
}

/* Footprints and detection work together, so the reference has 1,027 sub-rays, too. */
enum { JOINED = 1 };

/* Compares echoes with those of the deepest way through glass. */
static void check_optics(const char *file, struct side *side, struct side *reference)
{
    struct tally t = {0};
    struct schedule_run run;
    struct plan_row both = side->site->plan.optics;
    if (JOINED) both.error_m += side->site->plan.beam.error_m;
    if (JOINED) both.echo_share += side->site->plan.beam.echo_share;
    for (uint32_t j = 0; j < RUNS * (JOINED ? 1 : 3); j++) {
        if (!get_run(side, j, &run)) continue;
        uint32_t station = j % side->site->n_stations;
        const struct line_block *a = cast(side, station, &run, LINE_POLAR, NULL);
        const struct line_block *b = cast(reference, station, &run, LINE_POLAR, NULL);
        for (uint32_t i = 0, at = 0, bt = 0; i < RUN; i++) {
            uint32_t n = a->echo[at] >> 4, want = b->echo[bt] >> 4;
            for (uint32_t k = 0; k < n && n == want; k++)
                add(&t, 1e-6 * ((double)a->a[at + k] - (double)b->a[bt + k]));
            t.pulses++;
            t.wrong += n != want;
            t.several += want > 1;
            at += n > 1 ? n : 1;
            bt += want > 1 ? want : 1;
        }
    }
    expect_within(file, &t, &both, side->cfg);
}

/* Compares positions of pulses with the same echoes. Two counts are each rounded, and the order of surfaces may move a
 * range. */
static void check_positions(struct side *side, struct side *reference)
{
    const struct plan_row *row = &side->site->station[0].plan;
    double most = 0.0, bound = row->error_m, scale[3], other[3];
    uint64_t points = 0;
    struct schedule_run run;
    for (uint32_t i = 0; i < side->site->n_stations; i++)
        bound = fmax(bound, side->site->station[i].plan.error_m);
    for (uint32_t j = 0; j < RUNS; j++) {
        if (!get_run(side, j, &run)) continue;
        uint32_t station = j % side->site->n_stations;
        const struct line_block *a = cast(side, station, &run, LINE_GEO, scale);
        const struct line_block *b = cast(reference, station, &run, LINE_GEO, other);
        if (a->n_points != b->n_points || memcmp(a->echo, b->echo, a->n_points) != 0) continue;
        for (uint32_t i = 0; i < a->n_points; i++) {
            if (a->echo[i] == 0 || a->label[i] != b->label[i]) continue;
            const uint32_t *p[3] = {a->a, a->b, a->c}, *q[3] = {b->a, b->b, b->c};
            for (int k = 0; k < 3; k++)
                most = fmax(most, fabs(scale[k] * (int32_t)p[k][i] - other[k] * (int32_t)q[k][i]));
            points++;
        }
    }
    printf("# %s: %llu points, georef %s promises %.2g m, found %.2g m, counts of %.2g m\n", side->cfg->file,
           (unsigned long long)points, row->method, bound, most, side->site->scale_m);
    assert_true(points > RUNS);
    assert_true(bound <= side->cfg->output.tolerance_m);
    assert_true(most <= bound + 1.001 * side->site->scale_m);
}

static void check_plan(const char *file, int footprint, int georeferenced)
{
    static const char *const best[] = {"optics.depth=4", "output.georef=exact",
                                       "beam.mode=single", /* footprints have their own reference */
                                       "beam.mode=rings", "beam.rings=18"};
    struct side side, reference;
    open_side(&side, file, NULL, 0);
    open_side(&reference, file, best, 3);
    if (footprint) check_beam(file, &side);
    if (georeferenced) check_positions(&side, &reference);
    close_side(&reference);
    if (side.site->plan.methods.depth > 0) {
        open_side(&reference, file, best, JOINED ? 5 : 3);
        check_optics(file, &side, &reference);
        close_side(&reference);
    }
    close_side(&side);
}

static void test_demo(void **state)
{
    (void)state;
    static const char file[] = "/usr/share/assimp/models/IFC/AC14-FZK-Haus.ifc";
    if (access(file, R_OK) != 0) {
        printf("# %s is not there: package assimp-testmodels\n", file);
        skip();
    }
    check_plan("config/demo.yaml", 1, 1);
}

static void test_foliage(void **state)
{
    (void)state;
    check_plan("config/foliage.yaml", 1, 0);
}

static void test_glass(void **state)
{
    (void)state;
    check_plan("config/glass.yaml", 0, 1);
}

/* Returns where just 1 % of the energy is on the edge's far side, in radii from the centre. */
static double threshold(const struct beam *beam)
{
    double low = 0.0, high = 1.0, energy, moment;
    for (int i = 0; i < 60; i++) {
        double h = 0.5 * (low + high);
        beam_half(beam, h, &energy, &moment);
        *(energy > BEAM_LEAST_ENERGY ? &low : &high) = h;
    }
    return low;
}

/* A step of more than the resolution gives two echoes where both sides have 1 %: a strip of known width, in a view of
 * known width. A single ray is wrong in the whole strip. The plan's figure is an upper limit, the sample's share plus
 * 1.645 standard errors. The sample is within three standard errors of the strip's share, so the figure is 1.4 of
 * them below it to 4.7 above. The adaptive beam finds the strip. */
static void test_figures(void **state)
{
    (void)state;
    static const double range_m = 20.0, pan_deg = 0.5;
    const struct beam_view view = {-1.0, 1.0, -0.5, 0.5, 1000, 1000};
    struct beam_rig rig;
    struct sh_err err;
    struct plan_sample *sample;
    struct plan_option single, adaptive, rings;
    made_beam_rig(&rig, made_door(1.0), &view);
    const struct beam *beam = &rig.beam.beam;
    double strip = threshold(beam) * beam_radius(beam, range_m) / range_m, share = strip / (pan_deg * M_PI / 180.0);
    struct plan_place place = {
        .setup = rig.setup, .beam = &rig.beam, .segment = rig.segment, .pulses = view.lines * view.pulses};
    assert_int_equal(plan_sample_create(&(struct plan_places){&place, 1}, NULL, &sample, &err), SH_OK);
    plan_beam_option(BEAM_SINGLE, 0, &single);
    plan_sample_beam(sample, &single);
    plan_beam_option(BEAM_ADAPTIVE, 4, &adaptive);
    plan_sample_beam(sample, &adaptive);
    plan_beam_option(BEAM_RINGS, 2, &rings);
    plan_sample_beam(sample, &rings);
    double sigma = sqrt(share / 32768.0);
    printf(
        "# a step: two echoes in %.3f %% of the pulses; single rays are wrong in %.3f %%, 19 sub-rays in %.3f %%, the "
        "adaptive beam in %.3f %%\n",
        100.0 * share, 100.0 * single.echo_share, 100.0 * rings.echo_share, 100.0 * adaptive.echo_share);
    assert_true(single.echo_share > share - 1.4 * sigma && single.echo_share < share + 4.7 * sigma);
    assert_true(single.error_m < 1e-4); /* away from the strip it is right, but for less than 1 % of a metre's step */
    assert_true(rings.echo_share < single.echo_share && adaptive.echo_share < rings.echo_share);
    assert_true(adaptive.echo_share < 1e-3);
    assert_true(adaptive.cost_ns > 0.0 && adaptive.cost_ns < 100.0);
    plan_sample_free(sample);
    beam_rig_close(&rig);
}

/* A step of 4 mm gives one echo, at the mean over both sides. If a share E of the energy lies beyond the edge, a
 * single ray is wrong by E steps, so the mean square is known. All pulses in the strip count as those that meet more
 * than one smooth surface, so the plan looks at each. The plan's figure is 3 standard errors above the mean square that
 * it finds, which scatters by one. So the figure is 0 to 6 standard errors above the true one. A plan that looked at
 * one pulse in 32 would be 17 above it. */
static void test_small_steps(void **state)
{
    (void)state;
    static const double range_m = 20.0, pan_deg = 0.5, step_m = 0.004;
    enum { PARTS = 1000, DRAWN = 32768 };
    const struct beam_view view = {-1.0, 1.0, -0.5, 0.5, 1000, 1000};
    struct beam_rig rig;
    struct sh_err err;
    struct plan_sample *sample;
    struct plan_option single;
    double sum2 = 0.0, sum4 = 0.0, energy, moment;
    made_beam_rig(&rig, made_door(step_m), &view);
    const struct beam *beam = &rig.beam.beam;
    for (int i = 0; i < PARTS; i++) {
        beam_half(beam, (i + 0.5) / PARTS, &energy, &moment);
        sum2 += pow(energy * step_m, 2.0) / PARTS;
        sum4 += pow(energy * step_m, 4.0) / PARTS;
    }
    /* of all pulses, that share is within a radius of the edge */
    const double share = beam_radius(beam, range_m) / range_m / (pan_deg * M_PI / 180.0);
    const double mean2 = share * sum2, sigma = sqrt(share * sum4 / DRAWN);
    struct plan_place place = {
        .setup = rig.setup, .beam = &rig.beam, .segment = rig.segment, .pulses = view.lines * view.pulses};
    assert_int_equal(plan_sample_create(&(struct plan_places){&place, 1}, NULL, &sample, &err), SH_OK);
    plan_beam_option(BEAM_SINGLE, 0, &single);
    plan_sample_beam(sample, &single);
    const double above = (single.error_m * single.error_m - mean2) / sigma;
    printf("# a step of 4 mm: single rays are wrong by %.3f mm RMS, said %.3f mm: %.2f standard errors above\n",
           1e3 * sqrt(mean2), 1e3 * single.error_m, above);
    assert_true(above > 0.0 && above < 6.0);
    plan_sample_free(sample);
    beam_rig_close(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_figures), cmocka_unit_test(test_small_steps), cmocka_unit_test(test_demo),
        cmocka_unit_test(test_foliage), cmocka_unit_test(test_glass),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
