/* SPDX-License-Identifier: MIT */
/* The figures of a page while a scan is on. For a noise-free scan that the observer sees all of, they are those of
 * `scanhead report` and `scanhead coverage` for the same scan. A noisy scan is judged by its noise, stations follow the
 * head, and the coarse scene is the scene. The answers come by HTTP, as a browser gets them. */
#include <dirent.h>
#include <math.h>
#include <poll.h>
#include <sys/resource.h>

#include "tests/wire/watch_rig.h"

/* Returns the number after the first `key` after the first `after`; NaN: null. */
static double number(const char *json, const char *after, const char *key)
{
    char quoted[64];
    const char *at = strstr(json, after);
    snprintf(quoted, sizeof quoted, "\"%s\":", key);
    if (at == NULL || (at = strstr(at, quoted)) == NULL) fail_msg("no %s after %s in %.400s", key, after, json);
    at += strlen(quoted);
    return strncmp(at, "null", 4) == 0 ? (double)NAN : atof(at);
}

/* Returns how many of a head's threads have a lower priority than its first one. */
static int threads_below(const struct head *head)
{
    char path[64];
    int n = 0;
    snprintf(path, sizeof path, "/proc/%d/task", (int)head->pid);
    DIR *tasks = opendir(path);
    assert_non_null(tasks);
    const int nice = getpriority(PRIO_PROCESS, (id_t)head->pid);
    for (const struct dirent *task; (task = readdir(tasks)) != NULL;)
        n += atoi(task->d_name) > 0 && getpriority(PRIO_PROCESS, (id_t)atoi(task->d_name)) > nice;
    closedir(tasks);
    return n;
}

/* ---- the same scan off line */

static char *report_of(struct wire *wire, const char *config, const char *set)
{
    char cloud[256];
    snprintf(cloud, sizeof cloud, "%s", wire_path(wire, "scan.ply"));
    const char *const record[] = {"record", config, "-o", cloud, "--station", "1", "--empty-shots", "--quiet", NULL};
    const char *const report[] = {"report", config, cloud, "--json", "--tolerance-m", "1", NULL};
    free(watch_command(wire, record, set));
    return watch_command(wire, report, set);
}

static void same(const char *what, double value, double expected, double tolerance)
{
    if (!(fabs(value - expected) <= tolerance)) fail_msg("%s: %.12g, not %.12g", what, value, expected);
}

static double beyond(double v, double lo, double hi)
{
    return fmax(0.0, fmax(lo - v, v - hi));
}

/* The place of the largest distance is so far from SCENE's floor, east and north wall, whose distances are worked out
 * here. */
static void check_place_of_largest(const char *quality)
{
    double p[3];
    const char *at = strstr(quality, "\"max_at\":[");
    assert_non_null(at);
    assert_int_equal(sscanf(at, "\"max_at\":[%lf,%lf,%lf]", &p[0], &p[1], &p[2]), 3);
    const double floor_m = hypot(hypot(beyond(p[0], -4, 4), beyond(p[1], -4, 4)), p[2]);
    const double east_m = hypot(hypot(p[0] - 4, beyond(p[1], -4, 4)), beyond(p[2], 0, 3));
    const double north_m = hypot(hypot(beyond(p[0], -4, 4), p[1] - 4), beyond(p[2], 0, 3));
    same("distance at max_at", fmin(floor_m, fmin(east_m, north_m)), number(quality, "\"all\"", "max_m"), 1e-12);
}

/* The file holds the points as a client decodes them. So distances are the same but for the way back from UTM, whose
 * anchor is made twice: some units in the last place of 5.8e6 m, 1e-9 m each. Densities are of whole points in the same
 * cells: to a float's digits. */
