/* SPDX-License-Identifier: MIT */
/* Colours of points by texture: a chart with a colour of its own in each texel is on a board whose coordinates are
 * known. Each point has exactly the texel that lies there, worked out by hand. The test has each image format, each way
 * to wrap, and images beside the mesh and within it. The board is seen directly, under a footprint, in a mirror and on
 * a mesh that moves. */
#include "tests/common/chart.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/cast.h"
#include "core/colour.h"
#include "core/surface.h"
#include "tests/common/made.h"

enum { LINES = 96, ROOM = 1000 };
static const double AWAY_M = 10.0;

/* ---- scans of the board */

struct view {
    const struct scene *scene; /* the scene that stands still; has the board unless mover is there */
    const struct surface_colours *colours;
    enum texture_wrap wrap[2];
    const chart_texels *texels;
    const uint8_t *bare; /* beyond a decal */
    const struct cast_mover *mover;
    struct cast_beam *beam;
    const struct cast_detect *detect;
    double shift_m; /* of the board along x */
    int ghosts;     /* the board is seen in a mirror */
    double part;    /* of a texel that is left out at its borders: footprints */
};

struct seen {
    uint32_t n, bare, red;
    uint8_t texel[CHART_HIGH][CHART_WIDE];
};

static void check_point(const struct view *view, const double d[3], const uint8_t rgb[3], struct seen *seen)
{
    const double x_m = AWAY_M * d[0] / d[1] - view->shift_m, z_m = AWAY_M * d[2] / d[1];
    const double u = CHART_U0 + (CHART_U1 - CHART_U0) * (x_m + 2.0) / 4.0,
                 v = CHART_V0 + (CHART_V1 - CHART_V0) * (z_m + 2.0) / 4.0;
    const uint8_t *want = view->bare;
    int column = 0, row = 0;
    if (fabs(x_m) > 1.999 || fabs(z_m) > 1.999 || chart_is_near(u, CHART_WIDE) || chart_is_near(v, CHART_HIGH)) return;
    if (fabs(u * CHART_WIDE - round(u * CHART_WIDE)) < view->part ||
        fabs(v * CHART_HIGH - round(v * CHART_HIGH)) < view->part)
        return;
    if (chart_texel_of(u, v, view->wrap, &column, &row)) {
        want = (*view->texels)[row][column];
        seen->texel[row][column] = 1;
    } else {
        seen->bare++;
    }
    seen->n++;
    if (memcmp(rgb, want, 3) != 0)
        fail_msg("u %.6f, v %.6f, texel %d, %d: %d %d %d, not %d %d %d", u, v, column, row, rgb[0], rgb[1], rgb[2],
                 want[0], want[1], want[2]);
}

/* Lines are a quarter of a degree apart, over more than the board. */
static void begin(struct schedule_segment *segment)
{
    static const struct schedule_spec spec = {.prr_uhz = 48000000000,
                                              .lines_uhz = 96000000,
                                              .pan_udeg_s = 24000000,
                                              .fov_min_udeg = -12000000,
                                              .sweep_udeg = 60000000,
                                              .line_start_udeg = -12000000,
                                              .line_stop_udeg = 12000000,
                                              .pan_start_udeg = -12000000,
                                              .pan_stop_udeg = 12000000};
    schedule_start(segment, &spec);
}

static void cast_line(const struct view *view, struct caster *caster, const struct cast_setup *setup,
                      struct schedule_segment *segment, uint64_t l, struct line_block *block, struct seen *seen)
{
    struct schedule_line line;
    struct schedule_run run;
    uint64_t pulse;
    schedule_get_line(segment, l, &line);
    schedule_get_run(segment, &line, line.cast0, (uint32_t)(line.cast_end - line.cast0), &run);
    caster_cast(caster, setup, &run, block);
    pulse = line.cast0;
    for (uint32_t i = 0; i < block->n_points; i++) {
        if (i > 0 && (block->echo[i] & 15) <= 1) pulse++;
        const double m = 2.0 * M_PI * schedule_mirror_turn(segment, pulse);
        const double p = 2.0 * M_PI * schedule_pan_turn(segment, pulse);
        if (block->echo[i] == 0) assert_memory_equal(block->rgb[i], colour_grey, 3);
        if (block->label[i] == 1 && view->mover == NULL && !view->ghosts) {
            assert_memory_equal(block->rgb[i], chart_red, 3);
            seen->red++;
        }
        if (block->echo[i] == 0 || (block->label[i] != 0 && !view->ghosts && view->mover == NULL)) continue;
        check_point(view, (const double[3]){sin(p) * cos(m), cos(p) * cos(m), sin(m)}, block->rgb[i], seen);
    }
}

