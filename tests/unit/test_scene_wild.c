/* SPDX-License-Identifier: MIT */
/* These tests read OBJ, MTL and PLY in the forms of other programs: names of other machines, rare orders and parts.
 * Parts that are left out are reported, with file and line. Colours of vertices are in test_vertex_colours.c, STL is in
 * test_scene_stl.c. */
#include <math.h>
#include <sys/stat.h>

#include "tests/unit/scene_files.h"

/* Two quads of 16 m2 each, with a red material and a green one. */
#define QUADS                                                                              \
    "v -2 -2 -1\nv 2 -2 -1\nv 2 2 -1\nv -2 2 -1\nv -2 -2 1\nv 2 -2 1\nv 2 2 1\nv -2 2 1\n" \
    "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl red\nf 1/1 2/2 3/3 4/4\nusemtl green\nf 5/1 6/2 7/3 8/4\n"
#define RED_GREEN "newmtl red\nKd 1 0 0\nnewmtl green\nKd 0 1 0\n"

static char made[16][160]; /* files and folders of the test, to be removed */
static int n_made;

static void put(const char *name, const char *text)
{
    write_text(name, text);
    strcpy(made[n_made++], path);
}

static void put_folder(const char *name)
{
    snprintf(made[n_made], sizeof made[0], "%s/%s", folder, name);
    assert_int_equal(mkdir(made[n_made++], 0700), 0);
}

static void remove_made(void)
{
    while (n_made > 0)
        remove(made[--n_made]);
}

/* Loads it with colours and textures. NULL: it was refused, with the reason in *err. */
static struct scene *load_coloured(const char *name, const char *text, struct sh_err *err)
{
    struct scene *s = NULL;
    put(name, text);
    const struct scene_mesh_spec spec = {.file = path, .scale = 1, .textures = 1};
    load_spec(&spec, 1e-3, &s, err);
    remove_made();
    return s;
}

static struct scene *take(const char *name, const char *text)
{
    struct sh_err err;
    struct scene *s = load_coloured(name, text, &err);
    if (s == NULL) fail_msg("%s", err.text);
    return s;
}

/* Returns the surface's colour, 0xrgb with a digit a channel: 15 is 1; -1: it has none. */
static int colour_of(const struct scene *s, uint32_t i)
{
    const float *c = s->surface[i].colour;
    if (!s->surface[i].has_colour) return -1;
    return (int)lround(15.0 * (double)c[0]) << 8 | (int)lround(15.0 * (double)c[1]) << 4 |
           (int)lround(15.0 * (double)c[2]);
}

static void check_red_green(const char *name, const char *text)
{
    struct scene *s = take(name, text);
    if (n_warnings != 0) fail_msg("%s", warnings);
    assert_int_equal(s->n_surfaces, 2);
    assert_int_equal(colour_of(s, 0), 0xf00);
    assert_int_equal(colour_of(s, 1), 0x0f0);
    scene_free(s);
}

/* The names of two materials differ only beyond the bytes of a name. Each has its own colour. */
static void long_names_keep_their_colours(void **state)
{
    (void)state;
    char name[301], text[4096];
    memset(name, 'n', 300);
    name[300] = '\0';
    snprintf(text, sizeof text, "newmtl %s1\nKd 1 0 0\nnewmtl %s2\nKd 0 1 0\n", name, name);
    put("long.mtl", text);
    snprintf(text, sizeof text,
             "mtllib long.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl %s1\nf 1 2 3\nusemtl %s2\nf 3 2 1\n", name, name);
    struct scene *s = take("long.obj", text);
    if (n_warnings != 1) fail_msg("%s", warnings);
    assert_non_null(strstr(warnings, "2 names cut to 255 bytes"));
    assert_int_equal(colour_of(s, 0), 0xf00);
    assert_int_equal(colour_of(s, 1), 0x0f0);
    scene_free(s);
}

