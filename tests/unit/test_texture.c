/* SPDX-License-Identifier: MIT */
/* Reflectance from a mesh's texture: a board of dark and light squares, whose places are known. */

#include <math.h>
#include <png.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/cast.h"
#include "core/surface.h"
#include "tests/common/made.h"

enum { SQUARES = 8, TEXELS = 16 }; /* a side; texels of a square, a side */
static const double AWAY_M = 10.0, SIDE_M = 4.0;
static const int DARK = 60, LIGHT = 220; /* sRGB */

static char folder[64];

static const char *path_of(const char *name)
{
    static char path[2][128];
    static int turn;
    turn = !turn;
    snprintf(path[turn], sizeof path[turn], "%s/%s", folder, name);
    return path[turn];
}

static void write_text(const char *name, const char *text)
{
    FILE *f = fopen(path_of(name), "w");
    assert_non_null(f);
    fputs(text, f);
    assert_int_equal(fclose(f), 0);
}

/* Square 0, 0 is the lower left one, dark. */
static int is_light(int column, int row)
{
    return (column + row) % 2;
}

static void write_board(const char *name)
{
    enum { SIDE = SQUARES * TEXELS };
    static uint8_t rgb[SIDE * SIDE][3];
    png_image image = {.version = PNG_IMAGE_VERSION, .width = SIDE, .height = SIDE, .format = PNG_FORMAT_RGB};
    for (int y = 0; y < SIDE; y++)
        for (int x = 0; x < SIDE; x++)
            memset(rgb[y * SIDE + x], is_light(x / TEXELS, SQUARES - 1 - y / TEXELS) ? LIGHT : DARK, 3);
    if (!png_image_write_to_file(&image, path_of(name), 0, rgb, 0, NULL)) fail_msg("%s", image.message);
}

/* IEC 61966-2-1 */
static double light_of(double srgb)
{
    return srgb <= 0.04045 ? srgb / 12.92 : pow((srgb + 0.055) / 1.055, 2.4);
}

/* A square board is upright across the y axis, twice the image a side. The board is one polygon, so that the loader
 * cuts it. */
static const char BOARD[] = "mtllib board.mtl\no board\n"
                            "v -2 10 -2\nv 2 10 -2\nv 2 10 2\nv -2 10 2\n"
                            "vt 0 0\nvt 2 0\nvt 2 2\nvt 0 2\n"
                            "usemtl squares\nf 1/1 2/2 3/3 4/4\n";

static struct scene *load(const char *file, int textures)
{
    const struct scene_mesh_spec spec = {.file = path_of(file), .scale = 1.0, .textures = textures};
    struct scene *scene;
    struct sh_err err;
    if (scene_load(&spec, 1, 1e-4, NULL, &scene, &err) != SH_OK) fail_msg("%s", err.text);
    return scene;
}

static int make_folder(void **state)
{
    (void)state;
    strcpy(folder, "/tmp/scanhead-texture-XXXXXX");
    if (mkdtemp(folder) == NULL) return -1;
    write_board("board.png");
    write_text("board.obj", BOARD);
    write_text("board.mtl", "newmtl squares\nKd 1 0.8 0.5\nmap_Kd -s 1 1 1 board.png\n");
    return 0;
}

static int remove_folder(void **state)
{
    static const char *const file[] = {"board.png", "board.obj", "board.mtl",  "other.obj",
                                       "other.mtl", "other.png", "board.gltf", "board.bin"};
    (void)state;
    for (size_t i = 0; i < sizeof file / sizeof *file; i++)
        unlink(path_of(file[i]));
    return rmdir(folder);
}

struct seen {
    uint32_t n, light, dark;
};

/* The bound is half a step of 0.01 dB, and half a step of a texel, 1 / 65534, at a reflectance of 0.02 or more. */
static const double TOLD_DB = 0.005 + 4.343 * 0.5 / 65534.0 / 0.02;

/* Casts over the board and compares the reflectance of each pulse with its square's. Pulses within `near` squares of
 * its edge are left out. */
