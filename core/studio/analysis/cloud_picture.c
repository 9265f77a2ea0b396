/* SPDX-License-Identifier: MIT */
#include "core/studio/cloud_picture.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/colour.h"

struct pixel {
    float sum;
    uint32_t n, n_none; /* with and without a figure */
};

static void include(struct cloud_picture *p, const double m[2])
{
    for (int k = 0; k < 2; k++) {
        p->min_m[k] = fmin(p->min_m[k], m[k]);
        p->max_m[k] = fmax(p->max_m[k], m[k]);
    }
}

/* Returns how many points there are. */
static size_t find_area(const struct cloud_picture_spec *spec, struct cloud_picture *p)
{
    size_t n = 0;
    double m[2], figure;
    for (int k = 0; k < 2; k++) {
        p->min_m[k] = fmin((double)INFINITY, spec->include_m[0][k]);
        p->max_m[k] = fmax(-(double)INFINITY, spec->include_m[1][k]);
    }
    for (size_t i = 0; i < spec->n; i++) {
        if (!spec->point(spec->ctx, i, m, &figure)) continue;
        n++;
        include(p, m);
    }
    return n;
}

/* Adds a margin of 2 % on each side, and makes the area whole pixels. Returns the size of a pixel. */
static double choose_pixels(struct cloud_picture *p, size_t n)
{
    double span[2], longer = 1e-3;
    for (int k = 0; k < 2; k++)
        longer = fmax(longer, p->max_m[k] - p->min_m[k]);
    const double side = fmin(fmax(0.8 * sqrt((double)n), CLOUD_PICTURE_LEAST_PX), CLOUD_PICTURE_PX);
    const double pixel_m = 1.04 * longer / side;
    for (int k = 0; k < 2; k++) {
        const double middle = 0.5 * (p->min_m[k] + p->max_m[k]);
        span[k] = fmax(ceil((p->max_m[k] - p->min_m[k] + 0.04 * longer) / pixel_m - 1e-9), 1.0);
        p->min_m[k] = middle - 0.5 * span[k] * pixel_m;
        p->max_m[k] = middle + 0.5 * span[k] * pixel_m;
    }
    p->image.width = (uint32_t)span[0];
    p->image.height = (uint32_t)span[1];
    return pixel_m;
}

static void cloud_picture_fill(const struct cloud_picture_spec *spec, const struct cloud_picture *p, double pixel_m,
                               struct pixel *pixel)
{
    double m[2], figure;
    for (size_t i = 0; i < spec->n; i++) {
        if (!spec->point(spec->ctx, i, m, &figure)) continue;
        const double column = floor((m[0] - p->min_m[0]) / pixel_m), row = floor((p->max_m[1] - m[1]) / pixel_m);
        if (!(column >= 0.0 && column < p->image.width && row >= 0.0 && row < p->image.height)) continue;
        struct pixel *at = &pixel[(size_t)row * p->image.width + (size_t)column];
        if (isfinite(figure)) {
            at->sum += (float)figure;
            at->n++;
        } else {
            at->n_none++;
        }
    }
}

/* A pixel without points is white, which the ramp lacks. In reports white is transparent. */
static void colour_of(const struct pixel *pixel, double most, uint8_t rgb[3])
{
    memset(rgb, pixel->n_none > 0 ? 0 : 255, 3);
    if (pixel->n > 0) colour_ramp(fmin((double)pixel->sum / (double)pixel->n / most, 1.0), rgb);
}

int cloud_picture_make(const struct cloud_picture_spec *spec, struct cloud_picture *out, struct sh_err *err)
{
    static const uint8_t white[3] = {255, 255, 255};
    *out = (struct cloud_picture){0};
    const size_t n = find_area(spec, out);
    if (!(out->max_m[0] >= out->min_m[0] && out->max_m[1] >= out->min_m[1])) return SH_OK;
    const double pixel_m = choose_pixels(out, n);
    const size_t n_pixels = (size_t)out->image.width * out->image.height;
    struct pixel *pixel = calloc(n_pixels, sizeof *pixel);
    int rc = pixel != NULL ? SH_OK : sh_fail(err, SH_ENOMEM, "no memory for a picture");
    if (rc == SH_OK) rc = picture_make(&out->image, out->image.width, out->image.height, white, err);
    if (rc == SH_OK) cloud_picture_fill(spec, out, pixel_m, pixel);
    for (size_t i = 0; i < n_pixels && rc == SH_OK; i++)
        colour_of(&pixel[i], spec->most, out->image.rgb + 3 * i);
    free(pixel);
    return rc;
}
