/* SPDX-License-Identifier: MIT */
/* Holes that textures cut out. The continuation of a ray is computed here ray by ray, from the texels as they are
 * written, without the head's code. */
#include "tests/unit/scene_files.h"

#include <math.h>
#include <png.h>

#include "core/cast.h"
#include "tests/common/made.h"

enum { SQUARES = 8, TEXELS = 4, RAYS = 20000, LAYERS = 40 };

/* Square 0, 0 is the lower left one; it is a hole. */
static int is_solid(int column, int row)
{
    return (column + row) % 2;
}

static const char *file_of(const char *name)
{
    static char file[4][160];
    static int turn;
    turn = (turn + 1) % 4;
    snprintf(file[turn], sizeof file[turn], "%s/%s", folder, name);
    return file[turn];
}

/* Alpha is just above and below a half. */
static void write_board(const char *name, int cut)
{
    enum { SIDE = SQUARES * TEXELS };
    static uint8_t rgba[SIDE * SIDE][4];
    png_image image = {.version = PNG_IMAGE_VERSION, .width = SIDE, .height = SIDE, .format = PNG_FORMAT_RGBA};
    for (int y = 0; y < SIDE; y++)
        for (int x = 0; x < SIDE; x++) {
            int solid = !cut || is_solid(x / TEXELS, SQUARES - 1 - y / TEXELS);
            const uint8_t texel[4] = {90, 120, 60, solid ? 128 : 127};
            memcpy(rgba[y * SIDE + x], texel, sizeof texel);
        }
    if (!png_image_write_to_file(&image, file_of(name), 0, rgba, 0, NULL)) fail_msg("%s", image.message);
}

static const char MATERIALS[] = "newmtl board\nmap_Kd board.png\nnewmtl full\nmap_Kd full.png\nnewmtl wall\n"
                                "newmtl clamped\nmap_Kd -clamp on board.png\nnewmtl mapped\nmap_Kd full.png\n"
                                "map_d board.png\nnewmtl gone\nmap_Kd none.png\n"
                                "newmtl scaled\nmap_Kd -s 2 0.5 1 -bm 1 -o 0.375 -0 0 board.png\n"
                                "newmtl moved\nmap_Kd C:\\users\\me\\board.png\n";

static int make_files(void **state)
{
    if (make_folder(state) != 0) return -1;
    write_board("board.png", 1);
    write_board("full.png", 0);
    write_text("m.mtl", MATERIALS);
    return 0;
}

static int remove_files(void **state)
{
    static const char *const file[] = {"board.png", "full.png", "m.mtl", "m.obj"};
    for (size_t i = 0; i < sizeof file / sizeof *file; i++)
        unlink(file_of(file[i]));
    return remove_folder(state);
}

/* An OBJ that is written piece by piece. */
static FILE *obj;
static int n_quads;

static void begin_obj(void)
{
    obj = fopen(file_of("m.obj"), "w");
    assert_non_null(obj);
    fputs("mtllib m.mtl\n", obj);
    n_quads = 0;
}

/* Writes a square across the y axis, from -half to half, with the image once. */
static void quad(const char *material, double y, double half, double shift_u)
{
    fprintf(obj, "usemtl %s\n", material);
    for (int k = 0; k < 4; k++) {
        int right = k == 1 || k == 2, top = k >= 2;
        fprintf(obj, "v %.17g %.17g %.17g\nvt %.17g %d\n", right ? half : -half, y, top ? half : -half, right + shift_u,
                top);
    }
    fprintf(obj, "f %d/%d %d/%d %d/%d %d/%d\n", 4 * n_quads + 1, 4 * n_quads + 1, 4 * n_quads + 2, 4 * n_quads + 2,
            4 * n_quads + 3, 4 * n_quads + 3, 4 * n_quads + 4, 4 * n_quads + 4);
    n_quads++;
}

