/* SPDX-License-Identifier: MIT */
/* From the returns of a pulse to echoes, and figures of a beam. The truth is the definitions of core/footprint.h, in
 * numbers that can be worked out by hand. */
#include <math.h>

#include "core/footprint.h"
#include "core/rng.h"
#include "core/vec3.h"
#include "tests/common/cases.h"

enum { MOST = 16 };

static struct beam beam;
static struct beam_merging how;
static struct beam_echo echo[MOST + 1];
static uint32_t n_echoes;

static int set_up(void **state)
{
    (void)state;
    beam_init(&beam, 0.007, 0.35e-3, 4e-9); /* resolution: 0.5996 m */
    beam_merging(&beam, MOST, &how);
    return 0;
}

static void merge(struct beam_return *r, uint32_t n)
{
    uint64_t left_out = 0;
    for (uint32_t i = 0; i < n; i++)
        r[i].back = r[i].energy;
    n_echoes = beam_merge(&how, r, n, echo, &left_out);
    assert_true(left_out == 0);
}

/* Ten equal returns within the resolution: two of the nearer surface, eight of the other. The returns are one echo, at
 * the mean. The echo's surface is the one that returns most, though none of that surface's returns is stronger. The
 * order does not matter. */
static void test_surface_of_many_returns(void **state)
{
    (void)state;
    for (uint32_t turn = 0; turn < 10; turn++) {
        struct beam_return r[10] = {{0}};
        for (uint32_t i = 0; i < 10; i++) {
            uint32_t k = (i + turn) % 10, near = k < 2;
            r[i] = (struct beam_return){.range_m = near ? 20.0 : 20.3, .energy = 0.1, .label = near ? 7 : 9};
        }
        merge(r, 10);
        assert_int_equal(n_echoes, 1);
        assert_int_equal(echo[0].label, 9);
        assert_true(fabs(echo[0].range_m - 20.24) < 1e-12);
        assert_true(fabs(echo[0].energy - 1.0) < 1e-6);
    }
}

/* Returns of one surface have different texels. The echo has the colour of the strongest one, also where the nearest is
 * another. With two surfaces it is that of the first return of the stronger surface, or of the strongest return. */
static void test_colour_of_the_strongest(void **state)
{
    (void)state;
    struct beam_merging by_return = how;
    uint64_t left_out = 0;
    by_return.by_surface = 0;
    for (int surfaces = 1; surfaces <= 2; surfaces++)
        for (uint32_t strongest = 0; strongest < 4; strongest++) {
            struct beam_return r[4];
            for (uint32_t i = 0; i < 4; i++)
                r[i] = (struct beam_return){.range_m = 20.0 + 0.1 * i,
                                            .energy = i == strongest ? 0.3 : 0.2,
                                            .label = surfaces == 2 && i != strongest,
                                            .colour = 100 + i};
            merge(r, 4);
            assert_int_equal(n_echoes, 1);
            const uint32_t first_other = strongest == 0; /* three weak returns of one surface are 0.6 */
            assert_int_equal(echo[0].colour, surfaces == 1 ? 100 + strongest : 100 + first_other);
            assert_int_equal(echo[0].label, surfaces == 2);
            assert_int_equal(beam_merge(&by_return, r, 4, echo, &left_out), 1);
            assert_int_equal(echo[0].colour, 100 + strongest);
            assert_int_equal(echo[0].label, 0);
        }
}

/* The last return counts, too: two of a quarter each are more than one of 0.4. */
static void test_surface_of_the_last_return(void **state)
{
    (void)state;
    for (uint32_t nearest = 0; nearest < 2; nearest++) {
        struct beam_return r[3] = {{.range_m = nearest ? 20.0 : 20.2, .energy = 0.4, .label = 7},
                                   {.range_m = 20.1, .energy = 0.25, .label = 9},
                                   {.range_m = 20.15, .energy = 0.25, .label = 9}};
        merge(r, 3);
        assert_int_equal(n_echoes, 1);
        assert_int_equal(echo[0].label, 9);
    }
}

/* A gap above the resolution begins a new echo, and less than 1 % is none. Returns that are each within the resolution
 * of the next stay together, however far the first is from the last. */
