/* SPDX-License-Identifier: MIT */
/* An image, colours and the few marks pictures need. */
#include "core/studio/picture.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/colour.h"

int picture_make(struct picture *picture, uint32_t width, uint32_t height, const uint8_t rgb[3], struct sh_err *err)
{
    const size_t n = (size_t)width * height;
    *picture = (struct picture){width, height, malloc(n * 3 + 1)};
    if (picture->rgb == NULL) return sh_fail(err, SH_ENOMEM, "no memory for %u x %u pixels", width, height);
    for (size_t i = 0; i < n; i++)
        memcpy(picture->rgb + 3 * i, rgb, 3);
    return SH_OK;
}

void picture_free(struct picture *picture)
{
    free(picture->rgb);
    *picture = (struct picture){0};
}

static double lab_inverse(double t)
{
    return t > 6.0 / 29 ? t * t * t : 3 * (6.0 / 29) * (6.0 / 29) * (t - 4.0 / 29);
}

void picture_lab(double l, double a, double b, uint8_t rgb[3])
{
    const double fy = (l + 16) / 116;
    const double x = 0.95047 * lab_inverse(fy + a / 500), y = lab_inverse(fy), z = 1.08883 * lab_inverse(fy - b / 200);
    const double linear[3] = {3.2404542 * x - 1.5371385 * y - 0.4985314 * z,
                              -0.9692660 * x + 1.8760108 * y + 0.0415560 * z,
                              0.0556434 * x - 0.2040259 * y + 1.0572252 * z};
    for (int i = 0; i < 3; i++)
        rgb[i] = (uint8_t)lrint(255 * colour_srgb_encode(fmin(1, fmax(0, linear[i]))));
}

void picture_blend(struct picture *picture, long column, long row, const uint8_t rgb[3], double coverage)
{
    if (column < 0 || row < 0 || column >= (long)picture->width || row >= (long)picture->height) return;
    uint8_t *at = picture->rgb + ((size_t)row * picture->width + (size_t)column) * 3;
    for (int i = 0; i < 3; i++)
        at[i] = (uint8_t)lrint(at[i] + (rgb[i] - at[i]) * coverage);
}

void picture_fill(struct picture *picture, long column, long row, long width, long height, const uint8_t rgb[3])
{
    for (long r = row; r < row + height; r++)
        for (long c = column; c < column + width; c++)
            picture_blend(picture, c, r, rgb, 1);
}

static int inside(const double corner[3][2], double x, double y)
{
    int left = 0, right = 0;
    for (int i = 0; i < 3; i++) {
        const double *p = corner[i], *q = corner[(i + 1) % 3];
        const double side = (q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0]);
        left |= side > 0;
        right |= side < 0;
    }
    return !(left && right);
}

void picture_triangle(struct picture *picture, const double corner[3][2], const uint8_t rgb[3])
{
    enum { SUB = 4 }; /* sub-pixels per side, for even edges */
    const double min_x = fmin(corner[0][0], fmin(corner[1][0], corner[2][0]));
    const double max_x = fmax(corner[0][0], fmax(corner[1][0], corner[2][0]));
    const double min_y = fmin(corner[0][1], fmin(corner[1][1], corner[2][1]));
    const double max_y = fmax(corner[0][1], fmax(corner[1][1], corner[2][1]));
    for (long row = (long)floor(min_y); row <= (long)max_y; row++)
        for (long column = (long)floor(min_x); column <= (long)max_x; column++) {
            int hits = 0;
            for (int s = 0; s < SUB * SUB; s++)
                hits += inside(corner, (double)column + (s % SUB + 0.5) / SUB, (double)row + (s / SUB + 0.5) / SUB);
            if (hits > 0) picture_blend(picture, column, row, rgb, (double)hits / (SUB * SUB));
        }
}

/* ---- the pen on an image */

static void pen_fill(void *on, long column, long row, long width, long height, const uint8_t rgb[3])
{
    picture_fill(on, column, row, width, height, rgb);
}

static void pen_line(void *on, const double from[2], const double to[2], double width, const uint8_t rgb[3])
{
    picture_line(on, from, to, width, rgb);
}

static void pen_triangle(void *on, const double corner[3][2], const uint8_t rgb[3])
{
    picture_triangle(on, corner, rgb);
}

static void pen_text(void *on, const double at[2], enum picture_anchor anchor, const struct picture_type *type,
                     const uint8_t rgb[3], const char *text)
{
    picture_text(on, at, anchor, type, rgb, text);
}

static void pen_begin(void *on, const char *class_name, const char *title)
{
    (void)on;
    (void)class_name;
    (void)title;
}

static void pen_end(void *on)
{
    (void)on;
}

struct pen picture_pen(struct picture *picture)
{
    return (struct pen){picture, pen_fill, pen_line, pen_triangle, pen_text, pen_begin, pen_end};
}
