/* SPDX-License-Identifier: MIT */
/* Points spread over a mesh: their figures between the corners, progress and stops. And a mesh's note on flat triangles. */
#include "drivers/record/mesh_sparse.h"
#include "tests/unit/recorder_rig.h"

enum { AT_ONCE = 1 << 16 }; /* points between two questions whether to stop */

static const uint32_t face[1][3] = {{0, 1, 2}};
static const struct mesh_sparse_part part = {face, 1, 1, 1};

/* A right-angled triangle of 0.5 m2 in the plane z = 0, whose corners differ in all figures. */
static struct mesh_points triangle(int has_frame)
{
    static const double corner[3][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    struct mesh_points points = {.has_frame = has_frame};
    struct sh_err err;
    for (int k = 0; k < 3; k++) {
        struct mesh_point p = {.range_m = 10 + 2 * k,
                               .frame = 100 - 5 * k,
                               .reflectance_db = (float)(-3 * k),
                               .station = (uint16_t)(k + 1),
                               .rgb = {(uint8_t)(100 * k), (uint8_t)(200 - 100 * k), 7}};
        memcpy(p.xyz_m, corner[k], sizeof p.xyz_m);
        assert_int_equal(mesh_points_add(&points, &p, &err), SH_OK);
    }
    return points;
}

/* The weights of the second and the third corner are x and y. */
static void figures_lie_between_the_corners(void **state)
{
    (void)state;
    const struct mesh_sparse sparse = {.per_m2 = 400, .seed = 3};
    struct mesh_points from = triangle(1), to = {.has_frame = 1};
    struct sh_err err = {0};
    double area_m2 = 2;
    assert_int_equal(mesh_sparse_add(&sparse, &from, &part, &to, &area_m2, &err), SH_OK);
    assert_int_equal(to.n, 200);
    assert_true(fabs(area_m2 - 2.5) < 1e-12);
    for (uint32_t i = 0; i < to.n; i++) {
        const double x = to.xyz_m[i][0], y = to.xyz_m[i][1], rest = 1 - x - y;
        assert_true(x >= 0 && y >= 0 && rest >= -1e-15 && to.xyz_m[i][2] == 0);
        assert_true(fabs(to.range_m[i] - (10 + 2 * x + 4 * y)) < 1e-12);
        assert_true(fabs(to.frame[i] - (100 - 5 * x - 10 * y)) < 1e-12);
        assert_true(fabs((double)to.reflectance_db[i] - (-3 * x - 6 * y)) < 1e-6);
        assert_int_equal(to.station[i], x > y && x > rest ? 2 : y > rest ? 3 : 1);
        assert_true(fabs(to.rgb[i][0] - (100 * x + 200 * y)) <= 0.5 + 1e-9);
        assert_true(fabs(to.rgb[i][1] - (200 * rest + 100 * x)) <= 0.5 + 1e-9);
        assert_int_equal(to.rgb[i][2], 7);
    }
    mesh_points_free(&from);
    mesh_points_free(&to);
}

static int asked, shown;
static double share;

static int stop_at_once(void *ctx)
{
    (void)ctx;
    asked++;
    return 1;
}

static void show(void *ctx, const char *what, double fraction)
{
    (void)ctx;
    assert_string_equal(what, "spreading points over the mesh");
    share = fraction;
    shown++;
}

/* A half of a square metre with one point fewer than are made at once goes through, and with one more it does not. */
static void the_work_can_be_stopped(void **state)
{
    (void)state;
    static const struct sh_report report = {.stop = stop_at_once, .progress = show};
    for (uint32_t more = 0; more < 2; more++) {
        const uint32_t n = AT_ONCE - 1 + 2 * more;
        const struct mesh_sparse sparse = {.per_m2 = 2.0 * n, .report = &report};
        struct mesh_points from = triangle(0), to = {0};
        struct sh_err err = {0};
        double area_m2 = 0;
        asked = shown = 0;
        assert_int_equal(mesh_sparse_add(&sparse, &from, &part, &to, &area_m2, &err), more ? SH_ESTOPPED : SH_OK);
        assert_int_equal(to.n, AT_ONCE - 1);
        assert_int_equal(asked, more);
        assert_int_equal(shown, more);
        if (more) assert_true(share == (AT_ONCE - 1.0) / n);
        mesh_points_free(&from);
        mesh_points_free(&to);
    }
}

/* Of the first line's four shots two are at one place, and so are two of the second line. One of the three cells has
 * an edge of no length on either side: its two triangles have no area. */
static void flat_triangles_are_noted(void **state)
{
    (void)state;
    const struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 1);
    const struct native_descriptor d = {.idn = "Maker,Model,SN1,1.0",
                                        .profile = "model",
                                        .scan = 1,
                                        .layout = NATIVE_GEO,
                                        .prr_uhz = 1000000000,
                                        .lines_uhz = 1000000,
                                        .pan_udeg_s = 36000000,
                                        .pan_stop_udeg = 360000000,
                                        .sweep_udeg = 360000000,
                                        .line_stop_udeg = 36000000,
                                        .range_max_m = 100,
                                        .frames = 1,
                                        .mirror_counts_per_turn = 3600,
                                        .pan_counts_per_turn = 3600,
                                        .range_scale_m = 1e-3};
    static uint8_t out[1024];
    struct rig_point p[2][4];
    rig_begin();
    rig_put(out, native_encode_descriptor(out, sizeof out, &d, 0, 0));
    rig_anchor(&a);
    for (uint32_t line = 0; line < 2; line++) {
        for (int k = 0; k < 4; k++)
            p[line][k] = (struct rig_point){1000 * (int32_t)line, 5000, 1000 * (k - (k > 1)), -500, 0, 1, 1};
        rig_points(line, 1000 * line, 1000 * line, p[line], 4);
    }
    free(rig_record_bytes("a.ply", (struct recorder_options){.mesh = 1}, NULL));
    assert_non_null(strstr(rig_notes, "2 triangles left out that have no area or are seen edge-on"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(figures_lie_between_the_corners),
        cmocka_unit_test(the_work_can_be_stopped),
        cmocka_unit_test(flat_triangles_are_noted),
    };
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
