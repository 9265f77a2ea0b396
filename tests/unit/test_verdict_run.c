/* SPDX-License-Identifier: MIT */
/* The run of a verdict: what is done in which order and when, for how long the head waits for a client, what goes to
 * the checks, and which file of points is compared. Time goes on by 10 ms at each wait. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <cmocka.h>

#include "drivers/protocol/protocol.h"
#include "tests/unit/verdict_run_rig.h"

#define OPENED "site sights device stream loop listen run read "
#define CLOSED "end join free_loop join_stream journal "
#define FREED  "close_stream free_device free_site free_watch"

static void expect(const char *expected)
{
    struct sh_err err;
    assert_int_equal(run_it(&err), SH_OK);
    assert_string_equal(trace, expected);
}

static void patience(void **state)
{
    (void)state;
    cfg.loop.queue_ms = 2999.0;
    cfg.loop.late_ms = 3001.0;
    verdict_be_patient(&cfg);
    assert_true(cfg.loop.queue_ms == 3000.0 && cfg.loop.late_ms == 3001.0);
    cfg.loop.queue_ms = 3001.0;
    cfg.loop.late_ms = 2999.0;
    verdict_be_patient(&cfg);
    assert_true(cfg.loop.queue_ms == 3001.0 && cfg.loop.late_ms == 3000.0);
}

/* The head is up after 30 ms, and the client connects 20 ms later. The duration counts from the first points on, at
 * 70 ms. At the end, points have to go on for more than 100 ms of device time. */
static void a_good_run(void **state)
{
    (void)state;
    expect(OPENED "client>log@30 client no_faults@580 held@690 watched@690 stop_client:5@690 " CLOSED
                  "judge not_judged:no --client-file " FREED);
    assert_true(seen.has_sessions && seen.is_open && seen.scans && seen.was_there && seen.holds);
    assert_int_equal(seen.start_ns, 1030 * MS);
    assert_int_equal(seen.ended_ns, 1690 * MS);
    assert_true(verdict.figures.left_out == 21 && verdict.figures.lost_pulses == 23);
    assert_true(verdict.figures.wall_s > 0.6899 && verdict.figures.wall_s < 0.6901);
    assert_string_equal(verdict.log, "folder/some.log");
    assert_true(cfg.loop.queue_ms == 3000.0 && must_ask == 0);
    assert_int_equal(verdict.check[VERDICT_LIVES].state, VERDICT_FOUND);
    options.allowed = 1U << VERDICT_LIVES | 1U << VERDICT_SCANS;
    make_run(NULL);
    options.allowed = 1U << VERDICT_LIVES | 1U << VERDICT_SCANS;
    struct sh_err err;
    assert_int_equal(run_it(&err), SH_OK);
    assert_int_equal(verdict.check[VERDICT_LIVES].state, VERDICT_ALLOWED);
    assert_int_equal(verdict.check[VERDICT_ENDS].state, VERDICT_FOUND);
    assert_int_equal(verdict.check[VERDICT_SCANS].state, VERDICT_PASSED);
}

/* Where nobody comes back, or no more points come, the limit of 200 ms counts from the later of two times: the end
 * of the faults' time and the end of the last disturbance. */
static void waits_at_the_end(void **state)
{
    static const struct {
        int whole, last_points, over, ended, is_open, scans;
    } rows[] = {{600, NOT_EVER, 0, 690, 1, 1},                                    /* points are the last to come */
                {750, NOT_EVER, 0, 750, 1, 1},                                    /* the client is */
                {780, NOT_EVER, 0, 780, 1, 1},   {790, NOT_EVER, 0, 790, 1, 1},   /* just the limit and a wait */
                {800, NOT_EVER, 0, 790, 0, 1},   {850, NOT_EVER, 660, 850, 1, 1}, /* it has until 660 + 200 */
                {880, NOT_EVER, 660, 870, 0, 1}, {0, 680, 0, 790, 1, 0},          /* points came for 100 ms, not more */
                {0, 681, 0, 690, 1, 1}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct sh_err err;
        make_run(NULL);
        plan.whole = rows[i].whole;
        plan.last_points = rows[i].last_points;
        plan.over = rows[i].over;
        assert_int_equal(run_it(&err), SH_OK);
        if (seen.ended_ns != (1000 + rows[i].ended) * MS || seen.is_open != rows[i].is_open ||
            seen.scans != rows[i].scans)
            fail_msg("row %zu: ended at %lld ms, open %d, scans %d", i, (long long)(seen.ended_ns / MS), seen.is_open,
                     seen.scans);
    }
}

