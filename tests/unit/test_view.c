/* SPDX-License-Identifier: MIT */
/* Points in perspective: their places, which are visible, their shading, and an eye that sees all. */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/colour.h"
#include "core/studio/view.h"

static const uint8_t white[3] = {255, 255, 255}, red[3] = {255, 0, 0}, blue[3] = {0, 0, 255};

static struct view *make(const double eye[3], const double look_at[3], double fov_rad, double point_m)
{
    struct view_spec spec = {
        {{eye[0], eye[1], eye[2]}, {look_at[0], look_at[1], look_at[2]}, fov_rad, 200, 150}, point_m, 1};
    struct view *view = NULL;
    struct sh_err err = {0, ""};
    if (view_create(&spec, &view, &err) != SH_OK) fail_msg("%s", err.text);
    return view;
}

static void add(struct view *view, double x, double y, double z, const uint8_t rgb[3])
{
    const double p[3] = {x, y, z};
    view_add_points(view, 1, (const double(*)[3])p, NULL, (const uint8_t(*)[3])rgb);
}

static struct picture draw(const struct view *view, double shade)
{
    const struct view_colours colours = {NULL, NULL, shade, {255, 255, 255}, NULL};
    struct picture picture;
    struct sh_err err = {0, ""};
    if (view_draw(view, &colours, &picture, &err) != SH_OK) fail_msg("%s", err.text);
    return picture;
}

static const uint8_t *at(const struct picture *p, uint32_t column, uint32_t row)
{
    return p->rgb + 3 * ((size_t)row * p->width + column);
}

/* A field of 90 degrees across 200 pixels: f = 100 / tan 45 = 100 pixels. A point that is r to the right and u above
 * the axis at depth d is at column 100 + 100 r / d, row 75 - 100 u / d. All figures here are worked out by hand. */
static void test_pinhole(void **state)
{
    (void)state;
    const struct {
        double eye[3], look_at[3], p[3], column, row, depth;
    } cases[] = {
        {{0, 0, 0}, {0, 10, 0}, {1.025, 10, 0.525}, 110.25, 69.75, 10}, /* ahead is y, right is x, up is z */
        {{5, 5, 5}, {6, 5, 5}, {9, 3, 4}, 150, 100, 4},                 /* ahead x, right -y: r 2, u -1, d 4 */
        {{5, 5, 5}, {5, 2, 5}, {4.5, 0, 5.25}, 110, 70, 5},             /* ahead -y, right -x: r 0.5, u 0.25, d 5 */
        /* down by 3-4-5: ahead (0, .6, -.8), up (0, .8, .6); 5 ahead, 1.3 right, 0.65 up */
        {{0, 0, 4}, {0, 3, 0}, {1.3, 3 + 0.65 * 0.8, 0.65 * 0.6}, 126, 62, 5},
        /* straight down: right is x, up is y; straight up: up is -y */
        {{0, 0, 5}, {0, 0, 0}, {1, 2, 1}, 125, 25, 4},
        {{0, 0, 0}, {0, 0, 1}, {1, 2, 4}, 125, 125, 4},
        /* and up: ahead (0, .6, .8), up (0, -.8, .6); 10 ahead, 1 left, 2 down */
        {{0, 0, 0}, {0, 3, 4}, {-1, 6 + 1.6, 8 - 1.2}, 90, 95, 10},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct view *view = make(cases[i].eye, cases[i].look_at, M_PI / 2, 0);
        double place[2], depth_m;
        assert_int_equal(view_project(view, cases[i].p, place, &depth_m), 1);
        assert_true(fabs(place[0] - cases[i].column) < 1e-9 && fabs(place[1] - cases[i].row) < 1e-9);
        assert_true(fabs(depth_m - cases[i].depth) < 1e-12);
        /* A point that is a pixel wide colours its own pixel and the next ones, none farther. */
        add(view, cases[i].p[0], cases[i].p[1], cases[i].p[2], red);
        struct picture picture = draw(view, 0);
        double sum[2] = {0, 0}, weight = 0;
        for (uint32_t row = 0; row < 150; row++)
            for (uint32_t column = 0; column < 200; column++) {
                const double w = 255 - at(&picture, column, row)[1];
                const int near = fabs(column + 0.5 - cases[i].column) < 1.5 && fabs(row + 0.5 - cases[i].row) < 1.5;
                assert_true(w == 0 || near);
                sum[0] += w * (column + 0.5);
                sum[1] += w * (row + 0.5);
                weight += w;
            }
        assert_true(weight > 0); /* the colour's centre is the point, to half a sample; a pixel is two samples wide */
        assert_true(fabs(sum[0] / weight - cases[i].column) <= 0.3 && fabs(sum[1] / weight - cases[i].row) <= 0.3);
        picture_free(&picture);
        view_free(view);
    }
}

