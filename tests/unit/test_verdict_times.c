/* SPDX-License-Identifier: MIT */
/* When clients were sent away and came back, to the nanosecond: the clock is the test's. Link 1, that of the client,
 * has the sessions 1 to 8, link 2 those from 9 to 16. A third link is not watched. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <cmocka.h>

#include <stdio.h>
#include <string.h>

#include "firmware_sim/app/studio/verdict/watch.h"
#include "tests/unit/clock_rig.h"

#define MS INT64_C(1000000)

static struct watch w;

static int begin(void **state)
{
    (void)state;
    clock_rig_ns = 1000 * MS;
    watch_begin(&w, 2, 1, 0.2);
    return 0;
}

static int end(void **state)
{
    (void)state;
    assert_int_equal(pthread_mutex_trylock(&w.lock), 0);
    pthread_mutex_unlock(&w.lock);
    watch_free(&w);
    return 0;
}

static void session(uint32_t number, int begins)
{
    w.observer.session(w.observer.ctx, number, begins, "127.0.0.1:5", 0);
    assert_int_equal(pthread_mutex_trylock(&w.lock), 0);
    pthread_mutex_unlock(&w.lock);
}

static void note(enum fault_kind kind, uint32_t link, double for_ms)
{
    const struct fault_note note = {.kind = kind, .link = link, .for_ms = for_ms};
    watch_note(&w, &note);
}

static void expect_break(size_t i, uint32_t link, enum fault_kind kind, int64_t over_ms, int64_t back_ms)
{
    assert_true(i < w.n_broken);
    assert_int_equal(w.broken[i].link, link);
    assert_int_equal(w.broken[i].kind, kind);
    assert_int_equal(w.broken[i].over_ns, over_ms * MS);
    assert_int_equal(w.broken[i].back_ns, back_ms * MS);
}

static void sessions_belong_to_links(void **state)
{
    static const struct {
        uint32_t session, link;
    } rows[] = {{1, 1}, {8, 1}, {9, 2}, {16, 2}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        session(rows[i].session, 1);
        assert_int_equal(w.link[rows[i].link - 1].open, 1);
        session(rows[i].session, 0);
        assert_int_equal(w.link[rows[i].link - 1].open, 0);
    }
    session(17, 1);
    w.observer.heard(w.observer.ctx, 17, "x", 1);
    assert_true(w.link[2].open == 0 && w.heard_bytes == 0);
    session(1, 0); /* it was open already when the watch began */
    assert_int_equal(w.link[0].open, 0);
}

static void the_first_connection(void **state)
{
    (void)state;
    session(9, 1);
    assert_int_equal(watch_first_open_ns(&w), 0); /* of the other link */
    clock_rig_ns = 1100 * MS;
    session(3, 1);
    clock_rig_ns = 1200 * MS;
    session(1, 1);
    assert_int_equal(watch_first_open_ns(&w), 1100 * MS);
    assert_int_equal(w.link[0].open, 2);
    session(3, 0);
    assert_true(watch_is_whole(&w)); /* the other session is there */
    session(1, 0);
    assert_false(watch_is_whole(&w));
}

/* A client is back with its first session on its own link, from the end of the fault on. */
static void there_and_back(void **state)
{
    (void)state;
    assert_int_equal(watch_over_ns(&w), 0);
    session(1, 1);
    session(9, 1);
    note(FAULT_UNPLUG, 0, 50.0);
    clock_rig_ns = 1010 * MS;
    session(9, 0);
    session(1, 0);
    expect_break(0, 2, FAULT_UNPLUG, 1050, 0);
    expect_break(1, 1, FAULT_UNPLUG, 1050, 0);
    clock_rig_ns = 1070 * MS;
    session(2, 1);
    expect_break(0, 2, FAULT_UNPLUG, 1050, 0);
    expect_break(1, 1, FAULT_UNPLUG, 1050, 1070);
    assert_false(watch_is_whole(&w));
    clock_rig_ns = 1080 * MS;
    session(3, 1); /* it is back already */
    session(10, 1);
    expect_break(0, 2, FAULT_UNPLUG, 1050, 1080);
    expect_break(1, 1, FAULT_UNPLUG, 1050, 1070);
    assert_true(watch_is_whole(&w));
    note(FAULT_REFUSE, 2, 0.0);
    note(FAULT_REFUSE, 0, 0.0); /* nobody was turned away */
    assert_int_equal(w.n_broken, 3);
    expect_break(2, 2, FAULT_REFUSE, 1080, 0);
    assert_int_equal(watch_over_ns(&w), 1080 * MS);
    w.broken[1].over_ns = 1090 * MS;
    assert_int_equal(watch_over_ns(&w), 1090 * MS); /* the latest of all */
}

/* If there are several faults on a link, the one that lasts longest counts, and the later of equal ones. */
static void several_faults(void **state)
{
    (void)state;
    session(1, 1);
    note(FAULT_UNPLUG, 1, 50.0);
    note(FAULT_DISCONNECT, 1, 49.0);
    assert_int_equal(w.link[0].kind, FAULT_UNPLUG);
    note(FAULT_USB_RESET, 1, 50.0);
    assert_int_equal(w.link[0].kind, FAULT_USB_RESET);
    note(FAULT_DISCONNECT, 1, 51.0);
    note(FAULT_UNPLUG, 2, 99.0); /* of the other link */
    session(1, 0);
    expect_break(0, 1, FAULT_DISCONNECT, 1051, 0);
    session(1, 1); /* now no fault is at work */
    note(FAULT_USB_RESET, 1, 1.0);
    session(1, 0);
    expect_break(1, 1, FAULT_USB_RESET, 1001, 0);
}

