/* SPDX-License-Identifier: MIT */
/* Large coordinates, short and long ranges, and grazing incidence, where plain float coordinates fail. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "tests/common/collada.h"
#include "tests/common/generate.h"
#include "tests/common/thorough.h"
#include "tests/stability/rig.h"

static const double NOWHERE[3] = {0.0, 0.0, 0.0};

/* ---- scenes at large coordinates, from files */

struct place {
    const char *name;
    double rotation[9], offset_m[3];
};

/* Turns local east, north and up to ECEF at 52.5 N 13.4 E, an ordinary place with coordinates of several thousand
 * kilometres. */
static void to_ecef(struct place *place)
{
    const double lat = 0.9163, lon = 0.2339, earth_m = 6.371e6;
    const double sa = sin(lat), ca = cos(lat), so = sin(lon), co = cos(lon);
    const double rotation[9] = {-so, -sa * co, ca * co, co, -sa * so, ca * so, 0.0, ca, sa};
    memcpy(place->rotation, rotation, sizeof rotation);
    for (int k = 0; k < 3; k++)
        place->offset_m[k] = earth_m * rotation[3 * k + 2];
}

/* The test's own vertices are whole multiples of 2^-10 m, so that ten decimals hold them exactly. */
static void make_site(const struct place *place, struct mesh *mesh)
{
    const double centre[2] = {0.0, 0.0};
    struct scene *scene;
    struct sh_err err;
    if (generate_terrain(2000, 60.0, 2.0, centre, 11, &scene, &err) != SH_OK) fail_msg("%s", err.text);
    mesh_add_scene(mesh, scene, 0);
    scene_free(scene);
    mesh_move(mesh, 0, place->rotation, place->offset_m);
    for (uint32_t i = 0; i < mesh->n_vertices; i++)
        for (int k = 0; k < 3; k++)
            mesh->vertex[i][k] = floor(mesh->vertex[i][k] * 1024.0) / 1024.0;
}

static void write_obj(FILE *f, const struct mesh *m)
{
    for (uint32_t i = 0; i < m->n_vertices; i++)
        fprintf(f, "v %.10f %.10f %.10f\n", m->vertex[i][0], m->vertex[i][1], m->vertex[i][2]);
    for (uint32_t i = 0; i < m->n_triangles; i++)
        fprintf(f, "f %u %u %u\n", m->triangle[i][0] + 1, m->triangle[i][1] + 1, m->triangle[i][2] + 1);
}

static void write_ply_head(FILE *f, const struct mesh *m, const char *format)
{
    fprintf(f, "ply\nformat %s 1.0\nelement vertex %u\nproperty double x\nproperty double y\nproperty double z\n",
            format, m->n_vertices);
    fprintf(f, "element face %u\nproperty list uchar int vertex_indices\nend_header\n", m->n_triangles);
}

static void write_ply_text(FILE *f, const struct mesh *m)
{
    write_ply_head(f, m, "ascii");
    for (uint32_t i = 0; i < m->n_vertices; i++)
        fprintf(f, "%.10f %.10f %.10f\n", m->vertex[i][0], m->vertex[i][1], m->vertex[i][2]);
    for (uint32_t i = 0; i < m->n_triangles; i++)
        fprintf(f, "3 %u %u %u\n", m->triangle[i][0], m->triangle[i][1], m->triangle[i][2]);
}

static void write_ply_binary(FILE *f, const struct mesh *m)
{
    const unsigned char three = 3;
    write_ply_head(f, m, "binary_little_endian"); /* the byte order of the machines this runs on */
    fwrite(m->vertex, sizeof *m->vertex, m->n_vertices, f);
    for (uint32_t i = 0; i < m->n_triangles; i++) {
        fwrite(&three, 1, 1, f);
        fwrite(m->triangle[i], sizeof m->triangle[i], 1, f);
    }
}

/* One triangle is enough, as the file is refused. */
static void write_collada(FILE *f, const struct mesh *m)
{
    const double *v[3];
    for (int k = 0; k < 3; k++)
        v[k] = m->vertex[m->triangle[0][k]];
    fprintf(f, COLLADA_TRIANGLE("%.10f %.10f %.10f %.10f %.10f %.10f %.10f %.10f %.10f"), v[0][0], v[0][1], v[0][2],
            v[1][0], v[1][1], v[1][2], v[2][0], v[2][1], v[2][2]);
}

