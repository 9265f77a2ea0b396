/* SPDX-License-Identifier: MIT */
/* The client of a time server: when it asks, what sets the clock, and what it reports. The times of requests and
 * answers are exact, and the expected offsets and delays are computed by hand from them (RFC 4330, section 5). */
#include "firmware_sim/config/config.h"
#include "tests/unit/time_client_rig.h"

/* ---- the tests */

static void an_answer_sets_the_clock(void **state)
{
    (void)state;
    assert_int_equal(waits_ms, -1);
    expect_state("OFF", 0, 0, 0, 0, 0);
    set_server("CLIENT", 5, 0);
    expect_request(S); /* 1970 and the second since power-up */
    assert_int_equal(waits_ms, 1000);
    expect_state("ASKING", 0, 0, 0, 0, 0);

    /* T1 = 1, T2 = 100.5, T3 = 100.625, T4 = 1.375 s: offset (99.5 + 99.25) / 2, delay 0.375 - 0.125 */
    answer_after(S / 8 * 3, (struct answer){100 * S + S / 2, 100 * S + S / 8 * 5, 0, 1, NULL, 48});
    assert_true(date_ns() == S / 8 * 11 + S / 8 * 795);
    expect_state("SET", S / 8 * 795, S / 4, 1, 0, 0);
    expect_error(NULL);
    assert_int_equal(waits_ms, 5000 - 375);

    turn_after(5 * S - S / 8 * 3 - 1); /* a nanosecond too early */
    assert_int_equal(waits_ms, 1);
    assert_false(has_asked());
    turn_after(1);
    expect_request(6 * S + S / 8 * 795);
    answer_with(date_ns() - S / 8);
    expect_state("SET", -S / 8, 0, 2, 0, 0);
    assert_int_equal(waits_ms, 5000);
}

static void a_silent_server_is_given_up(void **state)
{
    (void)state;
    set_server("CLIENT", 5, 0);
    assert_true(has_asked());
    turn_after(S - 1);
    assert_int_equal(waits_ms, 1);
    expect_state("ASKING", 0, 0, 0, 0, 0);
    turn_after(1);
    expect_state("SILENT", 0, 0, 0, 0, 1);
    expect_error("127.1.2.3: no answer");
    assert_int_equal(waits_ms, 4000);
    answer_with(S); /* too late */
    expect_state("SILENT", 0, 0, 0, 0, 1);
    turn_after(4 * S);
    assert_true(has_asked());
    turn_after(S);
    expect_state("SILENT", 0, 0, 0, 0, 2);
    expect_error(NULL);  /* the state is no new one */
    turn_after(100 * S); /* the machine stood still: it asks once, and then a period later */
    assert_true(has_asked());
    assert_false(has_asked());
    turn_after(S);
    assert_int_equal(waits_ms, 4000);
}

static void answers_that_are_none(void **state)
{
    (void)state;
    set_server("CLIENT", 5, 0);
    assert_true(has_asked());
    answer_after(0, (struct answer){S, S, 0, 1, NULL, 47});
    request[47] ^= 1; /* to another request */
    answer_with(S);
    request[47] ^= 1;
    expect_state("ASKING", 0, 0, 0, 0, 0);
    assert_int_equal(waits_ms, 1000);
    is_interrupted = 1;
    turn_after(0);
    answer_after(0, (struct answer){S, S, 3, 1, NULL, 48});
    expect_state("UNSYNCHRONISED", 0, 0, 0, 1, 0);
    expect_error("127.1.2.3: is not synchronised");
    assert_int_equal(waits_ms, 5000);
    assert_true(date_ns() == S);
    answer_with(9 * S); /* one answer is enough */
    expect_state("UNSYNCHRONISED", 0, 0, 0, 1, 0);
}

/* The limit is 2 s. Both directions are tried at the limit and 1/8 s beyond. */
static void an_offset_has_a_limit(void **state)
{
    (void)state;
    set_clock(1, 0, 1000 * S); /* the first offset has no limit */
    expect_state("SET", 999 * S, 0, 1, 0, 0);
    turn_after(S);
    expect_request(1001 * S);
    answer_with(1003 * S + S / 8);
    expect_state("OFFSET", 999 * S, 0, 1, 1, 0);
    expect_error("127.1.2.3: 2.125000 s from the clock is beyond the limit of 2.000000 s");
    turn_after(S);
    expect_request(1002 * S);
    answer_with(1004 * S);
    expect_state("SET", 2 * S, 0, 2, 1, 0);
    turn_after(S);
    expect_request(1005 * S);
    answer_with(1003 * S);
    expect_state("SET", -2 * S, 0, 3, 1, 0);
    turn_after(S);
    expect_request(1004 * S);
    answer_with(1002 * S - S / 8);
    expect_state("OFFSET", -2 * S, 0, 3, 2, 0);
    expect_error("127.1.2.3: -2.125000 s from the clock is beyond the limit of 2.000000 s");
    assert_true(date_ns() == 1004 * S);

    /* The role was given up and taken again: the clock counts as not set. */
    rig_tell(rig, "TIME:SERV NONE,127.1.2.3,1,0,ETH", rig->next);
    set_server("CLIENT", 1, 0);
    turn_after(S);
    expect_request(1005 * S);
    answer_with(2005 * S);
    expect_state("SET", 1000 * S, 0, 4, 2, 0);
}