/* Nearer points hide farther ones, in any order. Discs of a wall hide what is behind them. */
static void test_hidden(void **state)
{
    (void)state;
    for (int order = 0; order < 2; order++) {
        struct view *view = make((const double[3]){0, 0, 0}, (const double[3]){0, 10, 0}, M_PI / 2, 0.3);
        for (int pass = 0; pass < 2; pass++) {
            for (int i = 0; i < 21 * 21 && pass == order; i++)
                add(view, -2 + 0.2 * (i % 21), 5, -2 + 0.2 * floor(i / 21.0), red);
            for (int i = 0; i < 101 * 101 && pass != order; i++)
                add(view, -10 + 0.2 * (i % 101), 10, -10 + 0.2 * floor(i / 101.0), blue);
        }
        struct picture picture = draw(view, 0);
        /* the near wall is 4 m wide at 5 m: 80 pixels about the middle, and half a point more */
        for (uint32_t row = 0; row < 150; row++)
            for (uint32_t column = 0; column < 200; column++) {
                const double away = fmax(fabs(column + 0.5 - 100), fabs(row + 0.5 - 75));
                if (away < 39) assert_memory_equal(at(&picture, column, row), red, 3);
                if (away > 45) assert_memory_equal(at(&picture, column, row), blue, 3);
            }
        picture_free(&picture);
        view_free(view);
    }
}

/* Two overlapping discs are at the same depth. They meet halfway between their points, in either order, as do the cells
 * of two neighbours on a wall. Each disc is 20 pixels wide, and the points are 10 pixels apart: columns 95 and 105. */
static void test_overlap(void **state)
{
    (void)state;
    for (int order = 0; order < 2; order++) {
        struct view *view = make((const double[3]){0, 0, 0}, (const double[3]){0, 10, 0}, M_PI / 2, 2);
        for (int pass = 0; pass < 2; pass++)
            add(view, pass == order ? -0.5 : 0.5, 10, 0, pass == order ? red : blue);
        struct picture picture = draw(view, 0);
        for (uint32_t column = 87; column < 113; column++)
            assert_memory_equal(at(&picture, column, 75), column < 100 ? red : blue, 3);
        picture_free(&picture);
        view_free(view);
    }
}

static void test_counts(void **state)
{
    (void)state;
    struct view *view = make((const double[3]){0, 0, 0}, (const double[3]){0, 10, 0}, M_PI / 2, 0);
    const double p[][3] = {{0, 5, 0}, {0, -5, 0}, {50, 5, 0}, {NAN, NAN, NAN}, {0, 0, 0}, {0, 1e300, 0}, {0, 5, 1e9}};
    const float value[7] = {1, 1, 1, 1, 1, 1, 1};
    struct view_counts counts;
    view_add_points(view, 7, p, value, NULL);
    view_get_counts(view, &counts);
    assert_int_equal(counts.drawn, 2);
    assert_int_equal(counts.beyond, 4);
    assert_int_equal(counts.empty, 1);
    view_free(view);
}

/* A wall is 10 m away; 2 m before it is a sheet of 4 x 4 m. Without shading all have their colour. With it the wall is
 * even away from the edges, and dark beside the sheet. The sheet is not dark there. */
static void test_shade(void **state)
{
    (void)state;
    struct view *view = make((const double[3]){0, 0, 0}, (const double[3]){0, 10, 0}, M_PI / 2, 0.08);
    const uint8_t grey[3] = {240, 240, 240};
    for (int i = 0; i < 400 * 300; i++) {
        const double x = -10 + 0.05 * (i % 400), z = -7.5 + 0.05 * (double)(i / 400);
        add(view, x, 10, z, grey);
        if (fabs(x) < 2 && fabs(z) < 2) add(view, x, 8, z, grey);
    }
    struct picture plain = draw(view, 0), lit = draw(view, 1);
    for (uint32_t i = 0; i < 200 * 150; i++)
        assert_memory_equal(plain.rgb + 3 * i, grey, 3);
    const uint8_t wall = at(&lit, 30, 30)[0];
    for (uint32_t row = 20; row < 40; row++) /* seen straight on: the light is the same everywhere; steps are 3 */
        for (uint32_t column = 20; column < 60; column++)
            assert_true(abs(at(&lit, column, row)[0] - wall) <= 3);
    /* The sheet's last point is at 100 + 100 * 1.95 / 8 = 124.4, and half a pixel wide. The wall beside it is
     * dark: all four distances of the shading reach over the edge there. */
    const uint8_t beyond = at(&lit, 125, 75)[0], within = at(&lit, 122, 75)[0];
    assert_true(beyond < wall - 60);
    assert_true(abs(within - wall) <= 9);
    picture_free(&plain);
    picture_free(&lit);
    view_free(view);
}

