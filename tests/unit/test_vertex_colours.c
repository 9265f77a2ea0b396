/* SPDX-License-Identifier: MIT */
/* Colours of vertices in PLY, OBJ and the formats that Assimp reads. The colours are interpolated between the corners
 * at a hit. They count after a texture and before the material's colour. A mesh without any is unchanged, as is a load
 * that does not want them. */
#include <math.h>

#include "core/cast.h"
#include "core/colour.h"
#include "core/scene_copies.h"
#include "core/surface.h"
#include "tests/common/made.h"
#include "tests/unit/scene_files.h"

static struct scene *take(const char *name, const char *text, int textures)
{
    struct sh_err err;
    struct scene *s = NULL;
    const struct scene_mesh_spec spec = {
        .file = write_text(name, text), .scale = 1, .textures = textures, .cutouts = 1};
    if (load_spec(&spec, 1e-3, &s, &err) != SH_OK) fail_msg("%s", err.text);
    unlink(path);
    return s;
}

/* Checks the colour of corner c of triangle i. */
static void check(const struct scene *s, uint32_t i, int c, int r, int g, int b)
{
    const uint8_t *at = s->rgb[i][c];
    if (at[0] != r || at[1] != g || at[2] != b || at[3] != 255)
        fail_msg("triangle %u, corner %d: %d %d %d %d, not %d %d %d", i, c, at[0], at[1], at[2], at[3], r, g, b);
}

#define HEAD "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
#define FACE "element face 1\nproperty list uchar int vertex_indices\n"
#define RGB(type, prefix) \
    "property " type " " prefix "red\nproperty " type " " prefix "green\nproperty " type " " prefix "blue\n"

/* 51 is a fifth of 255, 13107 of 65535. */
static void ply_of_any_type(void **state)
{
    (void)state;
    static const struct {
        const char *property, *one, *fifth;
    } as[] = {{RGB("uchar", ""), "255", "51"},
              {RGB("uchar", "diffuse_"), "255", "51"},
              {RGB("ushort", ""), "65535", "13107"},
              {RGB("float", ""), "1.0", "0.2"},
              {RGB("double", ""), "255.0", "51.0"}};
    for (size_t i = 0; i < sizeof as / sizeof as[0]; i++) {
        char text[1024];
        snprintf(text, sizeof text, HEAD "%s" FACE "end_header\n0 0 0 %s 0 0\n1 0 0 0 %s 0\n0 1 0 %s %s %s\n3 0 1 2\n",
                 as[i].property, as[i].one, as[i].fifth, as[i].fifth, as[i].fifth, as[i].one);
        struct scene *s = take("a.ply", text, 1);
        assert_non_null(s->rgb);
        check(s, 0, 0, 255, 0, 0);
        check(s, 0, 1, 0, 51, 0);
        check(s, 0, 2, 51, 51, 255);
        assert_int_equal(s->surface[0].vertex_colours, SCENE_COLOURS_ALL);
        scene_free(s);
    }
}

/* Corners at one place become one vertex, and keep their own colours. */
static void ply_with_a_vertex_for_each_corner(void **state)
{
    (void)state;
    struct scene *s = take(
        "a.ply",
        "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\n"
        "property float z\n" RGB(
            "uchar", "") "element face 2\n"
                         "property list uchar int vertex_indices\nend_header\n0 0 0 1 0 0\n1 0 0 2 0 0\n0 1 0 3 0 0\n"
                         "1 0 0 4 0 0\n1 1 0 5 0 0\n0 1 0 6 0 0\n3 0 1 2\n3 3 4 5\n",
        1);
    assert_int_equal(s->n_vertices, 4);
    for (int i = 0; i < 6; i++)
        check(s, (uint32_t)i / 3, i % 3, i + 1, 0, 0);
    scene_free(s);
}

static void ply_by_face(void **state)
{
    (void)state;
    struct scene *s = take("a.ply",
                           HEAD "element face 2\nproperty list uchar int vertex_indices\n" RGB(
                               "uchar", "") "end_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 9 8 7\n3 2 1 0 1 2 3\n",
                           1);
    check(s, 0, 2, 9, 8, 7);
    check(s, 1, 0, 1, 2, 3);
    scene_free(s);
}

