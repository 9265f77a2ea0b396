/* SPDX-License-Identifier: MIT */
/* The scene: axes, files together, checks, names, limits and refusals. */
#include <math.h>
#include <sys/stat.h>

#include "tests/unit/scene_files.h"

static void axes_scale_offset(void **state)
{
    (void)state;
    struct scene *s;
    struct sh_err err;
    struct scene_mesh_spec spec = {.file = write_text("a.obj", "v 1 2 3\nv 4 5 6\nv 7 8 10\nf 1 2 3\n"),
                                   .up = SCENE_UP_Y,
                                   .scale = 0.5,
                                   .offset_m = {100, 200, 300}};
    assert_int_equal(load_spec(&spec, 1, &s, &err), SH_OK);
    static const double turned[3][3] = {{100.5, 198.5, 301}, {102, 197, 302.5}, {103.5, 195, 304}};
    assert_memory_equal(s->vertex_m, turned, sizeof turned);
    scene_free(s);
    spec.up = SCENE_UP_Z;
    assert_int_equal(load_spec(&spec, 1, &s, &err), SH_OK);
    static const double upright[3][3] = {{100.5, 201, 301.5}, {102, 202.5, 303}, {103.5, 204, 305}};
    assert_memory_equal(s->vertex_m, upright, sizeof upright);
    scene_free(s);
    static const double wrong[] = {0, -1, NAN, INFINITY};
    for (size_t i = 0; i < 4; i++) {
        spec.scale = wrong[i];
        assert_int_equal(load_spec(&spec, 1, &s, &err), SH_EINPUT);
        assert_non_null(strstr(err.text, "a.obj: scale"));
    }
    unlink(path);
}

static void files_add_up(void **state)
{
    (void)state;
    char a[128], b[128];
    strcpy(a, write_text("a.obj", "v 9 9 9\nv 0 0 0\nv 1 0 0\nv 0 1 0\no x\nusemtl m\nf 2 3 4\nf 2 3 3\n"));
    strcpy(b, write_text("b.obj", "v 0 0 1\nv 1 0 1\nv 0 1 1\no y\nf 1 2 3\no x\nusemtl m\nf 1 2 -1\nf 1 1 2\n"));
    const struct scene_mesh_spec specs[2] = {{.file = a, .scale = 1}, {.file = b, .scale = 2}};
    struct scene *s;
    struct sh_err err;
    assert_int_equal(scene_load(specs, 2, 1, NULL, &s, &err), SH_OK);
    static const uint32_t triangle[3][3] = {{1, 2, 3}, {4, 5, 6}, {4, 5, 6}};
    static const uint16_t label[3] = {0, 1, 0};
    assert_int_equal(s->n_triangles, 3);
    assert_int_equal(s->n_meshes, 2);
    assert_int_equal(s->n_surfaces, 2);
    assert_memory_equal(s->triangle, triangle, sizeof triangle);
    assert_memory_equal(s->label, label, sizeof label);
    assert_int_equal(s->counts.zero_area, 2);
    assert_true(s->max_m[0] == 2 && s->max_m[2] == 2); /* the vertex at 9 is not used */
    scene_free(s);
    assert_int_equal(scene_load(specs, 0, 1, NULL, &s, &err), SH_EINPUT);
    unlink(a);
    assert_int_equal(scene_load(specs, 2, 1, NULL, &s, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "a.obj: No such file"));
    assert_int_equal(mkdir(a, 0700), 0);
    assert_int_equal(scene_load(specs, 2, 1, NULL, &s, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "a.obj: a directory, not a file"));
    rmdir(a);
    unlink(b);
}

static void zero_area_is_counted(void **state)
{
    (void)state;
    /* A point, a repeated corner, and three in line (even where 1/3 rounds) have no area. Needles do: 100 m long and 1
     * nm wide, and a wire of 0.1 mm over 1 km. */
    struct scene *s = load_text("zero.obj", "v 0 0 0\nv 1 1 1\nv 3 3 3\nv 0.1 0.3 0.7\nv 0.2 0.6 1.4\n"
                                            "v 100 0 0\nv 50 1e-9 0\nv 1000 0 0\nv 1000 1e-4 0\n"
                                            "f 1 1 1\nf 1 2 2\nf 1 2 3\nf 1 4 5\nf 1 6 7\nf 1 8 9\n");
    assert_int_equal(s->counts.zero_area, 4);
    assert_int_equal(s->n_triangles, 2);
    assert_int_equal(n_warnings, 1);
    assert_non_null(strstr(warnings, "zero.obj: 4 triangles without area left out"));
    scene_free(s);
}

