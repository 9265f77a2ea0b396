/* SPDX-License-Identifier: MIT */
/* These are tests of scanhead report. A noise-free recording deviates by no more than plan and counts allow, a noisy
 * one by its noise, in all layouts. Contradictions are reported. The page is complete for any names. */
#include "tests/wire/room.h"

enum { MAX_SETS = 10 };

/* Some names have characters that a page must escape. The room's walls are planes between x, y and z of ROOM_MIN and
 * ROOM_MAX. */
static const char CONFIG[] =
    "head: {profile: full-sweep, prr_hz: 20000, lines_hz: 100, pan_deg_s: 240, frames: 1}\n"
    "scene:\n  meshes: [{file: room.obj, up: z, scale: 1}]\n"
    "  anchor: {source: explicit, origin_m: [0, 0, 0], lat_deg: 52, lon_deg: 13, height_m: 100}\n"
    "stations: [{name: 'a<b>&\"c', position_m: [0.31, -0.42, 0.17], heading_deg: 30}]\n"
    "beam: {mode: single}\n";

static int run(struct wire *wire, const char *out, const char *const *first, const char *const *sets)
{
    const char *args[WIRE_MAX_ARGS];
    size_t n = 0;
    while (*first != NULL)
        args[n++] = *first++;
    for (; sets != NULL && *sets != NULL; sets++) {
        args[n++] = "--set";
        args[n++] = *sets;
    }
    args[n] = NULL;
    return wire_wait(wire, wire_spawn(wire, args, out, "err", -1));
}

static void prepare(struct wire *wire, char config[256])
{
    room_write(wire);
    snprintf(config, 256, "%s", wire_write_text(wire, "config.yaml", CONFIG));
}

static void record(struct wire *wire, const char *name, const char *const *sets)
{
    char config[256], cloud[256];
    prepare(wire, config);
    snprintf(cloud, sizeof cloud, "%s", wire_path(wire, name));
    const char *const args[] = {"record", config, "-o", cloud, "--quiet", NULL};
    if (run(wire, "out", args, sets) == 0) return;
    wire_show(wire, "err");
    fail_msg("recording %s", name);
}

/* Returns the report as JSON; free it. */
static char *report(struct wire *wire, const char *name, const char *const *sets)
{
    char config[256], cloud[256];
    prepare(wire, config);
    snprintf(cloud, sizeof cloud, "%s", wire_path(wire, name));
    const char *const args[] = {"report", config, cloud, "--json", "--tolerance-m", "1", "--quiet", NULL};
    if (run(wire, "report.json", args, sets) != 0) {
        wire_show(wire, "err");
        fail_msg("report of %s", name);
    }
    return wire_read(wire_path(wire, "report.json"), NULL);
}

/* Returns the number after the first `key` after the first `after`. */
static double number(const char *json, const char *after, const char *key)
{
    char quoted[64];
    const char *at = strstr(json, after);
    snprintf(quoted, sizeof quoted, "\"%s\": ", key);
    if (at == NULL || (at = strstr(at, quoted)) == NULL) fail_msg("no %s after %s", key, after);
    return atof(at + strlen(quoted));
}

static void must_say(const char *json, const char *judgement)
{
    char expected[64];
    snprintf(expected, sizeof expected, "\"judgement\": \"%s\"", judgement);
    if (strstr(json, expected) == NULL) fail_msg("not %s: %.300s", judgement, strstr(json, "\"verdict\""));
}

/* Returns the longest range in the room, from the station to the farthest corner. */
static double farthest_m(void)
{
    double sum = 0.0;
    for (int k = 0; k < 3; k++)
        sum += pow(fmax(ROOM_MAX[k] - STATION[k], STATION[k] - ROOM_MIN[k]), 2);
    return sqrt(sum);
}

/* The bound of a point's error, worked out by hand. The bound is 1e-6 m of the cast and the tolerance of georeferencing
 * (the cheapest method has to hold 1e-5 m here). Half a count an axis is added, and half a count of each encoder, which
 * has 2^20. */
