/* SPDX-License-Identifier: MIT */
/* A builder gives the surfaces of its scene their labels, by name, and their textures. The builder also stores the
 * colours of vertices. */
#ifndef CORE_SCENE_BUILD_SURFACES_H
#define CORE_SCENE_BUILD_SURFACES_H

#include "core/scene/build.h"

/* The label of a pair of names; a new pair gets the next number. Pointers into the scene's surfaces last until the next
 * label. */
int build_label(struct scene_build *b, struct text_span object, struct text_span material, uint16_t *label,
                struct sh_err *err);

/* Notes which surfaces have colours at the corners of their triangles. */
void build_note_colours(struct scene *scene);

/* A texture as a reader finds it. */
struct build_image {
    struct text_span name;   /* its file, as the mesh or its library names it */
    struct text_span folder; /* of the library that names it, which counts before that of the mesh; p NULL: none */
    const void *bytes;       /* of an image within the mesh's file, else NULL */
    size_t n_bytes;
    uint32_t raw_width, raw_height; /* struct texture_source */
    enum texture_wrap wrap[2];
};
/* Sets the texture's number, from 1. After an error *number is as it was. */
int build_texture(struct scene_build *b, const struct build_image *image, uint16_t *number, struct sh_err *err);

/* Frees the index of names by which build_label finds surfaces. To be called when the scene is done, or given up. */
void build_forget_surfaces(struct scene_build *b);

/* A colour that a file says, times scale, as scene->rgb has it. Values beyond 0..255, and NaN, are limited; the colours
 * that have such values are counted. */
void build_rgb(struct scene_build *b, const double colour[3], double scale, uint8_t rgb[4]);

/* A file may have colours as real numbers, from 0 to 1 or from 0 to 255. These counts show which. Zero-initialise. */
struct build_rgb_range {
    double largest;
    uint64_t n_above, n_between; /* above 1; between 0 and 1 */
};
void build_rgb_look(struct build_rgb_range *range, double number);
/* Returns the factor that takes colours to 0..255: 1 where the file's numbers already go up to 255, else 255. The
 * numbers go up to 255 where the largest is at least 2, and more of them are above 1 than between 0 and 1. In a file
 * from 0 to 1, rounding may leave numbers just above 1, and few colours are brighter than white. */
double build_rgb_scale(const struct build_rgb_range *range);

#endif
