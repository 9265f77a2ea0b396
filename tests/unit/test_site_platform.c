/* SPDX-License-Identifier: MIT */
/* Carriers of a head: each error and warning with its numbers and limits, and the stops of a head at its stations. */
#include "tests/unit/site_rig.h"

#include <limits.h>
#include <math.h>

static struct site *site;

/* Loads a site with these sections. The test has written path.csv or way.csv before. */
static int load_at(const char *stations, const char *platform, const char *head)
{
    char text[1024];
    site_free(site);
    site = NULL;
    write_in("room.obj", "v -50 -50 0\nv 50 -50 0\nv 50 50 0\nv -50 50 0\nf 1 2 3 4\n");
    snprintf(text, sizeof text,
             "head: {profile: full-sweep%s}\nscene: {meshes: [{file: room.obj, up: z, scale: 1}]}\ncast: {sight: off}\n"
             "stations: [%s]\nplatform: {%s}\n",
             head, stations, platform);
    write_in("test.yaml", text);
    clear_warned();
    if (config_load(config_path, NULL, 0, cfg, &err) != SH_OK) fail_msg("%s", err.text);
    return site_load(cfg, &report, &site, &err);
}

#define ONE   "{name: one, position_m: [0, 0, 2]}"
#define TWO   ONE ", {name: two, position_m: [3, 4, 2]}"
#define LINES "t_s,x_m,y_m,z_m,heading_deg,frame\n"
/* 2.4 m to the east in 1.2 s */
#define WAY LINES "5,0,0,2,0,100\n6.2,2.4,0,2,0,112\n"

static void refuse(const char *stations, const char *platform, const char *head, const char *says)
{
    assert_int_equal(load_at(stations, platform, head), SH_EINPUT);
    const size_t n = strlen(config_path);
    if (strncmp(err.text, config_path, n) != 0 || strcmp(err.text + n, says) != 0)
        fail_msg("%s: %s", platform, err.text);
}

static void take(const char *stations, const char *platform)
{
    if (load_at(stations, platform, "") != SH_OK) fail_msg("%s: %s", platform, err.text);
}

static void a_part_lies_on_the_trajectory(void **state)
{
    (void)state;
    write_in("path.csv", WAY);
#define GOES  "kind: trajectory, file: path.csv"
#define STOPS "kind: stops, file: path.csv"
    refuse(ONE, GOES ", start_s: 1.2", "",
           ": platform.start_s: 1.2 s is not before the trajectory's end; allowed 0 to below 1.2");
    refuse(ONE, GOES ", end_s: 1.3", "", ": platform.end_s: 1.3 s is after the trajectory's end; allowed 0 to 1.2");
    refuse(ONE, GOES ", start_s: 0.5, end_s: 1.3", "",
           ": platform.end_s: 1.3 s is after the trajectory's end; allowed 0.5 to 1.2");
    refuse(ONE, GOES ", start_s: 1.3, at_end: hold", "",
           ": platform.start_s: 1.3 s is after the trajectory's end; allowed 0 to 1.2");
    refuse(ONE, STOPS ", step_s: 0.1, start_s: 1.3", "",
           ": platform.start_s: 1.3 s is after the trajectory's end; allowed 0 to 1.2");
    refuse(ONE, STOPS ", frames_per_s: 10, first_frame: 13", "",
           ": platform.first_frame: 13 frames is after the trajectory's end; allowed 0 to 12");
    refuse(ONE, STOPS ", frames_per_s: 10, first_frame: 3, last_frame: 14", "",
           ": platform.last_frame: 14 frames is after the trajectory's end; allowed 3 to 12");
    write_in("pose.csv", "t_s,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg\n0,1,0,2,0,0,0\n");
    refuse(ONE, "kind: trajectory, file: pose.csv", "",
           ": platform.kind trajectory: the trajectory has one pose, and the scan would end with it; allowed two poses "
           "and more, or at_end: hold");
    take(ONE, "kind: trajectory, file: pose.csv, at_end: hold");
    take(ONE, "kind: stops, file: pose.csv, step_s: 0.1");
    take(ONE, GOES ", start_s: 1.1999, end_s: 1.2");
    take(ONE, GOES ", start_s: 1.2, at_end: hold");
    take(ONE, STOPS ", step_s: 0.1, start_s: 1.2");
    take(ONE, STOPS ", frames_per_s: 10, first_frame: 12, last_frame: 12");
}

