/* SPDX-License-Identifier: MIT */
/* The parts of a view's shading: holes that are closed, depths that are smoothed, and light on planes whose depths and
 * normals are worked out here. */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/studio/analysis/view_inside.h"

enum { W = 60, H = 50 };
static const double FOCAL = 50.0;

static struct view_place place[W * H];
static struct view view = {.focal = FOCAL, .width = W, .height = H, .place = place};
static float depth_m[W * H], light[W * H], log_depth[W * H];
static uint32_t near[W * H];

static void clear(void)
{
    for (int i = 0; i < W * H; i++)
        place[i] = (struct view_place){.order_m = INFINITY, .depth_m = INFINITY};
}

static void put(int x, int y, float depth)
{
    place[y * W + x] = (struct view_place){.order_m = depth, .depth_m = depth};
}

static void smooth(void)
{
    struct sh_err err = {0, ""};
    assert_int_equal(view_smooth(&view, depth_m, near, &err), SH_OK);
}

/* ---- holes */

static const int side[8][2] = {{1, 0}, {1, 1}, {0, 1}, {-1, 1}, {-1, 0}, {-1, -1}, {0, -1}, {1, -1}};

/* A hole is closed by points on six of its eight sides, up to three places away. The hole takes the nearest point. */
static void holes_are_closed(void **state)
{
    (void)state;
    enum { X = 20, Y = 15, AT = Y * W + X };
    for (int n = 5; n <= 8; n++)
        for (int away = 1; away <= 4; away++)
            for (int first = 0; first < 8; first++) {
                clear();
                for (int k = 0; k < n; k++) {
                    const int *s = side[(first + k) % 8];
                    put(X + away * s[0], Y + away * s[1], 10);
                }
                smooth();
                assert_int_equal(isfinite(depth_m[AT]), n >= 6 && away <= 3);
                assert_int_equal(near[AT] == AT, !isfinite(depth_m[AT]));
                assert_int_equal(isinf(depth_m[0]), 1);
            }
    for (int nearest = 0; nearest < 8; nearest++) {
        clear();
        for (int k = 0; k < 8; k++)
            put(X + (k == nearest ? 2 : 3) * side[k][0], Y + (k == nearest ? 2 : 3) * side[k][1], k == nearest ? 5 : 7);
        smooth();
        assert_int_equal(near[AT], (Y + 2 * side[nearest][1]) * W + X + 2 * side[nearest][0]);
        assert_true(depth_m[AT] == 5); /* its neighbours are holes, so nothing smoothes it */
    }
    static const int beside[4][2] = {{1, Y}, {W - 2, Y}, {X, 1}, {X, H - 2}};
    for (int i = 0; i < 4; i++) { /* the image's own edge is a side */
        clear();
        for (int k = 0; k < 8; k++)
            put(beside[i][0] + side[k][0], beside[i][1] + side[k][1], 10);
        smooth();
        assert_true(isfinite(depth_m[beside[i][1] * W + beside[i][0]]));
    }
    for (int x = 0; x < W; x += W - 1) { /* beyond the image there is no side */
        clear();
        for (int k = 0; k < 8; k++)
            if (x + side[k][0] >= 0 && x + side[k][0] < W) put(x + side[k][0], Y + side[k][1], 10);
        smooth();
        assert_true(isinf(depth_m[Y * W + x]));
        assert_int_equal(near[Y * W + x], Y * W + x);
    }
}

/* ---- smoothing */

/* Depths go up and down by e from place to place. With weights 1, 2, 2, 2 the mean of e, -e, e, -e is -e / 7. So each
 * pass leaves a seventh, with the other sign. An even slope stays, and so does a step from one surface to another. */
static void surfaces_are_smoothed(void **state)
{
    (void)state;
    const float e = 0.002f; /* 0.05 of the difference that belongs to one surface: weights are 2 to 1e-4 */
    for (int along = 0; along < 2; along++) {
        for (int y = 0; y < H; y++)
            for (int x = 0; x < W; x++)
                put(x, y, 10 + ((along ? y : x) % 2 ? -e : e));
        smooth();
        for (int i = 0; i < W * H; i++) {
            const int x = i % W, y = i / W, at = along ? y : x, n = along ? H : W;
            const int last = along ? (H - 1 - y) * W + x : y * W + W - 1 - x;
            const double off = (double)depth_m[i] - 10.0, want = (at % 2 ? -1.0 : 1.0) * (double)e / 49.0;
            /* floats at 10 err by some 1e-6; both ends are alike, but one is up where the other is down */
            assert_true(fabs(off + (double)depth_m[last] - 10.0) < 5e-6);
            assert_true(at < 8 || at >= n - 8 || fabs(off - want) < 5e-6);
        }
        assert_true(along || depth_m[20 * W] == 10 + e); /* there is nothing on one side of it */
    }
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++)
            put(x, y, x < W / 2 ? 10 + 0.01f * (float)x + 0.02f * (float)y : 12);
    smooth();
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++)
            assert_true(fabs((double)depth_m[y * W + x] - (double)place[y * W + x].depth_m) < 1e-3);
    assert_int_equal(near[7 * W + 9], 7 * W + 9);
}

