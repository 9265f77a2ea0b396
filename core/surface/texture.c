/* SPDX-License-Identifier: MIT */
#include "core/surface/texture.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/colour.h"
#include "core/rng.h"
#include "core/surface/found.h"

/* An image as reflectances. Its rows go from the top down. A texel is 1 + 65534 times the reflectance, as it stands in
 * the high 16 bits of a hit's label (surface_texel). Labels with the same image and colour share one texture. */
struct surface_texture {
    struct texture_frame frame;
    uint32_t users;
    const struct scene_texture *from;
    float colour[3];
    uint16_t texel[];
};

enum { CHANNELS = 3 };

void surface_textures_free(struct surface_table *table)
{
    for (uint32_t i = 0; table->texture != NULL && i <= table->n; i++)
        if (table->texture[i] != NULL && --table->texture[i]->users == 0) free(table->texture[i]);
    free(table->texture);
    free(table->by_vertex);
    free(table->found);
    table->texture = NULL;
    table->by_vertex = NULL;
    table->found = NULL;
}

static uint16_t as_texel(double reflectance)
{
    return (uint16_t)(1 + lround(65534.0 * fmin(1.0, fmax(0.0, reflectance))));
}

/* Alpha doesn't darken: texels that are no hole have the colour of the image. */
static void texture_fill(struct surface_texture *t, const uint8_t *rgba, size_t n, const float colour[CHANNELS])
{
    static const double weight[CHANNELS] = {0.2126, 0.7152, 0.0722};
    double part[CHANNELS][256];
    for (int c = 0; c < CHANNELS; c++)
        for (int v = 0; v < 256; v++)
            part[c][v] = weight[c] * colour_srgb_decode((double)colour[c]) * colour_srgb_decode(v / 255.0);
    for (size_t i = 0; i < n; i++)
        t->texel[i] = as_texel(part[0][rgba[4 * i]] + part[1][rgba[4 * i + 1]] + part[2][rgba[4 * i + 2]]);
}

static int texture_load(const struct scene_texture *from, const float colour[CHANNELS], struct surface_texture **out,
                        struct sh_err *err)
{
    struct texture_image image;
    struct surface_texture *t = NULL;
    int rc = scene_read_texture(from, 0, &image, err);
    size_t n = (size_t)image.width * image.height;
    if (rc == SH_OK) t = malloc(sizeof *t + n * sizeof *t->texel);
    if (rc == SH_OK && t == NULL) rc = sh_fail(err, SH_ENOMEM, "%s: no memory", from->file);
    if (rc == SH_OK) {
        *t = (struct surface_texture){.frame = {image.width, image.height, {from->wrap[0], from->wrap[1]}},
                                      .from = from};
        memcpy(t->colour, colour, sizeof t->colour);
        texture_fill(t, image.rgba, n, colour);
    }
    texture_image_free(&image);
    *out = t;
    return rc;
}

struct wanted {
    const struct surface_table *table;
    const struct scene_texture *from;
    const float *colour;
};

static int is_wanted(const void *ctx, uint32_t label)
{
    const struct wanted *w = ctx;
    const struct surface_texture *t = w->table->texture[label];
    return t->from == w->from && memcmp(t->colour, w->colour, sizeof t->colour) == 0;
}

static uint64_t hash_of(const struct wanted *w)
{
    uint64_t hash = rng_mix((uint64_t)(uintptr_t)w->from);
    for (int c = 0; c < CHANNELS; c++) {
        uint32_t bits;
        memcpy(&bits, &w->colour[c], sizeof bits);
        hash = rng_mix(hash + bits);
    }
    return hash;
}

int surface_table_texture(struct surface_table *table, uint32_t label, const struct scene_surface *named,
                          const struct scene_texture *texture, struct sh_err *err)
{
    static const float white[CHANNELS] = {1.0f, 1.0f, 1.0f};
    const float *colour = named->has_colour ? named->colour : white;
    const struct surface *s = &table->surface[label];
    if (s->glass > 0.0 || s->mirror > 0.0) return SH_OK;
    if (table->texture == NULL) table->texture = calloc((size_t)table->n + 1, sizeof *table->texture);
    if (table->texture == NULL) return sh_fail(err, SH_ENOMEM, "no memory for textures");
    const struct wanted wanted = {table, texture, colour};
    uint32_t *slot = surface_found_slot(&table->found, table->n, hash_of(&wanted), is_wanted, &wanted);
    if (slot == NULL) return sh_fail(err, SH_ENOMEM, "no memory for textures");
    struct surface_texture *t = *slot != 0 ? table->texture[*slot - 1] : NULL;
    int rc = t == NULL ? texture_load(texture, colour, &t, err) : SH_OK;
    if (rc != SH_OK) return rc;
    if (*slot == 0) *slot = label + 1;
    t->users++;
    table->texture[label] = t;
    return SH_OK;
}

int surface_table_by_vertex(struct surface_table *table, uint32_t label, struct sh_err *err)
{
    const struct surface *s = &table->surface[label];
    if (s->glass > 0.0 || s->mirror > 0.0) return SH_OK;
    if (table->by_vertex == NULL) table->by_vertex = calloc((size_t)table->n + 1, 1);
    if (table->by_vertex == NULL) return sh_fail(err, SH_ENOMEM, "no memory for colours of vertices");
    table->by_vertex[label] = 1;
    return SH_OK;
}

uint32_t surface_texel_of(uint32_t label, const uint8_t rgb[3])
{
    const float colour[CHANNELS] = {(float)rgb[0] / 255.0f, (float)rgb[1] / 255.0f, (float)rgb[2] / 255.0f};
    return label | (uint32_t)as_texel(surface_luminance(colour)) << 16;
}

uint32_t surface_texel(const struct surface_table *table, uint32_t label, const double uv[2])
{
    const struct surface_texture *t = table->texture[label];
    int64_t at = texture_at(&t->frame, uv);
    return at < 0 ? label : label | (uint32_t)t->texel[at] << 16;
}
