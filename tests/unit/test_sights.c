/* SPDX-License-Identifier: MIT */
/* Visibility maps of stations, as a site makes them: when, for which directions, and when not. */
#include "tests/unit/site_rig.h"

#include <math.h>

#include "core/angle.h"
#include "firmware_sim/site/site.h"
#include "firmware_sim/site/view.h"
#include "tests/common/aimed.h"

/* A closed box, 16 m wide. */
static const char BOX[] = "v -8 -8 -3\nv 8 -8 -3\nv 8 8 -3\nv -8 8 -3\nv -8 -8 5\nv 8 -8 5\nv 8 8 5\nv -8 8 5\n"
                          "f 1 2 3 4\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

static void write_config(const char *head, const char *stations, const char *more)
{
    char text[2048];
    write_in("box.obj", BOX);
    snprintf(text, sizeof text,
             "head: {%s}\nscene:\n  meshes:\n    - {file: box.obj, up: z, scale: 1}\nstations:\n%s\n%s", head, stations,
             more);
    write_in("test.yaml", text);
}

static const char ONE[] = "  - {position_m: [0.3, 0.2, 0.1], heading_deg: 40, pitch_deg: 12, roll_deg: -7}";

static int load(const char *head, const char *stations, const char *more, struct site **site)
{
    *site = NULL;
    write_config(head, stations, more);
    int rc = config_load(config_path, NULL, 0, cfg, &err);
    return rc == SH_OK ? site_load(cfg, NULL, site, &err) : rc;
}

static struct site *need_site(const char *head, const char *stations, const char *more)
{
    struct site *site;
    if (load(head, stations, more, &site) != SH_OK) fail_msg("%s: %s", head, err.text);
    return site;
}

/* ---- directions */

/* Writes unit vectors of a run's pulses, as core/cast aims them. */
static void aim(const struct site *site, uint32_t station, const struct schedule_run *run, double d[3][64])
{
    struct cast_setup setup;
    site_cast_setup(site, station, &setup);
    aimed_directions(run, setup.rotation, &(struct vec3_out){d[0], d[1], d[2]});
}

/* All pulses of the first lines and of the last ones go in directions that the view includes. */
static void expect_seen(const char *head, double least_share, double most_share)
{
    struct site *site = need_site(head, ONE, "");
    struct schedule_spec spec;
    struct schedule_segment segment;
    struct schedule_line line;
    struct site_view view;
    uint32_t pulses = 0;
    site_view_of(site, 0, &view);
    site_fill_spec(site, &cfg->head.settings, &spec);
    schedule_start(&segment, &spec);
    const uint64_t lines = schedule_line_of(&segment, segment.end_pulse - 1) + 1;
    for (uint64_t l = 0; l < lines; l += 1 + lines / 37 * (l > 2 && l + lines / 37 + 3 < lines)) {
        schedule_get_line(&segment, l, &line);
        for (uint64_t k = line.cast0; k < line.cast_end; k += 64) {
            struct schedule_run run;
            double d[3][64];
            schedule_get_run(&segment, &line, k, (uint32_t)(line.cast_end - k < 64 ? line.cast_end - k : 64), &run);
            aim(site, 0, &run, d);
            for (uint32_t i = 0; i < run.n; i++, pulses++)
                if (!site_view_sees(&view, (const double[3]){d[0][i], d[1][i], d[2][i]}, 0.0))
                    fail_msg("%s: pulse %llu goes to where none should", head, (unsigned long long)(k + i));
        }
    }
    const double share = site_view_share(&view, 0.0);
    printf("# %s: %u pulses in %.2g %% of all directions\n", head, pulses, 100.0 * share);
    assert_true(pulses > 100 && share >= least_share && share <= most_share);
    site_free(site);
}

/* The share of a window is its width times the difference of its limits' sines, over 4 pi. The margin adds a little. */
static void test_view(void **state)
{
    (void)state;
    const double up = 0.5 * (sin(angle_rad(60)) + sin(angle_rad(40)));
    expect_seen("profile: riegl-vz400i, pan_deg_s: 60", up - 0.01, up + 0.02);
    expect_seen("profile: riegl-vz400i, pan_start_deg: 20, pan_stop_deg: 65", up / 8 - 0.01, up / 8 + 0.02);
    expect_seen("profile: riegl-vz400i, pan_start_deg: 350, pan_stop_deg: 360, line_start_deg: -40, line_stop_deg: -20",
                0.001, 0.01);
    expect_seen("profile: full-sweep, pan_start_deg: 30, pan_stop_deg: 75, pan_deg_s: 36", up / 8 - 0.2, 0.5);
    expect_seen("profile: full-sweep, pan_deg_s: 0", 0.0, 0.05);
    expect_seen("profile: hokuyo-utm-30lx", 0.0, 0.05);
    expect_seen("profile: velodyne-vlp16", 0.02, 0.2);
}

