/* SPDX-License-Identifier: MIT */
/* A client's points beside those of the head: unknown ones, repeated ones, coordinate frames, rounding. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <cmocka.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "firmware_sim/app/studio/verdict/match.h"

enum { N = 600, PER_FRAME = 10, TICK_NS = 1000000 };

/* The head: 60 frames of 10 points, one each millisecond. Each point has a place of its own. */
static double xyz[N][3];
static struct own_frame frames[N / PER_FRAME];
static struct own_stream stream;
static struct watch watch;
static struct watch_span span[4];

static void begin(void)
{
    for (int i = 0; i < N; i++)
        for (int k = 0; k < 3; k++)
            xyz[i][k] = 0.001 * ((i * (7919 + 104729 * k)) % 20011) - 10.0;
    for (int f = 0; f < N / PER_FRAME; f++)
        frames[f] = (struct own_frame){(uint32_t)f, (int64_t)f * TICK_NS, (size_t)(f + 1) * PER_FRAME};
    memset(&stream, 0, sizeof stream);
    stream.frame = frames;
    stream.n_frames = N / PER_FRAME;
    stream.xyz_m = xyz;
    stream.n = N;
    stream.info.geo = 1;
    const double turn[9] = {0, -1, 0, 1, 0, 0, 0, 0, 1}, at[3] = {3.0, -2.0, 1.5};
    memcpy(stream.info.rotation, turn, sizeof turn);
    memcpy(stream.info.station_m, at, sizeof at);
    memset(&watch, 0, sizeof watch);
    span[0] = (struct watch_span){1, 0, INT64_MAX};
    watch.span = span;
    watch.n_span = 1;
}

static struct verdict_points try(const struct cloud *cloud, double match_m)
{
    struct verdict_points match;
    struct sh_err err;
    const struct match_input in = {
        .stream = &stream, .watch = &watch, .tick_ns = TICK_NS, .cloud = cloud, .match_m = match_m};
    assert_int_equal(match_points(&in, &match, &err), SH_OK);
    return match;
}

/* The client's own: points `from` to `to`. */
static double theirs[2 * N][3];
static struct cloud cloud_of(int from, int to)
{
    memcpy(theirs, xyz + from, (size_t)(to - from) * sizeof xyz[0]);
    return (struct cloud){.n = (size_t)(to - from), .xyz_m = theirs};
}

static void test_a_right_client(void **state)
{
    (void)state;
    begin();
    const struct cloud cloud = cloud_of(0, N);
    const struct verdict_points m = try(&cloud, 1e-5);
    assert_int_equal(m.n, N);
    assert_int_equal(m.unknown + m.repeated + m.again + m.empty, 0);
    assert_int_equal(m.sent, N);
    assert_string_equal(m.frame, "scene");
}

static void test_unknown_and_empty(void **state)
{
    (void)state;
    begin();
    const struct cloud cloud = cloud_of(0, N);
    theirs[7][2] += 0.0001;
    theirs[300][0] = NAN;
    memset(theirs[301], 0, sizeof theirs[301]);
    const struct verdict_points m = try(&cloud, 1e-5);
    assert_int_equal(m.unknown, 1);
    assert_int_equal(m.first_unknown, 7);
    assert_int_equal(m.empty, 2);
    assert_int_equal(m.n, N - 2);
    assert_int_equal(try(&cloud, 1.1e-4).unknown, 0);
}

static void test_repeated(void **state)
{
    (void)state;
    begin();
    struct cloud cloud = cloud_of(0, N);
    memcpy(theirs + N, xyz + 50, PER_FRAME * sizeof xyz[0]);
    cloud.n += PER_FRAME;
    assert_int_equal(try(&cloud, 1e-5).repeated, PER_FRAME);
    /* Two sessions were sent everything: a client of two connections may have it twice. */
    span[1] = (struct watch_span){2, 0, INT64_MAX};
    watch.n_span = 2;
    assert_int_equal(try(&cloud, 1e-5).repeated, 0);
    /* The second session ended more than two ticks before that frame, number 5, so it was not sent it. */
    span[1].to_ns = 2 * TICK_NS;
    assert_int_equal(try(&cloud, 1e-5).repeated, PER_FRAME);
    /* A fault took that frame away from it. */
    span[1].to_ns = INT64_MAX;
    struct watch_spoiled spoiled[] = {{2, 30}, {2, 40}, {2, 5}, {1, 9}, {2, 50}, {2, 12}, {2, 3}};
    watch.spoiled = spoiled;
    watch.n_spoiled = sizeof spoiled / sizeof spoiled[0];
    assert_int_equal(try(&cloud, 1e-5).repeated, PER_FRAME);
}

