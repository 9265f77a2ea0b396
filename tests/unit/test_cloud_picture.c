/* SPDX-License-Identifier: MIT */
/* A cloud from above as a picture (core/studio/cloud_picture.h): its area, its pixels and their colours. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/colour.h"
#include "core/studio/cloud_picture.h"
#include "tests/common/cases.h"

static const double (*point)[3]; /* x, y, figure; x NaN: left out */

static int take(void *ctx, size_t i, double place_m[2], double *figure)
{
    (void)ctx;
    place_m[0] = point[i][0];
    place_m[1] = point[i][1];
    *figure = point[i][2];
    return !isnan(point[i][0]);
}

static struct cloud_picture make(const double (*points)[3], size_t n, double most, const double include_m[2][2])
{
    static const double none[2][2] = {{NAN, NAN}, {NAN, NAN}};
    struct cloud_picture out;
    struct sh_err err;
    struct cloud_picture_spec spec = {.n = n, .point = take, .most = most};
    memcpy(spec.include_m, include_m != NULL ? include_m : none, sizeof spec.include_m);
    point = points;
    assert_int_equal(cloud_picture_make(&spec, &out, &err), SH_OK);
    return out;
}

static void expect(const char *what, double got, double want)
{
    if (!(fabs(got - want) <= 1e-9 * fmax(1.0, fabs(want)))) fail_msg("%s: %.12g, not %.12g", what, got, want);
}

/* The pixel that a place lies in, row 0 at the top; the area consists of whole pixels. */
static const uint8_t *pixel_at(const struct cloud_picture *p, double x_m, double y_m)
{
    const double column = (x_m - p->min_m[0]) / (p->max_m[0] - p->min_m[0]) * p->image.width;
    const double row = (p->max_m[1] - y_m) / (p->max_m[1] - p->min_m[1]) * p->image.height;
    assert_true(column >= 0 && column < p->image.width && row >= 0 && row < p->image.height);
    return p->image.rgb + 3 * ((size_t)row * p->image.width + (size_t)column);
}

static void expect_figure(const struct cloud_picture *p, double x_m, double y_m, double share)
{
    uint8_t rgb[3];
    colour_ramp(share, rgb);
    assert_memory_equal(pixel_at(p, x_m, y_m), rgb, 3);
}

/* For few points the longer side has 160 pixels, and a border of 2 % lies around them. A pixel shows the mean of its
 * figures; white is a place without points, black one whose points have no figure. */
static void a_few_points(void **state)
{
    (void)state;
    static const double points[][3] = {{10, 20, 0},   {60, 20, 2},       {10, 45, 4},   {60, 45, 9}, /* over the most */
                                       {30, 30, 1},   {30.01, 30.01, 2}, {30, 30, NAN}, {40, 30, INFINITY},
                                       {NAN, 1000, 1}};
    struct cloud_picture p = make(points, sizeof points / sizeof points[0], 4, NULL);
    assert_int_equal(p.image.width, 160);
    assert_int_equal(p.image.height, 84); /* (25 + 2) / (52 / 160) = 83.1 */
    const double pixel_m = 52.0 / 160;
    expect("west", p.min_m[0], 9);
    expect("east", p.max_m[0], 61);
    expect("south", p.min_m[1], 32.5 - 42 * pixel_m);
    expect("north", p.max_m[1], 32.5 + 42 * pixel_m);
    expect_figure(&p, 10, 20, 0);
    expect_figure(&p, 60, 20, 0.5);
    expect_figure(&p, 10, 45, 1);
    expect_figure(&p, 60, 45, 1);
    expect_figure(&p, 30, 30, 1.5 / 4);
    assert_memory_equal(pixel_at(&p, 40, 30), "\0\0", 3);
    assert_memory_equal(pixel_at(&p, 50, 40), "\xff\xff\xff", 3);
    size_t n_seen = 0;
    for (size_t i = 0; i < (size_t)p.image.width * p.image.height; i++)
        n_seen += memcmp(p.image.rgb + 3 * i, "\xff\xff\xff", 3) != 0;
    assert_int_equal(n_seen, 6);
    picture_free(&p.image);
}

/* The area also holds what it is to include. Pixels there stay white. */
static void an_area_includes_more(void **state)
{
    (void)state;
    static const double points[][3] = {{0, 0, 1}, {10, 5, 1}}, more[2][2] = {{-10, -40}, {5, 60}};
    struct cloud_picture p = make(points, 2, 1, more);
    expect("south", p.min_m[1], -42);
    expect("north", p.max_m[1], 62);
    expect("west", p.min_m[0], -0.5 * p.image.width * 104 / 160);
    expect("east", p.max_m[0], 0.5 * p.image.width * 104 / 160);
    assert_int_equal(p.image.height, 160);
    assert_int_equal(p.image.width, 37); /* 24 / 0.65 = 36.9 */
    picture_free(&p.image);
    p = make(points, 0, 1, more); /* no point, but an area */
    assert_true(p.image.rgb != NULL && p.image.height == 160);
    picture_free(&p.image);
    p = make(points, 0, 1, NULL);
    assert_null(p.image.rgb);
    p = make((const double[][3]){{3, 4, 1}}, 1, 1, NULL); /* one place is at least a millimetre wide */
    assert_true(p.image.width == p.image.height && p.max_m[0] - p.min_m[0] < 0.002);
    expect_figure(&p, 3, 4, 1);
    picture_free(&p.image);
}

/* The picture of n x n points in a square has 0.8 n pixels a side: at least 160, at most 800. */
static void many_points_have_more_pixels(void **state)
{
    (void)state;
    static const struct {
        int side;
        uint32_t pixels;
    } rows[] = {{100, 160}, {300, 240}, {1010, 800}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const int side = rows[i].side;
        double(*points)[3] = calloc((size_t)side * (size_t)side, sizeof *points);
        assert_non_null(points);
        for (int k = 0; k < side * side; k++)
            points[k][0] = k % side, points[k][1] = k / side;
        struct cloud_picture p = make((const double(*)[3])points, (size_t)side * (size_t)side, 1, NULL);
        assert_int_equal(p.image.width, rows[i].pixels);
        assert_int_equal(p.image.height, rows[i].pixels);
        expect("west", p.min_m[0], -0.02 * (side - 1));
        picture_free(&p.image);
        free(points);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_few_points),
        cmocka_unit_test(an_area_includes_more),
        cmocka_unit_test(many_points_have_more_pixels),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
