/* The configuration: what it takes, what it refuses and where it says so. Run from the top of the source
 * tree. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <cmocka.h>

#include "firmware_sim/config_private.h"
#include "tests/unit/config_cases.h"

static char dir[64], config_path[128];
static struct config *cfg;
static struct sh_err err;

static void write_file(const char *path, const void *bytes, size_t len)
{
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(bytes, 1, len, file), len);
    assert_int_equal(fclose(file), 0);
}

static void write_in(const char *name, const char *text)
{
    char path[256];
    snprintf(path, sizeof path, "%s/%s", dir, name);
    write_file(path, text, strlen(text));
}

static int load_sets(const char *const *sets, int n)
{
    memset(&err, 0, sizeof err);
    return config_load(config_path, sets, n, cfg, &err);
}

static int load_text(const char *text)
{
    write_file(config_path, text, strlen(text));
    return load_sets(NULL, 0);
}

/* base with its first `old` replaced by `with` */
static char *edited(const char *old, const char *with)
{
    const char *at = strstr(base, old);
    assert_non_null(at);
    char *text = malloc(sizeof base + strlen(with));
    assert_non_null(text);
    sprintf(text, "%.*s%s%s", (int)(at - base), base, with, at + strlen(old));
    return text;
}

static int load_edited(const char *old, const char *with)
{
    char *text = edited(old, with);
    int code = load_text(text);
    free(text);
    return code;
}

static void assert_loads(int code)
{
    if (code != SH_OK) fail_msg("%s", err.text);
}

static void assert_says(const char *fragment)
{
    assert_int_equal(err.code, SH_EINPUT);
    assert_null(strchr(err.text, '\n'));
    if (strstr(err.text, fragment) == NULL) fail_msg("\"%s\" says nothing of \"%s\"", err.text, fragment);
}

/* ---- malformed configurations */

static void malformed_configurations_are_refused(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        char start[256];
        int code = bad[i].old == NULL ? load_text(bad[i].with) : load_edited(bad[i].old, bad[i].with);
        int n = snprintf(start, sizeof start, "%s:%d: ", config_path, bad[i].line);
        if (bad[i].key != NULL) snprintf(start + n, sizeof start - (size_t)n, "%s: ", bad[i].key);
        if (code != SH_EINPUT || err.code != code) fail_msg("case %zu (%s): code %d", i, bad[i].with, code);
        if (strncmp(err.text, start, strlen(start)) != 0 || strstr(err.text, bad[i].fragment) == NULL)
            fail_msg("case %zu (%s): \"%s\", expected \"%s...%s\"", i, bad[i].with, err.text, start, bad[i].fragment);
        if (strpbrk(err.text, "\n\r") != NULL) fail_msg("case %zu: more than one line: %s", i, err.text);
    }
}

static void files_that_are_none_are_refused(void **state)
{
    (void)state;
    char *big = malloc((1 << 20) + 2), long_path[600];
    assert_int_equal(config_load("/nonexistent/a.yaml", NULL, 0, cfg, &err), SH_EINPUT);
    assert_says("/nonexistent/a.yaml: cannot be opened: No such file");
    assert_int_equal(config_load(dir, NULL, 0, cfg, &err), SH_EINPUT);
    assert_says("directory");
    assert_non_null(big);
    memset(big, '#', (1 << 20) + 1);
    big[(1 << 20) + 1] = '\0';
    assert_int_equal(load_text(big), SH_EINPUT);
    assert_says("larger than 1 MiB");
    memset(big, '[', 1 << 20); /* nests deeper than any parser should follow */
    big[1 << 20] = '\0';
    assert_int_equal(load_text(big), SH_EINPUT);
    assert_says(":1: nested too deep; allowed 16 levels");
    free(big);
    memset(long_path, 'a', sizeof long_path - 1);
    long_path[sizeof long_path - 1] = '\0';
    assert_int_equal(config_load(long_path, NULL, 0, cfg, &err), SH_EINPUT);
    assert_says("path too long");
    assert_int_equal(config_load(long_path, NULL, 0, cfg, NULL), SH_EINPUT);
}

/* ---- numbers */

