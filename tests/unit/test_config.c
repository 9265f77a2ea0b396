/* SPDX-License-Identifier: MIT */
/* The configuration: accepted and refused ones, and the place that an error names. */
#include "firmware_sim/config/load.h"
#include "firmware_sim/config/table/value.h"
#include "tests/common/thorough.h"
#include "tests/unit/config_cases.h"

/* ---- malformed configurations */

/* Returns whether one of the errors begins with start and has the fragment. */
static int is_told(const char *start, const char *fragment)
{
    for (uint32_t i = 0; i < diagnostics.n && i < CONFIG_MAX_DIAGNOSTICS; i++)
        if (strncmp(diagnostics.err[i].text, start, strlen(start)) == 0 &&
            strstr(diagnostics.err[i].text, fragment) != NULL)
            return 1;
    return 0;
}

static void malformed_configurations_are_refused(void **state)
{
    (void)state;
    for (size_t i = 0; i < n_bad; i++) {
        char start[256];
        int code = bad[i].old == NULL ? load_text(bad[i].with) : load_edited(bad[i].old, bad[i].with);
        int n = snprintf(start, sizeof start, "%s:%d: ", config_path, bad[i].line);
        if (bad[i].key != NULL) snprintf(start + n, sizeof start - (size_t)n, "%s: ", bad[i].key);
        if (code != SH_EINPUT || err.code != code) fail_msg("case %zu (%s): code %d", i, bad[i].with, code);
        if (!is_told(start, bad[i].fragment))
            fail_msg("case %zu (%s): \"%s\", expected \"%s...%s\"", i, bad[i].with, err.text, start, bad[i].fragment);
        for (uint32_t k = 0; k < diagnostics.n; k++)
            if (strpbrk(diagnostics.err[k].text, "\n\r") != NULL) fail_msg("case %zu: more than one line", i);
        /* An edit of base gives one error alone. A whole text gives others, too, as it lacks many keys. */
        if (bad[i].old != NULL && diagnostics.n != 1)
            fail_msg("case %zu (%s): %u faults: %s, %s", i, bad[i].with, diagnostics.n, diagnostics.err[0].text,
                     diagnostics.err[1].text);
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
    long_path[500] = '\0'; /* allowed are 511, with the folder */
    assert_int_equal(load_edited("cube.obj", long_path), SH_EINPUT);
    assert_says("too long with the folder of its file; allowed a path of 1 to 511 bytes");
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
        if (cfg_parse_decimal(good[i].text, good[i].decimals, &value) != NULL || value != good[i].value)
            fail_msg("%s: got %lld", good[i].text, (long long)value);
    }
    static const struct {
        const char *text;
        const char *why;
    } wrong[] = {
        {"0.0000001", "finer than 6 decimals"},
        {"1e-7", "finer than 6 decimals"},
        {"1e-999999999999", "finer than 6 decimals"},
        {"1e400", "out of range"},
        {"1234567890123456789012345678901", "out of range"},
        {"", "not a number"},
        {"-", "not a number"},
        {".5", "not a number"},
        {"1.", "not a number"},
        {"1.e3", "not a number"},
        {"1e+", "not a number"},
        {"1 ", "not a number"},
        {" 1", "not a number"},
        {"00", "not a number"},
        {"-01", "not a number"},
        {"1.2.3", "not a number"},
        {"infinity", "not a number"},
        {"1d5", "not a number"},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        __int128 value;
        const char *why = cfg_parse_decimal(wrong[i].text, 6, &value);
        if (why == NULL || strcmp(why, wrong[i].why) != 0) fail_msg("%s was taken wrongly", wrong[i].text);
    }
}