/* Colours from 0 to 1 or from 0 to 255 follow x, y, z. A fourth number alone is a weight, no colour. */
static void obj_of_two_ranges(void **state)
{
    (void)state;
    struct scene *s = take("a.obj", "v 0 0 0 1 0 0\nv 1 0 0 0 0.2 0\nv 0 1 0 0 0 0.6\nf 1 2 3\n", 1);
    check(s, 0, 0, 255, 0, 0);
    check(s, 0, 1, 0, 51, 0);
    check(s, 0, 2, 0, 0, 153);
    scene_free(s);
    s = take("a.obj", "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nf 1 2 3\nv 0 1 0 0 0 153\n", 1); /* 153: so all are 0 to 255 */
    check(s, 0, 0, 1, 0, 0);
    check(s, 0, 2, 0, 0, 153);
    scene_free(s);
    s = take("a.obj",
             "v 0 0 0 1.0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nv 0 1 1 0.2 0.2 0.2\no b\nf 1 2 4\n"
             "v 1 1 1 0 0 0\nv 1 2 1 0 0 0\no c\nf 4 5 6\nf 1 2 3\n",
             1);
    assert_int_equal(s->rgb[0][0][3], 0);
    check(s, 1, 2, 51, 51, 51);
    assert_int_equal(s->surface[0].vertex_colours, SCENE_COLOURS_NONE);
    assert_int_equal(s->surface[1].vertex_colours, SCENE_COLOURS_NONE); /* no triangle has all three */
    assert_int_equal(s->surface[2].vertex_colours, SCENE_COLOURS_SOME);
    scene_free(s);
}

/* Numbers that rounding left above 1, or a few that shine, do not make a file one of 0 to 255. Such numbers are cut to
 * 1, and counted. */
static void a_little_above_one(void **state)
{
    (void)state;
    static const struct {
        const char *name, *text, *says;
        int first, second;
    } as[] = {{"a.obj", "v 0 0 0 1.0001 0 0\nv 1 0 0 0.2 0 0\nv 0 1 0 0 0 0\nf 1 2 3\n",
               "a.obj: 1 colour of corners or vertices beyond the range of 0 to 1,", 255, 51},
              {"a.obj", "v 0 0 0 7.5 0 0\nv 1 0 0 0.2 0.4 0\nv 0 1 0 0 0 0\nf 1 2 3\n", "a.obj: 1 colour", 255, 51},
              {"a.obj", "v 0 0 0 255 0 0\nv 1 0 0 0.5 254.5 9\nv 0 1 0 300 0 0\nf 1 2 3\n",
               "beyond the range of 0 to 255,", 255, 0},
              {"a.obj", "v 0 0 0 2 0 0\nv 1 0 0 1 0 0\nv 0 1 0 0 0 0\nf 1 2 3\n", NULL, 2, 1},
              {"a.ply",
               HEAD RGB("float", "") FACE "end_header\n0 0 0 1.0001 0 0\n1 0 0 0.2 0 0\n0 1 0 0 0 0\n3 0 1 2\n",
               "a.ply: 1 colour", 255, 51},
              {"a.ply",
               HEAD "element face 1\nproperty list uchar int vertex_indices\n" RGB(
                   "float", "") "end_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 1.5 0.2 0\n",
               "a.ply: 3 colours", 255, 255}};
    for (size_t i = 0; i < sizeof as / sizeof as[0]; i++) {
        struct scene *s = take(as[i].name, as[i].text, 1);
        assert_int_equal(s->rgb[0][0][0], as[i].first);
        assert_int_equal(s->rgb[0][1][0], as[i].second);
        assert_int_equal(n_warnings, as[i].says != NULL);
        if (as[i].says != NULL && strstr(warnings, as[i].says) == NULL) fail_msg("%zu: %s", i, warnings);
        scene_free(s);
    }
}

