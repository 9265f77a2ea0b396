/* SPDX-License-Identifier: MIT */
/* The returns of a pulse with sub-rays, as waveforms take them: each by itself if they are few, else neighbours joined.
 * A joined return has the power, the mean range and the variance of those it stands for. */
#include <math.h>
#include <stdlib.h>

#include "core/cast/chunk.h"
#include "core/cast/waves.h"
#include "core/cast/sub_rays.h"
#include "tests/unit/cast_rig.h"

static struct caster *caster;
static struct waveform *waveform;
static struct cast_waves waves;
static struct cast_setup setup = {.range_min_m = 5, .range_max_m = 500, .waves = &waves};
static const struct chunk chunk = {.s = &setup, .n = 4};

static int set_up(void **state)
{
    (void)state;
    static const struct waveform_spec spec = {
        .shape = WAVEFORM_GAUSSIAN, .width_s = 4e-9, .sample_s = 1e-9, .bits = 12, .full_scale = 1000, .keep = 1};
    struct sh_err err;
    if (waveform_create(&spec, &waveform, &err) != 0 || caster_create(&caster, &err) != 0) return -1;
    waves.waveform = waveform;
    return caster_add_waves(caster, &err);
}

static int tear_down(void **state)
{
    (void)state;
    caster_free(caster);
    waveform_free(waveform);
    return 0;
}

/* Takes returns as those of a pulse, the first of a chunk. Returns how many parts it has. */
static uint32_t take(struct beam_return *r, uint32_t n)
{
    waves_begin(caster, &chunk);
    waves_take_returns(caster, &chunk, 2, r, n);
    const struct wave_work *w = caster->waves;
    assert_true(w->of[2].own == 1 && w->of[2].first == 0 && w->n_parts == w->of[2].n);
    assert_true(w->of[0].own == 0 && w->of[1].own == 0 && w->of[3].own == 0);
    return w->of[2].n;
}

static struct beam_return return_at(double range_m, uint32_t label)
{
    return (struct beam_return){
        .range_m = range_m, .energy = 0.5, .back = 0.01 * label, .label = label, .colour = ~label};
}

/* Up to 16 stay as they are, in their order. A return without depth is a point. Those out of range and those that send
 * nothing back are left out. */
static void few_stay_as_they_are(void **state)
{
    (void)state;
    struct beam_return r[20];
    uint32_t n = 0;
    for (uint32_t i = 1; i <= 16; i++) {
        if (i == 3) r[n++] = return_at(4.999, 90);
        if (i == 5) r[n++] = return_at(500.001, 91);
        if (i == 7) r[n++] = return_at(50, 0);
        r[n] = return_at(i == 1 ? 500 : i == 2 ? 5 : 100 + 1e-3 * (double)(i % 3), i);
        r[n++].sigma_m = i % 2 ? 0.0f : 0.25f;
    }
    assert_int_equal(take(r, n), 16);
    for (uint32_t i = 1; i <= 16; i++) {
        const struct wave_part *p = &caster->waves->part[i - 1];
        assert_true(p->range_m == (i == 1 ? 500 : i == 2 ? 5 : 100 + 1e-3 * (double)(i % 3)));
        assert_true(p->back == 0.01 * i && p->label == i && p->colour == ~i);
        assert_int_equal(p->spread, i % 2 ? WAVEFORM_POINT : WAVEFORM_BELL);
        assert_true(fabs(p->extent_m - (i % 2 ? 0 : 0.25)) < 1e-12);
    }
    assert_int_equal(take(r, 0), 0);
}

/* Two groups of returns lie 2 m apart, in any order. Within a group none is further from the first one than a sixteenth
 * of the pulse's integral, 4.26 ns for a Gaussian of 4 ns: 40 mm. */
static void many_are_joined(void **state)
{
    (void)state;
    struct beam_return r[18];
    double back[2] = {0}, first[2] = {0}, second[2] = {0};
    for (uint32_t i = 0; i < 18; i++) {
        const uint32_t group = i % 2;
        const double off_m = 0.004 * (i / 2);
        r[i] = return_at(100 + 2.0 * group + off_m, 1 + (i * 7) % 18);
        r[i].sigma_m = 0.125f * (float)group;
        back[group] += r[i].back;
        first[group] += r[i].back * off_m;
        second[group] += r[i].back * (off_m * off_m + 0.015625 * group);
    }
    assert_int_equal(take(r, 18), 2);
    for (uint32_t group = 0; group < 2; group++) {
        const struct wave_part *p = &caster->waves->part[group];
        const double mean_m = first[group] / back[group];
        assert_true(fabs(p->back - back[group]) < 1e-12);
        assert_true(fabs(p->range_m - (100 + 2.0 * group + mean_m)) < 1e-10);
        assert_true(fabs(p->extent_m - sqrt(second[group] / back[group] - mean_m * mean_m)) < 1e-10);
        assert_int_equal(p->spread, WAVEFORM_BELL);
        /* the strongest of the even and of the odd ones: labels 1 + 7 i mod 18 */
        assert_int_equal(p->label, group ? 18 : 17);
        assert_true(p->colour == ~p->label);
    }
}

/* A group ends a sixteenth of the pulse's integral after its first return: 4 ns sqrt(pi / (4 ln 2)) c / 32 = 39.89 mm.
 */
static void groups_are_short(void **state)
{
    (void)state;
    for (int beyond = 0; beyond < 2; beyond++) {
        struct beam_return r[17];
        for (uint32_t i = 0; i < 17; i++)
            r[i] = return_at(100 + (i < 16 ? 0.001 * i : beyond ? 0.03993 : 0.03985), i + 1);
        assert_int_equal(take(r, 17), 1 + beyond);
    }
    /* The third return begins the next group where each comes 30 mm after the one before. */
    struct beam_return r[60];
    for (uint32_t i = 0; i < 60; i++)
        r[i] = return_at(100 + 0.03 * i, 1);
    assert_int_equal(take(r, 60), 30);
}

/* A pulse has up to 64 parts. With more, groups are twice as long until they are few enough. They keep all power. */
static void groups_grow_until_there_is_room(void **state)
{
    (void)state;
    static const struct {
        uint32_t n;
        double step_m;
        uint32_t groups;
    } is[] = {{64, 1.0, 64}, {65, 0.05, 33}, {128, 0.05, 64}, {130, 0.05, 33}, {200, 0.3, 40}};
    /* 79.8 mm hold two returns 50 mm apart, 160 mm hold four; 1.28 m hold five returns 0.3 m apart, 0.64 m three. */
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++) {
        struct beam_return r[200];
        double sum = 0;
        for (uint32_t k = 0; k < is[i].n; k++)
            r[k] = return_at(100 + is[i].step_m * k, 2);
        const uint32_t groups = take(r, is[i].n);
        if (groups != is[i].groups) fail_msg("%u returns: %u groups", is[i].n, groups);
        for (uint32_t k = 0; k < groups; k++)
            sum += caster->waves->part[k].back;
        assert_true(fabs(sum - 0.02 * is[i].n) < 1e-12);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(few_stay_as_they_are),
        cmocka_unit_test(many_are_joined),
        cmocka_unit_test(groups_are_short),
        cmocka_unit_test(groups_grow_until_there_is_room),
    };
    return cmocka_run_group_tests_name("returns of a pulse", tests, set_up, tear_down);
}
