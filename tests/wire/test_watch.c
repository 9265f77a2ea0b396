/* SPDX-License-Identifier: MIT */
/* The figures of a page while a scan is on. For a noise-free scan that the observer sees all of, they are those of
 * `scanhead report` and `scanhead coverage` for the same scan. A noisy scan is judged by its noise, stations follow the
 * head, and the coarse scene is the scene. The answers come by HTTP, as a browser gets them. */
#include <dirent.h>
#include <math.h>
#include <poll.h>
#include <sys/resource.h>

#include "tests/wire/wire.h"

/* A floor of 8 x 8 m and two walls, 3 m high: half of all shots go into the open. */
static const char SCENE[] = "v -4 -4 0\nv 4 -4 0\nv 4 4 0\nv -4 4 0\nv 4 -4 3\nv 4 4 3\nv -4 4 3\n"
                            "o floor\nf 1 2 3 4\no east\nf 2 5 6 3\no north\nf 3 6 7 4\n";

static const char CONFIG[] =
    "head: {profile: full-sweep, prr_hz: 10000, lines_hz: 100, pan_deg_s: 240, frames: 1}\n"
    "scene:\n  meshes: [{file: corner.obj, up: z, scale: 1}]\n"
    "  anchor: {source: explicit, origin_m: [0, 0, 0], lat_deg: 52, lon_deg: 13, height_m: 100}\n"
    "stations:\n  - {name: first, position_m: [0.31, -0.42, 1.7], heading_deg: 30}\n"
    "  - {name: second, position_m: [-2.2, 1.3, 1.5], heading_deg: 200}\n"
    "beam: {mode: single}\n"
    "coverage: {cell_m: 0.25}\n"
    "fields: [{number: 3, name: gate, shape: rectangle, corner_m: [-1, 0.5], size_m: [2, 1]}]\n"
    "output: {layout: geo, crs: utm}\n"
    "loop: {pace: fast}\n"
    "links: [{type: tcp}, {type: web, waits: 'yes'}]\n";

static void prepare(struct wire *wire, char config[256])
{
    wire_write_text(wire, "corner.obj", SCENE);
    snprintf(config, 256, "%s", wire_write_text(wire, "config.yaml", CONFIG));
}

/* ---- answers */

/* Returns the body; free it. */
/* The whole answer. */
static char *ask_path(const struct head *head, const char *path, size_t *len)
{
    char request[256], *answer = NULL;
    size_t n = 0, room = 0;
    ssize_t got;
    const int fd = raw_connect(head_endpoint(head, "web"));
    const int port = endpoint_port(head_endpoint(head, "web"));
    snprintf(request, sizeof request, "GET %s HTTP/1.1\r\nHost: 127.0.0.1:%d\r\nConnection: close\r\n\r\n", path, port);
    raw_send(fd, request, strlen(request));
    do {
        if (n + 65536 > room) answer = realloc(answer, room = 2 * room + 65536 + 1);
        assert_non_null(answer);
        got = read(fd, answer + n, room - n - 1);
        assert_true(got >= 0);
        n += (size_t)got;
        answer[n] = '\0';
    } while (got > 0);
    close(fd);
    *len = n;
    return answer;
}

static char *get(const struct head *head, const char *path, size_t *len)
{
    size_t n;
    char *answer = ask_path(head, path, &n);
    char *body = strstr(answer, "\r\n\r\n");
    if (strncmp(answer, "HTTP/1.1 200", 12) != 0 || body == NULL) fail_msg("%s: %.60s", path, answer);
    body += 4;
    *len = n - (size_t)(body - answer);
    memmove(answer, body, *len + 1);
    return answer;
}

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

/* Returns the quality once a scan is over. The head computes it twice a second at most, so asking faster would only
 * cost. */
static char *quality_of(const struct head *head, unsigned station, unsigned scan)
{
    char begin[64];
    size_t len;
    snprintf(begin, sizeof begin, "{\"scan\":%u,\"station\":%u,\"over\":true,", scan, station);
    for (const int64_t until = wire_now_ms() + DEADLINE_MS; wire_now_ms() < until;) {
        char *json = get(head, "/quality", &len);
        if (strncmp(json, begin, strlen(begin)) == 0) return json;
        free(json);
        poll(NULL, 0, 50);
    }
    fail_msg("scan %u does not end", scan);
    return NULL;
}

