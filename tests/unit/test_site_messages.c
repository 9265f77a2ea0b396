/* SPDX-License-Identifier: MIT */
/* A site's messages while it is loaded are compared line by line, with their numbers; and so is the setup that its
 * casters get. */
#include "tests/unit/site_rig.h"

#include <math.h>

#include "core/cast.h"

static struct site *site;

/* The floor is 60 x 60 m at z = 0, an object without a colour. */
static int load(const char *head, double scale, const char *rest)
{
    char text[2048];
    write_in("floor.obj", "o floor\nv -30 -30 0\nv 30 -30 0\nv 30 30 0\nv -30 30 0\nf 1 2 3 4\n");
    snprintf(text, sizeof text,
             "head: {%s}\nscene:\n  meshes: [{file: floor.obj, up: z, scale: %g}]\ncast: {sight: off}\n%s", head, scale,
             rest);
    write_in("test.yaml", text);
    site_free(site);
    site = NULL;
    clear_warned();
    if (config_load(config_path, NULL, 0, cfg, &err) != SH_OK) fail_msg("%s", err.text);
    return site_load(cfg, &report, &site, &err);
}

/* Writes a head like one of the tree's, with another text in place of `was`. */
static void write_head(const char *name, const char *like, const char *was, const char *is)
{
    char *text = NULL, changed[16384];
    size_t size = 0;
    FILE *file = fopen(like, "r");
    assert_non_null(file);
    assert_true(getdelim(&text, &size, '\0', file) > 0);
    fclose(file);
    const char *at = strstr(text, was);
    assert_non_null(at);
    snprintf(changed, sizeof changed, "%.*s%s%s", (int)(at - text), text, is, at + strlen(was));
    write_in(name, changed);
    free(text);
}

/* Its range needs more than 32 bits of 1e-6 m. */
static void write_far_head(void)
{
    write_head("far.yaml", "config/heads/riegl-vz2000i.yaml", "range_max_m: { value: 2500,",
               "range_max_m: { value: 5000,");
    write_head("within.yaml", "config/heads/any-rate.yaml", "range_max_m: { value: 800,",
               "range_max_m: { value: 2140,");
}

/* FILE stands for the configuration's path. */
static void fill_in(const char *text, char *buf, size_t len)
{
    const int has_file = strncmp(text, "FILE", 4) == 0;
    snprintf(buf, len, "%s%s", has_file ? config_path : "", text + (has_file ? 4 : 0));
}

/* One of the warnings is this line. */
static void expect_warning(const char *text)
{
    char want[1024], lines[sizeof warned + 2];
    want[0] = '\n';
    fill_in(text, want + 1, sizeof want - 2);
    strcat(want, "\n");
    snprintf(lines, sizeof lines, "\n%s", warned);
    if (strstr(lines, want) == NULL) fail_msg("no line%sin:\n%s", want, warned);
}

#define STATION "stations: [{position_m: [0, 0, 2]}]\n"
#define SINGLE  "beam: {mode: single}\n"
#define VIEW    "station 1 station-1 at 0 0 2 m: "
#define EMPTY   VIEW "the scan is mostly empty: of 1024 directions "

