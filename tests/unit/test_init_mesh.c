/* SPDX-License-Identifier: MIT */
/* The unit and the axis that points up, which `init` takes from a mesh or guesses: at the bounds of each guess, and
 * what is said of it. */
#include "firmware_sim/app/studio/init/mesh.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "tests/unit/output_rig.h"

static char folder[] = "/tmp/scanhead-mesh-XXXXXX", path[64];
static struct init_mesh as;
static struct sh_err err;
static char *said;

static int go(void **state)
{
    (void)state;
    if (mkdtemp(folder) == NULL) return -1;
    snprintf(path, sizeof path, "%s/m.obj", folder);
    return 0;
}

static int leave(void **state)
{
    (void)state;
    free(said);
    unlink(path);
    return rmdir(folder);
}

/* Two triangles that reach from one corner of a box to the other. */
static void write_box(const double low[3], const double size[3])
{
    FILE *out = fopen(path, "w");
    assert_non_null(out);
    for (int i = 0; i < 4; i++)
        fprintf(out, "v %.10g %.10g %.10g\n", low[0] + (i & 1) * size[0], low[1] + (i / 2) * size[1],
                low[2] + (i == 3 || i == 1) * size[2]);
    fputs("f 1 2 3\nf 2 4 3\n", out);
    assert_int_equal(fclose(out), 0);
}

static struct scene *load(const char *up, double scale)
{
    const struct init_wish wish = {.file = path, .up = up, .scale = scale};
    struct scene *scene = NULL;
    struct output output;
    free(said);
    output_take(&output, stderr);
    const int rc = init_load_mesh(&wish, "m.obj", &scene, &as, &err);
    said = output_give_said(&output);
    if (rc != SH_OK) fail_msg("%s", err.text);
    return scene;
}

/* A mesh of more than 2 km in metres is taken as millimetres. A survey is not: it has up to 50 km, is below 500 units
 * high, and more than ten times as wide. */
static void units_are_guessed(void **state)
{
    static const char none[] = "assumed: the file doesn't say",
                      survey[] =
                          "assumed: it is as wide and flat as a survey, and would be a thin plate in millimetres";
    static const struct {
        double size[3], scale;
        const char *from;
    } rows[] = {{{10, 5, 3}, 1.0, none},           {{2000, 5, 3}, 1.0, none},
                {{2001, 1500, 1500}, 0.001, none}, {{6000, 5000, 499}, 1.0, survey},
                {{6000, 6000, 500}, 0.001, none},  {{5000, 2900, 290}, 0.001, none}, /* ten times as wide is not more */
                {{5000, 2901, 290}, 1.0, survey},  {{2900, 5000, 290}, 0.001, none},
                {{2901, 5000, 290}, 1.0, survey},  {{50000, 50000, 100}, 1.0, survey},
                {{50001, 50000, 100}, 0.001, none}};
    static const double low[3] = {70, -3000, 400};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const char *why = strstr(rows[i].from, ": ") + 2;
        const double largest = fmax(rows[i].size[0], rows[i].size[1]);
        char want[400];
        write_box(low, rows[i].size);
        struct scene *scene = load("z", 0);
        if (as.scale != rows[i].scale || strcmp(as.scale_from, rows[i].from) != 0)
            fail_msg("%zu: %g, %s", i, as.scale, as.scale_from);
        snprintf(want, sizeof want,
                 "scanhead: warning: m.obj: the file does not give its unit: a %s is assumed%s%s, which makes the mesh "
                 "%.4g m large; --scale sets another one\n",
                 rows[i].scale == 1.0 ? "metre" : "millimetre", rows[i].from == none ? "" : ", since ",
                 rows[i].from == none ? "" : why, rows[i].scale * largest);
        assert_string_equal(said, want);
        for (int k = 0; k < 3; k++)
            assert_true(fabs(scene->max_m[k] - rows[i].scale * (low[k] + rows[i].size[k])) < 1e-9 * largest);
        scene_free(scene);
        const double y_up[3] = {rows[i].size[0], rows[i].size[2], rows[i].size[1]}; /* the same mesh, with y up */
        write_box(low, y_up);
        scene = load("y", 0);
        assert_true(as.scale == rows[i].scale);
        scene_free(scene);
    }
}

/* The mesh's middle has projected coordinates where one is from 200 km on and the other from 50 km on. The larger one
 * is also at least 20 times the mesh's size. */
