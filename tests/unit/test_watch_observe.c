/* SPDX-License-Identifier: MIT */
/* The observer of a page reads a recorded stream to its end, in this thread. Its figures are those of the report of the
 * same points, and counts are known by hand. Run from the top of the source tree. */
#include "tests/unit/commands_rig.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include "core/bytes.h"
#include "drivers/protocol/native.h"
#include "drivers/protocol/native_encode.h"
#include "firmware_sim/app/studio/watch/inside.h"
#include "firmware_sim/command/head.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/load.h"

/* Steps of 10 degrees: 17 rings of 36 shots, and one at each pole. The 8 rings below the horizon and the one straight
 * down meet the floor. */
enum { SHOTS = 17 * 36 + 2, POINTS = 8 * 36 + 1, MOST_BYTES = 200000, ALL_EVENTS = 1 << 30 };

static uint8_t bytes[MOST_BYTES];
static size_t n_bytes;
static int n_lowered, lowered_to;
static const char *config = "c.yaml";

/* The product's call comes here. The priority of the test stays as it is. */
int setpriority(__priority_which_t which, id_t who, int to)
{
    assert_true(which == PRIO_PROCESS && who == (id_t)gettid());
    n_lowered++;
    lowered_to = to;
    return 0;
}

static int go_there(void **state)
{
    (void)state;
    if (commands_begin() != 0) return -1;
    write_text("floor.obj", "o floor\nv -30 -30 0\nv 30 -30 0\nv 30 30 0\nv -30 30 0\nf 1 2 3 4\n");
    write_text(
        "c.yaml",
        "head: {profile: sphere, step_deg: 10}\nscene: {meshes: [{file: floor.obj, up: z, scale: 1}], "
        "anchor: {source: explicit, origin_m: [0, 0, 0], lat_deg: 52, lon_deg: 15, height_m: 40, north_deg: 30}}\n"
        "stations: [{name: one, position_m: [0, 0, 2]}, "
        "{name: two, position_m: [6, 0, 2]}]\noutput: {crs: local}\ncoverage: {cell_m: 1}\n");
    return 0;
}

/* Records with these words to s.shs and s.ply, and takes the stream. */
static void record(const char *words)
{
    char line[256];
    snprintf(line, sizeof line, "%s -o s.shs -o s.ply --quiet %s", config, words);
    does(&app_record, line, 0);
    FILE *in = fopen("s.shs", "rb");
    assert_non_null(in);
    n_bytes = fread(bytes, 1, sizeof bytes, in);
    assert_true(n_bytes > 1000 && n_bytes < sizeof bytes);
    fclose(in);
}

/* ---- a watch of a head that is at its first scan, and whose stream is that of a recording */

static struct config *cfg;
static struct site *site;
static struct device *device;
static struct watch *w;
static struct sh_err err;

static void open_watch(const char *const *set, double cpu_share)
{
    struct watch_options options = {.cpu_share = cpu_share, .scene_triangles = WATCH_SCENE_TRIANGLES};
    size_t n = 0;
    while (set != NULL && set[n] != NULL)
        n++;
    cfg = calloc(1, sizeof *cfg);
    assert_non_null(cfg);
    if (config_load(config, set, (int)n, cfg, &err) != SH_OK) fail_msg("%s", err.text);
    if (site_load_for(cfg, SITE_WRITTEN_OUT, NULL, NULL, &site, &err) != SH_OK) fail_msg("%s", err.text);
    if (device_create(site, &(struct device_options){.start = 1}, &device, &err) != SH_OK) fail_msg("%s", err.text);
    struct device_work *work = calloc(1, sizeof *work);
    assert_non_null(work);
    while (!work->scanning) {
        assert_int_equal(device_claim(device, work), 0);
        device_done(work);
    }
    assert_int_equal(work->scan, 1);
    free(work);
    options.device = device;
    if (watch_page.open(cfg, site, &options, &w, &err) != SH_OK) fail_msg("%s", err.text);
    n_lowered = 0;
}

static void close_watch(void)
{
    watch_page.close(w);
    device_free(device);
    site_free(site);
    free(cfg);
}

