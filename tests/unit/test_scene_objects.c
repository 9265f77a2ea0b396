/* SPDX-License-Identifier: MIT */
/* Objects of a scene and their figures (core/scene_objects.h), on bodies whose figures are known. */
#include <math.h>

#include "core/body.h"
#include "core/scene_objects.h"
#include "core/vec3.h"
#include "tests/unit/scene_files.h"

/* The box has 2 x 3 x 4 m, and its top follows separately. The whole box has 52 m2 and 24 m3. */
#define CORNERS "v 0 0 0\nv 2 0 0\nv 2 3 0\nv 0 3 0\nv 0 0 4\nv 2 0 4\nv 2 3 4\nv 0 3 4\n"
#define SIDES   "f 4 3 2 1\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n"
#define BOX     CORNERS "o box\n" SIDES

static struct scene *load_bodies(const char *text, double x_m, struct scene_place *place, size_t n, int own)
{
    struct scene *scene;
    struct sh_err err;
    const struct scene_mesh_spec spec = {.file = write_text("bodies.obj", text),
                                         .scale = 1,
                                         .offset_m = {x_m, 2.0 * x_m, 0},
                                         .places = {.place = place, .n = n, .own_surfaces = own, .says = "places"}};
    const int rc = scene_load(&spec, 1, 1e-3, NULL, &scene, &err);
    unlink(path);
    if (rc != SH_OK) fail_msg("%s", err.text);
    return scene;
}

static uint64_t n_taken;
static double length_m;

static int take(void *ctx, const double a[3], const double b[3], struct sh_err *err)
{
    (void)ctx;
    (void)err;
    n_taken++;
    length_m += vec3_distance(a, b);
    return SH_OK;
}

/* The returned edges are the counted ones. */
static void find(const struct scene *scene, struct scene_objects *o)
{
    static const struct scene_open_edges all = {NULL, take}, *edges = &all;
    struct sh_err err;
    uint64_t n_open = 0;
    n_taken = 0;
    length_m = 0.0;
    assert_int_equal(scene_objects_find(scene, edges, NULL, o, &err), SH_OK);
    for (uint32_t i = 0; i < o->n; i++)
        n_open += o->object[i].n_open;
    assert_int_equal(n_taken, n_open);
}

/* A metre near 5,000 km is rounded to 1e-9, and each of 12 faces adds some of it. */
static void is_near(double value, double expected)
{
    if (!(fabs(value - expected) <= 1e-7 * fabs(expected))) fail_msg("%.12g, not %.12g", value, expected);
}

static void one(const char *text, double x_m, enum scene_object_state state, unsigned n_open, double area_m2,
                double volume_m3)
{
    struct scene *scene = load_bodies(text, x_m, NULL, 0, 0);
    struct scene_objects o;
    find(scene, &o);
    assert_int_equal(o.n, 1);
    assert_int_equal(o.object[0].state, state);
    assert_int_equal(o.object[0].n_open, n_open);
    assert_int_equal(o.object[0].n_triangles, scene->n_triangles);
    is_near(o.object[0].area_m2, area_m2);
    if (state == SCENE_OBJECT_CLOSED)
        is_near(o.object[0].volume_m3, volume_m3);
    else
        assert_true(isnan(o.object[0].volume_m3));
    scene_objects_free(&o);
    scene_free(scene);
}

static void bodies_are_judged(void **state)
{
    (void)state;
    for (double x_m = 0; x_m <= 2.5e6; x_m += 2.5e6) {
        one(BOX "f 5 6 7 8\n", x_m, SCENE_OBJECT_CLOSED, 0, 52, 24);
        one(CORNERS "f 1 2 3 4\nf 5 6 2 1\nf 6 7 3 2\nf 7 8 4 3\nf 8 5 1 4\nf 8 7 6 5\n", x_m, SCENE_OBJECT_CLOSED, 0,
            52, -24);
        one(BOX, x_m, SCENE_OBJECT_OPEN, 4, 46, 0);
        one(BOX "f 8 7 6 5\n", x_m, SCENE_OBJECT_TURNED, 0, 52, 0);
        /* A face that is there twice: each of its four edges has three triangles, and its diagonal has four. */
        one(BOX "f 5 6 7 8\nf 5 6 7 8\n", x_m, SCENE_OBJECT_OPEN, 4, 58, 0);
        /* The top's edges have corners in their middles, which the sides don't have. */
        one(BOX "v 1 0 4\nv 1 3 4\nf 5 9 10 8\nf 9 6 7 10\n", x_m, SCENE_OBJECT_CLOSED, 0, 52, 24);
        /* Half of the top closes two edges. Its diagonal and the two other edges of the top stay open. */
        one(BOX "f 5 6 7\n", x_m, SCENE_OBJECT_OPEN, 3, 49, 0);
    }
}