static void test_gaps(void **state)
{
    (void)state;
    struct beam_return apart[8] = {{.range_m = 30.61, .energy = 0.2},  {.range_m = 30.0, .energy = 0.3},
                                   {.range_m = 28.0, .energy = 0.009}, {.range_m = 40.0, .energy = 0.1},
                                   {.range_m = 41.5, .energy = 0.1},   {.range_m = 40.5, .energy = 0.1},
                                   {.range_m = 41.0, .energy = 0.1},   {.range_m = 50.0, .energy = 0.091}};
    merge(apart, 8);
    assert_int_equal(n_echoes, 4);
    static const double want_m[4] = {30.0, 30.61, 40.75, 50.0}, want_energy[4] = {0.3, 0.2, 0.4, 0.091};
    for (uint32_t i = 0; i < 4; i++) {
        assert_true(fabs(echo[i].range_m - want_m[i]) < 1e-12);
        assert_true(fabs(echo[i].energy - want_energy[i]) < 1e-6);
        assert_int_equal(echo[i].number, i);
    }
}

/* Returns that are just the resolution apart are one echo. The numbers are exact in float. */
static void test_at_the_resolution(void **state)
{
    (void)state;
    for (int beyond = 0; beyond < 2; beyond++) {
        struct beam_return r[2] = {{.range_m = 30.0, .energy = 0.5},
                                   {.range_m = beyond ? 30.50390625 : 30.5, .energy = 0.5}};
        struct beam_merging half = how;
        uint64_t left_out = 0;
        half.gap_m = 0.5;
        n_echoes = beam_merge(&half, r, 2, echo, &left_out);
        assert_int_equal(n_echoes, beyond ? 2 : 1);
    }
}

/* exp(-2 (r / w)^2) is 1/e at w / sqrt 2, and a half at w sqrt(ln 2 / 2); half of the angle is half of the radius. */
static void test_definitions(void **state)
{
    (void)state;
    static const double share[] = {
        [BEAM_AT_1_E2] = 0.1353352832366127, [BEAM_AT_1_E] = 0.3678794411714423, [BEAM_AT_HALF_MAXIMUM] = 0.5};
    for (int d = BEAM_AT_1_E2; d <= BEAM_AT_HALF_MAXIMUM; d++) {
        const double r = 1.0 / beam_widening((enum beam_definition)d);
        if (d != BEAM_HALF_AT_1_E2) assert_true(fabs(exp(-2.0 * r * r) - share[d]) < 1e-15);
    }
    assert_true(beam_widening(BEAM_HALF_AT_1_E2) == 2.0);
}

/* By core/footprint.h ring k has 6 k sub-rays, even steps apart, where half of its annulus's energy is inside. Odd
 * rings are turned by half a step. With what each stands for, sub-rays spread as the whole footprint does: x^2 has a
 * mean of half of t's, for t distributed as exp(-2 t) on 0 .. 1. */
static void test_rings(void **state)
{
    (void)state;
    const double all = 1.0 - exp(-2.0), mean_t = (0.5 - 1.5 * exp(-2.0)) / all;
    static struct beam_pattern pattern;
    for (uint32_t rings = 0; rings <= 6; rings++) {
        const uint32_t n = 1 + 3 * rings * (rings + 1);
        double xx = 0.0;
        beam_rings(rings, &pattern);
        assert_int_equal(pattern.n, n);
        assert_true(pattern.x[0] == 0.0f && pattern.y[0] == 0.0f);
        for (uint32_t k = 1, at = 1; k <= rings; k++)
            for (uint32_t i = 0; i < 6 * k; i++, at++) {
                const double x = (double)pattern.x[at], y = (double)pattern.y[at];
                const double within = (1.0 - exp(-2.0 * (x * x + y * y))) / all * n; /* sub-rays' shares */
                const double steps = 6.0 * k * atan2(y, x) / (2.0 * M_PI) - 0.5 * (k % 2);
                assert_true(fabs(within - (1.0 + 3.0 * k * (k - 1) + 3.0 * k)) < 1e-6 * n);
                assert_true(fabs(remainder(steps - i, 6.0 * k)) < 1e-5);
                xx += x * x / n;
            }
        assert_true(fabs(xx + pattern.rest - 0.5 * mean_t) < 1e-6);
    }
}

/* Axes across a beam are unit vectors, at right angles, and right-handed with the beam, also when it is level or just
 * below that. */
static void test_axes(void **state)
{
    (void)state;
    static const double d[6][3] = {{0, 0, 1},         {0, 0, -1},         {1, 0, 0},
                                   {0.48, 0.6, 0.64}, {0.48, 0.6, -0.64}, {-0.6, 0.8, -1e-12}};
    for (int n = 0; n < 6; n++) {
        double e1[3], e2[3], along[3];
        beam_axes(d[n], e1, e2);
        vec3_cross(e1, e2, along);
        assert_true(fabs(vec3_length(e1) - 1.0) < 1e-15 && fabs(vec3_length(e2) - 1.0) < 1e-15);
        assert_true(vec3_distance(along, d[n]) < 1e-15);
    }
}

