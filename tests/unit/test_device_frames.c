/* SPDX-License-Identifier: MIT */
/* The frames in which a head describes itself: each field against the configuration, and against figures that were
 * typed from config/heads. */
#include "tests/unit/site_rig.h"

#include <math.h>

#include "core/bvh.h"
#include "drivers/protocol/native.h"
#include "firmware_sim/device/device.h"
#include "firmware_sim/device/frames.h"

static const int64_t MICRO = 1000000;
static struct site *site;
static struct device_scan scan;

/* Loads a site with two objects, and plans a scan with the settings of power-up, which begins at the first station. */
static void plan(const char *head, const char *rest)
{
    char text[2048];
    struct schedule_spec spec;
    write_in("two.obj", "o a\nv -9 -9 0\nv 9 -9 0\nv 9 9 0\nf 1 2 3\no b\nv -9 9 0\nf 1 3 4\n");
    snprintf(text, sizeof text, "head: {%s}\nscene:\n  meshes: [{file: two.obj, up: z, scale: 1}]\n%s\n", head, rest);
    write_in("test.yaml", text);
    site_free(site);
    site = NULL;
    if (config_load(config_path, NULL, 0, cfg, &err) != SH_OK) fail_msg("%s", err.text);
    if (site_load(cfg, &report, &site, &err) != SH_OK) fail_msg("%s", err.text);
    config_fill_spec(&cfg->profile, &cfg->head.settings, &spec);
    scan = (struct device_scan){
        .site = site, .number = 3, .prr_uhz = cfg->head.settings.prr_uhz, .lines_uhz = cfg->head.settings.lines_uhz};
    schedule_start(&scan.segment, &spec);
}

#define STATION "stations: [{position_m: [0, 0, 2]}]\nbeam: {mode: single}\n"

static void a_descriptor_has_what_is_set(void **state)
{
    (void)state;
    static const char idn[sizeof((struct native_descriptor *)0)->idn] = "A,B,C,D";
    struct native_descriptor d;
    struct bvh_info info;
    plan("profile: riegl-vz400i, prr_hz: 300000, lines_hz: 50, pan_deg_s: 10, line_start_deg: -30, line_stop_deg: 20, "
         "pan_start_deg: 15, pan_stop_deg: 35, frames: 7, range_min_m: 2, range_max_m: 300",
         STATION "noise: {seed: 77}");
    scan.prr_uhz = 600000 * MICRO; /* a slow mirror: its segment has another rate */
    scan.lines_uhz = 60 * MICRO;
    memset(&d, 0xee, sizeof d);
    device_fill_descriptor(&scan, idn, 0, &d);
    info = *bvh_get_info(site->bvh);
    assert_string_equal(d.idn, "A,B,C,D");
    assert_string_equal(d.profile, "riegl-vz400i");
    assert_true(d.layout == NATIVE_POLAR && d.isa == info.packet && d.isa >= 1 && d.isa <= 16);
    assert_true(d.prr_uhz == 600000000000 && d.lines_uhz == 60000000 && d.pan_udeg_s == 10000000);
    assert_true(d.fov_min_udeg == -40 * MICRO && d.sweep_udeg == 240 * MICRO); /* 3 facets, twice their angle */
    assert_true(d.line_start_udeg == -30 * MICRO && d.line_stop_udeg == 20 * MICRO);
    assert_true(d.pan_start_udeg == 15 * MICRO && d.pan_stop_udeg == 35 * MICRO);
    assert_true(d.mirror_counts_per_turn == 720000 && d.pan_counts_per_turn == 720000);
    assert_true(d.range_scale_m == 1e-6 && d.range_min_m == 2.0 && d.range_max_m == 300.0);
    assert_true(d.max_echoes == 8 && d.n_surfaces == 2 && d.frames == 7 && d.scan == 3 && d.seed == 77);
    assert_true(d.content == 0 && d.reserved == 0);
}

static void a_descriptor_says_what_follows_the_points(void **state)
{
    (void)state;
    static const struct {
        const char *with;
        uint32_t waves, layout, content;
    } rows[] = {
        {"output: {layout: geo}\n", 0, NATIVE_GEO, 0},
        {"output: {attributes: on}\n", 0, NATIVE_POLAR, NATIVE_HAS_ATTRIBUTES},
        {"output: {colour: range}\n", 0, NATIVE_POLAR, NATIVE_HAS_COLOURS},
        {"", 1, NATIVE_POLAR, NATIVE_HAS_WAVES},
        {"signal: {model: on}\nwaveform: {echoes: fraction}\n", 0, NATIVE_POLAR, 0},
        {"signal: {model: on}\nwaveform: {echoes: fraction}\noutput: {attributes: on}\n", 0, NATIVE_POLAR,
         NATIVE_HAS_ATTRIBUTES | NATIVE_HAS_DEVIATIONS},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char rest[512];
        struct native_descriptor d;
        snprintf(rest, sizeof rest, STATION "%s", rows[i].with);
        plan("profile: riegl-vz400i", rest);
        static const char idn[sizeof d.idn] = "";
        device_fill_descriptor(&scan, idn, rows[i].waves, &d);
        assert_int_equal(d.layout, rows[i].layout);
        assert_int_equal(d.content, rows[i].content);
    }
}

