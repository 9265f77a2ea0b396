/* SPDX-License-Identifier: MIT */
/* Finds the texel at a coordinate, and makes masks of holes. */
#include <math.h>
#include <stdlib.h>

#include "core/texture.h"

struct texture_mask {
    struct texture_frame frame;
    uint64_t hole[]; /* bit i % 64 of word i / 64: texel i */
};

/* The texel along a side of n; -1: beyond a decal. */
static int64_t along(double x, uint32_t n, enum texture_wrap wrap)
{
    double turn = floor(x), part = x - turn;
    switch (wrap) {
    case TEXTURE_CLAMP:
        part = fmin(1.0, fmax(0.0, x));
        break;
    case TEXTURE_MIRROR:
        part = fmod(turn, 2.0) != 0.0 ? 1.0 - part : part;
        break;
    case TEXTURE_DECAL:
        if (!(x >= 0.0 && x <= 1.0)) return -1;
        part = x;
        break;
    case TEXTURE_REPEAT:
        break;
    }
    int64_t at = (int64_t)(part * n);
    return at < (int64_t)n ? at : (int64_t)n - 1; /* at the end, or rounded to it */
}

/* The row of a coordinate, counted from the top. A point on the border of two rows of the image belongs to the lower
 * row. Where the image repeats, a point on the border of two copies belongs to the last row of the upper copy. */
static int64_t down(double y, uint32_t n, enum texture_wrap wrap)
{
    double turn = floor(y), part = y - turn;
    if (wrap == TEXTURE_REPEAT) return along(1.0 - part, n, TEXTURE_CLAMP);
    if (wrap == TEXTURE_MIRROR) return along(fmod(turn, 2.0) != 0.0 ? part : 1.0 - part, n, TEXTURE_CLAMP);
    return along(1.0 - y, n, wrap);
}

int64_t texture_at(const struct texture_frame *frame, const double uv[2])
{
    int64_t column = along(uv[0], frame->width, frame->wrap[0]), row = down(uv[1], frame->height, frame->wrap[1]);
    return column < 0 || row < 0 ? -1 : row * frame->width + column;
}

/* 0..255 of a texel: alpha, or Rec. 601's luma. */
static double value_of(const uint8_t *texel, int by_light)
{
    return by_light ? 0.299 * texel[0] + 0.587 * texel[1] + 0.114 * texel[2] : texel[3];
}

int texture_mask_create(const struct texture_image *image, const enum texture_wrap wrap[2], double solid, int by_light,
                        struct texture_mask **out, struct sh_err *err)
{
    size_t n = (size_t)image->width * image->height, words = n / 64 + 1, i = 0;
    const int light = by_light && !image->has_alpha;
    *out = NULL;
    if ((!light && !image->has_alpha) || image->rgba == NULL) return SH_OK;
    while (i < n && !(value_of(image->rgba + 4 * i, light) < 255.0 * solid))
        i++;
    if (i == n) return SH_OK;
    struct texture_mask *mask = calloc(1, sizeof *mask + words * sizeof *mask->hole);
    if (mask == NULL) return sh_fail(err, SH_ENOMEM, "no memory for a texture's holes");
    mask->frame = (struct texture_frame){image->width, image->height, {wrap[0], wrap[1]}};
    for (; i < n; i++)
        if (value_of(image->rgba + 4 * i, light) < 255.0 * solid) mask->hole[i / 64] |= 1ULL << i % 64;
    *out = mask;
    return SH_OK;
}

int texture_is_hole(const struct texture_mask *mask, const double uv[2])
{
    if (!isfinite(uv[0]) || !isfinite(uv[1])) return 0;
    int64_t at = texture_at(&mask->frame, uv);
    return at >= 0 && (mask->hole[at / 64] >> at % 64 & 1) != 0;
}