/* clang-format off */
static const struct {
    const char *head;
    double scale;
    const char *rest;
    const char *says[2];
} warnings[] = {
    {"profile: any-rate", 0.0005, STATION SINGLE,
     {"FILE: the scene is 0.03 m large, but the head measures from 1.5 to 800 m: check scene.meshes[].scale, metres per unit, now 0.0005"}},
    {"profile: any-rate", 1000, STATION SINGLE,
     {"FILE: the scene is 6e+04 m large, but the head measures from 1.5 to 800 m: check scene.meshes[].scale, metres per unit, now 1000"}},
    /* A window at 40 deg down meets the floor 3.1 m away, one that looks up nothing. */
    {"profile: any-rate, line_start_deg: 10", 1, STATION SINGLE,
     {EMPTY "0 hit something from 1.5 to 800 m away, 0 something nearer, 0 something farther"}},
    {"profile: any-rate, line_stop_deg: -39.9, range_min_m: 4", 1, STATION SINGLE,
     {VIEW "of 1024 directions 1024 hit something nearer than range_min_m, 4 m: the station may be inside an object",
      EMPTY "0 hit something from 4 to 800 m away, 1024 something nearer, 0 something farther"}},
    {"profile: any-rate, line_stop_deg: -39.9, range_max_m: 3", 1, STATION SINGLE,
     {EMPTY "0 hit something from 1.5 to 3 m away, 0 something nearer, 1024 something farther"}},
    {"profile: any-rate", 1, STATION SINGLE "output: {attributes: on}\n",
     {"FILE: output.attributes: on, but signal.model is off: no echo has an amplitude, and with beam.mode single each has "
      "the pulse's width"}},
    {"profile: any-rate", 1, STATION "beam: {mode: rings}\noutput: {attributes: on}\n",
     {"FILE: output.attributes: on, but signal.model is off: no echo has an amplitude"}},
    {"profile: any-rate", 1, STATION SINGLE "output: {colour: reflectance}\n",
     {"FILE: output.colour: reflectance, but signal.model is off: no point has a reflectance, so all have the colour for a "
      "missing one"}},
    {"profile: any-rate", 1, STATION SINGLE "output: {colour: texture}\n",
     {"FILE: output.colour: texture, but 1 of 1 surfaces have neither texture nor colour: their points are grey"}},
    {"profile: sick-tim781", 1, STATION SINGLE "fields: [{number: 1, shape: segment, angles_deg: [0, 90], radii_m: [0, 1]}]\n",
     {"FILE: fields: no link has protocol: cola, so nothing evaluates them"}},
    {"profile: sick-lms111", 1, STATION SINGLE "inputs: [{input: 1, from_s: 1, until_s: 2}]\n",
     {"FILE: inputs: no link has protocol: cola, so nothing evaluates them"}},
    {"profile: sick-lms111", 1, STATION SINGLE "inputs: [{input: 1, from_s: 1, until_s: 2}]\n"
     "fields: [{number: 1, shape: segment, angles_deg: [0, 90], radii_m: [0, 1]}]\n",
     {"FILE: fields and inputs: no link has protocol: cola, so nothing evaluates them"}},
    {"profile: any-rate", 1, STATION SINGLE "surfaces: [{object: floor, mirror: 0.9}]\nplan: {tolerance_m: 1, echo_tolerance: 1}\n",
     {"FILE: plan.tolerance_m and plan.echo_tolerance allow glass and mirrors to be treated as other surfaces; set "
      "optics.depth to follow them"}},
    /* 82 gaps from pole to pole, 180 / 82 deg each */
    {"profile: sphere, step_deg: 2.2", 1, STATION SINGLE,
     {"FILE: head.step_deg: 2.2 deg does not divide 180 and 360 deg: 82 steps of 2.19512195 deg are used from ring to ring, "
      "and 164 of 2.19512195 deg along a ring"}},
    {"profile: sphere, step_deg: 2.2, ring_start_deg: 3, ring_stop_deg: 3", 1, STATION SINGLE,
     {"FILE: head.step_deg: 2.2 deg does not divide 360 deg: 164 steps of 2.19512195 deg are used"}},
    {"profile: any-rate", 1, STATION SINGLE "signal: {model: on, reflectance: 0.25}\n",
     {"FILE: 1 of 1 surfaces have no reflectance, neither from the mesh's colour nor from surfaces: 0.25 is used "
      "(signal.reflectance)"}},
    {"profile: any-rate", 1, STATION SINGLE "surfaces: [{object: floor, reflectance: 0.5}, {material: glass, object: pane, "
     "reflectance: 0.5}]\n",
     {"FILE: surfaces[1]: no surface of material \"glass\", object \"pane\" remains for this entry"}},
    /* counts of 1e-6 m: 31 bits hold 2147 m, 32 bits twice as much */
    {"profile: riegl-vz2000i", 1, STATION SINGLE "output: {layout: geo}\n",
     {"output.scale_m: a count on the wire is 1e-05 m, not 1e-06: coordinates up to 2500 m must fit into 31 bits, but at "
      "1e-06 m only those up to 2147 m do"}},
    /* Its range of 2140 m would fit. Heights may differ by 1 % more, and by 2140^2 / (2 x 6.3e6) m for the Earth's
     * curvature. */
    {"profile: within.yaml", 1,
     "stations: [{position_m: [0, 0, 2], lat_deg: 50, lon_deg: 11, height_m: 0}]\n" SINGLE
     "output: {layout: geo, crs: utm}\n",
     {"output.scale_m: a count on the wire is 1e-05 m, not 1e-06: coordinates up to 2161.76 m must fit into 31 bits, but "
      "at 1e-06 m only those up to 2147 m do"}},
    {"profile: far.yaml", 1, STATION SINGLE,
     {"output.scale_m: a count on the wire is 1e-05 m, not 1e-06: ranges up to 5000 m must fit into 32 bits, but at 1e-06 m "
      "only those up to 4295 m do"}},
    {"profile: any-rate", 1,
     "stations:\n  - {position_m: [-20, 0, 2], lat_deg: 50, lon_deg: 11.9997, height_m: 0}\n"
     "  - {position_m: [20, 0, 2], lat_deg: 50, lon_deg: 12.0003, height_m: 0}\n" SINGLE "output: {crs: utm, layout: geo}\n",
     {"FILE: station station-2 is in EPSG 32633, station station-1 in 32632: their points have no common system"}},
    /* 30 dB are 10^3 thresholds, 3.92 for each of 255 counts; 24 dB are 251 thresholds, less than one a count */
    {"profile: any-rate", 1, STATION SINGLE "signal: {model: on}\nwaveform: {send: on, bits: 8, baseline_counts: 0, "
     "full_scale_db: 30}\n",
     {"FILE: waveform.full_scale_db: a count of the samples is 3.92 times the detection threshold, so they don't show weak "
      "echoes; with 8 bits a full scale up to 24 dB does"}},
};
/* clang-format on */