static void give(const void *data, size_t len)
{
    assert_int_equal(write(w->link.fd, data, len), (ssize_t)len); /* it fits into the socket */
}

/* Gives the frames of the stream, but no events of this code (0: it gives all). Returns the next frame's number. */
static uint32_t give_stream(uint32_t without)
{
    uint32_t next = 0;
    for (size_t at = 0; at < n_bytes; at += native_frame_len(bytes + at)) {
        struct native_header h;
        struct native_event event;
        assert_int_equal(bytes[at], NATIVE_SYNC);
        native_read_header(bytes + at, &h);
        next = h.seq + 1;
        if (without != 0 && h.type == NATIVE_EVENT &&
            native_decode_event(bytes + at + NATIVE_HEADER_LEN, native_frame_len(bytes + at) - NATIVE_HEADER_LEN,
                                &event) == SH_OK &&
            (event.code == without || without == ALL_EVENTS))
            continue;
        give(bytes + at, native_frame_len(bytes + at));
    }
    return next;
}

static void give_telemetry(uint32_t seq, uint32_t state, uint32_t scan)
{
    uint8_t frame[512];
    const struct native_telemetry t = {.state = state, .scan = scan};
    native_encode_telemetry(frame, sizeof frame, &t, 1000000000, 0);
    give(frame, native_finish_frame(frame, seq));
}

/* Observes all that was given. Returns the quality; free it. */
static char *observed(void)
{
    struct web_body body;
    assert_int_equal(shutdown(w->link.fd, SHUT_WR), 0);
    assert_null(watch_observe(w));
    assert_int_equal(watch_get_quality(w, &body, &err), SH_OK);
    return body.bytes;
}

/* Returns the number after the first `key` after the first `after`; NaN: null. */
static double number(const char *json, const char *after, const char *key)
{
    char quoted[64];
    const char *at = strstr(json, after);
    if (at == NULL) fail_msg("no %s in %s", after, json);
    snprintf(quoted, sizeof quoted, "\"%s\":", key);
    at = strstr(at, quoted);
    if (at == NULL) fail_msg("no %s in %s", key, json);
    at += strlen(quoted);
    at += *at == ' ';
    return strncmp(at, "null", 4) == 0 ? (double)NAN : atof(at);
}

static void same(const char *what, double a, double b, double tolerance)
{
    if (!(fabs(a - b) <= tolerance)) fail_msg("%s: %.15g is not %.15g", what, a, b);
}

/* The report takes places from a file of doubles, and the observer from the stream itself. In UTM the anchor is made
 * twice, which costs some units in the last place of 5.8e6 m. */
static void expect_report(const char *quality, const char *words)
{
    static const char *const key[] = {"mean_m", "rms_m", "p95_m", "max_m"};
    char line[128];
    snprintf(line, sizeof line, "c.yaml s.ply --json --set coverage.cell_m=1%s", words);
    does(&app_report, line, 0);
    for (int k = 0; k < 4; k++)
        same(key[k], number(quality, "\"all\"", key[k]), number(on_out, "\"all\"", key[k]), 4e-9);
    same("along", number(quality, "along_beam", "points"), number(on_out, "along_beam", "points"), 0);
    same("bound", number(quality, "\"verdict\"", "bound_m"), number(on_out, "\"verdict\"", "bound_m"), 1e-12);
    same("p50", number(quality, "density", "p50_m2"), number(on_out, "density", "p50_m2"),
         1e-6 * number(on_out, "density", "p50_m2"));
    has(quality, "\"judgement\":\"within\"");
}

static void expect_counts(const char *json, const char *begin, double points, double shots, int over)
{
    const char *const is_over = over ? "\"over\":true" : "\"over\":false";
    const char *const at = strstr(json, begin);
    if (at == NULL) fail_msg("no %s in %s", begin, json);
    same("points", number(json, begin, "points"), points, 0);
    same("sampled", number(json, begin, "sampled_points"), points, 0);
    same("every", number(json, begin, "every"), 1, 0);
    same("left out", number(json, begin, "left_out"), 0, 0);
    same("shots", number(json, begin, "shots"), shots, 0);
    same("empty", number(json, begin, "empty_share"), (shots - points) / shots, 1e-12);
    const char *found = strstr(at, "\"over\":");
    assert_non_null(found);
    assert_memory_equal(found, is_over, strlen(is_over));
}