/* Where points are so dense that a client's agrees with several, no right client has a finding, whatever the order. */
static void test_dense_points(void **state)
{
    (void)state;
    begin();
    for (int i = 0; i < N; i++) {
        xyz[i][0] = 1e-4 * i;
        xyz[i][1] = xyz[i][2] = 0.5;
    }
    struct cloud cloud = cloud_of(0, N);
    for (int i = 0; i < N; i++) /* rounded to millimetres: ten of them are one */
        theirs[N - 1 - i][0] = 1e-3 * floor(xyz[i][0] / 1e-3 + 0.5);
    for (int i = 0; i < N; i++)
        theirs[i][1] = theirs[i][2] = 0.5;
    struct verdict_points m = try(&cloud, 5.1e-4);
    assert_int_equal(m.unknown + m.repeated, 0);
    memcpy(theirs + N, theirs, sizeof xyz); /* all of it twice */
    cloud.n = 2 * N;
    m = try(&cloud, 5.1e-4);
    assert_int_equal(m.repeated, N);
}

/* Head to scene: p_scene = station + rotation p. The station turns x to y; ROS has x where the head has y. */
static void test_frames(void **state)
{
    (void)state;
    begin();
    const struct cloud cloud = cloud_of(0, N);
    for (int i = 0; i < N; i++) {
        const double x = xyz[i][0] - 3.0, y = xyz[i][1] + 2.0;
        theirs[i][0] = y;
        theirs[i][1] = -x;
        theirs[i][2] = xyz[i][2] - 1.5;
    }
    struct verdict_points m = try(&cloud, 1e-5);
    assert_string_equal(m.frame, "head");
    assert_int_equal(m.unknown, 0);
    for (int i = 0; i < N; i++) { /* forward is y, left is -x */
        const double x = theirs[i][0];
        theirs[i][0] = theirs[i][1];
        theirs[i][1] = -x;
    }
    m = try(&cloud, 1e-5);
    assert_string_equal(m.frame, "head, x forward");
    assert_int_equal(m.unknown, 0);
    /* A polar stream is in the head's frame, and the client's points in the scene's. */
    stream.info.geo = 0;
    for (int i = 0; i < N; i++) {
        theirs[i][0] = 3.0 - xyz[i][1];
        theirs[i][1] = -2.0 + xyz[i][0];
        theirs[i][2] = 1.5 + xyz[i][2];
    }
    m = try(&cloud, 1e-5);
    assert_string_equal(m.frame, "scene");
    assert_int_equal(m.unknown, 0);
}

/* The frame in which most points agree is taken, though another one that is tried later has a point, too. */
static void test_most_points_decide(void **state)
{
    (void)state;
    begin();
    struct cloud cloud = cloud_of(0, N);
    theirs[N][0] = 3.0 - xyz[7][0]; /* the head's x forward is -x of the scene, and its y is -y */
    theirs[N][1] = -2.0 - xyz[7][1];
    theirs[N][2] = xyz[7][2] - 1.5;
    cloud.n++;
    const struct verdict_points m = try(&cloud, 1e-5);
    assert_string_equal(m.frame, "scene");
    assert_int_equal(m.unknown, 1);
    assert_int_equal(m.first_unknown, N);
}

/* The client's points, as the head of test_frames has them. */
static void turn_to_head(void)
{
    for (int i = 0; i < N; i++) {
        theirs[i][0] = xyz[i][1] + 2.0;
        theirs[i][1] = 3.0 - xyz[i][0];
        theirs[i][2] = xyz[i][2] - 1.5;
    }
}

/* A head that moves, or stood in several places, has no frame of its own; a CRS has no other frame beside it. */
static void test_frames_that_are_not_tried(void **state)
{
    static const struct {
        int geo, moving, is_moved, crs;
        const char *frame;
        int head_is_known; /* the client may use the head's frame */
    } rows[] = {{1, 0, 0, 0, "scene", 1},
                {1, 1, 0, 0, "scene", 0},
                {1, 0, 1, 0, "scene", 0},
                {1, 0, 0, 1, "the stream's CRS", 0},
                {0, 1, 0, 0, "scene", 0}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        begin();
        stream.info.geo = rows[i].geo;
        stream.info.moving = rows[i].moving;
        stream.info.crs = rows[i].crs;
        stream.is_moved = rows[i].is_moved;
        const struct cloud cloud = cloud_of(0, N);
        struct verdict_points m = try(&cloud, 1e-5);
        assert_string_equal(m.frame, rows[i].frame);
        assert_int_equal(m.unknown, 0);
        turn_to_head();
        m = try(&cloud, 1e-5);
        assert_int_equal(m.unknown == 0, rows[i].head_is_known);
    }
    begin();
    stream.info.geo = 0;
    stream.is_moved = 1;
    const struct cloud cloud = cloud_of(0, N);
    assert_string_equal(try(&cloud, 1e-5).frame, "head");
    for (int i = 0; i < N; i++) { /* in the scene */
        theirs[i][0] = 3.0 - xyz[i][1];
        theirs[i][1] = -2.0 + xyz[i][0];
        theirs[i][2] = 1.5 + xyz[i][2];
    }
    assert_true(try(&cloud, 1e-5).unknown > N / 2);
}

