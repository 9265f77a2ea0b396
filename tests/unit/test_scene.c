/* The scene: our own readers (OBJ, PLY), polygons, checks, names, axes. Formats by Assimp:
 * test_scene_import.c. */
#include <locale.h>
#include <math.h>

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
    assert_int_equal(n_warnings, 1);
    assert_non_null(strstr(warnings, "3 points and lines left out"));
    scene_free(s);
}

/* Colours by material, from the library beside the mesh; the first that is given, of what is a colour. */
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

static void obj_without_names(void **state)
{
    (void)state;
    struct scene *s = load_text("site.v2.obj", "v 0 0 0\rv 1 0 0\rv 0 1 0\rwhat 1 2\rf 1 2 3\r");
    assert_int_equal(s->n_triangles, 1); /* and CR alone ends a line */
    assert_string_equal(s->surface[0].object, "site.v2");
    assert_string_equal(s->surface[0].material, "");
    assert_int_equal(n_warnings, 1);
    assert_non_null(strstr(warnings, "1 unknown statements passed over; the first is 'what' in line 4"));
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
    /* 1e22 is beyond the allowed 1e9 m, hence a scale that is a power of two: exact for all but the tiny */
    int rc = load_spec(&spec, 1, &s, &err);
    unlink(path);
    if (rc != SH_OK) fail_msg("%s", err.text);
    for (size_t i = 0; i < sizeof expected / sizeof expected[0]; i++)
        if (s->vertex_m[i][0] != expected[i] * 0x1p-100) fail_msg("number %zu is not exact", i);
    scene_free(s);
}

/* strtod is the other implementation. Sets a locale with a decimal comma where there is one. */
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
        out[n++] = -3;
    }
    static const uint16_t face[2][4] = {{0, 1, 2, 3}, {3, 2, 4}};
    for (int f = 0; f < 2; f++) {
        out[n++] = -1;
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
        assert_non_null(strstr(warnings, "element 'camera' (1 of it) passed over"));
        /* cut off anywhere, it is refused */
        for (size_t cut = 0; cut < n; cut += 13)
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
    assert_non_null(strstr(warnings, "single precision, so good to 0.35 m only")); /* 5.8e6 * 6e-8 */
    scene_free(s);
}

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
    unlink(b);
}

static void zero_area_is_counted(void **state)
{
    (void)state;
    /* a point, a repeated corner, three in line (also where 1/3 rounds), then needles that are real: 100 m
     * long and 1 nm wide, and a wire of 0.1 mm over 1 km */
    struct scene *s = load_text("zero.obj", "v 0 0 0\nv 1 1 1\nv 3 3 3\nv 0.1 0.3 0.7\nv 0.2 0.6 1.4\n"
                                            "v 100 0 0\nv 50 1e-9 0\nv 1000 0 0\nv 1000 1e-4 0\n"
                                            "f 1 1 1\nf 1 2 2\nf 1 2 3\nf 1 4 5\nf 1 6 7\nf 1 8 9\n");
    assert_int_equal(s->counts.zero_area, 4);
    assert_int_equal(s->n_triangles, 2);
    assert_int_equal(n_warnings, 1);
    assert_non_null(strstr(warnings, "zero.obj: 4 triangles without area left out"));
    scene_free(s);
}