static struct scene *load_obj(int textures, int cutouts)
{
    const struct scene_mesh_spec spec = {
        .file = file_of("m.obj"), .scale = 1.0, .textures = textures, .cutouts = cutouts};
    struct scene *scene;
    struct sh_err err;
    if (load_spec(&spec, 1e-3, &scene, &err) != SH_OK) fail_msg("%s", err.text);
    return scene;
}

static struct scene *end_obj(int textures, int cutouts)
{
    assert_int_equal(fclose(obj), 0);
    return load_obj(textures, cutouts);
}

struct rays {
    uint32_t n, triangle[RAYS], label[RAYS];
    double x[RAYS], y[RAYS], z[RAYS], px[RAYS], py[RAYS], pz[RAYS], range_m[RAYS];
};
static struct rays rays;

/* Aims into a cone about y, from a small box around the origin. */
static void aim(double slope, double reach_m)
{
    uint64_t seed = 20;
    rays.n = RAYS;
    for (uint32_t i = 0; i < RAYS; i++) {
        double a = slope * (2.0 * case_unit(&seed) - 1.0), b = slope * (2.0 * case_unit(&seed) - 1.0);
        double length = sqrt(1.0 + a * a + b * b);
        rays.x[i] = a / length;
        rays.y[i] = 1.0 / length;
        rays.z[i] = b / length;
        rays.px[i] = reach_m * (2.0 * case_unit(&seed) - 1.0);
        rays.py[i] = reach_m * (2.0 * case_unit(&seed) - 1.0);
        rays.pz[i] = reach_m * (2.0 * case_unit(&seed) - 1.0);
    }
}

static void cast_all(const struct scene *scene, uint32_t packet)
{
    struct caster *caster;
    struct sh_err err;
    struct bvh *bvh = made_bvh(scene);
    if (caster_create(&caster, &err) != SH_OK) fail_msg("%s", err.text);
    if (packet != 0) bvh_set_packet(bvh, packet);
    for (uint32_t at = 0; at < rays.n; at += BVH_CHUNK) {
        const struct bvh_rays part = {.n = rays.n - at < BVH_CHUNK ? rays.n - at : BVH_CHUNK,
                                      .from.own = {rays.px + at, rays.py + at, rays.pz + at},
                                      .dir = {rays.x + at, rays.y + at, rays.z + at},
                                      .range_max_m = 1000.0,
                                      .range_m = rays.range_m + at,
                                      .triangle = rays.triangle + at,
                                      .label = rays.label + at};
        caster_hits(caster, bvh, &part);
    }
    caster_free(caster);
    bvh_free(bvh);
}

/* This is one layer of the expected scene. */
struct layer {
    double y, half, shift_u;
    int cut, label;
};

/* Rays nearer than this to a texel's border or an edge are skipped. Texture coordinates are floats, so they round by
 * 6e-8 of 1 + shift. Counted in squares that is 8 times as much. */
static const double NEAR = 4e-6;

/* Returns 1 where ray i meets the layer, 0 where it does not, -1 where it is too near to a border. */
static int meets(const struct layer *l, uint32_t i)
{
    double t = (l->y - rays.py[i]) / rays.y[i];
    double x = rays.px[i] + t * rays.x[i], z = rays.pz[i] + t * rays.z[i];
    if (fabs(x) > l->half || fabs(z) > l->half) return 0;
    if (!l->cut) return 1;
    double u = SQUARES * ((x + l->half) / (2.0 * l->half) + l->shift_u), v = SQUARES * (z + l->half) / (2.0 * l->half);
    if (fabs(u - round(u)) < NEAR || fabs(v - round(v)) < NEAR) return -1;
    return is_solid((int)floor(u), (int)floor(v));
}

