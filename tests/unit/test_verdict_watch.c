/* SPDX-License-Identifier: MIT */
/* The clients as the head sees them: who was sent away and came back, what was asked wrongly, what was sent. Session
 * numbers are 8 a link, from 1 (COMMANDS.md, Sessions and control). */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <cmocka.h>

#include <string.h>

#include "firmware_sim/app/studio/verdict/watch.h"
#include "firmware_sim/base/clock.h"

static struct watch w;

static void session(uint32_t number, int begins)
{
    w.observer.session(w.observer.ctx, number, begins, "127.0.0.1:5", 1000 * (int64_t)number + !begins);
}

static void note(enum fault_kind kind, uint32_t link, double for_ms)
{
    const struct fault_note note = {.kind = kind, .link = link, .for_ms = for_ms};
    watch_note(&w, &note);
}

static int begin(void **state)
{
    (void)state;
    watch_begin(&w, 2, 1, 60.0);
    return 0;
}

static int end(void **state)
{
    (void)state;
    watch_free(&w);
    return 0;
}

static void test_a_session_that_a_fault_ends(void **state)
{
    (void)state;
    assert_false(watch_is_whole(&w));
    session(1, 1);
    assert_true(watch_is_whole(&w));
    note(FAULT_DISCONNECT, 1, 50.0);
    assert_true(watch_is_whole(&w)); /* it has not ended yet */
    session(1, 0);
    assert_false(watch_is_whole(&w));
    assert_int_equal(w.n_broken, 1);
    assert_int_equal(w.broken[0].kind, FAULT_DISCONNECT);
    assert_string_equal(w.broken[0].peer, "127.0.0.1:5");
    assert_true(w.broken[0].over_ns > clock_now_ns() - 60000000 && watch_over_ns(&w) == w.broken[0].over_ns);
    session(9, 1); /* another link is no way back */
    assert_int_equal(w.broken[0].back_ns, 0);
    session(2, 1);
    assert_true(w.broken[0].back_ns != 0 && watch_is_whole(&w));
}

/* The fault is over with the next session. If that session ends, it ends for another reason. */
static void test_a_client_that_goes_by_itself(void **state)
{
    (void)state;
    session(1, 1);
    session(1, 0);
    assert_int_equal(w.n_broken, 0);
    assert_false(watch_is_whole(&w));
    note(FAULT_UNPLUG, 1, 0.0);
    session(2, 1);
    session(2, 0);
    assert_int_equal(w.n_broken, 0);
}

static void test_whom_a_fault_concerns(void **state)
{
    (void)state;
    session(1, 1);
    session(9, 1);
    note(FAULT_UNPLUG, 2, 0.0);
    session(1, 0); /* of the other link */
    assert_int_equal(w.n_broken, 0);
    session(1, 1);
    note(FAULT_POWER_CYCLE, 0, 100.0); /* of the head: both */
    session(1, 0);
    session(9, 0);
    assert_int_equal(w.n_broken, 2);
    const int64_t over_ns = w.broken[0].over_ns;
    const struct fault_note ended = {.kind = FAULT_POWER_CYCLE, .ended = 1};
    watch_note(&w, &ended); /* power is back, earlier than for_ms says */
    assert_true(w.broken[0].over_ns < over_ns);
    assert_int_equal(w.injected, 2);
}

/* A power cycle concerns each link that is watched, and no other. */
static void test_all_links(void **state)
{
    (void)state;
    note(FAULT_POWER_CYCLE, 0, 100.0);
    assert_true(w.link[0].acted && w.link[1].acted && !w.link[2].acted);
    watch_free(&w);
    watch_begin(&w, CONFIG_MAX_LINKS, 1, 60.0);
    for (uint32_t i = 0; i < CONFIG_MAX_LINKS; i++)
        session(1 + 8 * i, 1);
    note(FAULT_POWER_CYCLE, 0, 100.0);
    assert_int_equal(w.n_broken, 0);
    for (uint32_t i = 0; i < CONFIG_MAX_LINKS; i++)
        session(1 + 8 * i, 0);
    assert_int_equal(w.n_broken, CONFIG_MAX_LINKS);
    for (uint32_t i = 0; i < CONFIG_MAX_LINKS; i++)
        assert_int_equal(w.broken[i].link, i + 1);
}

/* A client may end a connection that is silent, and then has to come back. A client that keeps it need not. */
static void test_silence(void **state)
{
    (void)state;
    session(1, 1);
    note(FAULT_STALL, 1, 10.0);
    assert_true(watch_is_whole(&w));
    session(1, 0);
    assert_int_equal(w.n_broken, 1);
    assert_int_equal(w.stalls, 1);
    note(FAULT_REFUSE, 1, 0.0); /* turned away at the door */
    assert_int_equal(w.n_broken, 2);
    session(1, 1);
    assert_true(watch_is_whole(&w));
}