static void expect_sequence(const struct native_emitter *e, uint64_t num, uint64_t den)
{
    assert_true(e->sequence_ns_den != 0 && e->sequence_ns_num * den == num * e->sequence_ns_den);
}

static void an_emitter_has_its_pattern(void **state)
{
    (void)state;
    struct native_emitter e;
    struct native_beam beam[NATIVE_MAX_BEAMS];
    static const int elevation_deg[16] = {-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15};
    memset(&e, 0xee, sizeof e);
    plan("profile: riegl-vz400i", STATION);
    device_fill_emitter(&scan, BEAM_LAST, &e, beam);
    static const struct native_emitter none;
    assert_memory_equal(&e, &none, sizeof e); /* a line head has none */

    plan("profile: sick-lms111", STATION);
    scan.lines_uhz = 25 * MICRO; /* the rate that is set; the segment's mirror is faster */
    scan.prr_uhz = 18000 * MICRO;
    device_fill_emitter(&scan, BEAM_ALL, &e, beam);
    assert_true(e.kind == NATIVE_EMIT_PLANAR && e.steps == 720 && e.first_step == 0 && e.last_step == 540);
    assert_true(e.front_step == 270 && e.turn == -1 && e.n_beams == 0 && e.rings == 0 && e.gaps == 0);
    assert_true(e.first_ring_udeg == 0 && e.echoes == NATIVE_ECHOES_ALL);
    expect_sequence(&e, 1000000000, 18000);

    plan("profile: velodyne-vlp16", STATION);
    device_fill_emitter(&scan, BEAM_FIRST, &e, beam);
    assert_true(e.kind == NATIVE_EMIT_BEAMS && e.n_beams == 16 && e.turn == 1 && e.echoes == NATIVE_ECHOES_FIRST);
    expect_sequence(&e, 55296, 1);
    for (uint32_t i = 0; i < 16; i++) {
        assert_int_equal(beam[i].elevation_udeg, elevation_deg[i] * MICRO);
        assert_int_equal(beam[i].azimuth_udeg, 0);
        assert_int_equal(beam[i].offset_ns, 2304 * i);
    }

    plan("profile: sphere, lines_hz: 10", STATION);
    device_fill_emitter(&scan, BEAM_LAST, &e, beam);
    assert_true(e.kind == NATIVE_EMIT_SPHERE && e.steps == 360 && e.rings == 181 && e.gaps == 0);
    assert_true(e.first_ring_udeg == -90 * MICRO && e.echoes == NATIVE_ECHOES_LAST);
    expect_sequence(&e, 1000000000, 3600);

    plan("profile: sphere, lines_hz: 10, ring_start_deg: -10, ring_stop_deg: 20.5", STATION);
    device_fill_emitter(&scan, BEAM_STRONGEST, &e, beam);
    assert_true(e.rings == 31 && e.gaps == 180 && e.first_ring_udeg == -10 * MICRO);
    assert_int_equal(e.echoes, NATIVE_ECHOES_STRONGEST);
}

