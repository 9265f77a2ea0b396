/* SPDX-License-Identifier: MIT */
/* The run of a soak: what is opened, started and ended in which order, how long each part waits, and what it says. */
#include "tests/unit/commands_rig.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/unit/soak_run_rig.h"

extern const struct app_command app_soak;

static int go_there(void **state)
{
    (void)state;
    if (commands_begin() != 0) return -1;
    write_text("r.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    write_text("c.yaml",
               "head: {profile: sphere, step_deg: 10, frames: 7}\nscene: {meshes: [{file: r.obj, up: z, scale: "
               "1}]}\nstations: [{position_m: [0, 0, 1]}]\noutput: {crs: local}\nlinks: [{type: tcp}, {type: "
               "'null'}]\n");
    return 0;
}

#define OPENED "patience site sights device clean loop clients listen run read connect "
#define CLOSED "join free_loop join_clients join_clean journal judge0 head0 judge1 head1 conclude:71 hidden "
#define FREED  "close_clients close_clean free_device free_site"

static void expect(const char *words, int status, const char *expected)
{
    does(&app_soak, words, status);
    assert_string_equal(trace, expected);
}

/* The 0.1 s count from the first points on, which come at 40 ms. Then the faults end, and the clients have 5 s. */
static void a_good_soak(void **state)
{
    (void)state;
    when.done = 200;
    when.seen = 160;
    expect("c.yaml --duration 0.1 --quiet --json j.json", 0, OPENED "no_faults@140 end@220 " CLOSED FREED);
    assert_string_equal(on_out, "sheet of 0.10 s\n");
    assert_string_equal(on_err, "");
    char *json = contents("j.json");
    assert_string_equal(json, "{\n  \"wall_s\": 0.1\n}\n");
    free(json);
}

/* Each wait has a limit: 30 s for a scan; then 2.5 s for faults of the head, 5 s for the clients, and 6 s for the
 * head's answer. */
static void limits(void **state)
{
    static const struct {
        struct times when;
        int end;
    } rows[] = {{{40, NOT_EVER, 0, 0, NOT_EVER}, 140 + 5020 + 20},
                {{40, 0, NOT_EVER, 0, NOT_EVER}, 40 + 2520 + 20},
                {{40, 200, 0, NOT_EVER, NOT_EVER}, 200 + 6020},
                {{40, 200, 0, NOT_EVER, 300}, 300},
                {{30000, 30200, 0, 0, NOT_EVER}, 30220}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char expected[32];
        make_soak_run(NULL);
        when = rows[i].when;
        does(&app_soak, "c.yaml --duration 0.1 --quiet", 0);
        snprintf(expected, sizeof expected, " end@%d ", rows[i].end);
        has(trace, expected);
    }
    make_soak_run(NULL);
    when.scans = 30040;
    does(&app_soak, "c.yaml --duration 0.1 --quiet", 1);
    assert_string_equal(on_err, "scanhead: soak: no scan began within 30 s\n");
    assert_string_equal(trace,
                        OPENED "end@30020 join free_loop join_clients join_clean judge0 head0 judge1 head1 " FREED);
}

/* The soak ends early where the clean reader fails, or once all clients have ended. */
static void early_ends(void **state)
{
    (void)state;
    when.breaks = 80;
    does(&app_soak, "c.yaml --duration 9 --quiet", 0);
    has(trace, "no_faults@80 ");
    make_soak_run(NULL);
    when.done = 100;
    does(&app_soak, "c.yaml --duration 9 --quiet", 0);
    has(trace, "no_faults@100 end@120 ");
}

/* With a pace other than realtime, the duration is device time, which is ten times as fast here. */
static void device_time(void **state)
{
    (void)state;
    does(&app_soak, "c.yaml --duration 2 --quiet --pace fast", 0);
    has(trace, "no_faults@240 ");
    assert_null(strstr(trace, "patience ")); /* the head waits for its readers */
}

static void progress(void **state)
{
    (void)state;
    when.done = 3200;
    does(&app_soak, "c.yaml --duration 3", 0);
    has(trace, "connect 0.98@1040 1.98@2040 2.98@3040 no_faults@3040 ");
}

static void a_bad_soak(void **state)
{
    (void)state;
    is_bad = 1;
    does(&app_soak, "c.yaml --duration 0.1 --quiet --json -", 1);
    has(on_err, "sheet of 0.10 s\n");
    has(on_err, "scanhead: soak: it is bad\n");
    assert_string_equal(on_out, "{\n  \"wall_s\": 0.1\n}\n");
}

