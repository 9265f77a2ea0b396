/* SPDX-License-Identifier: MIT */
/* The path of a head that moves: its stretches cover it, each with an anchor in its middle; and how far a live head may
 * be from its anchor. */
#include "tests/unit/site_rig.h"

#include <math.h>

#include "core/vec3.h"
#include "firmware_sim/config/load.h"

static int try_load(const char *path, const char *platform, struct site **site)
{
    char text[512];
    write_in("room.obj", "v -50 -50 0\nv 50 -50 0\nv 50 50 0\nv -50 50 0\nf 1 2 3 4\n");
    write_in("path.csv", path);
    snprintf(text, sizeof text,
             "head: {profile: full-sweep}\nscene: {meshes: [{file: room.obj, up: z, scale: 1}]}\n"
             "stations: [{position_m: [0, 0, 2]}]\nplatform: {%s}\n",
             platform);
    write_in("test.yaml", text);
    const int rc = config_load(config_path, NULL, 0, cfg, &err);
    return rc == SH_OK ? site_load(cfg, &report, site, &err) : rc;
}

static struct site *load(const char *path, const char *platform)
{
    struct site *site;
    if (try_load(path, platform, &site) != SH_OK) fail_msg("%s", err.text);
    return site;
}

#define HEADER "t_s,x_m,y_m,z_m,heading_deg,pitch_deg,roll_deg\n"

/* The first stretch whose end is not before the time. */
static const struct site_stretch *stretch_at(const struct site *site, int64_t t_ns)
{
    size_t i = 0;
    while (i + 1 < site->n_stretches && site->stretch[i].until_ns < t_ns)
        i++;
    return &site->stretch[i];
}

/* Each pose is within reach of the anchor of its own stretch, and of the one before for 100 ms more, since pulses at
 * the boundary still have that anchor. */
static void expect_covered(const struct site *site)
{
    for (size_t k = 0; k < site->n_knots; k++)
        for (int64_t late_ns = 0; late_ns <= 100000000; late_ns += 100000000) {
            const struct site_stretch *s = stretch_at(site, site->knot[k].t_ns - late_ns);
            const double far_m = vec3_distance(site->knot[k].pose.position_m, s->centre_m);
            if (far_m > s->reach_m) fail_msg("pose %zu is %g m from its anchor, beyond %g m", k, far_m, s->reach_m);
        }
    for (size_t k = 1; k < site->n_knots; k++) { /* on the way to a pose the head is between it and the one before */
        const struct site_stretch *s = stretch_at(site, site->knot[k].t_ns);
        assert_true(vec3_distance(site->knot[k - 1].pose.position_m, s->centre_m) <= s->reach_m);
    }
    for (size_t i = 0; i + 1 < site->n_stretches; i++)
        assert_true(site->stretch[i].until_ns % 1000000 == 0 &&
                    site->stretch[i].until_ns < site->stretch[i + 1].until_ns);
    assert_true(site->stretch[site->n_stretches - 1].until_ns == INT64_MAX);
}

/* A straight way of 5.5 radii needs three stretches; each is as long as its limit but for a step of the poses, of 0.01
 * m and 10 ms at most. At 20 m/s the head goes 2 m in 100 ms, and a step more at each end. */
static void a_straight_way_has_as_few_stretches_as_possible(void **state)
{
    (void)state;
    char path[256];
    const double length_m = 5.5 * SITE_STRETCH_M;
    snprintf(path, sizeof path, HEADER "0,0,0,2,0,0,0\n%.9g,%.9g,0,2,0,0,0\n", length_m / 20.0, length_m);
    struct site *site = load(path, "kind: trajectory, file: path.csv");
    assert_int_equal(site->n_stretches, 3);
    expect_covered(site);
    for (size_t i = 0; i < 2; i++) {
        const struct site_stretch *s = &site->stretch[i];
        const double middle_m = (2.0 * (double)i + 1.0) * SITE_STRETCH_M;
        assert_true(fabs(s->centre_m[0] - middle_m) < 1.0 && s->centre_m[1] == 0.0 && s->centre_m[2] == 2.0);
        assert_true(s->reach_m > SITE_STRETCH_M && s->reach_m < SITE_STRETCH_M + 2.0 + 1.0);
    }
    const struct site_stretch *last = &site->stretch[2];
    assert_true(fabs(last->reach_m - 0.75 * SITE_STRETCH_M) < 1.0);
    assert_true(fabs(last->centre_m[0] - (length_m - 0.75 * SITE_STRETCH_M)) < 1.0);
    site_free(site);
}

static void a_slanting_way_has_one_stretch_about_its_box(void **state)
{
    (void)state;
    struct site *site = load(HEADER "0,-1,-2,2,0,0,0\n3,3,4,3,0,0,0\n", "kind: trajectory, file: path.csv");
    assert_int_equal(site->n_stretches, 1);
    expect_covered(site);
    /* The poses' tolerance is 1e-4 m, and the reach has a millimetre more. */
    const double centre_m[3] = {1.0, 1.0, 2.5}, reach_m = sqrt(4.0 + 9.0 + 0.25);
    assert_true(vec3_distance(site->stretch[0].centre_m, centre_m) < 1e-3);
    assert_true(fabs(site->stretch[0].reach_m - reach_m - 1e-3) < 1e-3);
    site_free(site);
}

/* The anchor of a live head is at its first station, and reaches platform.reach_m and the arm of its mount. */
static void a_live_head_has_one_stretch(void **state)
{
    (void)state;
    struct site *site = load(HEADER, "kind: live, reach_m: 30, mount_m: [0, 3, 4]");
    assert_int_equal(site->n_stretches, 1);
    assert_true(site->stretch[0].reach_m == 35.0 && site->stretch[0].until_ns == INT64_MAX);
    assert_true(site->stretch[0].centre_m[0] == 0.0 && site->stretch[0].centre_m[2] == 2.0);
    assert_true(site->live_reach_m == 35.0);
    site_free(site);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_straight_way_has_as_few_stretches_as_possible, site_rig_setup,
                                        site_rig_teardown),
        cmocka_unit_test_setup_teardown(a_slanting_way_has_one_stretch_about_its_box, site_rig_setup,
                                        site_rig_teardown),
        cmocka_unit_test_setup_teardown(a_live_head_has_one_stretch, site_rig_setup, site_rig_teardown),
    };
    return cmocka_run_group_tests_name("path", tests, NULL, NULL);
}
