/* SPDX-License-Identifier: MIT */
/* Surfaces of a scene are left out (scene_keep), or its copies are written out: what is left is what was asked for, in
 * the old order, bit for bit, with bounds, names and counts. */
#include <math.h>

#include "core/scene_copies.h"
#include "core/vec3.h"
#include "tests/unit/scene_files.h"

enum { MOST_TRIANGLES = 64, MOST_SURFACES = 16 };

/* A triangle of the scene, with the names of its surface. */
struct seen {
    double corner[3][3];
    char object[SCENE_NAME_LEN];
};

static struct seen before[MOST_TRIANGLES], after[MOST_TRIANGLES];
static struct sh_err err;

/* The first mesh has two surfaces, and its first copy reaches farther than the second one. The vertex that comes first
 * is the lowest one of its file. */
static const char TREE[] =
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 3\nv 1 0 3\nv 0 2 3\no trunk\nf 1 2 3\no crown\nf 4 5 6\nf 4 6 2\n";
static const char POST[] = "v 0 0 -1\nv 0.5 0 0\nv 0 0.5 2\no post\nf 1 2 3\n";
static const char GROUND[] = "v -5 -6 -2\nv 5 -6 0\nv 5 6 0\nv -5 6 0\nv 7 7 1\no ground\nf 1 2 3 4\no bank\nf 2 5 3\n";

static struct scene *load_all(int own_surfaces)
{
    static struct scene_place tree[] = {{.at_m = {-20, -30, 1}, .turn_deg = 30, .scale = 2},
                                        {.at_m = {4, 3, 0}, .scale = 1}};
    static struct scene_place post[] = {{.at_m = {9, 8, 0}, .scale = 3},
                                        {.at_m = {2, 8, 40}, .turn_deg = -90, .scale = 1}};
    char file[3][128];
    struct scene *scene;
    snprintf(file[0], sizeof file[0], "%s", write_text("tree.obj", TREE));
    snprintf(file[1], sizeof file[1], "%s", write_text("ground.obj", GROUND));
    snprintf(file[2], sizeof file[2], "%s", write_text("post.obj", POST));
    const struct scene_mesh_spec spec[3] = {{.file = file[0], .scale = 1, .places = {tree, 2, own_surfaces, "trees"}},
                                            {.file = file[1], .scale = 1},
                                            {.file = file[2], .scale = 1, .places = {post, 2, 0, "posts"}}};
    if (scene_load(spec, 3, 1e-3, NULL, &scene, &err) != SH_OK) fail_msg("%s", err.text);
    for (int i = 0; i < 3; i++)
        unlink(file[i]);
    assert_int_equal(scene->n_meshes, 5); /* each copy is one */
    return scene;
}

/* Lists the triangles whose surfaces are kept. The scene's bounds are those of all its triangles. */
static uint32_t list_triangles(const struct scene *s, const uint8_t *keep, struct seen *out)
{
    double min[3], max[3];
    uint32_t n = 0;
    vec3_bound_nothing(min, max);
    for (uint32_t i = 0; i < s->n_all; i++) {
        const uint32_t label = scene_label(s, i);
        assert_true(label < s->n_surfaces && n < MOST_TRIANGLES);
        memset(&out[n], 0, sizeof out[n]);
        scene_corners(s, i, out[n].corner);
        snprintf(out[n].object, sizeof out[n].object, "%s", s->surface[label].object);
        for (int c = 0; c < 3; c++)
            vec3_bound(min, max, out[n].corner[c]);
        n += keep == NULL || keep[label];
    }
    for (int k = 0; k < 3 && s->n_all > 0; k++)
        if (fabs(s->min_m[k] - min[k]) > 1e-12 || fabs(s->max_m[k] - max[k]) > 1e-12)
            fail_msg("axis %d: %g to %g, not %g to %g", k, s->min_m[k], s->max_m[k], min[k], max[k]);
    return n;
}

/* Surfaces of the scene's own mesh are numbered first: ground, bank, then trunk, crown (and again, where each copy has
 * its own), then post. Returns whether those copies of the tree that keep anything keep the same. */
static int fits(const uint8_t *keep, int own)
{
    if (!own) return 1;
    const int first = keep[2] + 2 * keep[3], second = keep[4] + 2 * keep[5];
    return first == 0 || second == 0 || first == second;
}

