/* SPDX-License-Identifier: MIT */
/* Which scans a format can hold, before they are made: at each limit, and one beyond it. */
#include "core/studio/mesh.h"
#include "tests/unit/recorder_rig.h"

static const struct recorder_options no_options;

/* "" where the format can hold the scan. */
static const char *refusal_of(const char *path, const struct recorder_options *options,
                              const struct recorder_scan *first, const struct recorder_scan *scan)
{
    static struct sh_err err;
    struct recorder_options shaped = *options;
    err = (struct sh_err){0};
    const struct recorder_ops *ops = recorder_find(path, &err);
    assert_non_null(ops);
    ops = recorder_shape(ops, &shaped);
    const int rc = ops->fits(path, &shaped, first, scan, &err);
    assert_int_equal(rc, err.text[0] == '\0' ? SH_OK : SH_EINPUT);
    return err.text;
}

/* 2^31 - 1 steps of 1 mm are 2147483.647 m; a station may be farther by the head's range. */
static void test_las(void **state)
{
    (void)state;
    static const struct recorder_scan first = {.station = 3, .scale_m = 1e-3, .place_m = {10, 20, 30}};
    for (int k = 0; k < 3; k++)
        for (int sign = -1; sign <= 1; sign += 2)
            for (int beyond = 0; beyond < 2; beyond++) {
                struct recorder_scan scan = {.station = 4, .scale_m = 10, .range_max_m = 100, .place_m = {10, 20, 30}};
                scan.place_m[k] += sign * (2147583.5 + beyond);
                assert_string_equal(refusal_of("a.las", &no_options, &first, &scan),
                                    !beyond ? ""
                                            : "a.las: the station is 2147584 m from station 3, and LAS holds 2147484 m "
                                              "in steps of 0.001 m: give the head a coarser output.scale_m, or each "
                                              "station its own file (--split)");
                scan.moves = 1;
                assert_string_equal(refusal_of("a.las", &no_options, &first, &scan), "");
                scan.moves = 0;
                scan.in_degrees = 1;
                assert_string_equal(refusal_of("a.las", &no_options, &first, &scan), "");
            }
}

/* A float has 24 bits: 1001 m are wrong by up to 1001 / 2^24 m. */
static void test_ply(void **state)
{
    (void)state;
    static const struct recorder_options floats = {.columns = PLY_XYZ | PLY_FLOAT};
    static const char far[] = "a.ply: coordinates of 1001 m as float would be wrong by up to 6e-05 m; leave out float, "
                              "which is allowed for stations within 1000 m of the origin";
    for (int k = 0; k < 3; k++)
        for (int sign = -1; sign <= 1; sign += 2) {
            struct recorder_scan scan = {.place_m = {1, 2, 3}};
            scan.place_m[k] = sign * 1000;
            assert_string_equal(refusal_of("a.ply", &floats, &scan, &scan), "");
            scan.place_m[k] = sign * 1001;
            assert_string_equal(refusal_of("a.ply", &floats, &scan, &scan), far);
            assert_string_equal(refusal_of("a.ply", &no_options, &scan, &scan), "");
            scan.moves = 1; /* its places are checked as they come, unless they count from the anchor */
            assert_string_equal(refusal_of("a.ply", &floats, &scan, &scan), "");
            scan.is_geo = 1;
            assert_string_equal(refusal_of("a.ply", &floats, &scan, &scan), far);
        }
    const struct recorder_scan degrees = {.in_degrees = 1};
    assert_string_equal(refusal_of("a.ply", &floats, &degrees, &degrees),
                        "a.ply: degrees as float would be wrong by metres; leave out float");
    assert_string_equal(refusal_of("a.ply", &no_options, &degrees, &degrees), "");
}

/* Indices are int. The points of a mesh stay in memory, with three doubles each at least. */
static void test_mesh(void **state)
{
    (void)state;
    const double there = (double)sysconf(_SC_PHYS_PAGES) * (double)sysconf(_SC_PAGESIZE);
    static const char *const paths[] = {"a.obj", "a.fbx"};
    for (size_t i = 0; i < 2; i++) {
        char want[300];
        struct recorder_scan scan = {.n_shots = INFINITY};
        assert_string_equal(refusal_of(paths[i], &no_options, &scan, &scan), ""); /* it is seen as the points come */
        scan.n_shots = 1000;
        assert_string_equal(refusal_of(paths[i], &no_options, &scan, &scan), "");
        scan.n_shots = MESH_MAX_VERTICES + 1.0;
        assert_string_equal(refusal_of(paths[i], &no_options, &scan, &scan),
                            i == 0 ? "a.obj: up to 2147483648 points; a mesh holds up to 2147483647: scan fewer "
                                     "stations, more coarsely, or with --split"
                                   : "a.fbx: up to 2147483648 points; a mesh holds up to 2147483647: scan fewer "
                                     "stations, more coarsely, or with --split");
        scan.n_shots = floor(fmin(there / 24, MESH_MAX_VERTICES));
        if (scan.n_shots * 24 < 0.9 * there) continue; /* this machine has room for any mesh */
        snprintf(want, sizeof want, "%s: a mesh of up to %.0f points takes ", paths[i], scan.n_shots);
        const char *text = refusal_of(paths[i], &no_options, &scan, &scan);
        assert_int_equal(strncmp(text, want, strlen(want)), 0);
        assert_true(strtod(text + strlen(want), NULL) >= there / 0x1p30 - 0.05); /* it is rounded to 0.1 */
        snprintf(want, sizeof want, " GiB of memory, and this machine has %.1f GiB: scan fewer stations",
                 there / 0x1p30);
        assert_non_null(strstr(text, want));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_las), cmocka_unit_test(test_ply),
                                       cmocka_unit_test(test_mesh)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
