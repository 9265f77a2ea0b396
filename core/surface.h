/* SPDX-License-Identifier: MIT */
/* Surfaces: how much of a pulse comes back from its hit. In: label, incidence and texel of each hit. Out: the
 * power that comes back, relative to a white target (below).
 *
 * Monostatic: source and detector look along the same line. The returned power is relative to that of a
 * white Lambertian target that fills the beam and is hit head on at the same range:
 *
 *     rho(i) = reflectance cos i + specular (m + 2)/2 cos^m(2i) cos i + retro
 *
 * - reflectance: Lambertian, radiance the same in all directions; cos i is the area the beam is spread over.
 * - specular: a lobe of cos^m about the mirror direction, which lies 2i from the way back. The lobe is normalised so
 *   that all of it adds up to `specular` (E. P. Lafortune, Y. D. Willems, Using the modified Phong reflectance model,
 *   1994); m is `gloss`.
 * - retro: sent back into a narrow cone around where it came from, at any incidence: a foil has 100 to 1000.
 *
 * Glass passes a share of the power on, at each of its surfaces, in the same direction (panes are thin: no
 * refraction). A mirror sends a share on by the law of reflection.
 *
 * Where the mesh has a colour, the reflectance is its luminance in linear sRGB (ITU-R BT.709: 0.2126 R +
 * 0.7152 G + 0.0722 B). This use of the colour is an assumption: a surface bright to the eye need not be bright at the
 * laser's wavelength. Where the mesh has a diffuse texture, the colour is multiplied by the texel at the hit,
 * channel by channel. Where the mesh has no texture but colours of its vertices, the colour interpolated at the
 * hit counts. */
#ifndef CORE_SURFACE_H
#define CORE_SURFACE_H

#include <stdint.h>

#include "core/scene.h"

struct surface {
    double reflectance;     /* Lambertian, 0..1 */
    double specular, gloss; /* 0..1; exponent of the lobe */
    double retro;           /* >= 0 */
    double glass, mirror;   /* shares of the power that are passed on, or reflected as by a mirror; 0..1 */
};

/* A configuration's rule for surfaces whose names fit (scene_name_fits). NaN: not said, and left unchanged. */
struct surface_rule {
    char object[SCENE_NAME_LEN], material[SCENE_NAME_LEN];
    struct surface surface;
};
int surface_rule_fits(const struct surface_rule *rule, const struct scene_surface *named);

/* Surfaces by label. Entry n stands for no surface at all: nothing comes back. */
struct surface_texture;
struct surface_table {
    uint32_t n;
    int has_lobes;  /* some surface is specular or retro-reflecting */
    int has_optics; /* some surface is glass or a mirror */
    int has_mirror;
    struct surface *surface;          /* [n + 1] */
    struct surface_texture **texture; /* [n + 1], an entry is NULL without texture; NULL: no surface has one */
    uint8_t *by_vertex;               /* [n + 1] 1: colours of vertices count; NULL: nowhere */
    struct surface_found *found;      /* inner state: which labels have which texture */
};

int surface_table_alloc(uint32_t n, struct surface_table *table, struct sh_err *err);
void surface_table_free(struct surface_table *table);

/* Fills entry `label` from the name and colour of a scene's surface and the first of n_rules rules that fits.
 * unknown: the reflectance where neither says one. Returns the number of that rule, -1: none fits. */
int surface_table_set(struct surface_table *table, uint32_t label, const struct scene_surface *named,
                      const struct surface_rule *rule, uint32_t n_rules, double unknown);

/* Gives labels of equal surfaces the same number: kind[n], the caller's array. */
int surface_kinds(const struct surface_table *table, uint16_t *kind, struct sh_err *err);

/* Entry `label` gets its reflectance from a texture (core/texture.h), whose gamma counts as that of sRGB. Beyond a
 * decal the entry's own reflectance counts. SH_EINPUT, naming the file: can't be read. Then, and for glass and
 * mirrors, the entry stays unchanged. */
int surface_table_texture(struct surface_table *table, uint32_t label, const struct scene_surface *named,
                          const struct scene_texture *texture, struct sh_err *err);

/* Entry `label` gets its reflectance from the colours of vertices, where a hit has no texel. Glass and mirrors stay
 * unchanged. */
int surface_table_by_vertex(struct surface_table *table, uint32_t label, struct sh_err *err);

/* Labels of hits hold the surface in their low 16 bits. Where a texture holds the reflectance, the high
 * 16 bits are 1 + 65534 times the reflectance, else 0. uv: of the hit, finite. Only for surfaces with a texture. */
uint32_t surface_texel(const struct surface_table *table, uint32_t label, const double uv[2]);
/* The same for a hit with that colour, sRGB, in place of a texel. */
uint32_t surface_texel_of(uint32_t label, const uint8_t rgb[3]);
static inline uint32_t surface_of_label(uint32_t label)
{
    return label & 0xffff;
}

/* Colours by label, for clouds that show them: the texel at a hit, as the image has it. Without a texel the hit has the
 * colour between the vertices, else the mesh's diffuse colour, else grey. Packed: red << 16 | green << 8 | blue. */
struct surface_image;
struct surface_colours {
    uint32_t n;
    uint32_t *own;                /* [n] without a texel */
    struct surface_image **image; /* [n] NULL where there is none */
    uint8_t *by_vertex;           /* [n] 1: some of its triangles have colours at their corners */
    struct surface_found *found;  /* inner state: which labels have which image */
};
int surface_colours_alloc(uint32_t n, struct surface_colours *colours, struct sh_err *err);
/* Leaves no entries. The function may be called again, and after an alloc that failed. */
void surface_colours_free(struct surface_colours *colours);
/* Sets an entry. The entry comes before its image. */
void surface_colours_set(struct surface_colours *colours, uint32_t label, const struct scene_surface *named);
/* Entry `label` gets an image. SH_EINPUT, naming the file: can't be read; the entry stays as it is. */
int surface_colours_texture(struct surface_colours *colours, uint32_t label, const struct scene_texture *texture,
                            struct sh_err *err);
/* Returns the colour of a hit. uv is finite, or NULL where it is not known; rgb is the colour between the vertices,
 * or NULL where there is none. Labels beyond the entries are grey. */
uint32_t surface_colour(const struct surface_colours *colours, uint32_t label, const double uv[2],
                        const uint8_t rgb[3]);

/* Returns the surface of a label, and entry n for one beyond the table. */
static inline const struct surface *surface_at(const struct surface_table *table, uint32_t label)
{
    label = surface_of_label(label);
    return &table->surface[label < table->n ? label : table->n];
}

/* Computes rho(i) of n hits; it is 0 for a label beyond the table. */
void surface_return(const struct surface_table *table, uint32_t n, const uint32_t *label, const double *cos_incidence,
                    double *rho);

#endif