static struct beam_line line_at(double turn_deg, double h)
{
    return (struct beam_line){.n = {cos(turn_deg * M_PI / 180.0), sin(turn_deg * M_PI / 180.0)}, .h = h};
}

static double cap(double h)
{
    double energy, moment;
    beam_half(&beam, h, &energy, &moment);
    return energy;
}

/* Lines that do not meet in the footprint cut caps off. Caps may be one within the other, equal and beside each other,
 * or on opposite sides. The truth is the energy beyond a line. */
static void test_two_caps(void **state)
{
    (void)state;
    static const struct {
        double turn_deg, h[2];
        int nested;
    } is[] = {{0.0, {0.2, 0.5}, 1},
              {0.0, {0.5, 0.2}, 1},
              {5.0, {0.1, 0.6}, 1},
              {80.0, {0.85, 0.85}, 0},
              {180.0, {0.3, 0.4}, 0}};
    static struct beam_pattern fine;
    beam_rings(BEAM_FINE_RINGS, &fine);
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++) {
        const struct beam_line line[2] = {line_at(0.0, is[i].h[0]), line_at(is[i].turn_deg, is[i].h[1])};
        const int outer = is[i].h[0] > is[i].h[1];
        struct beam_parts parts;
        double want[3] = {cap(is[i].h[0]), cap(is[i].h[1]), 0.0};
        if (is[i].nested) want[outer] -= want[1 - outer];
        want[2] = 1.0 - want[0] - want[1];
        assert_int_equal(beam_cut(&beam, &fine, line, 2, 0, &parts), 0);
        assert_int_equal(parts.n, 3);
        assert_int_equal(parts.centre, 2);
        for (int k = 0; k < 3; k++)
            assert_true(fabs(parts.part[k].energy - want[k]) < 1e-12);
    }
}

/* If there are too many echoes the weakest is left out, wherever it comes. The returned light counts, not the
 * energy. When two are equally weak, the first one goes. The others keep their numbers among all. */
static void test_crowd(void **state)
{
    (void)state;
    static const double back[5] = {0.4, 0.1, 0.6, 0.1, 0.3};
    static const uint32_t left[6][5] = {{0}, {2}, {0, 2}, {0, 2, 4}, {0, 2, 3, 4}, {0, 1, 2, 3, 4}};
    for (uint32_t most = 1; most <= 5; most++) {
        struct beam_return r[5];
        struct beam_merging few = how;
        uint64_t left_out = 0;
        few.most = most;
        for (uint32_t i = 0; i < 5; i++)
            r[i] = (struct beam_return){.range_m = 10.0 + 2.0 * i, .energy = 0.1 * (5 - i), .back = back[i]};
        n_echoes = beam_merge(&few, r, 5, echo, &left_out);
        assert_int_equal(n_echoes, most);
        assert_int_equal(left_out, 5 - most);
        for (uint32_t i = 0; i < most; i++) {
            assert_true(echo[i].range_m == 10.0 + 2.0 * left[most][i]);
            assert_int_equal(echo[i].number, left[most][i]);
        }
    }
}

/* ---- power that is received */

/* The signal falls with the square of the range. Of too many echoes, that of the least received power is left out: the
 * far ones send more back here, and 0.1 / 10^2 is the most. The surface of a mixed echo is that of the most power: 0.4
 * at 1 m against 0.6 at 1.5 m. Its power is the sum of both. */