static void libraries_are_found(void **state)
{
    (void)state;
    put("a.mtl", "\xef\xbb\xbf" RED_GREEN);
    check_red_green("bom.obj", "\xef\xbb\xbfmtllib a.mtl\n" QUADS);
    put("r.mtl", "newmtl red\nKd 1 0 0\n");
    put("g.mtl", "newmtl green\nKd 0 1 0\n");
    check_red_green("two.obj", "mtllib r.mtl\nmtllib g.mtl\n" QUADS);
    put("r.mtl", "newmtl red\nKd 1 0 0\n");
    put("g h.mtl", "newmtl green\nKd 0 1 0\n");
    check_red_green("line.obj", "mtllib r.mtl \"g h.mtl\"\n" QUADS);
    put("a.mtl", RED_GREEN);
    check_red_green("windows.obj", "mtllib C:\\work\\sub\\a.mtl\r\n" QUADS);
    put("a.mtl", RED_GREEN);
    check_red_green("posix.obj", "mtllib /nowhere/at/all/a.mtl\n" QUADS);
    put("my lib.mtl", RED_GREEN);
    check_red_green("quotes.obj", "mtllib \"my lib.mtl\"\n" QUADS);
    put("my lib.mtl", RED_GREEN);
    check_red_green("blanks.obj", "mtllib my lib.mtl  \r\n" QUADS);
    put("a.mtl", RED_GREEN);
    check_red_green("case.obj", "mtllib A.MTL\n" QUADS);
    put_folder("Sub");
    put("Sub/a.mtl", RED_GREEN);
    check_red_green("folder.obj", "mtllib .\\sub\\A.mtl\n" QUADS);
    put("a.mtl", "newmtl red\nKd 1 0 0 # red\nnewmtl green\nkd 0 1 0\n");
    check_red_green("comment.obj", "mtllib a.mtl # lib\nusemtl red # warm\n" QUADS);
}

/* Names of materials in quotes, on either side, and with a # that begins no comment. */
static void materials_are_found(void **state)
{
    (void)state;
    static const struct {
        const char *in_library[2], *in_file[2];
    } cases[] = {{{"\"red\"", "green"}, {"red", "green"}},
                 {{"red", "green"}, {"\"red\"", "\"green\""}},
                 {{"r", "\"g\""}, {"\"r\"", "\"g\""}},
                 {{"\"\"", "\"g\""}, {"\"\"", "g"}},
                 {{"Material #25", "Material"}, {"Material #25", "Material # made by hand"}},
                 {{"\"red", "red\""}, {"\"red", "red\""}}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char library[200], text[300];
        snprintf(library, sizeof library, "newmtl %s\nKd 1 0 0\nnewmtl %s\nKd 0 1 0\n", cases[i].in_library[0],
                 cases[i].in_library[1]);
        snprintf(text, sizeof text, "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl %s\nf 1 2 3\nusemtl %s\nf 3 2 1\n",
                 cases[i].in_file[0], cases[i].in_file[1]);
        put("a.mtl", library);
        check_red_green("names.obj", text);
    }
}

static void expect_warning(const char *name, const char *text, const char *expected)
{
    struct scene *s = take(name, text);
    if (n_warnings != 1 || strstr(warnings, expected) == NULL) fail_msg("'%s' doesn't say '%s'", warnings, expected);
    scene_free(s);
}

