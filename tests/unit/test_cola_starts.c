/* SPDX-License-Identifier: MIT */
/* CoLa: when a session that asks for scans starts the head, and when it starts the head again. */
#include "tests/unit/cola_rig.h"

static void a_resting_head_is_started(void **state)
{
    (void)state;
    cola_open_lms();
    cola_authorise();
    cola_expect("sMN LMCstartmeas", "sAN LMCstartmeas 0");
    assert_int_equal(cola.n_lines, 1); /* it scans already */
    cola_head_state("idle");
    cola_expect("sMN LMCstartmeas", "sAN LMCstartmeas 0");
    assert_int_equal(cola.n_lines, 2);
    assert_string_equal(cola.line[1], "SCAN:START");
    cola_expect("sEN LMDscandata 1", "sEA LMDscandata 1");
    assert_string_equal(cola.line[1], "SCAN:START");
    cola_expect("sEN LMDscandata 0", "sEA LMDscandata 0"); /* a client that wants no scans starts none */
    assert_int_equal(cola.n_lines, 0);
    cola_expect("sMN LMCstopmeas", "sAN LMCstopmeas 0"); /* of this session alone */
    assert_int_equal(cola.n_lines, 0);
    cola_expect("sEN LMDscandata 1", "sEA LMDscandata 1");
    assert_int_equal(cola.n_lines, 0); /* the session measures nothing */
    cola_head_state("fault");
    cola_expect("sMN LMCstartmeas", "sAN LMCstartmeas 1");
    cola_head_state("scanning");
    assert_int_equal(cola_ask("sRN STlms")[10], '6'); /* the session is stopped, as before */
    cola_head_state("spin-down");                     /* the scan starts as soon as it can */
    cola_expect("sMN LMCstartmeas", "sAN LMCstartmeas 0");
    cola_head_state("idle");
    cola.ops->time(cola.protocol, 200000000);
    assert_string_equal(cola.line[cola.n_lines - 1], "SCAN:START");
    cola_head_state("scanning"); /* but somebody has stopped it: no scan comes */
    cola_expect("sEN LMDscandata 1", "sEA LMDscandata 1");
    cola_head_state("idle");
    cola.ops->time(cola.protocol, 400000000);
    assert_string_equal(cola.line[cola.n_lines - 1], "SCAN:START");
    cola_head_state("scanning");
    cola_turn(10, 1.0); /* after a scan, a head that was stopped stays so */
    cola_head_state("idle");
    protocol_rig_clear(&cola);
    cola.ops->time(cola.protocol, 9000000000);
    assert_int_equal(cola.n_lines, 0);
}

/* Another session stops the head. Scans that the head had made before still come, but no other follows them. */
static void the_last_scans_of_a_stopped_head_are_not_enough(void **state)
{
    (void)state;
    static const char *const when_asked[] = {"spin-down", "scanning"};
    for (int i = 0; i < 2; i++) {
        cola_open_lms();
        cola_authorise();
        cola_head_state(when_asked[i]);
        cola_expect("sMN LMCstartmeas", "sAN LMCstartmeas 0");
        cola_expect("sEN LMDscandata 1", "sEA LMDscandata 1");
        cola_head_state("spin-down");
        cola_turn(0, 1.0);
        cola_turn(1, 1.0);
        assert_int_equal(cola.n_units, 3);
        cola_head_state("idle");
        protocol_rig_clear(&cola);
        cola.ops->time(cola.protocol, 400000000);
        assert_int_equal(cola.n_lines, 2);
        assert_string_equal(cola.line[1], "SCAN:START");
        cola_head_state("scanning");
        cola_turn(20, 1.0);
        cola_head_state("idle");
        protocol_rig_clear(&cola);
        cola.ops->time(cola.protocol, 9000000000);
        assert_int_equal(cola.n_lines, 0);
    }
}

/* A scan of one turn has ended by itself when the turn is sent. Where the session has started that scan, it is done. */
static void a_scan_that_ends_by_itself_is_enough(void **state)
{
    (void)state;
    cola_open_lms();
    cola_authorise();
    cola_head_state("idle");
    cola_expect("sMN LMCstartmeas", "sAN LMCstartmeas 0");
    cola.descriptor.frames = 1;
    cola.descriptor.scan++;
    protocol_rig_describe(&cola, 0);
    cola_head_state("spin-down");
    cola_turn(0, 1.0);
    cola_head_state("idle");
    protocol_rig_clear(&cola);
    cola.ops->time(cola.protocol, 9000000000);
    assert_int_equal(cola.n_lines, 0);
}

/* Returns how often the session has started the head since the last call. */
static int count_starts(void)
{
    int n = 0;
    for (uint32_t i = 0; i < cola.n_lines; i++)
        n += strcmp(cola.line[i], "SCAN:START") == 0;
    protocol_rig_clear(&cola);
    return n;
}

static int starts_until(int64_t from_ns, int64_t to_ns)
{
    int n = count_starts();
    for (int64_t t_ns = from_ns; t_ns <= to_ns; t_ns += 5000000) {
        cola.ops->time(cola.protocol, t_ns);
        n += count_starts();
    }
    return n;
}

/* The session is at an earlier tick than the head, where the scan is over and was endless, or was a round of a
 * recording: rounds have the same number. A recording may begin in the middle of a scan. */
