/* SPDX-License-Identifier: MIT */
/* Meshes from .ply as text: strips, vertices that are not finite, faces of few corners. */
#include <math.h>

#include "core/studio/picture.h"
#include "tests/unit/scene_files.h"

#define VERTICES(n) \
    "ply\nformat ascii 1.0\nelement vertex " n "\nproperty double x\nproperty double y\nproperty double z\n"
#define FACES(n) "element face " n "\nproperty list uchar int vertex_indices\nend_header\n"

/* Each vertex from the third on makes a triangle; every other one is the other way round, so that all face one way. -1
 * begins another strip. */
static void strips_are_triangles(void **state)
{
    (void)state;
    static const uint32_t want[4][3] = {{0, 1, 2}, {2, 1, 3}, {2, 3, 4}, {1, 3, 4}};
    struct scene *s = load_text("a.ply", VERTICES("5") "element tristrips 1\nproperty list int int vertex_indices\n"
                                                       "end_header\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n"
                                                       "9 0 1 2 3 4 -1 1 3 4\n");
    assert_true(s->n_triangles == 4 && s->n_vertices == 5 && s->n_meshes == 1);
    for (uint32_t i = 0; i < 4; i++)
        assert_memory_equal(s->triangle[i], want[i], sizeof want[i]);
    scene_free(s);
    s = load_text("a.ply", VERTICES("3") "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
                                         "0 0 0\n1 0 0\n0 1 0\n6 -1 0 1 2 -1 -1\n"); /* empty ones around it */
    assert_int_equal(s->n_triangles, 1);
    assert_memory_equal(s->triangle[0], want[0], sizeof want[0]);
    scene_free(s);
}

/* Vertices that are not finite, in any axis, don't matter where no face uses them: neither where vertices are shared
 * nor where each triangle has its own. The others keep their numbers. */
static void vertices_that_are_not_finite(void **state)
{
    (void)state;
    static const char vertices[] = "5 5 5\nnan 0 0\n6 5 5\n0 inf 0\n5 6 5\n0 0 -inf\n";
    char text[1024];
    for (int shared = 0; shared < 2; shared++) {
        snprintf(text, sizeof text, VERTICES("6") "%s%s%s", shared ? FACES("6") : FACES("1"), vertices,
                 shared ? "3 0 2 4\n3 2 4 0\n3 4 0 2\n3 0 4 2\n3 4 2 0\n3 2 0 4\n" : "3 0 2 4\n");
        struct scene *s = load_text("a.ply", text);
        assert_true(s->n_triangles == (shared ? 6 : 1));
        for (int k = 0; k < 3; k++)
            assert_true(s->min_m[k] == 5 && s->max_m[k] == (k == 2 ? 5 : 6));
        for (uint32_t i = 0; i < s->n_triangles; i++)
            assert_true(fabs(triangle_area(s, i) - 0.5) < 1e-12);
        assert_non_null(strstr(warnings, "3 vertices that are not finite left out; no face uses them"));
        scene_free(s);
        for (int bad = 1; bad < 6; bad += 2) { /* the header has 7 lines, and 9 with the faces' two */
            char says[96];
            snprintf(text, sizeof text, VERTICES("6") "%s%s3 0 2 %d\n%s", shared ? FACES("6") : FACES("1"), vertices,
                     bad, shared ? "3 2 4 0\n3 4 0 2\n3 0 4 2\n3 4 2 0\n3 2 0 4\n" : "");
            snprintf(says, sizeof says, "a.ply, line %d: vertex %d (%s) is not finite, and a face uses it", 9 + bad + 1,
                     bad + 1,
                     bad == 1   ? "nan 0 0"
                     : bad == 3 ? "0 inf 0"
                                : "0 0 -inf");
            refuse("a.ply", text, strlen(text), says);
        }
    }
}