static void check_figures(const char *quality, const char *report)
{
    static const char *const key[] = {"mean_m", "rms_m", "p95_m", "max_m"};
    same("every", number(quality, "{", "every"), 1, 0);
    same("points", number(quality, "{", "points"), number(report, "{", "points"), 0);
    same("sampled", number(quality, "{", "sampled_points"), number(report, "{", "points"), 0);
    const double shots = number(quality, "{", "shots");
    same("empty", number(quality, "{", "empty_share") * shots, number(report, "{", "empty"), 1e-6);
    for (int k = 0; k < 4; k++)
        same(key[k], number(quality, "\"all\"", key[k]), number(report, "{", key[k]), 4e-9);
    check_place_of_largest(quality);
    same("bound", number(quality, "\"verdict\"", "bound_m"), number(report, "\"verdict\"", "bound_m"), 1e-12);
    same("p50", number(quality, "density", "p50_m2"), number(report, "density", "p50_m2"),
         1e-6 * number(report, "density", "p50_m2"));
    same("cell", number(quality, "\"all\"", "density_cell_m"), number(report, "\"all\"", "density_cell_m"), 0);
    /* The RMS is within the report's bound: the plan's bound and half a count an axis. */
    assert_true(number(quality, "\"all\"", "rms_m") <= number(report, "\"verdict\"", "bound_m"));
    assert_true(number(quality, "\"all\"", "max_m") <= number(report, "\"verdict\"", "bound_m"));
    assert_non_null(strstr(quality, "\"judgement\":\"within\""));
    same("expected noise", number(quality, "\"expected\"", "range_sigma_m"), 0, 0);
    assert_true(number(quality, "\"expected\"", "place_step_m") > 0);
    same("lost", number(quality, "{", "lost_frames"), 0, 0);
}

/* A point is half a count from where its pulse met the surface, so it may lie in the next cell. The error shows only
 * where no other pulse meets one of the two. It is one cell at most, and rare; the cell's area is at most
 * (2.5 cell_m)^2. */
static void check_coverage(struct wire *wire, const char *config, const char *quality)
{
    const char *const args[] = {"coverage", config, "--json", "--quiet", NULL};
    char *coverage = watch_command(wire, args, NULL);
    const double area_m2 = number(coverage, "{", "area_m2"), seen_m2 = area_m2 - number(coverage, "{", "none_m2");
    same("cells", number(quality, "\"coverage\"", "cells"), number(coverage, "{", "cells"), 0);
    same("cell_m", number(quality, "\"coverage\"", "cell_m"), 0.25, 0);
    same("share", number(quality, "\"coverage\"", "share") * area_m2, seen_m2, 6.25 * 0.25 * 0.25);
    assert_true(seen_m2 < 0.999 * area_m2 && seen_m2 > 0.5 * area_m2);
    free(coverage);
}

/* A station was moved and turned. The station's points lie on the scene; from the old place they would not. */
static void check_move(const struct head *head, struct scanhead *sh)
{
    size_t len;
    client_tell(sh, "SITE:POSE 1, 1.5, 0.75, 1.4, 77, 4, -3");
    char *json = watch_get(head, "/head", &len);
    same("x", number(json, "\"name\":\"first\"", "x_m"), 1.5, 0);
    same("roll", number(json, "\"name\":\"first\"", "roll_deg"), -3, 0);
    assert_non_null(strstr(json, "\"fields\":[{\"number\":3,\"name\":\"gate\","
                                 "\"outline_m\":[-1,0.5,1,0.5,1,1.5,-1,1.5]}]"));
    free(json);
    json = watch_scan(head, sh, 1, 3);
    assert_non_null(strstr(json, "\"judgement\":\"within\""));
    same("sampled", number(json, "{", "sampled_points"), number(json, "{", "points"), 0);
    assert_true(number(json, "{", "points") > 2500);
    assert_true(number(json, "\"all\"", "max_m") <= number(json, "\"verdict\"", "bound_m"));
    assert_true(number(json, "along_beam", "points") > 0.9 * number(json, "{", "points"));
    free(json);
}

static void figures_are_those_of_the_report(void **state)
{
    struct wire *wire = *state;
    char config[256];
    watch_prepare(wire, config);
    char *report = report_of(wire, config, NULL);
    struct head head = head_start(wire, config, NULL);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    char *quality = watch_scan(&head, sh, 1, 1);
    check_figures(quality, report);
    const double first = number(quality, "\"name\":\"first\"", "seen_share");
    same("seen by the first", number(quality, "\"coverage\"", "share"), first, 0);
    free(quality);
    /* The second station's scan starts anew, and coverage goes on. */
    quality = watch_scan(&head, sh, 2, 2);
    same("station", number(quality, "{", "station"), 2, 0);
    same("points of the first", number(quality, "\"name\":\"first\"", "points"), number(report, "{", "points"), 0);
    /* Each sees some of it. Together they see more than either, and no more than both. */
    const double second = number(quality, "\"name\":\"second\"", "seen_share");
    const double both = number(quality, "\"coverage\"", "share");
    same("seen by the first, still", number(quality, "\"name\":\"first\"", "seen_share"), first, 0);
    assert_true(first > 0.3 && second > 0.3 && both >= fmax(first, second) && both < first + second);
    check_coverage(wire, config, quality);
    free(quality);
    check_move(&head, sh);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    free(report);
}

