/* SPDX-License-Identifier: MIT */
/* core/cast/kernels_sweep.c: directions of runs whose axes turn evenly, compared with long double, with angles taken
 * one by one, and cut in all ways. And the runs' times. */
#include "tests/common/cases.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "core/cast/kernels_sweep.h"
#include "core/cast/kernels_times.h"
#include "core/mat3.h"

enum { N = BVH_CHUNK, RUNS = 300 };
static const long double TWO_PI = 6.283185307179586476925286766559L;

static struct {
    double mirror[N], pan[N];
    double x[N], y[N], z[N], ex[N], ey[N], ez[N];
} one, whole, cut;

static int need_long_double(void **state)
{
    (void)state;
    return LDBL_MANT_DIG >= 64 ? 0 : -1;
}

static double below(uint64_t *seed, double most)
{
    return most * case_unit(seed);
}

/* A line head's run within a few turns. Steps are up to most_deg, and the pan's are mostly far smaller, as real
 * ones. */
static struct schedule_run a_run(uint64_t *seed, double most_deg)
{
    const double pan_deg = case_between(seed, 0, 3) == 0 ? most_deg : most_deg * 1e-3;
    struct schedule_run run = {.n = N,
                               .in_line = (uint32_t)case_between(seed, 0, 1000),
                               .num = (uint64_t)case_between(seed, 1, 1000000),
                               .mirror0_turn = below(seed, 1.0) - 0.5,
                               .pan0_turn = below(seed, 1.0),
                               .pan_step_turn = (below(seed, 2.0) - 1.0) * pan_deg / 360.0};
    run.r = run.in_line * run.num + (uint64_t)case_between(seed, 0, 1000000);
    run.mirror_turn_per_r = below(seed, most_deg) / 360.0 / (double)run.num;
    return run;
}

static void angles_of(const struct schedule_run *run, struct kernel_pulses *sweep)
{
    kernel_angles(run, 0, N, one.mirror, one.pan);
    *sweep = (struct kernel_pulses){run, 0, {N, one.mirror, one.pan}};
}

static void expect_direction(long double mirror_turn, long double pan_turn, long double d[3])
{
    const long double m = TWO_PI * mirror_turn, p = TWO_PI * pan_turn;
    d[0] = sinl(p) * cosl(m);
    d[1] = cosl(p) * cosl(m);
    d[2] = sinl(m);
}

static double distance(const long double d[3], double x, double y, double z)
{
    return (double)sqrtl((d[0] - x) * (d[0] - x) + (d[1] - y) * (d[1] - y) + (d[2] - z) * (d[2] - z));
}

/* Each of the two sines and cosines errs by half its last bit, and by the 4e-17 of the block's middle. Two products
 * follow: 4e-16 together. Taken one by one, angles are rounded before, to 1e-16 of a turn. */
static void they_are_closer_to_the_schedule_than_one_by_one(void **state)
{
    (void)state;
    uint64_t seed = 1;
    double worst = 0.0, worst_one = 0.0, longest = 0.0;
    struct kernel_steps steps = {0};
    for (int k = 0; k < RUNS; k++) {
        struct schedule_run run = a_run(&seed, k % 3 == 0 ? 0.35 : 0.05);
        struct kernel_pulses sweep;
        angles_of(&run, &sweep);
        assert_true(kernel_sweep_steps(&steps, &run));
        kernel_sweep(&steps, &sweep, mat3_unit, &(struct vec3_out){whole.x, whole.y, whole.z}, NULL);
        kernel_directions(&sweep.turns, mat3_unit, &(struct vec3_out){one.x, one.y, one.z}, NULL);
        for (uint32_t i = 0; i < N; i++) {
            long double d[3];
            expect_direction(
                (long double)run.mirror0_turn + (long double)(run.r + i * run.num) * (long double)run.mirror_turn_per_r,
                (long double)run.pan0_turn + (long double)(run.in_line + i) * (long double)run.pan_step_turn, d);
            const double x = whole.x[i], y = whole.y[i], z = whole.z[i];
            worst = fmax(worst, distance(d, x, y, z));
            worst_one = fmax(worst_one, distance(d, one.x[i], one.y[i], one.z[i]));
            longest =
                fmax(longest, (double)fabsl(sqrtl((long double)x * x + (long double)y * y + (long double)z * z) - 1));
        }
    }
    print_message("# worst error %.3g, one by one %.3g; length - 1: %.3g\n", worst, worst_one, longest);
    assert_true(worst < 4e-16 && worst < worst_one && longest < 4e-16);
}

