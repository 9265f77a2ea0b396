/* SPDX-License-Identifier: MIT */
/* Stops of a head along a trajectory: their number, times and places, and the turn of the head by its mount. */
#include "tests/unit/site_rig.h"

#include <math.h>

#include "core/angle.h"
#include "core/pose.h"
#include "firmware_sim/config/load.h"

/* The way is 2 m/s along x in 1.2 s from 5 s on, looking north. */
static const char PATH[] = "t_s,x_m,y_m,z_m,heading_deg,pitch_deg,roll_deg\n5,0,0,2,0,0,0\n6.2,2.4,0,2,0,0,0\n";

static int try_path(const char *path, const char *tripod, const char *platform, struct site **site)
{
    char text[512];
    write_in("room.obj", "v -50 -50 0\nv 50 -50 0\nv 50 50 0\nv -50 50 0\nf 1 2 3 4\n");
    write_in("path.csv", path);
    snprintf(text, sizeof text,
             "head: {profile: full-sweep}\nscene: {meshes: [{file: room.obj, up: z, scale: 1}]}\n"
             "stations: [{position_m: [0, 0, 2]%s}]\nplatform: {kind: stops, file: path.csv, %s}\n",
             tripod, platform);
    write_in("test.yaml", text);
    const int rc = config_load(config_path, NULL, 0, cfg, &err);
    return rc == SH_OK ? site_load(cfg, &report, site, &err) : rc;
}

static struct site *load_path(const char *path, const char *platform)
{
    struct site *site;
    if (try_path(path, "", platform, &site) != SH_OK) fail_msg("%s", err.text);
    return site;
}

static struct site *load(const char *platform)
{
    return load_path(PATH, platform);
}

/* 0.1 s divides 1.2 s, 0.3 s and 0.9 s, but not to the last bit. The stop at the end counts, and lies at the end of the
 * requested part, not beyond it. */
static void the_last_stop_is_at_the_end(void **state)
{
    (void)state;
    static const struct {
        const char *platform;
        uint32_t stops;
        double last_x_m;
    } is[] = {{"step_s: 0.1", 13, 2.4},
              {"step_s: 0.3", 5, 2.4},
              {"step_s: 0.25", 5, 2.0},
              {"step_s: 0.1, end_s: 0.3", 4, 0.6},
              {"step_s: 0.1, start_s: 0.2, end_s: 1.1", 10, 2.2},
              {"step_s: 2", 1, 0.0}};
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++) {
        struct site *site = load(is[i].platform);
        if (site->n_stations != is[i].stops)
            fail_msg("%s: %u stops, not %u", is[i].platform, site->n_stations, is[i].stops);
        const double x_m = site->station[site->n_stations - 1].at.position_m[0];
        assert_true(x_m <= is[i].last_x_m + 1e-15 && fabs(x_m - is[i].last_x_m) < 1e-9);
        site_free(site);
    }
}

/* 0.1 s and 0.2 s are 0.3 s, but not to the last bit: the sum is larger. The path's own length is allowed as its
 * end. */
static void a_part_may_end_with_the_path(void **state)
{
    (void)state;
    static const char path[] = "t_s,x_m,y_m,z_m,heading_deg,pitch_deg,roll_deg\n0.1,0,0,2,0,0,0\n0.3,2.4,0,2,0,0,0\n";
    struct site *site = load_path(path, "step_s: 0.1, end_s: 0.2");
    assert_int_equal(site->n_stations, 3);
    site_free(site);
    site = load_path(path, "step_s: 0.1, start_s: 0.2, end_s: 0.2");
    assert_true(fabs(site->station[0].at.position_m[0] - 2.4) < 1e-9);
    site_free(site);
}

/* The head comes down to 0.5 m at its third stop. The tripod is a key of the one station. */
static void a_tripod_is_too_high_at_a_stop(void **state)
{
    (void)state;
    struct site *site;
    static const char path[] = "t_s,x_m,y_m,z_m,heading_deg,pitch_deg,roll_deg\n0,0,0,2,0,0,0\n2,0,0,0.5,0,0,0\n";
    assert_int_equal(try_path(path, ", tripod: {leg_m: 2, head_above_m: 0.6}", "step_s: 1", &site), SH_EINPUT);
    if (strstr(err.text, "stations[0] (stop-3): tripod.head_above_m: 0.6 m, but the head is 0.5 m") == NULL)
        fail_msg("%s", err.text);
}

/* The third stop of a georeferenced scene is 150 km up, where no scene on the Earth may be. Stops count from 1. */
static void the_stop_that_is_not_on_the_earth_is_named(void **state)
{
    (void)state;
    struct site *site;
    static const char path[] = "t_s,x_m,y_m,z_m,heading_deg,pitch_deg,roll_deg\n0,0,0,2,0,0,0\n1,0,0,2,0,0,0\n"
                               "2,0,0,150000,0,0,0\n";
    assert_int_equal(try_path(path, ", lat_deg: 48, lon_deg: 11, height_m: 300", "step_s: 1", &site), SH_EINPUT);
    if (strstr(err.text, ": stop 3: scene point 0 0 150000: not near the Earth's surface") == NULL)
        fail_msg("%s", err.text);
}

/* The mount turns the head on the body: heading, pitch and roll each by itself, and its arm with it. */
static void the_mount_turns_the_head(void **state)
{
    (void)state;
    struct site *site =
        load("step_s: 2, mount_m: [0.1, 0.2, 0.3], mount_heading_deg: 40, mount_pitch_deg: -25, mount_roll_deg: 10");
    const struct placement *at = &site->station[0].at;
    double want[9];
    pose_attitude(angle_rad(40.0), angle_rad(-25.0), angle_rad(10.0), want);
    for (int i = 0; i < 9; i++)
        assert_true(fabs(at->rotation[i] - want[i]) < 1e-12);
    const struct config_station *stop = site->station[0].station;
    assert_string_equal(stop->name, "stop-1");
    assert_true(fabs(stop->heading_deg - 40.0) < 1e-9 && fabs(stop->pitch_deg + 25.0) < 1e-9 &&
                fabs(stop->roll_deg - 10.0) < 1e-9);
    assert_true(stop->has_position);
    assert_memory_equal(stop->position_m, at->position_m, sizeof stop->position_m);
    assert_true(fabs(at->position_m[0] - 0.1) < 1e-12 && fabs(at->position_m[1] - 0.2) < 1e-12 &&
                fabs(at->position_m[2] - 2.3) < 1e-12);
    site_free(site);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(the_last_stop_is_at_the_end, site_rig_setup, site_rig_teardown),
        cmocka_unit_test_setup_teardown(a_part_may_end_with_the_path, site_rig_setup, site_rig_teardown),
        cmocka_unit_test_setup_teardown(a_tripod_is_too_high_at_a_stop, site_rig_setup, site_rig_teardown),
        cmocka_unit_test_setup_teardown(the_stop_that_is_not_on_the_earth_is_named, site_rig_setup, site_rig_teardown),
        cmocka_unit_test_setup_teardown(the_mount_turns_the_head, site_rig_setup, site_rig_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