/* One number beyond 1, whichever it is, makes all of them numbers of 0 to 255. */
static void each_number_decides(void **state)
{
    (void)state;
    for (int k = 0; k < 9; k++) {
        static const char *const place[] = {"0 0 0", "1 0 0", "0 1 0"};
        char text[512] = HEAD RGB("float", "") FACE "end_header\n";
        for (int i = 0; i < 9; i++)
            sprintf(text + strlen(text), "%s %d%s", i % 3 == 0 ? place[i / 3] : "", i == k ? 2 : 1,
                    i % 3 == 2 ? "\n" : "");
        strcat(text, "3 0 1 2\n");
        struct scene *s = take("a.ply", text, 1);
        for (int i = 0; i < 9; i++)
            assert_int_equal(s->rgb[0][i / 3][i % 3], i == k ? 2 : 1);
        scene_free(s);
    }
}

/* Linear light as sRGB: 0.2158605 is 128 of 255. */
static void gltf_is_linear(void **state)
{
    (void)state;
    static const char gltf[] =
        "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0}],"
        "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0,\"COLOR_0\":1}}]}],\"accessors\":["
        "{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\",\"min\":[0,0,0],\"max\":[1,1,0]},"
        "{\"bufferView\":1,\"componentType\":5126,\"count\":3,\"type\":\"VEC4\"}],\"bufferViews\":["
        "{\"buffer\":0,\"byteLength\":36},{\"buffer\":0,\"byteOffset\":36,\"byteLength\":48}],\"buffers\":["
        "{\"byteLength\":84,\"uri\":\"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAACAPwAAAAAA"
        "AAAAAACAPwAAAACJCl0+AAAAAAAAgD8AAAAAAAAAAAAAgD8AAIA/\"}]}";
    struct scene *s = take("a.gltf", gltf, 1);
    check(s, 0, 0, 255, 0, 0);
    check(s, 0, 1, 0, 128, 0);
    check(s, 0, 2, 0, 0, 255);
    scene_free(s);
}

static const char board[] = "v -2 10 -2 1 0 0\nv 2 10 -2 0 1 0\nv 2 10 2 0 0 1\nv -2 10 2 1 1 1\nusemtl m\nf 1 2 3\n"
                            "f 1 3 4\n";

static void nothing_is_spent_without(void **state)
{
    (void)state;
    struct scene *s = take("a.obj", board, 0);
    assert_null(s->rgb);
    assert_int_equal(s->surface[0].vertex_colours, SCENE_COLOURS_NONE);
    scene_free(s);
    s = take("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", 1);
    assert_null(s->rgb);
    scene_free(s);
}

/* Colours stay with their triangles where surfaces are left out, and where copies are written out. */
static void colours_stay_with_triangles(void **state)
{
    (void)state;
    struct sh_err err;
    struct scene *s =
        take("a.obj", "v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 1 0 0\nv 0 1 1 0 0 1\no a\nf 1 2 3\no b\nf 4 2 1\n", 1);
    assert_int_equal(scene_keep(s, (const uint8_t[2]){0, 1}, &err), SH_OK);
    check(s, 0, 0, 0, 0, 255);
    scene_free(s);
    struct scene_place place[2] = {{.scale = 1}, {.at_m = {5, 0, 0}, .scale = 1}};
    char bare[128];
    strcpy(bare, write_text("bare.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"));
    const struct scene_mesh_spec spec[2] = {
        {.file = bare, .scale = 1, .textures = 1},
        {.file = write_text("a.obj", board), .scale = 1, .textures = 1, .places = {place, 2, .says = "copies"}}};
    if (scene_load(spec, 2, 1e-3, NULL, &s, &err) != SH_OK) fail_msg("%s", err.text);
    if (scene_write_out_copies(s, 100, NULL, &err) != SH_OK) fail_msg("%s", err.text);
    assert_int_equal(s->n_triangles, 5);
    assert_int_equal(s->rgb[0][0][3], 0);
    check(s, 3, 1, 0, 255, 0);
    check(s, 4, 2, 255, 255, 255);
    scene_free(s);
    unlink(path);
    unlink(bare);
}

/* ---- at hits */

/* Worked out by hand: the board's lower right half is between red, green and blue, its upper left one between red, blue
 * and white. */