static struct seen compare(const struct scene *scene, const struct surface_table *table, double dark, double light,
                           const struct cast_mover *mover, double shift_m, struct cast_beam *beam, double near)
{
    static const double at[3] = {0.0, 0.0, 0.0};
    const struct schedule_spec spec = {.prr_uhz = 24000000000,
                                       .lines_uhz = 3000000,
                                       .pan_udeg_s = 3000000,
                                       .fov_min_udeg = -40000000,
                                       .sweep_udeg = 240000000,
                                       .line_start_udeg = -10000000,
                                       .line_stop_udeg = 10000000,
                                       .pan_start_udeg = -10000000,
                                       .pan_stop_udeg = 10000000};
    struct schedule_segment segment;
    struct detect_signal signal;
    struct caster *caster;
    struct line_block block;
    struct seen seen = {0};
    struct sh_err err;
    const struct detect_signal_spec sheet = {
        .n_reaches = 1, .reach = {{0.9, 900.0}}, .threshold_snr = 8.0, .sharp = 1, .seed = 1};
    schedule_start(&segment, &spec);
    struct bvh *bvh = made_bvh(scene);
    if (caster_create(&caster, &err) != SH_OK || line_block_alloc(&block, 1000, &err) != SH_OK ||
        detect_signal_set_up(&sheet, &signal, &err) != SH_OK)
        fail_msg("%s", err.text);
    const struct cast_detect detect = {.surfaces = table, .signal = &signal, .max_echoes = 1};
    struct cast_setup setup = {.bvh = bvh,
                               .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1},
                               .range_max_m = 2000.0,
                               .mirror_counts = 0x1p32,
                               .pan_counts = 0x1p32,
                               .range_scale_m = 1e-5,
                               .detect = &detect};
    if (mover != NULL) {
        setup.n_movers = 1;
        setup.mover[0] = *mover;
    }
    struct beam_outlines *outlines = NULL;
    setup.beam = beam;
    if (beam != NULL && beam->mode == BEAM_ADAPTIVE) {
        const struct beam_outlines_spec wanted = {scene, at, &beam->beam, 2000.0, NULL, NULL};
        if (cast_outlines(&wanted, bvh, &outlines, &err) != SH_OK) fail_msg("%s", err.text);
        beam->outlines = outlines;
    }
    for (uint64_t l = 0; l < 20; l++) {
        struct schedule_line line;
        struct schedule_run run;
        schedule_get_line(&segment, l, &line);
        schedule_get_run(&segment, &line, line.cast0, (uint32_t)(line.cast_end - line.cast0), &run);
        caster_cast(caster, &setup, &run, &block);
        for (uint32_t i = 0; i < block.n_points; i++) {
            double m = 2.0 * M_PI * schedule_mirror_turn(&segment, line.cast0 + i);
            double p = 2.0 * M_PI * schedule_pan_turn(&segment, line.cast0 + i);
            double d[3] = {sin(p) * cos(m), cos(p) * cos(m), sin(m)}, range_m = AWAY_M / d[1];
            double u = (d[0] * range_m - shift_m + 0.5 * SIDE_M) * 2.0 / SIDE_M * SQUARES;
            double v = (d[2] * range_m + 0.5 * SIDE_M) * 2.0 / SIDE_M * SQUARES;
            if (block.echo[i] == 0 || fabs(u - round(u)) < near || fabs(v - round(v)) < near) continue;
            if (u < 0.0 || v < 0.0 || u > 2.0 * SQUARES || v > 2.0 * SQUARES) continue;
            int is = is_light((int)u, (int)v);
            double want_db = 10.0 * log10((is ? light : dark) * d[1]);
            if (!(fabs(0.01 * block.refl_cdb[i] - want_db) <= TOLD_DB))
                fail_msg("at %.4f, %.4f: %.2f dB, not %.4f", u, v, 0.01 * block.refl_cdb[i], want_db);
            assert_int_equal(block.label[i], mover != NULL ? 1 : 0);
            seen.n++;
            seen.light += (uint32_t)is;
            seen.dark += (uint32_t)!is;
        }
    }
    beam_outlines_free(outlines);
    line_block_free(&block);
    caster_free(caster);
    bvh_free(bvh);
    return seen;
}

static void fill_table(struct surface_table *table, const struct scene *scene, const struct scene_surface *surface,
                       uint32_t n, uint32_t textured)
{
    struct sh_err err;
    assert_int_equal(surface_table_alloc(n, table, &err), SH_OK);
    for (uint32_t i = 0; i < n; i++)
        surface_table_set(table, i, surface, NULL, 0, 0.5);
    if (surface_table_texture(table, textured, surface, &scene->texture[surface->texture - 1], &err) != SH_OK)
        fail_msg("%s", err.text);
}