static void missing_things_are_named(void **state)
{
    (void)state;
    expect_warning("a.obj", "# x\nmtllib nowhere.mtl\n" QUADS,
                   "a.obj, line 2: the material library 'nowhere.mtl' is missing");
    const struct scene_mesh_spec plain = {.file = path, .scale = 1}; /* glass is known from the library, too */
    struct sh_err err;
    struct scene *s;
    put("a.obj", "mtllib nowhere.mtl\n" QUADS);
    load_spec(&plain, 1e-3, &s, &err);
    assert_non_null(strstr(warnings, "a.obj, line 1: the material library 'nowhere.mtl' is missing"));
    scene_free(s);
    remove_made();
    put("r.mtl", "newmtl red\nKd 1 0 0\n");
    expect_warning("a.obj", "mtllib r.mtl g.mtl\n" QUADS, "a.obj, line 1: the material library 'g.mtl' is missing");
    put("r.mtl", "newmtl red\nKd 1 0 0\n"); /* both libraries are there, and green is in none of them */
    put("b.mtl", "newmtl blue\nKd 0 0 1\n");
    expect_warning("a.obj", "mtllib r.mtl b.mtl\n" QUADS,
                   "a.obj: 1 of its surfaces have a material that no library defines; the first: 'green'");
    put("r.mtl", "newmtl red\nKd 1 0 0\nnewmtl Green\nKd 0 1 0\n");
    expect_warning("a.obj", "mtllib r.mtl\n" QUADS,
                   "a.obj: 1 of its surfaces have a material that no library defines; the first: 'green'");
    put("r.mtl", "newmtl red\nKd 1 0 0\n");
    expect_warning("a.obj", "mtllib r.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red# warm\nf 1 2 3\n", /* no blank */
                   "a.obj: 1 of its surfaces have a material that no library defines; the first: 'red# warm'");
    put("r.mtl", "newmtl red\nKd 255 0 0\nnewmtl green\nKd 0.2\nKd xyz 1 1\n");
    s = take("a.obj", "mtllib r.mtl\n" QUADS);
    assert_int_equal(colour_of(s, 0), -1);
    assert_int_equal(colour_of(s, 1), 0x333); /* one number is a grey */
    assert_int_equal(n_warnings, 1);
    assert_non_null(
        strstr(warnings, "r.mtl, line 2: Kd '255 0 0' is left out, with 1 more; allowed are numbers from 0"));
    scene_free(s);
    put("r.mtl", RED_GREEN "d 2\n");
    expect_warning("a.obj", "mtllib r.mtl\n" QUADS, "r.mtl, line 5: the opacity '2' is left out; allowed are numbers");
    put("r.mtl", RED_GREEN "map_Kd C:\\maps\\no.png\n");
    expect_warning("a.obj", "mtllib r.mtl\n" QUADS,
                   "r.mtl, line 5: the texture 'C:\\maps\\no.png' is missing; put it beside");
}

/* For any contents, a file of that name is the texture. */
static void check_texture(const char *library_line, const char *map, const char *file)
{
    char library[256], text[1024], expected[192];
    snprintf(library, sizeof library, RED_GREEN "map_Kd %s\n", map);
    put(strstr(library_line, "mat") != NULL ? "mat/m.mtl" : "m.mtl", library);
    put(file, "x");
    snprintf(expected, sizeof expected, "%s/%s", folder, file);
    snprintf(text, sizeof text, "mtllib %s\n" QUADS, library_line);
    struct scene *s = take("t.obj", text);
    if (n_warnings != 0) fail_msg("%s", warnings);
    assert_int_equal(s->n_textures, 1);
    assert_string_equal(s->texture[0].file, expected);
    assert_int_equal(s->surface[1].texture, 1);
    scene_free(s);
}

static void textures_are_found(void **state)
{
    (void)state;
    check_texture("m.mtl", "wall one.png", "wall one.png");
    check_texture("m.mtl", "\"wall one.png\"", "wall one.png");
    check_texture("m.mtl", "-s 2 2 -bm 0.5 -clamp on wall one.png", "wall one.png");
    check_texture("m.mtl", "D:\\maps\\WALL.png", "wall.PNG");
    put_folder("mat");
    check_texture("mat/m.mtl", "inmat.png", "mat/inmat.png");
    put_folder("mat");
    check_texture("mat\\m.mtl", "beside.png", "beside.png");
}

/* Vertices come later, and indices have nothing after the slash. */
static void faces_are_read(void **state)
{
    (void)state;
    struct scene *s = take("a.obj", "f 1 2 3\nv -2 -2 -1\nv 2 -2 -1\nf -2 -1 3\nv 2 2 -1\nv -2 2 -1\nf 1// 3// 4//\n");
    static const uint32_t triangle[3][3] = {{0, 2, 3}, {0, 1, 2}, {0, 1, 2}};
    assert_int_equal(s->n_triangles, 3);
    assert_memory_equal(s->triangle, triangle, sizeof triangle);
    assert_int_equal(n_warnings, 0);
    scene_free(s);
    s = take("a.obj",
             "g a\nf 1/2/ 2/1/ 3/\\\n1\ng b\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 3 2 1\nvt 1 0\nf 1/ 2/ 3/\n");
    assert_int_equal(s->n_triangles, 3);
    assert_string_equal(s->surface[s->label[0]].object, "b");
    assert_string_equal(s->surface[s->label[2]].object, "a");
    scene_free(s);
}

#define PLY_HEAD "ply\nformat ascii 1.0\n"
#define XYZ(n)   "element vertex " #n "\nproperty float x\nproperty float y\nproperty float z\n"
#define LIST     "property list uchar int vertex_indices\n"
#define SQUARE   "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"

