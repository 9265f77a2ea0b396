/* SPDX-License-Identifier: MIT */
/* Records of E57 are made in vectors, column by column. Each field of each record is taken from the packet, bit by bit,
 * and compared with the plain formula of ASTM E2807's scaled integers: rint(v / scale), ties to even. The figures of a
 * packet are compared with those of a loop over its records. */
#include "tests/common/cases.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/record/e57_records.h"

static uint64_t state_of_random = 0x9e3779b97f4a7c15;

static uint64_t random_bits(void)
{
    return case_u64(&state_of_random);
}

static struct track track;
static struct e57_packet packet;
static struct e57_scan scan;
static struct e57_facts facts;

/* The fields of a record, as the whole numbers that the file has to hold. */
struct plain {
    int64_t field[E57_N_STREAMS];
};
static struct plain want[E57_PACKET_RECORDS];
static unsigned n_want;

static const unsigned width[E57_N_STREAMS] = {32, 32, 32, 2, 16, 1, 8, 8, 8, 64, 4, 4, 32, 32, 16};

static void begin(int empty_shots, int has_colours, int geo, double scale_m)
{
    scan = (struct e57_scan){.scale_m = scale_m};
    facts = (struct e57_facts){.empty_shots = empty_shots, .has_colours = has_colours, .scan = &scan, .n_scans = 1};
    track.info.geo = geo;
    track.pose = (struct station_pose){{500000.25, 5e6, 400.125}, {0.8, -0.6, 0, 0.6, 0.8, 0, 0, 0, 1}};
    e57_packet_begin(&packet, &facts);
    n_want = 0;
}

/* Returns a coordinate in the head's frame: any, halfway between two counts, a whole count, or at an end of the
 * range. */
static double coordinate(double scale_m)
{
    const double k = (double)(int32_t)random_bits();
    switch (random_bits() % 8) {
    case 0:
        return (rint(k / 1e4) + 0.5) * scale_m;
    case 1:
        return rint(k / 1e3) * scale_m;
    case 2:
        return (random_bits() % 2 ? 1 : -1) * 2147483646.5 * scale_m;
    case 3:
        return random_bits() % 2 ? 0.0 : -0.0;
    default:
        return k / 1e5 * (1 + 1e-9 * (double)(random_bits() % 1000)) * scale_m;
    }
}

static void set_point(int i, int is_empty)
{
    struct track_points *p = &track.points;
    double at[3];
    for (int k = 0; k < 3; k++)
        at[k] = coordinate(scan.scale_m);
    if (track.info.geo) station_pose_forward(&track.pose, at);
    p->x[i] = is_empty ? (double)NAN : at[0];
    p->y[i] = is_empty ? (double)NAN : at[1];
    p->z[i] = is_empty ? (double)NAN : at[2];
    p->reflectance_db[i] = is_empty || random_bits() % 3 == 0 ? (double)NAN : 0.01 * (double)(int16_t)random_bits();
    p->t_ns[i] = (int64_t)(random_bits() >> (random_bits() % 64) >> 1);
    p->label[i] = (uint16_t)random_bits();
    p->echo_count[i] = is_empty ? 0 : (uint8_t)(random_bits() % 15 + 1);
    p->echo[i] = is_empty ? 0 : (uint8_t)(random_bits() % p->echo_count[i] + 1);
    track.row[i] = (uint32_t)random_bits();
    for (int c = 0; c < 3; c++)
        track.rgb[i][c] = (uint8_t)random_bits();
}

static void take_plain(int i)
{
    const struct track_points *p = &track.points;
    struct plain *w = &want[n_want++];
    double at[3] = {p->x[i], p->y[i], p->z[i]}, t_s = (double)p->t_ns[i] / 1e9;
    const int is_empty = p->echo_count[i] == 0, is_modelled = !isnan(p->reflectance_db[i]);
    if (track.info.geo) station_pose_reverse(&track.pose, at);
    for (int k = 0; k < 3; k++)
        w->field[E57_X + k] = 2147483648 + (is_empty ? 0 : (int64_t)rint(at[k] / scan.scale_m));
    w->field[E57_INVALID] = is_empty ? 2 : 0;
    w->field[E57_INTENSITY] = 32768 + (is_modelled ? (int64_t)rint(p->reflectance_db[i] * 100) : 0);
    w->field[E57_NO_INTENSITY] = !is_modelled;
    for (int c = 0; c < 3; c++)
        w->field[E57_RED + c] = track.rgb[i][c];
    memcpy(&w->field[E57_TIME], &t_s, sizeof t_s);
    w->field[E57_RETURN] = p->echo[i] > 0 ? p->echo[i] - 1 : 0;
    w->field[E57_RETURNS] = p->echo_count[i];
    w->field[E57_ROW] = track.row[i];
    w->field[E57_COLUMN] = track.line;
    w->field[E57_LABEL] = p->label[i];
}

