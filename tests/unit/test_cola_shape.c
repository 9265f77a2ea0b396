/* SPDX-License-Identifier: MIT */
/* Shapes of monitored fields against a predicate of the test's own: the winding number as a sum of angles in long
 * double, and the edges by a scalar product in 128 bits. */
#include <math.h>
#include <string.h>

#include "drivers/protocol/cola_field.h"
#include "drivers/protocol/cola_shape.h"
#include "tests/common/cases.h"
#include "tests/common/thorough.h"

static struct cola_shape polygon(const int32_t (*corner)[2], uint32_t n)
{
    struct cola_shape s;
    memset(&s, 0, sizeof s);
    for (uint32_t i = 0; i < n; i++)
        assert_int_equal(cola_shape_add(&s, corner[i][0], corner[i][1]), 0);
    return s;
}

static int has(const struct cola_shape *s, int32_t x_um, int32_t y_um)
{
    const struct cola_measured m = {{x_um, y_um}, 0, 0, 1};
    return cola_shape_has(s, &m);
}

/* ---- the independent predicate */

static int is_on_edge(const struct cola_point *a, const struct cola_point *b, int32_t x, int32_t y)
{
    const __int128 ax = (__int128)a->x_um - x, ay = (__int128)a->y_um - y, bx = (__int128)b->x_um - x,
                   by = (__int128)b->y_um - y;
    return ax * by == ay * bx && ax * bx + ay * by <= 0;
}

/* Adds up the angles under which the edges are seen from the point. The sum is a whole number of turns to 1e-10, as
 * each of 128 angles has an error of 1e-19 turns. */
static int winds(const struct cola_shape *s, int32_t x, int32_t y)
{
    long double sum = 0.0L;
    for (uint32_t i = 0; i < s->n; i++) {
        const struct cola_point *a = &s->corner[i], *b = &s->corner[(i + 1) % s->n];
        if (is_on_edge(a, b, x, y)) return 1;
        const long double ax = (long double)a->x_um - x, ay = (long double)a->y_um - y, bx = (long double)b->x_um - x,
                          by = (long double)b->y_um - y;
        sum += atan2l(ax * by - ay * bx, ax * bx + ay * by);
    }
    const long double turns = sum / 6.283185307179586476925286766559L;
    assert_true(fabsl(turns - roundl(turns)) < 1e-10L);
    return lroundl(turns) != 0;
}

static int32_t any(uint64_t *random, int32_t most)
{
    return (int32_t)(case_u64(random) % (2U * (uint32_t)most + 1U)) - most;
}

/* Small coordinates put many points on edges and corners. Large ones need all bits of the products. */
static void random_polygons_agree(void **state)
{
    (void)state;
    static const int32_t most[] = {3, 6, 1000, COLA_SHAPE_REACH_UM};
    uint64_t random = 36;
    uint32_t inside = 0, on_corner = 0;
    for (uint32_t c = 0; c < (uint32_t)thorough(400000, 4000); c++) {
        const int32_t reach = most[c % 4];
        struct cola_shape s;
        memset(&s, 0, sizeof s);
        const uint32_t n = 3 + (uint32_t)(case_u64(&random) % 12);
        for (uint32_t i = 0; i < n; i++)
            cola_shape_add(&s, any(&random, reach), any(&random, reach));
        for (int k = 0; k < 20; k++) {
            const struct cola_point *at = &s.corner[case_u64(&random) % n];
            const int32_t x = k % 4 == 0 ? at->x_um : any(&random, reach);
            const int32_t y = k % 4 == 0 ? at->y_um : k % 4 == 1 ? at->y_um : any(&random, reach);
            assert_int_equal(has(&s, x, y), winds(&s, x, y));
            inside += (uint32_t)has(&s, x, y);
            on_corner += k % 4 == 0;
        }
    }
    assert_true(inside > on_corner + 1000); /* more than the corners alone */
}