static void ply_in_any_order(void **state)
{
    (void)state;
    struct scene *s = take("a.ply", PLY_HEAD "element face 1\n" LIST XYZ(4) "end_header\n4 0 1 2 3\n" SQUARE);
    assert_int_equal(s->n_triangles, 2);
    assert_true(fabs(total_area(s) - 1.0) < 1e-12);
    assert_int_equal(n_warnings, 0);
    scene_free(s);
    /* A strip of two triangles, and after -1 one of one. */
    s = take("a.ply", PLY_HEAD XYZ(4) "element tristrips 1\nproperty list int int vertex_indices\nend_header\n" SQUARE
                                      "8 0 1 3 2 -1 1 2 3\n");
    static const uint32_t triangle[3][3] = {{0, 1, 3}, {3, 1, 2}, {1, 2, 3}}; /* by the right-hand rule all face up */
    assert_int_equal(s->n_triangles, 3);
    for (int i = 0; i < 3; i++) { /* where each begins doesn't matter */
        uint32_t turned[3] = {s->triangle[i][2], s->triangle[i][0], s->triangle[i][1]};
        if (memcmp(s->triangle[i], triangle[i], sizeof turned) != 0) assert_memory_equal(turned, triangle[i], 12);
    }
    scene_free(s);
    s = take("a.ply", PLY_HEAD XYZ(4) "element face 3\n" LIST "end_header\n" SQUARE "0\n4 0 1 2 3\n0\n");
    assert_int_equal(s->n_triangles, 2);
    assert_int_equal(n_warnings, 1);
    assert_non_null(strstr(warnings, "a.ply: 2 faces without corners left out"));
    scene_free(s);
}

static void ply_vertices_that_nothing_uses(void **state)
{
    (void)state;
    struct sh_err err;
    for (int welded = 0; welded < 2; welded++) { /* where there are more vertices than faces */
        char text[512];
        snprintf(text, sizeof text,
                 PLY_HEAD XYZ(5) "element face %d\n" LIST "end_header\nnan nan nan\n5 5 5\n6 5 5\n6 6 5\n5 6 inf\n"
                                 "3 1 2 3\n3 1 3 2\n%s",
                 welded ? 2 : 5, welded ? "" : "3 1 2 3\n3 1 2 3\n3 1 2 3\n");
        struct scene *s = take("a.ply", text);
        assert_int_equal(s->n_vertices, welded ? 3 : 5);
        for (uint32_t i = 0; i < s->n_vertices; i++) /* nothing lies beyond what is used */
            assert_true(s->vertex_m[i][0] >= 5.0 && s->vertex_m[i][2] == 5.0);
        assert_true(fabs(triangle_area(s, 1) - 0.5) < 1e-12);
        assert_int_equal(n_warnings, 1);
        assert_non_null(strstr(warnings, "a.ply: 2 vertices that are not finite left out; no face uses them"));
        scene_free(s);
    }
    assert_null(load_coloured(
        "a.ply", PLY_HEAD XYZ(4) "element face 1\n" LIST "end_header\n0 0 0\n1 0 0\n0 1 0\n1 nan 0\n3 0 1 3\n", &err));
    assert_non_null(strstr(err.text, "a.ply, line 13: vertex 4 (1 nan 0) is not finite, and a face uses it"));
}