/* ---- tests */

/* A thread that nobody waits for gets the lowest priority. The second row limits its share of a processor, but so
 * little that it looks at all points on any machine. */
static void a_scan_is_judged_as_by_the_report(void **state)
{
    (void)state;
    static const struct {
        const char *set[3], *words;
        double cpu_share;
    } rows[] = {{{NULL}, "", 0},
                {{"output.layout=polar", NULL}, " --set output.layout=polar", 1e6},
                {{"output.crs=utm", "output.layout=geo", NULL}, " --set output.crs=utm --set output.layout=geo", 0}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        record(rows[i].words);
        open_watch(rows[i].set, rows[i].cpu_share);
        give_stream(0);
        char *quality = observed();
        assert_int_equal(n_lowered, rows[i].cpu_share > 0);
        if (n_lowered > 0) assert_int_equal(lowered_to, 19);
        expect_counts(quality, "{\"scan\":1,\"station\":1,", POINTS, SHOTS, 1);
        expect_report(quality, rows[i].words);
        expect_counts(quality, "\"stations\":[{\"number\":1,\"name\":\"one\",\"scan\":1,", POINTS, SHOTS, 1);
        same("lost", number(quality, "{", "lost_frames"), 0, 0);
        assert_true(number(quality, "\"coverage\"", "share") > 0);
        free(quality);
        assert_true(w->now_georef == NULL && w->held == NULL); /* all is given back */
        close_watch();
    }
}

/* The second station's scan has figures of its own, and those of the first stay. */
static void stations_follow_each_other(void **state)
{
    (void)state;
    record("--station all");
    open_watch(NULL, 0);
    give_stream(0);
    char *quality = observed();
    expect_counts(quality, "{\"scan\":2,\"station\":2,", POINTS, SHOTS, 1);
    expect_counts(quality, "{\"number\":1,\"name\":\"one\",\"scan\":1,\"station\":1,", POINTS, SHOTS, 1);
    expect_counts(quality, "{\"number\":2,\"name\":\"two\",\"scan\":2,\"station\":2,", POINTS, SHOTS, 1);
    const double both = number(quality, "\"coverage\"", "share"), one = number(quality, "\"one\"", "seen_share"),
                 two = number(quality, "\"two\"", "seen_share");
    /* The floor is the same from both, and they are 6 m apart, so few cells are seen from both places. */
    assert_true(one > 0 && two > 0 && both > fmax(one, two) && both <= one + two);
    free(quality);
    close_watch();
}

/* The end of a scan may be lost. Then the telemetry of a head that rests shows it, and nothing else does. */
static void telemetry_ends_a_scan(void **state)
{
    static const struct {
        uint32_t state, scan;
        int over;
    } rows[] = {{HEAD_IDLE, 1, 1}, {HEAD_SCANNING, 1, 0}, {HEAD_SPIN_DOWN, 1, 0}, {HEAD_IDLE, 0, 0}, {HEAD_IDLE, 2, 0}};
    (void)state;
    record("");
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        open_watch(NULL, 0);
        give_telemetry(give_stream(NATIVE_EV_SCAN_END), rows[i].state, rows[i].scan);
        char *quality = observed();
        expect_counts(quality, "{\"scan\":1,\"station\":1,", POINTS, SHOTS, rows[i].over);
        free(quality);
        assert_true(w->held == NULL); /* the stream's end gives it back, too */
        close_watch();
    }
}

static void end_scan_of_device(void)
{
    struct device_work *work = calloc(1, sizeof *work);
    assert_non_null(work);
    do {
        assert_int_equal(device_claim(device, work), 0);
        device_done(work);
    } while (work->scanning);
    free(work);
}

