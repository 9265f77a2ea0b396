/* SPDX-License-Identifier: MIT */
/* Rows of a site's plan that say what is set, without a choice; possible causes of a slow scan; the plan in one line.
 */
#include "tests/unit/site_rig.h"

#include <math.h>

#include "core/bvh.h"
#include "core/plan.h"
#include "firmware_sim/site/plan_rows.h"
#include "firmware_sim/site/waves.h"

static struct site *site;

static void plan_with(const char *head, const char *rest, const char *const *sets, int n)
{
    char text[2048];
    write_in("floor.obj", "v -30 -30 0\nv 30 -30 0\nv 30 30 0\nv -30 30 0\nf 1 2 3 4\n");
    snprintf(
        text, sizeof text,
        "head: {%s}\nscene:\n  meshes: [{file: floor.obj, up: z, scale: 1}]\nbeam: {mode: single}\ncast: {sight: off}\n%s\n",
        head, rest);
    write_in("test.yaml", text);
    site_free(site);
    site = NULL;
    if (config_load(config_path, sets, n, cfg, &err) != SH_OK) fail_msg("%s", err.text);
    if (site_load(cfg, &report, &site, &err) != SH_OK) fail_msg("%s", err.text);
    if (site_plan_rows(site, &err) != SH_OK) fail_msg("%s", err.text);
}

static void plan(const char *head, const char *rest)
{
    plan_with(head, rest, NULL, 0);
}

static const struct plan_row *row_of(const char *stage)
{
    for (size_t i = 0; i < site->plan.n; i++)
        if (strcmp(site->plan.row[i].stage, stage) == 0) return &site->plan.row[i];
    return NULL;
}

static void expect_row(const char *stage, const char *method, const char *why)
{
    const struct plan_row *row = row_of(stage);
    if (row == NULL) fail_msg("no row %s", stage);
    assert_string_equal(row->method, method);
    assert_string_equal(row->why, why);
}

#define STATION "stations: [{position_m: [0, 0, 2]}]\n"

/* 105 of 240 deg of each pulse rate are used. */
static void programs_and_ranges_have_their_figures(void **state)
{
    (void)state;
    plan("profile: riegl-vz600i, prr_hz: 600000, range_max_m: 300", STATION);
    expect_row("program", "600 kHz",
               "15 echoes, 0.5 to 300 m, 262.5 kHz used; riegl-vz600i also has 140, 1200, 2200 kHz");
    expect_row("range", "0.5 to 300 m",
               "head.range_min_m, range_max_m: there is no echo outside of them; the profile has 0.5 to 1000 m");
    assert_null(row_of("emitter"));
    assert_null(row_of("tripod"));
    plan("profile: any-rate", STATION);
    assert_null(row_of("program"));
    assert_null(row_of("range"));
}

static void heads_without_a_pan_say_how_they_fire(void **state)
{
    (void)state;
    char why[160];
    plan("profile: sick-lms111", STATION);
    emitter_describe(&site->emitter, why, sizeof why);
    expect_row("emitter", "planar", why);
}

static void the_plan_fits_a_line(void)
{
    char text[256], want[256];
    const struct site_plan *p = &site->plan;
    for (int polar = 0; polar < 2; polar++) {
        cfg->output.layout = polar ? LINE_POLAR : LINE_GEO;
        site_plan_text(site, text, sizeof text);
        snprintf(want, sizeof want, "sight %s; beam single; optics none; georef %s", p->sight.method,
                 polar ? "none" : site->station[0].plan.method);
        assert_string_equal(text, want);
    }
}

/* One row for all stations where they have the same method, with the largest of their errors. */
static void stations_share_a_row(void **state)
{
    (void)state;
    static const char two[] = "stations:\n  - {name: near, position_m: [0, 0, 2]}\n"
                              "  - {name: far, position_m: [20, 0, 2]}\noutput: {layout: geo}\n";
    plan("profile: any-rate", two);
    const struct plan_row *row = row_of("georef");
    assert_non_null(row);
    assert_int_equal(strncmp(row->why, "all stations: ", 14), 0);
    for (uint32_t i = 0; i < 2; i++)
        assert_true(row->error_m >= site->station[i].plan.error_m);
    /* Plans of other methods have a row each. */
    strcpy(site->station[1].plan.method, "other");
    assert_int_equal(site_plan_rows(site, &err), SH_OK);
    row = row_of("georef");
    assert_int_equal(strncmp(row[0].why, "station 1 near: ", 16), 0);
    assert_int_equal(strncmp(row[1].why, "station 2 far: ", 15), 0);
    assert_string_equal(row[1].method, "other");
    assert_string_equal(row[1].stage, "georef");
    plan("profile: any-rate", STATION "output: {layout: geo}\n");
    assert_null(strstr(row_of("georef")->why, "station"));
    the_plan_fits_a_line();
}