/* Layers in order of y. Returns how many rays passed through a hole. */
static uint32_t compare(const struct layer *layer, int n)
{
    uint32_t passed = 0, skipped = 0;
    for (uint32_t i = 0; i < rays.n; i++) {
        int k = 0, is = 0, holes = 0;
        for (; k < n; k++) {
            is = meets(&layer[k], i);
            if (is != 0) break;
            holes += layer[k].cut;
        }
        skipped += is < 0;
        if (is < 0) continue;
        passed += holes > 0;
        if (k == n) {
            if (!isnan(rays.range_m[i])) fail_msg("ray %u: %.9g m, not a miss", i, rays.range_m[i]);
            continue;
        }
        double want = (layer[k].y - rays.py[i]) / rays.y[i];
        if (!(fabs(rays.range_m[i] - want) < 1e-11) || rays.label[i] != (uint32_t)layer[k].label)
            fail_msg("ray %u: %.12f m on %u, not %.12f m on %d", i, rays.range_m[i], rays.label[i], want,
                     layer[k].label);
    }
    assert_true(skipped < rays.n / 50);
    return passed;
}

static void half_of_a_board_is_seen_through(void **state)
{
    (void)state;
    static const struct layer truth[] = {{10, 2, 0, 1, 0}, {20, 9, 0, 0, 1}};
    begin_obj();
    quad("board", 10, 2, 0);
    quad("wall", 20, 9, 0);
    struct scene *scene = end_obj(0, 1);
    assert_int_equal(scene->n_masks, 1);
    assert_int_equal(n_warnings, 0);
    aim(0.19, 0.1);
    for (uint32_t packet = 0; packet <= 16; packet = packet == 0 ? 1 : 4 * packet) {
        cast_all(scene, packet);
        assert_true(compare(truth, 2) > RAYS / 3);
    }
    scene_free(scene);
}

/* Layers are a micrometre apart, which glass would step over. Each is shifted by a part of a square, so that some rays
 * pass all. */
static void a_stack_of_any_number_is_seen_through(void **state)
{
    (void)state;
    static struct layer truth[LAYERS + 1];
    begin_obj();
    for (int k = 0; k <= LAYERS; k++) {
        truth[k] = (struct layer){10.0 + 1e-6 * k, 2.0, 0.002 * k, k < LAYERS, k == LAYERS};
        if (k == LAYERS) truth[k] = (struct layer){10.0 + 1e-6 * k, 9.0, 0, 0, 1};
        quad(k < LAYERS ? "board" : "wall", truth[k].y, truth[k].half, truth[k].shift_u);
    }
    struct scene *scene = end_obj(0, 1);
    aim(0.19, 0.1);
    rays.n = RAYS / 4;
    cast_all(scene, 0); /* float does not order surfaces that are so near */
    uint32_t on_wall = 0;
    assert_true(compare(truth, LAYERS + 1) > rays.n / 3);
    for (uint32_t i = 0; i < rays.n; i++)
        on_wall +=
            rays.label[i] == 1 && fabs(rays.px[i] + 10 * rays.x[i]) < 1.8 && fabs(rays.pz[i] + 10 * rays.z[i]) < 1.8;
    assert_true(on_wall > 100); /* through all of them */
    scene_free(scene);
}

/* A board is glued to a wall, in one plane. In a second scene board and wall are faces with the same corners. */
static void what_lies_in_the_same_plane_stops_the_ray(void **state)
{
    (void)state;
    static const struct layer glued[] = {{10, 9, 0, 0, 0}};
    for (int order = 0; order < 2; order++) {
        begin_obj();
        if (order) quad("board", 10, 2, 0);
        quad("wall", 10, 9, 0);
        if (!order) quad("board", 10, 2, 0);
        struct scene *scene = end_obj(0, 1);
        aim(0.19, 0.1);
        cast_all(scene, 0);
        for (uint32_t i = 0; i < rays.n; i++)
            rays.label[i] = 0; /* either of two in one plane may be named */
        compare(glued, 1);
        scene_free(scene);
    }
    static const struct layer twins[] = {{10, 2, 0, 0, 0}};
    begin_obj();
    quad("board", 10, 2, 0);
    quad("wall", 10, 2, 0);
    struct scene *scene = end_obj(0, 1);
    cast_all(scene, 0);
    for (uint32_t i = 0; i < rays.n; i++)
        rays.label[i] = 0;
    compare(twins, 1);
    scene_free(scene);
}