/* The clock shows local time, and requests have UTC. */
static void a_zone_is_ahead_of_utc(void **state)
{
    (void)state;
    set_clock(5, 2, 1000 * S);
    assert_true(date_ns() == 1000 * S + 7200 * S);
    expect_state("SET", 999 * S, 0, 1, 0, 0);
    turn_after(5 * S);
    expect_request(1005 * S);
    answer_with(1005 * S);
    assert_true(date_ns() == 1005 * S + 7200 * S);
    set_server("CLIENT", 5, -1); /* a second after the last request at the earliest */
    assert_int_equal(waits_ms, 1000);
    turn_after(S);
    expect_request(1006 * S);
    assert_true(date_ns() == 1006 * S + 7200 * S); /* until an answer comes */
    answer_with(1006 * S);
    assert_true(date_ns() == 1006 * S - 3600 * S);
    expect_state("SET", 0, 0, 3, 0, 0);
}

static void kisses(void **state)
{
    (void)state;
    set_server("CLIENT", 5, 0);
    assert_true(has_asked());
    kiss_with("RATE");
    expect_state("KISS", 0, 0, 0, 1, 0);
    expect_error("127.1.2.3: kiss-o'-death RATE");
    assert_int_equal(waits_ms, 10000);
    turn_after(10 * S);
    assert_true(has_asked());
    kiss_with("RATE");
    expect_error(NULL);
    assert_int_equal(waits_ms, 20000);
    turn_after(20 * S);
    assert_true(has_asked());
    kiss_with("ABCD"); /* it changes nothing */
    assert_int_equal(waits_ms, 20000);
    set_server("CLIENT", 6, 0); /* a new setting begins anew */
    turn_after(S);
    assert_true(has_asked());
    kiss_with("RSTR");
    assert_int_equal(waits_ms, -1);
    expect_error("127.1.2.3: kiss-o'-death RSTR, it is asked no more");
    set_server("CLIENT", 7, 0);
    turn_after(S);
    assert_true(has_asked());
    kiss_with("DENY");
    assert_int_equal(waits_ms, -1);
    expect_state("KISS", 0, 0, 0, 5, 0);
    expect_error("127.1.2.3: kiss-o'-death DENY, it is asked no more");
}

/* The rate is halved ten times at most. One wait lasts at most 1000 s, so a period of 1024 s takes two. */
static void it_slows_down_no_further(void **state)
{
    (void)state;
    set_server("CLIENT", 1, 0);
    assert_true(has_asked());
    for (int64_t period_s = 2; period_s <= 1024; period_s *= 2) {
        kiss_with("RATE");
        assert_int_equal(waits_ms, period_s < 1000 ? period_s * 1000 : 1000000);
        turn_after(period_s * S);
        assert_true(has_asked());
    }
    kiss_with("RATE");
    turn_after(1023 * S);
    assert_false(has_asked());
    turn_after(S);
    assert_true(has_asked());
}

static void a_server_is_asked_once_a_second(void **state)
{
    (void)state;
    set_server("CLIENT", 60, 0);
    assert_true(has_asked());
    now_ns += S / 4;
    set_server("CLIENT", 61, 0);
    assert_int_equal(waits_ms, 750);
    assert_false(has_asked());
    turn_after(S / 4 * 3);
    expect_request(2 * S);
    now_ns += S; /* it may be asked at once again */
    set_server("CLIENT", 62, 0);
    expect_request(3 * S);
    set_server("NONE", 62, 0);
    assert_int_equal(waits_ms, -1);
    expect_state("OFF", 0, 0, 0, 0, 0);
}

static void a_way_that_comes_later(void **state)
{
    (void)state;
    has_no_way = 1;
    set_server("CLIENT", 5, 0);
    expect_state("SILENT", 0, 0, 0, 0, 0);
    expect_error("127.1.2.3: there is no way to this server");
    assert_int_equal(waits_ms, 5000);
    turn_after(5 * S);
    assert_int_equal(waits_ms, 5000);
    expect_error(NULL);
    has_no_way = 0;
    turn_after(5 * S - 1);
    assert_false(has_asked());
    turn_after(1);
    expect_request(11 * S);
    expect_state("ASKING", 0, 0, 0, 0, 0);
    answer_with(11 * S);
    assert_int_equal(waits_ms, 5000);
}