static void test_range(void **state)
{
    (void)state;
    const struct view_spec spec = {{{0, 0, 0}, {0, 10, 0}, M_PI / 2, 200, 150}, 0, 0.5}; /* each point has one place */
    struct view *view = NULL;
    struct sh_err err;
    assert_int_equal(view_create(&spec, &view, &err), SH_OK);
    double low, high;
    assert_int_equal(view_range(view, &low, &high), 0);
    /* 20000 places, 10 to 109.995; the lowest and highest half percent are beyond 10.5 and 109.5 */
    for (int i = 0; i < 20000; i++) {
        const double p[3] = {(0.25 + 0.5 * (i % 200) - 50) / 10, 10, (0.25 + 0.5 * floor(i / 200.0) - 30) / 10};
        const float value = 10 + 0.005f * (float)i;
        view_add_points(view, 1, (const double(*)[3])p, &value, NULL);
    }
    assert_int_equal(view_range(view, &low, &high), 1);
    const double bin = 100.0 / 4096; /* the ends are those of the bins that hold these places */
    assert_true(low > 10.5 - bin && low < 10.5 + 0.01 && high > 109.5 - 0.01 && high < 109.5 + bin);
    view_free(view);
}

/* All corners of the box are in the image, and one of them is near a border, from any side. */
static void test_frame(void **state)
{
    (void)state;
    const double boxes[][2][3] = {{{-3, -2, 0}, {12, 12, 7}},
                                  {{1e6, 5e6, 100}, {1e6 + 300, 5e6 + 20, 130}},
                                  {{0, 0, 0}, {0, 0, 0.5}},
                                  {{0, 0, 0}, {100, 100, 0}}};
    for (int k = 0; k < 4 * 24; k++) {
        const double(*box)[3] = boxes[k % 4];
        struct view_spec spec = {{.fov_rad = 0.2 + 0.06 * (k / 4.0), .width = 300, .height = 200}, 0, 1};
        struct sh_err err = {0, ""};
        struct view *view;
        view_frame(box[0], box[1], 0.7 * k, -0.5 + 0.08 * (k % 24), &spec.camera);
        if (view_create(&spec, &view, &err) != SH_OK) fail_msg("%s", err.text);
        double share = 0;
        for (int c = 0; c < 8; c++) {
            const double p[3] = {box[c & 1][0], box[c >> 1 & 1][1], box[c >> 2][2]};
            double place[2], depth_m;
            assert_int_equal(view_project(view, p, place, &depth_m), 1);
            share = fmax(share, fmax(fabs(place[0] / 150 - 1), fabs(place[1] / 100 - 1)));
        }
        /* A box that is a line is not seen from within, however small it looks along its length. */
        if (!(share <= 1 && share > (k % 4 == 2 ? 0.1 : 0.85)))
            fail_msg("case %d: %g of the way to the border", k, share);
        view_free(view);
    }
}

