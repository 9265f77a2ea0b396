/* SPDX-License-Identifier: MIT */
/* Statements of OBJ that other tests don't have: several meshes with faces before their vertices, lines that go on, how
 * many numbers a statement may have, and the lines that errors name. */
#include <sys/stat.h>

#include "core/studio/picture.h"
#include "tests/unit/scene_files.h"

static struct sh_err err;

static struct scene *load_textured(const char *name, const char *text)
{
    struct scene *scene = NULL;
    const struct scene_mesh_spec spec = {.file = write_text(name, text), .scale = 1, .textures = 1};
    if (load_spec(&spec, 1e-3, &scene, &err) != SH_OK) fail_msg("%s", err.text);
    unlink(path);
    return scene;
}

/* A negative number counts back from its face's line, even if a vertex of the face comes later. Each file of a scene
 * counts by itself. */
static void faces_before_their_vertices(void **state)
{
    (void)state;
    static const char text[] = "v 0 0 0\nv 1 0 0\nv 1 1 0\nf -1 -3 4\nv 0 1 5\nv 9 9 9\nf -1 1 -2\nf 6 -1 1\nv 7 0 1\n";
    /* the vertices of each face, by number; faces with later vertices come after the others */
    static const uint32_t want[3][3] = {{4, 0, 3}, {2, 0, 3}, {5, 4, 0}};
    char file[2][160];
    struct scene *s;
    for (int i = 0; i < 2; i++)
        snprintf(file[i], sizeof file[i], "%s", write_text(i == 0 ? "a.obj" : "b.obj", text));
    const struct scene_mesh_spec spec[2] = {{.file = file[0], .scale = 1}, {.file = file[1], .scale = 1}};
    if (scene_load(spec, 2, 1e-3, NULL, &s, &err) != SH_OK) fail_msg("%s", err.text);
    assert_true(s->n_vertices == 12 && s->n_triangles == 6 && s->n_meshes == 2);
    for (uint32_t i = 0; i < 6; i++)
        for (int k = 0; k < 3; k++)
            assert_int_equal(s->triangle[i][k], want[i % 3][k] + (i < 3 ? 0 : 6));
    scene_free(s);
    for (int i = 0; i < 2; i++)
        unlink(file[i]);
}

static void write_image(const char *name)
{
    struct picture picture;
    assert_int_equal(picture_make(&picture, 2, 2, (const uint8_t[3]){1, 2, 3}, &err), SH_OK);
    assert_int_equal(picture_write_png(&picture, "test", path_in(name), &err), SH_OK);
    picture_free(&picture);
}

static void numbers_of_texture_coordinates(void **state)
{
    (void)state;
    static const struct {
        const char *vt;
        float v;
        int ok;
    } row[] = {{"vt 0.5", 0, 1}, {"vt 0.5 0.25", 0.25f, 1}, {"vt 0.5 0.25 7", 0.25f, 1}, {"vt 0.5 0.25 7 8", 0, 0},
               {"vt", 0, 0},     {"vt 0.5 x", 0, 0}};
    char image[160], library[160];
    write_image("a.png");
    snprintf(image, sizeof image, "%s", path_in("a.png"));
    snprintf(library, sizeof library, "%s", write_text("a.mtl", "newmtl a\nmap_Kd a.png\n"));
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        char text[128];
        struct scene *s;
        snprintf(text, sizeof text, "mtllib a.mtl\nv 0 0 0\nv 1 0 0\n%s\nv 1 1 0\nusemtl a\nf 1/1 2/1 3/-1\n",
                 row[i].vt);
        const struct scene_mesh_spec spec = {.file = write_text("a.obj", text), .scale = 1, .textures = 1};
        const int rc = load_spec(&spec, 1e-3, &s, &err);
        unlink(path);
        assert_int_equal(rc == SH_OK, row[i].ok);
        if (rc != SH_OK) {
            if (strstr(err.text, "vt must have 1 to 3 numbers") == NULL || strstr(err.text, "a.obj, line 4") == NULL)
                fail_msg("%s", err.text);
            continue;
        }
        for (int k = 0; k < 3; k++)
            assert_true(s->uv[0][k][0] == 0.5f && s->uv[0][k][1] == row[i].v);
        scene_free(s);
    }
    unlink(image);
    unlink(library);
}

