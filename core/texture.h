/* SPDX-License-Identifier: MIT */
/* Images that lie on a mesh. In: a file, or bytes within one, and texture coordinates. Out: texels as 8 bits
 * of red, green, blue and alpha; which texel lies at a coordinate; the holes that alpha cuts out.
 *
 * PNG, JPEG, TGA and BMP are read through stb_image, WebP through libwebp, and images that Assimp gives are unpacked
 * already. An image has up to TEXTURE_MAX_SIDE texels a side, TEXTURE_MAX_TEXELS in all, and a file of up to
 * TEXTURE_MAX_FILE bytes; decoding takes up to TEXTURE_MAX_MEMORY bytes, whatever the file says of itself. Only the
 * memory that libwebp itself takes is not counted; it depends on the image's size. Gamma that a file names is not
 * applied: values are sRGB. Rows count from the top; the coordinate 0, 0 is the lower left corner.
 * Images and masks are constant once they are made: any thread. */
#ifndef CORE_TEXTURE_H
#define CORE_TEXTURE_H

#include <stddef.h>
#include <stdint.h>

#include "core/err.h"

enum {
    TEXTURE_MAX_SIDE = 16384,
    TEXTURE_MAX_TEXELS = 1 << 26,
    TEXTURE_MAX_FILE = 1 << 28,
    TEXTURE_MAX_MEMORY = 1 << 30,
};

/* How an image goes on beyond coordinates of 0..1, in each direction. Decal: there is no image there, and the surface
 * is as without one. */
enum texture_wrap { TEXTURE_REPEAT, TEXTURE_CLAMP, TEXTURE_MIRROR, TEXTURE_DECAL };

struct texture_source {
    const char *file;     /* read where bytes is NULL; names the image in messages */
    const uint8_t *bytes; /* of an image that lies within another file */
    size_t n_bytes;
    uint32_t raw_width, raw_height; /* bytes are blue, green, red, alpha of texels; 0: as in a file */
    int alpha_only;                 /* an image without alpha need not be decoded */
};

struct texture_image {
    uint32_t width, height;
    uint8_t *rgba; /* NULL: not decoded */
    int has_alpha; /* the file has an alpha channel (in TGA, BMP: not of zeros alone), or a PNG a transparent colour */
};

/* SH_EINPUT, naming the file: can't be read, or is larger than allowed; SH_ENOMEM. texture_image_free is due in any
 * case. */
int texture_read(const struct texture_source *source, struct texture_image *image, struct sh_err *err);
void texture_image_free(struct texture_image *image);

/* The size of an image, and how it goes on beyond its sides. */
struct texture_frame {
    uint32_t width, height;
    enum texture_wrap wrap[2];
};
/* Returns the number of the texel, row by row, at finite coordinates; -1: they are beyond a decal. */
int64_t texture_at(const struct texture_frame *frame, const double uv[2]);

/* Where an image has holes: one bit a texel. */
struct texture_mask;

/* Texels whose value is below `solid` (0..1) are holes. The value is alpha. With by_light, an image without alpha is an
 * opacity map, and the value is its luma. *out is NULL where there is no hole; else it is released with free(). */
int texture_mask_create(const struct texture_image *image, const enum texture_wrap wrap[2], double solid, int by_light,
                        struct texture_mask **out, struct sh_err *err);
/* There is no hole where uv is not finite, or beyond a decal. */
int texture_is_hole(const struct texture_mask *mask, const double uv[2]);

#endif