static void others_are_not_asked(void **state)
{
    (void)state;
    rig_tell(rig, "TIME:SERV CLIENT,192.0.2.8,5,0,ETH", rig->next);
    turn_after(0);
    assert_int_equal(waits_ms, -1);
    expect_state("REFUSED", 0, 0, 0, 0, 0);
    expect_error("192.0.2.8: is not asked, since it is not on this machine; see ntp.anywhere");
    set_server("CLIENT", 5, 0);
    assert_true(has_asked());
}

/* Settings and answers are gone with power, and so is the clock. */
static void a_power_cycle_begins_anew(void **state)
{
    (void)state;
    set_clock(5, 3, 1000 * S);
    rig_go_to(rig, 374); /* power goes with this tick, and comes with the next one */
    rig_tell(rig, "HEAD:REB", rig->next);
    rig_go_to(rig, 700);
    turn_after(0);
    assert_int_equal(waits_ms, -1);
    expect_state("OFF", 0, 0, 0, 0, 0);
    const int64_t since_ns = date_ns();
    assert_true(since_ns == S / 8 * 5);
    set_server("CLIENT", 5, 0);
    turn_after(S);
    expect_request(since_ns + S);
    answer_with(5000 * S); /* beyond the limit of a clock that is set */
    assert_true(date_ns() == 5000 * S);
    expect_state("SET", 4999 * S - since_ns, 0, 1, 0, 0);
}

static void injected_faults_strike_at_answers(void **state)
{
    (void)state;
    static const struct {
        const char *fault, *state;
        int good, refused;
    } cases[] = {{"{kind: ntp_step, jump_s: 1}", "SET", 2, 0},
                 {"{kind: ntp_unsync}", "UNSYNCHRONISED", 2, 1},
                 {"{kind: ntp_kiss}", "KISS", 2, 2},
                 {"{kind: ntp_silent}", "KISS", 2, 2}};
    rig->cfg->n_links = 1; /* such faults need a link that can set the clock */
    rig->cfg->link[0].protocol = PROTOCOL_COLA;
    set_clock(1, 0, 1000 * S);
    for (size_t i = 0; i < 4; i++) {
        char line[80];
        snprintf(line, sizeof line, "FAUL:ADD %s", cases[i].fault);
        rig_tell(rig, line, rig->next);
        rig_go_to(rig, rig->next + 2);
        set_server("CLIENT", 2 + (int)i, 0);
        turn_after(S);
        assert_true(has_asked());
        const int64_t t_ns = date_ns();
        request[47] ^= 1; /* a fault does not change a foreign answer */
        answer_with(t_ns);
        request[47] ^= 1;
        answer_with(t_ns);
        assert_true(date_ns() == t_ns + (i == 0 ? S : 0));
        expect_state(i == 3 ? "ASKING" : cases[i].state, S, 0, cases[i].good, cases[i].refused, 0);
        rig_tell(rig, "FAUL:CLE ALL", rig->next);
        rig_go_to(rig, rig->next + 2);
    }
}

static void a_start_without_descriptors_fails(void **state)
{
    (void)state;
    struct time_client *other;
    struct sh_err err;
    has_no_descriptors = 1;
    assert_int_equal(time_client_start(rig->device, time_client_epoch_ns, &other, &err), SH_EIO);
    assert_string_equal(err.text, "no thread for the time server: Too many open files");
    assert_null(other);
    time_client_join(other);
}

#define TURN_BY_TURN(test) cmocka_unit_test_setup_teardown(test, time_client_setup, time_client_teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TURN_BY_TURN(an_answer_sets_the_clock),
        TURN_BY_TURN(a_silent_server_is_given_up),
        TURN_BY_TURN(answers_that_are_none),
        TURN_BY_TURN(an_offset_has_a_limit),
        TURN_BY_TURN(a_zone_is_ahead_of_utc),
        TURN_BY_TURN(kisses),
        TURN_BY_TURN(it_slows_down_no_further),
        TURN_BY_TURN(a_server_is_asked_once_a_second),
        TURN_BY_TURN(a_way_that_comes_later),
        TURN_BY_TURN(others_are_not_asked),
        TURN_BY_TURN(a_power_cycle_begins_anew),
        TURN_BY_TURN(injected_faults_strike_at_answers),
        TURN_BY_TURN(a_start_without_descriptors_fails),
    };
    return cmocka_run_group_tests_name("client of a time server", tests, make_folder, remove_folder);
}