static void projected_coordinates_are_metres(void **state)
{
    static const struct {
        double middle[3], size;
        int projected;
    } rows[] = {{{500000, 5800000, 0}, 3000, 1}, {{-500000, 5800000, 0}, 3000, 1},  {{50000, 200000, 0}, 3000, 1},
                {{49999, 200000, 0}, 3000, 0},   {{50000, 199999, 0}, 3000, 0},     {{200000, 50000, 0}, 3000, 1},
                {{0, 200000, 50000}, 3000, 1},   {{500000, 5800000, 0}, 290000, 1}, {{500000, 5800000, 0}, 290001, 0},
                {{5800000, 400, 0}, 3000, 0}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const double size[3] = {rows[i].size, rows[i].size, rows[i].size};
        double low[3];
        char want[160];
        for (int k = 0; k < 3; k++)
            low[k] = rows[i].middle[k] - 0.5 * rows[i].size;
        write_box(low, size);
        struct scene *scene = load("z", 0);
        snprintf(want, sizeof want, "assumed: its coordinates, near %.7g %.7g %.7g, are those of a projected system",
                 rows[i].middle[0], rows[i].middle[1], rows[i].middle[2]);
        assert_true(as.scale == (rows[i].projected ? 1.0 : 0.001));
        if (rows[i].projected) assert_string_equal(as.scale_from, want);
        if (!rows[i].projected) assert_string_equal(as.scale_from, "assumed: the file doesn't say");
        scene_free(scene);
    }
}

/* With y up the mesh is turned: y becomes z, and z becomes -y. */
static void axes_and_scale_are_given(void **state)
{
    static const double low[3] = {1, 2, 3}, size[3] = {10, 20, 40};
    (void)state;
    write_box(low, size);
    struct scene *scene = load("y", 0.5);
    assert_true(as.up == SCENE_UP_Y && as.scale == 0.5);
    assert_string_equal(as.up_from, "given by --up");
    assert_string_equal(as.scale_from, "given by --scale");
    assert_string_equal(said, "");
    assert_true(scene->min_m[0] == 0.5 && scene->max_m[0] == 5.5);
    assert_true(scene->min_m[1] == -21.5 && scene->max_m[1] == -1.5);
    assert_true(scene->min_m[2] == 1.0 && scene->max_m[2] == 11.0);
    double min[3] = {INFINITY, INFINITY, INFINITY}, max[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (uint32_t v = 0; v < scene->n_vertices; v++)
        for (int k = 0; k < 3; k++) {
            min[k] = fmin(min[k], scene->vertex_m[v][k]);
            max[k] = fmax(max[k], scene->vertex_m[v][k]);
        }
    for (int k = 0; k < 3; k++)
        assert_true(min[k] == scene->min_m[k] && max[k] == scene->max_m[k]);
    scene_free(scene);
    scene = load(NULL, 1);
    assert_int_equal(as.up, SCENE_UP_Z);
    assert_string_equal(as.up_from, "assumed: the file doesn't say; in many files y is up");
    assert_string_equal(said,
                        "scanhead: warning: m.obj: the file does not give the axis that points up: z is assumed; if "
                        "the mesh lies on its side, use --up y\n");
    assert_true(scene->min_m[1] == 2.0 && scene->max_m[2] == 43.0);
    scene_free(scene);
}

/* With y up, y is -z. The far side of a mesh that ends at z = 0 would be printed as y -0.000. */
static void bounds_have_no_negative_zero(void **state)
{
    (void)state;
    write_box((const double[3]){0, 0, -3}, (const double[3]){8, 6, 3});
    struct scene *scene = load("y", 0);
    assert_true(scene->min_m[1] == 0.0 && !signbit(scene->min_m[1]) && scene->max_m[1] == 3.0);
    scene_free(scene);
}

static void a_mesh_that_is_none(void **state)
{
    const struct init_wish wish = {.file = path};
    struct scene *scene = NULL;
    char want[400];
    (void)state;
    FILE *out = fopen(path, "w");
    assert_non_null(out);
    fputs("v 0 0 0\n", out);
    assert_int_equal(fclose(out), 0);
    assert_int_equal(init_load_mesh(&wish, "m.obj", &scene, &as, &err), SH_EINPUT);
    snprintf(want, sizeof want, "; a mesh of triangles is needed: export it again, for instance as .obj or .ply");
    assert_non_null(strstr(err.text, want));
    unlink(path);
    assert_int_equal(init_load_mesh(&wish, "m.obj", &scene, &as, &err), SH_EINPUT);
    snprintf(want, sizeof want, "%s: No such file or directory", path);
    assert_string_equal(err.text, want);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(units_are_guessed),        cmocka_unit_test(projected_coordinates_are_metres),
        cmocka_unit_test(axes_and_scale_are_given), cmocka_unit_test(bounds_have_no_negative_zero),
        cmocka_unit_test(a_mesh_that_is_none),
    };
    return cmocka_run_group_tests_name("init mesh", tests, go, leave);
}