/* Cards stand in front of a floor that is seen at a small angle. Behind a hole the float distance of the floor may be
 * less than the card's. */
static void nothing_is_lost_behind_a_card_above_the_floor(void **state)
{
    (void)state;
    begin_obj();
    for (int k = 0; k < 30; k++)
        quad("board", 5.0 + 3.0 * k, 2.0, 0.003 * k);
    fprintf(obj, "usemtl wall\nv -50 1 -0.05\nv 50 1 -0.05\nv 50 200 -0.05\nv -50 200 -0.05\nf -4 -3 -2 -1\n");
    struct scene *scene = end_obj(0, 1);
    uint64_t seed = 3;
    rays.n = RAYS;
    for (uint32_t i = 0; i < RAYS; i++) {
        double a = 0.01 * (2.0 * case_unit(&seed) - 1.0), b = -0.05 / (4.0 + 92.0 * case_unit(&seed));
        double length = sqrt(1.0 + a * a + b * b);
        rays.x[i] = a / length;
        rays.y[i] = 1.0 / length;
        rays.z[i] = b / length;
        rays.px[i] = rays.py[i] = rays.pz[i] = 0.0;
    }
    cast_all(scene, 0);
    uint32_t on_floor = 0;
    for (uint32_t i = 0; i < RAYS; i++) {
        double floor_m = -0.05 / rays.z[i];
        int near = 0, k = 0, is = 0;
        for (; k < 30 && (5.0 + 3.0 * k) / rays.y[i] < floor_m; k++) {
            is = meets(&(struct layer){5.0 + 3.0 * k, 2.0, 0.003 * k, 1, 0}, i);
            near |= is < 0 || fabs((5.0 + 3.0 * k) / rays.y[i] - floor_m) < 1e-9;
            if (is != 0) break;
        }
        if (near) continue;
        double want = is == 1 ? (5.0 + 3.0 * k) / rays.y[i] : floor_m;
        on_floor += is != 1;
        /* The plane is given by corners 200 m away and met at an angle of 5e-4: 2^-53 200 m / 5e-4. */
        if (!(fabs(rays.range_m[i] - want) < 1e-9)) fail_msg("ray %u: %.12f m, not %.12f m", i, rays.range_m[i], want);
    }
    assert_true(on_floor > 1000);
    scene_free(scene);
}

/* Beyond its border a clamped board continues its border. An opacity map cuts as alpha does. */
static void wrap_modes_and_opacity_maps_of_obj_count(void **state)
{
    (void)state;
    begin_obj();
    quad("clamped", 10, 2, 1);
    quad("wall", 20, 9, 0);
    struct scene *scene = end_obj(0, 1);
    aim(0.19, 0.0);
    cast_all(scene, 0);
    for (uint32_t i = 0; i < rays.n; i++) { /* u is 1 to 2: the last column of squares */
        double x = 10.0 * rays.x[i] / rays.y[i], z = 10.0 * rays.z[i] / rays.y[i], v = SQUARES * (z + 2.0) / 4.0;
        if (fabs(v - round(v)) < NEAR || fabs(x) > 2.0 || fabs(z) > 2.0) continue;
        assert_int_equal(rays.label[i], is_solid(SQUARES - 1, (int)v) ? 0 : 1);
    }
    scene_free(scene);
    static const struct layer truth[] = {{10, 2, 0, 1, 0}, {20, 9, 0, 0, 1}};
    begin_obj();
    quad("mapped", 10, 2, 0);
    quad("wall", 20, 9, 0);
    scene = end_obj(0, 1);
    cast_all(scene, 0);
    assert_true(compare(truth, 2) > RAYS / 3);
    scene_free(scene);
}