static void a_path_has_limits(void **state)
{
    (void)state;
    /* There is a pose every 10 ms, one more at the interval's end, and one more at the start. */
    write_in("path.csv", LINES "0,0,0,2,0,0\n101000,1e9,0,2,0,1\n");
    refuse(ONE, GOES ", start_s: 0.25", "",
           ": platform.file: the trajectory needs up to 10100002 poses from 0.25 s on; allowed 10000000");
    /* At 1 km/s poses are 10 m apart, so that a stretch is between 1990 and 2000 m long. */
    write_in("path.csv", LINES "0,0,0,2,0,0\n2050,2050000,0,2,0,1\n");
    refuse(ONE, GOES, "", ": platform: the path is too long; allowed 1024 stretches of 2000 m across");
    write_in("path.csv", LINES "0,0,0,2,0,0\n2030,2030000,0,2,0,1\n");
    take(ONE, GOES);
    assert_in_range(site->n_stretches, 1015, 1021); /* 2030 km by 2000 m, and by 1990 m */
    assert_null(strstr(warned, "bends"));
    /* 0.35 rad in 0.35 ms, with the head 0.5 m away: in 3 parts, each of 0.35^2 * 0.5 m / 8 / 9. */
    write_in("path.csv", LINES "0,0,0,2,0,0\n0.00035,0,0,2,20.053522829578813,1\n");
    take(ONE, GOES ", mount_m: [0.3, 0.4, 0]");
    assert_true(fabs(site->knot_error_m - 0.35 * 0.35 * 0.5 / 72) < 1e-12);
    assert_non_null(strstr(warned, "the trajectory bends more than poses 0.1 ms apart can follow: the head deviates "
                                   "from it by up to 0.00085 m\n"));
}

static void stops_have_limits(void **state)
{
    (void)state;
    write_in("path.csv", WAY);
    refuse(ONE, STOPS ", step_s: 0.0001", "",
           ": platform.step_s: 12001 stops in 1.2 s; allowed at most 4096, steps of 0.000293040293 s");
    take(ONE, STOPS ", step_s: 0.000293040294"); /* rounded up, so one fewer */
    assert_int_equal(site->n_stations, 4095);
    refuse(ONE, STOPS ", frames_per_s: 10, frame_step: 0.001", "",
           ": platform.frame_step: 12001 stops in 12 frames; allowed at most 4096, steps of 0.00293040293 frames");
    refuse(TWO, "kind: stops, step_s: 0.0005, end_s: 1.2", "",
           ": platform.step_s: 2401 stops at 2 stations in 1.2 s; allowed at most 4096 in all");
    refuse(TWO, "kind: stops, step_s: 0.001, end_s: 2.048", "",
           ": platform.step_s: 2049 stops at 2 stations in 2.048 s; allowed at most 4096 in all");
    take(TWO, "kind: stops, step_s: 0.001, end_s: 2.047");
    assert_int_equal(site->n_stations, 4096);
    refuse(ONE, STOPS ", step_s: 0.3", ", station: 6", ": head.station: there is no stop 6; allowed 1 to 5");
    assert_int_equal(load_at(ONE, STOPS ", step_s: 0.3", ", station: 5"), SH_OK);
}

/* The number of stations is known before the scene is loaded. */
static void stations_are_counted(void **state)
{
    (void)state;
    static const struct {
        const char *stations, *platform;
        uint32_t n;
    } is[] = {{ONE, "kind: static", 1},
              {TWO, "kind: static", 2},
              {ONE, STOPS ", step_s: 0.3", 5},
              {TWO, "kind: stops, step_s: 0.3, end_s: 1.2", 10}};
    write_in("path.csv", WAY);
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++) {
        uint32_t n = 0;
        take(is[i].stations, is[i].platform);
        assert_int_equal(site_count_stations(cfg, &report, &n, &err), SH_OK);
        assert_true(n == is[i].n && site->n_stations == n);
    }
    uint32_t n;
    refuse(ONE, STOPS ", step_s: 0.3, start_s: 2", "",
           ": platform.start_s: 2 s is after the trajectory's end; allowed 0 to 1.2");
    assert_int_equal(site_count_stations(cfg, &report, &n, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "platform.start_s: 2 s"));
    refuse(ONE, STOPS ", step_s: 0.00001", "",
           ": platform.step_s: 120001 stops in 1.2 s; allowed at most 4096, steps of 0.000293040293 s");
    assert_int_equal(site_count_stations(cfg, &report, &n, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "platform.step_s: 120001 stops"));
}

