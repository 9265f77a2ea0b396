/* SPDX-License-Identifier: MIT */
/* A station that a client moves: its new place, the head's direction, and its place on the Earth. */
#include "tests/unit/site_rig.h"

#include <math.h>

#include "core/angle.h"
#include "core/pose.h"
#include "firmware_sim/config/load.h"

static const char ROOM[] = "o floor\nv -50 -50 0.25\nv 50 -50 0.25\nv 50 50 0.25\nv -50 50 0.25\nf 1 2 3 4\n";

/* Makes a station over a floor at z = 0.25 m, with these keys. */
static struct site *load(const char *station)
{
    char text[512];
    struct site *site;
    write_in("room.obj", ROOM);
    snprintf(text, sizeof text,
             "head: {profile: full-sweep}\nscene:\n  meshes:\n    - {file: room.obj, up: z, scale: 1}\n"
             "stations:\n  - {%s}\n",
             station);
    write_in("test.yaml", text);
    if (config_load(config_path, NULL, 0, cfg, &err) != SH_OK || site_load(cfg, &report, &site, &err) != SH_OK)
        fail_msg("%s", err.text);
    return site;
}

static struct site *move(const struct site *from, const struct site *first, const struct site_place *to)
{
    struct site *moved;
    if (site_load_moved(from, &(struct site_station_move){first, 0, to}, &report, &moved, &err) != SH_OK)
        fail_msg("%s", err.text);
    return moved;
}

static void expect_attitude(const struct site *site, double heading_deg, double pitch_deg, double roll_deg)
{
    double want[9];
    pose_attitude(angle_rad(heading_deg), angle_rad(pitch_deg), angle_rad(roll_deg), want);
    for (int i = 0; i < 9; i++)
        assert_true(fabs(site->station[0].at.rotation[i] - want[i]) < 1e-15);
}

/* The station stands at the given place, no longer at a height above the floor. A turn alone turns the station. Back at
 * its first place it has its floor again. */
static void a_place_is_taken_as_it_is(void **state)
{
    (void)state;
    struct site *first = load("position_m: [1, 2, 5], instrument_height_m: 1.5, heading_deg: 30, pitch_deg: 2");
    struct site_place was, to = {{3.0, 4.0, 2.25}, 75.0, -1.0, 3.0};
    site_get_place(first, 0, &was);
    assert_true(was.heading_deg == 30.0 && was.pitch_deg == 2.0 && was.roll_deg == 0.0);
    assert_true(was.position_m[0] == 1.0 && was.position_m[1] == 2.0 && fabs(was.position_m[2] - 1.75) < 1e-12);
    assert_true(first->station[0].at.floor_m == 1.5);

    struct site *moved = move(first, first, &to);
    assert_memory_equal(moved->station[0].at.position_m, to.position_m, sizeof to.position_m);
    assert_true(isnan(moved->station[0].at.floor_m));
    expect_attitude(moved, 75.0, -1.0, 3.0);

    struct site *back = move(moved, first, &was);
    assert_memory_equal(back->station[0].at.position_m, was.position_m, sizeof was.position_m);
    assert_true(back->station[0].at.floor_m == 1.5);
    expect_attitude(back, 30.0, 2.0, 0.0);

    for (int axis = 0; axis < 3; axis++) {
        struct site_place turned = was;
        *(axis == 0 ? &turned.heading_deg : axis == 1 ? &turned.pitch_deg : &turned.roll_deg) += 10.0;
        struct site *other = move(first, first, &turned);
        expect_attitude(other, turned.heading_deg, turned.pitch_deg, turned.roll_deg);
        site_free(other);
    }
    site_free(back);
    site_free(moved);
    site_free(first);
}

/* Without an anchor the first place fixes the scene on the Earth: a move by 100 m east, 40 m north and 3 m up is the
 * same there. At 60 degrees of latitude a degree of longitude is 55.8 km, within half a percent of half of 111.3 km,
 * and one of latitude 111.4 km. */
static void on_the_earth_it_moves_along(void **state)
{
    (void)state;
    struct site *first = load("position_m: [1, 2, 5], lat_deg: 60, lon_deg: 11, height_m: 200");
    struct site_place to;
    site_get_place(first, 0, &to);
    to.position_m[0] += 100.0;
    to.position_m[1] += 40.0;
    to.position_m[2] += 3.0;
    struct site *moved = move(first, first, &to);
    const struct georef_place *at = &moved->station[0].at.place;
    assert_true(fabs((at->lon_deg - 11.0) * 55650.0 / 100.0 - 1.0) < 5e-3);
    /* The parallel bends away from the tangent, 100^2 / 2 / 6378 km times tan 60: 1.4 mm; the height by (100^2 + 40^2)
     * / 2 / 6378 km, 0.9 mm. */
    assert_true(fabs((at->lat_deg - 60.0) * 111412.0 / 40.0 - 1.0) < 5e-3 && fabs(at->height_m - 203.0) < 1e-3);
    assert_memory_equal(moved->station[0].at.position_m, to.position_m, sizeof to.position_m);
    site_free(moved);
    site_free(first);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_place_is_taken_as_it_is, site_rig_setup, site_rig_teardown),
        cmocka_unit_test_setup_teardown(on_the_earth_it_moves_along, site_rig_setup, site_rig_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