static void noise_free_scans_hold_the_bound(void **state)
{
    struct wire *wire = *state;
    static const struct {
        const char *file, *set[MAX_SETS];
        double georef_m, count_m;
    } row[] = {
        {"polar.ply", {"output.layout=polar"}, 0.0, 1e-6},
        {"utm.las",
         {"output.layout=geo", "output.crs=utm", "output.tolerance_m=1e-5", "output.scale_m=0.001"},
         1e-5,
         1e-3},
        {"ecef.ply", {"output.layout=geo", "output.crs=ecef", "output.tolerance_m=1e-5"}, 1e-5, 1e-6},
    };
    const double encoders_m = M_SQRT1_2 * 2.0 * M_PI / 1048576.0 * farthest_m();
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        const double bound_m = 1e-6 + row[i].georef_m + 0.5 * sqrt(3.0) * row[i].count_m + encoders_m;
        record(wire, row[i].file, row[i].set);
        char *json = report(wire, row[i].file, row[i].set);
        const double most_m = number(json, "{", "max_m"), said_m = number(json, "\"verdict\"", "bound_m");
        print_message("# %s: at most %.3g um, %.3g um said, %.3g um by hand\n", row[i].file, 1e6 * most_m, 1e6 * said_m,
                      1e6 * bound_m);
        must_say(json, "within");
        assert_true(number(json, "{", "points") > 10000.0);
        assert_true(most_m <= said_m && said_m <= bound_m);
        assert_true(most_m > 0.25 * row[i].count_m); /* counts do show */
        free(json);
    }
}

/* Checks the text, with a second station that has no points. */
static void verdict_is_said_once(struct wire *wire, const char *name, const char *const *sets)
{
    static const char verdict[] = "Within the expected error";
    char config[256], cloud[256];
    prepare(wire, config);
    snprintf(cloud, sizeof cloud, "%s", wire_path(wire, name));
    const char *const args[] = {"report",
                                config,
                                cloud,
                                "--tolerance-m",
                                "1",
                                "--set",
                                "stations.1.position_m=0,0,0.1",
                                "--set",
                                "stations.1.name=empty",
                                NULL};
    if (run(wire, "out", args, sets) != 0) wire_show(wire, "err");
    char *text = wire_read(wire_path(wire, "out"), NULL), *first = strstr(text, verdict);
    assert_non_null(first);
    assert_null(strstr(first + 1, verdict));
    free(text);
}

/* The RMS of n normal deviations scatters by 1 / sqrt(2 n) of itself. Six times that is exceeded once in 5e8 runs, and
 * the seed is fixed. full-sweep's sigma is 3 mm. */
static void a_noisy_scan_deviates_by_its_noise(void **state)
{
    struct wire *wire = *state;
    static const char *const on[] = {"output.layout=geo", "output.crs=utm", "noise.range=on", NULL};
    static const char *const off[] = {"output.layout=geo", "output.crs=utm", NULL};
    record(wire, "noisy.ply", on);
    char *json = report(wire, "noisy.ply", on);
    const double n = number(json, "\"all\"", "judged"), rms_m = number(json, "\"all\"", "judged_rms_m");
    print_message("# %.0f points, RMS %.4f mm\n", n, 1e3 * rms_m);
    must_say(json, "within");
    assert_true(n > 10000.0);
    if (fabs(rms_m / 0.003 - 1.0) > 6.0 / sqrt(2.0 * n)) fail_msg("RMS %g m", rms_m);
    assert_true(fabs(number(json, "\"all\"", "expected_rms_m") / 0.003 - 1.0) < 1e-4); /* counts add 1e-5 m */
    /* Figures in the text have four decimals, and the only station is judged like the whole. */
    const double least = number(json, "\"verdict\"", "least_rms_sigmas"),
                 most = number(json, "\"verdict\"", "most_rms_sigmas");
    char allowed[64];
    snprintf(allowed, sizeof allowed, "allowed %.4f to %.4f;", least, most);
    if (strstr(json, allowed) == NULL) fail_msg("not in the text: %s", allowed);
    assert_true(least > 0.9 && least < 1.0 && most > 1.0);
    assert_true(number(json, "\"stations\"", "least_rms_sigmas") == least);
    free(json);
    verdict_is_said_once(wire, "noisy.ply", on);
    /* The same cloud does not fit a head without noise. */
    json = report(wire, "noisy.ply", off);
    must_say(json, "beyond");
    free(json);
}

/* In a ball of 5 mm the mean distance from a plane is 3/8 of the radius (|x| for x uniform in the unit ball). The
 * distance's scatter is 0.244 of the radius. Six standard errors of 10,000 points are 1.5 % of the radius. */
