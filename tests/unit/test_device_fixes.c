/* SPDX-License-Identifier: MIT */
/* The receiver's fixes of a head that moves, and the poses that they need. */
#include <math.h>

#include "firmware_sim/config/config.h"
#include "firmware_sim/device/device_state.h"
#include "tests/unit/device_rig.h"

#define NMEA                                                                                                        \
    "scene.anchor.source=explicit", "scene.anchor.lat_deg=0", "scene.anchor.lon_deg=11", "scene.anchor.height_m=0", \
        "links[0].type=null", "links[0].protocol=nmea", "gnss.rate_hz=10", "time.epoch=2026-01-01T00:00:00Z"

/* The head goes north at 20 m/s, with a fix ten times a second. Each fix is where the head was then, not a tenth of a
 * second further. */
static void a_fix_is_where_the_head_was(void **state)
{
    (void)state;
    char path[96], set[128];
    snprintf(path, sizeof path, "%s/north.csv", folder);
    snprintf(set, sizeof set, "platform.waypoints=%s", path);
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fputs("x_m,y_m,z_m,speed_m_s\n0,0,0,20\n0,100,0,20\n", f);
    assert_int_equal(fclose(f), 0);
    const char *const sets[] = {"platform.kind=trajectory", set,
                                "stations[1].name=b",       "head.frames=0",
                                "stations[0].lat_deg=0",    "stations[0].lon_deg=11",
                                "stations[0].height_m=0",   "stations[1].lat_deg=1",
                                "stations[1].lon_deg=11",   "stations[1].height_m=0",
                                "links[0].type=null",       "links[0].protocol=nmea",
                                "gnss.rate_hz=10",          "time.epoch=2026-01-01T00:00:00Z"};
    struct rig *rig = rig_open(&(struct device_options){.start = 1}, sets, 14);
    const int64_t t0_ns = (int64_t)rig_wait(rig, NATIVE_EV_SCAN_START, 1000)->b;
    rig_go_to(rig, rig->next + 1500);
    const double e2 = 0.00669437999014, metres_per_deg = 6378137 * (1 - e2) * M_PI / 180; /* WGS 84, at the equator */
    for (int tenth = 5; tenth < 15; tenth++) {
        struct nmea_fix fix;
        assert_int_equal(device_fix(rig->device, tenth * INT64_C(100000000) + 12345, &fix), 1);
        const double want_m = 20 * fmax(0, 0.1 * tenth - 1e-9 * (double)t0_ns);
        assert_true(fabs(fix.lat_deg * metres_per_deg - want_m) < 0.01); /* a tenth is 2 m further */
    }
    rig_close(rig);
    unlink(path);
}

/* The first pose is that of a fix. So there is none before, and the way to the next pose alone gives the speed. Where
 * that pose is out of reach, no speed is known. */
static void a_fix_at_the_first_pose_has_its_speed(void **state)
{
    (void)state;
    static const char *const sets[] = {"platform.kind=live", "platform.reach_m=4",
                                       "stations[1].name=b", "stations[1].position_m=[5,0,0]",
                                       "head.station=2",     NMEA};
    struct nmea_fix fix;
    for (int out = 0; out < 2; out++) {
        struct rig *rig = rig_open(NULL, sets, sizeof sets / sizeof sets[0]);
        rig_go_to(rig, 300);
        assert_int_equal(device_pose(rig->device, 500000000, (double[6]){out ? 8 : 4}, NULL), SH_OK);
        if (out) rig_tell(rig, "HEAD:STATION 1", rig->next - 1);
        assert_int_equal(device_pose(rig->device, 600000000, (double[6]){out ? 0 : 6}, NULL), SH_OK);
        if (out) rig_tell(rig, "HEAD:STATION 2", rig->next - 1);
        rig_go_to(rig, 700);
        assert_int_equal(device_fix(rig->device, 500012345, &fix), 1);
        assert_true(fix.quality != 0 && fabs(fix.speed_m_s - (out ? 0 : 20)) < 1e-3);
        rig_close(rig);
    }
}

/* A platform in lock-step has a pose each 10 us. Those that are kept span 0.66 s, though a receiver's fixes could use
 * older ones. None is refused, since none is ahead. */
static void quick_poses_are_not_refused(void **state)
{
    (void)state;
    static const char *const sets[] = {"platform.kind=live", "loop.pace=step", NMEA};
    struct rig *rig = rig_open(NULL, sets, sizeof sets / sizeof sets[0]);
    for (int i = 0; i < DEVICE_POSES_KEPT + 1000; i++) {
        if (i % 100 == 0) rig_go_to(rig, (uint64_t)i / 100);
        assert_int_equal(device_pose(rig->device, i * INT64_C(10000), (double[6]){0}, NULL), SH_OK);
    }
    rig_close(rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_fix_is_where_the_head_was),
        cmocka_unit_test(a_fix_at_the_first_pose_has_its_speed),
        cmocka_unit_test(quick_poses_are_not_refused),
    };
    return cmocka_run_group_tests_name("device fixes", tests, make_folder, remove_folder);
}
