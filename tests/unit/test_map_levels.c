/* SPDX-License-Identifier: MIT */
/* Pixels of a scan map: levels of height tell walls from floors, and the lowest point gives the colour. */
#include <math.h>
#include <string.h>

#include "core/studio/analysis/map_inside.h"
#include "tests/common/cases.h"

static struct map *make(double pixel_m)
{
    const struct map_spec spec = {{0, 0}, {20 * pixel_m, 10 * pixel_m}, pixel_m};
    struct map *map = NULL;
    struct sh_err err;
    if (map_create(&spec, &map, &err) != SH_OK) fail_msg("%s", err.text);
    return map;
}

/* Adds a point in the middle of a pixel, z_m high. */
static void add(struct map *map, int column, int row, double z_m)
{
    const double x = (column + 0.5) * map->pixel_m, y = (row + 0.5) * map->pixel_m;
    map_add_points(map, 1, &x, &y, &z_m);
}

/* Levels are 0.1 m high, or as high as a pixel is wide. Up to 4 levels with points, as of a floor and a ceiling, are no
 * wall; 14 are one. Levels are counted from the first point's height, whatever that is. */
static void levels_make_a_wall(void **state)
{
    (void)state;
    static const struct {
        double pixel_m, level_m;
    } rows[] = {{0.02, 0.1}, {0.1, 0.1}, {0.5, 0.5}};
    static const double first_m[] = {0, 7.04, -3.33, 1234.56};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        for (size_t f = 0; f < sizeof first_m / sizeof first_m[0]; f++)
            for (int n = 1; n <= 16; n++)
                for (int down = 0; down < 2; down++) {
                    struct map *map = make(rows[i].pixel_m);
                    for (int k = 0; k < n; k++) /* twice in each level: near its foot, and near its top */
                        for (int top = 0; top < 2; top++)
                            add(map, 5, 5,
                                first_m[f] + rows[i].level_m * ((down ? -k : k) + (top ? 0.95 : 0.02 * (k > 0))));
                    const double want = n <= 4 ? 0 : n >= 14 ? 1 : (n - 4) / 10.0;
                    const double got = map_structure(map, 5, 5);
                    if (!(fabs(got - want) < 1e-12)) fail_msg("%zu %zu %d %d: %g, not %g", i, f, n, down, got, want);
                    map_free(map);
                }
}

/* A pixel has 64 levels. Heights above and below them count as the same levels again. */
static void levels_repeat_after_64(void **state)
{
    (void)state;
    static const struct {
        int level[5], n;
    } rows[] = {{{0, 1, 2, 3, 63}, 5},  {{0, 1, 2, 3, 64}, 4},  {{0, 1, 2, 3, -1}, 5},
                {{0, 1, 2, 62, -1}, 5}, {{0, 1, 2, 63, -1}, 4}, {{0, 1, 2, 3, -64}, 4}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct map *map = make(0.1);
        for (int k = 0; k < 5; k++)
            add(map, 5, 5, 0.1 * rows[i].level[k] + (k > 0 ? 0.05 : 0));
        assert_true(fabs(map_structure(map, 5, 5) - (rows[i].n - 4) / 10.0) < 1e-12);
        map_free(map);
    }
}

/* Of the nine pixels about a place, the one with the most levels counts. */
static void neighbours_count(void **state)
{
    (void)state;
    struct map *map = make(0.1);
    for (int k = 0; k < 9; k++)
        add(map, 8, 4, 0.1 * k + 0.05);
    for (int k = 0; k < 9; k++)
        add(map, 9, 4, 0.1 * (k % 5) + 0.05); /* fewer, and the same ones */
    add(map, 0, 0, 0.05);
    add(map, 19, 9, 0.05);
    for (uint32_t row = 0; row < 10; row++)
        for (uint32_t column = 0; column < 20; column++) {
            const int near = column >= 7 && column <= 9 && row >= 3 && row <= 5;
            const int beside = column == 10 && row >= 3 && row <= 5;
            assert_true(fabs(map_structure(map, column, row) - (near ? 0.5 : beside ? 0.1 : 0)) < 1e-12);
        }
    map_free(map);
}