static void values_arrive(void **state)
{
    (void)state;
    char file[128];
    assert_loads(load_edited(LINES, "  lines_hz: 99.999999\n  pan_stop_deg: 0.1\n  serial: K-7\n  frames: 1e3\n"));
    snprintf(file, sizeof file, "%s/cube.obj", dir);
    assert_int_equal(cfg->head.settings.prr_uhz, 500000000000);
    assert_int_equal(cfg->head.settings.lines_uhz, 99999999);
    assert_int_equal(cfg->head.settings.pan_stop_udeg, 100000);
    assert_int_equal(cfg->head.settings.frames, 1000);
    assert_string_equal(cfg->head.serial, "K-7");
    assert_int_equal(cfg->scene.n_meshes, 1);
    assert_string_equal(cfg->scene.mesh[0].file, file); /* beside the configuration */
    assert_int_equal(cfg->scene.mesh[0].up, SCENE_UP_Z);
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
    /* the profile's: see config/heads/any-rate.yaml */
    const struct head_settings *s = &cfg->head.settings;
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
    assert_true(cfg->scene.import.memory_mib == scene_import_defaults.memory_mib &&
                cfg->scene.import.time_s == scene_import_defaults.time_s &&
                cfg->scene.import.files == scene_import_defaults.files);
    assert_true(cfg->scene.tolerance_m == 1.0 && cfg->output.scale_m == 0.0);
    assert_true(cfg->scene.mesh[0].offset_m[0] == 0.0 && cfg->scene.mesh[0].offset_m[2] == 0.0);
    assert_int_equal(cfg->output.crs, GEOREF_LOCAL);
    assert_int_equal(cfg->output.layout, LINE_POLAR);
    assert_int_equal(cfg->link[0].max_sessions, 4);
    assert_int_equal(cfg->noise.range, RANGE_NOISE_OFF);
    assert_int_equal(cfg->noise.seed, 1);
    assert_true(cfg->loop.tick_hz == 1000 && cfg->loop.ahead_ms == 64 && cfg->loop.queue_ms == 250 &&
                cfg->loop.late_ms == 100);
    assert_int_equal(cfg->loop.threads, 0);
    assert_int_equal(cfg->loop.pace, PACE_REALTIME);
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
    assert_int_equal(cfg->noise.range, RANGE_NOISE_ON);
    assert_true(cfg->noise.seed == UINT64_MAX);
    /* A pan at rest, as in SCPI: each line is a frame. */
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
    /* An anchor in UTM gives zone and hemisphere. There is no position_m. */
    static const char old[] = "stations:\n  - position_m: [1, 2, 3]\n    heading_deg: 90";
    assert_loads(load_edited(old, "  anchor: {source: utm, utm_zone: 33, hemisphere: north}\nstations:\n"
                                  "  - {easting_m: 5e5, northing_m: 5e6, height_m: 0}"));
    assert_int_equal(cfg->station[0].utm_zone, 33);
    assert_true(cfg->station[0].north && !cfg->station[0].has_position);
    assert_loads(load_edited(old, "  anchor: {source: ecef}\nstations:\n  - {ecef_m: [6378137, 0, 0]}"));
    assert_int_equal(cfg->station[0].place, PLACE_ECEF);
    /* With an anchor, either position_m or a place on the Earth is given. */
    assert_int_equal(load_edited(old, "  anchor: {source: ecef}\nstations:\n"
                                      "  - {position_m: [1, 2, 3], ecef_m: [6378137, 0, 0]}"),
                     SH_EINPUT);
    assert_says("stations[0].position_m: given together with a place on the Earth");
    assert_int_equal(load_edited(old, "  anchor: {source: ecef}\nstations:\n  - {heading_deg: 5}"), SH_EINPUT);
    assert_says("stations[0].position_m: missing, and no place on the Earth is given");
}

static void seeds_follow_that_of_the_noise(void **state)
{
    (void)state;
    assert_loads(load_edited("output:", "noise: {seed: 7, ball: {radius_m: 0.1}}\noutput:"));
    assert_true(cfg->noise.seed == 7 && cfg->noise.ball.seed == 7);
    assert_loads(load_edited("output:", "noise: {seed: 7, ball: {radius_m: 0.1, seed: 0}}\noutput:"));
    assert_true(cfg->noise.seed == 7 && cfg->noise.ball.seed == 0);
}

/* ---- damaged files */

static uint32_t next_random(uint32_t *x) /* xorshift32, Marsaglia 2003 */
{
    *x ^= *x << 13;
    *x ^= *x >> 17;
    return *x ^= *x << 5;
}

enum { DAMAGED = 2000 };

/* Any bytes give a configuration, or errors of one line each. Sanitizers check the rest. */
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
    for (int round = 0; round < fewer(thorough(DAMAGED, DAMAGED / 4)); round++) {
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
        for (uint32_t i = 0; i < diagnostics.n && i < CONFIG_MAX_DIAGNOSTICS; i++)
            if (strpbrk(diagnostics.err[i].text, "\n\r") != NULL)
                fail_msg("round %d: %s", round, diagnostics.err[i].text);
    }
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
        cmocka_unit_test(seeds_follow_that_of_the_noise),
        cmocka_unit_test(damaged_files_never_crash),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
