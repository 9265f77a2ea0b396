/* SPDX-License-Identifier: MIT */
/* Rays that pass the outline of one thing in front of another so closely that floats see the wrong one. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "tests/stability/rig.h"

static const double UTM_M[3] = {391431.25, 5819712.5, 34.0};

#ifdef SH_SANITIZE
enum { RAYS = 20000 };
#else
enum { RAYS = 30000 };
#endif

/* Adds rays to places between `from` and `to`, beside them by up to 1e-7 of the distance, across the ray. Half of the
 * offsets are uniform, half by powers of ten down to 1e-17, where double precision ends. */
static void aim_beside_edge(struct rig *rig, const double from[3], const double to[3], uint32_t n, uint64_t seed)
{
    for (uint32_t i = 0; i < n; i++) {
        double part = rig_unit(seed, 4 * (uint64_t)i), p[3], edge[3], across[3],
               off = rig_unit(seed, 4 * (uint64_t)i + 1);
        double length2 = 0.0, across2 = 0.0, size = i % 2 ? 1e-7 * off : 1e-7 * pow(10.0, -10.0 * off);
        if (rig_unit(seed, 4 * (uint64_t)i + 2) < 0.5) size = -size;
        for (int k = 0; k < 3; k++) {
            p[k] = from[k] + part * (to[k] - from[k]) - rig->station_m[k];
            edge[k] = to[k] - from[k];
            length2 += p[k] * p[k];
        }
        for (int k = 0; k < 3; k++) {
            across[k] = edge[(k + 1) % 3] * p[(k + 2) % 3] - edge[(k + 2) % 3] * p[(k + 1) % 3];
            across2 += across[k] * across[k];
        }
        double scale = size * sqrt(length2 / across2);
        rig_direct(rig, p[0] + scale * across[0], p[1] + scale * across[1], p[2] + scale * across[2]);
    }
}

/* Adds a wall far behind, in cells. The wall faces the station, which looks along y from the origin. */
static void add_wall(struct mesh *mesh, double y)
{
    const double corner[3] = {-0.5 * y, y, -0.5 * y}, u[3] = {y, 0.0, 0.0}, v[3] = {0.0, 0.0, y};
    mesh_sheet(mesh, corner, u, v, 20, 20, 7);
}

/* Turns the mesh about an arbitrary axis and moves it to UTM coordinates. The station stays where y begins. */
static void open_turned(struct rig *rig, struct mesh *mesh, const double station_m[3])
{
    struct mesh point = {0};
    double rotation[9];
    mesh_any_rotation(rotation);
    mesh_vertex(&point, station_m[0], station_m[1], station_m[2]);
    mesh_move(&point, 0, rotation, UTM_M);
    mesh_move(mesh, 0, rotation, UTM_M);
    rig_open(rig, mesh_scene(mesh), point.vertex[0]);
    mesh_free(&point);
}

/* Aims at edges of the mesh between triangles of a label, whether they are outlines or not. */
static void aim_beside_all_edges(struct rig *rig, const struct mesh *mesh, uint16_t label, uint32_t rays)
{
    uint32_t edges = 0, at = 0;
    for (uint32_t t = 0; t < mesh->n_triangles; t++)
        edges += mesh->label[t] == label ? 3 : 0;
    for (uint32_t t = 0; t < mesh->n_triangles; t++)
        for (int e = 0; e < 3 && mesh->label[t] == label; e++, at++)
            aim_beside_edge(rig, mesh->vertex[mesh->triangle[t][e]], mesh->vertex[mesh->triangle[t][(e + 1) % 3]],
                            rays / edges, 61 + at);
}

static void row(struct mesh *mesh, uint16_t label, const double station_m[3], const char *regime)
{
    struct rig rig;
    open_turned(&rig, mesh, station_m);
    aim_beside_all_edges(&rig, mesh, label, RAYS);
    rig_row_of_rays(&rig, regime, rig.station_m);
    rig_close(&rig);
    mesh_free(mesh);
}

static const double STATION_M[3] = {0.0, 0.0, 0.0};

/* The bound of all rows is 0 wrong rays. Rays that pass an edge within 16 x 2^-53 of the distance of its farther end do
 * not count. There the reference in long double and double arithmetic may disagree on the side of the edge. */
static void test_solids(void **state)
{
    (void)state;
    const double distance_m[] = {2.0, 50.0, 1000.0};
    for (int i = 0; i < 3; i++) {
        struct mesh mesh = {0};
        char regime[96];
        double d = distance_m[i], min[3] = {-0.1 * d, d, -0.07 * d}, max[3] = {0.08 * d, 1.1 * d, 0.09 * d};
        mesh_box(&mesh, min, max, 0);
        add_wall(&mesh, 1.5 * d);
        snprintf(regime, sizeof regime, "edges of a box at %g m, wall behind", d);
        row(&mesh, 0, STATION_M, regime);
    }
    struct mesh mesh = {0};
    mesh_sphere(&mesh, (const double[3]){0.3, 20.0, 0.1}, 2.0, 0.0, 3, 0);
    add_wall(&mesh, 30.0);
    row(&mesh, 0, STATION_M, "outline of a sphere at 20 m, wall behind");
    table_check();
}

