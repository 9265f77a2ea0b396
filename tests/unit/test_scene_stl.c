/* SPDX-License-Identifier: MIT */
/* These tests read STL, binary and as text, in the forms of other programs. Files that are cut off are refused. */
#include "tests/unit/scene_files.h"

static size_t binary_stl(char *out, const char *head, uint32_t says, uint32_t n)
{
    memset(out, 0, 84);
    strcpy(out, head);
    memcpy(out + 80, &says, 4);
    for (uint32_t i = 0; i < n; i++) {
        const float facet[12] = {0, 0, 1, 0.1f, 0, (float)i, 1, 0, (float)i, 0, 1, (float)i};
        memset(out + 84 + 50 * i, 0, 50);
        memcpy(out + 84 + 50 * i, facet, sizeof facet);
    }
    return 84 + 50 * n;
}

static void stl_by_its_size(void **state)
{
    (void)state;
    char data[1024];
    size_t n = binary_stl(data, "solid exported by CAD", 2, 2);
    struct scene *s = load(write_file("a.stl", data, n));
    assert_int_equal(s->n_triangles, 2);
    assert_int_equal(s->n_meshes, 1);
    assert_true(s->vertex_m[0][0] == (double)0.1f);
    assert_string_equal(s->surface[0].object, "a");
    assert_int_equal(n_warnings, 0);
    scene_free(s);
    s = load(write_file("a.stl", data, n + 7));
    assert_int_equal(s->n_triangles, 2);
    assert_non_null(strstr(warnings, "a.stl: 7 bytes after the last of its 2 triangles ignored"));
    scene_free(s);
    n = binary_stl(data, "solid", 4, 2);
    refuse("a.stl", data, n, "cut off: a binary STL of 4 triangles has 284 bytes, but the file has 184");
    n = binary_stl(data, "x", 2, 2);
    refuse("a.stl", data, n - 1, "cut off");
    unlink(path);
}

#define FACET(z)                                                                                    \
    "facet normal 0 0 1\nouter loop\nvertex 0 0 " #z "\nvertex 500000.1 0 " #z "\nvertex 0 1e0 " #z \
    "\nendloop\nendfacet\n"

static void stl_as_text(void **state)
{
    (void)state;
    struct scene *s =
        load_text("a.stl", "\r\n\n  solid room\r\n" FACET(1) FACET(1) "endsolid room\nSOLID\n" FACET(-0) "EndSolid");
    assert_int_equal(s->n_triangles, 3);
    assert_int_equal(s->n_vertices, 6);         /* those at the same place are one */
    assert_true(s->vertex_m[1][0] == 500000.1); /* in double */
    assert_int_equal(n_warnings, 0);
    assert_string_equal(s->surface[0].object, "room");
    assert_string_equal(s->surface[s->label[2]].object, "a");
    scene_free(s);
    static const char text[] = "solid a\n" FACET(1) "endsolid a\n";
    for (size_t cut = 1; cut < sizeof text - 5; cut += 7) /* anywhere before the end of `endsolid` */
        refuse("a.stl", text, cut, "");
    refuse("a.stl", text, strlen(text) - 12, "cut off: the file ends where facet or endsolid is expected");
    refuse("a.stl", "solid\nfacet normal\nouter loop\nvertex 0 0\n", 39,
           "line 4: cut off: the file ends where a number of a vertex is expected");
    static const char digits[] = "0123456789012345678901234567890123456789"; /* 40, the most of a word that is named */
    static const char head[] = "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 ";
    for (int more = 0; more < 2; more++) {
        char bad[160], says[160];
        const int n = snprintf(bad, sizeof bad, "%sx%.*s\n", head, more ? 40 : 38, digits);
        snprintf(says, sizeof says, "line 4: 'x%.*s' is found where a number of a vertex is expected", more ? 39 : 38,
                 digits);
        refuse("a.stl", bad, (size_t)n, says);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(stl_by_its_size),
        cmocka_unit_test(stl_as_text),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
