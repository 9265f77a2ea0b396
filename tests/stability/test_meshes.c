/* SPDX-License-Identifier: MIT */
/* Meshes of poor quality: needles, triangles without area, T-junctions, soups that are not welded, faces that stand
 * twice. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/common/hits.h"
#include "tests/common/thorough.h"
#include "tests/stability/rig.h"

/* Each ray is cast by the BVH and looked up in a sight, and the two ways have to agree bit by bit. So half as many rays
 * give as many chances of an error as one way with all of them. */
#ifdef SH_SANITIZE
#define RAYS 20000u
#else
#define RAYS ((uint32_t)thorough(50000, 20000))
#endif

static const double NOWHERE[3] = {0.0, 0.0, 0.0};

static void turn(struct mesh *mesh)
{
    double rotation[9];
    mesh_any_rotation(rotation);
    mesh_move(mesh, 0, rotation, NOWHERE);
}

/* A screen covers all that lies behind it, so a hit farther away has leaked. Rays are aimed at points of triangles of
 * label 0 by their barycentric parts. `corner` draws them to edges (1) or to corners (2); 0 is anywhere. */
static void aim_at_screen(struct rig *rig, uint32_t n, int corner, uint64_t seed)
{
    const struct scene *scene = rig->scene;
    for (uint64_t i = 0; i < n; i++) {
        uint32_t t = (uint32_t)(rig_unit(seed, 5 * i) * scene->n_triangles),
                 c = (uint32_t)(3.0 * rig_unit(seed, 5 * i + 1));
        if (scene->label[t] != 0) continue;
        double part[3] = {rig_unit(seed, 5 * i + 2), rig_unit(seed, 5 * i + 3), 0.0}, p[3];
        if (part[0] + part[1] > 1.0) {
            part[0] = 1.0 - part[0];
            part[1] = 1.0 - part[1];
        }
        if (corner >= 1) part[1] = 0.0;
        if (corner >= 2) part[0] = 0.0;
        part[2] = 1.0 - part[0] - part[1];
        for (int k = 0; k < 3; k++) {
            p[k] = 0.0;
            for (uint32_t e = 0; e < 3; e++)
                p[k] += part[e] * scene->vertex_m[scene->triangle[t][(c + e) % 3]][k];
        }
        rig_aim(rig, p);
    }
}

/* Counts the rays that end at label 7, the wall behind, or nowhere. */
static uint64_t count_through(const struct rig *rig)
{
    uint64_t through = 0;
    for (uint32_t i = 0; i < rig->n; i++)
        through += rig->triangle[i] >= rig->scene->n_triangles || rig->scene->label[rig->triangle[i]] == 7;
    return through;
}

/* Casts the rays with Embree, robust and not, and with ours. Prints a row of those that pass the screen. The naive
 * figure is that of the robust cast, unless this has no leak. */
static void leak_row(struct rig *rig, const char *regime)
{
    rig_cast_naive(rig, rig->station_m, 1, 16);
    uint64_t robust = count_through(rig);
    rig_cast_naive(rig, rig->station_m, 0, 16);
    uint64_t fast = count_through(rig);
    rig_cast(rig);
    table_row(regime, robust != 0 ? "local frame, robust" : "local frame, not robust",
              (double)(robust != 0 ? robust : fast), (double)count_through(rig), 0.0, "leaks");
}

static void add_wall(struct mesh *mesh, double y)
{
    const double corner[3] = {-2.0 * y, y, -2.0 * y}, u[3] = {4.0 * y, 0.0, 0.0}, v[3] = {0.0, 0.0, 4.0 * y};
    mesh_sheet(mesh, corner, u, v, 10, 10, 7);
}

/* ---- needles: edges of 100 m, 0.1 mm high: a millionth */