/* A queue of 10 ms holds next to nothing at this pace. Most of a scan and its end are lost to the observer. When the
 * scan begins with the head, often even the descriptor is lost. */
static void a_scan_whose_end_is_lost_is_over(void **state)
{
    struct wire *wire = *state;
    char config[256];
    watch_prepare(wire, config);
    for (int start = 0; start < 3; start++) {
        struct head head = head_start(wire, config,
                                      (const char *const[]){"--set", "links.1.waits=no", "--set", "loop.queue_ms=10",
                                                            start ? "--start" : NULL, NULL});
        if (!start) {
            struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
            client_wait_state(sh, "idle");
            client_tell(sh, "SCAN:STAR");
            scanhead_close(sh);
        }
        free(watch_quality(&head, 1, 1));
        head_end(&head, SIGTERM);
    }
}

/* One sigma of 3 mm, set by a command: the scan is judged by it. */
static void noise_is_expected(void **state)
{
    struct wire *wire = *state;
    char config[256];
    watch_prepare(wire, config);
    struct head head = head_start(wire, config, (const char *const[]){"--set", "output.layout=polar", NULL});
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    client_wait_state(sh, "idle");
    client_tell(sh, "HEAD:NOIS ON");
    client_tell(sh, "HEAD:NOIS:SIGM 3 MM");
    char *quality = watch_scan(&head, sh, 1, 1);
    const double n = number(quality, "along_beam", "judged"), rms_m = number(quality, "along_beam", "judged_rms_m");
    /* The RMS of n normal deviations has a standard error of sigma / sqrt(2 n). Six of them are allowed, and 1 %: sigma
     * is of first order, and smooth faces are found by the noisy points themselves. */
    assert_true(n > 1000);
    same("sigma", number(quality, "along_beam", "expected_rms_m"), 0.003, 3e-6);
    same("sigma for clients", number(quality, "\"expected\"", "range_sigma_m"), 0.003, 1e-15);
    assert_true(number(quality, "\"expected\"", "range_step_m") > 0); /* a polar range has a count */
    same("rms", rms_m, 0.003, 0.003 * (6.0 / sqrt(2.0 * n) + 0.01));
    assert_true(isnan(number(quality, "\"verdict\"", "bound_m")));
    assert_non_null(strstr(quality, "\"judgement\":\"within\""));
    assert_non_null(strstr(quality, "\"along_beam\":{\"from_m\":"));
    /* A second scan from the same place has the same pulses, and is counted by itself. */
    const double points = number(quality, "{", "points");
    free(quality);
    quality = watch_scan(&head, sh, 1, 2);
    same("points of the second scan", number(quality, "{", "points"), points, 0);
    free(quality);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

/* An observer that the head waits for is not the last to get a processor, as the head would stand still while others
 * work. In real time the head does not wait, and the observer is the last. The observer's priority is set before a scan
 * is seen. A head that runs at the lowest priority itself, like this test, has no thread below it. */
static void who_is_waited_for_is_not_last(void **state)
{
    struct wire *wire = *state;
    char config[256];
    const int is_lowest = getpriority(PRIO_PROCESS, 0) == 19;
    watch_prepare(wire, config);
    for (int waited = 0; waited < 2; waited++) {
        struct head head =
            head_start(wire, config, (const char *const[]){"--pace", waited ? "fast" : "realtime", NULL});
        struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
        free(watch_scan(&head, sh, 1, 1));
        assert_int_equal(threads_below(&head), !waited && !is_lowest);
        scanhead_close(sh);
        head_end(&head, SIGTERM);
    }
}

static uint32_t u32_at(const char *bytes)
{
    uint32_t v;
    memcpy(&v, bytes, sizeof v);
    return v;
}

/* The list has these items in this order, and no others. Each begins with `head`, and then has its text. */
static void check_list(const char *json, const char *list, const char *head, const char *const *items)
{
    const char *at = strstr(json, list);
    assert_non_null(at);
    for (at += strlen(list); *items != NULL; items++) {
        assert_memory_equal(at, head, strlen(head));
        assert_memory_equal(at + strlen(head), *items, strlen(*items));
        int depth = 0; /* an item may have objects of its own */
        do {
            depth += (*at == '{') - (*at == '}');
        } while (*at++ != '\0' && depth > 0);
        at += *at == ',';
    }
    assert_int_equal(*at, ']');
}

/* The head of the configuration, by its profile (config/heads/full-sweep.yaml) and the defaults. */
static void expect_keys(const char *json)
{
    static const char *const keys[] = {"\"maker\":\"scanhead\",\"model\":\"full sweep\"",
                                       "\"profile\":\"full-sweep\"",
                                       "\"config\":\"config.yaml\"",
                                       "\"previews\":true",
                                       "\"tripod\":null",
                                       "\"served\":true"};
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++)
        if (strstr(json, keys[i]) == NULL) fail_msg("no %s in %s", keys[i], json);
}