static struct seen scan(const struct view *view)
{
    static const double at[3] = {0.0, 0.0, 0.0};
    struct seen seen = {0};
    struct schedule_segment segment;
    struct caster *caster;
    struct line_block block;
    struct beam_outlines *outlines = NULL;
    struct sh_err err;
    const uint32_t each = view->detect != NULL ? 3 : 1;
    begin(&segment);
    struct bvh *bvh = made_bvh(view->scene);
    if (caster_create(&caster, &err) != SH_OK || line_block_alloc(&block, each * ROOM, &err) != SH_OK ||
        line_block_alloc_colours(&block, &err) != SH_OK)
        fail_msg("%s", err.text);
    const struct cast_colour colour = {.scale.mode = COLOUR_TEXTURE, .surfaces = view->colours};
    struct cast_setup setup = {.bvh = bvh,
                               .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1},
                               .range_max_m = 2000.0,
                               .mirror_counts = 0x1p32,
                               .pan_counts = 0x1p32,
                               .range_scale_m = 1e-5,
                               .beam = view->beam,
                               .detect = view->detect,
                               .colour = &colour};
    setup.n_movers = view->mover != NULL;
    if (view->mover != NULL) setup.mover[0] = *view->mover;
    if (view->beam != NULL && view->beam->mode == BEAM_ADAPTIVE) {
        const struct beam_outlines_spec wanted = {view->scene, at, &view->beam->beam, 2000.0, NULL, NULL};
        if (cast_outlines(&wanted, bvh, &outlines, &err) != SH_OK) fail_msg("%s", err.text);
        view->beam->outlines = outlines;
    }
    for (uint64_t l = 0; l < LINES; l++)
        cast_line(view, caster, &setup, &segment, l, &block, &seen);
    beam_outlines_free(outlines);
    line_block_free(&block);
    caster_free(caster);
    bvh_free(bvh);
    return seen;
}

/* All texels of the chart were hit. */
static void check_all_seen(const struct seen *seen)
{
    for (int y = 0; y < CHART_HIGH; y++)
        for (int x = 0; x < CHART_WIDE; x++)
            if (!seen->texel[y][x]) fail_msg("texel %d, %d was not hit", x, y);
    assert_true(seen->n > 2000);
}

static void fill(struct surface_colours *colours, struct scene *scene, uint32_t n, uint32_t label)
{
    struct sh_err err;
    assert_int_equal(surface_colours_alloc(n, colours, &err), SH_OK);
    for (uint32_t i = 0; i < n; i++)
        surface_colours_set(colours, i, &scene->surface[i < scene->n_surfaces ? i : 0]);
    if (surface_colours_texture(colours, label, &scene->texture[scene->surface[0].texture - 1], &err) != SH_OK)
        fail_msg("%s", err.text);
}

static void each_format_and_each_way_to_wrap(void **state)
{
    (void)state;
    static const char *const image[] = {"chart.png", "chart.bmp", "chart.tga", "chart.jpg"};
    for (size_t f = 0; f < sizeof image / sizeof *image; f++) {
        struct scene *scene = chart_load_board(image[f], "", 10.0, "");
        struct view view = {.scene = scene, .bare = chart_bare, .texels = chart_decoded(image[f])};
        if (f < 3) assert_memory_equal(*view.texels, chart, sizeof chart);
        for (int w = 0; w < 16; w++) {
            struct surface_colours colours;
            view.wrap[0] = scene->texture[0].wrap[0] = (enum texture_wrap)(w % 4);
            view.wrap[1] = scene->texture[0].wrap[1] = (enum texture_wrap)(w / 4);
            fill(&colours, scene, scene->n_surfaces, 0);
            view.colours = &colours;
            const struct seen seen = scan(&view);
            check_all_seen(&seen);
            assert_int_equal(seen.bare > 500, w % 4 == TEXTURE_DECAL || w / 4 == TEXTURE_DECAL);
            surface_colours_free(&colours);
        }
        scene_free(scene);
    }
}

/* The mesh's own file decides: repeat unless -clamp is on. */
static void an_obj_says_how_to_wrap(void **state)
{
    (void)state;
    for (int clamp = 0; clamp < 2; clamp++) {
        struct surface_colours colours;
        struct scene *scene = chart_load_board("chart.png", clamp ? "-clamp on " : "", 10.0, "");
        const enum texture_wrap wrap = clamp ? TEXTURE_CLAMP : TEXTURE_REPEAT;
        fill(&colours, scene, scene->n_surfaces, 0);
        const struct seen seen = scan(&(struct view){.scene = scene,
                                                     .colours = &colours,
                                                     .wrap = {wrap, wrap},
                                                     .texels = (const chart_texels *)&chart,
                                                     .bare = chart_bare});
        check_all_seen(&seen);
        surface_colours_free(&colours);
        scene_free(scene);
    }
}

