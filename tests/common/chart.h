/* SPDX-License-Identifier: MIT */
/* A chart: an image with a colour of its own in each texel, in files of each format, and a board that it lies on. The
 * texel that lies at a coordinate is worked out here by hand, apart from the program. */
#ifndef TESTS_COMMON_CHART_H
#define TESTS_COMMON_CHART_H

#include "tests/common/cases.h"

#include "core/scene.h"
#include "core/texture.h"

enum { CHART_WIDE = 11, CHART_HIGH = 7 };
/* Texture coordinates at the board's corners at -2, -2 and 2, 2 m. The coordinates go more than a turn beyond the image
 * on each side, and are in no simple ratio to its size. */
#define CHART_U0 -1.4
#define CHART_U1 2.3
#define CHART_V0 -1.2
#define CHART_V1 2.6

typedef uint8_t chart_texels[CHART_HIGH][CHART_WIDE][3]; /* rows from the top */
extern chart_texels chart;
extern const uint8_t chart_bare[3], chart_red[3]; /* the board's own colour; that of the material `bare` */

/* Makes a folder with chart.png, .bmp, .tga and .jpg, or removes it. */
int chart_make_folder(void **state);
int chart_remove_folder(void **state);
/* Returns the path of a file in that folder, which is good until the call after the next. */
const char *chart_path(const char *name);
void chart_write_text(const char *name, const char *text);

/* Returns the image as its decoder has it, which is good until the next call. Only a JPEG's differs from the chart. */
const chart_texels *chart_decoded(const char *name);

/* Loads a scene with its textures. */
struct scene *chart_load(const char *file, enum scene_up up);
/* Loads a square upright across the y axis, 4 m a side, with the image on it. `options` are those of map_Kd. `more` are
 * lines of OBJ that follow; they may use the materials `bare` (red) and `none` (no colour). */
struct scene *chart_load_board(const char *image, const char *options, double y_m, const char *more);

/* Writes the texel's column and row at u, v. Returns 0 beyond a decal. */
int chart_texel_of(double u, double v, const enum texture_wrap wrap[2], int *column, int *row);
/* Returns whether x lies near a border between texels, n on a side. Near a border a mesh, whose coordinates are floats,
 * may fall on either side. */
int chart_is_near(double x, int n);

#endif
