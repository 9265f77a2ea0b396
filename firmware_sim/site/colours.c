/* SPDX-License-Identifier: MIT */
/* Colours of points: the quantity of output.colour, and its limits where the configuration gives none. */
#include <math.h>

#include "firmware_sim/config/config.h"
#include "firmware_sim/site/steps.h"

/* Fills in colours and textures of surfaces. Warns of textures that can't be used, and of surfaces without colours. */
static int load_textures(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    const uint32_t n = site->detect.ghost != NULL ? site->detect.n_real : site->n_surfaces;
    struct surface_colours *colours = &site->colours.surfaces;
    struct sh_err why = {0}, first = {0};
    uint32_t failed = 0, bare = 0, partly = 0;
    int rc = surface_colours_alloc(n, colours, err);
    if (rc != SH_OK) return rc;
    for (uint32_t i = 0; i < n && rc == SH_OK; i++) {
        const struct scene_surface *surface = site_surface(site, i);
        const struct scene_texture *texture = site_texture(site, i);
        surface_colours_set(colours, i, surface);
        if (texture == NULL && !surface->has_colour) {
            bare += surface->vertex_colours == SCENE_COLOURS_NONE;
            partly += surface->vertex_colours == SCENE_COLOURS_SOME;
        }
        if (texture == NULL || texture->unreadable) continue;
        rc = sh_check_stop(report, &why);
        if (rc == SH_OK) rc = surface_colours_texture(colours, i, texture, &why);
        if (rc != SH_EINPUT) continue;
        if (failed++ == 0) first = why;
        rc = SH_OK;
    }
    if (rc != SH_OK) return sh_fail(err, rc, "%s", why.text);
    if (failed > 0)
        sh_warn(
            report,
            "%s: output.colour: %u of %u surfaces have a texture that is not used: their colour is used, or grey; the "
            "first: %s",
            site->cfg->file, failed, n, first.text);
    if (bare > 0)
        sh_warn(report,
                "%s: output.colour: texture, but %u of %u surfaces have neither texture nor colour: their points "
                "are grey",
                site->cfg->file, bare, n);
    if (partly > 0)
        sh_warn(
            report,
            "%s: output.colour: texture, but %u of %u surfaces have colours at only some of their corners: points of "
            "triangles without colours are grey",
            site->cfg->file, partly, n);
    return SH_OK;
}

static void widen(struct colour_scale *scale, double v)
{
    scale->low = fmin(scale->low, v);
    scale->high = fmax(scale->high, v);
}

/* Finds limits: the head's limits of range, the lowest and the highest place of meshes that stand, or the smallest and
 * the largest frame number in the part of the trajectory that is used. Points beyond them (a mesh that moves, a ghost,
 * noise) get the colour of the limit. */
static void find_limits(const struct site *site, struct colour_scale *scale)
{
    scale->low = INFINITY;
    scale->high = -INFINITY;
    if (scale->mode == COLOUR_RANGE) {
        widen(scale, site->cfg->profile.range_min_m);
        widen(scale, site->cfg->profile.range_max_m);
    } else if (scale->mode == COLOUR_HEIGHT) {
        widen(scale, site->scene->min_m[2]);
        widen(scale, site->scene->max_m[2]);
    } else {
        for (size_t i = 0; i < site->n_knots; i++)
            widen(scale, site->knot[i].frame);
        for (uint32_t i = 0; i < site->n_stations && site->stop != NULL; i++)
            widen(scale, site->station[i].frame);
    }
}

int site_set_up_colours(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    const struct config_output *o = &site->cfg->output;
    struct colour_scale *scale = &site->colours.scale;
    *scale = (struct colour_scale){.mode = o->colour, .low = o->colour_limits[0], .high = o->colour_limits[1]};
    for (int i = 0; i < 3; i++)
        scale->rgb[i] = (uint8_t)lrint(o->colour_rgb[i]);
    if (colour_has_limits(scale->mode) && !o->colour_limited) find_limits(site, scale);
    int rc = scale->mode == COLOUR_TEXTURE ? load_textures(site, report, err) : SH_OK;
    for (uint32_t i = 0; i < site->n_stations; i++)
        site->station[i].colour = (struct cast_colour){*scale, site->station[i].frame, &site->colours.surfaces};
    return rc;
}