/* The image is within the mesh's file; glTF counts v from the top. */
static void load_gltf(const char *image, const char *type, int wrap_s, int wrap_t, struct scene **scene)
{
    static const float p[4][3] = {{-2, -2, -10}, {2, -2, -10}, {2, 2, -10}, {-2, 2, -10}}; /* y up: 10 m along y */
    const float uv[4][2] = {{(float)CHART_U0, 1 - (float)CHART_V0},
                            {(float)CHART_U1, 1 - (float)CHART_V0},
                            {(float)CHART_U1, 1 - (float)CHART_V1},
                            {(float)CHART_U0, 1 - (float)CHART_V1}};
    static const uint16_t index[6] = {0, 1, 2, 0, 2, 3};
    static uint8_t bytes[8192];
    char text[2048];
    FILE *in = fopen(chart_path(image), "rb"), *out = fopen(chart_path("board.bin"), "wb");
    assert_true(in != NULL && out != NULL);
    const size_t n = fread(bytes, 1, sizeof bytes, in);
    fwrite(p, sizeof p, 1, out);
    fwrite(uv, sizeof uv, 1, out);
    fwrite(index, sizeof index, 1, out);
    fwrite(bytes, 1, n, out);
    fclose(in);
    fclose(out);
    snprintf(text, sizeof text,
             "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0}],"
             "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0,\"TEXCOORD_0\":1},\"indices\":2,"
             "\"material\":0}]}],\"materials\":[{\"name\":\"chart\",\"pbrMetallicRoughness\":{"
             "\"baseColorTexture\":{\"index\":0}}}],\"textures\":[{\"source\":0,\"sampler\":0}],"
             "\"samplers\":[{\"wrapS\":%d,\"wrapT\":%d}],\"images\":[{\"bufferView\":3,\"mimeType\":\"image/%s\"}],"
             "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":4,\"type\":\"VEC3\","
             "\"min\":[-2,-2,-10],\"max\":[2,2,-10]},{\"bufferView\":1,\"componentType\":5126,\"count\":4,"
             "\"type\":\"VEC2\"},{\"bufferView\":2,\"componentType\":5123,\"count\":6,\"type\":\"SCALAR\"}],"
             "\"bufferViews\":[{\"buffer\":0,\"byteLength\":48},{\"buffer\":0,\"byteOffset\":48,\"byteLength\":32},"
             "{\"buffer\":0,\"byteOffset\":80,\"byteLength\":12},{\"buffer\":0,\"byteOffset\":92,\"byteLength\":%zu}],"
             "\"buffers\":[{\"uri\":\"board.bin\",\"byteLength\":%zu}]}",
             wrap_s, wrap_t, type, n, 92 + n);
    chart_write_text("board.gltf", text);
    *scene = chart_load("board.gltf", SCENE_UP_Y);
}

static void images_within_gltf(void **state)
{
    (void)state;
    static const struct {
        const char *image, *type;
        int s, t;
        enum texture_wrap wrap[2];
    } cases[] = {{"chart.png", "png", 33071, 33648, {TEXTURE_CLAMP, TEXTURE_MIRROR}},
                 {"chart.jpg", "jpeg", 10497, 33071, {TEXTURE_REPEAT, TEXTURE_CLAMP}}};
    for (int i = 0; i < 2; i++) {
        struct scene *scene;
        struct surface_colours colours;
        load_gltf(cases[i].image, cases[i].type, cases[i].s, cases[i].t, &scene);
        fill(&colours, scene, scene->n_surfaces, 0);
        const struct seen seen = scan(&(struct view){.scene = scene,
                                                     .colours = &colours,
                                                     .wrap = {cases[i].wrap[0], cases[i].wrap[1]},
                                                     .texels = chart_decoded(cases[i].image),
                                                     .bare = chart_bare});
        check_all_seen(&seen);
        surface_colours_free(&colours);
        scene_free(scene);
    }
}