static void warnings_have_their_numbers(void **state)
{
    (void)state;
    write_far_head();
    for (size_t i = 0; i < sizeof warnings / sizeof *warnings; i++) {
        if (load(warnings[i].head, warnings[i].scale, warnings[i].rest) != SH_OK) fail_msg("%s", err.text);
        for (int k = 0; k < 2 && warnings[i].says[k] != NULL; k++)
            expect_warning(warnings[i].says[k]);
    }
    /* A floor of 60 m at 2 m: nothing to say. */
    assert_int_equal(load("profile: any-rate", 1, STATION SINGLE), SH_OK);
    assert_string_equal(warned, "");
    assert_int_equal(load("profile: any-rate", 1,
                          STATION SINGLE "signal: {model: on}\nwaveform: {send: on, bits: 8, baseline_counts: 0, "
                                         "full_scale_db: 20}\nsurfaces: [{reflectance: 0.5}]\n"),
                     SH_OK);
    assert_string_equal(warned, "");
}

/* clang-format off */
static const struct {
    const char *head, *rest, *says;
} refused[] = {
    /* 5010 m / (2^32 - 1) = 1.1665e-6 m */
    {"profile: far.yaml", STATION SINGLE "output: {scale_m: 1.166e-6}\nnoise: {ball: {radius_m: 10}}\n",
     "FILE: output.scale_m: 1.166e-06: ranges up to 5010 m do not fit into 32 bits; allowed 0 (automatic) and from 1.17e-06 m on"},
    /* 2800 m / 2^31 = 1.304e-6 m */
    {"profile: riegl-vz400i", STATION SINGLE "platform: {kind: live, reach_m: 2000}\noutput: {layout: geo, scale_m: 1e-6}\n",
     "FILE: output.scale_m: station station-1: coordinates up to 2800 m from their anchor do not fit into 31 bits at 1e-06 m "
     "per count; at least 1.31e-06 m"},
    {"profile: any-rate", "stations: [{position_m: [0, 0, 2], tripod: {leg_m: 2, head_above_m: 3}}]\n" SINGLE,
     "FILE: stations[0] (station-1): tripod.head_above_m: 3 m, but the head is 2 m above the ground; allowed is less than that"},
    {"profile: any-rate", "stations: [{name: gate, position_m: [3, 4, -1], instrument_height_m: 1.5}]\n" SINGLE,
     "FILE: stations[0] (gate): instrument_height_m, but no surface of the scene lies below 3 4 -1 m; give a place above the "
     "floor, or no instrument_height_m"},
};
/* clang-format on */