/* The colour of a structure and a height, by its definition: hues from blue to red, darker where there is a wall. */
static void expected_colour(double structure, double height, uint8_t rgb[3])
{
    const double hue_rad = (255 - 205 * height) * M_PI / 180, chroma = (12 + 20 * height) * (1 - 0.45 * structure);
    picture_lab(90 - 70 * structure, chroma * cos(hue_rad), chroma * sin(hue_rad), rgb);
}

static void expect_pixel(const struct map *map, const struct picture *picture, uint32_t column, uint32_t row,
                         double structure, double height)
{
    struct map_layout at;
    uint8_t want[3];
    map_get_layout(map, &at);
    const uint8_t *got =
        picture->rgb + 3 * ((size_t)(at.top + map->height - 1 - row) * picture->width + at.left + column);
    if (height < 0)
        memset(want, 255, 3);
    else
        expected_colour(structure, height, want);
    if (memcmp(got, want, 3) != 0)
        fail_msg("%u, %u: %d %d %d, not %d %d %d", column, row, got[0], got[1], got[2], want[0], want[1], want[2]);
}

/* Heights go from the lowest to the highest of the pixels' lowest points. Half a percent of the pixels are left out at
 * either end: with so few pixels that is none. A ceiling hides nothing. */
static void heights_are_hues(void **state)
{
    (void)state;
    struct map *map = make(1);
    struct picture picture;
    struct sh_err err;
    add(map, 1, 1, 100);
    add(map, 1, 1, 103);
    add(map, 6, 1, 101);
    add(map, 11, 1, 102);
    add(map, 11, 1, 102.1);
    add(map, 11, 7, 100.5);
    for (int k = 0; k < 9; k++)
        add(map, 6, 7, 100 + k + 0.5);
    assert_int_equal(map_draw_pixels(map, &picture, &err), SH_OK);
    expect_pixel(map, &picture, 1, 1, 0, 0);
    expect_pixel(map, &picture, 2, 2, 0, 0);
    expect_pixel(map, &picture, 3, 1, 0, -1);
    expect_pixel(map, &picture, 6, 1, 0, 0.5);
    expect_pixel(map, &picture, 11, 1, 0, 1);
    expect_pixel(map, &picture, 11, 7, 0, 0.25);
    expect_pixel(map, &picture, 6, 7, 0.5, 0.25);
    expect_pixel(map, &picture, 15, 5, 0, -1);
    picture_free(&picture);
    map_free(map);
    map = make(1);
    add(map, 3, 3, 12);
    add(map, 9, 3, 12); /* all of one height */
    assert_int_equal(map_draw_pixels(map, &picture, &err), SH_OK);
    expect_pixel(map, &picture, 3, 3, 0, 0);
    picture_free(&picture);
    map_free(map);
}

/* Half a percent of 401 pixels is 2.005, so the scale leaves out the two lowest and the two highest. From the lowest to
 * the highest there are 1024 steps, and the scale ends at the end of a step. A pixel shows the lowest of its
 * neighbours. */
static void a_few_heights_are_beyond(void **state)
{
    (void)state;
    const struct map_spec spec = {{0, 0}, {401, 1}, 1};
    struct map *map = NULL;
    struct picture picture;
    struct sh_err err;
    const double step_m = 1400.0 / 1024, low_m = -500 + step_m * floor(502 / step_m),
                 high_m = -500 + step_m * (floor(898 / step_m) + 1);
    assert_int_equal(map_create(&spec, &map, &err), SH_OK);
    for (int k = 0; k < 401; k++)
        add(map, k, 0, k == 0 ? -500 : k == 400 ? 900 : k);
    assert_int_equal(map_draw_pixels(map, &picture, &err), SH_OK);
    for (uint32_t k = 0; k < 401; k++) {
        const double lowest_m = k < 2 ? -500.0 : k - 1.0;
        expect_pixel(map, &picture, k, 0, 0, fmin(1, fmax(0, (lowest_m - low_m) / (high_m - low_m))));
    }
    picture_free(&picture);
    map_free(map);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(levels_make_a_wall),     cmocka_unit_test(neighbours_count),
        cmocka_unit_test(heights_are_hues),       cmocka_unit_test(a_few_heights_are_beyond),
        cmocka_unit_test(levels_repeat_after_64),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