/* Clients of the native protocol on TCP, a pty or USB can start a scan. Without such a link the head starts itself.
 * A UDP link has a clean link beside it, where its packets come to this machine. */
static void who_starts_the_scan(void **state)
{
    static const struct {
        const char *links;
        int starts, clean_links;
    } rows[] = {{"{type: tcp}", 0, 0},
                {"{type: pty}", 0, 0},
                {"{type: 'null'}", 1, 0},
                {"{type: tcp, protocol: velodyne-http}", 1, 0},
                {"{type: udp, protocol: velodyne, port: 2368}", 1, 1},
                {"{type: udp, protocol: velodyne, port: 2369}", 1, 0}, /* its port is taken */
                {"{type: udp, protocol: velodyne, port: 2368}, {type: tcp}", 0, 1}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char text[512];
        make_soak_run(NULL);
        snprintf(text, sizeof text,
                 "head: {profile: velodyne-vlp16, frames: 7}\nscene: {meshes: [{file: r.obj, up: z, scale: 1}]}\n"
                 "stations: [{position_m: [0, 0, 1]}]\noutput: {crs: local}\nlinks: [%s]\n",
                 rows[i].links);
        write_text("d.yaml", text);
        fails = "clean"; /* here it ends */
        does(&app_soak, "d.yaml --quiet", 1);
        assert_int_equal(strstr(trace, "starting_") != NULL, rows[i].starts);
        assert_int_equal(strstr(trace, "beside:1 ") != NULL, rows[i].clean_links);
    }
    make_soak_run(NULL);
    fails = "clean";
    does(&app_soak, "c.yaml --quiet --set head.start=on --truth t", 1);
    has(trace, "starting_truth_device");
}

static void each_step_may_fail(void **state)
{
    static const struct {
        const char *step, *trace;
    } rows[] = {
        {"site", "patience site close_clients close_clean free_device:none free_site"},
        {"sights", "patience site sights close_clients close_clean free_device:none free_site"},
        {"device", "patience site sights device close_clients close_clean free_device:none free_site"},
        {"clean", "patience site sights device clean " FREED},
        {"loop", "patience site sights device clean loop " FREED},
        {"clients", "patience site sights device clean loop clients free_loop " FREED},
        {"run",
         "patience site sights device clean loop clients listen run end@0 join free_loop join_clients join_clean "
         "judge0 head0 judge1 head1 " FREED},
        {"read", "patience site sights device clean loop clients listen run read end@0 join free_loop join_clients "
                 "join_clean judge0 head0 judge1 head1 " FREED},
        {"connect", OPENED "end@0 join free_loop join_clients join_clean judge0 head0 judge1 head1 " FREED}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char text[64];
        make_soak_run(NULL);
        fails = rows[i].step;
        expect("c.yaml --duration 0.1 --quiet", 1, rows[i].trace);
        snprintf(text, sizeof text, "scanhead: %s failed\n", rows[i].step);
        assert_string_equal(on_err, text);
    }
    make_soak_run(NULL);
    fails = "journal";
    does(&app_soak, "c.yaml --duration 0.1 --quiet", 1);
    assert_string_equal(on_err, "scanhead: journal failed\n");
}

static void wrong_use(void **state)
{
    (void)state;
    expect("c.yaml --set loop.pace=step", 2, "");
    assert_string_equal(on_err, "scanhead: loop.pace: step, but no client grants time; allowed realtime and fast\n");
    expect("c.yaml --link 3", 2, "");
    assert_string_equal(on_err, "scanhead: no link 3\n");
    does(&app_soak, "c.yaml --link 2 --duration 0.1 --quiet", 0);
    has(trace, " only2_clients ");
    make_soak_run(NULL);
    write_text("f.yaml", "faults: [{kind: drop, at: 5}, {kind: drop, at: 7}]\n");
    does(&app_soak, "c.yaml --scenario f.yaml --duration 0.1 --quiet", 0);
    has(trace, " faults2_clients ");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_good_soak, make_soak_run),
        cmocka_unit_test_setup(limits, make_soak_run),
        cmocka_unit_test_setup(early_ends, make_soak_run),
        cmocka_unit_test_setup(device_time, make_soak_run),
        cmocka_unit_test_setup(progress, make_soak_run),
        cmocka_unit_test_setup(a_bad_soak, make_soak_run),
        cmocka_unit_test_setup(who_starts_the_scan, make_soak_run),
        cmocka_unit_test_setup(each_step_may_fail, make_soak_run),
        cmocka_unit_test_setup(wrong_use, make_soak_run),
    };
    return cmocka_run_group_tests(tests, go_there, commands_end);
}