/* ---- light */

/* The depth of a plane through (0, 0, 10) with that normal, at a place of the image. */
static double plane_depth(const double n[3], double x, double y)
{
    const double right = (x + 0.5 - 0.5 * W) / FOCAL, up = (0.5 * H - y - 0.5) / FOCAL;
    return 10.0 * n[2] / (n[0] * right + n[1] * up + n[2]);
}

/* Returns a sum over four distances: a weight times the mean over eight neighbours of how much nearer each one is, as
 * a logarithm from 0 to 0.06. Diagonal neighbours are 0.7 of the distance away in both axes. */
static double plane_dark(const double n[3], int x, int y)
{
    static const int reach[4][3] = {{2, 1, 14}, {5, 4, 9}, {12, 8, 5}, {28, 20, 3}};
    double dark = 0.0;
    for (int s = 0; s < 4; s++)
        for (int k = 0; k < 8; k++) {
            const int by = reach[s][k % 2], cx = x + by * side[k][0], cy = y + by * side[k][1];
            if (cx < 0 || cy < 0 || cx >= W || cy >= H) continue;
            const double nearer = log(plane_depth(n, x, y)) - log(plane_depth(n, cx, cy));
            dark += reach[s][2] * fmin(0.06, fmax(0.0, nearer)) / 8.0;
        }
    return dark;
}

static void shade(double strength)
{
    const struct view_colours colours = {.shade = strength};
    struct sh_err err = {0, ""};
    assert_int_equal(view_shade(&view, depth_m, &colours, log_depth, light, &err), SH_OK);
}

/* Lambert's law with a light at the upper left of the eye, from which 0.38 of the light comes. */
static void planes_face_the_light(void **state)
{
    (void)state;
    static const double to_light[3] = {-0.40, 0.62, -0.674};
    static const double normals[][3] = {{0, 0, -1},   {0.3, 0, -1},  {-0.3, 0, -1},
                                        {0, 0.4, -1}, {0, -0.4, -1}, {-0.5, 0.5, -1}};
    for (size_t i = 0; i < sizeof normals / sizeof normals[0]; i++)
        for (int strength = 1; strength <= 2; strength++) {
            const double *n = normals[i], length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
            const double cosine = (n[0] * to_light[0] + n[1] * to_light[1] + n[2] * to_light[2]) / length;
            for (int k = 0; k < W * H; k++)
                depth_m[k] = (float)plane_depth(n, k % W, (int)(k / W));
            shade(strength);
            for (int k = 0; k < W * H; k++) {
                const double want = (0.62 + 0.38 * fmax(0.0, cosine)) * exp(-plane_dark(n, k % W, (int)(k / W)));
                /* differences of floats over three places are good to some 1e-5 */
                assert_true(fabs((double)light[k] - pow(want, strength)) < 1e-3);
            }
        }
}

/* A sheet before a wall is as light at its edge as in its middle: the slope is that of its own surface. */
static void an_edge_is_no_slope(void **state)
{
    (void)state;
    for (int i = 0; i < W * H; i++)
        depth_m[i] = i % W < W / 2 || i / W < H / 2 ? 10.0f : 9.5f;
    shade(1.0);
    for (int y = H / 2; y < H; y++)
        for (int x = W / 2; x < W; x++)
            assert_true(fabs((double)light[y * W + x] - (0.62 + 0.38 * 0.674)) < 1e-3); /* seen straight on */
}

/* Where there is no surface it is light, and so is everything without shading. A place by itself has no slope. */
static void places_without_neighbours(void **state)
{
    (void)state;
    for (int i = 0; i < W * H; i++)
        depth_m[i] = INFINITY;
    depth_m[20 * W + 20] = 10;
    shade(1.0);
    for (int i = 0; i < W * H; i++)
        assert_true(i == 20 * W + 20 ? fabsf(light[i] - 0.8f) < 1e-6f : light[i] == 1.0f);
    shade(0.0);
    for (int i = 0; i < W * H; i++)
        assert_true(light[i] == 1.0f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(holes_are_closed),          cmocka_unit_test(surfaces_are_smoothed),
        cmocka_unit_test(planes_face_the_light),     cmocka_unit_test(an_edge_is_no_slope),
        cmocka_unit_test(places_without_neighbours),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