/* Faces of one or two corners are points and lines. Faces without corners are another count. */
static void faces_of_few_corners(void **state)
{
    (void)state;
    struct scene *s =
        load_text("a.ply", VERTICES("3") FACES("7") "0 0 0\n1 0 0\n0 1 0\n0\n3 0 1 2\n1 0\n2 0 1\n0\n2 1 2\n0\n");
    assert_true(s->n_triangles == 1 && s->counts.not_triangles == 3 && s->n_meshes == 1);
    assert_non_null(strstr(warnings, "3 faces without corners left out"));
    scene_free(s);
    s = load_text("a.ply", VERTICES("3") FACES("1") "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
    assert_int_equal(n_warnings, 0);
    scene_free(s);
}

/* An index is a whole number from 0 on, and below the number of vertices. */
static void indices_at_their_bounds(void **state)
{
    (void)state;
    static const struct {
        const char *face, *says;
    } row[] = {{"3 0 1 3", "index 3 out of range; there are 3 vertices"},
               {"3 0 1 -1", "index -1 out of range; there are 3 vertices"},
               {"3 3 1 2", "index 3 out of range; there are 3 vertices"}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        char text[512];
        snprintf(text, sizeof text, VERTICES("3") FACES("1") "0 0 0\n1 0 0\n0 1 0\n%s\n", row[i].face);
        refuse("a.ply", text, strlen(text), row[i].says);
    }
}

static void write_image(const char *name)
{
    struct picture picture;
    struct sh_err err;
    assert_int_equal(picture_make(&picture, 2, 2, (const uint8_t[3]){1, 2, 3}, &err), SH_OK);
    assert_int_equal(picture_write_png(&picture, "test", path_in(name), &err), SH_OK);
    picture_free(&picture);
}

/* Programs have several names for texture coordinates, and for colours. A comment names the image. */
static void names_of_texture_coordinates(void **state)
{
    (void)state;
    static const char *const names[4][2] = {{"s", "t"}, {"u", "v"}, {"texture_u", "texture_v"}, {"up", "v2"}};
    struct sh_err err;
    write_image("a b.png");
    for (int i = 0; i < 4; i++) {
        char text[1024];
        struct scene *s;
        snprintf(text, sizeof text,
                 "ply\nformat ascii 1.0\ncomment TextureFile\ncomment TextureFile a b.png\nelement vertex 3\n"
                 "property double x\nproperty double y\nproperty double z\nproperty float %s\nproperty float %s\n"
                 "property uchar %sred\nproperty uchar %sgreen\nproperty uchar %sblue\n" FACES(
                     "1") "0 0 0 0.5 0.25 1 2 3\n"
                          "1 0 0 0.75 1 4 5 6\n0 1 0 0 0.125 7 8 9\n3 0 1 2\n",
                 names[i][0], names[i][1], i % 2 ? "diffuse_" : "", i % 2 ? "diffuse_" : "", i % 2 ? "diffuse_" : "");
        const struct scene_mesh_spec spec = {.file = write_text("a.ply", text), .scale = 1, .textures = 1};
        if (load_spec(&spec, 1e-3, &s, &err) != SH_OK) fail_msg("%s", err.text);
        unlink(path);
        static const float uv[3][2] = {{0.5f, 0.25f}, {0.75f, 1}, {0, 0.125f}};
        for (int k = 0; k < 3; k++) {
            assert_true(s->rgb != NULL && s->rgb[0][k][0] == 3 * k + 1 && s->rgb[0][k][2] == 3 * k + 3);
            if (i < 3) assert_memory_equal(s->uv[0][k], uv[k], sizeof uv[k]);
        }
        if (i < 3) {
            assert_int_equal(s->n_textures, 1);
            assert_non_null(strstr(s->texture[0].file, "a b.png"));
        }
        scene_free(s);
    }
    unlink(path_in("a b.png"));
}

/* A header has up to 16 elements, 512 properties and 256 textures. One more of each is refused, with its line. */
static void limits_of_a_header(void **state)
{
    (void)state;
    static const struct {
        int n; /* of them; the mesh itself has two elements and four properties */
        const char *first, *line, *says;
    } row[] = {{14, "", "element other 0\n", NULL},
               {15, "", "element other 0\n", "line 23: more than 16 elements"},
               {508, "element other 0\n", "property int a\n", NULL},
               {509, "element other 0\n", "property int a\n", "line 518: more than 512 properties"},
               {256, "", "comment TextureFile a.png\n", NULL},
               {257, "", "comment TextureFile a.png\n", "line 265: more than 256 textures"},
               {1, "", "element other 1\n", "element other has no properties"}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        static char text[16384];
        char *p = text + sprintf(text, VERTICES("3") "element face 1\nproperty list uchar int vertex_indices\n%s",
                                 row[i].first);
        for (int k = 0; k < row[i].n; k++)
            p += sprintf(p, "%s", row[i].line);
        p += sprintf(p, "end_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
        if (row[i].says != NULL)
            refuse("a.ply", text, (size_t)(p - text), row[i].says);
        else
            scene_free(load_text("a.ply", text));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(strips_are_triangles),         cmocka_unit_test(vertices_that_are_not_finite),
        cmocka_unit_test(faces_of_few_corners),         cmocka_unit_test(indices_at_their_bounds),
        cmocka_unit_test(names_of_texture_coordinates), cmocka_unit_test(limits_of_a_header),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