/* A cone is seen where any direction in it is. The cones here have a seen direction just within their border. */
static void test_cones(void **state)
{
    (void)state;
    struct site *site = need_site(
        "profile: riegl-vz400i, pan_start_deg: 20, pan_stop_deg: 65, line_start_deg: 30, line_stop_deg: 60", ONE, "");
    struct site_view view;
    uint32_t seen = 0, cones = 0;
    site_view_of(site, 0, &view);
    for (int i = 0; i < 20000; i++) {
        const double z = (2.0 * i + 1.0) / 20000 - 1.0, r = sqrt(1.0 - z * z), turn = i * 2.399963229728653;
        const double d[3] = {r * cos(turn), r * sin(turn), z}, width = 0.002 + 0.4 * (i % 97) / 97.0;
        if (!site_view_sees(&view, d, 0.0)) continue;
        seen++;
        for (int k = 0; k < 8; k++) { /* turned about an axis across */
            const double a = k * M_PI / 4.0, east[3] = {-sin(turn), cos(turn), 0.0};
            const double north[3] = {-z * cos(turn), -z * sin(turn), r};
            double at[3];
            for (int j = 0; j < 3; j++)
                at[j] = cos(0.999 * width) * d[j] + sin(0.999 * width) * (cos(a) * east[j] + sin(a) * north[j]);
            if (!site_view_sees(&view, at, width)) fail_msg("direction %d, %.3f rad beside", i, width);
            cones++;
        }
    }
    assert_true(seen > 100 && cones == 8 * seen);
    site_free(site);
}

/* ---- making them */

static void test_made_by_station(void **state)
{
    (void)state;
    struct site *site =
        need_site("profile: riegl-vz400i, frames: 0",
                  "  - {position_m: [0, 0, 0]}\n  - {position_m: [1, 0, 0]}\n  - {position_m: [2, 1, 0]}",
                  "cast: {sight: on, sight_mib: 6}");
    struct cast_setup setup;
    struct sight_info info;
    assert_true(site->plan.methods.sight);
    for (uint32_t i = 0; i < 3; i++)
        assert_null(site->station[i].sight);
    assert_int_equal(site_open_sights(site, 1, 1, NULL, &err), SH_OK);
    assert_true(site->station[0].sight == NULL && site->station[1].sight != NULL && site->station[2].sight == NULL);
    site_cast_setup(site, 1, &setup);
    assert_ptr_equal(setup.sight, site->station[1].sight);
    assert_int_equal(site_open_sights(site, 0, 3, NULL, &err), SH_OK); /* the one there is stays */
    assert_ptr_equal(setup.sight, site->station[1].sight);
    for (uint32_t i = 0; i < 3; i += 2) { /* together they take no more than sight_mib */
        info = *sight_get_info(site->station[i].sight);
        assert_true(info.bytes <= 2 << 20);
    }
    site_free(site);
}

static int stops(void *ctx)
{
    (void)ctx;
    return 1;
}

static void test_stopped(void **state)
{
    (void)state;
    const struct sh_report stop = {.stop = stops};
    struct site *site = need_site("profile: riegl-vz400i", ONE, "cast: {sight: on}");
    assert_int_equal(site_open_sights(site, 0, 1, &stop, &err), SH_ESTOPPED);
    assert_null(site->station[0].sight);
    site_free(site);
}

/* There are more stations than maps. A run has none, a recording has one at a time, and no hit depends on it. */
static void test_many_stations(void **state)
{
    (void)state;
    char stations[1024] = "";
    for (int i = 0; i <= SITE_MAX_SIGHTS; i++)
        sprintf(stations + strlen(stations), "  - {position_m: [%d, 0, 0]}\n", i - SITE_MAX_SIGHTS / 2);
    struct site *site = need_site("profile: riegl-vz400i", stations, "cast: {sight: on}");
    assert_true(site->plan.methods.sight);
    assert_int_equal(site_open_sights(site, 0, site->n_stations, NULL, &err), SH_OK);
    assert_null(site->station[0].sight);
    assert_int_equal(site_open_sights(site, 3, 1, NULL, &err), SH_OK);
    assert_non_null(site->station[3].sight);
    site_free(site);
}

static void test_never(void **state)
{
    (void)state;
    static const struct {
        const char *head, *more, *why;
    } cases[] = {
        {"frames: 0", "instrument: {transit_offset_m: 0.01}\n", "moves the beam"},
        {"frames: 0", "platform: {kind: live}\n", "the head moves"},
        {"frames: 0", "beam: {mode: rings}\n", "no ray for the centre"},
        {"frames: 1, pan_stop_deg: 1", "", "too few: a map would cost"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char head[128];
        snprintf(head, sizeof head, "profile: riegl-vz400i, %s", cases[i].head);
        struct site *site = need_site(head, ONE, cases[i].more);
        assert_false(site->plan.methods.sight);
        if (strstr(site->plan.sight.why, cases[i].why) == NULL) fail_msg("%s", site->plan.sight.why);
        assert_int_equal(site_open_sights(site, 0, 1, NULL, &err), SH_OK);
        assert_null(site->station[0].sight);
        site_free(site);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_view),    cmocka_unit_test(test_cones),         cmocka_unit_test(test_made_by_station),
        cmocka_unit_test(test_stopped), cmocka_unit_test(test_many_stations), cmocka_unit_test(test_never),
    };
    return cmocka_run_group_tests(tests, site_rig_setup, site_rig_teardown);
}