static void give_event(uint32_t seq, uint32_t code, uint64_t a)
{
    uint8_t frame[256];
    const struct native_event event = {.code = code, .a = a};
    native_encode_event(frame, sizeof frame, &event, 1000000000, 0);
    give(frame, native_finish_frame(frame, seq));
}

/* Once the head's scan is over, the observer is behind until it has read that: by SCAN_END, by telemetry, or since
 * power went or the head boots. The scan may have no points. An observer that reads no more is not waited for. */
static void the_observer_is_behind_until_the_end(void **state)
{
    static const struct {
        int points, by_telemetry, by_event, behind;
        uint32_t code, a;
    } rows[] = {
        /* clang-format off */
        {1, 1, 0, 0, 0, 0}, {1, 0, 0, 1, 0, 0}, {0, 1, 0, 0, 0, 0},
        {1, 0, 1, 0, NATIVE_EV_SCAN_END, 1}, {0, 0, 1, 0, NATIVE_EV_SCAN_END, 1},
        {1, 0, 1, 0, NATIVE_EV_STATE, HEAD_OFF}, {0, 0, 1, 0, NATIVE_EV_STATE, HEAD_OFF},
        {1, 0, 1, 0, NATIVE_EV_STATE, HEAD_BOOT}, {1, 0, 1, 1, NATIVE_EV_STATE, HEAD_SPIN_DOWN},
        /* clang-format on */
    };
    (void)state;
    record("");
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        open_watch(NULL, 0);
        assert_int_equal(watch_is_behind(w), 0); /* the scan goes on */
        end_scan_of_device();
        assert_int_equal(watch_is_behind(w), 1);
        if (!rows[i].points) give_event(1, NATIVE_EV_SCAN_START, 1);
        const uint32_t next = rows[i].points ? give_stream(NATIVE_EV_SCAN_END) : 2;
        if (rows[i].by_telemetry) give_telemetry(next, HEAD_IDLE, 1);
        if (rows[i].by_event) give_event(next, rows[i].code, rows[i].a);
        free(observed());
        assert_int_equal(watch_is_behind(w), 0);
        atomic_store(&w->is_deaf, 0);
        assert_int_equal(watch_is_behind(w), rows[i].behind);
        assert_int_equal(w->at.over, rows[i].points && !rows[i].behind);
        close_watch();
    }
}

/* The end of scan 1 was lost, and scan 2 has no points. Where scan 2 ends, scan 1 is over too, and not the last one. */
static void an_earlier_scan_s_end_is_not_the_last(void **state)
{
    (void)state;
    record("");
    for (int by_event = 0; by_event < 2; by_event++) {
        open_watch(NULL, 0);
        const uint32_t next = give_stream(NATIVE_EV_SCAN_END);
        by_event ? give_event(next, NATIVE_EV_SCAN_END, 2) : give_telemetry(next, HEAD_IDLE, 2);
        give_event(next + 1, NATIVE_EV_SCAN_START, 3);
        free(observed());
        assert_int_equal(atomic_load(&w->ended), 2);
        close_watch();
    }
}

/* Frames that the head left out for this reader are counted, and frames after a scan's end are none of its points. */
static void what_comes_after_the_end_does_not_count(void **state)
{
    (void)state;
    uint8_t frame[256];
    const struct native_event lost = {.code = NATIVE_EV_READER_LOST, .a = 3, .b = 40, .c = 5};
    record("");
    open_watch(NULL, 0);
    native_encode_event(frame, sizeof frame, &lost, 1000000000, NATIVE_LOCAL);
    give(frame, native_finish_frame(frame, 0));
    uint32_t next = give_stream(0);
    for (size_t at = 0; at < n_bytes; at += native_frame_len(bytes + at)) {
        struct native_header h;
        native_read_header(bytes + at, &h);
        if (h.type != NATIVE_POINTS) continue;
        give(bytes + at, native_finish_frame(bytes + at, next));
        break;
    }
    char *quality = observed();
    expect_counts(quality, "{\"scan\":1,\"station\":1,", POINTS, SHOTS, 1);
    same("lost", number(quality, "{", "lost_frames"), 5, 0);
    free(quality);
    assert_int_equal(w->missed, 1);
    struct web_body body;
    assert_int_equal(w->source.get(w->source.ctx, "/past", "", &body, &err), SH_OK);
    assert_int_equal(le_get64((const uint8_t *)body.bytes + 40), 5);
    free(body.bytes);
    close_watch();
}

