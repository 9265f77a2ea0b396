/* SPDX-License-Identifier: MIT */
/* The scene: our own readers of OBJ, PLY and STL, and their numbers. Formats by Assimp: test_scene_import.c. */
#include <locale.h>
#include <math.h>

#include "tests/common/thorough.h"
#include "tests/unit/scene_files.h"

static const char *obj_text = "# a comment \\\n"
                              "mtllib C:\\dir\\\r\n"
                              "v 0 0 0 1.0\r\n"
                              "v 1 0 0 0.5 0.5 0.5\n"
                              "v 1 \\\n"
                              "  1 \\\r\n"
                              "  0\n"
                              "v 0 1 0 # the last\n"
                              "vt 0 0\nvn 0 0 1\ns off\n"
                              "o hall\nusemtl brick wall \n"
                              "f 1/1/1 2//1 3/1\n"
                              "g\troof\n"
                              "f -4 -2 -1\n"
                              "usemtl tin\n"
                              "f 1 2 3 4\n"
                              "p 1 2\nl 1 2 3\n"
                              "o hall\nusemtl brick wall\n"
                              "f 4 3 2 1";

static void obj_is_read(void **state)
{
    (void)state;
    struct scene *s = load_text("a.OBJ", obj_text);
    static const uint32_t triangle[6][3] = {{0, 1, 2}, {0, 2, 3}, {0, 1, 2}, {0, 2, 3}, {3, 2, 1}, {3, 1, 0}};
    static const uint16_t label[6] = {0, 1, 2, 2, 0, 0};
    assert_int_equal(s->n_vertices, 4);
    assert_int_equal(s->n_triangles, 6);
    assert_memory_equal(s->triangle, triangle, sizeof triangle);
    assert_memory_equal(s->label, label, sizeof label);
    assert_int_equal(s->n_surfaces, 3);
    assert_string_equal(s->surface[0].object, "hall");
    assert_string_equal(s->surface[0].material, "brick wall");
    assert_string_equal(s->surface[1].object, "roof");
    assert_string_equal(s->surface[1].material, "brick wall");
    assert_string_equal(s->surface[2].material, "tin");
    assert_int_equal(s->counts.not_triangles, 3);
    assert_int_equal(n_warnings, 2);
    assert_non_null(strstr(warnings, "line 2: the material library 'C:\\dir\\' is missing"));
    assert_non_null(strstr(warnings, "3 points and lines left out"));
    scene_free(s);
}

/* Colours come by material, from the library beside the mesh. The first given one counts, if it is a colour. */
static void obj_takes_colours_from_its_library(void **state)
{
    (void)state;
    static const char library[] = "# made by hand\nnewmtl brick wall\r\nKa 1 1 1\nKd 0.5 0.25 1\nKd 0 0 0\n"
                                  "newmtl tin\nKd spectral tin.rfl\nnewmtl unused\nKd 1 1 1\nnewmtl gold\nKd 1 2 0\n";
    static const char mesh[] = "mtllib my colours.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\n"
                               "usemtl brick wall\nf 1 2 3\no b\nf 1 2 3\nusemtl tin\nf 1 2 3\nusemtl gold\nf 1 2 3\n";
    write_file("my colours.mtl", library, sizeof library - 1);
    struct scene *s = load_text("coloured.obj", mesh);
    assert_int_equal(s->n_surfaces, 4);
    for (int i = 0; i < 4; i++)
        assert_int_equal(s->surface[i].has_colour, i < 2);
    for (int i = 0; i < 2; i++)
        assert_true(s->surface[i].colour[0] == 0.5f && s->surface[i].colour[1] == 0.25f &&
                    s->surface[i].colour[2] == 1.0f);
    scene_free(s);
    unlink(strcat(strcpy(path, folder), "/my colours.mtl"));
}

