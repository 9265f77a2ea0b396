/* SPDX-License-Identifier: MIT */
/* Private to core/studio/analysis: the parts of the view. Each pixel of the image has VIEW_SUB x VIEW_SUB places.
 * Points are drawn into places, as discs (view.c). The image is made of the places (view_draw.c, view_shade.c). */
#ifndef CORE_STUDIO_ANALYSIS_VIEW_INSIDE_H
#define CORE_STUDIO_ANALYSIS_VIEW_INSIDE_H

#include "core/studio/view.h"

enum { VIEW_SUB = 2 }; /* places along a pixel's side: a pixel is the mean of its places, so that edges are smooth */

struct view_place {
    /* Depth of the disc at this place; a disc is deeper at its rim (view.h). Where several discs overlap, the disc with
     * the least depth is in front. INFINITY: there is no disc. */
    float order_m;
    float depth_m; /* of the disc's centre */
    union {
        float value;
        uint8_t rgb[4];
    };
};

struct view {
    struct view_spec spec;
    double right[3], up[3], ahead[3];
    double focal; /* in places */
    uint32_t width, height;
    struct view_place *place; /* [height][width], the upper row first */
    int has_rgb;
    struct view_counts counts;
};

/* Smooths depths within surfaces and closes small holes: depth_m[height][width]; INFINITY: nothing is there. near: for
 * each place, the index of the place that gives its colour. A place gives its own colour, or a neighbour does where a
 * hole was closed. */
int view_smooth(const struct view *view, float *depth_m, uint32_t *near, struct sh_err *err);
/* Sets light to the brightness of each place, 0..1, from these depths. log_depth: working memory for as many figures.
 * SH_ESTOPPED where colours->report asks to stop. */
int view_shade(const struct view *view, const float *depth_m, const struct view_colours *colours, float *log_depth,
               float *light, struct sh_err *err);

#endif