static void noise_of_balls_and_angles_is_known(void **state)
{
    struct wire *wire = *state;
    static const char *const ball[] = {"output.layout=polar", "noise.ball.radius_m=0.005", NULL};
    static const char *const angle[] = {"head.profile=riegl-vz400i",
                                        "head.prr_hz=100000",
                                        "head.pan_deg_s=100",
                                        "head.pan_stop_deg=60",
                                        "output.layout=polar",
                                        "noise.angle=on",
                                        NULL};
    record(wire, "ball.ply", ball);
    char *json = report(wire, "ball.ply", ball);
    must_say(json, "within");
    const double most_m = number(json, "{", "max_m"), mean_m = number(json, "{", "mean_m");
    assert_true(most_m <= 0.005 + 1e-4 && most_m > 0.0045);
    if (fabs(mean_m - 0.375 * 0.005) > 0.015 * 0.005) fail_msg("mean %g m", mean_m);
    free(json);
    record(wire, "angle.ply", angle);
    json = report(wire, "angle.ply", angle);
    must_say(json, "within");
    assert_non_null(strstr(json, "\"bound_m\": null")); /* Gaussian noise has none */
    assert_true(number(json, "\"all\"", "judged") > 10000.0);
    free(json);
}

/* A station with a scanner of its own is judged by that scanner. One station is without noise, one with it. */
static void stations_are_judged_by_their_scanners(void **state)
{
    struct wire *wire = *state;
    char config[256], cloud[256];
    static const char two[] = "head: {profile: full-sweep, prr_hz: 10000, lines_hz: 100, pan_deg_s: 240, frames: 1}\n"
                              "scene: {meshes: [{file: room.obj, up: z, scale: 1}]}\n"
                              "stations:\n  - {position_m: [0.31, -0.42, 0.17]}\n"
                              "  - {position_m: [1, 1, 0.2], scanner: {noise: {range: 'on'}}}\n"
                              "beam: {mode: single}\n";
    room_write(wire);
    snprintf(config, sizeof config, "%s", wire_write_text(wire, "two.yaml", two));
    snprintf(cloud, sizeof cloud, "%s", wire_path(wire, "two.las"));
    const char *const scan[] = {"record", config, "--station", "all", "-o", cloud, "--quiet", NULL};
    const char *const args[] = {"report", config, cloud, "--json", "--tolerance-m", "1", "--quiet", NULL};
    assert_int_equal(run(wire, "out", scan, NULL), 0);
    assert_int_equal(run(wire, "report.json", args, NULL), 0);
    char *json = wire_read(wire_path(wire, "report.json"), NULL);
    must_say(json, "within");
    const char *second = strstr(strstr(json, "\"stations\""), "\"station\": 2");
    assert_non_null(second);
    must_say(second, "within");
    assert_true(number(json, "\"stations\"", "max_m") < 1e-4); /* of the first one */
    assert_true(fabs(number(second, "2", "judged_rms_m") - 0.003) < 2e-4);
    free(json);
}

/* With a footprint only points on smooth faces are judged. A cloud of another place has none, so it must not pass.
 * It lies in the room's middle, or farther than everything. A place whose square is infinite as a double is far. */
static void another_place_does_not_pass(void **state)
{
    struct wire *wire = *state;
    static const char *const footprint[] = {"head.profile=riegl-vz400i", "head.prr_hz=100000", "head.pan_deg_s=100",
                                            "output.layout=polar",       "beam.mode=adaptive", NULL};
    static const struct {
        const char *points, *judgement, *far;
    } row[] = {{"1 1 0.5\n1.2 1 0.5\n", "not judged", "\"far\": 0"},
               {"900 0 0\n901 0 0\n", "beyond", "\"far\": 2"},
               {"-1e300 0 0.1\n901 0 0\n", "beyond", "\"far\": 2"}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        char text[300];
        snprintf(text, sizeof text,
                 "ply\nformat ascii 1.0\nelement vertex 2\nproperty double x\nproperty double y\nproperty double z\n"
                 "end_header\n%s",
                 row[i].points);
        char config[256], cloud[256];
        prepare(wire, config);
        snprintf(cloud, sizeof cloud, "%s", wire_write_text(wire, "other.ply", text));
        const char *const args[] = {"report", config, cloud, "--json", NULL};
        if (run(wire, "other.json", args, footprint) != 1) wire_show(wire, "err"); /* beyond the tolerance */
        char *json = wire_read(wire_path(wire, "other.json"), NULL);
        must_say(json, row[i].judgement);
        assert_non_null(strstr(json, row[i].far));
        free(json);
    }
}

