/* SPDX-License-Identifier: MIT */
/* A client of a soak: its calls at each result of the library, in their order and with their times. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "firmware_sim/app/studio/soak/client.h"
#include "tests/unit/lock_rig.h"
#include "tests/unit/soak_client_rig.h"

enum { LINE_END = SCANHEAD_LINE_END, POINTS = SCANHEAD_POINTS };

/* A client of the first link, until its turns are over. */
static void run(const struct turn *script, const char *type)
{
    struct sh_err err;
    add_place(type, "tcp:x", "native");
    add_place("null", "null", NULL);
    assert_int_equal(open_all(0, &err), SH_OK);
    turns = script;
    assert_int_equal(soak_clients_start(&soak, &err), SH_OK);
    assert_true(at->running && !soak.link[1].running);
    soak_clients_join(&soak);
    assert_false(at->running);
    assert_int_equal(atomic_load(&at->done), 1);
    assert_int_equal(pthread_mutex_trylock(&at->lock), 0);
    free(at->fact);
    at->fact = NULL;
}

#define LAST    \
    {           \
        .rc = 1 \
    }

/* It asks for the head's state as it begins, and each 200 ms as long as no points come; then it asks other
 * questions. After more than 500 ms without points it asks for the state again. */
static void it_asks_now_and_then(void **unused)
{
    static const struct turn script[] = {
        {SCANHEAD_OK, 30, 0, NULL},         {SCANHEAD_ETIMEOUT, 50, 0, NULL}, /* 1080: it has no frame */
        {SCANHEAD_OK, 199, LINE_END, NULL}, {SCANHEAD_OK, 1, LINE_END, NULL}, /* 1280: points may come soon */
        {SCANHEAD_OK, 200, LINE_END, NULL},                                   /* 1480 */
        {SCANHEAD_OK, 20, POINTS, NULL},                                      /* 1500: that is too soon */
        {SCANHEAD_OK, 500, LINE_END, NULL},                                   /* 2000: points came 500 ms ago */
        {SCANHEAD_OK, 200, LINE_END, NULL},                                   /* 2200 */
        {SCANHEAD_OK, 10, POINTS, NULL},    {SCANHEAD_ETIMEOUT, 190, 0, NULL}, LAST};
    (void)unused;
    reader_lost = 12;
    run(script, "tcp");
    assert_string_equal(trace, "open:tcp:x=0 listen opened:30 saw_open@1030 scan@1080 line@1279 inside "
                               "line@1280 inside ask@1280 line@1480 inside scan@1480 points@1500 inside "
                               "line@2000 inside ask@2000 line@2200 inside scan@2200 points@2210 inside "
                               "ask@2400 ");
    assert_int_equal(at->ask.settling, 0);
    assert_true(at->reader_lost == 12 && at->dropped == 24);
    assert_string_equal(at->failed, "");
}

/* A terminal may have old bytes in it, so its first question is one that the library asks to resynchronise. */
static void a_terminal_settles_first(void **unused)
{
    static const struct turn script[] = {{SCANHEAD_OK, 0, 0, NULL}, LAST};
    (void)unused;
    run(script, "pty");
    assert_string_equal(trace, "open:tcp:x=0 listen opened:0 saw_open@1000 ");
    assert_int_equal(at->ask.settling, 1);
}

/* It tries each 20 ms. The first time it opens the head, later it finds the same one again. */
static void it_opens_the_head_again(void **unused)
{
    static const int ends[] = {SCANHEAD_ECLOSED, SCANHEAD_ELOST, SCANHEAD_ERESET};
    (void)unused;
    for (int i = 0; i < 3; i++) {
        const struct turn script[] = {{SCANHEAD_ECLOSED, 3, 0, NULL}, {SCANHEAD_ELOST, 3, 0, NULL},
                                      {SCANHEAD_OK, 3, 0, NULL},      {SCANHEAD_OK, 1, POINTS, NULL},
                                      {ends[i], 10, 0, NULL},         {SCANHEAD_EIO, 5, 0, NULL},
                                      {SCANHEAD_OK, 5, 0, NULL},      LAST};
        char expected[512];
        make_soak(NULL);
        run(script, "tcp");
        snprintf(expected, sizeof expected,
                 "open:tcp:x=%d no_open@1003 open:tcp:x=%d no_open@1026 open:tcp:x=0 listen opened:3 saw_open@1049 "
                 "points@1050 inside ask@1050 end@1060 reattach:0=%d no_open@1065 reattach:0=0 listen opened:5 "
                 "saw_open@1090 ask@1090 ",
                 SCANHEAD_ECLOSED, SCANHEAD_ELOST, SCANHEAD_EIO);
        assert_string_equal(trace, expected);
    }
}

static void end_soak(void)
{
    atomic_store(&soak.phase, SOAK_ENDS);
}

static void it_stops_trying_at_the_end(void **unused)
{
    static const struct turn script[] = {{SCANHEAD_ECLOSED, 1, 0, NULL}, {SCANHEAD_ECLOSED, 1, 0, end_soak}, LAST};
    static const struct turn last_frame[] = {{SCANHEAD_OK, 0, 0, NULL}, {SCANHEAD_OK, 1, POINTS, end_soak}, LAST};
    (void)unused;
    run(script, "tcp");
    assert_string_equal(trace, "open:tcp:x=-6 no_open@1001 open:tcp:x=-6 no_open@1022 ");
    assert_int_equal(at->reader_lost, 0); /* it has no head */
    make_soak(NULL);
    run(last_frame, "tcp"); /* it takes what is still there, without a question, and ends no session */
    assert_string_equal(trace, "open:tcp:x=0 listen opened:0 saw_open@1000 points@1001 inside ");
}