/* The head sees the top of a table from hardly above it. Its far edge is met at 89 and at 89.9 degrees, and the wall is
 * 20 m behind. */
static void test_grazed_edge(void **state)
{
    (void)state;
    const double incidence_deg[] = {89.0, 89.9};
    for (int i = 0; i < 2; i++) {
        struct mesh mesh = {0};
        struct rig rig;
        char regime[96];
        double min[3] = {-1.0, 4.0, -0.05}, max[3] = {1.0, 10.0, 0.0};
        double above_m = 10.0 / tan(incidence_deg[i] * acos(-1.0) / 180.0);
        mesh_box(&mesh, min, max, 0);
        add_wall(&mesh, 30.0);
        open_turned(&rig, &mesh, (const double[3]){0.0, 0.0, above_m});
        aim_beside_edge(&rig, mesh.vertex[6], mesh.vertex[7], RAYS, 71); /* y and z at their largest */
        snprintf(regime, sizeof regime, "far edge of a table top at %g degrees", incidence_deg[i]);
        rig_row_of_rays(&rig, regime, rig.station_m);
        rig_close(&rig);
        mesh_free(&mesh);
    }
    table_check();
}

/* Edges without a neighbour, in a sheet with holes, and edges of boxes that are ever thinner fins. */
static void test_open_edges(void **state)
{
    (void)state;
    struct mesh mesh = {0};
    mesh_sheet(&mesh, (const double[3]){-1.0, 10.0, -1.0}, (const double[3]){2.0, 1.0, 0.0},
               (const double[3]){0.0, 0.5, 2.0}, 8, 8, 0);
    for (uint32_t t = 0; t < mesh.n_triangles; t += 5) { /* every fifth triangle is a hole */
        mesh.n_triangles--;
        memcpy(mesh.triangle[t], mesh.triangle[mesh.n_triangles], sizeof *mesh.triangle);
    }
    add_wall(&mesh, 30.0);
    row(&mesh, 0, STATION_M, "open sheet with holes at 10 m, wall behind");

    const double thick_m[] = {1e-2, 1e-4, 1e-6};
    for (int i = 0; i < 3; i++) {
        char regime[96];
        double half = 0.5 * thick_m[i];
        mesh_box(&mesh, (const double[3]){0.5 - half, 20.0, -1.0}, (const double[3]){0.5 + half, 21.0, 1.0}, 0);
        add_wall(&mesh, 30.0);
        snprintf(regime, sizeof regime, "edges of a fin %g m thin at 20 m", thick_m[i]);
        row(&mesh, 0, STATION_M, regime);
    }
    table_check();
}

/* A roof whose crest goes away from the station, with rays that look almost along it. A ray that is aimed at the crest
 * is rounded, but does not end at the wall behind. */
static void test_crests(void **state)
{
    (void)state;
    uint32_t passed = 0, rays = 0;
    for (uint64_t k = 0; k < 40; k++) {
        struct mesh mesh = {0};
        struct rig rig;
        const double x = 2.0 * rig_unit(81, 4 * k) - 1.0, slope = 0.1 * rig_unit(81, 4 * k + 1),
                     far_m = 20.0 + (double)k;
        const double from[3] = {x, 10.0, -0.3 - rig_unit(81, 4 * k + 2)},
                     to[3] = {x + 0.3, far_m, from[2] - slope * far_m};
        for (int i = 0; i < 2; i++) {
            const double *at = i == 0 ? from : to;
            mesh_vertex(&mesh, at[0], at[1], at[2]);
            mesh_vertex(&mesh, at[0] - 1.0, at[1], at[2] - 1.0);
            mesh_vertex(&mesh, at[0] + 1.0, at[1], at[2] - 1.0);
        }
        mesh_triangle(&mesh, 0, 3, 1, 0);
        mesh_triangle(&mesh, 1, 3, 4, 0);
        mesh_triangle(&mesh, 0, 2, 3, 0);
        mesh_triangle(&mesh, 2, 5, 3, 0);
        add_wall(&mesh, 100.0);
        rig_open(&rig, mesh_scene(&mesh), STATION_M);
        for (uint32_t i = 0; i < RAYS / 40; i++) {
            double p[3], part = rig_unit(82 + k, i);
            for (int j = 0; j < 3; j++)
                p[j] = from[j] + part * (to[j] - from[j]);
            rig_aim(&rig, p);
        }
        rig_cast(&rig);
        for (uint32_t i = 0; i < rig.n; i++)
            passed += rig.range_m[i] < 99.0 ? 0 : 1;
        rays += rig.n;
        rig_close(&rig);
        mesh_free(&mesh);
    }
    table_note("crests of roofs, seen almost along them: %u of %u rays pass them by", passed, rays);
    assert_int_equal(passed, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_solids),
        cmocka_unit_test(test_grazed_edge),
        cmocka_unit_test(test_open_edges),
        cmocka_unit_test(test_crests),
    };
    table_head("stability: silhouettes");
    return cmocka_run_group_tests(tests, NULL, NULL);
}