static void an_anchor_says_where_its_station_stands(void **state)
{
    (void)state;
    struct native_anchor a;
    plan("profile: riegl-vz400i", "  anchor: {source: utm, utm_zone: 33, hemisphere: north}\nstations:\n"
                                  "  - {easting_m: 391437, northing_m: 5819711, height_m: 2}\n"
                                  "  - {easting_m: 391440, northing_m: 5819715, height_m: 3, heading_deg: 90}\n"
                                  "beam: {mode: single}\noutput: {crs: utm, layout: geo, scale_m: 0.001}\n");
    memset(&a, 0xee, sizeof a);
    device_fill_anchor(site, 1, 0, &a);
    const struct site_station *s = &site->station[1];
    assert_true(a.crs == NATIVE_CRS_UTM && a.epsg == 32633 && a.station == 2 && a.moving == 0);
    assert_true(a.anchor[0] == 391440 && a.anchor[1] == 5819715 && a.anchor[2] == 3 && a.scale_m == 0.001);
    assert_true(a.lat_deg == s->at.place.lat_deg && a.lon_deg == s->at.place.lon_deg);
    assert_true(a.lat_deg > 52.5 && a.lat_deg < 52.6 && a.lon_deg > 13.3 && a.lon_deg < 13.5); /* Berlin */
    assert_true(fabs(a.height_m - 3) < 1e-6);
    assert_true(a.station_m[0] == 391440 && a.station_m[1] == 5819715 && a.station_m[2] == 3);
    assert_memory_equal(a.rotation, s->at.rotation, sizeof a.rotation);
    assert_true(fabs(a.rotation[1] - 1.0) < 1e-3); /* forward is east; grid north is not quite the plumb line's */
    assert_true(a.frame == 0 && a.heights == NATIVE_HEIGHTS_ELLIPSOID && a.until_ms == 0);
    for (int k = 0; k < 3; k++)
        assert_true(a.scale[k] > 0.0 && a.scale[k] <= 0.001);
    for (int k = 0; k < 9; k++) /* the scene is in the CRS */
        assert_true(fabs(a.axes[k] - (k % 4 == 0)) < 1e-9);
    static const struct {
        const char *crs;
        uint32_t is;
    } rows[] = {{"local", NATIVE_CRS_LOCAL}, {"ecef", NATIVE_CRS_ECEF}, {"geodetic", NATIVE_CRS_GEODETIC}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char rest[256];
        snprintf(rest, sizeof rest,
                 "stations: [{position_m: [1, 2, 3], lat_deg: 50, lon_deg: 10, height_m: 80}]\nbeam: {mode: single}\n"
                 "output: {crs: %s, layout: geo}\n",
                 rows[i].crs);
        plan("profile: riegl-vz400i", rest);
        device_fill_anchor(site, 0, 0, &a);
        assert_int_equal(a.crs, rows[i].is);
        assert_true(a.station == 1 && a.lat_deg == 50 && a.lon_deg == 10 && a.height_m == 80);
        assert_true(a.station_m[0] == 1 && a.station_m[1] == 2 && a.station_m[2] == 3);
    }
}

static void an_anchor_says_whether_the_head_moves(void **state)
{
    (void)state;
    struct native_anchor a;
    plan("profile: sick-lms111", STATION "platform: {kind: live}\n");
    device_fill_anchor(site, 0, 0, &a);
    assert_int_equal(a.moving, NATIVE_MOVING);
    write_in("path.csv", "t_s,x_m,y_m,z_m,heading_deg,pitch_deg,roll_deg,frame\n0,0,0,2,0,0,0,5\n10,10,0,2,0,0,0,25\n");
    plan("profile: riegl-vz400i", STATION "platform: {kind: stops, file: path.csv, step_s: 5}\n");
    device_fill_anchor(site, 1, 0, &a);
    assert_true(a.moving == NATIVE_STOP && a.station == 2 && a.frame == 15 && a.station_m[0] == 5);
}

/* A path of 4 km has stretches of 2 km. The first one ends when half of the path's time is over: after 25 days, which
 * fit in 32 bits, or after 99, which don't. */
static void an_anchor_says_how_long_it_counts(void **state)
{
    (void)state;
    static const struct {
        const char *end_s;
        int fits;
    } row[] = {{"4294967", 1}, {"17179870", 0}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        struct native_anchor a;
        char path[128];
        snprintf(path, sizeof path, "t_s,x_m,y_m,z_m,heading_deg\n0,-1000,0,2,0\n%s,3000,0,2,0\n", row[i].end_s);
        write_in("path.csv", path);
        plan("profile: sick-lms111", STATION "platform: {kind: trajectory, file: path.csv}\noutput: {layout: geo}\n");
        assert_true(site->n_stretches > 1);
        const int64_t until_ms = site->stretch[0].until_ns / 1000000;
        assert_int_equal(until_ms <= UINT32_MAX, row[i].fits);
        device_fill_anchor(site, 0, 0, &a);
        assert_int_equal(a.until_ms, row[i].fits ? until_ms : 0);
    }
}

static int tear_down(void **state)
{
    site_free(site);
    return site_rig_teardown(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_descriptor_has_what_is_set),
        cmocka_unit_test(a_descriptor_says_what_follows_the_points),
        cmocka_unit_test(an_emitter_has_its_pattern),
        cmocka_unit_test(an_anchor_says_where_its_station_stands),
        cmocka_unit_test(an_anchor_says_whether_the_head_moves),
        cmocka_unit_test(an_anchor_says_how_long_it_counts),
    };
    return cmocka_run_group_tests_name("device frames", tests, site_rig_setup, tear_down);
}
