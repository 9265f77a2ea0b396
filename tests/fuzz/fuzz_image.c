/* SPDX-License-Identifier: MIT */
/* This fuzzes images that lie on meshes: PNG, JPEG, TGA, BMP, and texels as a mesh's file holds them. The input is
 * three bytes, then the image. A decoded image must have all its texels, and must answer about a hole at any
 * coordinate. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/texture.h"
#include "tests/fuzz/rig.h"

/* Asks for holes at coordinates of all kinds, some of them infinite. */
static void ask_holes(const struct texture_image *image, unsigned how, struct sh_err *err)
{
    static const double uv[][2] = {{0, 0},     {0.999999, 0.5}, {-1e300, 1e300}, {1, 1},
                                   {NAN, 0.5}, {INFINITY, 0},   {-0.0, 2.5}};
    const enum texture_wrap wrap[2] = {(enum texture_wrap)(how >> 2 & 3), (enum texture_wrap)(how >> 4 & 3)};
    struct texture_mask *mask = NULL;
    if (texture_mask_create(image, wrap, 0.5, (how & 1) != 0, &mask, err) != SH_OK) {
        fuzz_must_be_line(err);
        return;
    }
    for (size_t i = 0; mask != NULL && i < sizeof uv / sizeof uv[0]; i++)
        texture_is_hole(mask, uv[i]);
    free(mask);
}

/* A small file may ask for 2^26 texels, and reading them all takes too long. So this reads about 4,096 bytes and the
 * last one. */
static unsigned sum_of(const struct texture_image *image)
{
    unsigned sum = 0;
    const size_t n = 4 * (size_t)image->width * image->height;
    for (size_t i = 0; image->rgba != NULL && i < n; i += 1 + n / 4096)
        sum += image->rgba[i];
    return n > 0 && image->rgba != NULL ? sum + image->rgba[n - 1] : sum;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct fuzz_bytes in = {data, size};
    const unsigned how = fuzz_u8(&in), width = fuzz_u8(&in), height = fuzz_u8(&in);
    struct texture_source source = {.file = "in.png", .bytes = in.p, .n_bytes = in.n, .alpha_only = (how & 2) != 0};
    struct texture_image image = {0};
    struct sh_err err = {0};
    if ((how & 64) != 0) source.raw_width = width, source.raw_height = height;
    if ((how & 128) != 0) source.bytes = NULL, source.n_bytes = 0, source.file = fuzz_file(".png", in.p, in.n);
    if (texture_read(&source, &image, &err) == SH_OK) {
        fuzz_must(sum_of(&image) <= 255 * 8200, "all texels can be read");
        if (image.rgba != NULL) ask_holes(&image, how, &err);
    } else {
        fuzz_must_be_line(&err);
    }
    texture_image_free(&image);
    return 0;
}