static void decimals_are_exact(void **state)
{
    (void)state;
    static const struct {
        const char *text;
        int decimals;
        int64_t value;
    } good[] = {
        {"0.1", 6, 100000},
        {"2.2e6", 6, 2200000000000},
        {"99.999999", 6, 99999999},
        {"-40", 6, -40000000},
        {"0.000001", 6, 1},
        {"1e-6", 6, 1},
        {"10e-7", 6, 1},
        {"1.2000000000000000", 6, 1200000},
        {"-0", 6, 0},
        {"0e999999999999", 6, 0},
        {"+3.25E+2", 6, 325000000},
        {"9223372036854.775807", 6, INT64_MAX},
        {"1e3", 0, 1000},
        {"15.0", 0, 15},
        {"9007199254740993", 0, 9007199254740993}, /* 2^53 + 1: no double */
    };
    for (size_t i = 0; i < sizeof good / sizeof good[0]; i++) {
        __int128 value = -1;
        if (cfg_parse_decimal(good[i].text, good[i].decimals, &value) != CFG_NUMBER_OK || value != good[i].value)
            fail_msg("%s: got %lld", good[i].text, (long long)value);
    }
    static const struct {
        const char *text;
        enum cfg_number why;
    } wrong[] = {
        {"0.0000001", CFG_TOO_FINE},
        {"1e-7", CFG_TOO_FINE},
        {"1e-999999999999", CFG_TOO_FINE},
        {"1e400", CFG_TOO_LARGE},
        {"1234567890123456789012345678901", CFG_TOO_LARGE},
        {"", CFG_NOT_A_NUMBER},
        {"-", CFG_NOT_A_NUMBER},
        {".5", CFG_NOT_A_NUMBER},
        {"1.", CFG_NOT_A_NUMBER},
        {"1.e3", CFG_NOT_A_NUMBER},
        {"1e+", CFG_NOT_A_NUMBER},
        {"1 ", CFG_NOT_A_NUMBER},
        {" 1", CFG_NOT_A_NUMBER},
        {"00", CFG_NOT_A_NUMBER},
        {"-01", CFG_NOT_A_NUMBER},
        {"1.2.3", CFG_NOT_A_NUMBER},
        {"infinity", CFG_NOT_A_NUMBER},
        {"1d5", CFG_NOT_A_NUMBER},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        __int128 value;
        if (cfg_parse_decimal(wrong[i].text, 6, &value) != wrong[i].why)
            fail_msg("%s was taken wrongly", wrong[i].text);
    }
}

static void values_arrive(void **state)
{
    (void)state;
    char file[128];
    assert_loads(load_edited(LINES, "  lines_hz: 99.999999\n  pan_stop_deg: 0.1\n  serial: K-7\n  frames: 1e3\n"));
    snprintf(file, sizeof file, "%s/cube.obj", dir);
    assert_int_equal(cfg->settings.prr_uhz, 500000000000);
    assert_int_equal(cfg->settings.lines_uhz, 99999999);
    assert_int_equal(cfg->settings.pan_stop_udeg, 100000);
    assert_int_equal(cfg->settings.frames, 1000);
    assert_string_equal(cfg->serial, "K-7");
    assert_int_equal(cfg->n_meshes, 1);
    assert_string_equal(cfg->mesh[0].file, file); /* beside the configuration */
    assert_int_equal(cfg->mesh[0].up, SCENE_UP_Z);
    assert_int_equal(cfg->n_stations, 1);
    assert_true(cfg->station[0].position_m[0] == 1 && cfg->station[0].position_m[1] == 2 &&
                cfg->station[0].position_m[2] == 3 && cfg->station[0].heading_deg == 90);
    assert_int_equal(cfg->n_links, 1);
    assert_int_equal(cfg->link[0].type, LINK_TCP);
    assert_string_equal(cfg->file, config_path);
}

static void defaults_are_those_of_the_table(void **state)
{
    (void)state;
    assert_loads(load_edited(PRR LINES, ""));
    /* the profile's: see config/heads/riegl-vz400i.yaml */
    const struct head_settings *s = &cfg->settings;
    assert_int_equal(s->prr_uhz, 1200000000000);
    assert_int_equal(s->lines_uhz, 240000000);
    assert_int_equal(s->pan_udeg_s, 150000000);
    assert_int_equal(s->line_start_udeg, -40000000);
    assert_int_equal(s->line_stop_udeg, 60000000);
    assert_int_equal(s->pan_start_udeg, 0);
    assert_int_equal(s->pan_stop_udeg, 360000000);
    assert_int_equal(s->frames, 1);
    assert_int_equal(s->station, 1);
    assert_string_equal(cfg->station[0].name, "station-1");
    assert_true(cfg->scene_tolerance_m == 1e-6 && cfg->scale_m == 0.0);
    assert_true(cfg->mesh[0].offset_m[0] == 0.0 && cfg->mesh[0].offset_m[2] == 0.0);
    assert_int_equal(cfg->crs, GEOREF_LOCAL);
    assert_int_equal(cfg->layout, LINE_POLAR);
    assert_int_equal(cfg->link[0].max_sessions, 4);
    assert_int_equal(cfg->noise_range, RANGE_NOISE_OFF);
    assert_int_equal(cfg->seed, 1);
    assert_true(cfg->tick_hz == 1000 && cfg->ahead_ms == 64 && cfg->queue_ms == 250 && cfg->late_ms == 100);
    assert_int_equal(cfg->threads, 0);
    assert_int_equal(cfg->pace, PACE_REALTIME);
    assert_string_equal(cfg->time.epoch, "none");
}