/* ---- times and names */

static void expect_stop(uint32_t i, const char *name, double t_s, double frame, double x_m, double y_m)
{
    const struct site_station *s = &site->station[i];
    assert_string_equal(s->station->name, name);
    if (!(fabs(s->t_s - t_s) < 1e-12 && fabs(s->frame - frame) < 1e-9))
        fail_msg("%s: %.9g s, frame %.9g", name, s->t_s, s->frame);
    assert_true(fabs(s->at.position_m[0] - x_m) < 1e-9 && fabs(s->at.position_m[1] - y_m) < 1e-9);
}

/* All stations have their turn at the first time, then at the second. Without frames the times are numbered. */
static void stops_at_stations(void **state)
{
    (void)state;
    take(TWO, "kind: stops, start_s: 1, step_s: 2, end_s: 3");
    assert_int_equal(site->n_stations, 4);
    expect_stop(0, "one frame 1", 1, 1, 0, 0);
    expect_stop(1, "two frame 1", 1, 1, 3, 4);
    expect_stop(2, "one frame 2", 3, 2, 0, 0);
    expect_stop(3, "two frame 2", 3, 2, 3, 4);
    const struct config_station *two = site->station[3].station; /* a stop is a station with a name of its own */
    assert_true(two->has_position && two->position_m[0] == 3 && two->position_m[1] == 4);
    take(TWO, "kind: stops, frames_per_s: 10, first_frame: 5, last_frame: 25, frame_step: 10");
    assert_int_equal(site->n_stations, 6);
    expect_stop(1, "two frame 5", 0.5, 5, 3, 4);
    expect_stop(2, "one frame 15", 1.5, 15, 0, 0);
    expect_stop(5, "two frame 25", 2.5, 25, 3, 4);
}

/* Names of stops are as different as those of their stations: a name of the longest kind (31 bytes) is kept whole, and
 * so is a character of several bytes. A frame has as many digits as tell it from the next. */
static void names_of_stops_are_whole(void **state)
{
    (void)state;
#define LONGEST "Eingang\xc3\xa4-Nord-0123456789ab-\xe2\x82\xac" /* 31 bytes */
    _Static_assert(sizeof LONGEST == CONFIG_NAME_LEN, "the longest name of a station");
    static const char stations[] = "{name: entrance-north, position_m: [0, 0, 2]}, {name: entrance-south, position_m: "
                                   "[3, 4, 2]}, {name: " LONGEST ", position_m: [3, 5, 2]}";
    take(stations, "kind: stops, step_s: 1, end_s: 0");
    assert_int_equal(site->n_stations, 3);
    expect_stop(0, "entrance-north frame 1", 0, 1, 0, 0);
    expect_stop(1, "entrance-south frame 1", 0, 1, 3, 4);
    expect_stop(2, LONGEST " frame 1", 0, 1, 3, 5);
    take(ONE, "kind: stops, frames_per_s: 1, first_frame: 123456789, last_frame: 123456789.5, frame_step: 0.25");
    assert_int_equal(site->n_stations, 3);
    expect_stop(0, "one frame 123456789", 123456789, 123456789, 0, 0);
    expect_stop(1, "one frame 123456789.2", 123456789.25, 123456789.25, 0, 0);
    expect_stop(2, "one frame 123456789.5", 123456789.5, 123456789.5, 0, 0);
    /* With nine digits 123456789.5 and 123456790.5 are both rounded to the even number. */
    take(ONE, "kind: stops, frames_per_s: 1, first_frame: 123456789.5, last_frame: 123456790.5, frame_step: 1");
    expect_stop(0, "one frame 123456789.5", 123456789.5, 123456789.5, 0, 0);
    expect_stop(1, "one frame 123456790.5", 123456790.5, 123456790.5, 0, 0);
}

