/* SPDX-License-Identifier: MIT */
/* Colours of surfaces: their textures as they are, texel by texel. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/colour.h"
#include "core/rng.h"
#include "core/surface.h"
#include "core/surface/found.h"

/* An image's rows go from the top down. Labels with the same image share it. */
struct surface_image {
    struct texture_frame frame;
    uint32_t users;
    const struct scene_texture *from;
    uint8_t rgb[][3];
};

int surface_colours_alloc(uint32_t n, struct surface_colours *colours, struct sh_err *err)
{
    *colours = (struct surface_colours){.n = n};
    colours->own = calloc((size_t)n + 1, sizeof *colours->own);
    colours->image = calloc((size_t)n + 1, sizeof *colours->image);
    colours->by_vertex = calloc((size_t)n + 1, 1);
    if (colours->own != NULL && colours->image != NULL && colours->by_vertex != NULL) return SH_OK;
    surface_colours_free(colours);
    return sh_fail(err, SH_ENOMEM, "no memory for colours of %u surfaces", n);
}

void surface_colours_free(struct surface_colours *colours)
{
    for (uint32_t i = 0; colours->image != NULL && i < colours->n; i++)
        if (colours->image[i] != NULL && --colours->image[i]->users == 0) free(colours->image[i]);
    free(colours->image);
    free(colours->own);
    free(colours->by_vertex);
    free(colours->found);
    *colours = (struct surface_colours){.n = 0};
}

void surface_colours_set(struct surface_colours *colours, uint32_t label, const struct scene_surface *named)
{
    uint8_t rgb[3];
    memcpy(rgb, colour_grey, sizeof rgb);
    for (int i = 0; i < 3 && named->has_colour; i++)
        rgb[i] = (uint8_t)lrint(255.0 * fmin(1.0, fmax(0.0, (double)named->colour[i])));
    colours->own[label] = colour_packed(rgb);
    colours->by_vertex[label] = named->vertex_colours != SCENE_COLOURS_NONE;
}

static int colours_load(const struct scene_texture *from, struct surface_image **out, struct sh_err *err)
{
    struct texture_image image;
    struct surface_image *to = NULL;
    int rc = scene_read_texture(from, 0, &image, err);
    const size_t n = rc == SH_OK ? (size_t)image.width * image.height : 0;
    if (rc == SH_OK) to = malloc(sizeof *to + n * sizeof *to->rgb);
    if (rc == SH_OK && to == NULL) rc = sh_fail(err, SH_ENOMEM, "%s: no memory", from->file);
    if (to != NULL)
        *to =
            (struct surface_image){.frame = {image.width, image.height, {from->wrap[0], from->wrap[1]}}, .from = from};
    for (size_t i = 0; i < n && to != NULL; i++)
        memcpy(to->rgb[i], image.rgba + 4 * i, sizeof to->rgb[i]);
    texture_image_free(&image);
    *out = to;
    return rc;
}

struct wanted {
    const struct surface_colours *colours;
    const struct scene_texture *from;
};

static int is_wanted(const void *ctx, uint32_t label)
{
    const struct wanted *w = ctx;
    return w->colours->image[label]->from == w->from;
}

int surface_colours_texture(struct surface_colours *colours, uint32_t label, const struct scene_texture *texture,
                            struct sh_err *err)
{
    const struct wanted wanted = {colours, texture};
    const uint64_t hash = rng_mix((uint64_t)(uintptr_t)texture);
    uint32_t *slot = surface_found_slot(&colours->found, colours->n, hash, is_wanted, &wanted);
    if (slot == NULL) return sh_fail(err, SH_ENOMEM, "no memory for textures");
    struct surface_image *image = *slot != 0 ? colours->image[*slot - 1] : NULL;
    int rc = image == NULL ? colours_load(texture, &image, err) : SH_OK;
    if (rc != SH_OK) return rc;
    if (*slot == 0) *slot = label + 1;
    image->users++;
    colours->image[label] = image;
    return SH_OK;
}

uint32_t surface_colour(const struct surface_colours *colours, uint32_t label, const double uv[2], const uint8_t rgb[3])
{
    label = surface_of_label(label);
    if (label >= colours->n) return colour_packed(colour_grey);
    const struct surface_image *image = uv != NULL ? colours->image[label] : NULL;
    const int64_t at = image != NULL ? texture_at(&image->frame, uv) : -1;
    return at >= 0 ? colour_packed(image->rgb[at]) : rgb != NULL ? colour_packed(rgb) : colours->own[label];
}