static void odd_but_right_configurations_load(void **state)
{
    (void)state;
    assert_loads(load_edited("links:\n  - type: tcp\n    port: 0\n", "")); /* off line */
    assert_int_equal(cfg->n_links, 0);
    assert_loads(load_edited("links:\n  - type: tcp\n    port: 0\n", "links: []\n"));
    assert_loads(load_edited("head:", "\xef\xbb\xbfhead:")); /* byte order mark */
    assert_loads(load_edited("heading_deg: 90", "name: K\xc3\xbc"
                                                "che"));
    assert_loads(
        load_edited("heading_deg: 90", "heading_deg: &turn 90\n  - position_m: [0, 0, 0]\n    heading_deg: *turn"));
    assert_true(cfg->station[1].heading_deg == 90);
    assert_loads(load_edited("type: tcp\n    port: 0", "type: null"));
    assert_int_equal(cfg->link[0].type, LINK_NULL);
    assert_loads(load_edited("output:", "noise: {range: true, seed: 18446744073709551615}\noutput:"));
    assert_int_equal(cfg->noise_range, RANGE_NOISE_ON);
    assert_true(cfg->seed == UINT64_MAX);
    /* A pan at rest, as SCPI has it, too: each line is a frame. */
    assert_loads(load_edited(LINES, "  pan_deg_s: 0\n  frames: 0\n"));
    assert_loads(load_edited(LINES, "  pan_deg_s: 0\n  frames: 7\n"));
    assert_loads(load_edited("output:", "platform: {kind: live, port: 7000}\noutput:"));
    assert_int_equal(cfg->platform.kind, PLATFORM_LIVE);
}

static void places_are_taken_in_each_form(void **state)
{
    (void)state;
    assert_loads(load_edited("heading_deg: 90", "lat_deg: 50\n    lon_deg: 180\n    height_m: 5"));
    assert_int_equal(cfg->station[0].place, PLACE_GEODETIC);
    assert_true(cfg->station[0].has_position && !cfg->station[0].has_instrument_height);
    assert_loads(load_edited("heading_deg: 90", UTM_PLACE "    instrument_height_m: 0"));
    assert_int_equal(cfg->station[0].place, PLACE_UTM);
    assert_int_equal(cfg->station[0].utm_zone, 33);
    assert_true(cfg->station[0].north && cfg->station[0].has_instrument_height);
    /* An anchor in UTM gives zone and hemisphere; without position_m. */
    static const char old[] = "stations:\n  - position_m: [1, 2, 3]\n    heading_deg: 90";
    assert_loads(load_edited(old, "  anchor: {source: utm, utm_zone: 33, hemisphere: north}\nstations:\n"
                                  "  - {easting_m: 5e5, northing_m: 5e6, height_m: 0}"));
    assert_int_equal(cfg->station[0].utm_zone, 33);
    assert_true(cfg->station[0].north && !cfg->station[0].has_position);
    assert_loads(load_edited(old, "  anchor: {source: ecef}\nstations:\n  - {ecef_m: [6378137, 0, 0]}"));
    assert_int_equal(cfg->station[0].place, PLACE_ECEF);
    /* With an anchor, one of both. */
    assert_int_equal(load_edited(old, "  anchor: {source: ecef}\nstations:\n"
                                      "  - {position_m: [1, 2, 3], ecef_m: [6378137, 0, 0]}"),
                     SH_EINPUT);
    assert_says("stations[0].position_m: together with a place on the Earth");
    assert_int_equal(load_edited(old, "  anchor: {source: ecef}\nstations:\n  - {heading_deg: 5}"), SH_EINPUT);
    assert_says("stations[0].position_m: missing, and no place on the Earth is given either");
}

/* ---- --set */