static void long_names_are_cut(void **state)
{
    (void)state;
    char text[512];
    /* 62 bytes, then a character of two bytes that would be cut in half at 63 */
    sprintf(text, "v 0 0 0\nv 1 0 0\nv 0 1 0\no %062d\xc3\xa4z\nusemtl %063d\nf 1 2 3\n", 1, 2);
    struct scene *s = load_text("long.obj", text);
    assert_int_equal(strlen(s->surface[0].object), 62);
    assert_int_equal(strlen(s->surface[0].material), 63);
    assert_int_equal(s->counts.names_cut, 1);
    assert_non_null(strstr(warnings, "long.obj: 1 names cut to 63 bytes"));
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
        {"a.obj", "v 0 0\n", "line 1: v takes 3 to 8 numbers, found the end of the line"},
        {"a.obj", "v 0 0 zero\n", "line 1: v takes 3 to 8 numbers, found 'zero'"},
        {"a.obj", "v 0 0 1.2.3\n", "found '1.2.3'"},
        {"a.obj", "v 0 0 1e\n", "found '1e'"},
        {"a.obj", "v 0,5 0 0\n", "found '0,5'"},
        {"a.obj", "v 0x10 0 0\n", "found '0x10'"},
        {"a.obj", TRI "\\\nv 0 nan 0\n", "line 5: vertex 4 (0 nan 0) is not finite"},
        {"a.obj", "v 0 0 -Infinity\n", "vertex 1 (0 0 -inf) is not finite"},
        {"a.obj", "v 0 0 1e999\n", "is not finite"},
        {"a.obj", "v 0 0 1.1e9\n", "vertex 1 is at 1.1e+09 m; allowed are coordinates up to 1e+09 m"},
        {"a.obj", TRI "f 1 2 4\n", "line 4: index 4 out of range; 3 vertices so far"},
        {"a.obj", TRI "f 1 2 0\n", "line 4: index 0 out of range"},
        {"a.obj", TRI "f 1 2 -4\n", "line 4: index -4 out of range"},
        {"a.obj", TRI "f 1 2 99999999999999999999\n", "found '99999999999999999999'"},
        {"a.obj", TRI "f 1 2 3/x\n", "found '3/x'"},
        {"a.obj", TRI "f 1 2 3.5\n", "found '3.5'"},
        {"a.obj", TRI "f\n", "found the end of the line"},
        {"a.ply", "", "not a PLY file"},
        {"a.ply", "plyx\n", "not a PLY file"},
        {"a.ply", HEAD, "ends within the header"},
        {"a.ply", "ply\nformat ascii 2.0\n", "line 2: format version has to be 1.0, not '2.0'"},
        {"a.ply", "ply\nformat text 1.0\n", "not 'text'"},
        {"a.ply", "ply\nelement vertex 0\n" XYZ "end_header\n", "no format"},
        {"a.ply", HEAD "element vertex -3\n", "line 3: element takes a name and a count"},
        {"a.ply", HEAD "property float x\n", "property before any element"},
        {"a.ply", HEAD "element vertex 3\nproperty real x\n", "unknown property type 'real'"},
        {"a.ply", HEAD "element vertex 3\nproperty list float int x\n", "count can't be of type 'float'"},
        {"a.ply", HEAD "element vertex 3\nproperty float x\nproperty float x\n", "twice: 'x'"},
        {"a.ply", HEAD "element vertex 3\nproperty float x\nend_header\n", "lacks one of the properties x, y, z"},
        {"a.ply", HEAD "element face 1\n" FACE "end_header\n", "face comes before element vertex"},
        {"a.ply", HEAD "element vertex 1\n" XYZ "end_header\n0 0 0\n", "points are not a mesh"},
        {"a.ply", HEAD "element vertex 1\n" XYZ "element face 1\nproperty int a\nend_header\n", "lacks the list"},
        {"a.ply", HEAD "element vertex 999999999999\n" XYZ "element face 1\n" FACE "end_header\n0 0 0\n",
         "999999999999 of element vertex need 6 bytes or more each; 7 are left"},
        {"a.ply", PLY "0 0 0\n1 0 0\n0 nan 0\n3 0 1 2\n", "line 12: vertex 3 (0 nan 0) is not finite"},
        {"a.ply", PLY "0 0 0\n1 0 0\n0 1\n3 0 1 2\n", "line 12: vertex 3 of 3: a value is missing"},
        {"a.ply", PLY "0 0 0\n1 0 0\n0 1 0 0\n3 0 1 2\n", "line 12: vertex 3 of 3: there are more values"},
        {"a.ply", PLY "0 0 0\n1 0 0\n0 1 x\n3 0 1 2\n", "line 12: vertex 3 of 3: a value is not a number"},
        {"a.ply", PLY "0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", "line 13: face 1 of 1: index 3 out of range"},
        {"a.ply", PLY "0 0 0\n1 0 0\n0 1 0\n3 0 1 0.5\n", "index 0.5 out of range"},
        {"a.ply", PLY "0 0 0\n1 0 0\n0 1 0\n3 0 1\n", "face 1 of 1: a value is missing"},
        {"a.ply", PLY "0 0 0\n1 0 0\n0 1 0\n-3 0 1\n", "not a whole number from 0"},
        {"a.ply", PLY "0 0 0\n1 0 0\n0 1 0\n0      \n", "it has no corners"},
        {"a.ply", PLY "0 0 0\n1 0 0\n0 1 0\n", "line 13: face 1 of 1: the file ends before it"},
        {"a.xyz", "", "unknown ending; allowed are .obj .ply"},
        {"obj", "", "unknown ending"},
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
    sprintf(expected, "face 1 of 1, byte %zu: the file ends within it", n + 24);
    refuse("huge.ply", data, n + 24, expected);
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
        scene_from_arrays((const double(*)[3])v, 4, (const uint32_t(*)[3])t, 3, label, surface, 2, &s, &err), SH_OK);
    assert_int_equal(s->n_triangles, 2);
    assert_int_equal(s->counts.zero_area, 1);
    assert_int_equal(s->label[0], 1);
    assert_int_equal(s->label[1], 0);
    assert_string_equal(s->surface[1].material, "d");
    assert_true(s->max_m[0] == 1);
    scene_free(s);
    assert_int_equal(scene_from_arrays((const double(*)[3])v, 4, (const uint32_t(*)[3])t, 3, NULL, NULL, 0, &s, &err),
                     SH_OK);
    assert_string_equal(s->surface[0].object, "object");
    assert_string_equal(s->surface[0].material, "material");
    scene_free(s);
    label[2] = 2;
    assert_int_equal(
        scene_from_arrays((const double(*)[3])v, 4, (const uint32_t(*)[3])t, 3, label, surface, 2, &s, &err),
        SH_EINPUT);
    assert_non_null(strstr(err.text, "triangle 2: label 2 out of range"));
    t[2][1] = 4;
    assert_int_equal(scene_from_arrays((const double(*)[3])v, 4, (const uint32_t(*)[3])t, 3, NULL, NULL, 0, &s, &err),
                     SH_EINPUT);
    assert_non_null(strstr(err.text, "triangle 2: index 4 out of range"));
    v[3][1] = NAN;
    assert_int_equal(scene_from_arrays((const double(*)[3])v, 4, (const uint32_t(*)[3])t, 3, NULL, NULL, 0, &s, &err),
                     SH_EINPUT);
    assert_non_null(strstr(err.text, "vertex 4 (5 nan 5) is not finite"));
    assert_null(s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(obj_is_read),
        cmocka_unit_test(obj_takes_colours_from_its_library),
        cmocka_unit_test(obj_without_names),
        cmocka_unit_test(obj_numbers_are_exact),
        cmocka_unit_test(obj_random_numbers_are_exact),
        cmocka_unit_test(obj_is_read_exactly),
        cmocka_unit_test(ply_is_read_exactly),
        cmocka_unit_test(ply_in_float_warns),
        cmocka_unit_test(axes_scale_offset),
        cmocka_unit_test(files_add_up),
        cmocka_unit_test(zero_area_is_counted),
        cmocka_unit_test(long_names_are_cut),
        cmocka_unit_test(surfaces_have_a_limit),
        cmocka_unit_test(malformed_files_are_refused),
        cmocka_unit_test(a_huge_list_is_refused),
        cmocka_unit_test(arrays_become_a_scene),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
