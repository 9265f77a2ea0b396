/* SPDX-License-Identifier: MIT */
/* Marks of stations, and legends, on a view. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/studio/analysis/view_inside.h"
#include "core/studio/figures.h"
#include "core/angle.h"
#include "core/colour.h"

enum { MARGIN_PX = 24, BAR_PX = 220, BAR_HEIGHT_PX = 10, SWATCH_PX = 12, MAX_NAMES = 512, MAX_TICKS = 5 };

static const uint8_t ink[3] = {40, 44, 52}, red[3] = {214, 39, 40}, white[3] = {255, 255, 255};
static const struct picture_type name_type = {11.5, 1, 2.5}, text_type = {10.5, 0, 2.5};

void view_ramp(double part, uint8_t rgb[3])
{
    if (isnan(part)) {
        memcpy(rgb, colour_unknown, 3);
        return;
    }
    const double t = fmin(1, fmax(0, part)), hue_rad = angle_rad(255 - 205 * t), chroma = 30 + 16 * t;
    picture_lab(80 - 4 * t, chroma * cos(hue_rad), chroma * sin(hue_rad), rgb);
}

static const struct picture_box NO_BOX = {INFINITY, INFINITY, -INFINITY, -INFINITY};

static int find_mark(const struct view *view, const struct picture *picture, const struct view_station *station,
                     double at[2])
{
    double depth_m;
    return view_project(view, station->p_m, at, &depth_m) && at[0] >= 0 && at[1] >= 0 && at[0] < picture->width &&
           at[1] < picture->height;
}

static void draw_mark(struct picture *picture, const double at[2])
{
    for (int k = 0; k < 2; k++) { /* white around red */
        const double size = k == 0 ? 13 : 9;
        const double corner[3][2] = {{at[0], at[1] - size},
                                     {at[0] + 0.87 * size, at[1] + 0.5 * size},
                                     {at[0] - 0.87 * size, at[1] + 0.5 * size}};
        picture_triangle(picture, corner, k == 0 ? white : red);
    }
}

/* Boxes that names must leave free: other names, and the marks of other stations. */
struct taken {
    struct picture_box *name, *mark; /* [n_names], [n_marks]; a mark that is not in the image is an empty box */
    uint32_t n_names, n_marks;
};

static int is_free(const struct taken *taken, const struct picture_box *own, uint32_t own_mark)
{
    for (uint32_t i = 0; i < taken->n_names; i++)
        if (picture_box_overlaps(own, &taken->name[i])) return 0;
    for (uint32_t i = 0; i < taken->n_marks; i++)
        if (i != own_mark && picture_box_overlaps(own, &taken->mark[i])) return 0;
    return 1;
}

/* Draws a name to the right of its mark, or to the left of it. Returns 0 where neither has room. */
static int draw_name(struct picture *picture, const double at[2], const char *name, uint32_t mark, struct taken *taken)
{
    const double width = picture_text_width(&name_type, name);
    for (int left = 0; left < 2; left++) {
        const double x = at[0] + (left ? -14 - width : 14);
        const struct picture_box own = {x - 3, at[1] - 9, x + width + 3, at[1] + 8};
        if (x < 4 || x + width > picture->width - 4 || !is_free(taken, &own, mark)) continue;
        picture_text(picture, (const double[2]){x, at[1] + 5}, PICTURE_LEFT, &name_type, ink, name);
        taken->name[taken->n_names++] = own;
        return 1;
    }
    return 0;
}

