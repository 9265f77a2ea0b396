/* SPDX-License-Identifier: MIT */
/* Places of the head: against a wall, in a solid, in a face's plane, among kilometres and millimetres, before surfaces
 * that cross. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/common/thorough.h"
#include "tests/stability/rig.h"

#ifdef SH_SANITIZE
#define RAYS 2000u
#else
/* Each ray is cast by the BVH and by a sight, which have to agree bit by bit. */
#define RAYS ((uint32_t)thorough(8000, 3000))
#endif

static const double NOWHERE[3] = {0.0, 0.0, 0.0};

static void turn_about(struct mesh *mesh, const double station_m[3], double turned_m[3])
{
    struct mesh point = {0};
    double rotation[9];
    mesh_any_rotation(rotation);
    mesh_vertex(&point, station_m[0], station_m[1], station_m[2]);
    mesh_move(&point, 0, rotation, NOWHERE);
    mesh_move(mesh, 0, rotation, NOWHERE);
    memcpy(turned_m, point.vertex[0], sizeof point.vertex[0]);
    mesh_free(&point);
}

/* A room 8 m wide, 1 km from the scene's origin, with the head 1 mm from a wall of 1.5 m cells: ranges from 1 mm,
 * incidence to 90 degrees. Ours: 16 x 2^-53 x (range + 1 km) / cos i, with range x cos i = 1 mm at least on that wall.
 * A ray that meets it at 8 m stands at cos i = 1.2e-4: below 2e-8 m. Naive: the wall and the head round by 3e-5 m each
 * in the scene's own coordinates, 3 % of the range. The BVH's frame is about the scene's middle: in the room, or 1 km
 * from there, with a ball as far away on the other side. */
static void against_wall(const char *regime, int beside)
{
    const double walls_m[2][3] = {{700.0, 700.0, 10.0}, {708.0, 706.0, 13.0}}, off_m[3] = {1e-3, 2.2, 1.1};
    struct mesh mesh = {0};
    struct rig rig;
    double station_m[3];
    for (int i = 0; i < 6; i++) {
        double corner[3], u[3] = {0, 0, 0}, v[3] = {0, 0, 0};
        memcpy(corner, walls_m[i / 3], sizeof corner);
        int a = (i + 1) % 3, b = (i + 2) % 3, s = i / 3 == 0 ? 1 : -1;
        u[a] = s * (walls_m[1][a] - walls_m[0][a]);
        v[b] = s * (walls_m[1][b] - walls_m[0][b]);
        mesh_sheet(&mesh, corner, u, v, 4, 4, (uint16_t)i);
    }
    for (int k = 0; k < 3; k++)
        station_m[k] = walls_m[0][k] + off_m[k];
    if (beside) mesh_sphere(&mesh, (const double[3]){-700.0, -700.0, -10.0}, 1.0, 0.0, 0, 6);
    turn_about(&mesh, station_m, station_m);
    rig_open(&rig, mesh_scene(&mesh), station_m);
    rig_aim_at_sphere(&rig, RAYS, 131);
    rig_row_of_ranges(&rig, regime, NOWHERE, RIG_MICROMETRE);
    rig_close(&rig);
    mesh_free(&mesh);
}

static void test_against_wall(void **state)
{
    (void)state;
    against_wall("head 1 mm from a wall", 0);
    against_wall("head 1 mm from a wall, BVH 1 km off", 1);
    table_check();
}

/* The head is inside of a closed body that stands in a closed room, and sees the body's inner side. Naive: a cast that
 * skips the first millimetre, to avoid hits on its own surface, with the head 0.5 mm from the body's skin. */
static void test_inside_solid(void **state)
{
    (void)state;
    struct mesh mesh = {0};
    struct rig rig;
    double station_m[3] = {10.0, 20.0, 3.0};
    mesh_sphere(&mesh, station_m, 0.25, 0.0, 3, 0);
    mesh_box(&mesh, (const double[3]){4.0, 15.0, 0.0}, (const double[3]){15.0, 26.0, 8.0}, 1);
    station_m[0] += 0.2475; /* facets are up to 1 % within the sphere */
    turn_about(&mesh, station_m, station_m);
    rig_open(&rig, mesh_scene(&mesh), station_m);
    rig_aim_at_sphere(&rig, RAYS, 141);
    rig_row_of_ranges(&rig, "head inside a solid, near its skin", NOWHERE, RIG_MICROMETRE);
    rig_close(&rig);
    mesh_free(&mesh);
    table_check();
}