/* Edges and corners belong to the field. A point one micrometre beyond an edge does not. */
static void edges_belong_to_the_field(void **state)
{
    (void)state;
    static const int32_t square[][2] = {{-1000, 500}, {1000, 500}, {1000, 2500}, {-1000, 2500}};
    const struct cola_shape s = polygon(square, 4);
    static const int32_t in[][2] = {{0, 500}, {-1000, 500}, {1000, 2500}, {1000, 501}, {-1000, 2499}, {0, 1000}};
    static const int32_t out[][2] = {{0, 499}, {-1001, 500}, {1001, 1000}, {0, 2501},
                                     {0, 0},   {2000, 2500}, {-2000, 500}};
    for (size_t i = 0; i < sizeof in / sizeof in[0]; i++)
        assert_true(has(&s, in[i][0], in[i][1]));
    for (size_t i = 0; i < sizeof out / sizeof out[0]; i++)
        assert_false(has(&s, out[i][0], out[i][1]));
}

/* A U that is open at the back, with the head within its bay and within its base. */
static void concave_fields_and_heads_inside(void **state)
{
    (void)state;
    static const int32_t u[][2] = {{-300, -300}, {-300, 300}, {-200, 300}, {-200, -200},
                                   {200, -200},  {200, 300},  {300, 300},  {300, -300}};
    const struct cola_shape s = polygon(u, 8);
    assert_false(has(&s, 0, 0));
    assert_true(has(&s, 0, -250) && has(&s, -250, 0) && has(&s, 250, 200) && has(&s, -200, 0));
    assert_false(has(&s, 0, 250));
    int32_t near_um, far_um;
    assert_true(cola_shape_cut(&s, 0.75, &near_um, &far_um)); /* backward */
    assert_int_equal(near_um, 200);
    assert_int_equal(far_um, 300);
    assert_false(cola_shape_cut(&s, 0.25, &near_um, &far_um));
    struct cola_shape empty;
    memset(&empty, 0, sizeof empty);
    assert_false(has(&empty, 0, 0));
}

/* A field that begins one micrometre beside the head does not begin at the head. One with the head on its border does,
 * and one that is behind the head is not met. */
static void fields_beside_the_head(void **state)
{
    (void)state;
    for (int turn = 0; turn < 4; turn++)
        for (int32_t from = -1; from <= 1; from++) {
            static const int32_t cosine[] = {1, 0, -1, 0}, sine[] = {0, 1, 0, -1};
            const int32_t along[] = {from, 1000, 1000, from}, across[] = {-500, -500, 500, 500};
            int32_t corner[4][2], near_um, far_um;
            for (int i = 0; i < 4; i++) {
                corner[i][0] = cosine[turn] * along[i] - sine[turn] * across[i];
                corner[i][1] = sine[turn] * along[i] + cosine[turn] * across[i];
            }
            const struct cola_shape s = polygon(corner, 4);
            assert_true(cola_shape_cut(&s, 0.25 * turn, &near_um, &far_um));
            assert_int_equal(near_um, from > 0 ? from : 0);
            assert_int_equal(far_um, 1000);
            const int behind = cola_shape_cut(&s, 0.25 * turn + 0.5, &near_um, &far_um);
            assert_int_equal(behind, from <= 0);
            if (behind) assert_true(near_um == 0 && far_um == -from);
        }
}

static int in_sector(const struct cola_shape *s, int32_t step, int32_t steps, int32_t range_um)
{
    const struct cola_measured m = cola_measured_at(step, steps, range_um);
    return cola_shape_has(s, &m);
}

/* Steps of 1/3 degree: 30 degrees are step 90, and 350 degrees are step 1050, or -30. */
static void sectors_have_their_limits(void **state)
{
    (void)state;
    struct cola_shape s = {.kind = COLA_SHAPE_SECTOR, .sector = {.inner_um = 1000, .outer_um = 2000}};
    s.sector.start_e4 = 3500000; /* 350 to 30 degrees goes across 0 */
    s.sector.span_e4 = 400000;
    static const int32_t in[] = {1050, -30, 0, 1080, 90, 1170, 1079}, out[] = {1049, -31, 91, 540, -990 + 1};
    for (size_t i = 0; i < sizeof in / sizeof in[0]; i++)
        assert_true(in_sector(&s, in[i], 1080, 1000) && in_sector(&s, in[i], 1080, 2000));
    for (size_t i = 0; i < sizeof out / sizeof out[0]; i++)
        assert_false(in_sector(&s, out[i], 1080, 1500));
    assert_false(in_sector(&s, 0, 1080, 999));
    assert_false(in_sector(&s, 0, 1080, 2001));
    s.sector.span_e4 = 0; /* one beam */
    assert_true(in_sector(&s, 1050, 1080, 1500));
    assert_false(in_sector(&s, 1051, 1080, 1500));
    s.sector.span_e4 = COLA_TURN_E4;
    for (int32_t step = -1080; step <= 2160; step++)
        assert_true(in_sector(&s, step, 1080, 1500));
    /* a third of a degree is no whole number of 1/10000: 3333 is below it, 3334 above */
    s.sector.start_e4 = 0;
    s.sector.span_e4 = 3333;
    assert_false(in_sector(&s, 1, 1080, 1500));
    s.sector.span_e4 = 3334;
    assert_true(in_sector(&s, 1, 1080, 1500));
}

