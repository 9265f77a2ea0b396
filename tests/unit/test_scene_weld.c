/* SPDX-License-Identifier: MIT */
/* Some meshes in binary PLY have a vertex for each corner. Vertices at the same place become one, as by a naive
 * comparison of all of them. Meshes that share vertices stay as they are. */
#include "core/rng.h"
#include "tests/unit/scene_files.h"

/* Places are on a grid, each used some six times, in an order that repeats near and far. Some coordinates are -0.
 * Triangles are random among them, so some have no area. */
struct torn {
    uint32_t n_vertices, n_faces;
    double (*v)[3];
    uint8_t *bytes;
    size_t n_bytes;
};

static void put(struct torn *t, const void *data, size_t n)
{
    memcpy(t->bytes + t->n_bytes, data, n);
    t->n_bytes += n;
}

static struct torn make_torn(uint32_t faces, uint32_t per_face, uint32_t places)
{
    struct torn t = {.n_vertices = faces * per_face, .n_faces = faces};
    t.v = malloc(t.n_vertices * sizeof *t.v);
    t.bytes = malloc(300 + (size_t)t.n_vertices * 29 + faces);
    assert_non_null(t.v);
    assert_non_null(t.bytes);
    t.n_bytes = (size_t)sprintf((char *)t.bytes,
                                "ply\nformat binary_little_endian 1.0\nelement vertex %u\nproperty double x\n"
                                "property double y\nproperty double z\nelement face %u\n"
                                "property list uchar int vertex_indices\nend_header\n",
                                t.n_vertices, faces);
    for (uint32_t i = 0; i < t.n_vertices; i++) {
        const uint64_t r = rng_u64(5, i);
        const uint64_t place = r % 3 == 0 ? r / 3 % places : (i / 7 + r % 5) % places;
        t.v[i][0] = (double)(place % 20);
        t.v[i][1] = (double)(place / 20);
        t.v[i][2] = r % 2 == 0 ? 0.0 : -0.0;
    }
    put(&t, t.v, t.n_vertices * sizeof *t.v);
    for (uint32_t i = 0; i < t.n_vertices; i++)
        t.v[i][2] += 0.0; /* as offset_m is added: a scene without an offset has no -0 */
    for (uint32_t i = 0; i < faces; i++) {
        const uint8_t n = (uint8_t)per_face;
        put(&t, &n, 1);
        for (uint32_t k = 0; k < per_face; k++)
            put(&t, &(int32_t){(int32_t)(i * per_face + k)}, 4);
    }
    return t;
}

static void free_torn(struct torn *t)
{
    free(t->v);
    free(t->bytes);
}

/* number[i]: which of the different places vertex i has, in the order of their first vertices. Returns how many there
 * are. */
static uint32_t weld_naively(const struct torn *t, uint32_t *number)
{
    uint32_t n = 0;
    for (uint32_t i = 0; i < t->n_vertices; i++) {
        uint32_t k = 0;
        while (memcmp(t->v[k], t->v[i], sizeof *t->v) != 0)
            k++;
        number[i] = k == i ? n++ : number[k];
    }
    return n;
}

static int has_area(const double *a, const double *b, const double *c)
{
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) != 0.0; /* whole numbers: exact */
}

static void as_a_naive_comparison_has_them(void **state)
{
    (void)state;
    struct torn t = make_torn(3000, 3, 1200);
    uint32_t *number = malloc(t.n_vertices * sizeof *number), n = weld_naively(&t, number), at = 0;
    struct scene *s = load(write_file("torn.ply", t.bytes, t.n_bytes));
    assert_in_range(n, 1000, 1200);
    assert_int_equal(s->n_vertices, n);
    for (uint32_t i = 0; i < t.n_vertices; i++)
        assert_memory_equal(s->vertex_m[number[i]], t.v[i], sizeof *t.v);
    for (uint32_t i = 0; i < t.n_faces; i++) {
        if (!has_area(t.v[3 * i], t.v[3 * i + 1], t.v[3 * i + 2])) continue;
        assert_true(at < s->n_triangles);
        assert_memory_equal(s->triangle[at++], number + 3 * i, sizeof *s->triangle);
    }
    assert_int_equal(at, s->n_triangles);
    assert_in_range(s->counts.zero_area, 1, t.n_faces / 2);
    free(number);
    scene_free(s);
    free_torn(&t);
}