/* Without a connection within 200 ms, or points after one, nothing more is waited for. */
static void a_client_that_does_not_come(void **state)
{
    (void)state;
    plan.connects = NOT_EVER;
    expect(OPENED "client>log@30 client no_faults@240 held@240 watched@240 stop_client:5@240 " CLOSED
                  "judge not_judged:no --client-file " FREED);
    assert_true(!seen.is_open && !seen.scans && seen.was_there);
    make_run(NULL);
    plan.first_points = NOT_EVER; /* it is connected, so points are waited for once more */
    expect(OPENED "client>log@30 client no_faults@260 held@470 watched@470 stop_client:5@470 " CLOSED
                  "judge not_judged:no --client-file " FREED);
    assert_true(seen.is_open && !seen.scans);
}

/* A link of UDP has no connections, and its head starts by itself. */
static void a_link_without_sessions(void **state)
{
    (void)state;
    cfg.link[1].type = LINK_UDP;
    plan.connects = plan.whole = NOT_EVER;
    expect("site sights starting_device stream loop listen run read client>log@30 client no_faults@580 held@690 "
           "watched@690 stop_client:5@690 " CLOSED "judge not_judged:no --client-file " FREED);
    assert_true(!seen.has_sessions && seen.scans && !seen.is_open);
    make_run(NULL);
    cfg.link[1].type = LINK_UDP;
    plan.first_points = NOT_EVER;
    expect("site sights starting_device stream loop listen run read client>log@30 client no_faults@240 held@240 "
           "watched@240 stop_client:5@240 " CLOSED "judge not_judged:no --client-file " FREED);
    make_run(NULL);
    cfg.head.start = 1;
    struct sh_err err;
    assert_int_equal(run_it(&err), SH_OK);
    assert_non_null(strstr(trace, "starting_device "));
}

/* A client that ended has no connections left, and is not waited for. */
static void a_client_that_ends_by_itself(void **state)
{
    (void)state;
    plan.ends = 300;
    expect(OPENED "client>log@30 client no_faults@300 watched@300 stop_client:5@300 " CLOSED
                  "judge not_judged:no --client-file " FREED);
    assert_true(!seen.was_there && !seen.holds);
    assert_int_equal(seen.ended_ns, 1300 * MS);
}

static void protocols_that_ask(void **state)
{
    struct sh_err err;
    (void)state;
    cfg.link[0].protocol = PROTOCOL_SCIP;
    cfg.link[2].protocol = PROTOCOL_COLA;
    assert_int_equal(run_it(&err), SH_OK);
    assert_int_equal(must_ask, 5);
    make_run(NULL);
    cfg.link[0].protocol = PROTOCOL_VELODYNE;
    cfg.link[1].protocol = PROTOCOL_SCIP;
    cfg.link[3].protocol = PROTOCOL_SCIP; /* there are three links */
    assert_int_equal(run_it(&err), SH_OK);
    assert_int_equal(must_ask, 2);
}

/* ---- errors and signals */