/* A rectangle that is turned by 90 degrees lies to the left of its corner. */
static void rectangles_turn_about_their_corner(void **state)
{
    (void)state;
    struct cola_shape s;
    memset(&s, 0, sizeof s);
    assert_int_equal(cola_shape_rectangle(&s, (const double[2]){100, 200}, (const double[2]){30, 500}, 0.25), 0);
    assert_true(has(&s, 100, 200) && has(&s, -400, 200) && has(&s, -400, 230) && has(&s, 100, 230));
    assert_false(has(&s, 101, 210) || has(&s, 0, 199) || has(&s, 0, 231) || has(&s, -401, 210));
    memset(&s, 0, sizeof s);
    assert_int_equal(cola_shape_rectangle(&s, (const double[2]){0, 0}, (const double[2]){1e9 + 1, 1}, 0.0), -1);
    memset(&s, 0, sizeof s);
    for (int i = 0; i < COLA_SHAPE_CORNERS; i++)
        assert_int_equal(cola_shape_add(&s, i, 0), 0);
    assert_int_equal(cola_shape_add(&s, 0, 0), -1);
    assert_int_equal(cola_shape_add(&s, NAN, 0), -1);
}

/* A measured point on an axis is exact; others are within 0.71 um of range and angle, as both coordinates are
 * rounded. */
static void points_are_rounded_to_a_micrometre(void **state)
{
    (void)state;
    const struct cola_measured ahead = cola_measured_at(360, 1440, 7654321), left = cola_measured_at(-720, 1440, 12345);
    assert_true(ahead.at.x_um == 0 && ahead.at.y_um == 7654321);
    assert_true(left.at.x_um == -12345 && left.at.y_um == 0);
    for (int32_t step = -270; step <= 810; step++) {
        const struct cola_measured m = cola_measured_at(step, 1080, 20000000);
        const long double turns = (long double)step / 1080.0L * 6.283185307179586476925286766559L;
        assert_true(hypotl(m.at.x_um - 2e7L * cosl(turns), m.at.y_um - 2e7L * sinl(turns)) < 0.71L);
    }
}

/* Links at 30, 60 and 90 degrees, of a grid that is not the beams'. Between the first two the far line is the chord of
 * two points at 2 m, whose middle is at 2 cos 15 degrees = 1.931851653 m. */
static void chains_join_their_links(void **state)
{
    (void)state;
    struct cola_shape s;
    memset(&s, 0, sizeof s);
    assert_int_equal(cola_shape_link(&s, 300000, COLA_TURN_E4, 0, 2000000), 0);
    assert_int_equal(cola_shape_link(&s, 600000, COLA_TURN_E4, 1000000, 2000000), 0);
    assert_int_equal(cola_shape_link(&s, 600000, COLA_TURN_E4, 0, 1), -1);
    assert_int_equal(cola_shape_link(&s, 900000, COLA_TURN_E4, 1000001, 1000000), -1);
    assert_int_equal(cola_shape_link(&s, 900000, COLA_TURN_E4, 1000000, 1000000), 0);
    assert_true(in_sector(&s, 90, 1080, 0) && in_sector(&s, 90, 1080, 2000000));
    assert_false(in_sector(&s, 90, 1080, 2000001) || in_sector(&s, 89, 1080, 1000000));
    assert_true(in_sector(&s, 180, 1080, 1000000) && in_sector(&s, 180, 1080, 2000000));
    assert_false(in_sector(&s, 180, 1080, 999999) || in_sector(&s, 180, 1080, 2000001));
    assert_true(in_sector(&s, 270, 1080, 1000000));
    assert_false(in_sector(&s, 270, 1080, 1000001) || in_sector(&s, 271, 1080, 1000000));
    assert_true(in_sector(&s, 135, 1080, 1931850) && in_sector(&s, 135, 1080, 1000));
    assert_false(in_sector(&s, 135, 1080, 1931854));
    /* A line goes from the head to the second link's near end. The triangle before it is in the field. */
    assert_true(in_sector(&s, 179, 1080, 500000));
    assert_false(in_sector(&s, 181, 1080, 990000));
}