static int load_set(const char *set)
{
    const char *const sets[] = {set};
    write_file(config_path, base, sizeof base - 1);
    return load_sets(sets, 1);
}

static void set_changes_values(void **state)
{
    (void)state;
    assert_loads(load_set("head.prr_hz=2e5"));
    assert_int_equal(cfg->settings.prr_uhz, 200000000000);
    assert_loads(load_set("stations[0].heading_deg=45.5"));
    assert_true(cfg->station[0].heading_deg == 45.5);
    assert_loads(load_set("stations.0.heading_deg=-1"));
    assert_true(cfg->station[0].heading_deg == -1);
    assert_loads(load_set("stations[0].position_m=[4, 5.5, -6]"));
    assert_true(cfg->station[0].position_m[1] == 5.5 && cfg->station[0].position_m[2] == -6);
    assert_loads(load_set("stations[0].position_m=7,8,9"));
    assert_true(cfg->station[0].position_m[2] == 9);
    assert_loads(load_set("head.serial=A=B"));
    assert_string_equal(cfg->serial, "A=B");
    assert_loads(load_set("head.profile=riegl-vz600i"));
    assert_string_equal(cfg->profile.name, "riegl-vz600i");
    assert_int_equal(cfg->settings.line_stop_udeg, 65000000); /* defaults follow the profile */
}

static void set_appends_elements(void **state)
{
    (void)state;
    static const char *const sets[] = {"links[1].path=out.bin", "links[1].type=file", "stations.1.position_m=0,0,2",
                                       "head.station=2",        "head.station=1",     "head.station=2"};
    write_file(config_path, base, sizeof base - 1);
    assert_loads(load_sets(sets, 6));
    assert_int_equal(cfg->n_links, 2);
    assert_int_equal(cfg->link[1].type, LINK_FILE);
    assert_string_equal(cfg->link[1].path, "out.bin"); /* of the working directory, not of the file */
    assert_int_equal(cfg->n_stations, 2);
    assert_int_equal(cfg->settings.station, 2);
    assert_string_equal(cfg->station[1].name, "station-2");
}

static void set_refuses(void **state)
{
    (void)state;
    static const struct {
        const char *set, *key, *fragment;
    } wrong[] = {
        {"head.prr_hz", "head.prr_hz", "no '='"},
        {"=5", "=5", "no key"},
        {"", "", "no '='"},
        {"head.prr=5", "head.prr", "did you mean head.prr_hz?"},
        {"prr_hz=5", "prr_hz", "did you mean head.prr_hz?"},
        {"head.prr_hz=30 kHz", "head.prr_hz", "not a number"},
        {"head.prr_hz=", "head.prr_hz", "not a number"},
        {"head.prr_hz=5e6", "head.prr_hz", "allowed 100000 to 1200000 Hz"},
        {"head=5", "head", "is a section"},
        {"links=[]", "links", "is a list"},
        {"links[0]=tcp", "links[0]", "is a section"},
        {"stations[2].heading_deg=0", "stations[2].heading_deg", "allowed indices 0 to 1, the last appends one"},
        {"links[99999999999999999999].type=tcp", "links[99999999999999999999].type", "allowed indices 0 to 1"},
        {"links[-1].type=tcp", "links[-1].type", "unknown key"},
        {"links[].type=tcp", "links[].type", "no index"},
        {"links[0.type=tcp", "links[0.type", "unknown key"},
        {"links[0]type=tcp", "links[0]type", "unknown key"},
        {"links.type=tcp", "links.type", "unknown key"},
        {"links[0].typ=tcp", "links[0].typ", "did you mean links[0].type?"},
        {"links[1].port=5", "links[1].type", "missing"},
        {"stations[0].position_m=1,2", "stations[0].position_m", "[x, y, z]"},
        {"stations[0].position_m=[1,2,3", "stations[0].position_m", "[x, y, z]"},
        {"stations[0].position_m=1,2,3,4", "stations[0].position_m", "not a number"},
        {"stations[0].name=\xff", "stations[0].name", "not UTF-8"},
        {"stations[0].name=a\nb", "stations[0].name", "control characters"},
        {"output.crs=utm", "stations[0].lat_deg", "missing"},
        {"head.profile=nosuch", "head.profile", "no profile \"nosuch\""},
        {"output.scale_m=1e-7", "output.scale_m", "1e-6 to 1 m"},
        {"loop.tick_hz=999", "loop.tick_hz", "a divisor of 1e9"},
        {"links[0].type=pty", "links[0].port", "a pty link has no such key"},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        char start[128], in_file[192];
        snprintf(start, sizeof start, "--set %s: ", wrong[i].key);
        snprintf(in_file, sizeof in_file, "%s:", config_path); /* where the file is at fault together with --set */
        if (load_set(wrong[i].set) != SH_EINPUT) fail_msg("%s was taken", wrong[i].set);
        int elsewhere = strcmp(wrong[i].set, "output.crs=utm") == 0 || strcmp(wrong[i].set, "links[0].type=pty") == 0;
        const char *expected = elsewhere ? in_file : start;
        if (strncmp(err.text, expected, strlen(expected)) != 0) fail_msg("%s: %s", wrong[i].set, err.text);
        assert_says(wrong[i].fragment);
        assert_says(wrong[i].key);
    }
}