/* The first of two definitions of a material counts, in one library or in two. Within it, d counts before Tr. */
static void obj_takes_the_first_opacity(void **state)
{
    (void)state;
    static const char first[] = "newmtl glass\nTr 0.125\nd 0.25\nnewmtl air\nd 1\nnewmtl glass\nd 0.875\n",
                      second[] = "newmtl glass\nd 0.75\nnewmtl air\nTr 0.5\nnewmtl late\nTr 0.5\nd -halo 0.5\n";
    static const char mesh[] = "mtllib a.mtl b.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\n"
                               "usemtl glass\nf 1 2 3\nusemtl air\nf 1 2 3\nusemtl late\nf 1 2 3\n";
    static const float clear[3] = {0.75f, 0.0f, 0.5f};
    write_file("a.mtl", first, sizeof first - 1);
    write_file("b.mtl", second, sizeof second - 1);
    struct scene *s = load_text("clear.obj", mesh);
    assert_int_equal(s->n_surfaces, 3);
    for (int i = 0; i < 3; i++)
        if (s->surface[i].clear != clear[i]) fail_msg("%s: %g", s->surface[i].material, (double)s->surface[i].clear);
    assert_non_null(strstr(warnings, "b.mtl, line 7: the opacity '-halo 0.5' is left out"));
    scene_free(s);
    unlink(strcat(strcpy(path, folder), "/a.mtl"));
    unlink(strcat(strcpy(path, folder), "/b.mtl"));
}

static void obj_without_names(void **state)
{
    (void)state;
    struct scene *s = load_text("site.v2.obj", "v 0 0 0\rv 1 0 0\rv 0 1 0\rwhat 1 2\rf 1 2 3\r");
    assert_int_equal(s->n_triangles, 1); /* and CR alone ends a line */
    assert_string_equal(s->surface[0].object, "site.v2");
    assert_string_equal(s->surface[0].material, "");
    assert_int_equal(n_warnings, 1);
    assert_non_null(strstr(warnings, "1 unknown statements ignored; the first is 'what' in line 4"));
    scene_free(s);
}

/* The compiler's conversion of the same digits is the independent source. */
/* clang-format off */
#define NUMBERS                                                                                             \
    N(500000.12345678901)                                                                                   \
    N(5800000.00000000093)                                                                                  \
    N(-5812345.678901234) N(0.1) N(.5) N(5.) N(1e22) N(1e-22) N(123456789012345e-22) N(9007199254740993e-9) \
        N(4.35e-6) N(+7.25) N(-0.0) N(1.7976931348623157e-300) N(00000000000000000000000.125)               \
            N(0.10000000000000000555111512312578270) N(123456.7890123456789E+2) N(4.9e-324)                 \
                N(9007199254740993.0)
/* clang-format on */

static void obj_numbers_are_exact(void **state)
{
    (void)state;
#define N(x) "v " #x " 0 0\n"
    static const char text[] = NUMBERS "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\n";
#undef N
#define N(x) x,
    static const double expected[] = {NUMBERS};
#undef N
    struct scene *s;
    struct sh_err err;
    char with_limit[sizeof text];
    strcpy(with_limit, text);
    const struct scene_mesh_spec spec = {.file = write_text("n.obj", with_limit), .scale = 0x1p-100};
    /* 1e22 is beyond the allowed 1e9 m, hence a scale that is a power of two: exact for all but the tiny. */
    int rc = load_spec(&spec, 1, &s, &err);
    unlink(path);
    if (rc != SH_OK) fail_msg("%s", err.text);
    for (size_t i = 0; i < sizeof expected / sizeof expected[0]; i++)
        if (s->vertex_m[i][0] != expected[i] * 0x1p-100) fail_msg("number %zu is not exact", i);
    scene_free(s);
}