static void refusals_have_their_numbers(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof refused / sizeof *refused; i++) {
        char want[512];
        assert_int_equal(load(refused[i].head, 1, refused[i].rest), SH_EINPUT);
        fill_in(refused[i].says, want, sizeof want);
        assert_string_equal(err.text, want);
    }
}

/* Between two mirrors pulses go to and fro. Echoes are separate from half of a pulse's length on. */
static void mirrors_that_face_each_other_are_told(void **state)
{
    (void)state;
    char text[1024];
    struct cast_setup setup;
    write_in("hall.obj", "o hall\nv -30 -30 0\nv 30 -30 0\nv 30 30 0\nv -30 30 0\nv -30 -30 4\nv 30 -30 4\nv 30 30 4\n"
                         "v -30 30 4\nf 1 2 3 4\nf 8 7 6 5\n");
    snprintf(
        text, sizeof text,
        "head: {profile: any-rate}\nscene:\n  meshes: [{file: hall.obj, up: z, scale: 1}]\ncast: {sight: off}\n" STATION
            SINGLE "surfaces: [{object: hall, mirror: 0.9, reflectance: 0.1}]\n");
    write_in("test.yaml", text);
    site_free(site);
    site = NULL;
    clear_warned();
    if (config_load(config_path, NULL, 0, cfg, &err) != SH_OK) fail_msg("%s", err.text);
    if (site_load(cfg, &report, &site, &err) != SH_OK) fail_msg("%s", err.text);
    expect_warning("FILE: paths of pulses meet more glass and mirrors than the 4 surfaces that are followed");
    site_cast_setup(site, 0, &setup);
    assert_non_null(setup.detect);
    assert_int_equal(setup.detect->depth, 4);
    assert_true(cfg->profile.pulse_width_ns == 4.0 && fabs(setup.detect->separation_m - 0.599584916) < 1e-12);
}

static void casters_get_what_is_set(void **state)
{
    (void)state;
    struct cast_setup setup;
    assert_int_equal(
        load("profile: riegl-vz600i, prr_hz: 600000, range_min_m: 2", 1,
             "stations: [{position_m: [0, 0, 2]}, {position_m: [1, 2, 3], heading_deg: 90, tripod: {leg_m: "
             "4}}]\n" SINGLE "noise: {range: on, seed: 7, sigma_m: 0.02}\n"
             "output: {colour: range}\n"),
        SH_OK);
    const struct site_station *s = &site->station[1];
    memset(&setup, 0xee, sizeof setup);
    site_cast_setup(site, 1, &setup);
    assert_true(setup.bvh == site->bvh && setup.georef == s->georef && setup.beam == s->beam);
    assert_true(setup.sight == NULL && setup.silent == NULL && setup.waves == NULL);
    assert_true(setup.station_m[0] == 1 && setup.station_m[1] == 2 && setup.station_m[2] == 3);
    assert_memory_equal(setup.rotation, s->at.rotation, sizeof setup.rotation);
    assert_true(setup.noise_on && setup.range_sigma_m == 0.02 && setup.range_sigma_ppm == 0.0);
    assert_true(setup.mirror_counts == 720000 && setup.pan_counts == 720000);
    assert_true(setup.range_min_m == 2 && setup.range_max_m == 480 && setup.max_echoes == 15);
    assert_true(setup.layout == LINE_POLAR && setup.tripod == &s->tripod.cast && setup.echoes == BEAM_ALL);
    assert_true(setup.range_scale_m == 1e-6 && setup.colour == &s->colour && setup.detect == NULL);
    assert_memory_equal(setup.xyz_scale, s->scale, sizeof setup.xyz_scale);
    assert_true(fabs(setup.pulse_m - 0.149896229 * cfg->profile.pulse_width_ns) < 1e-12 && setup.pulse_m > 0.1);
    assert_true(setup.n_movers == 0 && setup.n_knots == 0 && setup.disturbance == NULL && setup.scan_key == 0);
    const uint64_t key = setup.noise_key;
    site_cast_setup(site, 0, &setup);
    assert_true(setup.tripod == NULL && setup.noise_key == key && setup.station_m[2] == 2);
    site_set_program(site, INT64_C(2200000) * 1000000, &setup);
    assert_true(setup.range_min_m == 2 && setup.range_max_m == 250 && setup.max_echoes == 5);

    assert_int_equal(load("profile: sick-lms111", 1, STATION "beam: {mode: single, echoes: last}\nnoise: {seed: 8}\n"),
                     SH_OK);
    site_cast_setup(site, 0, &setup);
    assert_true(!setup.noise_on && setup.noise_key != key && setup.colour == NULL && setup.echoes == BEAM_LAST);
    assert_true(setup.mirror_counts == 4294967296.0 && setup.pan_counts == 4294967296.0); /* ideal encoders */
}