/* The locks that the client's thread has taken so far: two as it opened the head, then one for each note. */
static int n_locks;

static void count_locks(void)
{
    n_locks = lock_rig_taken;
}

static void get_no_frames(void)
{
    frames_in_stats = 0;
}

static void get_frames(void)
{
    frames_in_stats = 1;
}

/* A stream that begins with a frame of another version goes on. Where no frame ever came, the stream is over. */
static void wrong_beginnings_are_told_apart(void **unused)
{
    static const struct turn script[] = {
        {SCANHEAD_OK, 0, 0, NULL},        {SCANHEAD_EFORMAT, 1, 0, get_frames},
        {SCANHEAD_EFORMAT, 1, 0, NULL},   {SCANHEAD_EFORMAT, 1, 0, get_no_frames},
        {SCANHEAD_OK, 7, 0, count_locks}, LAST,
    };
    (void)unused;
    run(script, "tcp");
    assert_string_equal(trace, "open:tcp:x=0 listen opened:0 saw_open@1000 scan@1001 end@1003 reattach:0=0 listen "
                               "opened:7 saw_open@1010 scan@1010 ");
    assert_int_equal(n_locks, 2);
}

static void other_errors_end_the_client(void **unused)
{
    static const int errors[] = {SCANHEAD_EIO, SCANHEAD_ENOMEM, SCANHEAD_EPERM, SCANHEAD_ESTATE, SCANHEAD_EINPUT};
    (void)unused;
    for (int i = 0; i < 5; i++) {
        const struct turn script[] = {{SCANHEAD_OK, 0, 0, NULL}, {errors[i], 1, 0, NULL}, LAST};
        make_soak(NULL);
        run(script, "tcp");
        assert_string_equal(trace, "open:tcp:x=0 listen opened:0 saw_open@1000 ");
        assert_string_equal(at->failed, "it broke");
    }
}

/* ---- the end of a soak */

static void drain_early(void)
{
    atomic_store(&soak.phase, SOAK_DRAINS);
    atomic_store(&soak.until, 50);
    at->in_session = 1;
    at->last = 49;
}

static void get_last(void)
{
    at->last = 50;
}

static void lose_session(void)
{
    get_last();
    at->in_session = 0;
}

static void have_session(void)
{
    at->in_session = 1;
}

/* A client is done once it has seen the last frame that a fault can have hit, if it has a session and got points less
 * than 500 ms ago. From then on it only reads. */
static void it_is_done(void **unused)
{
    static const struct turn script[] = {{SCANHEAD_OK, 0, 0, NULL},
                                         {SCANHEAD_OK, 0, POINTS, drain_early}, /* 1000 */
                                         {SCANHEAD_ETIMEOUT, 200, 0, lose_session},
                                         {SCANHEAD_ETIMEOUT, 300, 0, have_session}, /* points are too old */
                                         {SCANHEAD_ETIMEOUT, 200, 0, NULL},
                                         {SCANHEAD_OK, 0, POINTS, NULL}, /* 1700: done */
                                         {SCANHEAD_OK, 300, POINTS, count_locks},
                                         LAST};
    static const struct turn just[] = {
        {SCANHEAD_OK, 0, 0, NULL}, {SCANHEAD_OK, 0, POINTS, drain_early}, {SCANHEAD_ETIMEOUT, 499, 0, get_last}, LAST};
    (void)unused;
    run(script, "tcp");
    assert_string_equal(trace, "open:tcp:x=0 listen opened:0 saw_open@1000 points@1000 inside ask@1000 ask@1200 "
                               "ask@1500 scan@1700 points@1700 inside points@2000 inside ");
    assert_int_equal(n_locks, 2 + 5); /* it looked five times whether it was done */
    make_soak(NULL);
    run(just, "tcp");
    assert_string_equal(trace, "open:tcp:x=0 listen opened:0 saw_open@1000 points@1000 inside ask@1000 ");
}

static void before_the_top(void)
{
    at->last = top;
}

static void at_the_top(void)
{
    at->last = top + 1;
}

static void drain(void)
{
    atomic_store(&soak.phase, SOAK_DRAINS);
}

/* Packets are done once one came after the last that a fault can have hit. They are compared on to the soak's end. */
static void packets_are_done(void **unused)
{
    static const struct turn script[] = {{0, 0, 0, NULL},
                                         {0, 0, 0, drain},
                                         {0, 0, 0, NULL},
                                         {0, 0, 0, before_the_top},
                                         {0, 0, 0, at_the_top},
                                         {0, 0, 0, NULL},
                                         LAST};
    (void)unused;
    top = 70;
    soak.datagrams[0] = (struct soak_datagrams *)&cfg;
    run(script, "udp");
    assert_string_equal(trace, "step:0 step:0 top step:0 step:70 step:71 step:71,done step:71,done finish ");
    trace[0] = '\0';
    at->sh = handle;
    soak_clients_close(&soak);
    assert_string_equal(trace, "close datagrams close:none datagrams:none ");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(it_asks_now_and_then, make_soak),
        cmocka_unit_test_setup(a_terminal_settles_first, make_soak),
        cmocka_unit_test_setup(it_opens_the_head_again, make_soak),
        cmocka_unit_test_setup(it_stops_trying_at_the_end, make_soak),
        cmocka_unit_test_setup(wrong_beginnings_are_told_apart, make_soak),
        cmocka_unit_test_setup(other_errors_end_the_client, make_soak),
        cmocka_unit_test_setup(it_is_done, make_soak),
        cmocka_unit_test_setup(packets_are_done, make_soak),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