static void each_step_may_fail(void **state)
{
    static const struct {
        const char *step, *trace;
    } rows[] = {
        {"site", "site close_stream free_device:none free_site free_watch"},
        {"sights", "site sights close_stream free_device:none free_site free_watch"},
        {"device", "site sights device close_stream free_device:none free_site free_watch"},
        {"stream", "site sights device stream " FREED},
        {"loop", "site sights device stream loop " FREED},
        {"run", "site sights device stream loop listen run end join free_loop join_stream " FREED},
        {"read", OPENED "end join free_loop join_stream " FREED},
        {"client", OPENED "client>log@30 client end join free_loop join_stream " FREED},
        {"journal", OPENED "client>log@30 client no_faults@580 held@690 watched@690 stop_client:5@690 " CLOSED FREED},
    };
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char text[64];
        struct sh_err err;
        make_run(NULL);
        fails = rows[i].step;
        assert_int_equal(run_it(&err), SH_EIO);
        assert_string_equal(trace, rows[i].trace);
        snprintf(text, sizeof text, "%s failed", rows[i].step);
        assert_string_equal(err.text, text);
    }
}

static void a_head_that_does_not_boot(void **state)
{
    struct sh_err err;
    (void)state;
    plan.up = 60000;
    assert_int_equal(run_it(&err), SH_OK); /* just in time */
    make_run(NULL);
    plan.up = 60020;
    assert_int_equal(run_it(&err), SH_ESTATE);
    assert_string_equal(err.text, "soak: the head did not boot within 60 s");
    assert_string_equal(trace, OPENED "end join free_loop join_stream " FREED);
}

static void no_verdict(void **state)
{
    struct sh_err err;
    (void)state;
    plan.stop = 200;
    assert_int_equal(run_it(&err), SH_ESTOPPED);
    assert_string_equal(err.text, "stopped while loading; no scan was run");
    assert_string_equal(trace, OPENED
                        "client>log@30 client no_faults@200 held@200 watched@200 stop_client:5@200 " CLOSED FREED);
    make_run(NULL);
    plan.stop = 10; /* before the head is up */
    assert_int_equal(run_it(&err), SH_ESTOPPED);
    make_run(NULL);
    is_short = 1;
    assert_int_equal(run_it(&err), SH_ENOMEM);
    assert_string_equal(err.text, "no memory for what the client does");
}

/* ---- points */

static char path[64];
static const struct timespec OLD[] = {{.tv_sec = 5, .tv_nsec = 7}, {.tv_sec = 5, .tv_nsec = 7}};

/* An empty file from before the run. */
static void make_file(void)
{
    strcpy(path, "/tmp/scanhead-points-XXXXXX");
    const int fd = mkstemp(path);
    assert_true(fd >= 0 && futimens(fd, OLD) == 0);
    close(fd);
}

static void set_time(time_t s, long ns)
{
    utimensat(AT_FDCWD, path, (const struct timespec[]){{s, ns}, {s, ns}}, 0);
}

static void file_is_later(void)
{
    set_time(6, 7);
}

static void file_is_little_later(void)
{
    set_time(5, 8);
}

static void file_grows(void)
{
    if (truncate(path, 1) == 0) set_time(5, 7);
}

static void another_file_is_there(void)
{
    char other[80];
    snprintf(other, sizeof other, "%s-new", path);
    close(open(other, O_CREAT | O_WRONLY, 0600));
    rename(other, path);
    set_time(5, 7);
}

static void file_is_gone(void)
{
    remove(path);
}

/* The judging of points, which is all after the client's end. */
static void expect_points(const char *expected)
{
    struct sh_err err;
    assert_int_equal(run_it(&err), SH_OK);
    const char *at = strstr(trace, "judge ");
    assert_non_null(at);
    assert_int_equal(strncmp(at + 6, expected, strlen(expected)), 0);
    assert_string_equal(at + 6 + strlen(expected), FREED);
    assert_non_null(strstr(trace, "keeping_stream "));
}

static void with_file(const char *file)
{
    make_run(NULL);
    options.file = file;
}

static void points_are_compared(void **state)
{
    struct sh_err err;
    (void)state;
    with_file("-"); /* what it prints goes to a file of the folder */
    expect_points("read:folder/some.stdout cloud match points free_cloud ");
    assert_non_null(strstr(trace, "client>folder/some.stdout@30 "));
    with_file("x");
    n_matched = 0;
    expect_points("read:x cloud match found:it has no point free_cloud ");
    with_file("x");
    fails = "cloud";
    expect_points("read:x cloud found:cloud failed ");
    with_file("x");
    fails = "match";
    assert_int_equal(run_it(&err), SH_EIO);
    assert_string_equal(strstr(trace, "judge "), "judge read:x cloud match free_cloud " FREED);
    with_file("x");
    short_of = "it is too long";
    expect_points("not_judged:it is too long ");
    assert_string_equal(warned, "soak: some: --client-file: the points are not judged: it is too long\n");
}

