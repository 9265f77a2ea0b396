/* SPDX-License-Identifier: MIT */
/* A cloud from above, coloured by a figure. In: places (metres, x to the right, y up) and a figure each. Out: an image
 * of the pixels' means.
 *
 * A pixel shows the mean of its points' figures: by colour_ramp, 0 is blue; `most`, and all beyond it, is red. Pixels
 * whose points have no finite figure are black. Pixels without points are white, a colour that the ramp lacks. The
 * longer side has up to CLOUD_PICTURE_PX pixels, fewer where there are few points, so that areas are filled. */
#ifndef CORE_STUDIO_CLOUD_PICTURE_H
#define CORE_STUDIO_CLOUD_PICTURE_H

#include <stddef.h>

#include "core/studio/picture.h"

enum { CLOUD_PICTURE_PX = 800, CLOUD_PICTURE_LEAST_PX = 160 };

struct cloud_picture_spec {
    size_t n;
    /* Sets the place and the figure of point i (infinite or NaN: none). Returns 0 where the point is left out. */
    int (*point)(void *ctx, size_t i, double place_m[2], double *figure);
    void *ctx;
    double most;            /* figure that is red; > 0 */
    double include_m[2][2]; /* least and largest x and y that the area must hold; NaN: the points alone decide */
};

struct cloud_picture {
    struct picture image;      /* rgb NULL: there was no point, and no area */
    double min_m[2], max_m[2]; /* the area, up to the outer borders of the pixels */
};

/* The image is freed by picture_free. */
int cloud_picture_make(const struct cloud_picture_spec *spec, struct cloud_picture *out, struct sh_err *err);

#endif