static void a_scan_of_its_own_may_be_over_when_it_comes(void **state)
{
    (void)state;
    for (uint32_t line = 0; line <= 100; line += 100) {
        cola_open_lms();
        cola_authorise();
        cola_head_state("idle");
        for (int64_t s = 1; s <= 11; s += 10) {
            cola.ops->time(cola.protocol, s * 1000000000);
            cola_expect("sMN LMCstartmeas", "sAN LMCstartmeas 0");
            assert_int_equal(count_starts(), 1);
            cola_expect("sEN LMDscandata 1", "sEA LMDscandata 1");
            assert_int_equal(starts_until(s * 1000000000, s * 1000000000 + 10000000), 0);
            cola.scan_t0_ns = s * 1000000000 + 10000000 - line * 40000000; /* 25 turns a second */
            cola_turn(line, 1.0);
            assert_int_equal(cola.n_units, 1);
            assert_int_equal(starts_until(s * 1000000000 + 60000000, s * 1000000000 + 2000000000), 0);
            cola_expect("sMN LMCstopmeas", "sAN LMCstopmeas 0");
        }
    }
}

/* The mirror takes 3 s to its speed, and the session is behind the head, where the scan is over by then. Two turns take
 * 80 ms. If no scan has come by then, somebody has stopped it, and the head is started again. */
static void a_slow_mirror_is_started_once(void **state)
{
    (void)state;
    for (int comes = 0; comes < 2; comes++) {
        cola_open_lms();
        cola.identity.spin_up_ns = 3000000000;
        cola_authorise();
        cola_head_state("idle");
        cola.ops->time(cola.protocol, 1000000000);
        cola_expect("sEN LMDscandata 1", "sEA LMDscandata 1");
        assert_int_equal(starts_until(1000000000, 4080000000), 1);
        cola.scan_t0_ns = 4080000000;
        if (comes) cola_turn(0, 1.0);
        assert_int_equal(starts_until(4120000000, 4500000000), !comes);
    }
}

/* Frames wait for the session for up to queue_ns, so that it may be that far behind the head. Two turns take 80 ms, so
 * that the first whole turn may come that much later. Only after that the head is started again. */
static void a_session_that_is_behind_starts_once(void **state)
{
    (void)state;
    for (int64_t queue_ns = 200000000; queue_ns <= 1000000000; queue_ns += 800000000) {
        cola_open_lms();
        cola.identity.queue_ns = queue_ns;
        cola_authorise();
        cola_head_state("idle");
        cola.ops->time(cola.protocol, 1000000000);
        cola_expect("sEN LMDscandata 1", "sEA LMDscandata 1");
        assert_int_equal(starts_until(1000000000, 1075000000 + queue_ns), 1);
        assert_int_equal(starts_until(1080000000 + queue_ns, 1280000000 + queue_ns), 1);
    }
}

/* The session has started the scan that another session stops, but had its turns before it asked for scans again. */
static void a_scan_of_its_own_from_before_is_not_enough(void **state)
{
    (void)state;
    cola_open_lms();
    cola_authorise();
    cola_head_state("idle");
    cola.ops->time(cola.protocol, 1000000000);
    cola_expect("sMN LMCstartmeas", "sAN LMCstartmeas 0");
    assert_int_equal(count_starts(), 1);
    cola.scan_t0_ns = 1010000000;
    cola_turn(0, 1.0);
    cola_expect("sMN LMCstopmeas", "sAN LMCstopmeas 0");
    cola_head_state("spin-down");
    cola_expect("sMN LMCstartmeas", "sAN LMCstartmeas 0");
    cola_turn(1, 1.0);
    cola_head_state("idle");
    assert_int_equal(starts_until(1095000000, 1250000000), 1);
    cola.scan_t0_ns = 1260000000;
    cola_turn(0, 1.0);
    cola_expect("sMN LMCstopmeas", "sAN LMCstopmeas 0");
    cola_expect("sMN LMCstartmeas", "sAN LMCstartmeas 0"); /* at once: the scan that was started last has come */
    assert_int_equal(count_starts(), 1);
}

/* Another session starts an endless scan after the wish, and stops it. */
static void a_later_scan_of_another_is_enough(void **state)
{
    (void)state;
    cola_open_lms();
    cola_authorise();
    cola.ops->time(cola.protocol, 1000000000);
    cola_head_state("spin-up");
    cola_expect("sMN LMCstartmeas", "sAN LMCstartmeas 0");
    cola_head_state("spin-down");
    cola.scan_t0_ns = 1050000000;
    cola_turn(0, 1.0);
    cola_head_state("idle");
    assert_int_equal(starts_until(1100000000, 2000000000), 0);
}

int main(void)
{
#define CASE(f) cmocka_unit_test_teardown(f, cola_teardown)
    const struct CMUnitTest tests[] = {
        CASE(a_resting_head_is_started),
        CASE(the_last_scans_of_a_stopped_head_are_not_enough),
        CASE(a_scan_that_ends_by_itself_is_enough),
        CASE(a_scan_of_its_own_may_be_over_when_it_comes),
        CASE(a_slow_mirror_is_started_once),
        CASE(a_session_that_is_behind_starts_once),
        CASE(a_scan_of_its_own_from_before_is_not_enough),
        CASE(a_later_scan_of_another_is_enough),
    };
    return cmocka_run_group_tests_name("cola starts", tests, NULL, NULL);
}