static void test_refusals(void **state)
{
    (void)state;
    const struct {
        struct view_spec spec;
        const char *says;
    } bad[] = {
        {{{{1, 1, 1}, {1, 1, 1}, 1, 200, 150}, 0, 1}, "the eye is at its target"},
        {{{{NAN, 0, 0}, {0, 1, 0}, 1, 200, 150}, 0, 1}, "x of the eye"},
        {{{{0, 0, 0}, {0, 1, 0}, 3, 200, 150}, 0, 1}, "0.01 to 2.8"},
        {{{{0, 0, 0}, {0, 1, 0}, 1, 8, 150}, 0, 1}, "8 x 150 pixels"},
        {{{{0, 0, 0}, {0, 1, 0}, 1, 8000, 8000}, 0, 1}, "16777216"},
        {{{{0, 0, 0}, {0, 1, 0}, 1, 200, 150}, -1, 1}, "points of -1 m"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        struct view *view = NULL;
        struct sh_err err = {0, ""};
        assert_int_equal(view_create(&bad[i].spec, &view, &err), SH_EINPUT);
        assert_null(view);
        if (strstr(err.text, bad[i].says) == NULL) fail_msg("'%s' without '%s'", err.text, bad[i].says);
    }
}

static int stop(void *ctx)
{
    (void)ctx;
    return 1;
}

static void test_stopped(void **state)
{
    (void)state;
    struct view *view = make((const double[3]){0, 0, 0}, (const double[3]){0, 10, 0}, M_PI / 2, 0);
    const struct sh_report report = {.stop = stop};
    const struct view_colours colours = {NULL, NULL, 1, {255, 255, 255}, &report};
    struct picture picture;
    struct sh_err err;
    add(view, 0, 10, 0, red);
    assert_int_equal(view_draw(view, &colours, &picture, &err), SH_ESTOPPED);
    assert_null(picture.rgb);
    view_free(view);
}

static void ramp(const void *ctx, double value, uint8_t rgb[3])
{
    (void)ctx;
    view_ramp(value, rgb);
}

/* A legend and stations change the picture within its borders, for any values. */
static void test_marks(void **state)
{
    (void)state;
    struct view *view = make((const double[3]){0, 0, 0}, (const double[3]){0, 10, 0}, M_PI / 2, 0);
    struct picture picture;
    struct sh_err err;
    struct view_entry entry[VIEW_MAX_NAMES] = {{{255, 0, 0}, "a"}};
    assert_int_equal(picture_make(&picture, 200, 150, white, &err), SH_OK);
    /* One station is before the eye, one behind it, one beside the image. Two more are at nearly the same place: one
     * name fits on the left of its mark, and there is no room for the other. */
    const struct view_station stations[] = {{{1, 10, 0}, "here"},
                                            {{0, -10, 0}, "behind"},
                                            {{30, 10, 0}, "beside"},
                                            {{1.1, 10, 0}, "here"},
                                            {{1.2, 10, 0}, "or"}};
    assert_int_equal(view_draw_stations(view, &picture, stations, 3), 0);
    assert_int_equal(view_draw_stations(view, &picture, stations, 5), 1);
    assert_memory_equal(at(&picture, 110, 74), ((const uint8_t[3]){214, 39, 40}), 3);
    /* Steps of the legend that no double can represent, and a span that no double can hold, both end. */
    const struct view_colours colours = {ramp, NULL, 0, {255, 255, 255}, NULL};
    view_draw_scale(&picture, "Range", 1e15, 1e15 + 0.125, &colours);
    view_draw_scale(&picture, "Range", -1e308, 1e308, &colours);
    /* Two marks are where the name of a third could be, to its right and to its left. Both stay, and the name is left
     * out. */
    const struct view_station row[] = {{{-3, 10, -3}, "name"}, {{-1, 10, -3}, ""}, {{-5, 10, -3}, ""}};
    assert_int_equal(view_draw_stations(view, &picture, row, 3), 1);
    for (uint32_t column = 50; column <= 90; column += 20)
        assert_memory_equal(at(&picture, column, 104), ((const uint8_t[3]){214, 39, 40}), 3);
    for (uint32_t n = 1; n <= 40; n += 13)
        view_draw_names(&picture, "Things", entry, n);
    picture_free(&picture);
    view_free(view);
}

/* Returns the hue of a colour in degrees: 0 is red, 120 green, 240 blue. */
static double hue_deg(const uint8_t rgb[3])
{
    const double r = rgb[0], g = rgb[1], b = rgb[2];
    return atan2(sqrt(3.0) * (g - b), 2.0 * r - g - b) * 180.0 / M_PI;
}

/* Views have paler colours than recordings and maps, so that shading is seen. Low and high mean the same: the hue goes
 * from blue to red. Hues of view and map are at most 60 degrees apart. With one ramp reversed the ends would be 240
 * apart. */
static void low_and_high_mean_the_same_in_views(void **state)
{
    (void)state;
    for (int i = 0; i <= 20; i++) {
        uint8_t view[3], map[3];
        view_ramp(i / 20.0, view);
        colour_ramp(i / 20.0, map);
        const double apart_deg = fabs(remainder(hue_deg(view) - hue_deg(map), 360.0));
        if (apart_deg > 60.0) fail_msg("%d/20: hues %.0f and %.0f", i, hue_deg(view), hue_deg(map));
    }
    uint8_t unknown[3] = {1, 2, 3};
    view_ramp((double)NAN, unknown);
    assert_memory_equal(unknown, colour_unknown, 3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(low_and_high_mean_the_same_in_views),
        cmocka_unit_test(test_pinhole),
        cmocka_unit_test(test_hidden),
        cmocka_unit_test(test_overlap),
        cmocka_unit_test(test_counts),
        cmocka_unit_test(test_shade),
        cmocka_unit_test(test_range),
        cmocka_unit_test(test_frame),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_marks),
        cmocka_unit_test(test_stopped),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