/* strtod is the other implementation. The test sets a locale with a decimal comma where there is one. */
static void obj_random_numbers_are_exact(void **state)
{
    (void)state;
    enum { COUNT = 3000 };
    static double expected[COUNT];
    char *text = malloc(COUNT * 64 + 64), *p = text;
    srand(7);
    for (int i = 0; i < COUNT; i++) {
        static const char *const formats[] = {"v %.17g 0 0\n", "v %.15g 0 0\n", "v %.9f 0 0\n", "v %.3e 0 0\n"};
        double v = (rand() - RAND_MAX / 2.0) * pow(10, rand() % 9 - 10) * (1 + rand() / (RAND_MAX + 1.0));
        int n = sprintf(p, formats[i % 4], v);
        expected[i] = strtod(p + 2, NULL);
        p += n;
    }
    strcpy(p, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\n");
    setlocale(LC_ALL, "de_DE.UTF-8");
    struct scene *s = load_text("random.obj", text);
    setlocale(LC_ALL, "C");
    for (int i = 0; i < COUNT; i++)
        if (s->vertex_m[i][0] != expected[i]) fail_msg("number %d is not exact", i);
    scene_free(s);
    free(text);
}

/* More decimals than any writer makes, and a power that takes them back: this is 1. */
static void obj_long_numbers_are_exact(void **state)
{
    (void)state;
    char text[1200];
    sprintf(text, "v 0.%01000d1e1001 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n", 0);
    struct scene *s = load_text("long.obj", text);
    assert_true(s->vertex_m[0][0] == 1.0);
    scene_free(s);
}

/* Writes a PLY with every scalar type: a quad and a triangle, double coordinates at UTM. */
static const double utm[5][3] = {{500000.1, 5800000.2, 30.3},
                                 {500001.00000000012, 5800000.2, 30.3},
                                 {500001.1, 5800001.2000000011, 30.3},
                                 {500000.1, 5800001.2, 30.300000000000004},
                                 {500000.7, 5800002.9, 31}};

static size_t put(char *out, const void *value, size_t size, bool big)
{
    for (size_t i = 0; i < size; i++)
        out[i] = ((const char *)value)[big ? size - 1 - i : i];
    return size;
}

static size_t make_binary_ply(char *out, bool big)
{
    size_t n = (size_t)sprintf(out,
                               "ply\nformat binary_%s_endian 1.0\ncomment by a test\nobj_info none\n"
                               "element camera 1\nproperty int id\nproperty list uchar float values\n"
                               "element vertex 5\nproperty uchar red\nproperty double x\nproperty float64 y\n"
                               "property list ushort short history\nproperty double z\nproperty int8 q\n"
                               "element face 2\nproperty char flag\nproperty list uint8 ushort vertex_index\n"
                               "property float quality\nend_header\n",
                               big ? "big" : "little");
    int32_t id = 7;
    n += put(out + n, &id, 4, big);
    out[n++] = 2;
    float value = 1.5f;
    n += put(out + n, &value, 4, big);
    n += put(out + n, &value, 4, big);
    for (int i = 0; i < 5; i++) {
        out[n++] = (char)200;
        n += put(out + n, &utm[i][0], 8, big);
        n += put(out + n, &utm[i][1], 8, big);
        uint16_t count = (uint16_t)i;
        n += put(out + n, &count, 2, big);
        for (int16_t k = 0; k < i; k++)
            n += put(out + n, &k, 2, big);
        n += put(out + n, &utm[i][2], 8, big);
        out[n++] = (char)-3;
    }
    static const uint16_t face[2][4] = {{0, 1, 2, 3}, {3, 2, 4}};
    for (int f = 0; f < 2; f++) {
        out[n++] = (char)-1;
        out[n++] = (char)(4 - f);
        for (int k = 0; k < 4 - f; k++)
            n += put(out + n, &face[f][k], 2, big);
        n += put(out + n, &value, 4, big);
    }
    return n;
}

static void check_utm_scene(struct scene *s)
{
    static const uint32_t triangle[3][3] = {{0, 1, 2}, {0, 2, 3}, {3, 2, 4}};
    assert_int_equal(s->n_vertices, 5);
    assert_int_equal(s->n_triangles, 3);
    assert_memory_equal(s->vertex_m, utm, sizeof utm); /* every bit of every double */
    assert_memory_equal(s->triangle, triangle, sizeof triangle);
    assert_int_equal(s->n_surfaces, 1);
    assert_string_equal(s->surface[0].object, "utm");
    assert_string_equal(s->surface[0].material, "");
    assert_true(s->min_m[1] == 5800000.2 && s->max_m[2] == 31);
    scene_free(s);
}

static void ply_is_read_exactly(void **state)
{
    (void)state;
    char data[2048];
    for (int big = 0; big < 2; big++) {
        size_t n = make_binary_ply(data, big);
        check_utm_scene(load(write_file("utm.ply", data, n)));
        unlink(path);
        assert_non_null(strstr(warnings, "element 'camera' (1 of them) is not used"));
        /* Cut anywhere, it is refused. */
        for (size_t cut = 0; cut < n; cut += SANITIZED ? 91 : 13)
            refuse("cut.ply", data, cut, "");
    }
    check_utm_scene(load_text("utm.ply",
                              "ply\r\nformat ascii 1.0\r\nelement vertex 5 \r\nproperty double x\r\n"
                              "property double y\r\nproperty double z\r\nproperty uchar red\r\n"
                              "element face 2\r\nproperty list uchar int vertex_indices\r\nend_header\r\n"
                              "500000.1 5800000.2 30.3 1\r\n500001.00000000012 5800000.2 30.3 2\r\n"
                              "500001.1 5800001.2000000011 30.3 3\r\n500000.1 5800001.2 30.300000000000004 4\r\n"
                              "\r\n500000.7 5800002.9 31 5\r\n4 0 1 2 3\r\n3 3 2 4"));
}

static void obj_is_read_exactly(void **state)
{
    (void)state;
    char text[1024];
    size_t n = 0;
    for (int i = 0; i < 5; i++)
        n += (size_t)sprintf(text + n, "v %.17g %.17g %.17g\n", utm[i][0], utm[i][1], utm[i][2]);
    strcpy(text + n, "f 1 2 3 4\nf 4 3 5\n");
    check_utm_scene(load_text("utm.obj", text));
}

static void ply_in_float_warns(void **state)
{
    (void)state;
    char data[512];
    size_t n = (size_t)sprintf(data, "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\n"
                                     "property float y\nproperty float z\nelement face 1\n"
                                     "property list uchar uchar vertex_indices\nend_header\n");
    static const float v[3][3] = {{500000, 5800000, 0}, {500001, 5800000, 0}, {500000, 5800001, 0}};
    memcpy(data + n, v, sizeof v);
    memcpy(data + n + sizeof v, "\3\0\1\2", 4);
    struct scene *s = load(write_file("float.ply", data, n + sizeof v + 4));
    unlink(path);
    assert_non_null(strstr(warnings, "single precision, with errors up to 0.35 m")); /* 5.8e6 * 6e-8 */
    scene_free(s);
}

/* Words of a text STL may stand in any lines, but for the numbers of a vertex. Writers put anything for a normal. */
static void stl_words_stand_in_any_lines(void **state)
{
    (void)state;
    struct scene *s =
        load_text("words.stl",
                  "solid roof of tin\nfacet normal 0 0 1 outer loop vertex 0 0 0\nvertex 1 0 0 vertex 0 1 0\nendloop "
                  "endfacet\nfacet normal nan nan nan\nouter\nloop\nvertex 0 0 1\nvertex 1 0 1\nvertex 0 1 1\n"
                  "endloop\nendfacet facet\nouter loop vertex 0 0 2 vertex 1 0 2 vertex 0 1 2 endloop endfacet "
                  "endsolid roof of tin\n");
    assert_int_equal(s->n_triangles, 3);
    assert_int_equal(n_warnings, 0);
    assert_true(total_area(s) == 1.5);
    assert_string_equal(s->surface[0].object, "roof of tin");
    scene_free(s);
}

/* A binary STL of 3.5 MB: a reader gives back memory of triangles that it has read, from 2 MiB on. */
static void stl_may_be_large(void **state)
{
    (void)state;
    enum { N = 70000, SIZE = 84 + 50 * N };
    char *data = calloc(1, SIZE + 7);
    const uint32_t n = N;
    memcpy(data + 80, &n, sizeof n);
    for (int i = 0; i < N; i++) { /* multiples of 1/512, which floats hold */
        const float x = (float)(i % 256) / 256, y = (float)(i / 256) / 512;
        const float corner[3][3] = {{x, y, 0}, {x + 1.0f / 256, y, 0}, {x, y + 1.0f / 512, 0}};
        memcpy(data + 84 + 50 * i + 12, corner, sizeof corner);
    }
    for (int more = 0; more < 8; more += 7) {
        struct scene *s = load(write_file("large.stl", data, (size_t)(SIZE + more)));
        unlink(path);
        assert_int_equal(s->n_triangles, N);
        assert_int_equal(n_warnings, more != 0);
        if (more != 0) assert_non_null(strstr(warnings, "7 bytes after the last of its 70000 triangles ignored"));
        scene_free(s);
    }
    free(data);
}

/* A facet of two points or fewer is left out and counted. A facet of four points makes two triangles. Errors name the
 * line of the vertex. */
static void test_stl_facets(void **state)
{
    (void)state;
    struct scene *s = load_text("a.stl", "solid a\nfacet normal 0 0 1\nouter loop\nendloop\nendfacet\n"
                                         "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nendloop\n"
                                         "endfacet\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
                                         "vertex 1 1 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n");
    assert_true(s->n_triangles == 2 && s->counts.not_triangles == 2 && s->counts.zero_area == 0);
    assert_true(fabs(total_area(s) - 1.0) < 1e-12);
    scene_free(s);
    static const char far[] = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n\nvertex 1 2e9 0\n"
                              "endloop\nendfacet\nendsolid a\n";
    refuse("a.stl", far, sizeof far - 1, "a.stl, line 7: ");
}

/* What is said of a whole file names no line of it. */
static void whole_files_have_no_line(void **state)
{
    (void)state;
    static const char *const file[][2] = {
        {"a.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\np 1\nf 1 2 3\n"},
        {"a.stl",
         "solid a\nfacet normal 0 0 1\nouter loop\nendloop\nendfacet\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n"
         "vertex 1 0 0\nvertex 2 0 0\nendloop\nendfacet\nendsolid a\n"},
        {"a.ply",
         "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
         "element face 2\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n2 0 0\n2 0 1\n3 0 1 2\n"}};
    for (int i = 0; i < 3; i++) {
        char want[160];
        snprintf(want, sizeof want, "%s: it has no triangles (1 without area, 1 points and lines)", file[i][0]);
        refuse(file[i][0], file[i][1], strlen(file[i][1]), want);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(obj_is_read),
        cmocka_unit_test(obj_takes_colours_from_its_library),
        cmocka_unit_test(obj_takes_the_first_opacity),
        cmocka_unit_test(obj_without_names),
        cmocka_unit_test(obj_numbers_are_exact),
        cmocka_unit_test(obj_random_numbers_are_exact),
        cmocka_unit_test(obj_long_numbers_are_exact),
        cmocka_unit_test(obj_is_read_exactly),
        cmocka_unit_test(ply_is_read_exactly),
        cmocka_unit_test(ply_in_float_warns),
        cmocka_unit_test(stl_words_stand_in_any_lines),
        cmocka_unit_test(test_stl_facets),
        cmocka_unit_test(stl_may_be_large),
        cmocka_unit_test(whole_files_have_no_line),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