static void a_full_list_takes_no_more(void **state)
{
    (void)state;
    char text[8][32];
    const char *sets[8];
    for (int i = 0; i < 8; i++) {
        snprintf(text[i], sizeof text[i], "links[%d].type=null", i + 1);
        sets[i] = text[i];
    }
    write_file(config_path, base, sizeof base - 1);
    assert_loads(load_sets(sets, 7));
    assert_int_equal(cfg->n_links, 8);
    assert_int_equal(load_sets(sets, 8), SH_EINPUT);
    assert_says("--set links[8].type: links has 8 elements; allowed indices 0 to 7");
}

/* ---- profiles */

static void shipped_files_load(void **state)
{
    (void)state;
    static const char *const heads[] = {"riegl-vz400i", "riegl-vz600i", "leica-rtc360", "full-sweep"};
    for (size_t i = 0; i < 4; i++) {
        char set[64];
        snprintf(set, sizeof set, "head.profile=%s", heads[i]);
        assert_loads(load_set(set));
        assert_string_equal(cfg->profile.name, heads[i]);
        assert_true(cfg->profile.spin_up_s + cfg->ahead_ms * 1e-3 < 0.1); /* command to beam */
    }
    /* The whole sweep is the field of view, without rounding. */
    assert_true(360.0 / cfg->profile.facets * cfg->profile.optical_gain == 100.0);
    assert_int_equal(cfg->profile.fov_max_udeg - cfg->profile.fov_min_udeg, 100000000);
    static const char *const ready[] = {"config/demo.yaml", "config/vz600i_house.yaml"};
    if (access("/usr/share/assimp/models/IFC/AC14-FZK-Haus.ifc", R_OK) != 0) {
        print_message("the house model is not installed: ready configurations not loaded\n");
        return;
    }
    for (size_t i = 0; i < 2; i++)
        assert_loads(config_load(ready[i], NULL, 0, cfg, &err));
}

static void profiles_give_their_figures(void **state)
{
    (void)state;
    assert_loads(load_set("head.profile=leica-rtc360"));
    /* Leica RTC360 data sheet: 0.5 to 130 m, 1.0 mm + 10 ppm, 300 deg */
    const struct config_profile *p = &cfg->profile;
    assert_true(p->range_min_m == 0.5 && p->range_max_m == 130 && p->range_sigma_m == 0.001 &&
                p->range_sigma_ppm == 10);
    assert_int_equal(p->fov_max_udeg - p->fov_min_udeg, 300000000);
    assert_string_equal(p->maker, "Leica");
}

/* Reads a shipped profile, replaces `old` by `with` and loads it as heads/mine.yaml beside the configuration.
 */
static int load_profile(const char *old, const char *with)
{
    char text[8192];
    FILE *file = fopen("config/heads/leica-rtc360.yaml", "rb");
    assert_non_null(file);
    size_t len = fread(text, 1, sizeof text - 1, file);
    fclose(file);
    text[len] = '\0';
    char *at = strstr(text, old), changed[8448];
    assert_non_null(at);
    snprintf(changed, sizeof changed, "%.*s%s%s", (int)(at - text), text, with, at + strlen(old));
    write_in("heads/mine.yaml", changed);
    return load_edited("riegl-vz400i\n  prr_hz: 500000\n  lines_hz: 100", "mine");
}