/* ---- rays within the plane of faces: the head is at the height of a table's top, and looks level. The ray may meet
 * the top anywhere between its near and its far edge, as double precision can't tell the edge-on plane from the ray. Or
 * it may pass over the top to the wall. Nothing else is right. `turned` turns all about an arbitrary axis, so that only
 * rounding separates the plane from the ray. */
struct level {
    double near_m, end_m, wall_m; /* along the ray */
};

static double along_face_error(const struct rig *rig, const struct level *level)
{
    double worst_m = 0.0;
    for (uint32_t i = 0; i < rig->n; i++) {
        const struct level *l = &level[i];
        double range_m = rig->range_m[i], beside_m = fmax(fmax(l->near_m - range_m, range_m - l->end_m), 0.0);
        double error_m = fmin(beside_m, fabs(range_m - l->wall_m));
        worst_m = isnan(range_m) ? (double)INFINITY : fmax(worst_m, error_m);
    }
    return worst_m;
}

/* Double arithmetic is good to 1e-14 m here. The naive float range of a wall at 140 m is good to 1e-5 m. */
static void along_face_row(int turned)
{
    struct mesh mesh = {0};
    struct rig rig;
    const double head_m[3] = {0.3, 0.2, 1.1};
    double station_m[3], rotation[9];
    struct level *level = malloc(RAYS * sizeof *level);
    mesh_box(&mesh, (const double[3]){-4.0, 6.0, 1.0}, (const double[3]){4.0, 9.0, 1.1}, 0);
    mesh_sheet(&mesh, (const double[3]){-200.0, 140.0, -200.0}, (const double[3]){400.0, 0, 0},
               (const double[3]){0, 0, 400.0}, 10, 10, 7);
    memcpy(station_m, head_m, sizeof station_m);
    mesh_any_rotation(rotation);
    if (turned) turn_about(&mesh, station_m, station_m);
    rig_open(&rig, mesh_scene(&mesh), station_m);
    for (uint64_t i = 0; i < RAYS; i++) {
        double x = (rig_unit(151, i) - 0.5) * 0.8, length = sqrt(1.0 + x * x);
        if (turned)
            rig_direct(&rig, rotation[0] * x + rotation[1], rotation[3] * x + rotation[4],
                       rotation[6] * x + rotation[7]);
        else
            rig_direct(&rig, x, 1.0, 0.0);
        level[i] = (struct level){(6.0 - head_m[1]) * length, (9.0 - head_m[1]) * length, (140.0 - head_m[1]) * length};
    }
    rig_cast_naive(&rig, NOWHERE, 1, 16);
    double naive_m = along_face_error(&rig, level);
    rig_cast(&rig);
    table_row(turned ? "rays along a face, turned" : "rays along a face", "float rays and vertices", naive_m,
              along_face_error(&rig, level), RIG_MICROMETRE, "m");
    rig_close(&rig);
    mesh_free(&mesh);
    free(level);
}

static void test_along_face(void **state)
{
    (void)state;
    along_face_row(0);
    along_face_row(1);
    table_check();
}

/* ---- kilometres and millimetres: the top of a screw, 2 mm wide and 0.5 mm high, stands out of a slope of 4 km made of
 * two triangles, 5 m from the scanner. Embree meets the slope with floats of kilometres, which are wrong by tenths of a
 * millimetre. */