/* Fills the packet with n records, in runs of all lengths. */
static void fill(unsigned n, int one_in)
{
    double far_m[3];
    while (packet.n < n) {
        int first = (int)(random_bits() % 200), run = (int)(random_bits() % 56 + 1);
        if ((unsigned)run > n - packet.n) run = (int)(n - packet.n);
        track.line = (uint32_t)random_bits();
        for (int i = first; i < first + run; i++) {
            set_point(i, facts.empty_shots && random_bits() % (uint64_t)one_in == 0);
            take_plain(i);
        }
        assert_int_equal(e57_records_put(&packet, &facts, &track, first, run, far_m), 0);
    }
}

static uint64_t bits_at(const uint8_t *stream, unsigned bits, unsigned i)
{
    uint64_t v = 0;
    for (unsigned b = 0; b < bits; b++) {
        const unsigned at = i * bits + b;
        v |= (uint64_t)(stream[at / 8] >> at % 8 & 1) << b;
    }
    return v;
}

/* Takes the packet of the first n wanted records apart. */
static void check_packet(const uint8_t *p, size_t len, unsigned n)
{
    int n_streams = 0, of = 0;
    for (int s = 0; s < E57_N_STREAMS; s++)
        n_streams += s == E57_INVALID ? facts.empty_shots != 0 : s < E57_RED || s > E57_BLUE || facts.has_colours;
    assert_int_equal(p[0], 1);
    assert_int_equal(p[2] + 256 * p[3] + 1, len);
    assert_int_equal(p[4] + 256 * p[5], n_streams);
    assert_int_equal(len % 4, 0);
    const uint8_t *at = p + 6 + 2 * n_streams;
    for (int s = 0; s < E57_N_STREAMS; s++) {
        if (s == E57_INVALID && !facts.empty_shots) continue;
        if (s >= E57_RED && s <= E57_BLUE && !facts.has_colours) continue;
        const unsigned n_bytes = (n * width[s] + 7) / 8;
        assert_int_equal(p[6 + 2 * of] + 256 * p[7 + 2 * of], n_bytes);
        of++;
        for (unsigned i = 0; i < n; i++)
            if (bits_at(at, width[s], i) != (uint64_t)want[i].field[s])
                fail_msg("stream %d, record %u: %llx; by the plain formula %llx", s, i,
                         (unsigned long long)bits_at(at, width[s], i), (unsigned long long)want[i].field[s]);
        for (unsigned b = n * width[s]; b < 8 * n_bytes; b++)
            assert_int_equal(at[b / 8] >> b % 8 & 1, 0);
        at += n_bytes;
    }
    for (; at < p + len; at++)
        assert_int_equal(*at, 0);
}

static void keep_lowest(int64_t *low, int64_t *high, int64_t v, int is_first)
{
    if (is_first || v < *low) *low = v;
    if (is_first || v > *high) *high = v;
}

/* Computes the figures of records 0 to n - 1 by a loop. */
static void check_figures(const struct e57_scan *got, unsigned n)
{
    int64_t low[E57_N_STREAMS] = {0}, high[E57_N_STREAMS] = {0};
    unsigned n_points = 0, n_modelled = 0;
    for (unsigned i = 0; i < n; i++) {
        const int64_t *f = want[i].field;
        for (int k = 0; k < 3 && f[E57_INVALID] == 0; k++)
            keep_lowest(&low[E57_X + k], &high[E57_X + k], f[E57_X + k] - 2147483648, n_points == 0);
        n_points += f[E57_INVALID] == 0;
        if (f[E57_NO_INTENSITY] == 0)
            keep_lowest(&low[E57_INTENSITY], &high[E57_INTENSITY], f[E57_INTENSITY] - 32768, n_modelled++ == 0);
        for (int s = E57_RETURN; s <= E57_COLUMN; s++)
            keep_lowest(&low[s], &high[s], f[s], i == 0);
    }
    assert_int_equal(got->n_records, n);
    assert_int_equal(got->n_points, n_points);
    assert_int_equal(got->have_intensity, n_modelled > 0);
    for (int k = 0; k < 3; k++) {
        assert_int_equal(got->min[k], low[E57_X + k]);
        assert_int_equal(got->max[k], high[E57_X + k]);
    }
    assert_int_equal(got->intensity_min_cdb, low[E57_INTENSITY]);
    assert_int_equal(got->intensity_max_cdb, high[E57_INTENSITY]);
    assert_int_equal(got->return_max, high[E57_RETURN]);
    assert_int_equal(got->row_min, low[E57_ROW]);
    assert_int_equal(got->row_max, high[E57_ROW]);
    assert_int_equal(got->column_min, low[E57_COLUMN]);
    assert_int_equal(got->column_max, high[E57_COLUMN]);
}