/* Texture coordinates come by face and by vertex, for one texture or several. */
static void ply_textures(void **state)
{
    (void)state;
    put("wall.png", "x");
    struct scene *s =
        take("a.ply",
             PLY_HEAD "comment TextureFile wall.png\n" XYZ(4) "element face 2\n" LIST
                                                              "property list uchar float texcoord\nend_header\n" SQUARE
                                                              "4 0 1 2 3 8 0 0 1 0 1 1 0 1\n3 0 1 2 0\n");
    assert_int_equal(s->n_textures, 1);
    assert_int_equal(s->surface[0].texture, 1);
    assert_string_equal(s->surface[0].material, "");
    assert_true(s->uv[0][1][0] == 1.0f && s->uv[0][1][1] == 0.0f && isnan(s->uv[2][0][0]));
    assert_int_equal(n_warnings, 0);
    scene_free(s);
    put("a.png", "x");
    s = take("a.ply", PLY_HEAD "comment TextureFile a.png\ncomment TextureFile D:\\b c.png\n" XYZ(
                          4) "property float texture_u\nproperty float texture_v\nelement face 3\n" LIST
                             "property int texnumber\nend_header\n0 0 0 0 0\n1 0 0 1 0\n1 1 0 1 1\n0 1 0 0 1\n"
                             "3 0 1 2 1\n3 0 2 3 0\n3 0 1 3 -1\n");
    assert_int_equal(s->n_surfaces, 3);
    assert_string_equal(s->surface[0].material, "D:\\b c.png");
    assert_int_equal(s->surface[0].texture, 2);
    assert_string_equal(s->surface[1].material, "a.png");
    assert_int_equal(s->surface[1].texture, 1);
    assert_int_equal(s->surface[2].texture, 0);
    assert_true(s->uv[1][2][0] == 0.0f && s->uv[1][2][1] == 1.0f);
    assert_int_equal(n_warnings, 1);
    assert_non_null(strstr(warnings, "a.ply, line 4: the texture 'D:\\b c.png' is missing; put it beside the mesh"));
    scene_free(s);
}

/* Textures and coordinates that a file lacks are reported: once each, and how many. */
static void ply_textures_that_do_not_fit(void **state)
{
    (void)state;
#define TEXTURES(n) PLY_HEAD "comment TextureFile a.png\n" n XYZ(4)
#define UV          "property float texture_u\nproperty float texture_v\n"
#define CORNERS     "end_header\n0 0 0 0 0\n1 0 0 1 0\n1 1 0 1 1\n0 1 0 0 1\n"
#define SECOND      "comment TextureFile b.png\n"
    static const struct {
        const char *text, *says, *also;
        int n_there; /* of a.png and b.png */
    } row[] = {
        {TEXTURES("") "element face 4\n" LIST "property list uchar float texcoord\nend_header\n" SQUARE
                      "4 0 1 2 3 8 0 0 1 0 1 1 0 1\n3 0 1 2 4 0 0 1 0\n3 0 2 3 0\n3 0 1 3 8 0 0 1 0 1 1 0 1\n",
         "a.ply: 2 faces have more or fewer texture coordinates than corners: these coordinates are left out\n", NULL,
         2},
        {TEXTURES(SECOND) UV "element face 1\n" LIST "property int texnumber\n" CORNERS "3 0 1 2 1\n",
         "a.ply, line 3: the texture 'a.png' is missing; put it beside the mesh\n",
         "a.ply: 2 of 2 textures are missing\n", 0},
        {TEXTURES(SECOND) UV "element face 1\n" LIST CORNERS "3 0 1 2\n",
         "a.ply: it names 2 textures, but its faces have no texnumber: the first texture is used\n", NULL, 2},
        {TEXTURES("") "element face 1\n" LIST "end_header\n" SQUARE "3 0 1 2\n",
         "a.ply: it names a texture, but has no texture coordinates: the texture is not used\n", NULL, 2},
    };
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        if (row[i].n_there > 0) put("a.png", "x");
        if (row[i].n_there > 1) put("b.png", "x");
        struct scene *s = take("a.ply", row[i].text);
        if (strstr(warnings, row[i].says) == NULL) fail_msg("%zu: %s", i, warnings);
        if (row[i].also != NULL) assert_non_null(strstr(warnings, row[i].also));
        assert_int_equal(n_warnings, row[i].also != NULL ? 2 : 1);
        assert_int_equal(s->surface[0].texture, i < 3 ? i == 1 ? 2 : 1 : 0);
        if (i == 0) /* triangles 0 and 1 are of the square */
            assert_true(!isnan(s->uv[0][0][0]) && !isnan(s->uv[1][2][1]) && isnan(s->uv[2][0][0]) &&
                        isnan(s->uv[4][1][0]));
        scene_free(s);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(libraries_are_found),
        cmocka_unit_test(materials_are_found),
        cmocka_unit_test(long_names_keep_their_colours),
        cmocka_unit_test(missing_things_are_named),
        cmocka_unit_test(textures_are_found),
        cmocka_unit_test(faces_are_read),
        cmocka_unit_test(ply_in_any_order),
        cmocka_unit_test(ply_vertices_that_nothing_uses),
        cmocka_unit_test(ply_textures),
        cmocka_unit_test(ply_textures_that_do_not_fit),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