static void add_needles(struct mesh *mesh)
{
    mesh_sheet(mesh, (const double[3]){-50.0, 40.0, -0.1}, (const double[3]){100.0, 10.0, 3.0},
               (const double[3]){0.0, 0.02, 0.2}, 1, 2000, 0);
    for (uint32_t i = 0; i + 1 < 2000; i += 20) { /* between its own corners, and on one point */
        mesh_triangle(mesh, 2 * i, 2 * i + 1, 2 * i, 1);
        uint32_t middle = mesh_vertex(mesh, 0.5 * (mesh->vertex[2 * i][0] + mesh->vertex[2 * i + 1][0]),
                                      0.5 * (mesh->vertex[2 * i][1] + mesh->vertex[2 * i + 1][1]),
                                      0.5 * (mesh->vertex[2 * i][2] + mesh->vertex[2 * i + 1][2]));
        mesh_triangle(mesh, 2 * i, middle, 2 * i + 1, 1);
    }
}

/* Corners round by 2^-53 x 65 m. Over the height of a needle this turns its plane by 1e-10 rad about its long side, and
 * over 100 m by far less about its short side. Normals are wrong by 2^-53 x |e1| |e2|.
 * Over 100 m that displaces the plane by 2^-53 x 100 m x 10^6 = 1e-8 m, so a micrometre holds. */
static void test_needles(void **state)
{
    (void)state;
    struct mesh mesh = {0};
    struct rig rig;
    add_needles(&mesh);
    turn(&mesh);
    uint32_t n_flat = 2 * 100, before = mesh.n_triangles;
    struct scene *scene = mesh_scene(&mesh);
    assert_int_equal(scene->n_triangles, before - n_flat);
    assert_int_equal(scene->counts.zero_area, n_flat);
    rig_open(&rig, scene, NOWHERE);
    aim_at_screen(&rig, RAYS / 50, 0, 81);
    rig_row_of_ranges(&rig, "needles 1:10^6 and triangles without area", NOWHERE, RIG_MICROMETRE);
    rig_close(&rig);

    add_wall(&mesh, 80.0);
    rig_open(&rig, mesh_scene(&mesh), NOWHERE);
    aim_at_screen(&rig, RAYS / 10, 0, 82);
    leak_row(&rig, "through needles 1:10^6, rays anywhere");
    rig_clear(&rig);
    for (uint64_t i = 0; i < RAYS / 10; i++) { /* the long edges; not the border's */
        uint32_t a = 2 * (1 + (uint32_t)(rig_unit(83, 2 * i) * 1998.0)), b = a + (i % 2 ? 1 : 3);
        double part = 0.001 + 0.998 * rig_unit(83, 2 * i + 1), p[3];
        for (int k = 0; k < 3; k++)
            p[k] = mesh.vertex[a][k] + part * (mesh.vertex[b][k] - mesh.vertex[a][k]);
        rig_aim(&rig, p);
    }
    leak_row(&rig, "through needles 1:10^6, at their long edges");
    rig_close(&rig);
    mesh_free(&mesh);
    table_check();
}

/* A fan of needles in a full turn, with all their points in one place. A ray that goes through is wrong by 100 m. Float
 * ranges err by 1e-5 m, double ones as above. */
static void test_fan(void **state)
{
    (void)state;
    enum { BLADES = 3000 };
    struct mesh mesh = {0};
    struct rig rig;
    uint32_t middle = mesh_vertex(&mesh, 0.1, 100.0, 0.2);
    for (uint32_t i = 0; i < BLADES; i++) {
        double angle = 2.0 * acos(-1.0) * i / BLADES;
        mesh_vertex(&mesh, 30.0 * cos(angle), 100.0 + 5.0 * cos(5.0 * angle), 30.0 * sin(angle));
        mesh_triangle(&mesh, middle, middle + 1 + i, middle + 1 + (i + 1) % BLADES, 0);
    }
    add_wall(&mesh, 200.0);
    turn(&mesh);
    rig_open(&rig, mesh_scene(&mesh), NOWHERE);
    for (uint64_t i = 0; i < RAYS / 20; i++) { /* near the middle, by powers of ten from 10 m to 1e-17 m */
        const double *tip = mesh.vertex[middle],
                     *end = mesh.vertex[middle + 1 + (uint32_t)(rig_unit(91, 2 * i) * BLADES)];
        double part = pow(10.0, -0.5 - 18.0 * rig_unit(91, 2 * i + 1)), p[3];
        for (int k = 0; k < 3; k++)
            p[k] = tip[k] + part * (end[k] - tip[k]);
        rig_aim(&rig, p);
    }
    rig_row_of_ranges(&rig, "fan of 3000 needles, near its middle", NOWHERE, RIG_MICROMETRE);
    rig_close(&rig);
    mesh_free(&mesh);
    table_check();
}