/* The outer arc comes first, from the start on, then the inner one back: 64 corners each. Without an inner arc the head
 * is the last corner. */
static void an_outline_of_a_sector_has_two_arcs(void **state)
{
    (void)state;
    struct cola_shape s = {.kind = COLA_SHAPE_SECTOR,
                           .sector = {.start_e4 = 900000, .span_e4 = 900000, .inner_um = 1000000, .outer_um = 2000000}};
    double at[COLA_SHAPE_CORNERS][2];
    assert_int_equal(cola_shape_outline(&s, at), 128);
    for (int i = 0; i < 128; i++) {
        const double deg = 90 + 90.0 * (i < 64 ? i : 127 - i) / 63, radius_m = i < 64 ? 2 : 1;
        assert_true(fabs(at[i][0] - radius_m * cos(deg / 180 * M_PI)) < 1e-12); /* some roundings of 2 m */
        assert_true(fabs(at[i][1] - radius_m * sin(deg / 180 * M_PI)) < 1e-12);
    }
    s.sector.inner_um = 0;
    assert_int_equal(cola_shape_outline(&s, at), 65);
    assert_true(fabs(at[63][0] + 2) < 1e-12 && at[64][0] == 0 && at[64][1] == 0);
    static const int32_t corner[3][2] = {{1000000, 0}, {0, 2000000}, {-3000000, 0}};
    s = polygon(corner, 3);
    assert_int_equal(cola_shape_outline(&s, at), 3);
    for (int i = 0; i < 3; i++)
        assert_true(fabs(at[i][0] - 1e-6 * corner[i][0]) < 1e-12 && fabs(at[i][1] - 1e-6 * corner[i][1]) < 1e-12);
    s.kind = COLA_SHAPE_CHAIN;
    assert_int_equal(cola_shape_outline(&s, at), 0);
}

/* Lengths of a record may be 0, and up to the reach of shapes; scale and offset are its own. */
static void lengths_at_their_limits(void **state)
{
    (void)state;
    const struct planar_head head = {.known = 1, .steps = 1080, .n = 811, .last = 810, .front = 405};
    static const struct {
        float scale, offset;
        uint16_t counts;
        int32_t um; /* -1: refused */
    } rows[] = {{1, 0, 0, 0},
                {1, -700, 700, 0},
                {1, -700, 699, -1},
                {2, 5, 100, 205000},
                {20, 0, 50000, COLA_SHAPE_REACH_UM},
                {20, 1, 50000, -1}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        const struct cola_record r = {.scale = rows[i].scale,
                                      .offset = rows[i].offset,
                                      .step_e4 = 3333,
                                      .type = COLA_FIELD_RECTANGLE,
                                      .is_rectangle = 1,
                                      .distance = rows[i].counts,
                                      .angle_e4 = 1800000,
                                      .width_mm = 1000,
                                      .length_mm = 2000};
        struct cola_shape shape;
        const enum cola_error error = cola_record_shape(&r, &head, 0, &shape);
        assert_int_equal(error, rows[i].um >= 0 ? COLA_OK : COLA_INVALID_DATA);
        if (error == COLA_OK) assert_int_equal(shape.corner[0].x_um, -rows[i].um);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(random_polygons_agree),           cmocka_unit_test(edges_belong_to_the_field),
        cmocka_unit_test(concave_fields_and_heads_inside), cmocka_unit_test(fields_beside_the_head),
        cmocka_unit_test(sectors_have_their_limits),       cmocka_unit_test(rectangles_turn_about_their_corner),
        cmocka_unit_test(lengths_at_their_limits),         cmocka_unit_test(points_are_rounded_to_a_micrometre),
        cmocka_unit_test(chains_join_their_links),         cmocka_unit_test(an_outline_of_a_sector_has_two_arcs),
    };
    return cmocka_run_group_tests_name("cola shape", tests, NULL, NULL);
}
