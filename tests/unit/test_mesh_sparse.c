/* SPDX-License-Identifier: MIT */
/* drivers/record/mesh_sparse.h: the figures of points that are spread over a mesh. The weights of a point are taken
 * from its place: the triangle's corners are the origin and the ends of x and y. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/studio/mesh.h"
#include "drivers/record/mesh_sparse.h"
#include "tests/common/cases.h"

static const double corner[3][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
static const uint32_t face[1][3] = {{0, 1, 2}};
static const struct mesh_sparse_part part = {face, 1, 2, 3};
static struct mesh_points from, to;
static struct sh_err err;

static void begin(int has_frame)
{
    static const uint8_t rgb[3][3] = {{250, 0, 30}, {0, 100, 60}, {50, 255, 90}};
    mesh_points_free(&from);
    mesh_points_free(&to);
    from.has_frame = to.has_frame = has_frame;
    for (int k = 0; k < 3; k++) {
        struct mesh_point p = {.range_m = 10 + 7 * k * k,
                               .frame = 100 - 30 * k,
                               .reflectance_db = (float)(-20 + 9 * k),
                               .label = (uint16_t)(10 * k),
                               .station = (uint16_t)(5 + k)};
        memcpy(p.xyz_m, corner[k], sizeof p.xyz_m);
        memcpy(p.rgb, rgb[k], sizeof p.rgb);
        assert_int_equal(mesh_points_add(&from, &p, &err), 0);
    }
}

static void end(void)
{
    mesh_points_free(&from);
    mesh_points_free(&to);
}

/* Returns the value of a point between three corners. */
static double between(const double weight[3], double a, double b, double c)
{
    return weight[0] * a + weight[1] * b + weight[2] * c;
}

/* Range, reflectance, scalar of the trajectory and colour are linear over a triangle; label and station are the nearest
 * corner's. A colour is rounded to whole numbers, and the reflectance to float. */
static void figures_are_linear(void **state)
{
    (void)state;
    for (int has_frame = 0; has_frame < 2; has_frame++) {
        const struct mesh_sparse sparse = {.per_m2 = 200, .seed = 3};
        double area_m2 = 4;
        begin(has_frame);
        assert_int_equal(mesh_sparse_add(&sparse, &from, &part, &to, &area_m2, &err), SH_OK);
        assert_true(fabs(area_m2 - 4.5) < 1e-12);
        assert_int_equal(to.n, 100);
        for (uint32_t i = 0; i < to.n; i++) {
            const double x = to.xyz_m[i][0], y = to.xyz_m[i][1], w[3] = {1 - x - y, x, y};
            const int near = x > y && x > w[0] ? 1 : y > w[0] ? 2 : 0;
            assert_true(fabs(to.range_m[i] - between(w, 10, 17, 38)) < 1e-12);
            assert_true(fabs(to.reflectance_db[i] - between(w, -20, -11, -2)) < 1e-5);
            if (has_frame) assert_true(fabs(to.frame[i] - between(w, 100, 70, 40)) < 1e-12);
            assert_true(fabs(to.rgb[i][0] - between(w, 250, 0, 50)) <= 0.5 + 1e-9);
            assert_true(fabs(to.rgb[i][1] - between(w, 0, 100, 255)) <= 0.5 + 1e-9);
            assert_true(fabs(to.rgb[i][2] - between(w, 30, 60, 90)) <= 0.5 + 1e-9);
            assert_int_equal(to.label[i], 10 * near);
            assert_int_equal(to.station[i], 5 + near);
            assert_true(to.xyz_m[i][2] == 0 && to.normal[i][2] == 0 && to.uv[i][0] == 0);
        }
    }
    end();
}

/* A mesh without colours gives black points, and each part adds its points to those before it. */
static void parts_without_colours(void **state)
{
    (void)state;
    const struct mesh_sparse sparse = {.per_m2 = 20, .seed = 3};
    double area_m2 = 0;
    begin(0);
    free(from.rgb);
    from.rgb = NULL;
    for (uint32_t k = 1; k <= 2; k++) {
        const struct mesh_sparse_part one = {face, 1, 1, k};
        assert_int_equal(mesh_sparse_add(&sparse, &from, &one, &to, &area_m2, &err), SH_OK);
        assert_int_equal(to.n, 10 * k);
    }
    assert_memory_equal(to.rgb, ((uint8_t[20][3]){{0}}), sizeof(uint8_t[20][3]));
    assert_memory_not_equal(to.xyz_m, to.xyz_m + 10, 10 * sizeof *to.xyz_m); /* the scan decides the places */
    end();
}