/* Two names that differ only in their last byte, and whose cut would fall into a character of two bytes, stay two. */
static void long_names_are_cut(void **state)
{
    (void)state;
    char text[2048];
    sprintf(
        text,
        "v 0 0 0\nv 1 0 0\nv 0 1 0\no %0237d\xc3\xa4%020d\nusemtl %0255d\nf 1 2 3\no %0237d\xc3\xa4%020d\nf 1 2 3\n", 1,
        1, 2, 1, 2);
    struct scene *s = load_text("long.obj", text);
    assert_int_equal(s->n_surfaces, 2);
    for (int i = 0; i < 2; i++) {
        assert_int_equal(strlen(s->surface[i].object), 237 + 1 + 16);
        assert_int_equal(s->surface[i].object[237], '~');
        assert_int_equal(strlen(s->surface[i].material), 255);
    }
    assert_memory_equal(s->surface[0].object, s->surface[1].object, 238);
    assert_int_equal(s->counts.names_cut, 2);
    assert_non_null(strstr(warnings, "long.obj: 2 names cut to 255 bytes"));
    scene_free(s);
}

static void surfaces_have_a_limit(void **state)
{
    (void)state;
    char *text = malloc(1 << 21), *p = text;
    p += sprintf(p, "v 0 0 0\nv 1 0 0\nv 0 1 0\n");
    for (int i = 0; i < SCENE_MAX_SURFACES; i++)
        p += sprintf(p, "g %d\nf 1 2 3\n", i);
    struct scene *s = load_text("many.obj", text);
    assert_int_equal(s->n_surfaces, SCENE_MAX_SURFACES);
    assert_int_equal(s->label[SCENE_MAX_SURFACES - 1], SCENE_MAX_SURFACES - 1);
    assert_string_equal(s->surface[SCENE_MAX_SURFACES - 1].object, "65533");
    scene_free(s);
    p += sprintf(p, "g another\nf 1 2 3\n");
    refuse("many.obj", text, (size_t)(p - text), "up to 65534");
    free(text);
}

#define TRI  "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
#define HEAD "ply\nformat ascii 1.0\n"
#define XYZ  "property float x\nproperty float y\nproperty float z\n"
#define FACE "property list uchar int vertex_indices\n"
#define PLY  HEAD "element vertex 3\n" XYZ "element face 1\n" FACE "end_header\n"

