/* SPDX-License-Identifier: MIT */
/* The builder of a scene (core/scene/build.h): what it takes, what it leaves out and counts, and what it says. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/scene/build_load.h"
#include "core/scene/build_surfaces.h"
#include "tests/common/cases.h"

static char warned[2048];
static uint32_t n_warned;
static struct sh_err err;

static void keep_warning(void *ctx, const char *text)
{
    (void)ctx;
    n_warned++;
    snprintf(warned + strlen(warned), sizeof warned - strlen(warned), "%s\n", text);
}

static const struct sh_report report = {.warn = keep_warning};
static struct scene_build b;

static void begin(const struct scene_mesh_spec *spec, double tolerance_m)
{
    warned[0] = '\0';
    n_warned = 0;
    assert_int_equal(build_init(&b, tolerance_m, &report, &err), SH_OK);
    build_begin_file(&b, spec);
}

static const struct scene_mesh_spec PLAIN = {.file = "dir/house.obj", .scale = 1.0};

static void says(int rc, const char *want)
{
    assert_int_equal(rc, SH_EINPUT);
    assert_string_equal(err.text, want);
}

/* A message has the line or, without one, the mesh's name. It has only the end of a long path. */
static void places_in_messages(void **state)
{
    (void)state;
    char path[160], want[256], mesh[80];
    begin(&PLAIN, 1.0);
    says(build_fail(&b, SH_EINPUT, &err, "%d", 5), "dir/house.obj: 5");
    b.mesh = "roof";
    says(build_fail(&b, SH_EINPUT, &err, "why"), "dir/house.obj, mesh 'roof': why");
    b.line = 7;
    says(build_fail(&b, SH_EINPUT, &err, "why"), "dir/house.obj, line 7: why");
    memset(mesh, 'm', sizeof mesh);
    mesh[sizeof mesh - 1] = '\0';
    b.line = 0;
    b.mesh = mesh;
    build_fail(&b, SH_EINPUT, &err, "why");
    snprintf(want, sizeof want, "dir/house.obj, mesh '%.64s': why", mesh);
    assert_string_equal(err.text, want);
    build_release(&b);
    for (size_t n = 126; n < 130; n++) { /* the name has room for 127 bytes */
        memset(path, 'p', n);
        path[n] = '\0';
        begin(&(struct scene_mesh_spec){.file = path, .scale = 1.0}, 1.0);
        build_fail(&b, SH_EINPUT, &err, "why");
        snprintf(want, sizeof want, "%s%s: why", n < 128 ? "" : "...", path + (n < 128 ? 0 : n - 124));
        assert_string_equal(err.text, want);
        build_release(&b);
    }
}

static void names_without_folders(void **state)
{
    (void)state;
    static const char *const names[][2] = {
        {"a/b.c.obj", "b.c"}, {"house", "house"}, {"x/.obj", ".obj"}, {"x.y/house", "house"}, {"a.b", "a"}};
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        begin(&(struct scene_mesh_spec){.file = names[i][0], .scale = 1.0}, 1.0);
        if (!text_is(build_base_name(&b), names[i][1])) fail_msg("%s", names[i][0]);
        build_release(&b);
    }
}

/* Errors are in the file's units, and are rounded up to two digits. Below a micrometre nothing is said; above a
 * millimetre, what to do. */
static void single_precision(void **state)
{
    (void)state;
    static const struct {
        double scale, largest, error;
        int refuse;
        double kept_m;
        const char *warns, *fails;
    } is[] = {
        {1.0, 5.0, 0.0, 1, 0.0, "", NULL},
        {1.0, 5.0, 1e-6, 1, 1e-6, "", NULL},
        {0.001, 5.0, 9.11e-4, 1, 9.2e-7, "", NULL},
        {1.0, 123.5, 1.23e-6, 1, 1.3e-6,
         "dir/house.obj: read in single precision, with errors up to 1.3e-06 m: coordinates go up to 123.5\n", NULL},
        {1.0, 5e4, 1e-3, 1, 1e-3,
         "dir/house.obj: read in single precision, with errors up to 0.001 m: coordinates go up to 50000\n", NULL},
        {1.0, 5e4, 1.1e-3, 1, 1.1e-3,
         "dir/house.obj: read in single precision, with errors up to 0.0011 m: coordinates go up to 50000; move it near "
         "its origin, then export it again\n",
         NULL},
        {2.0, 5e4, 1.5e-3, 1, 3e-3,
         "dir/house.obj: read in single precision, with errors up to 0.003 m: coordinates go up to 50000; move it near "
         "its origin, then export it again\n",
         NULL},
        {1.0, 5e5, 0.01, 1, 0.01,
         "dir/house.obj: read in single precision, with errors up to 0.01 m: coordinates go up to 500000; move it near "
         "its origin, then export it again\n",
         NULL},
        {1.0, 5e5, 0.0301, 1, 0.0, "",
         "dir/house.obj: coordinates up to 500000 are read in single precision, with errors up to 0.031 m; allowed are "
         "0.01 m (scene.tolerance_m, or else a tenth of plan.tolerance_m): set it to 0.031, move the mesh near its "
         "origin, or convert it to .obj or .ply"},
        {1.0, 5e7, 3.0, 1, 0.0, "",
         "dir/house.obj: coordinates up to 50000000 are read in single precision, with errors up to 3 m; allowed are "
         "0.01 m (scene.tolerance_m, or else a tenth of plan.tolerance_m): move the mesh near its origin, or convert it "
         "to .obj or .ply"},
        {1.0, 5e5, 0.0301, 0, 0.031,
         "dir/house.obj: read in single precision, with errors up to 0.031 m: coordinates go up to 500000; move it near "
         "its origin, then export it again\n",
         NULL}};
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++) {
        const struct scene_mesh_spec spec = {.file = "dir/house.obj", .scale = is[i].scale};
        begin(&spec, 0.01);
        const int rc = build_single(&b, is[i].largest, is[i].error, is[i].refuse, &err);
        if (is[i].fails != NULL)
            says(rc, is[i].fails);
        else
            assert_int_equal(rc, SH_OK);
        assert_string_equal(warned, is[i].warns);
        assert_true(fabs(b.scene->error_m - is[i].kept_m) <= 1e-9 * is[i].kept_m);
        if (rc == SH_OK) {
            b.scene->error_m = 5.0; /* that of another mesh, which is larger */
            build_single(&b, is[i].largest, is[i].error, is[i].refuse, &err);
            assert_true(b.scene->error_m == 5.0);
        }
        build_release(&b);
    }
}