/* ---- seams */

/* Halves of a screen that meet at x = 0 with 7 and 64 cells a side. Corners of one lie on edges of the other, as far as
 * doubles go. The corners miss the edges by up to 2^-53 of their coordinates, below the resolution of double precision
 * at that distance, so no ray may pass. */
static void test_t_junctions(void **state)
{
    (void)state;
    struct mesh mesh = {0};
    struct rig rig;
    mesh_sheet(&mesh, (const double[3]){-3.0, 9.0, -3.0}, (const double[3]){3.0, 1.0, 0.0},
               (const double[3]){0.0, 0.3, 6.0}, 7, 7, 0);
    uint32_t fine = mesh.n_vertices;
    mesh_sheet(&mesh, (const double[3]){0.0, 10.0, -3.0}, (const double[3]){3.0, 1.0, 0.0},
               (const double[3]){0.0, 0.3, 6.0}, 64, 64, 0);
    add_wall(&mesh, 20.0);
    turn(&mesh);
    rig_open(&rig, mesh_scene(&mesh), NOWHERE);
    for (uint64_t i = 0; i < RAYS; i++) { /* along the seam: at its corners and between; not at its two ends */
        uint32_t row = 1 + (uint32_t)(rig_unit(101, 2 * i) * 63.0);
        double part = i % 2 ? 0.0 : rig_unit(101, 2 * i + 1), p[3];
        const double *a = mesh.vertex[fine + 65 * row], *b = mesh.vertex[fine + 65 * (row > 1 ? row - 1 : row + 1)];
        for (int k = 0; k < 3; k++)
            p[k] = a[k] + part * (b[k] - a[k]);
        rig_aim(&rig, p);
    }
    leak_row(&rig, "along T-junctions, 7 cells beside 64");
    rig_close(&rig);
    mesh_free(&mesh);
    table_check();
}

static void test_soup(void **state)
{
    (void)state;
    for (int corner = 1; corner <= 2; corner++) {
        struct mesh mesh = {0};
        struct rig rig;
        mesh_sphere(&mesh, (const double[3]){0.3, 0.2, -0.1}, 5.0, 0.02, 5, 0);
        mesh_unweld(&mesh);
        mesh_sphere(&mesh, (const double[3]){0.0, 0.0, 0.0}, 8.0, 0.0, 3, 7);
        rig_open(&rig, mesh_scene(&mesh), NOWHERE);
        aim_at_screen(&rig, RAYS, corner, 111);
        leak_row(&rig, corner == 1 ? "unwelded soup, rays at its edges" : "unwelded soup, rays at its corners");
        rig_close(&rig);
        mesh_free(&mesh);
    }
    table_check();
}

/* ---- faces that stand twice: one of the labels is always chosen */

/* The results of one way of casting, by label. */
struct labels {
    uint16_t *label;
    uint32_t n;
};

static uint64_t compare_labels(const struct rig *rig, struct labels *first)
{
    uint64_t differ = 0;
    for (uint32_t i = 0; i < rig->n; i++) {
        uint32_t t = rig->triangle[i];
        uint16_t label = 0xffff;
        if (t < rig->scene->n_triangles) label = rig->scene->label[t];
        if (first->n == 0)
            first->label[i] = label;
        else
            differ += first->label[i] != label;
    }
    first->n = rig->n;
    return differ;
}

/* Casts in runs of `cut` rays, so that packets hold other rays each time. */
static void cast_cut(struct rig *rig, uint32_t cut)
{
    for (uint32_t at = 0; at < rig->n; at += cut) {
        uint32_t n = rig->n - at < cut ? rig->n - at : cut;
        hits_from(rig->caster, rig->bvh, rig->station_m, 1e5, n, rig->dx + at, rig->dy + at, rig->dz + at,
                  rig->range_m + at, rig->triangle + at);
    }
}