uint32_t view_draw_stations(const struct view *view, struct picture *picture, const struct view_station *station,
                            uint32_t n)
{
    struct picture_box name[MAX_NAMES];
    struct taken taken = {name, malloc((n + 1) * sizeof *taken.mark), 0, n};
    uint32_t left_out = 0;
    double at[2];
    for (uint32_t i = 0; i < n; i++) {
        const int seen = find_mark(view, picture, &station[i], at);
        if (seen) draw_mark(picture, at);
        if (taken.mark != NULL)
            taken.mark[i] = seen ? (struct picture_box){at[0] - 8, at[1] - 9, at[0] + 8, at[1] + 5} : NO_BOX;
    }
    for (uint32_t i = 0; i < n; i++) {
        if (!find_mark(view, picture, &station[i], at)) continue;
        const int has_room = taken.mark != NULL && taken.n_names < MAX_NAMES; /* without memory, no names */
        left_out += !has_room || !draw_name(picture, at, station[i].name, i, &taken);
    }
    free(taken.mark);
    return left_out;
}

void view_draw_scale(struct picture *picture, const char *title, double low, double high,
                     const struct view_colours *colours)
{
    const long left = MARGIN_PX, top = (long)picture->height - MARGIN_PX - 16 - BAR_HEIGHT_PX;
    picture_text(picture, (const double[2]){(double)left, (double)top - 8}, PICTURE_LEFT, &name_type, ink, title);
    for (long i = 0; i < BAR_PX; i++) {
        uint8_t rgb[3];
        colours->colour(colours->ctx, low + (high - low) * ((double)i + 0.5) / BAR_PX, rgb);
        picture_fill(picture, left + i, top, 1, BAR_HEIGHT_PX, rgb);
    }
    char text[32];
    if (!(high > low)) {
        snprintf(text, sizeof text, "%.4g", low);
        picture_text(picture, (const double[2]){(double)left, (double)top + BAR_HEIGHT_PX + 15}, PICTURE_LEFT,
                     &text_type, ink, text);
        return;
    }
    const double step = figures_nice((high - low) / MAX_TICKS);
    const int digits = (int)fmin(9, fmax(0, -floor(log10(step) + 1e-9)));
    /* Ticks are multiples of the step. A sum would stay the same where the step is smaller than the sum's rounding. */
    const double first = ceil(low / step - 1e-9);
    for (int i = 0; i <= MAX_TICKS && (first + i) * step <= high + 1e-9 * step; i++) {
        const double v = (first + i) * step;
        const double x = (double)left + (v - low) / (high - low) * BAR_PX;
        snprintf(text, sizeof text, "%.*f", digits, fabs(v) < 1e-9 * step ? 0.0 : v);
        picture_fill(picture, lrint(x - 0.5), top + BAR_HEIGHT_PX, 1, 4, ink);
        picture_text(picture, (const double[2]){x, (double)top + BAR_HEIGHT_PX + 17}, PICTURE_MIDDLE, &text_type, ink,
                     text);
    }
}

void view_draw_names(struct picture *picture, const char *title, const struct view_entry *entry, uint32_t n)
{
    const double line = 19;
    const double room = ((double)picture->height - 2 * MARGIN_PX) / line - 2;
    uint32_t shown = n;
    if ((double)n > fmin(VIEW_MAX_NAMES, room)) shown = (uint32_t)fmax(1, fmin(VIEW_MAX_NAMES, room) - 1);
    const uint32_t lines = shown + (shown < n);
    double y = (double)picture->height - MARGIN_PX - line * lines;
    picture_text(picture, (const double[2]){MARGIN_PX, y - 4}, PICTURE_LEFT, &name_type, ink, title);
    for (uint32_t i = 0; i < shown; i++) {
        y += line;
        picture_fill(picture, MARGIN_PX, (long)y - SWATCH_PX + 1, SWATCH_PX, SWATCH_PX, entry[i].rgb);
        picture_text(picture, (const double[2]){MARGIN_PX + SWATCH_PX + 8, y}, PICTURE_LEFT, &text_type, ink,
                     entry[i].name);
    }
    if (shown == n) return;
    char more[32];
    snprintf(more, sizeof more, "and %u more", n - shown);
    picture_text(picture, (const double[2]){MARGIN_PX, y + line}, PICTURE_LEFT, &text_type, ink, more);
}
