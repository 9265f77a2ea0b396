/* SPDX-License-Identifier: MIT */
/* Configurations that can't be recorded are refused before the first scan: one line, status 2, no file. Where a
 * case has three stations, the error is mostly at the last one, and the earlier ones could be scanned. */
#include "tests/wire/room.h"
#include "tests/wire/usage_rig.h"

static const char LAST[] = "stations:\n  - {position_m: [0.31, -0.42, 0.17]}\n  - {position_m: [1.25, 0.5, 0.25]}\n"
                           "  - {position_m: [1, -0.5, 0.25], scanner: {head: {%s}}}\n";
static const char ON_EARTH[] = "  anchor: {source: explicit, lat_deg: 52, lon_deg: 13, height_m: 100}\n"
                               "output: {layout: geo, crs: %s}\nstations:\n  - {position_m: [0.31, -0.42, 0.17]}\n"
                               "  - {position_m: [1.25, 0.5, 0.25]}\n";
static const char FAR[] = "stations:\n  - {position_m: [0.31, -0.42, 0.17]}\n  - {position_m: [1.25, 0.5, 0.25]}\n"
                          "  - {position_m: [%s]}\n";
static const char MOVING[] = "stations: [{position_m: [0, 0, 0]}]\nplatform: {kind: trajectory, file: ride.csv}\n%s";

enum { MOST = 12 };

static void expect_refused(struct wire *wire, const char *stations, const char *in_them, const char *const *more,
                           const char *says)
{
    char text[1024], config[128], path[2][128], what[128] = "";
    const char *args[MOST] = {"record", config, "--quiet"};
    int n = 3, n_paths = 0, head;
    wire_empty(wire);
    room_write(wire);
    wire_write_text(wire, "ride.csv",
                    "t_s,x_m,y_m,z_m,heading_deg,pitch_deg,roll_deg\n0,0,0,0,0,0,0\n1,1,0,0,0,0,0\n2,2,0,0,0,0,0\n");
    head = snprintf(text, sizeof text,
                    "head: {profile: sphere, step_deg: 10}\nscene:\n  meshes: [{file: room.obj, up: z, scale: 1}]\n");
    snprintf(text + head, sizeof text - (size_t)head, stations, in_them);
    snprintf(config, sizeof config, "%s", wire_write_text(wire, "config.yaml", text));
    for (int i = 0; more[i] != NULL; i++) {
        args[n] = more[i];
        if (i > 0 && strcmp(more[i - 1], "-o") == 0) {
            snprintf(path[n_paths], sizeof path[0], "%s", wire_path(wire, more[i]));
            args[n] = path[n_paths++];
        }
        n++;
        strncat(what, more[i], sizeof what - strlen(what) - 2);
        strcat(what, " ");
    }
    usage_expect(wire, what, args, 2, (const char *const[]){says, NULL});
}

#define ALL(...) ((const char *const[]){"--station", "all", __VA_ARGS__, NULL})

static void a_scanner_whose_lines_are_all_one(void **state)
{
    static const char circle[] = "profile: sphere, step_deg: 10, ring_start_deg: 0, ring_stop_deg: 0",
                      still[] = "profile: full-sweep, prr_hz: 10000, lines_hz: 50, pan_deg_s: 0, frames: 1";
    static const char *const mesh[] = {"a.obj", "a.gltf", "a.glb", "a.fbx"};
    const char *const heads[] = {circle, still};
    usage_complaints = 0;
    for (int h = 0; h < 2; h++) {
        for (int i = 0; i < 4; i++)
            expect_refused(*state, LAST, heads[h], ALL("-o", mesh[i]), "a mesh needs a surface");
        expect_refused(*state, LAST, heads[h], ALL("-o", "a.ply", "--mesh"), "a mesh needs a surface");
        expect_refused(*state, LAST, heads[h], ALL("-o", "a.ply", "--sparse", "10"), "a mesh needs a surface");
        expect_refused(*state, LAST, heads[h], ALL("-o", "a.obj", "--split"), "a mesh needs a surface");
    }
    assert_int_equal(usage_complaints, 0);
}

static void a_station_too_far_for_floats(void **state)
{
    usage_complaints = 0;
    expect_refused(*state, FAR, "2000, 0, 0", ALL("-o", "a.ply", "--ply-columns", "float"), "of 2000 m as float");
    expect_refused(*state, FAR, "30000000, 0, 0", ALL("-o", "a.glb"), "station 3");
    expect_refused(*state, FAR, "30000000, 0, 0", ALL("-o", "a.fbx", "--split"), "station 3");
    assert_int_equal(usage_complaints, 0);
}

static void coordinates_of_the_earth_as_float(void **state)
{
    usage_complaints = 0;
    expect_refused(*state, ON_EARTH, "utm", ALL("-o", "a.ply", "--ply-columns", "float"), "as float");
    expect_refused(*state, ON_EARTH, "geodetic", ALL("-o", "a.ply", "--ply-columns", "float"), "degrees as float");
    assert_int_equal(usage_complaints, 0);
}

/* 2^31 steps of a micrometre are 2147 m; the scanner's range is 1000 m. */
static void a_station_beyond_the_numbers_of_las(void **state)
{
    usage_complaints = 0;
    expect_refused(*state, FAR, "3200, 0, 0", ALL("-o", "a.las", "--set", "output.scale_m=1e-6"), "from station 1");
    assert_int_equal(usage_complaints, 0);
}

/* These are 5.8 * 10^9 shots, more than a mesh may have vertices (MESH_MAX_VERTICES). */
static void a_scan_of_too_many_points(void **state)
{
    usage_complaints = 0;
    expect_refused(*state, LAST, "profile: sphere, step_deg: 0.01, frames: 9", ALL("-o", "a.glb"), "station 3");
    assert_int_equal(usage_complaints, 0);
}

static void colours_that_points_do_not_say(void **state)
{
    usage_complaints = 0;
    expect_refused(*state, MOVING, "", ALL("-o", "a.ply", "--colour", "range", "--crs", "local"), "--colour range");
    assert_int_equal(usage_complaints, 0);
}

/* A station's number is checked before anything is looked up by it. */
static void a_station_that_is_not_there(void **state)
{
    static const char *const fourth[] = {"--station", "4", "-o", "a.ply", NULL};
    usage_complaints = 0;
    expect_refused(*state, FAR, "0, 0, 0", fourth, "there is no station 4; allowed 1 to 3");
    expect_refused(*state, LAST, "step_deg: 20", fourth, "there is no station 4; allowed 1 to 3");
    expect_refused(*state, MOVING, "", fourth, "there is no station 4; allowed 1 to 1");
    assert_int_equal(usage_complaints, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_station_that_is_not_there),         cmocka_unit_test(a_scanner_whose_lines_are_all_one),
        cmocka_unit_test(a_station_too_far_for_floats),        cmocka_unit_test(coordinates_of_the_earth_as_float),
        cmocka_unit_test(a_station_beyond_the_numbers_of_las), cmocka_unit_test(a_scan_of_too_many_points),
        cmocka_unit_test(colours_that_points_do_not_say),
    };
    return cmocka_run_group_tests(tests, wire_setup, wire_teardown);
}