/* Directions of whole counts. The kernel's own error, d^3/6 for d of half a count, is far below the last bit. The
 * rest is the error of a rounded angle, as the counts are found from rounded angles. */
static void encoders_read_whole_counts(void **state)
{
    (void)state;
    const struct cast_setup setup = {.mirror_counts = 1048576.0, .pan_counts = 1048576.0};
    uint64_t seed = 2;
    double worst = 0.0;
    struct kernel_steps steps = {0};
    for (int k = 0; k < RUNS / 4; k++) {
        struct schedule_run run = a_run(&seed, 0.05);
        struct kernel_pulses sweep;
        angles_of(&run, &sweep);
        assert_true(kernel_sweep_steps(&steps, &run));
        kernel_sweep(&steps, &sweep, mat3_unit, &(struct vec3_out){cut.x, cut.y, cut.z},
                     &(struct kernel_reading){&setup, mat3_unit, {whole.x, whole.y, whole.z}});
        kernel_sweep(&steps, &sweep, mat3_unit, &(struct vec3_out){one.x, one.y, one.z}, NULL);
        assert_memory_equal(cut.x, one.x, sizeof cut.x);
        assert_memory_equal(cut.z, one.z, sizeof cut.z);
        for (uint32_t i = 0; i < N; i++) {
            long double d[3];
            expect_direction(nearbyintl(one.mirror[i] * 1048576.0L) / 1048576.0L,
                             nearbyintl(one.pan[i] * 1048576.0L) / 1048576.0L, d);
            worst = fmax(worst, distance(d, whole.x[i], whole.y[i], whole.z[i]));
        }
    }
    print_message("# whole counts: worst error %.3g\n", worst);
    assert_true(worst < 2e-15);
}

static void check_cut(const struct schedule_run *run, const struct cast_setup *setup, uint32_t from, uint32_t n,
                      int own_run)
{
    struct kernel_steps steps = {0};
    struct schedule_run later = *run;
    struct kernel_pulses part = {run, from, {n, one.mirror + from, one.pan + from}};
    if (own_run) {
        later.in_line += from;
        later.r += from * run->num;
        later.pulse0 += from;
        later.n = n;
        part.run = &later;
        part.first = 0;
    }
    assert_true(kernel_sweep_steps(&steps, part.run));
    kernel_sweep(&steps, &part, mat3_unit, &(struct vec3_out){cut.x, cut.y, cut.z},
                 &(struct kernel_reading){setup, mat3_unit, {cut.ex, cut.ey, cut.ez}});
    const size_t bytes = n * sizeof cut.x[0];
    if (memcmp(cut.x, whole.x + from, bytes) != 0 || memcmp(cut.y, whole.y + from, bytes) != 0 ||
        memcmp(cut.z, whole.z + from, bytes) != 0 || memcmp(cut.ex, whole.ex + from, bytes) != 0 ||
        memcmp(cut.ey, whole.ey + from, bytes) != 0 || memcmp(cut.ez, whole.ez + from, bytes) != 0)
        fail_msg("pulses %u .. %u differ from those of the whole run", from, from + n - 1);
}

