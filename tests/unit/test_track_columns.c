/* SPDX-License-Identifier: MIT */
/* The columns of a batch, which recorders share, beside the plain formulas: seconds, places, and points that are left
 * out. */
#include "tests/common/cases.h"

#include <math.h>
#include <string.h>

#include "drivers/record/station_pose.h"
#include "drivers/record/track.h"

static struct track track;

static void expect_seconds(void)
{
    static double seen[TRACK_BATCH];
    track_seconds(&track, TRACK_BATCH, seen);
    for (int i = 0; i < TRACK_BATCH; i++)
        if (seen[i] != (double)track.points.t_ns[i] / 1e9)
            fail_msg("%lld ns: %a s", (long long)track.points.t_ns[i], seen[i]);
}

/* Vectors convert times from -2^51 to 2^51 ns. With one time outside, the plain way converts all. */
static void seconds_are_those_of_the_division(void **state)
{
    (void)state;
    static const int64_t ends[] = {0,         1,        -1, (1LL << 51) - 1, -(1LL << 51), 1LL << 51, -(1LL << 51) - 1,
                                   INT64_MAX, INT64_MIN};
    uint64_t seed = 1;
    for (int round = 0; round < 2000; round++) {
        const int64_t most = 1LL << case_between(&seed, 1, 62);
        for (int i = 0; i < TRACK_BATCH; i++)
            track.points.t_ns[i] = case_between(&seed, -most, most);
        expect_seconds();
    }
    for (size_t k = 0; k < sizeof ends / sizeof *ends; k++) {
        for (int i = 0; i < TRACK_BATCH; i++)
            track.points.t_ns[i] = i == 77 ? ends[k] : i;
        expect_seconds();
    }
}

static double any_number(uint64_t *seed)
{
    static const double odd[] = {0, -0.0, 1e300, -1e300, INFINITY, NAN};
    const int64_t k = case_between(seed, 0, 99);
    return k < 6 ? odd[k] : ldexp(2 * case_unit(seed) - 1, (int)case_between(seed, -10, 20));
}

/* Places are the same bit by bit. Where one is NaN, so is the other. */
static void places_are_those_of_one_point(void **state)
{
    (void)state;
    static double all[3][TRACK_BATCH], from[3][TRACK_BATCH];
    uint64_t seed = 2;
    for (int round = 0; round < 2000; round++) {
        struct station_pose pose;
        for (int i = 0; i < 9; i++)
            pose.rotation[i] = round % 50 == 0 ? any_number(&seed) : 2 * case_unit(&seed) - 1;
        for (int k = 0; k < 3; k++)
            pose.shift_m[k] = any_number(&seed);
        for (int i = 0; i < 3 * TRACK_BATCH; i++)
            from[i / TRACK_BATCH][i % TRACK_BATCH] = any_number(&seed);
        memcpy(all, from, sizeof all);
        if (round % 2 == 0)
            station_pose_forward_all(&pose, TRACK_BATCH, all[0], all[1], all[2]);
        else
            station_pose_reverse_all(&pose, TRACK_BATCH, all[0], all[1], all[2]);
        for (int i = 0; i < TRACK_BATCH; i++) {
            double p[3] = {from[0][i], from[1][i], from[2][i]};
            (round % 2 == 0 ? station_pose_forward : station_pose_reverse)(&pose, p);
            for (int k = 0; k < 3; k++)
                if (!(isnan(p[k]) ? isnan(all[k][i]) : memcmp(&p[k], &all[k][i], sizeof p[k]) == 0))
                    fail_msg("point %d of round %d: %a, not %a", i, round, all[k][i], p[k]);
        }
    }
}

enum { KIND_PLACED, KIND_EMPTY, KIND_NOWHERE };

/* Each column gets the point's index. */
static void set_point(int i, int kind)
{
    static const double none[] = {INFINITY, -INFINITY, NAN};
    struct track_points *p = &track.points;
    p->x[i] = p->y[i] = p->z[i] = kind == KIND_EMPTY ? (double)NAN : i;
    if (kind == KIND_NOWHERE) (i % 3 == 0 ? p->x : i % 3 == 1 ? p->y : p->z)[i] = none[i / 3 % 3];
    p->range_m[i] = p->reflectance_db[i] = i;
    p->t_ns[i] = i;
    p->label[i] = (uint16_t)i;
    p->echo[i] = p->echo_count[i] = kind != KIND_EMPTY;
    track.row[i] = (uint32_t)i;
    track.frame[i] = track.deviation[i] = track.wave_at[i] = track.gps_s[i] = i;
    track.attribute[i] = (struct scanhead_attribute){i, i};
    memset(track.rgb[i], i % 251, 3);
    track.wave[i] = (const struct scanhead_wave *)track.rgb + i;
}

static void expect_point(int at, int i)
{
    const struct track_points *p = &track.points;
    assert_true(p->range_m[at] == i && p->reflectance_db[at] == i && p->t_ns[at] == i && p->label[at] == (uint16_t)i);
    assert_true(track.row[at] == (uint32_t)i && track.frame[at] == i && track.deviation[at] == i);
    assert_true(track.wave_at[at] == i && track.gps_s[at] == i && track.attribute[at].width_ns == i);
    assert_int_equal(track.rgb[at][2], i % 251);
    assert_true(track.wave[at] == (const struct scanhead_wave *)track.rgb + i);
}

static void points_are_left_out_with_all_their_figures(void **state)
{
    (void)state;
    uint64_t seed = 3;
    memset(&track, 0, sizeof track);
    track.info.moving = track.waited = track.has_attributes = track.has_deviations = track.has_colours =
        track.has_waves = 1;
    for (int round = 0; round < 400; round++) {
        const int n = (int)case_between(&seed, 0, TRACK_BATCH), odds = (int)case_between(&seed, 0, 6);
        int kind[TRACK_BATCH], kept = 0, n_kept = 0;
        uint64_t n_empty = 0, n_nowhere = 0;
        track.no_empty = round & 1;
        track.missing = (struct track_missing){0};
        for (int i = 0; i < n; i++) {
            const int64_t k = case_between(&seed, 0, 9);
            kind[i] = odds == 0 || k >= odds ? KIND_PLACED : k % 2 == 0 ? KIND_EMPTY : KIND_NOWHERE;
            set_point(i, kind[i]);
            n_empty += kind[i] == KIND_EMPTY && track.no_empty;
            n_nowhere += kind[i] == KIND_NOWHERE;
        }
        kept = track_leave_out(&track, n);
        assert_int_equal(track.missing.n_empty, n_empty);
        assert_int_equal(track.missing.n_nowhere, n_nowhere);
        for (int i = 0; i < n; i++)
            if (kind[i] == KIND_PLACED || (kind[i] == KIND_EMPTY && !track.no_empty)) expect_point(n_kept++, i);
        assert_int_equal(kept, n_kept);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(seconds_are_those_of_the_division),
        cmocka_unit_test(places_are_those_of_one_point),
        cmocka_unit_test(points_are_left_out_with_all_their_figures),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