/* Returns the luminance of the material's colour times the texel's, for Kd 1 0.8 0.5. */
static double reflectance(int srgb)
{
    double texel = light_of(srgb / 255.0);
    return texel * (0.2126 + 0.7152 * light_of(0.8) + 0.0722 * light_of(0.5));
}

/* A texel's share of 65534 steps may be none, all, or half. A label without a texel has its surface's value. */
static void texels_in_labels(void **state)
{
    (void)state;
    static const uint32_t label[] = {1U << 16, 65535U << 16, 32768U << 16, 0};
    static const double cosine[] = {1.0, 1.0, 0.5, 1.0};
    struct surface surface[2] = {{.reflectance = 0.3}};
    struct surface_texture *none[2] = {NULL, NULL};
    const struct surface_table table = {.n = 1, .surface = surface, .texture = none};
    double rho[4];
    surface_return(&table, 4, label, cosine, rho);
    assert_true(rho[0] == 0.0 && rho[1] == 1.0 && fabs(rho[2] - 0.25) < 1e-12 && rho[3] == 0.3);
}

static void squares_are_where_the_image_has_them(void **state)
{
    (void)state;
    struct scene *scene = load("board.obj", 1);
    struct surface_table table;
    assert_int_equal(scene->n_textures, 1);
    assert_string_equal(scene->texture[0].file, path_of("board.png"));
    fill_table(&table, scene, &scene->surface[0], 1, 0);
    struct seen seen = compare(scene, &table, reflectance(DARK), reflectance(LIGHT), NULL, 0.0, NULL, 1e-3);
    assert_true(seen.light > 200 && seen.dark > 200);
    surface_table_free(&table);
    scene_free(scene);
}

/* The board moves to the right, and a wall far behind it stands still. */
static void squares_move_with_the_mesh(void **state)
{
    (void)state;
    static const double wall[3][3] = {{-500, 100, -500}, {500, 100, -500}, {0, 100, 900}};
    static const uint32_t triangle[1][3] = {{0, 1, 2}};
    struct scene *board = load("board.obj", 1), *still;
    struct surface_table table;
    still = made_scene(&(struct scene_arrays){wall, 3, triangle, 1, NULL, NULL, 0});
    for (uint32_t i = 0; i < board->n_triangles; i++)
        board->label[i] = 1;
    struct bvh *bvh = made_bvh(board);
    fill_table(&table, board, &board->surface[0], 2, 1);
    const struct cast_mover mover = {.bvh = bvh,
                                     .centre_m = {0.0, AWAY_M, 0.0},
                                     .radius_m = 3.0,
                                     .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1},
                                     .shift_m = {0.35, 0.0, 0.0}};
    struct seen seen = compare(still, &table, reflectance(DARK), reflectance(LIGHT), &mover, 0.35, NULL, 1e-3);
    assert_true(seen.light > 200 && seen.dark > 200);
    surface_table_free(&table);
    bvh_free(bvh);
    scene_free(board);
    scene_free(still);
}

/* A footprint of 8 mm is compared where it lies within a square. With the adaptive beam one ray decides by the square
 * in its centre. */
static void squares_under_a_footprint(void **state)
{
    (void)state;
    static struct cast_beam beam;
    struct scene *scene = load("board.obj", 1);
    struct surface_table table;
    fill_table(&table, scene, &scene->surface[0], 1, 0);
    beam_init(&beam.beam, 0.007, 0.35e-3, 4e-9);
    beam_rings(2, &beam.pattern);
    beam_rings(BEAM_FINE_RINGS, &beam.fine);
    beam.max_echoes = 1;
    for (int adaptive = 0; adaptive < 2; adaptive++) {
        beam.mode = adaptive ? BEAM_ADAPTIVE : BEAM_RINGS;
        struct seen seen =
            compare(scene, &table, reflectance(DARK), reflectance(LIGHT), NULL, 0.0, &beam, adaptive ? 1e-3 : 0.02);
        assert_true(seen.light > 200 && seen.dark > 200);
    }
    surface_table_free(&table);
    scene_free(scene);
}