static int load_site(const struct mesh *mesh, const char *ending, void (*write)(FILE *f, const struct mesh *m),
                     struct scene **scene, struct sh_err *err)
{
    char folder[] = "/tmp/scanhead-stability-XXXXXX", path[64];
    if (mkdtemp(folder) == NULL) fail_msg("no folder under /tmp");
    snprintf(path, sizeof path, "%s/site%s", folder, ending);
    FILE *f = fopen(path, "wb");
    if (f == NULL) fail_msg("can't write %s", path);
    write(f, mesh);
    int bad = ferror(f);
    bad |= fclose(f);
    if (bad) fail_msg("can't write %s", path);
    const struct scene_mesh_spec spec = {.file = path, .scale = 1.0};
    int rc = scene_load(&spec, 1, 1e-3, NULL, scene, err);
    unlink(path);
    rmdir(folder);
    return rc;
}

/* Ranges go up to 42 m, and rays meet the ground at up to about 89.9 degrees. Ours: vertices minus station are exact
 * (both are multiples of 2^-10 m). The double arithmetic after them errs by 16 x 2^-53 x 42 m / cos i < 1e-10 m, so the
 * promised micrometre holds with much to spare. Naive: floats at 5.8e6 m are 0.5 m apart. */
static void site_row(const struct place *place, const struct mesh *mesh, const char *ending, const char *format,
                     void (*write)(FILE *f, const struct mesh *m))
{
    struct scene *scene;
    struct sh_err err;
    struct rig rig;
    char regime[96];
    if (load_site(mesh, ending, write, &scene, &err) != SH_OK) fail_msg("%s", err.text);
    assert_int_equal(scene->n_vertices, mesh->n_vertices);
    assert_int_equal(scene->n_triangles, mesh->n_triangles);
    assert_memory_equal(scene->vertex_m, mesh->vertex, mesh->n_vertices * sizeof *mesh->vertex);
    double station_m[3];
    for (int k = 0; k < 3; k++) /* 3 m up in the middle */
        station_m[k] = floor((place->offset_m[k] + 3.0 * place->rotation[3 * k + 2]) * 1024.0) / 1024.0;
    rig_open(&rig, scene, station_m);
    rig_aim_at_sphere(&rig, 1500, 21); /* each ray is cast by the BVH and by a sight, which have to agree bit by bit */
    snprintf(regime, sizeof regime, "site at %s coordinates, %s", place->name, format);
    rig_row_of_ranges(&rig, regime, NOWHERE, RIG_MICROMETRE);
    rig_close(&rig);
}

/* A format of floats can't hold such coordinates. The naive method reads them all the same. */
static void refused_row(const struct place *place, const struct mesh *mesh)
{
    struct scene *scene;
    struct sh_err err;
    double worst_m = 0.0;
    char regime[96];
    int rc = load_site(mesh, ".dae", write_collada, &scene, &err);
    double ours_m = rc == SH_EINPUT && scene == NULL ? 0.0 : INFINITY;
    if (rc == SH_OK) scene_free(scene);
    for (uint32_t i = 0; i < 3 * mesh->n_vertices; i++) {
        double x = mesh->vertex[i / 3][i % 3];
        worst_m = fmax(worst_m, fabs((double)(float)x - x));
    }
    snprintf(regime, sizeof regime, "site at %s coordinates, Collada: refused", place->name);
    table_row(regime, "read as floats: vertices", worst_m, ours_m, 0.0, "m");
}

static void test_large_coordinates(void **state)
{
    (void)state;
    struct place place[2] = {{"UTM", {1, 0, 0, 0, 1, 0, 0, 0, 1}, {391431.0, 5819712.0, 34.0}}, {.name = "ECEF"}};
    to_ecef(&place[1]);
    for (int i = 0; i < 2; i++) {
        struct mesh mesh = {0};
        make_site(&place[i], &mesh);
        site_row(&place[i], &mesh, ".obj", "OBJ", write_obj);
        site_row(&place[i], &mesh, ".ply", "PLY ascii", write_ply_text);
        site_row(&place[i], &mesh, ".ply", "PLY binary", write_ply_binary);
        refused_row(&place[i], &mesh);
        mesh_free(&mesh);
    }
    table_check();
}