/* The floor is a mirror below a roof, so the roof is seen once more below the floor. Nothing is there: these points
 * count and are left out of the figures. */
static void points_in_mirrors_are_left_out(void **state)
{
    (void)state;
    double points, ghosts;
    write_text("m.obj", "o floor\nv -9 -9 0\nv 9 -9 0\nv 9 9 0\nv -9 9 0\nf 1 2 3 4\n"
                        "o roof\nv -9 -9 3\nv 9 -9 3\nv 9 9 3\nv -9 9 3\nf 8 7 6 5\n");
    write_text("m.yaml", "head: {profile: sphere, step_deg: 10}\noutput: {crs: local, layout: geo}\n"
                         "scene: {meshes: [{file: m.obj, up: z, scale: 1}]}\nstations: [{position_m: [0, 0, 2]}]\n"
                         "beam: {mode: single}\nsurfaces: [{object: floor, mirror: 0.9}]\n");
    config = "m.yaml";
    record("");
    open_watch(NULL, 0);
    give_stream(0);
    char *quality = observed();
    does(&app_report, "m.yaml s.ply", 0);
    const char *at = strstr(on_out, "\nghosts ");
    assert_non_null(at);
    assert_int_equal(sscanf(on_out, "points %lf", &points) + sscanf(at, " ghosts %lf", &ghosts), 2);
    assert_true(points > 20 && ghosts > 20);
    same("points", number(quality, "{", "points"), points + ghosts, 0);
    same("left out", number(quality, "{", "left_out"), ghosts, 0);
    same("sampled", number(quality, "{", "sampled_points"), points, 0);
    has(quality, "\"judgement\":\"within\"");
    free(quality);
    close_watch();
    config = "c.yaml";
}

/* The scan of a station that the configuration doesn't have is not looked at. */
static void another_head_s_stations_are_passed_over(void **state)
{
    (void)state;
    record("--station 2");
    open_watch((const char *const[]){"stations=[{position_m: [0, 0, 2]}]", NULL}, 0);
    give_stream(0);
    char *quality = observed();
    assert_memory_equal(quality, "{\"scan\":null,", 13);
    free(quality);
    close_watch();
}

/* In a long scan one in four pulses is looked at, spread over all lines. The number of these points has a standard
 * deviation of sqrt(289 * 3 / 16) = 7.4 where pulses are chosen by chance; six deviations are allowed. */
static void one_in_four_pulses_is_looked_at(void **state)
{
    (void)state;
    record("");
    open_watch(NULL, 0);
    w->at = (struct watch_scan){.scan = 1, .station = 1, .in_scene = 1}; /* it is at this scan already */
    w->now = w->head[0];
    w->sample.every = 4;
    give_stream(ALL_EVENTS);
    char *quality = observed();
    same("every", number(quality, "{", "every"), 4, 0);
    same("points", number(quality, "{", "points"), POINTS, 0);
    same("sampled", number(quality, "{", "sampled_points"), POINTS / 4.0, 44);
    same("figures", number(quality, "\"all\"", "points"), number(quality, "{", "sampled_points"), 0);
    free(quality);
    close_watch();
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_scan_is_judged_as_by_the_report),
        cmocka_unit_test(stations_follow_each_other),
        cmocka_unit_test(telemetry_ends_a_scan),
        cmocka_unit_test(the_observer_is_behind_until_the_end),
        cmocka_unit_test(an_earlier_scan_s_end_is_not_the_last),
        cmocka_unit_test(what_comes_after_the_end_does_not_count),
        cmocka_unit_test(points_in_mirrors_are_left_out),
        cmocka_unit_test(another_head_s_stations_are_passed_over),
        cmocka_unit_test(one_in_four_pulses_is_looked_at),
    };
    return cmocka_run_group_tests_name("watch observe", tests, go_there, commands_end);
}