/* A client that goes by itself, long after a stall, was not sent away by it. The test sets the times. */
static void test_an_end_long_after_a_silence(void **state)
{
    (void)state;
    session(1, 1);
    note(FAULT_STALL, 1, 10.0);
    w.link[0].over_ns -= INT64_C(70000000000); /* it was over 70 s ago, and 60 s are the limit */
    session(1, 0);
    assert_int_equal(w.n_broken, 0);
    session(1, 1);
    note(FAULT_CABLE, 1, 10.0);
    w.link[0].over_ns -= INT64_C(30000000000);
    const int64_t ended_ns = clock_now_ns();
    session(1, 0);
    assert_int_equal(w.n_broken, 1);
    assert_true(w.broken[0].over_ns >= ended_ns); /* it can come back from its own end on */
    session(1, 1);
    note(FAULT_DISCONNECT, 1, 0.0); /* this ends it, however late its thread reports that */
    w.link[0].over_ns -= INT64_C(70000000000);
    session(1, 0);
    assert_int_equal(w.n_broken, 2);
}

/* The device sends only what was asked for, so a client is back once it has asked. */
static void test_a_link_on_which_clients_must_ask(void **state)
{
    (void)state;
    w.must_ask = 1;
    session(1, 1);
    note(FAULT_DISCONNECT, 1, 0.0);
    session(1, 0);
    w.observer.heard(w.observer.ctx, 1, "MD", 2); /* read late: nobody is there any more */
    session(2, 1);
    assert_false(watch_is_whole(&w));
    w.observer.heard(w.observer.ctx, 2, "MD", 2);
    assert_true(watch_is_whole(&w));
}

static void test_requests(void **state)
{
    (void)state;
    w.observer.heard(w.observer.ctx, 1, "GO\r\n", 4);
    w.observer.refused(w.observer.ctx, 1, "GO", "ERR -113,\"Undefined header\"");
    w.observer.refused(w.observer.ctx, 1, "SCAN:STAR", "ERR -221,\"Settings conflict\"");
    w.observer.refused(w.observer.ctx, 1, "SCAN:STAR", "ERR -203,\"Command protected\"");
    w.observer.heard(w.observer.ctx, 1, "\002sMN X\003", 7);
    w.observer.refused(w.observer.ctx, 1, NULL, NULL);
    w.observer.refused(w.observer.ctx, 17, "OWN", "ERR -113,\"\""); /* the head's own stream is no link of the two */
    assert_int_equal(w.wrong, 2);
    assert_int_equal(w.wrong_state, 2);
    assert_int_equal(w.heard_bytes, 11);
    assert_string_equal(w.refused[0], "'GO': ERR -113,\"Undefined header\"");
    assert_string_equal(w.refused[1], "'sMN X'");
}

static void test_spans_of_the_chosen_link(void **state)
{
    (void)state;
    session(9, 1);
    session(1, 1);
    session(2, 1);
    session(1, 0);
    assert_int_equal(w.n_span, 2);
    assert_true(w.span[0].session == 1 && w.span[0].from_ns == 1000 && w.span[0].to_ns == 1001);
    assert_true(w.span[1].session == 2 && w.span[1].to_ns == INT64_MAX);
    const struct fault_note drop = {.kind = FAULT_DROP, .link = 1, .session = 2, .has_seq = 1, .seq = 77};
    watch_note(&w, &drop);
    assert_true(w.n_spoiled == 1 && w.spoiled[0].session == 2 && w.spoiled[0].seq == 77);
}

/* A session that the end of the run ends is no disturbance. */
static void test_the_end(void **state)
{
    (void)state;
    session(1, 1);
    note(FAULT_DISCONNECT, 1, 0.0);
    watch_end(&w);
    session(1, 0);
    assert_int_equal(w.n_broken, 0);
    assert_int_equal(w.span[0].to_ns, 1001);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_a_session_that_a_fault_ends, begin, end),
        cmocka_unit_test_setup_teardown(test_a_client_that_goes_by_itself, begin, end),
        cmocka_unit_test_setup_teardown(test_whom_a_fault_concerns, begin, end),
        cmocka_unit_test_setup_teardown(test_all_links, begin, end),
        cmocka_unit_test_setup_teardown(test_silence, begin, end),
        cmocka_unit_test_setup_teardown(test_an_end_long_after_a_silence, begin, end),
        cmocka_unit_test_setup_teardown(test_requests, begin, end),
        cmocka_unit_test_setup_teardown(test_a_link_on_which_clients_must_ask, begin, end),
        cmocka_unit_test_setup_teardown(test_spans_of_the_chosen_link, begin, end),
        cmocka_unit_test_setup_teardown(test_the_end, begin, end),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