static double told; /* the fraction that was told last */
static int n_told;

static void tell(void *ctx, const char *what, double fraction)
{
    (void)ctx;
    assert_string_equal(what, "spreading points over the mesh");
    assert_true(fraction > told && fraction < 1);
    told = fraction;
    n_told++;
}

static int stop_at_second(void *ctx)
{
    (void)ctx;
    return n_told >= 2;
}

/* Many points can be stopped, and their progress is told: at least each 100,000 points. */
static void many_points_can_be_stopped(void **state)
{
    (void)state;
    const struct sh_report report = {.progress = tell, .stop = stop_at_second};
    const struct mesh_sparse sparse = {.per_m2 = 800000, .seed = 3, .report = &report};
    double area_m2 = 0;
    told = n_told = 0;
    begin(0);
    assert_int_equal(mesh_sparse_add(&sparse, &from, &part, &to, &area_m2, &err), SH_ESTOPPED);
    assert_true(n_told == 2 && told > 0.25 && to.n <= 200000); /* of 400,000 */
    assert_true(fabs(told - to.n / 400000.0) < 1e-5);
    end();
}

/* The limit is that of the file, of all parts together. */
static void points_beyond_the_file(void **state)
{
    (void)state;
    const struct mesh_sparse sparse = {.per_m2 = 200};
    double area_m2 = 7;
    begin(0);
    to.n = INT32_MAX - 99;
    assert_int_equal(mesh_sparse_add(&sparse, &from, &part, &to, &area_m2, &err), SH_EINPUT);
    assert_non_null(
        strstr(err.text, "--sparse 200: 7.5 m2 of mesh would get 2.147e+09 points; a file holds 2147483647: give"));
    end();
}

/* More points than the memory holds are refused before they are made. The figure of the message is allowed, and the
 * next one of three digits isn't. A point takes 110 bytes. */
static void points_beyond_the_memory(void **state)
{
    (void)state;
    const double held = (double)sysconf(_SC_PHYS_PAGES) * (double)sysconf(_SC_PAGESIZE) / 110;
    const struct mesh_sparse sparse = {.per_m2 = rint(3 * held)};
    double area_m2 = 0, n, has, most;
    if (1.5 * held > MESH_MAX_VERTICES) skip();
    begin(0);
    assert_int_equal(mesh_sparse_add(&sparse, &from, &part, &to, &area_m2, &err), SH_EINPUT);
    assert_int_equal(to.n, 0);
    const char *at = strstr(err.text, ": 0.5 m2 of mesh would get ");
    assert_non_null(at);
    assert_int_equal(
        sscanf(at, ": 0.5 m2 of mesh would get %lf points; there is memory for %lf: give at most %lf", &n, &has, &most),
        3);
    assert_true(fabs(n / (1.5 * held) - 1) < 1e-3 && fabs(has / held - 1) < 1e-2);
    assert_true(most * 0.5 <= held && most * 0.5 * 1.0101 > held);
    end();
}

/* Coordinates of a broken stream may be so far apart that the area is infinite. */
static void an_infinite_area(void **state)
{
    (void)state;
    const struct mesh_sparse sparse = {.per_m2 = 2.5};
    double area_m2 = 0;
    begin(0);
    from.xyz_m[1][0] = from.xyz_m[2][1] = 1e200;
    assert_int_equal(mesh_sparse_add(&sparse, &from, &part, &to, &area_m2, &err), SH_EINPUT);
    assert_string_equal(err.text, "--sparse 2.5: the mesh has an area of inf m2");
    end();
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(figures_are_linear),         cmocka_unit_test(parts_without_colours),
        cmocka_unit_test(many_points_can_be_stopped), cmocka_unit_test(points_beyond_the_memory),
        cmocka_unit_test(points_beyond_the_file),     cmocka_unit_test(an_infinite_area),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