/* Returns the setting of a second floor, which moves. */
static const char *mover_setting(void)
{
    static char text[256];
    const int n = (int)(strrchr(config_path, '/') - config_path);
    snprintf(text, sizeof text,
             "scene.meshes[1]={file: %.*s/floor.obj, up: z, scale: 1, move_m_s: [0, 0, 1], cycle_s: 1}", n,
             config_path);
    return text;
}

/* How far points may be from where their georeference is: within the scene and within the head's range, with a margin;
 * those of movers, and of a head that others move, within the head's range alone. */
static void georeferences_have_an_extent(void **state)
{
    (void)state;
    const char *const sets[] = {"scene.anchor={source: explicit, lat_deg: 48, lon_deg: 11, height_m: 500}",
                                "output={layout: geo, crs: utm}", mover_setting()};
    static const struct {
        const char *head, *rest, *extent;
    } rows[] = {
        {"profile: any-rate, range_max_m: 100", STATION, " for points up to 42.893 m away, 2.05 m up or down"},
        {"profile: any-rate, range_max_m: 100", "stations: [{position_m: [-10, 5, 1]}]\n",
         " for points up to 53.725 m away, 1.04 m up or down"},
        {"profile: any-rate, range_max_m: 100", STATION "noise: {range: on, sigma_m: 0.05}\n",
         " for points up to 43.558 m away, 2.52 m up or down"},
        {"profile: any-rate, range_max_m: 1.6", STATION, " for points up to 1.616 m away, 1.616 m up or down"},
        {"profile: any-rate, range_max_m: 10", STATION "platform: {kind: live, reach_m: 5}\n",
         " for points up to 15.15 m away, 2.05 m up or down"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        plan_with(rows[i].head, rows[i].rest, sets, 2);
        const char *why = row_of("georef")->why, *extent = strstr(why, " for points up to ");
        if (extent == NULL || strcmp(extent, rows[i].extent) != 0) fail_msg("%zu: %s", i, why);
    }
    plan_with("profile: any-rate, range_max_m: 20", STATION, sets, 3);
    assert_non_null(strstr(row_of("georef")->why, " for points up to 20.2 m away, 20.2 m up or down"));
}

static void a_tripod_has_a_row(void **state)
{
    (void)state;
    static const struct {
        const char *stations, *method, *begins;
    } rows[] = {
        {"stations: [{position_m: [0, 0, 2], tripod: {leg_m: 2.5, legs: on}}]\n", "legs",
         "legs of 2.5 m in view, top "},
        {"stations: [{position_m: [0, 0, 2]}, {name: a, position_m: [3, 0, 2], tripod: {leg_m: 2.5}}]\n", "cone",
         "legs of 2.5 m, top "},
        {"stations: [{name: b, position_m: [0, 0, 2], tripod: {leg_m: 2.25}}, {position_m: [3, 0, 2], tripod: {leg_m: 2.5}}]\n",
         "cone", "b: legs of 2.25 m, top "},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        plan("profile: any-rate", rows[i].stations);
        const struct plan_row *row = row_of("tripod");
        assert_non_null(row);
        assert_string_equal(row->method, rows[i].method);
        if (strncmp(row->why, rows[i].begins, strlen(rows[i].begins)) != 0) fail_msg("%s", row->why);
    }
}

/* A pulse is cast into each body that moves, too; a recorded wave costs what its row says. */
static void a_pulse_costs_all_that_it_meets(void **state)
{
    (void)state;
    const char *const sets[] = {mover_setting(), "signal.model=on", "waveform.send=on"};
    struct bvh_info bvh;
    plan("profile: any-rate", STATION);
    bvh = *bvh_get_info(site->bvh);
    const double alone_ns = site_planned_ns(site);
    plan_with("profile: any-rate", STATION, sets, 1);
    assert_int_equal(site->n_movers, 1);
    assert_true(fabs(site_planned_ns(site) - alone_ns - plan_pulse_ns(2, bvh.packet)) < 1e-6);
    assert_true(site_wave_ns(site) == 0.0);
    plan_with("profile: riegl-vz400i", STATION, sets + 1, 1);
    const double plain_ns = site_planned_ns(site);
    plan_with("profile: riegl-vz400i", STATION, sets + 1, 2);
    const double wave_ns = row_of("waveform")->cost_ns;
    assert_true(wave_ns > 0.0 && wave_ns == site_wave_ns(site));
    assert_true(fabs(site_planned_ns(site) - plain_ns - wave_ns) < 1e-6);
}

/* All beams are in the row, the chosen one and those left out, with the costs of their 70 ns a ray (cost.h). */
static void all_beams_are_compared(void **state)
{
    (void)state;
    static const char *const sets[] = {"beam.mode=auto"};
    static const struct {
        const char *method;
        double cost_ns; /* NaN: by the scene */
    } beams[] = {{"single", 0},
                 {"adaptive", NAN},
                 {"rings 1 (7 rays)", 490},
                 {"rings 2 (19 rays)", 1330},
                 {"rings 3 (37 rays)", 2590},
                 {"rings 4 (61 rays)", 4270},
                 {"rings 6 (127 rays)", 8890},
                 {"rings 8 (217 rays)", 15190},
                 {"rings 12 (469 rays)", 32830}};
    enum { BEAMS = sizeof beams / sizeof beams[0] };
    plan_with("profile: riegl-vz400i", STATION, sets, 1);
    const struct plan_row *row = row_of("beam");
    assert_int_equal(row->n_left, BEAMS - 1);
    for (int i = 0; i < BEAMS; i++) {
        int found = strcmp(row->method, beams[i].method) == 0;
        for (uint32_t k = 0; k < row->n_left; k++) {
            if (strcmp(row->left[k].method, beams[i].method) != 0) continue;
            found++;
            if (!isnan(beams[i].cost_ns)) assert_true(row->left[k].cost_ns == beams[i].cost_ns);
        }
        if (found != 1) fail_msg("%s is there %d times", beams[i].method, found);
    }
}

/* 100 of 240 deg are cast, so 0.125 of 0.3 million pulses/s. The figures follow from the cost that was measured, to the
 * three digits that are printed. The errors are those of the other rows. */
static void the_total_is_measured(void **state)
{
    (void)state;
    static const char *const sets[] = {"loop.threads=1"};
    double million_s = 0, percent = 0;
    plan_with("profile: riegl-vz400i, prr_hz: 300000", STATION, sets, 1);
    const struct plan_row *row = row_of("total");
    assert_string_equal(row->method, "measured");
    assert_true(isnan(row->error_m) && isnan(row->echo_share) && row->cost_ns > 0.0);
    if (sscanf(
            row->why,
            "1 processor computes %lf million pulses/s; the configuration has 0.3 million/s; 0.125 million of them are "
            "cast and need %lf %% of the processor time",
            &million_s, &percent) != 2)
        fail_msg("%s", row->why);
    assert_true(fabs(million_s * row->cost_ns / 1e3 - 1.0) < 0.01);
    assert_true(fabs(percent / (100.0 * 125e3 * 1e-9 * row->cost_ns) - 1.0) < 0.01);
}

static void a_slow_scan_has_possible_causes(void **state)
{
    (void)state;
    static const struct {
        enum beam_mode beam;
        uint32_t depth, n_movers, n_triangles;
        const char *says;
    } rows[] = {
        {BEAM_RINGS, 2, 1, 12, "the sub-rays of footprints (beam.mode single has none), a busy machine"},
        {BEAM_SINGLE, 1, 1, 12, "glass and mirrors (optics.depth 0 leaves them out), a busy machine"},
        {BEAM_SINGLE, 0, 1, 12, "meshes that move (1, each cast by itself), a busy machine"},
        {BEAM_SINGLE, 0, 0, 32, "triangles that lie over one another as seen from the head, a busy machine"},
        {BEAM_SINGLE, 0, 0, 31, "a busy machine"},
    };
    struct site *one = calloc(1, sizeof *one);
    struct scene scene = {0};
    assert_non_null(one);
    one->scene = &scene;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char text[128];
        scene.n_triangles = rows[i].n_triangles;
        one->plan.methods = (struct plan_methods){.beam = rows[i].beam, .depth = rows[i].depth};
        one->n_movers = rows[i].n_movers;
        site_cost_reason(one, text, sizeof text);
        assert_string_equal(text, rows[i].says);
    }
    free(one);
}

static int tear_down(void **state)
{
    site_free(site);
    return site_rig_teardown(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(programs_and_ranges_have_their_figures),
        cmocka_unit_test(heads_without_a_pan_say_how_they_fire),
        cmocka_unit_test(stations_share_a_row),
        cmocka_unit_test(georeferences_have_an_extent),
        cmocka_unit_test(a_tripod_has_a_row),
        cmocka_unit_test(a_pulse_costs_all_that_it_meets),
        cmocka_unit_test(a_slow_scan_has_possible_causes),
        cmocka_unit_test(the_total_is_measured),
        cmocka_unit_test(all_beams_are_compared),
    };
    return cmocka_run_group_tests_name("rows of a plan", tests, site_rig_setup, tear_down);
}
