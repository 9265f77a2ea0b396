/* SPDX-License-Identifier: MIT */
/* Which faces and vertices of a mesh stand twice (core/scene.h), by the definition. */
#include <stdlib.h>
#include <string.h>

#include "core/scene.h"
#include "tests/common/cases.h"

/* A square of two faces; vertices 4 and 5 lie at the places of 0 and 2. Vertex 6 differs from 0 in the sign of a zero.
 */
static double vertex_m[][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 0}, {1, 1, 0}, {-0.0, 0, 0}};

static struct sh_err err;

static void expect(const struct scene *scene, uint64_t want)
{
    uint64_t *duplicate = NULL;
    assert_int_equal(scene_find_duplicate_faces(scene, NULL, &duplicate, &err), SH_OK);
    if (duplicate[0] != want) fail_msg("faces %llx instead of %llx", (long long)duplicate[0], (long long)want);
    free(duplicate);
}

/* The corners' order and their numbers don't matter, their places do, bit for bit. */
static void faces_have_the_same_places(void **state)
{
    (void)state;
    static uint32_t triangle[][3] = {{0, 1, 2}, {0, 2, 3}, {2, 1, 0}, {5, 4, 1}, {3, 0, 5}, {0, 1, 3}, {6, 1, 2}};
    struct scene scene = {.n_vertices = 7, .n_triangles = 7, .vertex_m = vertex_m, .triangle = triangle};
    expect(&scene, 1 << 2 | 1 << 3 | 1 << 4);
    scene.n_triangles = 2;
    expect(&scene, 0);
}

/* Faces with holes are duplicates where they have the same image, at the same place on each corner. */
static void faces_have_the_same_holes(void **state)
{
    (void)state;
    static const struct texture_mask *const none = NULL;
    int image[2]; /* their addresses stand for two images */
    const struct texture_mask *cutout[] = {none, (void *)&image[0], (void *)&image[1], (void *)&image[0]};
    static uint32_t triangle[][3] = {{0, 1, 2}, {0, 1, 2}, {2, 0, 1}, {5, 1, 4}, {0, 1, 2}, {0, 1, 2}, {1, 2, 0}};
    static uint16_t label[] = {11, 11, 11, 13, 12, 10, 10};
    static float uv[][3][2] = {{{0, 0}, {1, 0}, {1, 1}}, {{0, 0}, {1, 0}, {1, 1}}, /* the same */
                               {{1, 1}, {0, 0}, {1, 0}},                           /* the same, turned */
                               {{1, 1}, {1, 0}, {0, 0}},  /* the same image of another surface */
                               {{0, 0}, {1, 0}, {1, 1}},  /* another image */
                               {{0, 0}, {0, 0}, {0, 0}},  /* without holes */
                               {{9, 9}, {9, 9}, {9, 9}}}; /* likewise */
    struct scene scene = {.n_vertices = 7,
                          .n_triangles = 7,
                          .vertex_m = vertex_m,
                          .triangle = triangle,
                          .label = label,
                          .label0 = 10,
                          .uv = uv,
                          .cutout = cutout};
    expect(&scene, 1 << 1 | 1 << 2 | 1 << 3 | 1 << 6);
    for (int corner = 0; corner < 3; corner++) /* one corner of the second face is laid elsewhere */
        for (int k = 0; k < 2; k++) {
            uv[1][corner][k] += 0.5f;
            expect(&scene, 1 << 2 | 1 << 3 | 1 << 6);
            uv[1][corner][k] -= 0.5f;
        }
}

/* Of 200 faces each third one stands once more at the end. */
static void many_faces(void **state)
{
    (void)state;
    enum { N = 200, TWICE = (N + 2) / 3 };
    static double many_m[N + 2][3];
    static uint32_t triangle[N + TWICE][3];
    struct scene scene = {.n_vertices = N + 2, .n_triangles = N + TWICE, .vertex_m = many_m, .triangle = triangle};
    uint64_t *duplicate = NULL;
    for (uint32_t i = 0; i < N + 2; i++)
        many_m[i][0] = i / 2, many_m[i][1] = i % 2;
    for (uint32_t i = 0; i < N + TWICE; i++)
        for (uint32_t c = 0; c < 3; c++)
            triangle[i][c] = (i < N ? i : 3 * (i - N)) + (i < N ? c : 2 - c);
    assert_int_equal(scene_find_duplicate_faces(&scene, NULL, &duplicate, &err), SH_OK);
    for (uint32_t i = 0; i < N + TWICE; i++)
        assert_int_equal(duplicate[i / 64] >> i % 64 & 1, i >= N);
    free(duplicate);
}

static void vertices_have_the_same_place(void **state)
{
    (void)state;
    static const uint32_t want[] = {0, 1, 2, 3, 0, 2};
    struct scene scene = {.n_vertices = 6, .vertex_m = vertex_m};
    uint32_t *same = NULL;
    assert_int_equal(scene_find_same(&scene, NULL, &same, &err), SH_OK);
    assert_memory_equal(same, want, sizeof want);
    free(same);
}

static int stop(void *ctx)
{
    (void)ctx;
    return 1;
}

/* After a stop there is nothing to be freed. */
static void the_search_can_be_stopped(void **state)
{
    (void)state;
    static const struct sh_report report = {.stop = stop};
    static uint32_t triangle[1][3] = {{0, 1, 2}};
    struct scene scene = {.n_vertices = 3, .n_triangles = 1, .vertex_m = vertex_m, .triangle = triangle};
    uint64_t *duplicate = (uint64_t *)vertex_m;
    uint32_t *same = (uint32_t *)triangle;
    assert_int_equal(scene_find_duplicate_faces(&scene, &report, &duplicate, &err), SH_ESTOPPED);
    assert_null(duplicate);
    assert_int_equal(scene_find_same(&scene, &report, &same, &err), SH_ESTOPPED);
    assert_null(same);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(faces_have_the_same_places),
        cmocka_unit_test(faces_have_the_same_holes),
        cmocka_unit_test(many_faces),
        cmocka_unit_test(vertices_have_the_same_place),
        cmocka_unit_test(the_search_can_be_stopped),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