/* A backslash at a line's end continues numbers. In a path it is part of the name, so the next line is a statement. */
static void lines_that_go_on(void **state)
{
    (void)state;
    struct scene *s = load_text("a.obj", "v 0 0 \\\n0\nv 1 0 0\nvn 0 0 \\\n1\nvt 0 \\\n0\ns \\\n1\nv 1 1 0\nl 1 \\\n2\n"
                                         "p 1 \\\n2 3\nf 1 \\\n2 3\n");
    assert_true(s->n_vertices == 3 && s->n_triangles == 1);
    assert_int_equal(s->counts.not_triangles, 1 + 3);
    assert_null(strstr(warnings, "unknown statement"));
    scene_free(s);
    s = load_textured("a.obj", "mtllib textures\\\nv 0 0 0\nmaplib C:\\maps\\\nv 1 0 0\nv 1 1 0\nf 1 2 3\n");
    assert_true(s->n_vertices == 3 && s->n_triangles == 1);
    assert_null(strstr(warnings, "unknown statement"));
    scene_free(s);
}

#define FACE(material) "usemtl " material "\nf 1/1 2/1 3/1\n"

/* An image may lie beside the library that names it, in a folder of its own. Names of libraries may be in quotes, with
 * blanks, and several in a line. A comment after a material's name, as some programs write it, is not a part of it. */
static void libraries_and_their_images(void **state)
{
    (void)state;
    static const char text[] =
        "mtllib \"sub/a b.mtl\" c.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\n" FACE("red   # as paint") FACE("blue")
            FACE("green");
    assert_int_equal(mkdir(path_in("sub"), 0700), 0);
    write_image("sub/a.png");
    write_text("sub/a b.mtl", "newmtl red\nKd 1 0 0.5\nmap_Kd a.png\nnewmtl green\nKd 0 1 0\n");
    write_text("c.mtl", "newmtl blue\nKd 0.25\nd 0.75\n");
    struct scene *s = load_textured("a.obj", text);
    if (n_warnings > 0) fail_msg("%s", warnings);
    assert_int_equal(s->n_surfaces, 3);
    static const float want[3][4] = {{1, 0, 0.5f, 0}, {0.25f, 0.25f, 0.25f, 0.25f}, {0, 1, 0, 0}};
    for (int i = 0; i < 3; i++) {
        assert_memory_equal(s->surface[i].colour, want[i], sizeof s->surface[i].colour);
        assert_true(s->surface[i].has_colour && s->surface[i].clear == want[i][3]);
        assert_int_equal(s->surface[i].texture, i == 0);
    }
    assert_non_null(strstr(s->texture[0].file, "sub/a.png"));
    scene_free(s);
    static const char *const made[] = {"sub/a.png", "sub/a b.mtl", "c.mtl"};
    for (int i = 0; i < 3; i++)
        assert_int_equal(unlink(path_in(made[i])), 0);
    assert_int_equal(rmdir(path_in("sub")), 0);
}