static void label_row(struct rig *rig, const char *regime)
{
    static const uint32_t width[] = {16, 8, 4, 1}, cut[] = {4096, 1, 7, 33};
    struct labels ours = {malloc(rig->n * sizeof(uint16_t)), 0}, naive = {malloc(rig->n * sizeof(uint16_t)), 0};
    uint64_t by_width = 0, by_cut = 0, by_threads = 0, naive_differ = 0;
    for (int i = 0; i < 4; i++) {
        rig_cast_naive(rig, rig->station_m, 1, width[i]);
        naive_differ += compare_labels(rig, &naive);
    }
    for (int i = 0; i < 4; i++) {
        bvh_set_packet(rig->bvh, width[i]);
        rig_cast(rig);
        by_width += compare_labels(rig, &ours);
    }
    bvh_set_packet(rig->bvh, width[0]);
    for (int i = 0; i < 4; i++) {
        cast_cut(rig, cut[i]);
        by_cut += compare_labels(rig, &ours);
    }
    rig_rebuild(rig, 2);
    bvh_set_packet(rig->bvh, width[0]);
    rig_cast(rig);
    by_threads += compare_labels(rig, &ours);
    table_row(regime, "local frame, robust: by width", (double)naive_differ, (double)(by_width + by_cut + by_threads),
              0.0, "labels");
    table_note("of %u rays; ours differ for packets of 8, 4, 1: %llu, other cuts: %llu, 2 build threads: %llu", rig->n,
               (unsigned long long)by_width, (unsigned long long)by_cut, (unsigned long long)by_threads);
    free(ours.label);
    free(naive.label);
}

/* A sphere of 1280 triangles stands twice (labels 0 and 1). In test_coplanar a screen has two tessellations in one
 * plane (2 and 3). The same ray has to give the same label in any packet, cut and BVH. */
static void add_sphere_twice(struct mesh *mesh, int swapped)
{
    const double centre[3] = {0.1, 0.2, 0.3};
    mesh_sphere(mesh, centre, 4.0, 0.0, 3, 0);
    uint32_t n = mesh->n_triangles;
    for (uint32_t t = 0; t < n; t++) {
        const uint32_t *c = mesh->triangle[swapped ? n - 1 - t : t];
        mesh_triangle(mesh, c[0], c[swapped ? 2 : 1], c[swapped ? 1 : 2], 1);
    }
}

static void test_duplicates(void **state)
{
    (void)state;
    for (int swapped = 0; swapped < 2; swapped++) {
        struct mesh mesh = {0};
        struct rig rig;
        add_sphere_twice(&mesh, swapped);
        rig_open(&rig, mesh_scene(&mesh), NOWHERE);
        rig_aim_at_sphere(&rig, RAYS / 4, 121);
        aim_at_screen(&rig, RAYS / 4, 1, 122);
        label_row(&rig, swapped ? "faces twice, turned over" : "faces twice");
        rig_close(&rig);
        mesh_free(&mesh);
    }
    table_check();
}

static void test_coplanar(void **state)
{
    (void)state;
    struct mesh mesh = {0};
    struct rig rig;
    const double corner[3] = {-4.0, 8.0, -4.0}, u[3] = {8.0, 1.0, 0.0}, v[3] = {0.0, 2.0, 8.0};
    mesh_sheet(&mesh, corner, u, v, 12, 12, 2);
    mesh_sheet(&mesh, corner, u, v, 8, 16, 3);
    rig_open(&rig, mesh_scene(&mesh), NOWHERE);
    for (uint64_t i = 0; i < RAYS / 4; i++) {
        double a = rig_unit(123, 2 * i), b = rig_unit(123, 2 * i + 1);
        rig_aim(&rig, (const double[3]){corner[0] + a * u[0], corner[1] + a * u[1] + b * v[1], corner[2] + b * v[2]});
    }
    label_row(&rig, "coplanar faces that overlap");
    rig_close(&rig);
    mesh_free(&mesh);
    table_check();
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_needles), cmocka_unit_test(test_fan),        cmocka_unit_test(test_t_junctions),
        cmocka_unit_test(test_soup),    cmocka_unit_test(test_duplicates), cmocka_unit_test(test_coplanar),
    };
    table_head("stability: meshes as they come");
    return cmocka_run_group_tests(tests, NULL, NULL);
}
