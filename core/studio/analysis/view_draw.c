/* SPDX-License-Identifier: MIT */
/* Makes an image of the view's places, which are samples: VIEW_SUB x VIEW_SUB in each pixel. A place gets a colour and
 * light, and a pixel the mean of its places. */
#include <math.h>
#include <stdlib.h>

#include "core/studio/analysis/view_inside.h"

struct drawing {
    float *depth_m, *light, *log_depth;
    uint32_t *near;
};

/* Light multiplies the encoded (sRGB) colour: equal steps of light then look about equal. */
static void place_colour(const struct view *view, const struct drawing *d, const struct view_colours *colours, size_t i,
                         float sum[3])
{
    uint8_t rgb[3];
    float light = 1;
    if (isfinite(d->depth_m[i])) {
        const struct view_place *p = &view->place[d->near[i]];
        for (int k = 0; k < 3; k++)
            rgb[k] = p->rgb[k];
        if (!view->has_rgb) colours->colour(colours->ctx, (double)p->value, rgb);
        light = d->light[i];
    } else {
        for (int k = 0; k < 3; k++)
            rgb[k] = colours->background[k];
    }
    for (int k = 0; k < 3; k++)
        sum[k] += light * (float)rgb[k];
}

/* Rounds to every third step: no eye sees it, and a PNG has half the size. */
static uint8_t even(float channel)
{
    return (uint8_t)(3 * (int)fminf(85, channel / 3 + 0.5f));
}

static void draw_pixels(const struct view *view, const struct drawing *d, const struct view_colours *colours,
                        struct picture *out)
{
    for (uint32_t row = 0; row < out->height; row++)
        for (uint32_t column = 0; column < out->width; column++) {
            float sum[3] = {0, 0, 0};
            for (uint32_t s = 0; s < VIEW_SUB * VIEW_SUB; s++)
                place_colour(view, d, colours,
                             (size_t)(row * VIEW_SUB + s / VIEW_SUB) * view->width + column * VIEW_SUB + s % VIEW_SUB,
                             sum);
            for (int k = 0; k < 3; k++)
                out->rgb[3 * ((size_t)row * out->width + column) + (size_t)k] = even(sum[k] / (VIEW_SUB * VIEW_SUB));
        }
}

int view_draw(const struct view *view, const struct view_colours *colours, struct picture *out, struct sh_err *err)
{
    const size_t n = (size_t)view->width * view->height;
    struct drawing d = {malloc(n * sizeof *d.depth_m), malloc(n * sizeof *d.light), malloc(n * sizeof *d.log_depth),
                        malloc(n * sizeof *d.near)};
    *out = (struct picture){0};
    int rc = d.depth_m != NULL && d.light != NULL && d.log_depth != NULL && d.near != NULL
                 ? picture_make(out, view->spec.camera.width, view->spec.camera.height, colours->background, err)
                 : sh_fail(err, SH_ENOMEM, "view: no memory for shading");
    if (rc == SH_OK) rc = view_smooth(view, d.depth_m, d.near, err);
    if (rc == SH_OK) rc = view_shade(view, d.depth_m, colours, d.log_depth, d.light, err);
    if (rc == SH_OK) draw_pixels(view, &d, colours, out);
    free(d.depth_m);
    free(d.light);
    free(d.log_depth);
    free(d.near);
    if (rc != SH_OK) picture_free(out);
    return rc;
}