static void test_rounding(void **state)
{
    (void)state;
    static const struct {
        double xyz[2][3], unit_m;
    } texts[] = {
        {{{1.234, 10.5, -100.257}, {0.001, 2.0, 3.0}}, 1e-3},     /* %.3f */
        {{{1.23457, 12.3457, -123.457}, {0.123457, 2, 3}}, 1e-3}, /* %g has six digits */
        {{{5.0, 6.0, 7.0}, {8.0, 9.0, 4.0}}, 1.0},
        {{{0.0, 0.0, 0.0}, {NAN, NAN, NAN}}, 1.0},
        {{{1.2345, 2.0, 3.0}, {4.0, 5.0, 6.0}}, 1e-4}, /* any coordinate may have the most digits */
        {{{1.0, 2.0, 3.25}, {4.0, 5.0, 6.0}}, 1e-2},
        {{{1.0, 2.0, 3.0}, {4.0, 5.0, 6.125}}, 1e-3},
    };
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++) {
        double points[2][3];
        memcpy(points, texts[i].xyz, sizeof points);
        struct cloud cloud = {.n = 2, .xyz_m = points, .is_text = 1};
        assert_true(fabs(match_unit_m(&cloud, 1e3) - texts[i].unit_m) < 1e-12);
        cloud.is_text = 0;
        cloud.count_m = 2e-6;
        assert_true(fabs(match_unit_m(&cloud, 1e3) - 2e-6) <= 0.0);
    }
    for (int i = 0; i < 6; i++) { /* the largest coordinate, of whichever point, has 2^-14 m as its last place */
        double points[2][3] = {{1, 2, 3}, {4, 5, 6}};
        points[i / 3][i % 3] = i % 2 == 0 ? 1000.0 : -1000.0;
        const struct cloud cloud = {.n = 2, .xyz_m = points, .is_single = 1};
        assert_true(fabs(match_unit_m(&cloud, 1e3) / (2.0 / 16384.0) - 1.0) < 0.03); /* 1000 is not quite 2^10 */
    }
}

/* A number that no head can have says nothing of how the others are rounded. */
static void test_a_huge_coordinate(void **state)
{
    (void)state;
    for (int single = 0; single < 2; single++) {
        begin();
        struct cloud cloud = cloud_of(0, N);
        cloud.is_text = !single;
        cloud.is_single = single;
        for (int i = 0; i < N; i++)
            for (int k = 0; k < 3; k++)
                theirs[i][k] = round(1e3 * theirs[i][k]) / 1e3; /* as text has them */
        theirs[7][1] = 1e30;
        theirs[8][1] += 0.01; /* more than a millimetre, and 1e-5 m */
        cloud.count_m = 1.2e23;
        const struct verdict_points m = try(&cloud, 1e-5);
        assert_int_equal(m.unknown, 2);
        assert_int_equal(m.first_unknown, 7);
        /* Points have three decimals, and are at most 10.01 m from 0 in each direction. */
        assert_true(single ? m.unit_m > 0.0 && m.unit_m < 2e-6 : fabs(m.unit_m - 1e-3) < 1e-12);
    }
}

/* --match-mm 0 with the head's own doubles: nothing is rounded. */
static void test_exact_points(void **state)
{
    (void)state;
    begin();
    const struct cloud cloud = cloud_of(0, N);
    theirs[7][2] += 1e-7;
    struct verdict_points m = try(&cloud, 0.0);
    assert_int_equal(m.unknown, 1);
    assert_int_equal(m.repeated, 0);
    stream.n = stream.n_frames = 0; /* a head that saw nothing */
    m = try(&cloud, 0.0);
    assert_int_equal(m.unknown, N);
}

static int always(void *ctx)
{
    (void)ctx;
    return 1;
}

static void test_a_stop(void **state)
{
    (void)state;
    begin();
    const struct cloud cloud = cloud_of(0, N);
    const struct sh_report report = {.stop = always};
    const struct match_input in = {
        .stream = &stream, .watch = &watch, .tick_ns = TICK_NS, .cloud = &cloud, .match_m = 100.0, .report = &report};
    struct verdict_points match;
    struct sh_err err;
    assert_int_equal(match_points(&in, &match, &err), SH_ESTOPPED);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_right_client),
        cmocka_unit_test(test_unknown_and_empty),
        cmocka_unit_test(test_repeated),
        cmocka_unit_test(test_dense_points),
        cmocka_unit_test(test_frames),
        cmocka_unit_test(test_most_points_decide),
        cmocka_unit_test(test_frames_that_are_not_tried),
        cmocka_unit_test(test_rounding),
        cmocka_unit_test(test_a_huge_coordinate),
        cmocka_unit_test(test_exact_points),
        cmocka_unit_test(test_a_stop),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