static void test_received_power(void **state)
{
    (void)state;
    struct detect_signal signal;
    struct sh_err err;
    const struct detect_signal_spec spec = {.n_reaches = 1, .reach = {{0.9, 500.0}}, .threshold_snr = 8.0, .sharp = 1};
    struct beam_merging few = how;
    struct beam_return r[4], two[2] = {{.range_m = 1.0, .plane_m = 1.0, .energy = 0.4, .back = 0.4, .label = 1},
                                       {.range_m = 1.5, .plane_m = 1.5, .energy = 0.6, .back = 0.6, .label = 2}};
    const double power = 0.4 + 0.6 / 2.25, mean_m = (0.4 + 0.6 / 1.5) / power;
    uint64_t left_out = 0;
    assert_int_equal(detect_signal_set_up(&spec, &signal, &err), SH_OK);
    few.signal = &signal;
    for (few.most = 1; few.most <= 3; few.most++) {
        for (uint32_t i = 0; i < 4; i++)
            r[i] = (struct beam_return){.range_m = 10.0 * (i + 1),
                                        .plane_m = 10.0 * (i + 1),
                                        .energy = 0.2,
                                        .back = i == 0 ? 0.1 : 0.1 + 0.1333 * i};
        assert_int_equal(beam_merge(&few, r, 4, echo, &left_out), few.most);
        for (uint32_t i = 0; i < few.most; i++)
            assert_true(echo[i].range_m == 10.0 * (i + 1));
    }
    assert_int_equal(left_out, 6);
    assert_int_equal(beam_merge(&few, two, 2, echo, &left_out), 1);
    assert_int_equal(echo[0].label, 1);
    assert_true(fabs(echo[0].range_m - mean_m) < 1e-12 && fabs(echo[0].back / (power * mean_m * mean_m) - 1.0) < 1e-9);
    two[1].plane_m = 1.0; /* both on one plane: distance has no part */
    assert_int_equal(beam_merge(&few, two, 2, echo, &left_out), 1);
    assert_true(echo[0].label == 2 && fabs(echo[0].range_m - 1.3) < 1e-12 && echo[0].back == 1.0);
    few.least_m = 1.2; /* both are on a plane that is too near; one ray has the same mean */
    assert_int_equal(beam_merge(&few, two, 2, echo, &left_out), 1);
    assert_true(fabs(echo[0].range_m - 1.3) < 1e-12);
    two[1].plane_m = 1.5; /* nothing is received from the first */
    assert_int_equal(beam_merge(&few, two, 2, echo, &left_out), 1);
    assert_true(fabs(echo[0].range_m - 1.5) < 1e-12 && fabs(echo[0].back / 0.6 - 1.0) < 1e-9);
}

/* Near pulses are merged several at a time only where their returns lie on one plane. */
static void test_alike_planes(void **state)
{
    (void)state;
    enum { N = 7 };
    static double range_m[BEAM_ALIKE * N];
    static uint32_t label[BEAM_ALIKE * N], plane[BEAM_ALIKE * N];
    const struct detect_signal_spec spec = {.n_reaches = 1, .reach = {{0.9, 500.0}}, .threshold_snr = 8.0, .sharp = 1};
    struct detect_signal signal;
    struct beam_echo alike[BEAM_ALIKE];
    struct beam_merging with = how;
    struct sh_err err;
    assert_int_equal(detect_signal_set_up(&spec, &signal, &err), SH_OK);
    with.signal = &signal;
    for (uint32_t i = 0; i < BEAM_ALIKE * N; i++) {
        range_m[i] = (i / N % 3 == 0 ? 100.0 : 1.0) + 0.02 * (i % N); /* at 100 m the shift is below 0.1 mm */
        plane[i] = i / N % 3 == 1 ? i % N : 3;
    }
    const struct beam_alike all = {N, 1.0 / N, range_m, label, NULL, plane};
    const struct beam_alike unknown = {N, 1.0 / N, range_m, label, NULL, NULL};
    const uint32_t bits = beam_merge_alike(&with, &all, alike), far = beam_merge_alike(&with, &unknown, alike);
    for (uint32_t i = 0; i < BEAM_ALIKE; i++) {
        assert_int_equal(bits >> i & 1, i % 3 != 1);
        assert_int_equal(far >> i & 1, i % 3 == 0);
    }
    /* The smallest range lies within a pulse. Its plane is received as a whole, in both ways. */
    struct beam_return r[N];
    struct beam_echo one;
    uint64_t left_out = 0;
    with.least_m = 1.05;
    assert_int_equal(beam_merge_alike(&with, &all, alike), bits);
    for (uint32_t j = 0; j < N; j++)
        r[j] = (struct beam_return){.range_m = range_m[2 * N + j], .plane_m = 1.06, .energy = 1.0 / N, .back = 1.0 / N};
    assert_int_equal(beam_merge(&with, r, N, &one, &left_out), 1);
    assert_true(one.range_m == alike[2].range_m);
}

/* ---- several pulses at a time */

enum { EACH = 19, ROWS = 400 };

/* A pulse of EACH returns. Most are on one surface; others have a gap, a miss, ranges at the resolution, equal nearest
 * ones, two labels, or no light that comes back. */