/* Each file of a scene has its own libraries: a material of the same name may look otherwise. */
static void libraries_of_two_files(void **state)
{
    (void)state;
    static const char *const name[4] = {"a.obj", "b.obj", "a.mtl", "b.mtl"};
    static const char *const text[4] = {"mtllib a.mtl\no a\nv 0 0 0\nv 1 0 0\nv 1 1 0\n" FACE("paint"),
                                        "mtllib b.mtl\no b\nv 0 0 0\nv 1 0 0\nv 1 1 0\n" FACE("paint") FACE("glass"),
                                        "newmtl paint\nKd 1 0 0\nd 0.5\n",
                                        "newmtl paint\nKd 0 1 0\nd 0.25\nnewmtl glass\nTr 0.875\nnewmtl paint\nd 1\n"};
    char file[4][160];
    struct scene *s;
    for (int i = 0; i < 4; i++)
        snprintf(file[i], sizeof file[i], "%s", write_text(name[i], text[i]));
    const struct scene_mesh_spec spec[2] = {{.file = file[0], .scale = 1}, {.file = file[1], .scale = 1}};
    if (scene_load(spec, 2, 1e-3, NULL, &s, &err) != SH_OK) fail_msg("%s", err.text);
    assert_int_equal(s->n_surfaces, 3);
    assert_true(s->surface[0].colour[0] == 1 && s->surface[0].clear == 0.5f);
    assert_true(s->surface[1].colour[1] == 1 && s->surface[1].clear == 0.75f); /* the first definition counts */
    assert_true(!s->surface[2].has_colour && s->surface[2].clear == 0.875f);
    scene_free(s);
    for (int i = 0; i < 4; i++)
        unlink(file[i]);
}

/* The first unknown statement is named with its line; each counts. */
static void unknown_statements(void **state)
{
    (void)state;
    struct scene *s = load_text("a.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nwavy 1 2\nodd\n\nf 1 2 3\nwavy\n");
    if (strstr(warnings, "3 unknown statements ignored; the first is 'wavy' in line 4") == NULL)
        fail_msg("%s", warnings);
    scene_free(s);
    s = load_text("a.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\ncall b.obj 1\nf 1 2 3\ncall c.obj\n");
    if (strstr(warnings, "2 statements call another file, which is not read; the first is 'b.obj' in line 4") == NULL)
        fail_msg("%s", warnings);
    scene_free(s);
    s = load_text("a.obj", "# no statement\nv 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n");
    assert_int_equal(n_warnings, 0);
    scene_free(s);
}

/* Errors name the line of the statement, as do those that are found when a face's later vertices are known. */
static void lines_of_errors(void **state)
{
    (void)state;
    static const struct {
        const char *text, *says;
    } row[] = {{"v 0 0 0\nv 1 0 0\n\nv 1 1\nf 1 2 3\n", "a.obj, line 4"},
               {"v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 4\nv 0 1 0\nf 1 2 0\n", "a.obj, line 6: index 0 out of range"},
               {"v 0 0 0\nv 1 0 0\nv 1 1 0\n\nf 1 2 5\nf 1 2 3\nv 1 2 1\n",
                "a.obj, line 5: index 5 out of range; there are 4 vertices"},
               {"v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 -4\n", "a.obj, line 4: index -4 out of range; there are 3 vertices"},
               {"v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3/1/1/1\n", "a.obj, line 4"},
               {"v 0 0 0\nv 1 0 0\nv 1 1 0\nf\nf 1 2 3\n", "a.obj, line 4"},
               {"v 0 0 0\nv 1 0 0\n\nv 1 1e10 0\nf 1 2 3\n", "a.obj, line 4"}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++)
        refuse("a.obj", row[i].text, strlen(row[i].text), row[i].says);
}

/* A polygon has up to 65536 corners. One corner more is refused, with its line. */
static void corners_of_a_polygon(void **state)
{
    (void)state;
    enum { MOST = 65536, ROOM = 1 << 20 };
    char *text = malloc(ROOM), *p = text;
    assert_non_null(text);
    p += sprintf(p, "v 0 0 0\nv 1 0 0\nv 1 1 0\n\nf");
    for (int i = 0; i <= MOST; i++)
        p += sprintf(p, " %d", i % 3 + 1);
    p += sprintf(p, "\nf 1 2 3\n");
    refuse("a.obj", text, (size_t)(p - text), "a.obj, line 5");
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(faces_before_their_vertices),
        cmocka_unit_test(numbers_of_texture_coordinates),
        cmocka_unit_test(lines_that_go_on),
        cmocka_unit_test(unknown_statements),
        cmocka_unit_test(lines_of_errors),
        cmocka_unit_test(libraries_and_their_images),
        cmocka_unit_test(libraries_of_two_files),
        cmocka_unit_test(corners_of_a_polygon),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