static void kept_surfaces_are_as_they_were(void **state)
{
    (void)state;
    for (int own = 0; own < 2; own++) {
        const uint32_t n = own ? 7 : 5;
        for (uint32_t mask = 0; mask < 1U << n; mask++) {
            struct scene *s = load_all(own);
            uint8_t keep[MOST_SURFACES] = {0};
            assert_int_equal(s->n_surfaces, n);
            for (uint32_t i = 0; i < n; i++)
                keep[i] = mask >> i & 1;
            const uint32_t n_kept = list_triangles(s, keep, before);
            const int rc = scene_keep(s, keep, &err);
            assert_int_equal(rc, fits(keep, own) ? SH_OK : SH_EINPUT);
            if (rc == SH_OK) {
                assert_int_equal(list_triangles(s, NULL, after), n_kept);
                assert_memory_equal(after, before, n_kept * sizeof *after);
                assert_int_equal(s->n_surfaces, __builtin_popcount(mask));
                const int trees = own ? (keep[2] || keep[3]) + (keep[4] || keep[5]) : 2 * (keep[2] || keep[3]);
                assert_int_equal(s->n_copies, trees + 2 * keep[n - 1]);
                assert_int_equal(s->n_copied, (trees > 0) + keep[n - 1]);
                for (uint32_t i = 0; i < s->n_triangles; i++)
                    for (int c = 0; c < 3; c++)
                        assert_true(s->triangle[i][c] < s->n_vertices);
            }
            scene_free(s);
        }
    }
}

/* If no mesh has colours or texture coordinates, the scene has none afterwards. */
static void written_out_copies_are_as_they_were(void **state)
{
    (void)state;
    for (int own = 0; own < 2; own++) {
        struct scene *s = load_all(own);
        const uint32_t n = list_triangles(s, NULL, before);
        assert_int_equal(n, 14 - 3);
        assert_int_equal(scene_write_out_copies(s, n, NULL, &err), SH_OK);
        assert_int_equal(s->n_triangles, n);
        assert_true(s->n_copies == 0 && s->n_copied == 0);
        assert_true(s->uv == NULL && s->rgb == NULL && s->cutout == NULL);
        assert_int_equal(list_triangles(s, NULL, after), n);
        assert_memory_equal(after, before, n * sizeof *after);
        scene_free(s);
    }
    struct scene *s = load_all(0);
    assert_int_equal(scene_write_out_copies(s, s->n_all - 1, NULL, &err), SH_EINPUT);
    assert_string_equal(err.text,
                        "scene.meshes[].copies: 4 copies come to 11 triangles; reports, coverage and the page "
                        "of `run` need each of them in memory: allowed are 10 at most");
    scene_free(s);
}

/* A binary STL has floats: its error is 6e-8 of its largest coordinate, along whichever axis, times the scale of its
 * largest copy. */
static void rounding_grows_with_copies(void **state)
{
    (void)state;
    for (int axis = 0; axis < 3; axis++)
        for (int order = 0; order < 3; order++) {
            struct scene_place place[3] = {{.scale = 1}, {.scale = 1}, {.scale = 1}};
            float corner[12] = {0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0}; /* its normal first */
            uint8_t file[134] = {0};
            place[order].scale = 2;
            corner[3 + 3 * order + axis] = -1000;
            file[80] = 1; /* triangle */
            memcpy(file + 84, corner, sizeof corner);
            struct scene *s;
            const struct scene_mesh_spec spec = {
                .file = write_file("a.stl", file, sizeof file), .scale = 3, .places = {place, 3, 0, "places"}};
            if (load_spec(&spec, 1e-3, &s, &err) != SH_OK) fail_msg("%s", err.text);
            unlink(path);
            assert_true(fabs(s->error_m - 6e-8 * 1000 * 3 * 2) < 1e-12);
            assert_int_equal(s->n_copies, 3);
            scene_free(s);
        }
}

/* Arrays are one mesh, with one surface where none is named. */
static void arrays_are_one_mesh(void **state)
{
    (void)state;
    static const double vertex_m[3][3] = {{1, 2, 3}, {4, 2, 3}, {1, 5, 3}};
    static const uint32_t triangle[1][3] = {{0, 1, 2}};
    const struct scene_arrays arrays = {vertex_m, 3, triangle, 1, NULL, NULL, 0};
    struct scene *s;
    assert_int_equal(scene_from_arrays(&arrays, &s, &err), SH_OK);
    assert_true(s->n_meshes == 1 && s->n_all == 1 && s->n_triangles == 1 && s->n_vertices == 3 && s->n_surfaces == 1);
    assert_true(s->n_copied == 0 && s->n_copies == 0 && s->n_textures == 0 && s->error_m == 0);
    assert_true(s->uv == NULL && s->rgb == NULL && s->cutout == NULL);
    assert_string_equal(s->surface[0].object, "object");
    assert_string_equal(s->surface[0].material, "material");
    assert_memory_equal(s->vertex_m, vertex_m, sizeof vertex_m);
    assert_int_equal(list_triangles(s, NULL, after), 1);
    scene_free(s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(kept_surfaces_are_as_they_were),
        cmocka_unit_test(written_out_copies_are_as_they_were),
        cmocka_unit_test(arrays_are_one_mesh),
        cmocka_unit_test(rounding_grows_with_copies),
    };
    return cmocka_run_group_tests_name("scene_keep", tests, make_folder, remove_folder);
}