static void test_mixed_sizes(void **state)
{
    (void)state;
    struct mesh mesh = {0};
    struct rig rig;
    const double place_m[3] = {3.0, 4.0, 0.0}, turn_flat[9] = {1, 0, 0, 0, 1, 0, 0, 0, 0.5};
    double station_m[3] = {0.0, 0.0, 1.6};
    mesh_sphere(&mesh, NOWHERE, 1e-3, 0.0, 3, 0);
    mesh_move(&mesh, 0, turn_flat, place_m);
    mesh_sheet(&mesh, (const double[3]){-1900.0, -2100.0, 0.0}, (const double[3]){4000.0, 0.0, 0.0},
               (const double[3]){0.0, 4000.0, 0.0}, 1, 1, 1);
    turn_about(&mesh, station_m, station_m);
    struct mesh spot = {0};
    for (uint32_t i = 0; i < RAYS; i++)
        mesh_vertex(&spot, place_m[0] + 3e-3 * (rig_unit(161, 3 * (uint64_t)i) - 0.5),
                    place_m[1] + 3e-3 * (rig_unit(161, 3 * (uint64_t)i + 1) - 0.5),
                    1e-3 * rig_unit(161, 3 * (uint64_t)i + 2));
    turn_about(&spot, NOWHERE, (double[3]){0});
    rig_open(&rig, mesh_scene(&mesh), station_m);
    for (uint32_t i = 0; i < spot.n_vertices; i++)
        rig_aim(&rig, spot.vertex[i]);
    rig_row_of_ranges(&rig, "2 mm screw on ground of 4 km, from 5 m", station_m, RIG_MICROMETRE);
    rig_close(&rig);
    mesh_free(&mesh);
    mesh_free(&spot);
    table_check();
}

/* ---- surfaces that cross: a pole through a floor. Near the line where they cross, both are met at ranges nearer to
 * each other than floats can order. */
static void crossing_row(double distance_m)
{
    struct mesh mesh = {0}, spot = {0};
    struct rig rig;
    char regime[96];
    const double half_m = 0.05, d = distance_m;
    double station_m[3] = {0.0, 0.0, 0.2 * d};
    mesh_box(&mesh, (const double[3]){-half_m, d, -0.5}, (const double[3]){half_m, d + 2.0 * half_m, 1.0}, 0);
    mesh_sheet(&mesh, (const double[3]){-d, 0.1 * d, 0.0}, (const double[3]){2.0 * d, 0.0, 0.0},
               (const double[3]){0.0, 2.0 * d, 0.0}, 20, 20, 1);
    for (uint32_t i = 0; i < RAYS; i++) { /* above and below the front's foot, by powers of ten from 1 cm to 10 nm */
        double off_m = 1e-2 * pow(10.0, -6.0 * rig_unit(171, 2 * (uint64_t)i + 1));
        mesh_vertex(&spot, 1.9 * half_m * (rig_unit(171, 2 * (uint64_t)i) - 0.5), d, i % 2 ? off_m : -off_m);
    }
    turn_about(&spot, NOWHERE, (double[3]){0});
    turn_about(&mesh, station_m, station_m);
    rig_open(&rig, mesh_scene(&mesh), station_m);
    for (uint32_t i = 0; i < spot.n_vertices; i++)
        rig_aim(&rig, spot.vertex[i]);
    snprintf(regime, sizeof regime, "pole through a floor at %g m", distance_m);
    rig_row_of_ranges(&rig, regime, station_m, RIG_MICROMETRE);
    rig_close(&rig);
    mesh_free(&mesh);
    mesh_free(&spot);
}

static void test_crossing(void **state)
{
    (void)state;
    crossing_row(5.0);
    crossing_row(50.0);
    crossing_row(1000.0);
    table_check();
}

/* The plate is seen from the front. The plate's back is so near behind that floats can't tell which comes first. */
static void test_thin_plate(void **state)
{
    (void)state;
    const double thick_m[] = {1e-3, 1e-4, 1e-5};
    for (int i = 0; i < 3; i++) {
        struct mesh mesh = {0};
        struct rig rig;
        char regime[96];
        double station_m[3] = {0.0, 0.0, 0.0};
        mesh_box(&mesh, (const double[3]){-80.0, 200.0, -80.0}, (const double[3]){80.0, 200.0 + thick_m[i], 80.0}, 0);
        turn_about(&mesh, station_m, station_m);
        rig_open(&rig, mesh_scene(&mesh), station_m);
        rig_aim_at_sphere(&rig, 5 * RAYS, 181);
        snprintf(regime, sizeof regime, "plate %g m thick at 200 m", thick_m[i]);
        rig_row_of_ranges(&rig, regime, station_m, RIG_MICROMETRE);
        rig_close(&rig);
        mesh_free(&mesh);
    }
    table_check();
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_against_wall), cmocka_unit_test(test_inside_solid), cmocka_unit_test(test_along_face),
        cmocka_unit_test(test_mixed_sizes),  cmocka_unit_test(test_crossing),     cmocka_unit_test(test_thin_plate),
    };
    table_head("stability: places");
    return cmocka_run_group_tests(tests, NULL, NULL);
}
