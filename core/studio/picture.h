/* SPDX-License-Identifier: MIT */
/* Pictures: marks, lines and text on an image, as a PNG file or as SVG. In: places in pixels from the upper left
 * corner, x to the right, y down; colours as sRGB, 8 bits a channel. Out: an image, a PNG (libpng), an SVG.
 *
 * A pen draws on either: on an image, where edges are anti-aliased, or into an SVG, as vector elements. So drawings are
 * described once. The font is one of strokes and our own: ASCII, the letters of Latin-1 with their accents, and the
 * degree sign. Other characters are boxes on an image; an SVG has them as they are.
 *
 * Ownership: picture_make allocates, picture_free releases; so do svg_begin and svg_end. Thread: a picture
 * belongs to one at a time. Not real-time safe. */
#ifndef CORE_STUDIO_PICTURE_H
#define CORE_STUDIO_PICTURE_H

#include <stdint.h>
#include <stdio.h>

#include "core/err.h"

struct picture {
    uint32_t width, height;
    uint8_t *rgb; /* [height][width][3], the upper row first */
};

int picture_make(struct picture *picture, uint32_t width, uint32_t height, const uint8_t rgb[3], struct sh_err *err);
void picture_free(struct picture *picture);

/* Places outside of the image are ignored, here and below. coverage 0..1: how much of the pixel gets the
 * colour. */
void picture_blend(struct picture *picture, long column, long row, const uint8_t rgb[3], double coverage);
void picture_fill(struct picture *picture, long column, long row, long width, long height, const uint8_t rgb[3]);
/* Draws a line with round ends; where from and to are the same place it is a disc. */
void picture_line(struct picture *picture, const double from[2], const double to[2], double width,
                  const uint8_t rgb[3]);
void picture_triangle(struct picture *picture, const double corner[3][2], const uint8_t rgb[3]);

enum picture_anchor { PICTURE_LEFT, PICTURE_MIDDLE, PICTURE_RIGHT };

struct picture_type {
    double size_px; /* height of capitals */
    int bold;
    double halo_px; /* > 0: so much white around the strokes */
};
/* Draws a text (UTF-8). at: x of its left end, middle or right end, y of its baseline. */
void picture_text(struct picture *picture, const double at[2], enum picture_anchor anchor,
                  const struct picture_type *type, const uint8_t rgb[3], const char *text);
double picture_text_width(const struct picture_type *type, const char *text);

/* A rectangle of a picture, without its right and lower borders. */
struct picture_box {
    double left, top, right, bottom;
};
static inline int picture_box_overlaps(const struct picture_box *a, const struct picture_box *b)
{
    return a->left < b->right && b->left < a->right && a->top < b->bottom && b->top < a->bottom;
}

/* Converts CIE 1976 L*a*b* (white D65), L* 0..100, to sRGB; colours outside the gamut are moved to its border. */
void picture_lab(double l, double a, double b, uint8_t rgb[3]);

struct picture_part {
    const struct picture *picture;
    uint32_t column, row, width, height;
    const uint8_t *clear; /* this colour is transparent; NULL: none is */
};

/* Writes the image to path.part, which is renamed once it is complete: path never has a part of an image. Errors begin
 * with `what` and name the path. */
int picture_write_png(const struct picture *picture, const char *what, const char *path, struct sh_err *err);

/* Writes the picture's PNG to a stream, which is flushed. Errors give only the reason. */
int picture_put_png(FILE *out, const struct picture *picture, struct sh_err *err);

/* These two functions are for pages that hold pictures. picture_put_uri writes the image as a data URI of a PNG, with
 * one colour transparent (NULL: none). picture_put_escaped writes a text for XML or HTML, also for an attribute. Bytes
 * that are no character of XML become U+FFFD. */
int picture_put_uri(FILE *out, const struct picture *picture, const uint8_t *clear, struct sh_err *err);
void picture_put_escaped(FILE *out, const char *text);

/* ---- pens */

struct pen {
    void *on; /* a struct picture, or a struct svg */
    void (*fill)(void *on, long column, long row, long width, long height, const uint8_t rgb[3]);
    void (*line)(void *on, const double from[2], const double to[2], double width, const uint8_t rgb[3]);
    void (*triangle)(void *on, const double corner[3][2], const uint8_t rgb[3]);
    void (*text)(void *on, const double at[2], enum picture_anchor anchor, const struct picture_type *type,
                 const uint8_t rgb[3], const char *text);
    /* Marks that are drawn between these two make a group with a title. */
    void (*begin)(void *on, const char *class_name, const char *title);
    void (*end)(void *on);
};

struct pen picture_pen(struct picture *picture);

struct svg;
int svg_begin(uint32_t width, uint32_t height, const char *title, struct svg **out, struct sh_err *err);
struct pen svg_pen(struct svg *svg);
/* Adds part of an image, as PNG data, at the same place. */
int svg_image(struct svg *svg, const struct picture_part *part, struct sh_err *err);
/* Writes as picture_write_png does. */
int svg_write(struct svg *svg, const char *what, const char *path, struct sh_err *err);
void svg_end(struct svg *svg);

#endif