static void malformed_profiles_are_refused(void **state)
{
    (void)state;
    static const struct {
        const char *old, *with, *key, *fragment;
    } wrong[] = {
        {"{ value: 130, from: data sheet }", "130", "range_max_m", "allowed { value: V, from: data sheet }"},
        {"{ value: 130, from: data sheet }", "{ value: 130 }", "range_max_m", "\"from\" is missing"},
        {"{ value: 130, from: data sheet }", "{ from: assumed }", "range_max_m", "\"value\" is missing"},
        {"{ value: 130, from: data sheet }", "{ value: 130, from: hearsay }", "range_max_m",
         "allowed data sheet, assumed"},
        {"{ value: 130, from: data sheet }", "{ value: 130, from: [] }", "range_max_m", "allowed data sheet, assumed"},
        {"{ value: 130, from: data sheet }", "{ value: 130 m, from: assumed }", "range_max_m", "not a number"},
        {"{ value: 130, from: data sheet }", "{ value: 1, value: 2, from: assumed }", "range_max_m", "given twice"},
        {"{ value: 130, from: data sheet }", "{ value: 1, note: 2, from: assumed }", "range_max_m", "unknown"},
        {"{ value: 130, from: data sheet }", "{ value: 0.4, from: assumed }", "range_min_m", "below range_max_m"},
        {"{ value: 0.00088, from: assumed }", "{ value: 0.002, from: assumed }", "range_sigma_floor_m",
         "above range_sigma_m"},
        {"range_m: 130, from: assumed", "range_m: 130", "reaches[0].from", "missing"},
        {"range_m: 130, from: assumed", "range_m: 130, from: memory", "reaches[0].from", "allowed data sheet, assumed"},
        {"range_m: 130, from: assumed }",
         "range_m: 130, from: assumed }\n  - { reflectance: 0.2, range_m: 140, from: assumed }", "reaches",
         "falls at least with the square of the range"},
        {"range_max_m:", "range_mx_m:", "range_mx_m", "did you mean range_max_m?"},
        {"range_max_m: { value: 130, from: data sheet }\n", "", "range_max_m", "missing"},
        {"facets: { value: 1,", "facets: { value: 2,", "fov_max_deg", "allowed up to 180 deg"},
        {"facets: { value: 1,", "facets: { value: 0,", "facets", "1 to 360"},
        {"optical_gain: { value: 1,", "optical_gain: { value: 2,", "optical_gain", "allowed up to 360"},
        {"beam_divergence_rad: { value: 0.0005,", "beam_divergence_rad: { value: 0.5,", "beam_divergence_rad",
         "0 to 0.01"},
        {"max_echoes: { value: 1,", "max_echoes: { value: 16,", "max_echoes", "1 to 15"},
        {"lines_min_hz: { value: 5,", "lines_min_hz: { value: 0.2,", "lines_min_hz", "allowed 0.25 to"},
        {"lines_min_hz: { value: 5,", "lines_min_hz: { value: 201,", "lines_min_hz", "at most lines_max_hz"},
        {"prr_min_hz: { value: 100000,", "prr_min_hz: { value: 2000001,", "prr_min_hz", "at most prr_max_hz"},
        {"pan_max_deg: { value: 180,", "pan_max_deg: { value: 0,", "pan_max_deg", "above pan_min_deg"},
        {"fov_min_deg: { value: -60,", "fov_min_deg: { value: 240,", "fov_min_deg", "below fov_max_deg"},
        {"model: RTC360", "model: a,b", "model", "without comma"},
        {"model: RTC360", "model: { value: RTC360, from: data sheet }", "model", "here stands a section"},
    };
    assert_loads(load_profile("RTC360", "RTC360"));
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        char start[128], key[64];
        if (load_profile(wrong[i].old, wrong[i].with) != SH_EINPUT) fail_msg("%s was taken", wrong[i].with);
        snprintf(start, sizeof start, "%s/heads/mine.yaml:", dir);
        snprintf(key, sizeof key, ": %s: ", wrong[i].key);
        if (strncmp(err.text, start, strlen(start)) != 0) fail_msg("%s: %s", wrong[i].with, err.text);
        assert_says(key);
        assert_says(wrong[i].fragment);
    }
}

static void a_range_beyond_31_bits_is_refused(void **state)
{
    (void)state;
    /* 2^31 * 1e-6 m = 2147.48 m: 2147 m fit, 2148 m do not. */
    char *text = edited("riegl-vz400i\n  prr_hz: 500000\n  lines_hz: 100", "mine");
    for (int far_m = 2147; far_m <= 2148; far_m++) {
        char value[64];
        snprintf(value, sizeof value, "range_max_m: { value: %d,", far_m);
        assert_loads(load_profile("range_max_m: { value: 130,", value));
        const char *const sets[] = {"output.scale_m=1e-6"};
        write_file(config_path, text, strlen(text));
        int code = load_sets(sets, 1);
        assert_int_equal(code, far_m == 2147 ? SH_OK : SH_EINPUT);
    }
    assert_says("--set output.scale_m: 1e-06 is too fine");
    free(text);
}

