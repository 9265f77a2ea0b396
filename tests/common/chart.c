/* SPDX-License-Identifier: MIT */
#include "tests/common/chart.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define STB_IMAGE_WRITE_IMPLEMENTATION
#define STB_IMAGE_WRITE_STATIC
#include <stb/stb_image_write.h>

chart_texels chart;
const uint8_t chart_bare[3] = {51, 102, 255}, chart_red[3] = {255, 0, 0}; /* of Kd */

static char folder[64];

const char *chart_path(const char *name)
{
    static char path[2][128];
    static int turn;
    turn = !turn;
    snprintf(path[turn], sizeof path[turn], "%s/%s", folder, name);
    return path[turn];
}

void chart_write_text(const char *name, const char *text)
{
    FILE *f = fopen(chart_path(name), "w");
    assert_non_null(f);
    fputs(text, f);
    assert_int_equal(fclose(f), 0);
}

static void make_chart(void)
{
    for (int y = 0; y < CHART_HIGH; y++)
        for (int x = 0; x < CHART_WIDE; x++) {
            chart[y][x][0] = (uint8_t)(23 * x + 7);
            chart[y][x][1] = (uint8_t)(36 * y + 3);
            chart[y][x][2] = (uint8_t)(255 - 11 * x - 17 * y);
        }
}

int chart_make_folder(void **state)
{
    (void)state;
    strcpy(folder, "/tmp/scanhead-colours-XXXXXX");
    if (mkdtemp(folder) == NULL) return -1;
    make_chart();
    stbi_write_png(chart_path("chart.png"), CHART_WIDE, CHART_HIGH, 3, chart, 0);
    stbi_write_bmp(chart_path("chart.bmp"), CHART_WIDE, CHART_HIGH, 3, chart);
    stbi_write_tga(chart_path("chart.tga"), CHART_WIDE, CHART_HIGH, 3, chart);
    stbi_write_jpg(chart_path("chart.jpg"), CHART_WIDE, CHART_HIGH, 3, chart, 100);
    return 0;
}

int chart_remove_folder(void **state)
{
    static const char *const file[] = {"chart.png", "chart.bmp", "chart.tga",  "chart.jpg",
                                       "board.obj", "board.mtl", "board.gltf", "board.bin"};
    (void)state;
    for (size_t i = 0; i < sizeof file / sizeof *file; i++)
        unlink(chart_path(file[i]));
    return rmdir(folder);
}

/* ---- the texel that lies at a coordinate, worked out by hand */

static double wrapped(double x, enum texture_wrap wrap)
{
    const double turns = floor(x), part = x - turns;
    if (wrap == TEXTURE_CLAMP) return x < 0.0 ? 0.0 : x > 1.0 ? 1.0 : x;
    if (wrap == TEXTURE_MIRROR) return ((long)turns & 1) != 0 ? 1.0 - part : part;
    return wrap == TEXTURE_REPEAT ? part : x >= 0.0 && x <= 1.0 ? x : (double)NAN;
}

/* Coordinates so near to a border of texels, or of the image, may fall on either side: a mesh has them as floats. */
int chart_is_near(double x, int n)
{
    return fabs(x * n - round(x * n)) < 1e-4;
}

/* Writes the texel's column and row. Returns 0 beyond a decal. */
int chart_texel_of(double u, double v, const enum texture_wrap wrap[2], int *column, int *row)
{
    const double x = wrapped(u, wrap[0]), y = wrapped(v, wrap[1]);
    if (isnan(x) || isnan(y)) return 0;
    *column = x >= 1.0 ? CHART_WIDE - 1 : (int)floor(x * CHART_WIDE);
    *row = CHART_HIGH - 1 - (y >= 1.0 ? CHART_HIGH - 1 : (int)floor(y * CHART_HIGH));
    return 1;
}

struct scene *chart_load(const char *file, enum scene_up up)
{
    const struct scene_mesh_spec spec = {.file = chart_path(file), .scale = 1.0, .up = up, .textures = 1};
    struct scene *scene;
    struct sh_err err;
    if (scene_load(&spec, 1, 1e-4, NULL, &scene, &err) != SH_OK) fail_msg("%s", err.text);
    return scene;
}

/* The square stands upright across the y axis. With y_m below 0 it is behind the head. */
struct scene *chart_load_board(const char *image, const char *options, double y_m, const char *more)
{
    char text[1024];
    snprintf(text, sizeof text,
             "mtllib board.mtl\no board\nv -2 %g -2\nv 2 %g -2\nv 2 %g 2\nv -2 %g 2\n"
             "vt %g %g\nvt %g %g\nvt %g %g\nvt %g %g\nusemtl chart\nf 1/1 2/2 3/3 4/4\n%s",
             y_m, y_m, y_m, y_m, CHART_U0, CHART_V0, CHART_U1, CHART_V0, CHART_U1, CHART_V1, CHART_U0, CHART_V1, more);
    chart_write_text("board.obj", text);
    snprintf(text, sizeof text, "newmtl chart\nKd 0.2 0.4 1\nmap_Kd %s%s\nnewmtl bare\nKd 1 0 0\nnewmtl none\n",
             options, image);
    chart_write_text("board.mtl", text);
    return chart_load("board.obj", SCENE_UP_Z);
}

/* Returns the image as its decoder has it. Only a JPEG's differs from the chart. */
const chart_texels *chart_decoded(const char *name)
{
    static chart_texels texels;
    struct texture_image image;
    struct sh_err err;
    if (texture_read(&(struct texture_source){.file = chart_path(name)}, &image, &err) != SH_OK)
        fail_msg("%s", err.text);
    assert_int_equal(image.width, CHART_WIDE);
    for (int i = 0; i < CHART_WIDE * CHART_HIGH; i++)
        memcpy(texels[i / CHART_WIDE][i % CHART_WIDE], image.rgba + 4 * (size_t)i, 3);
    texture_image_free(&image);
    return (const chart_texels *)&texels;
}