/* Where a run may cast footprints, surfaces of different reflectances are told apart for their outlines. */
static void footprints_have_kinds_of_surfaces(void **state)
{
    (void)state;
#define LIT "signal: {model: on}\nsurfaces: [{reflectance: 0.5}]\n"
    static const char *const beams[] = {SINGLE, "beam: {mode: rings}\n", "beam: {mode: adaptive}\n"};
    char rest[256];
    for (int i = 0; i < 3; i++) {
        snprintf(rest, sizeof rest, STATION "%s" LIT, beams[i]);
        assert_int_equal(load("profile: riegl-vz400i", 1, rest), SH_OK);
        assert_int_equal(site->detect.kind != NULL, i > 0);
    }
}

/* The noise of a head has a part that grows with the range. */
static void casters_get_the_noise_of_the_head(void **state)
{
    (void)state;
    struct cast_setup setup;
    write_head("noisy.yaml", "config/heads/full-sweep.yaml", "range_sigma_ppm: { value: 0,",
               "range_sigma_ppm: { value: 25,");
    assert_int_equal(load("profile: noisy.yaml", 1, STATION "noise: {range: on}\n"), SH_OK);
    site_cast_setup(site, 0, &setup);
    assert_true(setup.noise_on && setup.range_sigma_m == 0.003 && setup.range_sigma_ppm == 25.0);
}

static void casters_get_the_noise_of_a_ball(void **state)
{
    (void)state;
    struct cast_setup setup;
    assert_int_equal(load("profile: any-rate", 1,
                          STATION SINGLE
                          "noise: {ball: {radius_m: 0.5, distance_1_m: 0.25, factor: [1, 2, 3], axes: beam}}\n"),
                     SH_OK);
    site_cast_setup(site, 0, &setup);
    assert_true(setup.detect != NULL && setup.detect->ball != NULL);
    const struct detect_ball *ball = setup.detect->ball;
    assert_true(ball->radius_m == 0.5 && ball->per_distance_1_m == 0.25 && ball->local);
    for (int i = 0; i < 3; i++)
        assert_true(ball->factor[i] == i + 1);
}

static int tear_down(void **state)
{
    site_free(site);
    return site_rig_teardown(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(warnings_have_their_numbers),           cmocka_unit_test(refusals_have_their_numbers),
        cmocka_unit_test(mirrors_that_face_each_other_are_told), cmocka_unit_test(casters_get_what_is_set),
        cmocka_unit_test(casters_get_the_noise_of_a_ball),       cmocka_unit_test(casters_get_the_noise_of_the_head),
        cmocka_unit_test(footprints_have_kinds_of_surfaces),
    };
    return cmocka_run_group_tests_name("messages of a site", tests, site_rig_setup, tear_down);
}
