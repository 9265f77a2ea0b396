/* SPDX-License-Identifier: MIT */
/* Texels of an image by coordinates, in each way of going on beyond its sides; and which of them are holes. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/texture.h"
#include "tests/common/cases.h"

enum { WIDTH = 4, HEIGHT = 3 };

/* The column of a place by the definition of glTF and OBJ: the image repeats, stays at its border, or is mirrored at
 * every second side. A border belongs to the column on its right, except the last one. */
static int column_of(double x, enum texture_wrap wrap)
{
    double part = x - floor(x);
    if (wrap == TEXTURE_CLAMP) part = x < 0 ? 0 : x > 1 ? 1 : x;
    if (wrap == TEXTURE_MIRROR && fmod(fabs(floor(x)), 2) == 1) part = 1 - part;
    if (wrap == TEXTURE_DECAL) {
        if (x < 0 || x > 1) return -1;
        part = x;
    }
    const int column = (int)(part * WIDTH);
    return column < WIDTH ? column : WIDTH - 1;
}

/* Row 0 is the upper one, at 1. A border of two rows belongs to the lower one. A border of two copies of a repeated
 * image belongs to the upper copy's last row. */
static int row_of(double y, enum texture_wrap wrap, int height)
{
    double part = y - floor(y);
    if (wrap == TEXTURE_CLAMP) part = y < 0 ? 0 : y > 1 ? 1 : y;
    if (wrap == TEXTURE_MIRROR && fmod(fabs(floor(y)), 2) == 1) part = 1 - part;
    if (wrap == TEXTURE_DECAL) {
        if (y < 0 || y > 1) return -1;
        part = y;
    }
    const int row = (int)((1 - part) * height);
    return row < height ? row : height - 1;
}

/* Places are in eighths: borders, middles, and whole numbers. */
static void each_place(const struct texture_frame *frame)
{
    for (int i = -24; i <= 24; i++)
        for (int j = -24; j <= 24; j++) {
            const double uv[2] = {i / 8.0, j / 8.0};
            const int column = column_of(uv[0], frame->wrap[0]);
            const int row = row_of(uv[1], frame->wrap[1], (int)frame->height);
            const int64_t want = column < 0 || row < 0 ? -1 : row * WIDTH + column;
            const int64_t got = texture_at(frame, uv);
            if (got != want)
                fail_msg("%d %d, %u rows, at %g %g: %ld, not %ld", (int)frame->wrap[0], (int)frame->wrap[1],
                         frame->height, uv[0], uv[1], (long)got, (long)want);
        }
}

/* With three rows no place lies on a border of two rows within the image; with four rows some do. */
static void each_way_beyond_the_sides(void **state)
{
    (void)state;
    for (int a = TEXTURE_REPEAT; a <= TEXTURE_DECAL; a++)
        for (int b = TEXTURE_REPEAT; b <= TEXTURE_DECAL; b++)
            for (uint32_t height = HEIGHT; height <= HEIGHT + 1; height++)
                each_place(&(struct texture_frame){WIDTH, height, {(enum texture_wrap)a, (enum texture_wrap)b}});
}

static struct texture_mask *mask_of(const uint8_t (*rgba)[4], int has_alpha, double solid, int by_light)
{
    static const enum texture_wrap wrap[2] = {TEXTURE_REPEAT, TEXTURE_DECAL};
    struct texture_mask *mask;
    struct sh_err err;
    const struct texture_image image = {WIDTH, HEIGHT, (uint8_t *)(uintptr_t)rgba, has_alpha};
    assert_int_equal(texture_mask_create(&image, wrap, solid, by_light, &mask, &err), SH_OK);
    return mask;
}

/* Checks that the holes are those texels, and no others. */
static void expect_holes(const struct texture_mask *mask, const int hole[WIDTH * HEIGHT])
{
    assert_non_null(mask);
    for (int row = 0; row < HEIGHT; row++)
        for (int column = 0; column < WIDTH; column++) {
            const double uv[2] = {(column + 0.5) / WIDTH - 2, 1 - (row + 0.5) / HEIGHT};
            assert_int_equal(texture_is_hole(mask, uv), hole[row * WIDTH + column]);
        }
}

/* A texel is a hole below the share, not at it: half of 255 lies between 127 and 128. Luma is that of Rec. 601; an
 * image with alpha is no opacity map. */
static void texels_below_the_share_are_holes(void **state)
{
    (void)state;
    static const uint8_t rgba[WIDTH * HEIGHT][4] = {{255, 255, 255, 127}, {0, 0, 0, 128},      {9, 9, 9, 255},
                                                    {255, 0, 0, 255},     {0, 255, 0, 0},      {0, 0, 255, 255},
                                                    {128, 128, 128, 51},  {127, 127, 127, 50}, {76, 77, 77, 255},
                                                    {255, 255, 0, 255},   {0, 0, 0, 255},      {255, 255, 255, 255}};
    static const int by_alpha[] = {1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 0, 0},
                     by_fifth[] = {0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0, 0};
    static const int by_luma[] = {0, 1, 1, 1, 0, 1, 0, 1, 1, 0, 1, 0}; /* red 76, green 150, blue 29 */
    struct texture_mask *mask = mask_of(rgba, 1, 0.5, 0);
    expect_holes(mask, by_alpha);
    const double far[2] = {0.5, 1.01}, nan_x[2] = {NAN, 0.5}, inf_y[2] = {0.5, INFINITY}, first[2] = {0.1, 0.9};
    assert_int_equal(texture_is_hole(mask, first), 1);
    assert_int_equal(texture_is_hole(mask, far), 0);
    assert_int_equal(texture_is_hole(mask, nan_x), 0);
    assert_int_equal(texture_is_hole(mask, inf_y), 0);
    free(mask);
    mask = mask_of(rgba, 1, 0.2, 0);
    expect_holes(mask, by_fifth); /* 51 is a fifth of 255 */
    free(mask);
    mask = mask_of(rgba, 0, 0.5, 1);
    expect_holes(mask, by_luma);
    free(mask);
    mask = mask_of(rgba, 1, 0.5, 1);
    expect_holes(mask, by_alpha);
    free(mask);
}

static void an_image_may_have_no_holes(void **state)
{
    (void)state;
    uint8_t rgba[WIDTH * HEIGHT][4];
    memset(rgba, 255, sizeof rgba);
    assert_null(mask_of((const uint8_t(*)[4])rgba, 1, 1.0, 0));
    rgba[WIDTH * HEIGHT - 1][3] = 254; /* the last one is looked at */
    struct texture_mask *mask = mask_of((const uint8_t(*)[4])rgba, 1, 1.0, 0);
    assert_non_null(mask);
    free(mask);
    assert_null(mask_of((const uint8_t(*)[4])rgba, 1, 0.99, 0));
    memset(rgba, 0, sizeof rgba);
    assert_null(mask_of((const uint8_t(*)[4])rgba, 1, 0.0, 0));
    assert_null(mask_of((const uint8_t(*)[4])rgba, 0, 0.5, 0)); /* no alpha */
    assert_null(mask_of(NULL, 1, 0.5, 0));                      /* not decoded */
    assert_null(mask_of(NULL, 0, 0.5, 1));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_way_beyond_the_sides),
        cmocka_unit_test(texels_below_the_share_are_holes),
        cmocka_unit_test(an_image_may_have_no_holes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