static void vertices(void **state)
{
    (void)state;
    static const double v[3] = {1.0, 2.0, 3.0}, most[3] = {1e9, -1e9, 1e9};
    struct scene_mesh_spec spec = {.file = "f", .scale = 2.0, .offset_m = {10.0, 20.0, 30.0}};
    begin(&spec, 1.0);
    assert_int_equal(build_vertex(&b, v, &err), SH_OK);
    spec.up = SCENE_UP_Y; /* y is up in the file: (x, y, z) becomes (x, -z, y) */
    assert_int_equal(build_vertex(&b, v, &err), SH_OK);
    static const double want[2][3] = {{12.0, 24.0, 36.0}, {12.0, 14.0, 34.0}};
    assert_int_equal(b.scene->n_vertices, 2);
    assert_memory_equal(b.scene->vertex_m, want, sizeof want);
    for (int k = 0; k < 3; k++) {
        double bad[3] = {1.0, 2.0, 3.0};
        char text[128];
        bad[k] = k == 1 ? (double)NAN : (double)INFINITY;
        b.n_welded = 4; /* counts, too */
        snprintf(text, sizeof text, "f: vertex 7 (%g %g %g) is not finite", bad[0], bad[1], bad[2]);
        says(build_vertex(&b, bad, &err), text);
    }
    b.n_welded = 0;
    b.mesh_vertex0 = 2;
    b.mesh = "wall";
    says(build_vertex(&b, most, &err), "f, mesh 'wall': vertex 1 is at 2e+09 m; allowed are coordinates up to 1e+09 m: "
                                       "check the scale of 2 metres per unit");
    assert_int_equal(b.scene->n_vertices, 2);
    build_release(&b);
    begin(&(struct scene_mesh_spec){.file = "f", .scale = 1.0}, 1.0);
    assert_int_equal(build_vertex(&b, most, &err), SH_OK);
    build_release(&b);
}

static void add_corner(const double x, double y, double z)
{
    const uint32_t n = b.scene->n_vertices;
    assert_int_equal(build_vertex(&b, (const double[3]){x, y, z}, &err), SH_OK);
    assert_int_equal(build_corners(&b, n % 3 + 1, &err), SH_OK);
    b.corner[n % 3] = n;
}

/* A triangle has area where its height is more than 1e-12 of its longest edge, whichever that is. */
static void needles_are_left_out(void **state)
{
    (void)state;
    begin(&PLAIN, 1.0);
    for (int edge = 0; edge < 3; edge++)
        for (int wide = 0; wide < 2; wide++) {
            const double h = 100.0 * (wide ? 1.01e-12 : 0.99e-12);
            for (int c = 0; c < 3; c++) {
                const int k = (c + edge) % 3;
                add_corner(k == 0 ? 0.0 : k == 1 ? 100.0 : 50.0, k == 2 ? h : 0.0, 0.0);
            }
            assert_int_equal(build_polygon(&b, 3, 0, &err), SH_OK);
        }
    assert_int_equal(b.scene->n_triangles, 3);
    assert_int_equal(b.counts.zero_area, 3);
    b.counts.not_triangles = 2;
    b.counts.names_cut = 1;
    b.not_simple = 4;
    assert_int_equal(build_end_file(&b, &err), SH_OK);
    assert_int_equal(n_warned, 4);
    assert_string_equal(warned,
                        "dir/house.obj: 3 triangles without area left out\n"
                        "dir/house.obj: 2 points and lines left out\n"
                        "dir/house.obj: 1 names cut to 255 bytes\n"
                        "dir/house.obj: the outlines of 4 polygons cross themselves; their triangles overlap\n");
    assert_true(b.scene->counts.zero_area == 3 && b.scene->counts.not_triangles == 2 && b.scene->counts.names_cut == 1);
    /* The next file has counts of its own; the scene adds them up. */
    build_begin_file(&b, &PLAIN);
    b.counts.zero_area = 5;
    b.counts.not_triangles = 6;
    says(build_end_file(&b, &err), "dir/house.obj: it has no triangles (5 without area, 6 points and lines)");
    assert_true(b.scene->counts.zero_area == 8 && b.scene->counts.not_triangles == 8 && b.scene->counts.names_cut == 1);
    build_release(&b);
}