/* ---- ranges: a hull about the station, 1.2 km from the scene's origin */

/* The rough hull's facets stand at up to 80 degrees to the ray. Ours: 16 x 2^-53 x R / cos i is 1e-10 m at 10 km, and
 * the rounding of vertices about the station adds 2^-53 x 1.2 km. So the micrometre holds throughout, at 10 km too.
 * Naive: floats at 1.2 km are wrong by 6e-5 m even at short ranges, and by 5e-4 m at 10 km. The BVH's own frame is
 * about the scene's middle. That is the middle of the hull or, with a small sphere beside the hull, more than 1.2 km
 * from there. */
static void range_row(double radius_m, double rough, int beside)
{
    const double centre[3] = {1000.0, -700.0, 30.0};
    struct mesh mesh = {0};
    struct rig rig;
    char regime[96];
    double station_m[3];
    mesh_sphere(&mesh, centre, radius_m, rough, 4, 0);
    for (int k = 0; k < 3; k++)
        station_m[k] = centre[k] + 0.15 * radius_m;
    if (beside)
        mesh_sphere(&mesh, (const double[3]){centre[0] + 2.0 * radius_m + 2500.0, centre[1], centre[2]}, 1.0, 0.0, 0,
                    1);
    struct scene *scene = mesh_scene(&mesh);
    rig_open(&rig, scene, station_m);
    rig_aim_at_sphere(&rig, (uint32_t)thorough(1000, 400), 31);
    snprintf(regime, sizeof regime, "range %g m, %s hull%s", radius_m, rough > 0.0 ? "rough" : "smooth",
             beside ? ", BVH 1.2 km off" : "");
    rig_row_of_ranges(&rig, regime, NOWHERE, RIG_MICROMETRE);
    rig_close(&rig);
    mesh_free(&mesh);
}

static void test_ranges(void **state)
{
    (void)state;
    const double radius_m[] = {0.1, 1.0, 10.0, 100.0, 1000.0, 2000.0, 10000.0};
    for (size_t i = 0; i < sizeof radius_m / sizeof radius_m[0]; i++) {
        for (int beside = 0; beside < 2; beside++) {
            range_row(radius_m[i], 0.0, beside);
            range_row(radius_m[i], 0.05, beside);
        }
    }
    table_check();
}

/* ---- incidence: an exactly flat, tessellated slope at UTM coordinates, z = x/8 + y/4 */

static const double UTM_E_M = 391431.0, UTM_N_M = 5819712.0;

/* The slope has cells of cell_m, which divides 200 m and 2200 m. It has two triangles where cell_m is 0. */
static struct scene *make_slope(double cell_m)
{
    struct mesh mesh = {0};
    const double corner[3] = {-100.0, 0.0, -12.5}, u[3] = {200.0, 0.0, 25.0}, v[3] = {0.0, 2200.0, 550.0};
    mesh_sheet(&mesh, corner, u, v, cell_m > 0.0 ? (uint32_t)(200.0 / cell_m) : 1,
               cell_m > 0.0 ? (uint32_t)(2200.0 / cell_m) : 1, 0);
    for (uint32_t i = 0; i < mesh.n_vertices; i++) { /* multiples of 2^-5 m: exact */
        double *p = mesh.vertex[i];
        if (p[2] != p[0] / 8.0 + p[1] / 4.0) fail_msg("vertex %u doesn't lie in the plane", i);
        p[0] += UTM_E_M;
        p[1] += UTM_N_M;
    }
    struct scene *scene = mesh_scene(&mesh);
    for (uint32_t t = 0; t < scene->n_triangles; t++) /* of all sizes */
        scene->label[t] = (uint16_t)(48611 * (t + 1) % SCENE_MAX_SURFACES);
    mesh_free(&mesh);
    return scene;
}

/* Stands at (0, 0) on the slope, lifted along its normal so that points at range_m are met at the given incidence. */
static void stand_on_slope(double range_m, double incidence_deg, double station_m[3])
{
    const double normal_length = sqrt(1.0 + 1.0 / 64.0 + 1.0 / 16.0);
    double lift = range_m * cos(incidence_deg * acos(-1.0) / 180.0) / normal_length;
    station_m[0] = UTM_E_M + lift * -0.125;
    station_m[1] = UTM_N_M + 1.0 + lift * -0.25;
    station_m[2] = 0.25 + lift;
}