static void a_slow_pulse_rate_needs_slow_lines(void **state)
{
    (void)state;
    assert_loads(load_profile("prr_min_hz: { value: 100000,", "prr_min_hz: { value: 10,"));
    char *text =
        edited("riegl-vz400i\n  prr_hz: 500000\n  lines_hz: 100", "mine\n  prr_hz: 100\n  lines_hz: 100.000001");
    assert_int_equal(load_text(text), SH_EINPUT);
    assert_says(":3: head.prr_hz: less than a pulse per line");
    free(text);
}

static void profiles_are_looked_up_in_order(void **state)
{
    (void)state;
    char env[256], path[128];
    assert_loads(load_profile("model: RTC360", "model: mine"));
    assert_string_equal(cfg->profile.model, "mine"); /* heads/ beside the configuration */
    snprintf(path, sizeof path, "%s/heads/mine.yaml", dir);
    assert_string_equal(cfg->profile_file, path);
    assert_loads(load_edited("riegl-vz400i\n  prr_hz: 500000", "heads/mine.yaml")); /* relative to the file */
    assert_string_equal(cfg->profile.name, "mine");
    snprintf(env, sizeof env, "%s", getenv("SCANHEAD_HEADS"));
    snprintf(path, sizeof path, "%s/first", dir);
    mkdir(path, 0700);
    write_in("first/mine.yaml", "maker: first\n");
    setenv("SCANHEAD_HEADS", path, 1);
    assert_int_equal(load_edited("riegl-vz400i", "mine"), SH_EINPUT);
    assert_says("first/mine.yaml:1: model: missing"); /* the variable goes before heads/ */
    setenv("SCANHEAD_HEADS", env, 1);
}

static void profiles_are_listed(void **state)
{
    (void)state;
    char *text = NULL;
    size_t len = 0;
    FILE *out = open_memstream(&text, &len);
    assert_int_equal(config_list_profiles("config/heads", out, &err), 4);
    fclose(out);
    assert_non_null(strstr(text, "leica-rtc360"));
    assert_non_null(strstr(text, "Leica RTC360; data sheet: range_min_m, range_max_m, range_sigma_m, range_sigma_ppm"));
    int lines = 0;
    for (const char *p = text; *p != '\0'; p++)
        lines += *p == '\n';
    assert_int_equal(lines, 4);
    free(text);
    assert_int_equal(config_list_profiles("/nonexistent", stdout, &err), SH_EINPUT);
    assert_says("/nonexistent");
}

/* ---- the table itself */

static void the_reference_names_every_key(void **state)
{
    (void)state;
    char *text = NULL, line[CFG_PATH_MAX + 2];
    size_t len = 0;
    FILE *out = open_memstream(&text, &len);
    config_print_reference(out);
    fclose(out);
    const struct cfg_table *tables[] = {&cfg_config_table, &cfg_profile_table};
    for (int t = 0; t < 2; t++)
        for (size_t i = 0; i < tables[t]->n; i++) {
            const struct cfg_key *key = &tables[t]->keys[i];
            snprintf(line, sizeof line, "\n%s\n", key->path);
            if (strstr(text, line) == NULL || strstr(text, key->help) == NULL) fail_msg("%s is not there", key->path);
        }
    free(text);
}

static void rows_are_sound(void **state)
{
    (void)state;
    const struct cfg_table *tables[] = {&cfg_config_table, &cfg_profile_table};
    for (int t = 0; t < 2; t++)
        for (size_t i = 0; i < tables[t]->n; i++) {
            const struct cfg_key *key = &tables[t]->keys[i];
            int sized = key->type == CFG_MICRO || key->type == CFG_REAL  ? key->size == 8
                        : key->type == CFG_COUNT                         ? key->size == 4 || key->size == 8
                        : key->type == CFG_BOOL || key->type == CFG_ENUM ? key->size == sizeof(int)
                        : key->type == CFG_VEC3                          ? key->size == 3 * sizeof(double)
                                                                         : 1;
            if (!sized) fail_msg("%s: its member has another size than its type", key->path);
            if (cfg_find(tables[t], key->path) != key) fail_msg("%s stands twice", key->path);
            if (key->def != NULL && key->def[0] == '@') assert_non_null(cfg_find(&cfg_profile_table, key->def + 1));
            if (key->max_key != NULL) assert_non_null(cfg_find(&cfg_profile_table, key->max_key));
            if (key->min_key != NULL) assert_non_null(cfg_find(&cfg_profile_table, key->min_key));
            if (strstr(key->path, "[]") != NULL) assert_non_null(cfg_list_of(tables[t], key));
            assert_non_null(key->help);
        }
}