static void make_row(uint64_t key, double *range_m, double *rho, uint32_t *label)
{
    const uint64_t kind = rng_u64(1, key) % 10;
    const double spread_m = kind == 0 ? 3.0 : kind == 1 ? beam.resolution_m : 0.3;
    for (uint32_t j = 0; j < EACH; j++) {
        const double part = (double)(rng_u64(2, key * EACH + j) >> 11) * 0x1p-53;
        range_m[j] = 20.0 + spread_m * (kind == 1 ? (double)(part > 0.5) : part);
        rho[j] = kind == 2 ? 0.0 : 0.1 + (double)(rng_u64(3, key * EACH + j) >> 11) * 0x1p-53;
        label[j] = kind == 3 && part > 0.9 ? 8 : 7;
        if (kind == 4 && part > 0.9) range_m[j] = (double)NAN;
        if (kind == 5 && part > 0.5) range_m[j] = 19.9;
        if (kind == 6) range_m[j] = (double)NAN;
    }
}

/* Merges one pulse by beam_merge. Returns whether it is one echo of all returns. */
static int merge_row(const double *range_m, const double *rho, const uint32_t *label, struct beam_echo *one)
{
    struct beam_return r[EACH];
    uint64_t left_out = 0;
    uint32_t n = 0, labels = 0;
    for (uint32_t j = 0; j < EACH; j++) {
        const double energy = 1.0 / EACH;
        if (isnan(range_m[j])) continue;
        labels |= label[j] ^ label[0];
        r[n++] = (struct beam_return){.range_m = range_m[j],
                                      .energy = energy,
                                      .back = rho != NULL ? energy * 1.0 * rho[j] : energy,
                                      .label = label[j]};
    }
    if (n < EACH || beam_merge(&how, r, EACH, echo, &left_out) != 1) return 0;
    *one = echo[0];
    return labels == 0;
}

/* Every pulse that is merged with others is the same, bit by bit, as by itself. Pulses that beam_merge makes one echo
 * of, without a gap anywhere, are all merged so, unless nothing comes back of them. */
static void test_alike(void **state)
{
    (void)state;
    static double range_m[BEAM_ALIKE * EACH], rho[BEAM_ALIKE * EACH];
    static uint32_t label[BEAM_ALIKE * EACH];
    uint32_t merged = 0, others = 0;
    for (uint32_t row = 0; row < 2 * ROWS; row++) {
        const double *weights = row % 2 == 0 ? rho : NULL;
        struct beam_echo alike[BEAM_ALIKE], one;
        for (uint32_t i = 0; i < BEAM_ALIKE; i++)
            make_row((uint64_t)row * BEAM_ALIKE + i, range_m + i * EACH, rho + i * EACH, label + i * EACH);
        const struct beam_alike all = {EACH, 1.0 / EACH, range_m, label, weights, NULL};
        const uint32_t bits = beam_merge_alike(&how, &all, alike);
        for (uint32_t i = 0; i < BEAM_ALIKE; i++) {
            const double *r = range_m + i * EACH, *w = weights != NULL ? rho + i * EACH : NULL;
            const int is_one = merge_row(r, w, label + i * EACH, &one);
            double least_m = r[0], most_m = r[0];
            for (uint32_t j = 1; j < EACH; j++) {
                least_m = fmin(least_m, r[j]);
                most_m = fmax(most_m, r[j]);
            }
            const int is_apart = !is_one || most_m - least_m > how.gap_m || !(one.back > 0.0);
            assert_int_equal(bits >> i & 1, !is_apart);
            others += (uint32_t)is_apart;
            if (is_apart) continue;
            merged++;
            assert_memory_equal(&alike[i].range_m, &one.range_m, sizeof one.range_m);
            assert_memory_equal(&alike[i].energy, &one.energy, sizeof one.energy);
            assert_memory_equal(&alike[i].back, &one.back, sizeof one.back);
            assert_int_equal(alike[i].label, one.label);
            assert_int_equal(alike[i].number, one.number);
        }
    }
    assert_true(merged > ROWS && others > ROWS);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_surface_of_many_returns),
        cmocka_unit_test(test_colour_of_the_strongest),
        cmocka_unit_test(test_surface_of_the_last_return),
        cmocka_unit_test(test_gaps),
        cmocka_unit_test(test_two_caps),
        cmocka_unit_test(test_crowd),
        cmocka_unit_test(test_at_the_resolution),
        cmocka_unit_test(test_definitions),
        cmocka_unit_test(test_axes),
        cmocka_unit_test(test_rings),
        cmocka_unit_test(test_received_power),
        cmocka_unit_test(test_alike),
        cmocka_unit_test(test_alike_planes),
    };
    return cmocka_run_group_tests(tests, set_up, NULL);
}