/* After a fault that leaves sessions open, a client may end its own up to 200 ms later, and has all its time from then
 * on. A fault that ends sessions is the cause however late that is seen. */
static void faults_that_leave_sessions(void **state)
{
    static const struct {
        enum fault_kind kind;
        int ended_ms, is_broken, over_ms;
    } rows[] = {
        {FAULT_STALL, 1005, 1, 1010},       {FAULT_STALL, 1010, 1, 1010},      {FAULT_STALL, 1210, 1, 1210},
        {FAULT_STALL, 1211, 0, 0},          {FAULT_CABLE, 1210, 1, 1210},      {FAULT_CABLE, 1211, 0, 0},
        {FAULT_ENDPOINT_STALL, 1211, 0, 0}, {FAULT_SHORT_PACKETS, 1211, 0, 0}, {FAULT_DISCONNECT, 1211, 1, 1010},
        {FAULT_UNPLUG, 1211, 1, 1010},      {FAULT_USB_RESET, 1211, 1, 1010},  {FAULT_POWER_CYCLE, 1211, 1, 1010},
        {FAULT_DROP, 1005, 0, 0},           {FAULT_DELAY, 1005, 0, 0}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        watch_free(&w);
        begin(NULL);
        session(1, 1);
        note(rows[i].kind, 1, 10.0);
        assert_int_equal(w.stalls, rows[i].kind == FAULT_STALL);
        clock_rig_ns = rows[i].ended_ms * MS;
        session(1, 0);
        assert_int_equal(w.n_broken, rows[i].is_broken);
        if (rows[i].is_broken) expect_break(0, 1, rows[i].kind, rows[i].over_ms, 0);
    }
}

/* Clients that a power cycle sent away, and that are away still, can come back from its end on. */
static void power_comes_back(void **state)
{
    const struct fault_note ended = {.kind = FAULT_POWER_CYCLE, .ended = 1};
    (void)state;
    session(1, 1);
    session(9, 1);
    note(FAULT_DISCONNECT, 2, 5.0);
    session(9, 0);
    note(FAULT_POWER_CYCLE, 0, 100.0);
    session(1, 0);
    session(2, 1);
    note(FAULT_POWER_CYCLE, 0, 100.0);
    session(2, 0);
    clock_rig_ns = 1030 * MS;
    watch_note(&w, &ended);
    expect_break(0, 2, FAULT_DISCONNECT, 1005, 0);
    expect_break(1, 1, FAULT_POWER_CYCLE, 1100, 1000);
    expect_break(2, 1, FAULT_POWER_CYCLE, 1030, 0);
    assert_int_equal(w.injected, 3); /* an end is no fault */
}

/* Frames that a session did not get whole are known by their numbers. */
static void spoiled_frames(void **state)
{
    static const struct {
        enum fault_kind kind;
        int has_seq, spoils;
    } rows[] = {
        {FAULT_DROP, 1, 1}, {FAULT_TRUNCATE, 1, 1}, {FAULT_DROP, 0, 0}, {FAULT_FLIP, 1, 0}, {FAULT_DELAY, 1, 0}};
    size_t n = 0;
    (void)state;
    for (uint32_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const struct fault_note note = {
            .kind = rows[i].kind, .link = 1, .session = i + 1, .has_seq = rows[i].has_seq, .seq = 70 + i};
        watch_note(&w, &note);
        n += (size_t)rows[i].spoils;
        assert_int_equal(w.n_spoiled, n);
    }
    assert_true(w.spoiled[0].session == 1 && w.spoiled[0].seq == 70);
    assert_true(w.spoiled[1].session == 2 && w.spoiled[1].seq == 71);
}

/* The first three wrong requests are kept, up to 60 characters of each and 80 of its reply. */
static void wrong_requests(void **state)
{
    char line[101], reply[101], expected[160];
    (void)state;
    memset(line, 'a', 100);
    memset(reply, 'b', 100);
    line[100] = reply[100] = '\0';
    w.observer.refused(w.observer.ctx, 1, "one", "OK -221");
    w.observer.refused(w.observer.ctx, 16, line, reply);
    w.observer.refused(w.observer.ctx, 1, "three", NULL);
    w.observer.refused(w.observer.ctx, 1, "four", "ERR -222");
    w.observer.refused(w.observer.ctx, 1, "five", "ERR -221");
    assert_true(w.wrong == 4 && w.wrong_state == 1);
    assert_string_equal(w.refused[0], "'one': OK -221");
    snprintf(expected, sizeof expected, "'%.60s': %.80s", line, reply);
    assert_string_equal(w.refused[1], expected);
    assert_string_equal(w.refused[2], "'three'");
    w.observer.heard(w.observer.ctx, 1, line, 100); /* 79 characters are kept */
    assert_int_equal(strlen(w.last), WATCH_LINE - 1);
    w.observer.heard(w.observer.ctx, 1, "", 0);
    assert_true(w.last[0] == '\0' && w.heard_bytes == 100);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(sessions_belong_to_links, begin, end),
        cmocka_unit_test_setup_teardown(the_first_connection, begin, end),
        cmocka_unit_test_setup_teardown(there_and_back, begin, end),
        cmocka_unit_test_setup_teardown(several_faults, begin, end),
        cmocka_unit_test_setup_teardown(faults_that_leave_sessions, begin, end),
        cmocka_unit_test_setup_teardown(power_comes_back, begin, end),
        cmocka_unit_test_setup_teardown(spoiled_frames, begin, end),
        cmocka_unit_test_setup_teardown(wrong_requests, begin, end),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