/* ---- damaged files */

static uint32_t next_random(uint32_t *x) /* xorshift32, Marsaglia 2003 */
{
    *x ^= *x << 13;
    *x ^= *x >> 17;
    return *x ^= *x << 5;
}

/* Any bytes give a configuration or one line of error; sanitizers look for the rest. */
static void damaged_files_never_crash(void **state)
{
    (void)state;
    unsigned char demo[4096], text[4096];
    FILE *file = fopen("config/demo.yaml", "rb");
    assert_non_null(file);
    size_t len = fread(demo, 1, sizeof demo, file);
    fclose(file);
    assert_in_range(len, 500, sizeof demo - 1);
    static const char spice[] = ":-[]{}#&*!|>'\"%@`,?\n\t 09.eE~\\";
    uint32_t x = 20240229;
    for (int round = 0; round < 2000; round++) {
        memcpy(text, demo, len);
        size_t now = len;
        for (uint32_t k = next_random(&x) % 4 + 1; k > 0; k--) {
            size_t at = next_random(&x) % now;
            uint32_t how = next_random(&x) % 4;
            if (how == 0)
                text[at] = (unsigned char)next_random(&x);
            else if (how < 3)
                text[at] = (unsigned char)spice[next_random(&x) % (sizeof spice - 1)];
            else
                memmove(text + at, text + at + 1, --now - at);
        }
        write_file(config_path, text, now);
        int code = load_sets(NULL, 0);
        assert_true(code == SH_OK || code == SH_EINPUT);
        assert_int_equal(err.code, code);
        if (code != SH_OK && strpbrk(err.text, "\n\r") != NULL) fail_msg("round %d: %s", round, err.text);
    }
}

static int set_up(void **state)
{
    (void)state;
    char path[512];
    snprintf(dir, sizeof dir, "/tmp/test_config.XXXXXX");
    if (mkdtemp(dir) == NULL || getcwd(path, sizeof path - 16) == NULL) return -1;
    strcat(path, "/config/heads");
    setenv("SCANHEAD_HEADS", path, 1);
    snprintf(config_path, sizeof config_path, "%s/test.yaml", dir);
    snprintf(path, sizeof path, "%s/heads", dir);
    if (mkdir(path, 0700) != 0) return -1;
    snprintf(path, sizeof path, "%s/dir.obj", dir);
    if (mkdir(path, 0700) != 0) return -1;
    write_in("cube.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    cfg = malloc(sizeof *cfg);
    return cfg == NULL ? -1 : 0;
}

static int tear_down(void **state)
{
    (void)state;
    static const char *const made[] = {"test.yaml", "cube.obj", "heads/mine.yaml", "first/mine.yaml",
                                       "first",     "heads",    "dir.obj",         ""};
    char path[256];
    free(cfg);
    for (size_t i = 0; i < sizeof made / sizeof made[0]; i++) {
        snprintf(path, sizeof path, "%s/%s", dir, made[i]);
        remove(path);
    }
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(malformed_configurations_are_refused),
        cmocka_unit_test(files_that_are_none_are_refused),
        cmocka_unit_test(decimals_are_exact),
        cmocka_unit_test(values_arrive),
        cmocka_unit_test(defaults_are_those_of_the_table),
        cmocka_unit_test(odd_but_right_configurations_load),
        cmocka_unit_test(places_are_taken_in_each_form),
        cmocka_unit_test(set_changes_values),
        cmocka_unit_test(set_appends_elements),
        cmocka_unit_test(set_refuses),
        cmocka_unit_test(a_full_list_takes_no_more),
        cmocka_unit_test(shipped_files_load),
        cmocka_unit_test(profiles_give_their_figures),
        cmocka_unit_test(malformed_profiles_are_refused),
        cmocka_unit_test(a_range_beyond_31_bits_is_refused),
        cmocka_unit_test(a_slow_pulse_rate_needs_slow_lines),
        cmocka_unit_test(profiles_are_looked_up_in_order),
        cmocka_unit_test(profiles_are_listed),
        cmocka_unit_test(the_reference_names_every_key),
        cmocka_unit_test(rows_are_sound),
        cmocka_unit_test(damaged_files_never_crash),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