static void expected(double x_m, double z_m, double rgb[3])
{
    const double u = (x_m + 2.0) / 4.0, v = (z_m + 2.0) / 4.0;
    const double w[3] = {1.0 - fmax(u, v), fabs(u - v), fmin(u, v)}; /* red, the corner of its half, blue */
    rgb[0] = 255.0 * (w[0] + (v > u ? w[1] : 0.0));
    rgb[1] = 255.0 * w[1];
    rgb[2] = 255.0 * (w[2] + (v > u ? w[1] : 0.0));
}

/* Casts one line of 200 pulses upwards through the board, and writes its points into the block. */
static void cast_line(const struct scene *scene, const struct cast_setup *setup, struct line_block *block)
{
    static const struct schedule_spec spec = {.prr_uhz = 20000000000,
                                              .lines_uhz = 100000000,
                                              .pan_udeg_s = 1000000,
                                              .fov_min_udeg = -10000000,
                                              .sweep_udeg = 20000000,
                                              .line_start_udeg = -10000000,
                                              .line_stop_udeg = 10000000,
                                              .pan_start_udeg = -3000000,
                                              .pan_stop_udeg = 3000000};
    struct schedule_segment segment;
    struct schedule_line line;
    struct schedule_run run;
    struct caster *caster = NULL;
    struct sh_err err;
    struct cast_setup with = *setup;
    schedule_start(&segment, &spec);
    struct bvh *bvh = made_bvh(scene);
    if (caster_create(&caster, &err) != SH_OK) fail_msg("%s", err.text);
    with.bvh = bvh;
    schedule_get_line(&segment, 0, &line);
    schedule_get_run(&segment, &line, line.cast0, (uint32_t)(line.cast_end - line.cast0), &run);
    caster_cast(caster, &with, &run, block);
    caster_free(caster);
    bvh_free(bvh);
}

static const struct cast_setup plain = {.rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1},
                                        .range_max_m = 2000.0,
                                        .mirror_counts = 0x1p32,
                                        .pan_counts = 0x1p32,
                                        .range_scale_m = 1e-5};

static void hits_have_the_colour_between(void **state)
{
    (void)state;
    struct scene *s = take("a.obj", board, 1);
    struct surface_colours colours;
    struct line_block block;
    struct sh_err err;
    assert_int_equal(surface_colours_alloc(1, &colours, &err), SH_OK);
    surface_colours_set(&colours, 0, &s->surface[0]);
    assert_int_equal(line_block_alloc(&block, 1000, &err), SH_OK);
    assert_int_equal(line_block_alloc_colours(&block, &err), SH_OK);
    const struct cast_colour colour = {.scale.mode = COLOUR_TEXTURE, .surfaces = &colours};
    struct cast_setup setup = plain;
    setup.colour = &colour;
    cast_line(s, &setup, &block);
    uint32_t n = 0;
    for (uint32_t i = 0; i < block.n_points; i++) {
        const double m = 0x1p-31 * M_PI * (int32_t)block.b[i], p = 0x1p-31 * M_PI * (int32_t)block.c[i];
        const double x_m = 10.0 * tan(p), z_m = 10.0 * tan(m) / cos(p);
        double rgb[3];
        if (block.echo[i] == 0) continue;
        expected(x_m, z_m, rgb);
        for (int k = 0; k < 3; k++) /* half a step of rounding, and as much for the angles' */
            if (fabs(rgb[k] - block.rgb[i][k]) > 1.0)
                fail_msg("z %g: channel %d is %d, not %g", z_m, k, block.rgb[i][k], rgb[k]);
        n++;
    }
    assert_true(n > 100);
    line_block_free(&block);
    surface_colours_free(&colours);
    scene_free(s);
}

/* A point has the mean of the corners' colours, weighted by areas: a quarter of the first one's, a half of the second
 * one's and a quarter of the third one's here. Where a corner has no colour, the point has none. */