/* ---- tests */

/* Packets are full, or shorter, of all lengths. The next one begins without a record. */
static void test_plain(void **state)
{
    (void)state;
    static const unsigned lengths[] = {1920, 1, 7, 8, 9, 63, 64, 257, 1000, 1919};
    static const double scales[] = {1e-3, 1e-6, 2.5e-4, 0.1};
    for (int kind = 0; kind < 64; kind++) {
        const unsigned n = lengths[kind % 10];
        const int has_colours = kind >> 1 & 1;
        size_t len;
        begin(kind & 1, has_colours, kind >> 2 & 1, scales[kind >> 3 & 3]);
        fill(has_colours && n > packet.most ? packet.most : n, kind % 5 + 1);
        const uint8_t *p = e57_packet_make(&packet, &facts, &len);
        check_packet(p, len, n_want);
        assert_int_equal(e57_packet_count(p, len, &facts, &scan), 0);
        check_figures(&scan, n_want);
        assert_int_equal(packet.n, 0);
        n_want = 0;
        fill(20, 3);
        p = e57_packet_make(&packet, &facts, &len);
        check_packet(p, len, 20);
    }
}

/* The format has room for -(2^31 - 1) to 2^31 - 1 counts. 2^31 - 0.5 is rounded to even, which is 2^31. The first point
 * without room is named, and those before it are put: a file that ends here holds them. */
static void test_far(void **state)
{
    (void)state;
    static const double far[] = {2147483648.0, -2147483648.0, 1e300, -1e300, (double)INFINITY, 2147483647.5};
    for (size_t c = 0; c < 2 * sizeof far / sizeof *far; c++)
        for (int k = 0; k < 3; k++) {
            double far_m[3];
            size_t len;
            begin(0, 0, 0, 0.5);
            for (int i = 0; i < 40; i++)
                set_point(i, 0);
            double *column = k == 0 ? track.points.x : k == 1 ? track.points.y : track.points.z;
            const int at = c % 4 < 2 ? 17 : 0;
            column[at] = far[c / 2] * 0.5;
            if (c % 2 != 0) column[30] = (double)NAN;
            column[3] = 2147483647.0 * 0.5;
            column[4] = -2147483647.0 * 0.5;
            assert_int_equal(e57_records_put(&packet, &facts, &track, 0, 40, far_m), -1);
            assert_int_equal(packet.n, at);
            assert_true(far_m[0] == track.points.x[at] && far_m[1] == track.points.y[at] &&
                        far_m[2] == track.points.z[at]);
            for (int i = 0; i < at; i++)
                take_plain(i);
            const uint8_t *p = e57_packet_make(&packet, &facts, &len);
            check_packet(p, len, (unsigned)at);
        }
}

/* The figures of a scan go on from one packet to the next, also after one of a single record. */
static void test_figures_go_on(void **state)
{
    (void)state;
    size_t len;
    for (int round = 0; round < 20; round++) {
        begin(round & 1, 0, 0, 1e-3);
        fill(1, 9);
        const uint8_t *p = e57_packet_make(&packet, &facts, &len);
        assert_int_equal(e57_packet_count(p, len, &facts, &scan), 0);
        check_figures(&scan, 1);
        fill(8, 9);
        p = e57_packet_make(&packet, &facts, &len);
        assert_int_equal(e57_packet_count(p, len, &facts, &scan), 0);
        check_figures(&scan, 9);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_plain),
        cmocka_unit_test(test_figures_go_on),
        cmocka_unit_test(test_far),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