static void a_mesh_takes_its_image_along(void **state)
{
    (void)state;
    static const double wall[3][3] = {{-500, 100, -500}, {500, 100, -500}, {0, 100, 900}};
    static const uint32_t triangle[1][3] = {{0, 1, 2}};
    struct scene *board = chart_load_board("chart.png", "", 10.0, ""), *still;
    struct surface_colours colours;
    still = made_scene(&(struct scene_arrays){wall, 3, triangle, 1, NULL, NULL, 0});
    for (uint32_t i = 0; i < board->n_triangles; i++)
        board->label[i] = 1;
    struct bvh *bvh = made_bvh(board);
    fill(&colours, board, 2, 1);
    const struct cast_mover mover = {.bvh = bvh,
                                     .centre_m = {0.0, AWAY_M, 0.0},
                                     .radius_m = 3.0,
                                     .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1},
                                     .shift_m = {0.35, 0.0, 0.0}};
    const struct seen seen = scan(&(struct view){.scene = still,
                                                 .colours = &colours,
                                                 .texels = (const chart_texels *)&chart,
                                                 .bare = chart_bare,
                                                 .mover = &mover,
                                                 .shift_m = 0.35});
    check_all_seen(&seen);
    surface_colours_free(&colours);
    bvh_free(bvh);
    scene_free(board);
    scene_free(still);
}

/* A footprint of 8 mm is within a texel of 98 x 150 mm. With the adaptive beam one ray decides by the texel in its
 * centre. */
static void under_a_footprint(void **state)
{
    (void)state;
    static struct cast_beam beam;
    struct scene *scene = chart_load_board("chart.png", "", 10.0, "");
    struct surface_colours colours;
    fill(&colours, scene, scene->n_surfaces, 0);
    beam_init(&beam.beam, 0.007, 0.35e-3, 4e-9);
    beam_rings(2, &beam.pattern);
    beam_rings(BEAM_FINE_RINGS, &beam.fine);
    beam.max_echoes = 1;
    for (int adaptive = 0; adaptive < 2; adaptive++) {
        beam.mode = adaptive ? BEAM_ADAPTIVE : BEAM_RINGS;
        const struct seen seen = scan(&(struct view){.scene = scene,
                                                     .colours = &colours,
                                                     .texels = (const chart_texels *)&chart,
                                                     .bare = chart_bare,
                                                     .beam = &beam,
                                                     .part = adaptive ? 0.0 : 0.1});
        assert_true(seen.n > 2000);
    }
    surface_colours_free(&colours);
    scene_free(scene);
}

/* The board is seen through a pane that is red itself, and in a mirror. With the board 2 m behind the head and the
 * mirror 4 m before it, its image is 10 m before it. */
static void through_glass_and_in_a_mirror(void **state)
{
    (void)state;
    for (int mirror = 0; mirror < 2; mirror++) {
        static const char *const more[] = {"v -50 3 -50\nv 50 3 -50\nv 50 3 50\nv -50 3 50\nusemtl bare\nf 5 6 7 8\n",
                                           "v -50 4 -50\nv 50 4 -50\nv 50 4 50\nv -50 4 50\nusemtl bare\nf 5 6 7 8\n"};
        struct scene *scene = chart_load_board("chart.png", "", mirror ? -2.0 : 10.0, more[mirror]);
        struct surface_colours colours;
        struct surface_table table;
        struct sh_err err;
        assert_int_equal(scene->n_surfaces, 2);
        fill(&colours, scene, 2, 0);
        assert_int_equal(surface_table_alloc(2, &table, &err), SH_OK);
        table.surface[0].reflectance = 0.5;
        table.surface[1] =
            mirror ? (struct surface){.mirror = 0.9} : (struct surface){.reflectance = 0.1, .glass = 0.8};
        const struct cast_detect detect = {.surfaces = &table, .depth = 2, .ghost_label = 2, .max_echoes = 3};
        const struct seen seen = scan(&(struct view){.scene = scene,
                                                     .colours = &colours,
                                                     .texels = (const chart_texels *)&chart,
                                                     .bare = chart_bare,
                                                     .detect = &detect,
                                                     .ghosts = mirror});
        check_all_seen(&seen);
        assert_int_equal(seen.red > 2000, !mirror);
        surface_table_free(&table);
        surface_colours_free(&colours);
        scene_free(scene);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_format_and_each_way_to_wrap),
        cmocka_unit_test(an_obj_says_how_to_wrap),
        cmocka_unit_test(images_within_gltf),
        cmocka_unit_test(a_mesh_takes_its_image_along),
        cmocka_unit_test(under_a_footprint),
        cmocka_unit_test(through_glass_and_in_a_mirror),
    };
    return cmocka_run_group_tests(tests, chart_make_folder, chart_remove_folder);
}