static void colours_between_corners(void **state)
{
    (void)state;
    static const double corner[3][3] = {{1, 2, 3}, {5, 2, 3}, {1, 2, 7}}, p[3] = {3, 2, 4};
    const double *const corners[3] = {corner[0], corner[1], corner[2]};
    uint8_t of[2][3][4] = {{{0}}, {{200, 0, 40, 255}, {0, 100, 40, 255}, {0, 200, 40, 255}}}, rgb[3];
    const struct scene scene = {.n_triangles = 2, .rgb = of};
    assert_int_equal(scene_rgb_at(&scene, 1, corners, p, rgb), 1);
    assert_memory_equal(rgb, ((const uint8_t[3]){50, 100, 40}), 3);
    for (int c = 0; c < 3; c++) {
        of[1][c][3] = 0;
        assert_int_equal(scene_rgb_at(&scene, 1, corners, p, rgb), 0);
        of[1][c][3] = 255;
    }
}

/* Without a rule the reflectance is the colour's luminance, 0.2126 of red and so on, in linear light. */
static void hits_reflect_as_their_colour(void **state)
{
    (void)state;
    struct surface_table table;
    struct sh_err err;
    const struct scene_surface named = {.object = "a", .material = "m", .vertex_colours = SCENE_COLOURS_ALL};
    static const struct {
        uint8_t rgb[3];
        double rho;
    } as[] = {{{255, 255, 255}, 1.0}, {{255, 0, 0}, 0.2126}, {{0, 255, 0}, 0.7152}, {{0, 0, 0}, 0.0}};
    assert_int_equal(surface_table_alloc(1, &table, &err), SH_OK);
    surface_table_set(&table, 0, &named, NULL, 0, 0.6);
    assert_int_equal(surface_table_by_vertex(&table, 0, &err), SH_OK);
    for (size_t i = 0; i < sizeof as / sizeof as[0]; i++) {
        const uint32_t label = surface_texel_of(0, as[i].rgb);
        const double cosine = 1.0;
        double rho;
        surface_return(&table, 1, &label, &cosine, &rho);
        assert_true(fabs(rho - as[i].rho) < 1.0 / 65534.0); /* a step of the 16 bits */
    }
    const uint32_t none = 0;
    const double cosine = 1.0;
    double rho;
    surface_return(&table, 1, &none, &cosine, &rho);
    assert_true(rho == 0.6); /* where no colour is known */
    surface_table_free(&table);
}

/* The colour is that between the vertices, else the material's, else grey. (Here no surface has a texture.) */
static void the_order_of_colours(void **state)
{
    (void)state;
    struct surface_colours colours;
    struct sh_err err;
    const struct scene_surface named[2] = {{.colour = {0, 0, 1}, .has_colour = 1}, {.object = "a"}};
    static const uint8_t rgb[3] = {1, 2, 3};
    assert_int_equal(surface_colours_alloc(2, &colours, &err), SH_OK);
    for (uint32_t i = 0; i < 2; i++)
        surface_colours_set(&colours, i, &named[i]);
    assert_int_equal(surface_colour(&colours, 0, NULL, rgb), 0x010203);
    assert_int_equal(surface_colour(&colours, 0, NULL, NULL), 0x0000ff);
    assert_int_equal(surface_colour(&colours, 1, NULL, NULL), 0x808080);
    assert_int_equal(surface_colour(&colours, 2, NULL, NULL), 0x808080);
    surface_colours_free(&colours);
    /* A second call is harmless, and no surface has a colour then. */
    assert_true(colours.n == 0 && colours.own == NULL && colours.image == NULL && colours.by_vertex == NULL);
    surface_colours_free(&colours);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ply_of_any_type),
        cmocka_unit_test(ply_with_a_vertex_for_each_corner),
        cmocka_unit_test(ply_by_face),
        cmocka_unit_test(each_number_decides),
        cmocka_unit_test(obj_of_two_ranges),
        cmocka_unit_test(a_little_above_one),
        cmocka_unit_test(gltf_is_linear),
        cmocka_unit_test(nothing_is_spent_without),
        cmocka_unit_test(colours_stay_with_triangles),
        cmocka_unit_test(hits_have_the_colour_between),
        cmocka_unit_test(colours_between_corners),
        cmocka_unit_test(hits_reflect_as_their_colour),
        cmocka_unit_test(the_order_of_colours),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