/* Elements that are opened are closed, in order. Only these elements have no end. */
static void assert_well_formed(const char *html)
{
    char open[64][32];
    int depth = 0;
    for (const char *p = html; (p = strchr(p, '<')) != NULL;) {
        const char *name = p + 1, *end = strchr(p, '>');
        assert_non_null(end);
        p = end;
        const int closes = *name == '/';
        name += closes;
        const size_t len = strcspn(name, " />\n");
        if (*name == '!' || strncmp(name, "meta", len) == 0 || end[-1] == '/') continue;
        if (!closes) {
            assert_true(depth < 64 && len < sizeof open[0]);
            snprintf(open[depth++], sizeof open[0], "%.*s", (int)len, name);
        } else if (depth == 0 || strlen(open[--depth]) != len || strncmp(open[depth], name, len) != 0) {
            fail_msg("</%.*s> closes nothing at ...%.60s", (int)len, name, name > html + 60 ? name - 60 : html);
        }
    }
    assert_int_equal(depth, 0);
}

/* The page is complete by itself in each case: with one point, with a far one and none, with marks in names. */
static void the_page_is_whole(void **state)
{
    struct wire *wire = *state;
    static const char *const text[] = {
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty double x\nproperty double y\nproperty double z\nend_header\n"
        "5.83 0 0\n",
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty double y\nproperty double z\n"
        "property double time\nproperty uchar echo\nproperty uchar echo_count\nend_header\n"
        "nan nan nan 0 0 0\n900 0 0 nan 1 2\n5 0 0 3 1 1\n"};
    for (int i = 0; i < 2; i++) {
        char config[256], path[256], html[256];
        prepare(wire, config);
        snprintf(path, sizeof path, "%s", wire_write_text(wire, "few & <far>.ply", text[i]));
        snprintf(html, sizeof html, "%s", wire_path(wire, "few.html"));
        const char *const args[] = {"report", config, path, "--html", html, NULL};
        assert_int_equal(run(wire, "out", args, (const char *const[]){"output.layout=polar", NULL}), i);
        char *page = wire_read(html, NULL);
        assert_well_formed(page);
        assert_non_null(strstr(page, "few &amp; &lt;far&gt;.ply"));
        assert_non_null(strstr(page, "a&lt;b&gt;&amp;&quot;c"));
        assert_null(strstr(page, "a<b>"));
        assert_null(strstr(page, "nan"));
        assert_null(strstr(page, "http")); /* nothing from elsewhere */
        free(page);
    }
}

static void wrong_input_is_one_line(void **state)
{
    struct wire *wire = *state;
    char config[256], cloud[256], *text;
    prepare(wire, config);
    snprintf(cloud, sizeof cloud, "%s",
             wire_write_text(wire, "none.ply",
                             "ply\nformat ascii 1.0\nelement vertex 1\nproperty double x\nproperty double y\n"
                             "property double z\nend_header\nnan nan nan\n"));
    const char *const pdf[] = {"report", config, cloud, "--html", "page.pdf", NULL};
    const char *const nowhere[] = {"report", config, cloud, "--html", "/nowhere/page.html", NULL};
    const char *const empty[] = {"report", config, cloud, NULL};
    const char *const *const args[] = {pdf, nowhere, empty};
    static const char *const said[] = {"allowed is a name that ends in .html",
                                       "--html /nowhere/page.html: No such file or directory", "it has no points"};
    for (int i = 0; i < 3; i++) {
        assert_int_equal(run(wire, "out", args[i], (const char *const[]){"output.layout=polar", NULL}), 2);
        text = wire_read(wire_path(wire, "err"), NULL);
        if (strstr(text, said[i]) == NULL) fail_msg("%s", text);
        free(text);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(noise_free_scans_hold_the_bound, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(a_noisy_scan_deviates_by_its_noise, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(noise_of_balls_and_angles_is_known, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(stations_are_judged_by_their_scanners, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(another_place_does_not_pass, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(the_page_is_whole, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(wrong_input_is_one_line, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