static void cuts_change_nothing(void **state)
{
    (void)state;
    const struct cast_setup setup = {.mirror_counts = 1048576.0, .pan_counts = 65536.0};
    uint64_t seed = 3;
    for (int k = 0; k < RUNS; k++) {
        struct schedule_run run = a_run(&seed, 0.05);
        struct kernel_pulses sweep;
        struct kernel_steps steps = {0};
        angles_of(&run, &sweep);
        assert_true(kernel_sweep_steps(&steps, &run));
        kernel_sweep(&steps, &sweep, mat3_unit, &(struct vec3_out){whole.x, whole.y, whole.z},
                     &(struct kernel_reading){&setup, mat3_unit, {whole.ex, whole.ey, whole.ez}});
        for (int j = 0; j < 40; j++) {
            uint32_t from = (uint32_t)case_between(&seed, 0, N - 1);
            uint32_t n = (uint32_t)case_between(&seed, 1,
                                                j % 2                       ? N - from
                                                : from % 20 + 1 <= N - from ? from % 20 + 1
                                                                            : 1);
            check_cut(&run, &setup, from, n, j % 4 < 2);
        }
    }
}

/* The table is that of the current run, whatever came before. */
static void runs_take_turns(void **state)
{
    (void)state;
    uint64_t seed = 4;
    struct schedule_run run[2] = {a_run(&seed, 0.05), a_run(&seed, 0.05)};
    struct kernel_steps shared = {0};
    for (int k = 0; k < 6; k++) {
        struct kernel_steps own = {0};
        const struct schedule_run *r = &run[k % 4 / 2];
        assert_true(kernel_sweep_steps(&shared, r) && kernel_sweep_steps(&own, r));
        assert_memory_equal(&shared, &own, sizeof own);
    }
}

static void what_does_not_turn_evenly_is_refused(void **state)
{
    (void)state;
    uint64_t seed = 5;
    struct kernel_steps steps = {0};
    struct schedule_run run = a_run(&seed, 0.05);
    const struct emitter_firing firing = {0};
    run.firing = &firing;
    assert_false(kernel_sweep_steps(&steps, &run));
    run.firing = NULL;
    assert_true(kernel_sweep_steps(&steps, &run));
    run.pan_step_turn = -0.36 / 360.0;
    assert_false(kernel_sweep_steps(&steps, &run));
    run.pan_step_turn = 0.0;
    run.mirror_turn_per_r = 0.36 / 360.0 / (double)run.num;
    assert_false(kernel_sweep_steps(&steps, &run));
}

/* dt(j) = j * quot + floor((acc + j * rem) / den), in 128 bits. */
static void times_are_whole_nanoseconds(void **state)
{
    (void)state;
    static uint32_t dt_ns[3000];
    uint64_t seed = 6;
    for (int k = 0; k < 2000; k++) {
        const int64_t den = case_between(&seed, 1, k % 2 ? 12 : INT64_C(1000000000000000));
        const struct schedule_run run = {.n = (uint32_t)case_between(&seed, 1, k % 3 ? 3000 : 70),
                                         .ns_quot = case_between(&seed, 0, 100000),
                                         .ns_den = (uint64_t)den,
                                         .ns_rem = (uint64_t)case_between(&seed, 0, den - 1),
                                         .ns_acc = (uint64_t)case_between(&seed, 0, den - 1)};
        kernel_times(&run, dt_ns);
        for (uint64_t j = 0; j < run.n; j++) {
            const unsigned __int128 over = run.ns_acc + (unsigned __int128)j * run.ns_rem;
            if (dt_ns[j] != j * (uint64_t)run.ns_quot + (uint64_t)(over / run.ns_den))
                fail_msg("pulse %u of %u: %u ns", (uint32_t)j, run.n, dt_ns[j]);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(they_are_closer_to_the_schedule_than_one_by_one),
        cmocka_unit_test(encoders_read_whole_counts),
        cmocka_unit_test(cuts_change_nothing),
        cmocka_unit_test(runs_take_turns),
        cmocka_unit_test(times_are_whole_nanoseconds),
        cmocka_unit_test(what_does_not_turn_evenly_is_refused),
    };
    return cmocka_run_group_tests_name("sweep", tests, need_long_double, NULL);
}
