/* SPDX-License-Identifier: MIT */
/* Textures of surfaces (core/surface.h): each label has its own image and colour, though labels may share one, and hits
 * beyond a decal have none. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/surface.h"
#include "tests/common/cases.h"

enum { LABELS = 6, IMAGES = 2 };

/* Two texels beside each other: blue, green, red and alpha of each. */
static uint8_t texels[IMAGES][8] = {{10, 20, 30, 255, 200, 100, 50, 255}, {0, 0, 255, 255, 255, 255, 255, 0}};
static char names[IMAGES][8] = {"one", "two"};
static struct sh_err err;

static void make_images(struct scene_texture texture[IMAGES])
{
    for (int i = 0; i < IMAGES; i++)
        texture[i] = (struct scene_texture){.file = names[i],
                                            .bytes = texels[i],
                                            .n_bytes = 8,
                                            .raw_width = 2,
                                            .raw_height = 1,
                                            .wrap = {TEXTURE_DECAL, TEXTURE_REPEAT}};
}

static double linear(double srgb)
{
    return srgb <= 0.04045 ? srgb / 12.92 : pow((srgb + 0.055) / 1.055, 2.4);
}

/* The luminance of a texel (IEC 61966-2-1, Rec. 709) times that of the surface's colour, channel by channel. */
static double reflectance(const uint8_t *bgra, const float *colour)
{
    static const double weight[3] = {0.2126, 0.7152, 0.0722};
    double sum = 0.0;
    for (int c = 0; c < 3; c++)
        sum += weight[c] * linear(bgra[2 - c] / 255.0) * linear(colour != NULL ? (double)colour[c] : 1.0);
    return sum;
}

static const struct {
    int image, has_colour;
    float colour[3];
} labels[LABELS] = {{0, 0, {0}},
                    {1, 0, {0}},
                    {0, 1, {0.5F, 0.25F, 0.75F}},
                    {0, 0, {0}},
                    {1, 1, {0.5F, 0.25F, 0.75F}},
                    {0, 1, {0.5F, 0.25F, 0.75F}}};

static void reflectances_of_texels(void **state)
{
    (void)state;
    struct scene_texture texture[IMAGES];
    struct surface_table table;
    make_images(texture);
    assert_int_equal(surface_table_alloc(LABELS, &table, &err), SH_OK);
    for (uint32_t i = 0; i < LABELS; i++) {
        struct scene_surface named = {.has_colour = labels[i].has_colour};
        memcpy(named.colour, labels[i].colour, sizeof named.colour);
        surface_table_set(&table, i, &named, NULL, 0, 0.5);
        assert_int_equal(surface_table_texture(&table, i, &named, &texture[labels[i].image], &err), SH_OK);
    }
    for (uint32_t i = 0; i < LABELS; i++)
        for (int k = 0; k < 2; k++) {
            const double uv[2] = {0.25 + 0.5 * k, 3.5}, beyond[2] = {1.25, 0.5};
            const double want =
                reflectance(texels[labels[i].image] + 4 * k, labels[i].has_colour ? labels[i].colour : NULL);
            const uint32_t label = surface_texel(&table, i, uv);
            double cosine = 0.5, rho;
            assert_int_equal(surface_of_label(label), i);
            assert_true(fabs((label >> 16) - (1.0 + 65534.0 * want)) < 0.51);
            surface_return(&table, 1, &label, &cosine, &rho);
            assert_true(fabs(rho - 0.5 * want) < 1e-5);
            assert_int_equal(surface_texel(&table, i, beyond), i);
        }
    /* Labels with the same image and colour share it; others don't. */
    assert_ptr_equal(table.texture[0], table.texture[3]);
    assert_ptr_equal(table.texture[2], table.texture[5]);
    assert_true(table.texture[0] != table.texture[1] && table.texture[0] != table.texture[2] &&
                table.texture[1] != table.texture[4] && table.texture[2] != table.texture[4]);
    /* A pane or a mirror stays as it is. */
    struct scene_surface plain = {.has_colour = 0};
    table.surface[0].glass = 0.5;
    const uint32_t before = surface_texel(&table, 0, (const double[2]){0.25, 0.5});
    assert_int_equal(surface_table_texture(&table, 0, &plain, &texture[1], &err), SH_OK);
    assert_int_equal(surface_texel(&table, 0, (const double[2]){0.25, 0.5}), before);
    surface_table_free(&table);
}