/* Corners that are in the file twice are one place. */
static void corners_of_faces_are_joined(void **state)
{
    (void)state;
    char text[4096] = "o box\n";
    static const char *const face[] = {"4 3 2 1", "1 2 6 5", "2 3 7 6", "3 4 8 7", "4 1 5 8", "5 6 7 8"};
    int n = 0;
    for (int f = 0; f < 6; f++) {
        int v[4];
        assert_int_equal(sscanf(face[f], "%d %d %d %d", &v[0], &v[1], &v[2], &v[3]), 4);
        for (int c = 0; c < 4; c++) {
            const int b = v[c] - 1, x = b % 4 == 1 || b % 4 == 2, y = b % 4 >= 2;
            sprintf(text + strlen(text), "v %d %d %d\n", 2 * x, 3 * y, 4 * (b / 4));
        }
        sprintf(text + strlen(text), "f %d %d %d %d\n", n + 1, n + 2, n + 3, n + 4);
        n += 4;
    }
    one(text, 0, SCENE_OBJECT_CLOSED, 0, 52, 24);
}

/* A missing square of 1 mm2 in a box of 52 m2 is an opening. */
static void a_small_hole_is_open(void **state)
{
    (void)state;
    one(BOX "v 0.5 1 4\nv 0.501 1 4\nv 0.501 1.001 4\nv 0.5 1.001 4\n"
            "f 5 6 10 9\nf 6 7 11 10\nf 7 8 12 11\nf 8 5 9 12\n",
        0, SCENE_OBJECT_OPEN, 4, 52 - 1e-6, 0);
}

/* A slit over the whole top is an opening from a mean width of 0.5e-5 of the body's diagonal on. The width is the
 * slit's area, as the sums over its edges give it, divided by the length of edges without a counterpart. These are the
 * slit's sides of 3 m, and at either end an edge of 2 m beside two of 1 m. The volume lacks a pyramid on the slit, 2 m
 * high. */
static void a_slit_counts_by_its_width(void **state)
{
    (void)state;
    const double min[3] = {0, 0, 0}, max[3] = {2, 3, 4}, thin_m = 1e-4;
    const double slit[4][3] = {{1, 0, 4}, {1, 3, 4}, {1 + thin_m, 3, 4}, {1 + thin_m, 0, 4}};
    struct body_sum sum;
    body_begin(&sum, min, max);
    for (int i = 0; i < 4; i++)
        body_add_edge(&sum, slit[i], slit[(i + 1) % 4]);
    const double limit_m = 0.5e-5 * vec3_distance(min, max) * (2 * 3 + 2 * 4) / (body_open_m2(&sum) / thin_m);
    for (int open = 0; open < 2; open++) {
        const double width_m = (open ? 1.05 : 0.95) * limit_m;
        char text[1024];
        snprintf(text, sizeof text, BOX "v 1 0 4\nv 1 3 4\nv %.17g 0 4\nv %.17g 3 4\nf 5 9 10 8\nf 11 6 7 12\n",
                 1 + width_m, 1 + width_m);
        one(text, 0, open ? SCENE_OBJECT_OPEN : SCENE_OBJECT_CLOSED, open ? 8 : 0, 52 - 3 * width_m, 24 - 2 * width_m);
    }
}

/* Objects are known by name, whatever their materials and order. */
static void surfaces_of_a_name_are_one_object(void **state)
{
    (void)state;
    struct scene *scene =
        load_bodies(CORNERS "o box\nusemtl a\nf 4 3 2 1\nf 1 2 6 5\no other\nv 9 9 9\nv 9 8 9\nv 8 9 9\n"
                            "f 9 10 11\no box\nusemtl b\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\nf 5 6 7 8\n",
                    0, NULL, 0, 0);
    struct scene_objects o;
    find(scene, &o);
    assert_int_equal(scene->n_surfaces, 3);
    assert_int_equal(o.n, 2);
    assert_string_equal(scene->surface[o.object[0].surface].object, "box");
    assert_int_equal(o.object[0].n_surfaces, 2);
    assert_int_equal(o.object[0].state, SCENE_OBJECT_CLOSED);
    is_near(o.object[0].volume_m3, 24);
    assert_int_equal(o.object[1].n_open, 3);
    is_near(o.object[1].area_m2, 0.5);
    for (uint32_t i = 0; i < 3; i++)
        assert_int_equal(o.of[i], strcmp(scene->surface[i].object, "box") != 0);
    scene_objects_free(&o);
    scene_free(scene);
}