/* Commands a scan from a station, as any client does. */
static char *scan_from(const struct head *head, struct scanhead *sh, unsigned station, unsigned scan)
{
    char line[32];
    struct scanhead_frame frame;
    snprintf(line, sizeof line, "HEAD:STATION %u", station);
    client_wait_state(sh, "idle");
    client_tell(sh, line);
    client_tell(sh, "SCAN:STAR");
    client_until(sh, SCANHEAD_EV_SCAN_END, &frame);
    return quality_of(head, station, scan);
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

static char *command(struct wire *wire, const char *const *first, const char *set, const char *out)
{
    const char *args[WIRE_MAX_ARGS];
    size_t n = 0;
    while (*first != NULL)
        args[n++] = *first++;
    if (set != NULL) {
        args[n++] = "--set";
        args[n++] = set;
    }
    args[n] = NULL;
    if (wire_wait(wire, wire_spawn(wire, args, out, "err", -1)) != 0) {
        wire_show(wire, "err");
        fail_msg("%s", args[0]);
    }
    return wire_read(wire_path(wire, out), NULL);
}

static char *report_of(struct wire *wire, const char *config, const char *set)
{
    char cloud[256];
    snprintf(cloud, sizeof cloud, "%s", wire_path(wire, "scan.ply"));
    const char *const record[] = {"record", config, "-o", cloud, "--station", "1", "--empty-shots", "--quiet", NULL};
    const char *const report[] = {"report", config, cloud, "--json", "--tolerance-m", "1", NULL};
    free(command(wire, record, set, "out"));
    return command(wire, report, set, "report.json");
}

static void same(const char *what, double value, double expected, double tolerance)
{
    if (!(fabs(value - expected) <= tolerance)) fail_msg("%s: %.12g, not %.12g", what, value, expected);
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

/* A point is half a count from where its pulse met the surface, so it may lie in the next cell. That shows only where
 * no other pulse meets one of the two. It is one cell more or less, and rare; its area is at most (2.5 cells)^2. */
static void check_coverage(struct wire *wire, const char *config, const char *quality)
{
    const char *const args[] = {"coverage", config, "--json", "--quiet", NULL};
    char *coverage = command(wire, args, NULL, "coverage.json");
    const double area_m2 = number(coverage, "{", "area_m2"), seen_m2 = area_m2 - number(coverage, "{", "none_m2");
    same("cells", number(quality, "\"coverage\"", "cells"), number(coverage, "{", "cells"), 0);
    same("cell_m", number(quality, "\"coverage\"", "cell_m"), 0.25, 0);
    same("share", number(quality, "\"coverage\"", "share") * area_m2, seen_m2, 6.25 * 0.25 * 0.25);
    assert_true(seen_m2 < 0.999 * area_m2 && seen_m2 > 0.5 * area_m2);
    free(coverage);
}

/* A station was moved and turned. Its points lie on the scene; from its old place they would not. */
static void check_move(const struct head *head, struct scanhead *sh)
{
    size_t len;
    client_tell(sh, "SITE:POSE 1, 1.5, 0.75, 1.4, 77, 4, -3");
    char *json = get(head, "/head", &len);
    same("x", number(json, "\"name\":\"first\"", "x_m"), 1.5, 0);
    same("roll", number(json, "\"name\":\"first\"", "roll_deg"), -3, 0);
    assert_non_null(strstr(json, "\"fields\":[{\"number\":3,\"name\":\"gate\","
                                 "\"outline_m\":[-1,0.5,1,0.5,1,1.5,-1,1.5]}]"));
    free(json);
    json = scan_from(head, sh, 1, 3);
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
    prepare(wire, config);
    char *report = report_of(wire, config, NULL);
    struct head head = head_start(wire, config, NULL);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    char *quality = scan_from(&head, sh, 1, 1);
    check_figures(quality, report);
    const double first = number(quality, "\"name\":\"first\"", "seen_share");
    same("seen by the first", number(quality, "\"coverage\"", "share"), first, 0);
    free(quality);
    /* The second station's scan starts anew, and coverage goes on. */
    quality = scan_from(&head, sh, 2, 2);
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
    prepare(wire, config);
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
        free(quality_of(&head, 1, 1));
        head_end(&head, SIGTERM);
    }
}

/* One sigma of 3 mm, set by a command: the scan is judged by it, and the histogram is highest in the middle. */
static void noise_is_expected(void **state)
{
    struct wire *wire = *state;
    char config[256];
    prepare(wire, config);
    struct head head = head_start(wire, config, (const char *const[]){"--set", "output.layout=polar", NULL});
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    client_wait_state(sh, "idle");
    client_tell(sh, "HEAD:NOIS ON");
    client_tell(sh, "HEAD:NOIS:SIGM 3 MM");
    char *quality = scan_from(&head, sh, 1, 1);
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
    free(quality);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

/* An observer that the head waits for is not the last to get a processor, as the head would stand still while others
 * work. In real time the head does not wait, and the observer is the last. Its priority is set before it has seen a
 * scan. */
static void who_is_waited_for_is_not_last(void **state)
{
    struct wire *wire = *state;
    char config[256];
    prepare(wire, config);
    for (int waited = 0; waited < 2; waited++) {
        struct head head =
            head_start(wire, config, (const char *const[]){"--pace", waited ? "fast" : "realtime", NULL});
        struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
        free(scan_from(&head, sh, 1, 1));
        assert_int_equal(threads_below(&head), !waited);
        scanhead_close(sh);
        head_end(&head, SIGTERM);
    }
}

/* The points after a PLY's header. */
static const char *ply_points(const char *file, size_t len, size_t *n)
{
    static const char last[] = "end_header\n";
    const char *at = memmem(file, len, last, sizeof last - 1);
    assert_non_null(at);
    at += sizeof last - 1;
    *n = len - (size_t)(at - file);
    return at;
}

/* What a page saves has the bytes of what `record` writes of the same scan. */
static void the_points_so_far_are_a_file(void **state)
{
    struct wire *wire = *state;
    char config[256], path[352];
    size_t len, n_saved, n_recorded;
    prepare(wire, config);
    snprintf(path, sizeof path, "%s", wire_path(wire, "whole.ply"));
    free(command(wire, (const char *const[]){"record", config, "-o", path, "--station", "1", "--quiet", NULL}, NULL,
                 "out"));
    char *recorded = wire_read(path, &len);
    const char *want = ply_points(recorded, len, &n_recorded);
    struct head head = head_start(wire, config, NULL);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    free(scan_from(&head, sh, 1, 1));
    free(get(&head, "/save?as=ply", &len));
    const int64_t until = wire_now_ms() + DEADLINE_MS;
    for (int done = 0; !done; poll(NULL, 0, done ? 0 : 20)) {
        char *json = get(&head, "/save", &len);
        done = strstr(json, "\"state\":\"done\"") != NULL;
        if (wire_now_ms() > until) fail_msg("no file: %s", json);
        free(json);
    }
    char *saved = get(&head, "/saved?file=1&from=0", &len);
    const char *has = ply_points(saved, len, &n_saved);
    assert_int_equal(n_saved, n_recorded);
    assert_memory_equal(has, want, n_saved);
    free(saved);
    char *other = ask_path(&head, "/saved?file=2&from=0", &len);
    assert_non_null(strstr(other, "file 2 is not there; "));
    assert_int_equal(strncmp(other, "HTTP/1.1 400", 12), 0);
    free(other);
    free(recorded);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

static uint32_t u32_at(const char *bytes)
{
    uint32_t v;
    memcpy(&v, bytes, sizeof v);
    return v;
}

/* The scene has 7 corners and 6 triangles, as in the file, relative to the middle of the bounds. */
static void scene_is_the_scene(void **state)
{
    struct wire *wire = *state;
    static const double corner[7][3] = {{-4, -4, 0}, {4, -4, 0}, {4, 4, 0}, {-4, 4, 0},
                                        {4, -4, 3},  {4, 4, 3},  {-4, 4, 3}};
    char config[256];
    size_t len;
    prepare(wire, config);
    struct head head = head_start(wire, config, NULL);
    char *scene = get(&head, "/scene", &len);
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
    char *json = get(&head, "/head", &len);
    same("x", number(json, "\"name\":\"second\"", "x_m"), -2.2, 0);
    same("heading", number(json, "\"name\":\"second\"", "heading_deg"), 200, 1e-9);
    assert_non_null(strstr(json, "\"pace\":\"fast\""));
    assert_non_null(strstr(json, "{\"label\":1,\"object\":\"east\""));
    assert_non_null(strstr(json, "\"bounds\":{\"min\":[-4,-4,0],\"max\":[4,4,3]}"));
    free(json);
    json = get(&head, "/plan", &len);
    assert_memory_equal(json, "{\"text\":\"", 9);
    free(json);
    json = get(&head, "/quality", &len);
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
        cmocka_unit_test_setup_teardown(the_points_so_far_are_a_file, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(scene_is_the_scene, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests_name("watch", tests, NULL, NULL);
}