/* The image is scaled to twice a side, and shifted by three eighths: that equals a board with such coordinates. */
static void scale_and_offset_of_obj_count(void **state)
{
    (void)state;
    begin_obj();
    quad("scaled", 10, 2, 0);
    quad("wall", 20, 9, 0);
    struct scene *scene = end_obj(0, 1);
    assert_int_equal(n_warnings, 0);
    aim(0.19, 0.0);
    cast_all(scene, 0);
    for (uint32_t i = 0; i < rays.n; i++) {
        double x = 10.0 * rays.x[i] / rays.y[i], z = 10.0 * rays.z[i] / rays.y[i];
        double u = SQUARES * (2.0 * (x + 2.0) / 4.0 + 0.375), v = SQUARES * 0.5 * (z + 2.0) / 4.0;
        if (fabs(v - round(v)) < NEAR || fabs(u - round(u)) < NEAR || fabs(x) > 2.0 || fabs(z) > 2.0) continue;
        assert_int_equal(rays.label[i], is_solid((int)u, (int)v) ? 0 : 1);
    }
    scene_free(scene);
}

/* The mesh names its image by a path of another machine. */
static void an_image_beside_the_mesh_is_found(void **state)
{
    (void)state;
    begin_obj();
    quad("moved", 10, 2, 0);
    struct scene *scene = end_obj(1, 1);
    assert_int_equal(n_warnings, 0);
    assert_string_equal(scene->texture[0].file, file_of("board.png"));
    assert_non_null(scene->cutout);
    scene_free(scene);
}

static void a_scene_without_holes_has_nothing_of_it(void **state)
{
    (void)state;
    begin_obj();
    quad("full", 10, 2, 0);
    quad("gone", 12, 2, 0);
    struct scene *scene = end_obj(0, 1);
    assert_true(scene->cutout == NULL && scene->uv == NULL && scene->n_textures == 0);
    assert_int_equal(n_warnings, 1);
    assert_non_null(strstr(warnings, "none.png' is missing"));
    scene_free(scene);
    scene = load_obj(1, 1);
    assert_true(scene->cutout == NULL && scene->uv != NULL && scene->n_textures == 2);
    scene_free(scene);
    begin_obj();
    quad("board", 10, 2, 0);
    scene = end_obj(0, 0);
    assert_true(scene->cutout == NULL && scene->uv == NULL && n_warnings == 0);
    scene_free(scene);
}

static void one_ray_passes_through_holes(void **state)
{
    (void)state;
    static const double y[3] = {0, 1, 0}, hole[3] = {-1.75, 0, -1.75}, solid[3] = {-1.25, 0, -1.75};
    begin_obj();
    quad("wall", 20, 9, 0);
    quad("board", 10, 2, 0);
    struct scene *scene = end_obj(0, 1);
    struct bvh *bvh = made_bvh(scene);
    assert_true(fabs(bvh_ray(bvh, hole, y) - 20.0) < 1e-9);
    assert_true(fabs(bvh_ray(bvh, solid, y) - 10.0) < 1e-9);
    bvh_free(bvh);
    scene_free(scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(half_of_a_board_is_seen_through),
                                       cmocka_unit_test(a_stack_of_any_number_is_seen_through),
                                       cmocka_unit_test(what_lies_in_the_same_plane_stops_the_ray),
                                       cmocka_unit_test(nothing_is_lost_behind_a_card_above_the_floor),
                                       cmocka_unit_test(wrap_modes_and_opacity_maps_of_obj_count),
                                       cmocka_unit_test(scale_and_offset_of_obj_count),
                                       cmocka_unit_test(an_image_beside_the_mesh_is_found),
                                       cmocka_unit_test(a_scene_without_holes_has_nothing_of_it),
                                       cmocka_unit_test(one_ray_passes_through_holes)};
    return cmocka_run_group_tests(tests, make_files, remove_files);
}