static void malformed_files_are_refused(void **state)
{
    (void)state;
    static const struct {
        const char *name, *text, *expected;
    } bad[] = {
        {"a.obj", "", "no triangles"},
        {"a.obj", TRI, "no triangles"},
        {"a.obj", TRI "f 1 1 2\n", "1 without area"},
        {"a.obj", "v 0 0\n", "line 1: v must have 3 to 8 numbers, found the end of the line"},
        {"a.obj", "v 0 0 zero\n", "line 1: v must have 3 to 8 numbers, found 'zero'"},
        {"a.obj", "v 0 0 1.2.3\n", "found '1.2.3'"},
        {"a.obj", "v 0 0 1e\n", "found '1e'"},
        {"a.obj", "v 0,5 0 0\n", "found '0,5'"},
        {"a.obj", "v 0x10 0 0\n", "found '0x10'"},
        {"a.obj", TRI "\\\nv 0 nan 0\n", "line 5: vertex 4 (0 nan 0) is not finite"},
        {"a.obj", "v 0 0 -Infinity\n", "vertex 1 (0 0 -inf) is not finite"},
        {"a.obj", "v 0 0 1e999\n", "is not finite"},
        {"a.obj", "v 0 0 1.1e9\n", "vertex 1 is at 1.1e+09 m; allowed are coordinates up to 1e+09 m"},
        {"a.obj", TRI "f 1 2 4\n", "line 4: index 4 out of range; there are 3 vertices"},
        {"a.obj", TRI "f 1 2 0\n", "line 4: index 0 out of range"},
        {"a.obj", TRI "f 1 2 -4\n", "line 4: index -4 out of range"},
        {"a.obj", TRI "f 1 2 99999999999999999999\n", "found '99999999999999999999'"},
        {"a.obj", TRI "f 1 2 3/x\n", "found '3/x'"},
        {"a.obj", TRI "f 1 2 3.5\n", "found '3.5'"},
        {"a.obj", TRI "f\n", "found the end of the line"},
        {"a.ply", "", "not a PLY file"},
        {"a.ply", "plyx\n", "not a PLY file"},
        {"a.ply", HEAD, "ends in the header"},
        {"a.ply", "ply\nformat ascii 2.0\n", "line 2: the format version must be 1.0, not '2.0'"},
        {"a.ply", "ply\nformat text 1.0\n", "not 'text'"},
        {"a.ply", "ply\nelement vertex 0\n" XYZ "end_header\n", "no format"},
        {"a.ply", HEAD "element vertex -3\n", "line 3: an element must have a name and a count"},
        {"a.ply", HEAD "property float x\n", "property before any element"},
        {"a.ply", HEAD "element vertex 3\nproperty real x\n", "unknown property type 'real'"},
        {"a.ply", HEAD "element vertex 3\nproperty list float int x\n", "count can't be of type 'float'"},
        {"a.ply", HEAD "element vertex 3\nproperty float x\nproperty float x\n", "twice: 'x'"},
        {"a.ply", HEAD "element vertex 3\nproperty float x\nend_header\n", "lacks one of the properties x, y, z"},
        {"a.ply", HEAD "element face 1\n" FACE "end_header\n", "no element vertex"},
        {"a.ply", HEAD "element vertex 1\n" XYZ "end_header\n0 0 0\n", "points are not a mesh"},
        {"a.ply", HEAD "element vertex 1\n" XYZ "element face 1\nproperty int a\nend_header\n", "lacks the list"},
        {"a.ply", HEAD "element vertex 999999999999\n" XYZ "element face 1\n" FACE "end_header\n0 0 0\n",
         "999999999999 elements vertex need at least 6 bytes each, but 7 bytes are left in the file"},
        {"a.ply", PLY "0 0 0\n1 0 0\n0 nan 0\n3 0 1 2\n", "line 12: vertex 3 (0 nan 0) is not finite"},
        {"a.ply", PLY "0 0 0\n1 0 0\n0 1\n3 0 1 2\n", "line 12: vertex 3 of 3: a value is missing"},
        {"a.ply", PLY "0 0 0\n1 0 0\n0 1 0 0\n3 0 1 2\n", "line 12: vertex 3 of 3: there are more values"},
        {"a.ply", PLY "0 0 0\n1 0 0\n0 1 x\n3 0 1 2\n", "line 12: vertex 3 of 3: a value is not a number"},
        {"a.ply", PLY "0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", "line 13: face 1 of 1: index 3 out of range"},
        {"a.ply", PLY "0 0 0\n1 0 0\n0 1 0\n3 0 1 0.5\n", "index 0.5 out of range"},
        {"a.ply", PLY "0 0 0\n1 0 0\n0 1 0\n3 0 1\n", "face 1 of 1: a value is missing"},
        {"a.ply", PLY "0 0 0\n1 0 0\n0 1 0\n-3 0 1\n", "not a whole number from 0"},
        {"a.ply", PLY "0 0 0\n1 0 0\n0 1 0\n0      \n", "no triangles"},
        {"a.ply", PLY "0 0 0\n1 0 0\n0 1 0\n", "line 13: face 1 of 1: the file ends before it"},
        {"a.xyz", "", "unknown ending; allowed are .obj .ply"},
        {"obj", "", "unknown ending"},
        {".obj", "", "its name is only an ending; allowed is a name before it"},
        {".TIF", "", "its name is only an ending"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++)
        refuse(bad[i].name, bad[i].text, strlen(bad[i].text), bad[i].expected);
    refuse("utf16.obj", "\xff\xfev\0 \0", 6, "not a text");
}

static void a_huge_list_is_refused(void **state)
{
    (void)state;
    char data[512];
    size_t n = (size_t)sprintf(data, "ply\nformat binary_big_endian 1.0\nelement vertex 1\n" XYZ
                                     "element face 1\nproperty list uint uint vertex_indices\nend_header\n");
    memset(data + n, 0, 12);
    memset(data + n + 12, 0xff, 4);
    memset(data + n + 16, 0, 8);
    char expected[64];
    sprintf(expected, "face 1 of 1, byte %zu: the file ends in it", n + 24);
    refuse("huge.ply", data, n + 24, expected);
}

/* Bounds are those of all corners in use, including the first one of a triangle. An unused vertex does not count. */
static void bounds_are_of_all_corners(void **state)
{
    (void)state;
    static const double v[4][3] = {{-7, 3, 0}, {1, 8, -2}, {0, 5, 9}, {50, 50, 50}};
    for (uint32_t first = 0; first < 3; first++) {
        const uint32_t t[1][3] = {{first, (first + 1) % 3, (first + 2) % 3}};
        struct scene *s;
        struct sh_err err;
        assert_int_equal(scene_from_arrays(&(struct scene_arrays){v, 4, t, 1, NULL, NULL, 0}, &s, &err), SH_OK);
        assert_true(s->min_m[0] == -7 && s->min_m[1] == 3 && s->min_m[2] == -2);
        assert_true(s->max_m[0] == 1 && s->max_m[1] == 8 && s->max_m[2] == 9);
        scene_free(s);
    }
}

static void arrays_become_a_scene(void **state)
{
    (void)state;
    double v[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {5, 5, 5}};
    uint32_t t[3][3] = {{0, 1, 2}, {0, 0, 1}, {2, 1, 0}};
    uint16_t label[3] = {1, 0, 0};
    struct scene_surface surface[2] = {{.object = "a", .material = "b"}, {.object = "c", .material = "d"}};
    struct scene *s;
    struct sh_err err;
    assert_int_equal(
        scene_from_arrays(
            &(struct scene_arrays){(const double(*)[3])v, 4, (const uint32_t(*)[3])t, 3, label, surface, 2}, &s, &err),
        SH_OK);
    assert_int_equal(s->n_triangles, 2);
    assert_int_equal(s->counts.zero_area, 1);
    assert_int_equal(s->label[0], 1);
    assert_int_equal(s->label[1], 0);
    assert_string_equal(s->surface[1].material, "d");
    assert_true(s->max_m[0] == 1);
    scene_free(s);
    assert_int_equal(
        scene_from_arrays(&(struct scene_arrays){(const double(*)[3])v, 4, (const uint32_t(*)[3])t, 3, NULL, NULL, 0},
                          &s, &err),
        SH_OK);
    assert_string_equal(s->surface[0].object, "object");
    assert_string_equal(s->surface[0].material, "material");
    scene_free(s);
    label[2] = 2;
    assert_int_equal(
        scene_from_arrays(
            &(struct scene_arrays){(const double(*)[3])v, 4, (const uint32_t(*)[3])t, 3, label, surface, 2}, &s, &err),
        SH_EINPUT);
    assert_non_null(strstr(err.text, "triangle 2: label 2 out of range"));
    t[2][1] = 4;
    assert_int_equal(
        scene_from_arrays(&(struct scene_arrays){(const double(*)[3])v, 4, (const uint32_t(*)[3])t, 3, NULL, NULL, 0},
                          &s, &err),
        SH_EINPUT);
    assert_non_null(strstr(err.text, "triangle 2: index 4 out of range"));
    v[3][1] = NAN;
    assert_int_equal(
        scene_from_arrays(&(struct scene_arrays){(const double(*)[3])v, 4, (const uint32_t(*)[3])t, 3, NULL, NULL, 0},
                          &s, &err),
        SH_EINPUT);
    assert_non_null(strstr(err.text, "vertex 4 (5 nan 5) is not finite"));
    assert_null(s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(axes_scale_offset),         cmocka_unit_test(files_add_up),
        cmocka_unit_test(zero_area_is_counted),      cmocka_unit_test(long_names_are_cut),
        cmocka_unit_test(surfaces_have_a_limit),     cmocka_unit_test(malformed_files_are_refused),
        cmocka_unit_test(a_huge_list_is_refused),    cmocka_unit_test(arrays_become_a_scene),
        cmocka_unit_test(bounds_are_of_all_corners),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
