/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "firmware_sim/command/head.h"

/* All pairs of a state and an event, by name; "-" is refused. */
static const char *const event_order[HEAD_N_EVENTS] = {"power-on", "power-off", "booted",    "start", "spun-up",
                                                       "stop",     "done",      "spun-down", "fail",  "reset"};
static const struct {
    const char *state;
    const char *next[HEAD_N_EVENTS];
} pairs[HEAD_N_STATES] = {
    /* clang-format off */
    /*            power-on power-off booted start      spun-up     stop         done         spun-down fail     reset */
    {"off",       {"boot", "off",    "-",    "-",       "-",        "-",         "-",         "-",    "-",     "-"}},
    {"boot",      {"-",    "off",    "idle", "-",       "-",        "-",         "-",         "-",    "fault", "-"}},
    {"idle",      {"-",    "off",    "-",    "spin-up", "-",        "-",         "-",         "-",    "fault", "idle"}},
    {"spin-up",   {"-",    "off",    "-",    "-",       "scanning", "spin-down", "-",         "-",    "fault", "spin-down"}},
    {"scanning",  {"-",    "off",    "-",    "-",       "-",        "spin-down", "spin-down", "-",    "fault", "spin-down"}},
    {"spin-down", {"-",    "off",    "-",    "-",       "-",        "-",         "-",         "idle", "fault", "spin-down"}},
    {"fault",     {"-",    "off",    "-",    "-",       "-",        "-",         "-",         "-",    "fault", "idle"}},
    /* clang-format on */
};

static int next(int state, int event)
{
    return head_next_state((enum head_state)state, (enum head_event)event);
}

static void every_pair_is_as_written(void **ctx)
{
    (void)ctx;
    for (int state = 0; state < HEAD_N_STATES; state++) {
        assert_string_equal(head_state_name((enum head_state)state), pairs[state].state);
        for (int event = 0; event < HEAD_N_EVENTS; event++) {
            const int got = next(state, event);
            const char *name = got < 0 ? "-" : head_state_name((enum head_state)got);
            if (strcmp(name, pairs[state].next[event]) != 0)
                fail_msg("%s + %s gives %s, not %s", pairs[state].state, event_order[event], name,
                         pairs[state].next[event]);
        }
    }
}

static void names_are_those_on_the_wire(void **ctx)
{
    (void)ctx;
    static const char *const names[] = {"off", "boot", "idle", "spin-up", "scanning", "spin-down", "fault", "unknown"};
    for (int state = 0; state <= HEAD_N_STATES; state++)
        assert_string_equal(head_state_name((enum head_state)state), names[state]);
    assert_string_equal(head_state_name((enum head_state) - 1), "unknown");
}

static void what_is_no_state_or_event_is_refused(void **ctx)
{
    (void)ctx;
    const int wrong[] = {-1, HEAD_N_EVENTS, 1000, INT32_MIN, INT32_MAX};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        assert_int_equal(next(wrong[i], HEAD_EV_POWER_OFF), -1);
        assert_int_equal(next(HEAD_IDLE, wrong[i]), -1);
    }
    assert_int_equal(next(HEAD_N_STATES, HEAD_EV_POWER_OFF), -1);
}

static void only_power_leads_to_and_from_off(void **ctx)
{
    (void)ctx;
    for (int state = 0; state < HEAD_N_STATES; state++) {
        assert_int_equal(next(state, HEAD_EV_POWER_OFF), HEAD_OFF);
        for (int event = 0; event < HEAD_N_EVENTS; event++)
            if (event != HEAD_EV_POWER_OFF) assert_int_not_equal(next(state, event), HEAD_OFF);
    }
    for (int event = 0; event < HEAD_N_EVENTS; event++) {
        const int got = next(HEAD_OFF, event);
        assert_true(event == HEAD_EV_POWER_ON ? got == HEAD_BOOT : got == -1 || got == HEAD_OFF);
    }
}

/* Returns the states that are reachable from `from` by the given events, as a bit set. */
static unsigned reachable(int from, unsigned events)
{
    unsigned set = 1u << from, before = 0;
    while (set != before) {
        before = set;
        for (int state = 0; state < HEAD_N_STATES; state++)
            for (int event = 0; event < HEAD_N_EVENTS; event++)
                if ((set >> state & 1) && (events >> event & 1) && next(state, event) >= 0)
                    set |= 1u << next(state, event);
    }
    return set;
}

static void idle_is_reachable_without_a_power_cycle(void **ctx)
{
    (void)ctx;
    const unsigned all = (1u << HEAD_N_EVENTS) - 1;
    const unsigned power = 1u << HEAD_EV_POWER_ON | 1u << HEAD_EV_POWER_OFF;
    for (int state = HEAD_BOOT; state < HEAD_N_STATES; state++)
        assert_true(reachable(state, all & ~power) >> HEAD_IDLE & 1);
    assert_int_equal(reachable(HEAD_OFF, all), (1u << HEAD_N_STATES) - 1);
    /* *RST and the head's own movements lead there from everywhere but the self test. */
    const unsigned by_reset = 1u << HEAD_EV_RESET | 1u << HEAD_EV_SPUN_DOWN;
    for (int state = HEAD_IDLE; state < HEAD_N_STATES; state++)
        assert_true(reachable(state, by_reset) >> HEAD_IDLE & 1);
}

static void a_failure_takes_every_powered_state(void **ctx)
{
    (void)ctx;
    for (int state = HEAD_BOOT; state < HEAD_N_STATES; state++)
        assert_int_equal(next(state, HEAD_EV_FAIL), HEAD_FAULT);
    for (int event = 0; event < HEAD_N_EVENTS; event++) /* and only power, reset leave it */
        if (event != HEAD_EV_POWER_OFF && event != HEAD_EV_RESET && event != HEAD_EV_FAIL)
            assert_int_equal(next(HEAD_FAULT, event), -1);
}

/* The laser fires in `scanning` only. The mirror must have come up to speed before, and must stop after. */
static void scanning_lies_between_the_spins(void **ctx)
{
    (void)ctx;
    for (int state = 0; state < HEAD_N_STATES; state++)
        for (int event = 0; event < HEAD_N_EVENTS; event++) {
            const int got = next(state, event);
            if (got == HEAD_SCANNING) assert_true(state == HEAD_SPIN_UP && event == HEAD_EV_SPUN_UP);
            if (state == HEAD_SCANNING && got >= 0)
                assert_true(got == HEAD_SPIN_DOWN || got == HEAD_FAULT || got == HEAD_OFF);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_pair_is_as_written),
        cmocka_unit_test(names_are_those_on_the_wire),
        cmocka_unit_test(what_is_no_state_or_event_is_refused),
        cmocka_unit_test(only_power_leads_to_and_from_off),
        cmocka_unit_test(idle_is_reachable_without_a_power_cycle),
        cmocka_unit_test(a_failure_takes_every_powered_state),
        cmocka_unit_test(scanning_lies_between_the_spins),
    };
    return cmocka_run_group_tests_name("head", tests, NULL, NULL);
}