/* glTF counts v from the top, and Assimp reverses that. */
static void squares_of_gltf(void **state)
{
    (void)state;
    static const float p[4][3] = {{-2, -2, -10}, {2, -2, -10}, {2, 2, -10}, {-2, 2, -10}}; /* y up: 10 m along y */
    static const float uv[4][2] = {{0, 1}, {2, 1}, {2, -1}, {0, -1}};
    static const uint16_t index[6] = {0, 1, 2, 0, 2, 3};
    FILE *f = fopen(path_of("board.bin"), "wb");
    assert_non_null(f);
    fwrite(p, sizeof p, 1, f);
    fwrite(uv, sizeof uv, 1, f);
    fwrite(index, sizeof index, 1, f);
    fclose(f);
    write_text(
        "board.gltf",
        "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0}],"
        "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0,\"TEXCOORD_0\":1},\"indices\":2,"
        "\"material\":0}]}],\"materials\":[{\"name\":\"squares\",\"pbrMetallicRoughness\":{"
        "\"baseColorTexture\":{\"index\":0}}}],\"textures\":[{\"source\":0}],\"images\":[{\"uri\":\"board.png\"}],"
        "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":4,\"type\":\"VEC3\","
        "\"min\":[-2,-2,-10],\"max\":[2,2,-10]},{\"bufferView\":1,\"componentType\":5126,\"count\":4,"
        "\"type\":\"VEC2\"},{\"bufferView\":2,\"componentType\":5123,\"count\":6,\"type\":\"SCALAR\"}],"
        "\"bufferViews\":[{\"buffer\":0,\"byteOffset\":0,\"byteLength\":48},{\"buffer\":0,\"byteOffset\":48,"
        "\"byteLength\":32},{\"buffer\":0,\"byteOffset\":80,\"byteLength\":12}],"
        "\"buffers\":[{\"uri\":\"board.bin\",\"byteLength\":92}]}");
    const struct scene_mesh_spec spec = {.file = path_of("board.gltf"), .scale = 1.0, .up = SCENE_UP_Y, .textures = 1};
    struct scene *scene;
    struct surface_table table;
    struct sh_err err;
    if (scene_load(&spec, 1, 1e-4, NULL, &scene, &err) != SH_OK) fail_msg("%s", err.text);
    assert_int_equal(scene->n_textures, 1);
    fill_table(&table, scene, &scene->surface[0], 1, 0);
    struct seen seen = compare(scene, &table, light_of(DARK / 255.0), light_of(LIGHT / 255.0), NULL, 0.0, NULL, 1e-3);
    assert_true(seen.light > 200 && seen.dark > 200);
    surface_table_free(&table);
    scene_free(scene);
}

static void nothing_is_kept_unasked(void **state)
{
    (void)state;
    struct scene *scene = load("board.obj", 0);
    assert_null(scene->uv);
    assert_int_equal(scene->n_textures, 0);
    assert_int_equal(scene->surface[0].texture, 0);
    scene_free(scene);
}

static void what_is_no_png_is_said(void **state)
{
    (void)state;
    struct surface_table table;
    struct sh_err err;
    write_text("other.obj",
               "mtllib other.mtl\nv -2 10 -2\nv 2 10 -2\nv 2 10 2\nvt 0 0\nusemtl squares\nf 1/1 2/1 3/-1\n");
    write_text("other.mtl", "newmtl squares\nmap_Kd other.png\n");
    write_text("other.png", "no image");
    struct scene *scene = load("other.obj", 1);
    assert_int_equal(surface_table_alloc(1, &table, &err), SH_OK);
    assert_int_equal(surface_table_texture(&table, 0, &scene->surface[0], &scene->texture[0], &err), SH_EINPUT);
    assert_non_null(strstr(err.text, path_of("other.png")));
    surface_table_free(&table);
    scene_free(scene);
    write_text("other.obj", "v -2 10 -2\nv 2 10 -2\nv 2 10 2\nvt 0 0\nf 1/1 2/1 3/2\n");
    const struct scene_mesh_spec spec = {.file = path_of("other.obj"), .scale = 1.0, .textures = 1};
    assert_int_equal(scene_load(&spec, 1, 1e-4, NULL, &scene, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "vt index 2 out of range"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(texels_in_labels),
                                       cmocka_unit_test(squares_are_where_the_image_has_them),
                                       cmocka_unit_test(squares_move_with_the_mesh),
                                       cmocka_unit_test(squares_under_a_footprint),
                                       cmocka_unit_test(squares_of_gltf),
                                       cmocka_unit_test(nothing_is_kept_unasked),
                                       cmocka_unit_test(what_is_no_png_is_said)};
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