static void aim_along_slope(struct rig *rig, double range_m)
{
    const uint64_t n = (uint64_t)thorough(7000, 2500);
    for (uint64_t i = 0; i < n; i++) {
        double y = (0.95 + 0.05 * rig_unit(41, 2 * i)) * range_m * 0.97,
               x = (rig_unit(41, 2 * i + 1) - 0.5) * 0.1 * range_m;
        rig_aim(rig, (const double[3]){UTM_E_M + x, UTM_N_M + y, x / 8.0 + y / 4.0});
    }
}

/* Returns the error of the ranges. The true range is that of the plane's formula, in long double, from the same station
 * and in the same direction that were cast. */
static double slope_error_m(const struct rig *rig)
{
    long double z = (rig->station_m[0] - (long double)UTM_E_M) / 8 + (rig->station_m[1] - (long double)UTM_N_M) / 4;
    double worst_m = 0.0;
    for (uint32_t i = 0; i < rig->n; i++) {
        long double down = (long double)rig->dx[i] / 8 + (long double)rig->dy[i] / 4 - (long double)rig->dz[i];
        double error_m = (double)fabsl((rig->station_m[2] - z) / down - (long double)rig->range_m[i]);
        worst_m = isnan(error_m) ? (double)INFINITY : fmax(worst_m, error_m);
    }
    return worst_m;
}

/* Range = h / cos i, with n . dir and n . v0 as sums of three products in double. Each is wrong by at most 3 roundings
 * of its largest product (below range x |n|), and n itself by 2 more: 8 x 2^-53 x R / cos i, twice (numerator and
 * denominator). v0 counts from the BVH's origin, up to half of the slope's length away. A normal is tilted by the
 * rounding of its edges, 4 x 2^-53 of the longest side / cos i. The corners are differences of UTM coordinates, and are
 * exact here. Up to 89.9 degrees that must stay below the promised micrometre. */
static double incidence_bound_m(double cell_m, double range_m, double incidence_deg)
{
    const double longest_m = cell_m > 0.0 ? 1.5 * cell_m : 2300.0, origin_m = 1150.0;
    double bound_m =
        0x1p-53 * (16.0 * (range_m + origin_m) + 4.0 * longest_m) / cos(incidence_deg * acos(-1.0) / 180.0);
    return incidence_deg <= 89.9 ? fmin(bound_m, RIG_MICROMETRE) : bound_m;
}

static void incidence_row(double cell_m, double range_m, double incidence_deg)
{
    struct rig rig;
    char regime[96];
    double station_m[3];
    stand_on_slope(range_m, incidence_deg, station_m);
    rig_open(&rig, make_slope(cell_m), station_m);
    aim_along_slope(&rig, range_m);
    rig_cast_naive(&rig, station_m, 1, 16);
    double naive_m = slope_error_m(&rig);
    rig_cast(&rig);
    snprintf(regime, sizeof regime, "incidence %g degrees at %g m, %s", incidence_deg, range_m,
             cell_m > 0.0 ? "cells of 6.25 m" : "one face of 2.2 km");
    table_row(regime, "float rays, local frame", naive_m, slope_error_m(&rig),
              incidence_bound_m(cell_m, range_m, incidence_deg), "m");
    rig_close(&rig);
}

static const double INCIDENCE_DEG[] = {80.0, 85.0, 88.0, 89.0, 89.5, 89.9, 89.99};
enum { N_INCIDENCES = 7 };

static void test_incidence(void **state)
{
    (void)state;
    for (int i = 0; i < N_INCIDENCES; i++) {
        incidence_row(6.25, 100.0, INCIDENCE_DEG[i]);
        incidence_row(6.25, 2000.0, INCIDENCE_DEG[i]);
        incidence_row(0.0, 2000.0, INCIDENCE_DEG[i]);
    }
    table_check();
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_large_coordinates),
        cmocka_unit_test(test_ranges),
        cmocka_unit_test(test_incidence),
    };
    table_head("stability: coordinates, ranges, incidence");
    return cmocka_run_group_tests(tests, NULL, NULL);
}