/* The scene has 7 corners and 6 triangles, as in the file, relative to the middle of the bounds. */
static void scene_is_the_scene(void **state)
{
    struct wire *wire = *state;
    static const double corner[7][3] = {{-4, -4, 0}, {4, -4, 0}, {4, 4, 0}, {-4, 4, 0},
                                        {4, -4, 3},  {4, 4, 3},  {-4, 4, 3}};
    char config[256];
    size_t len;
    watch_prepare(wire, config);
    struct head head =
        head_start(wire, config,
                   (const char *const[]){
                       "--set", "stations.1.tripod={leg_m: 1.8, head_above_m: 0.2, legs_heading_deg: 40}", NULL});
    char *scene = watch_get(&head, "/scene", &len);
    double origin_m[3];
    assert_memory_equal(scene, "SHSC", 4);
    assert_true(u32_at(scene + 4) == 1 && u32_at(scene + 8) == 7 && u32_at(scene + 12) == 6);
    assert_int_equal(len, 40 + 7 * 12 + 6 * 12);
    memcpy(origin_m, scene + 16, sizeof origin_m);
    assert_true(origin_m[0] == 0.0 && origin_m[1] == 0.0 && origin_m[2] == 1.5);
    for (int v = 0; v < 7; v++)
        for (int i = 0; i < 3; i++) {
            float f;
            memcpy(&f, scene + 40 + 12 * v + 4 * i, sizeof f);
            same("corner", (double)f + origin_m[i], corner[v][i], 0);
        }
    for (int i = 0; i < 18; i++)
        assert_true(u32_at(scene + 40 + 84 + 4 * i) < 7);
    free(scene);
    char *json = watch_get(&head, "/head", &len);
    same("x", number(json, "\"name\":\"second\"", "x_m"), -2.2, 0);
    same("heading", number(json, "\"name\":\"second\"", "heading_deg"), 200, 1e-9);
    expect_keys(json);
    /* The tripod's top is 1.3 m above the floor, and each leg is the longest side of a right triangle. */
    same("leg", number(json, "\"tripod\":{", "leg_m"), 1.8, 0);
    same("head above", number(json, "\"tripod\":{", "head_above_m"), 0.2, 0);
    same("top", number(json, "\"tripod\":{", "height_m"), 1.3, 1e-9);
    same("feet", number(json, "\"tripod\":{", "foot_radius_m"), sqrt(1.8 * 1.8 - 1.3 * 1.3), 1e-9);
    same("legs", number(json, "\"tripod\":{", "legs_heading_deg"), 40, 1e-9);
    assert_non_null(strstr(json, "\"pace\":\"fast\""));
    same("y", number(json, "\"name\":\"second\"", "y_m"), 1.3, 0);
    same("z", number(json, "\"name\":\"second\"", "z_m"), 1.5, 0);
    check_list(json, "\"stations\":[",
               "{\"number\":", (const char *const[]){"1,\"name\":\"first\"", "2,\"name\":\"second\"", NULL});
    check_list(
        json, "\"surfaces\":[", "{\"label\":",
        (const char *const[]){"0,\"object\":\"floor\"", "1,\"object\":\"east\"", "2,\"object\":\"north\"", NULL});
    assert_non_null(strstr(json, "\"bounds\":{\"min\":[-4,-4,0],\"max\":[4,4,3]}"));
    free(json);
    json = watch_get(&head, "/plan", &len);
    assert_memory_equal(json, "{\"text\":\"", 9);
    free(json);
    json = watch_get(&head, "/quality", &len);
    assert_true(isnan(number(json, "{", "scan")) && isnan(number(json, "{", "all")));
    same("share", number(json, "\"coverage\"", "share"), 0, 0);
    free(json);
    head_end(&head, SIGTERM);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(figures_are_those_of_the_report, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(a_scan_whose_end_is_lost_is_over, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(noise_is_expected, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(who_is_waited_for_is_not_last, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(scene_is_the_scene, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests_name("watch", tests, NULL, NULL);
}