/* The first triangle with texture coordinates, or colours, makes room for those before it, which have none. */
static void coordinates_and_colours_of_corners(void **state)
{
    (void)state;
    begin(&PLAIN, 1.0);
    for (int t = 0; t < 3; t++) {
        for (int c = 0; c < 3; c++) {
            add_corner(c == 1, c == 2, t);
            b.corner_uv[c][0] = (float)(10 * t + c);
            b.corner_uv[c][1] = 0.5F;
            memset(b.corner_rgb[c], 16 * t + c, 4);
        }
        b.has_uv = b.has_rgb = t == 1;
        assert_int_equal(build_polygon(&b, 3, (uint16_t)t, &err), SH_OK);
    }
    const struct scene *s = b.scene;
    assert_int_equal(s->n_triangles, 3);
    for (int c = 0; c < 3; c++) {
        assert_true(isnan(s->uv[0][c][0]) && isnan(s->uv[2][c][1]));
        assert_true(s->uv[1][c][0] == 10.0F + (float)c && s->uv[1][c][1] == 0.5F);
        for (int k = 0; k < 4; k++)
            assert_true(s->rgb[0][c][k] == 0 && s->rgb[1][c][k] == 16 + c && s->rgb[2][c][k] == 0);
        assert_int_equal(s->label[c], c);
    }
    build_release(&b);
}

static void limits_of_counts(void **state)
{
    (void)state;
    begin(&PLAIN, 1.0);
    assert_int_equal(build_reserve(&b, 3, 1, &err), SH_OK);
    says(build_reserve(&b, UINT32_MAX, 0, &err), "dir/house.obj: too many vertices: a scene holds up to 4294967294");
    says(build_reserve(&b, 0, UINT32_MAX, &err), "dir/house.obj: too many triangles: a scene holds up to 4294967294");
    says(build_polygon(&b, SCENE_MAX_CORNERS + 1, 0, &err),
         "dir/house.obj: a polygon has 65537 corners; allowed are up to 65536");
    struct scene *scene;
    says(build_finish(&b, 0, &scene, &err), "the scene has no triangles");
    build_release(&b);
}

/* Colours are limited to 0..255, and counted where they were not. */
static void colours_of_files(void **state)
{
    (void)state;
    static const struct {
        double in[3], scale;
        uint8_t out[3];
        uint32_t limited;
    } is[] = {{{0.0, 0.5, 1.0}, 255.0, {0, 128, 255}, 0},
              {{255.0, 100.4, 100.6}, 1.0, {255, 100, 101}, 0},
              {{-0.1, 0.5, 0.5}, 255.0, {0, 128, 128}, 1},
              {{0.5, 1.1, 0.5}, 255.0, {128, 255, 128}, 1},
              {{0.5, 0.5, NAN}, 255.0, {128, 128, 0}, 1}};
    begin(&PLAIN, 1.0);
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++) {
        uint8_t rgb[4];
        b.n_rgb_limited = 0;
        build_rgb(&b, is[i].in, is[i].scale, rgb);
        assert_memory_equal(rgb, is[i].out, 3);
        assert_int_equal(b.n_rgb_limited, is[i].limited);
    }
    build_release(&b);
    struct build_rgb_range range = {0};
    static const double numbers[] = {0.0, 0.5, 1.0, 1.0000001, 1.9};
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++)
        build_rgb_look(&range, numbers[i]);
    assert_true(build_rgb_scale(&range) == 255.0); /* no number is 2 or more */
    build_rgb_look(&range, 2.0);
    assert_true(build_rgb_scale(&range) == 1.0); /* and three are above 1, one between 0 and 1 */
    build_rgb_look(&range, 0.25);
    build_rgb_look(&range, 0.75);
    assert_true(build_rgb_scale(&range) == 255.0); /* as many on either side of 1 */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(places_in_messages),   cmocka_unit_test(names_without_folders),
        cmocka_unit_test(single_precision),     cmocka_unit_test(vertices),
        cmocka_unit_test(needles_are_left_out), cmocka_unit_test(coordinates_and_colours_of_corners),
        cmocka_unit_test(limits_of_counts),     cmocka_unit_test(colours_of_files),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