static void colours_of_texels(void **state)
{
    (void)state;
    static const uint8_t between[3] = {1, 2, 3};
    static const double first[2] = {0.25, 0.5}, second[2] = {0.75, 0.5}, beyond[2] = {-0.25, 0.5};
    struct scene_texture texture[IMAGES];
    struct surface_colours colours;
    make_images(texture);
    assert_int_equal(surface_colours_alloc(LABELS, &colours, &err), SH_OK);
    for (uint32_t i = 0; i < LABELS; i++) {
        struct scene_surface named = {.has_colour = labels[i].has_colour,
                                      .vertex_colours = i == 2 ? SCENE_COLOURS_SOME : SCENE_COLOURS_NONE};
        memcpy(named.colour, labels[i].colour, sizeof named.colour);
        surface_colours_set(&colours, i, &named);
        assert_int_equal(colours.by_vertex[i], i == 2);
        if (i != 3) assert_int_equal(surface_colours_texture(&colours, i, &texture[labels[i].image], &err), SH_OK);
    }
    assert_true(colours.image[0] == colours.image[2] && colours.image[0] == colours.image[5]);
    assert_true(colours.image[1] == colours.image[4] && colours.image[0] != colours.image[1]);
    for (uint32_t i = 0; i < LABELS; i++) {
        const uint8_t *of = texels[labels[i].image];
        const uint32_t own = labels[i].has_colour ? 0x8040bf : 0x808080; /* a half is 127.5, to even */
        if (i != 3) {
            assert_int_equal(surface_colour(&colours, i, first, between), of[2] << 16 | of[1] << 8 | of[0]);
            assert_int_equal(surface_colour(&colours, i | 0x70000, second, NULL), of[6] << 16 | of[5] << 8 | of[4]);
        } else {
            assert_int_equal(surface_colour(&colours, i, first, between), 0x010203);
        }
        assert_int_equal(surface_colour(&colours, i, beyond, between), 0x010203);
        assert_int_equal(surface_colour(&colours, i, NULL, between), 0x010203);
        assert_int_equal(surface_colour(&colours, i, NULL, NULL), own);
    }
    assert_int_equal(surface_colour(&colours, LABELS, first, between), 0x808080); /* grey beyond the entries */
    surface_colours_free(&colours);
    surface_colours_free(&colours);
}

/* An image that can't be read is named, and its entry stays as it is. */
static void images_that_cannot_be_read(void **state)
{
    (void)state;
    struct scene_texture texture[IMAGES];
    struct surface_table table;
    struct surface_colours colours;
    const struct scene_surface named = {.has_colour = 0};
    make_images(texture);
    texture[1].n_bytes = 7;
    assert_int_equal(surface_table_alloc(1, &table, &err), SH_OK);
    assert_int_equal(surface_table_texture(&table, 0, &named, &texture[1], &err), SH_EINPUT);
    assert_int_equal(strncmp(err.text, "two: ", 5), 0);
    assert_null(table.texture[0]);
    surface_table_free(&table);
    assert_int_equal(surface_colours_alloc(1, &colours, &err), SH_OK);
    surface_colours_set(&colours, 0, &named);
    assert_int_equal(surface_colours_texture(&colours, 0, &texture[1], &err), SH_EINPUT);
    assert_int_equal(surface_colour(&colours, 0, (const double[2]){0.25, 0.5}, NULL), 0x808080);
    surface_colours_free(&colours);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(reflectances_of_texels), cmocka_unit_test(colours_of_texels),
                                       cmocka_unit_test(images_that_cannot_be_read)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