/* Along a trajectory the frame is the file's, or counted where the configuration counts in frames. */
static void stops_on_a_path(void **state)
{
    (void)state;
    write_in("path.csv", WAY);
    take(ONE, STOPS ", start_s: 0.3, step_s: 0.4");
    assert_int_equal(site->n_stations, 3);
    for (uint32_t i = 0; i < 3; i++) {
        char name[16];
        snprintf(name, sizeof name, "stop-%u", i + 1);
        expect_stop(i, name, 0.3 + 0.4 * i, 103 + 4 * i, 0.6 + 0.8 * i, 0);
    }
    take(ONE, STOPS ", frames_per_s: 20, first_frame: 4, last_frame: 20, frame_step: 8");
    assert_int_equal(site->n_stations, 3);
    expect_stop(0, "stop-1", 0.2, 4, 0.4, 0);
    expect_stop(2, "stop-3", 1.0, 20, 2.0, 0);
    assert_false(site->station[2].at.on_earth);
}

/* The only station anchors the scene, so that stops have places on the Earth. At 48 degrees of latitude the radius of
 * a parallel is 4279 km. */
static void stops_on_the_earth(void **state)
{
    (void)state;
    write_in("path.csv", WAY);
    take("{name: one, position_m: [0, 0, 2], lat_deg: 48, lon_deg: 11, height_m: 300}", STOPS ", step_s: 1.2");
    assert_int_equal(site->n_stations, 2);
    for (uint32_t i = 0; i < 2; i++) {
        const struct placement *at = &site->station[i].at;
        assert_true(at->on_earth && isnan(at->floor_m));
        assert_true(fabs(at->place.lat_deg - 48) < 1e-8 && fabs(at->place.height_m - 300) < 1e-5);
        const double east_deg = 2.4 * i / 4279e3 * 180 / M_PI;
        assert_true(fabs(at->place.lon_deg - 11 - east_deg) < 1e-3 * east_deg + 1e-12);
    }
}

/* A live platform stays within its reach of the station that it is at. So counts need not reach from one station to
 * another. The head's mount adds 5 m. */
static void a_live_head_reaches_around_its_station(void **state)
{
    (void)state;
    take(TWO ", {name: three, position_m: [-12, 0, 7]}", "kind: live, reach_m: 30, mount_m: [0, 3, 4]");
    assert_int_equal(site->n_stretches, 1);
    assert_true(site->stretch[0].reach_m == 35 && site->live_reach_m == 35);
}

static int stop_at(void *ctx)
{
    int *left = ctx;
    return (*left)-- <= 0;
}

/* A path of 30 km has more than 10 stretches, and each asks whether to stop. The rest of this site asks fewer times. */
static void stretches_can_be_stopped(void **state)
{
    (void)state;
    static const char *const GEO = "}\noutput: {layout: geo";
    int left = INT_MAX;
    const struct sh_report stopping = {.ctx = &left, .stop = stop_at};
    write_in("path.csv", LINES "0,0,0,2,0,0\n30,30000,0,2,0,1\n");
    for (int k = 0; k < 2; k++) {
        const char *const other =
            k == 0 ? TWO : ONE ", {name: two, position_m: [3, 4, 2], scanner: {head: {profile: velodyne-vlp16}}}";
        assert_int_equal(load_at(other, GOES, GEO), SH_OK);
        assert_true(site->n_stretches > 10 && site->station[0].on_stretch != NULL);
        assert_int_equal(site->station[1].on_stretch != NULL, k == 0); /* another scanner has its own site */
    }
    struct site *again = NULL;
    assert_int_equal(site_load(cfg, &stopping, &again, &err), SH_OK);
    const int n_asked = INT_MAX - left;
    site_free(again);
    again = NULL;
    assert_true(n_asked > 10);
    left = n_asked - 1;
    assert_int_equal(site_load(cfg, &stopping, &again, &err), SH_ESTOPPED);
    site_free(again);
}

static int teardown(void **state)
{
    site_free(site);
    return site_rig_teardown(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_part_lies_on_the_trajectory),
        cmocka_unit_test(a_path_has_limits),
        cmocka_unit_test(stops_have_limits),
        cmocka_unit_test(stations_are_counted),
        cmocka_unit_test(stops_at_stations),
        cmocka_unit_test(names_of_stops_are_whole),
        cmocka_unit_test(stops_on_a_path),
        cmocka_unit_test(stops_on_the_earth),
        cmocka_unit_test(a_live_head_reaches_around_its_station),
        cmocka_unit_test(stretches_can_be_stopped),
    };
    return cmocka_run_group_tests_name("platform of a site", tests, site_rig_setup, teardown);
}
