/* SPDX-License-Identifier: MIT */
#include "core/surface.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/colour.h"
#include "core/surface/texture.h"
#include "core/vecmath.h"

enum { FIELDS = sizeof(struct surface) / sizeof(double) };
_Static_assert(sizeof(struct surface) == 6 * sizeof(double), "gathered as doubles");

int surface_table_alloc(uint32_t n, struct surface_table *table, struct sh_err *err)
{
    *table = (struct surface_table){.n = n};
    table->surface = calloc((size_t)n + 1, sizeof *table->surface);
    return table->surface != NULL ? SH_OK : sh_fail(err, SH_ENOMEM, "no memory for %u surfaces", n);
}

void surface_table_free(struct surface_table *table)
{
    surface_textures_free(table);
    free(table->surface);
    table->surface = NULL;
}

double surface_luminance(const float rgb[3])
{
    return 0.2126 * colour_srgb_decode((double)rgb[0]) + 0.7152 * colour_srgb_decode((double)rgb[1]) +
           0.0722 * colour_srgb_decode((double)rgb[2]);
}

int surface_rule_fits(const struct surface_rule *rule, const struct scene_surface *named)
{
    return scene_name_fits(rule->object, named->object) && scene_name_fits(rule->material, named->material);
}

int surface_table_set(struct surface_table *table, uint32_t label, const struct scene_surface *named,
                      const struct surface_rule *rule, uint32_t n_rules, double unknown)
{
    struct surface *s = &table->surface[label];
    int found = -1;
    *s = (struct surface){.reflectance = named->has_colour ? surface_luminance(named->colour) : unknown};
    for (uint32_t i = 0; i < n_rules && found < 0; i++)
        if (surface_rule_fits(&rule[i], named)) found = (int)i;
    if (found >= 0) {
        double field[FIELDS], said[FIELDS];
        memcpy(field, s, sizeof field);
        memcpy(said, &rule[found].surface, sizeof said);
        for (int k = 0; k < FIELDS; k++)
            if (!isnan(said[k])) field[k] = said[k];
        memcpy(s, field, sizeof field);
        /* A pane scatters light that it doesn't pass on, according to its colour; a mirror scatters
         * none. */
        if (isnan(rule[found].surface.reflectance)) s->reflectance *= s->mirror > 0.0 ? 0.0 : 1.0 - s->glass;
    }
    table->has_lobes |= s->specular > 0.0 || s->retro > 0.0;
    table->has_mirror |= s->mirror > 0.0;
    table->has_optics |= s->glass > 0.0 || s->mirror > 0.0;
    return found;
}

struct named_surface {
    struct surface surface; /* the first member, since by_surface compares what the struct begins with */
    uint32_t label;
};

static int by_surface(const void *a, const void *b)
{
    return memcmp(a, b, sizeof(struct surface));
}

int surface_kinds(const struct surface_table *table, uint16_t *kind, struct sh_err *err)
{
    struct named_surface *all = calloc(table->n + 1, sizeof *all);
    uint16_t kinds = 0;
    if (all == NULL) return sh_fail(err, SH_ENOMEM, "surfaces: no memory for %u of them", table->n);
    for (uint32_t i = 0; i < table->n; i++)
        all[i] = (struct named_surface){table->surface[i], i};
    qsort(all, table->n, sizeof *all, by_surface);
    for (uint32_t i = 0; i < table->n; i++) {
        kinds = (uint16_t)(kinds + (i > 0 && by_surface(&all[i - 1], &all[i]) != 0));
        kind[all[i].label] = kinds;
    }
    free(all);
    return SH_OK;
}

VEC_CLONES
static void lambert(const double *restrict field, uint32_t surfaces, uint32_t n, const uint32_t *restrict label,
                    const double *restrict cosi, double *restrict rho)
{
    for (uint32_t i = 0; i < n; i++)
        rho[i] = field[(int64_t)(label[i] < surfaces ? label[i] : surfaces) * FIELDS] * cosi[i];
}

static void lambert_texels(const struct surface_table *table, uint32_t n, const uint32_t *label, const double *cosi,
                           double *rho)
{
    for (uint32_t i = 0; i < n; i++) {
        uint32_t texel = surface_of_label(label[i]) < table->n ? label[i] >> 16 : 0;
        rho[i] = cosi[i] * (texel != 0 ? (texel - 1) / 65534.0 : surface_at(table, label[i])->reflectance);
    }
}

VEC_CLONES
static void lobes(const double *restrict field, uint32_t surfaces, uint32_t n, const uint32_t *restrict label,
                  const double *restrict cosi, double *restrict rho)
{
    for (uint32_t i = 0; i < n; i++) {
        uint32_t own = label[i] & 0xffff;
        int64_t at = (int64_t)(own < surfaces ? own : surfaces) * FIELDS;
        double specular = field[at + 1], gloss = field[at + 2], retro = field[at + 3];
        double c2 = 2.0 * cosi[i] * cosi[i] - 1.0;
        double lobe = vec_exp(gloss * vec_log(c2 > 1e-300 ? c2 : 1e-300));
        lobe = c2 > 0.0 ? lobe : 0.0;
        rho[i] += specular * 0.5 * (gloss + 2.0) * lobe * cosi[i] + retro;
    }
}

void surface_return(const struct surface_table *table, uint32_t n, const uint32_t *label, const double *cos_incidence,
                    double *rho)
{
    const double *field = &table->surface[0].reflectance;
    if (table->texture != NULL || table->by_vertex != NULL)
        lambert_texels(table, n, label, cos_incidence, rho);
    else
        lambert(field, table->n, n, label, cos_incidence, rho);
    if (table->has_lobes) lobes(field, table->n, n, label, cos_incidence, rho);
}