static int compare_places(const void *a, const void *b)
{
    return memcmp(a, b, 3 * sizeof(double));
}

/* The file has 10 MB, which are freed while they are read. The table grows, as there are more places than its first
 * size. A second file of the same places has vertices of its own. */
static void large_and_twice(void **state)
{
    (void)state;
    struct torn t = make_torn(120000, 3, 700000);
    struct scene *s;
    struct sh_err err = {0};
    const char *file = write_file("torn.ply", t.bytes, t.n_bytes);
    const struct scene_mesh_spec spec[2] = {{.file = file, .scale = 1}, {.file = file, .scale = 1}};
    assert_int_equal(scene_load(spec, 2, 1e-3, NULL, &s, &err), SH_OK);
    unlink(file);
    const uint32_t n = s->n_vertices / 2, half = s->n_triangles / 2;
    assert_in_range(n, (1 << 17) + 1, t.n_vertices - 1); /* beyond half of its first size, 2^18, the table grows */
    assert_memory_equal(s->vertex_m, s->vertex_m + n, n * sizeof *s->vertex_m);
    for (uint32_t i = 0, at = 0; i < t.n_faces; i++) {
        if (!has_area(t.v[3 * i], t.v[3 * i + 1], t.v[3 * i + 2])) continue;
        for (int k = 0; k < 3; k++) {
            assert_memory_equal(s->vertex_m[s->triangle[at][k]], t.v[3 * i + (uint32_t)k], sizeof *t.v);
            assert_int_equal(s->triangle[half + at][k], s->triangle[at][k] + n);
        }
        at++;
    }
    qsort(s->vertex_m, n, sizeof *s->vertex_m, compare_places);
    for (uint32_t i = 1; i < n; i++)
        assert_true(memcmp(s->vertex_m[i - 1], s->vertex_m[i], sizeof *s->vertex_m) != 0);
    scene_free(s);
    free_torn(&t);
}

/* If there are no more vertices than faces, the file's vertices stay as they are, even two at one place. */
static void shared_vertices_stay(void **state)
{
    (void)state;
    struct scene *s = load_text("shared.ply", "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\n"
                                              "property double y\nproperty double z\nelement face 4\n"
                                              "property list uchar int vertex_indices\nend_header\n"
                                              "0 0 0\n1 0 0\n0 1 0\n0 0 0\n"
                                              "3 3 1 2\n3 0 1 2\n3 1 2 3\n3 2 0 1\n");
    static const uint32_t triangle[4][3] = {{3, 1, 2}, {0, 1, 2}, {1, 2, 3}, {2, 0, 1}};
    assert_int_equal(s->n_vertices, 4);
    assert_int_equal(s->n_triangles, 4);
    assert_memory_equal(s->triangle, triangle, sizeof triangle);
    scene_free(s);
}

/* Messages count the file's vertices. */
static void messages_count_as_the_file(void **state)
{
    (void)state;
    struct torn t = make_torn(4, 3, 2);
    const uint64_t nan_bits = UINT64_C(0x7ff8000000000000);
    uint8_t *vertices = t.bytes + t.n_bytes - 4 * 13 - 12 * 24;
    memcpy(vertices + 10 * 24, &nan_bits, 8);
    refuse("nan.ply", t.bytes, t.n_bytes, "vertex 11 (nan");
    memcpy(vertices + 10 * 24, t.v[10], 8);
    memcpy(t.bytes + t.n_bytes - 4, &(int32_t){12}, 4);
    refuse("index.ply", t.bytes, t.n_bytes, "index 12 out of range; there are 12 vertices");
    free_torn(&t);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(as_a_naive_comparison_has_them),
        cmocka_unit_test(large_and_twice),
        cmocka_unit_test(shared_vertices_stay),
        cmocka_unit_test(messages_count_as_the_file),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