/* Copies count with their scales, each by itself or all as one. */
static void copies_count(void **state)
{
    (void)state;
    struct scene_place place[3] = {{.scale = 1}, {.at_m = {50, 0, 0}, .turn_deg = 30, .scale = 2}, {.scale = 0.5}};
    for (int own = 0; own < 2; own++) {
        struct scene *scene = load_bodies(BOX "f 5 6 7 8\no lid\nf 5 6 7\n", 0, place, 3, own);
        struct scene_objects o;
        find(scene, &o);
        assert_int_equal(o.n, own ? 6 : 2);
        double area_m2 = 0, volume_m3 = 0;
        for (uint32_t i = 0; i < o.n; i++) {
            const int is_box = strncmp(scene->surface[o.object[i].surface].object, "box", 3) == 0;
            assert_int_equal(o.object[i].state, is_box ? SCENE_OBJECT_CLOSED : SCENE_OBJECT_OPEN);
            assert_int_equal(o.object[i].n_triangles, (is_box ? 12 : 1) * (own ? 1 : 3));
            area_m2 += is_box ? o.object[i].area_m2 : 0;
            volume_m3 += is_box ? o.object[i].volume_m3 : 0;
        }
        is_near(length_m, (2 + 3 + sqrt(13)) * (1 + 2 + 0.5)); /* of the lids */
        is_near(area_m2, 52 * (1 + 4 + 0.25));
        is_near(volume_m3, 24 * (1 + 8 + 0.125));
        scene_objects_free(&o);
        scene_free(scene);
    }
}

/* Objects of the scene's own mesh come first. Those of a mesh that is placed keep their own figures. */
static void copies_beside_a_mesh(void **state)
{
    (void)state;
    struct scene_place place[2] = {{.scale = 1}, {.at_m = {50, 0, 0}, .scale = 2}};
    char file[2][128];
    snprintf(file[0], sizeof file[0], "%s", write_text("own.obj", CORNERS "o floor\nf 1 2 3\no wall\nf 1 2 6 5\n"));
    snprintf(file[1], sizeof file[1], "%s", write_text("placed.obj", BOX "f 5 6 7 8\no lid\nf 5 6 7\n"));
    const struct scene_mesh_spec spec[2] = {
        {.file = file[0], .scale = 1},
        {.file = file[1], .scale = 1, .places = {.place = place, .n = 2, .own_surfaces = 1, .says = "places"}}};
    static const double area_m2[] = {3, 8, 52, 3, 4 * 52, 4 * 3};
    static const int n_triangles[] = {1, 2, 12, 1, 12, 1};
    struct scene *scene;
    struct scene_objects o;
    struct sh_err err;
    if (scene_load(spec, 2, 1e-3, NULL, &scene, &err) != SH_OK) fail_msg("%s", err.text);
    find(scene, &o);
    assert_int_equal(o.n, 6);
    for (uint32_t i = 0; i < o.n; i++) {
        is_near(o.object[i].area_m2, area_m2[i]);
        assert_int_equal(o.object[i].n_triangles, n_triangles[i]);
        assert_int_equal(o.object[i].state == SCENE_OBJECT_CLOSED, n_triangles[i] == 12);
    }
    scene_objects_free(&o);
    scene_free(scene);
    for (int i = 0; i < 2; i++)
        unlink(file[i]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bodies_are_judged),    cmocka_unit_test(corners_of_faces_are_joined),
        cmocka_unit_test(a_small_hole_is_open), cmocka_unit_test(surfaces_of_a_name_are_one_object),
        cmocka_unit_test(copies_count),         cmocka_unit_test(a_slit_counts_by_its_width),
        cmocka_unit_test(copies_beside_a_mesh),
    };
    return cmocka_run_group_tests_name("scene_objects", tests, make_folder, remove_folder);
}