/* A file from before, which the client did not touch, has none of its points. */
static void an_old_file(void **state)
{
    static void (*const changes[])(void) = {NULL,       file_is_later,         file_is_little_later,
                                            file_grows, another_file_is_there, file_is_gone};
    char expected[256];
    (void)state;
    for (size_t i = 0; i < sizeof changes / sizeof changes[0]; i++) {
        make_file();
        with_file(path);
        client_does = changes[i];
        snprintf(expected, sizeof expected,
                 changes[i] == NULL ? "found:%s: the client did not write it "
                                    : "read:%s cloud match points free_cloud ",
                 path);
        expect_points(expected);
        remove(path);
    }
    with_file(path); /* it was not there before, and is not now: reading it would fail */
    snprintf(expected, sizeof expected, "read:%s cloud match points free_cloud ", path);
    expect_points(expected);
}

/* How far coordinates may differ: by the protocol, unless the user says it. */
static void limits_of_protocols(void **state)
{
    static const struct {
        const char *protocol;
        double given_m, match_m;
    } rows[] = {{"native", -1, 1e-5},
                {"scip", -1, 2e-3},
                {"cola", -1, 2e-3},
                {"velodyne", -1, 2e-2},
                {"velodyne-position", -1, 2e-2},
                {"velodyn", -1, 2e-3},
                {"native", 0, 0},
                {"scip", 0.5, 0.5}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct sh_err err;
        with_file("x");
        protocol = rows[i].protocol;
        options.match_m = rows[i].given_m;
        assert_int_equal(run_it(&err), SH_OK);
        assert_true(match_m == rows[i].match_m);
    }
}

/* A flip with a right checksum changes points, so none strikes where points are compared. */
static void resealed_flips(void **state)
{
    struct sh_err err;
    (void)state;
    for (int compares = 0; compares < 2; compares++) {
        with_file(compares ? "x" : NULL);
        cfg.faults.n = 4;
        for (int i = 0; i < 5; i++)
            cfg.faults.fault[i] = (struct fault){.kind = FAULT_FLIP, .reseal = 1, .until_s = 9};
        cfg.faults.fault[1].reseal = 0;
        cfg.faults.fault[2].kind = FAULT_DROP;
        assert_int_equal(run_it(&err), SH_OK);
        for (int i = 0; i < 5; i++) {
            const int is_out = compares && (i == 0 || i == 3);
            assert_true(cfg.faults.fault[i].until_s == (is_out ? 1e-9 : 9));
        }
        assert_string_equal(warned, compares ? "soak: 2 faults of kind flip with reseal do not strike: no client can "
                                               "notice them, and the points that they change would count as unknown\n"
                                             : "");
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(patience, make_run),
        cmocka_unit_test_setup(a_good_run, make_run),
        cmocka_unit_test_setup(waits_at_the_end, make_run),
        cmocka_unit_test_setup(a_client_that_does_not_come, make_run),
        cmocka_unit_test_setup(a_link_without_sessions, make_run),
        cmocka_unit_test_setup(a_client_that_ends_by_itself, make_run),
        cmocka_unit_test_setup(protocols_that_ask, make_run),
        cmocka_unit_test_setup(each_step_may_fail, make_run),
        cmocka_unit_test_setup(a_head_that_does_not_boot, make_run),
        cmocka_unit_test_setup(no_verdict, make_run),
        cmocka_unit_test_setup(points_are_compared, make_run),
        cmocka_unit_test_setup(an_old_file, make_run),
        cmocka_unit_test_setup(limits_of_protocols, make_run),
        cmocka_unit_test_setup(resealed_flips, make_run),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
