/* SPDX-License-Identifier: MIT */
/* States of the pulses per second, by pulses that come, don't come, or come at another time. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#include "firmware_sim/device/pps.h"

static const int64_t SECOND = 1000000000;

static void expect(const struct pps *pps, int64_t t_ns, enum protocol_pps state, int set)
{
    int was_set;
    assert_int_equal(pps_at(pps, t_ns, &was_set), state);
    assert_int_equal(was_set, set);
}

/* Pulses come at seconds 1 to 4, not at 5 and 6, and at 7 to 9. Then the clock jumps by 0.3 s. */
static void states_follow_the_pulses(void **state)
{
    (void)state;
    struct pps pps = {0};
    pps_power_up(&pps, 0, 0);
    for (int s = 1; s <= 9; s++)
        if (s != 5 && s != 6) pps_take(&pps, s * SECOND, 100 + s);
    pps_take(&pps, 9 * SECOND + 700000000, 110);
    for (int s = 1; s <= 3; s++)
        pps_take(&pps, (9 + s) * SECOND + 700000000, 110 + s);
    expect(&pps, 500000000, PROTOCOL_PPS_SYNCHRONISING, 1);
    expect(&pps, 2 * SECOND, PROTOCOL_PPS_SYNCHRONISING, 1);
    expect(&pps, 3 * SECOND, PROTOCOL_PPS_LOCKED, 1);
    expect(&pps, 5 * SECOND, PROTOCOL_PPS_LOCKED, 1);
    expect(&pps, 5 * SECOND + PPS_TOLERANCE_NS + 1, PROTOCOL_PPS_ABSENT, 1);
    expect(&pps, 7 * SECOND - 1, PROTOCOL_PPS_ABSENT, 1);
    expect(&pps, 7 * SECOND, PROTOCOL_PPS_SYNCHRONISING, 1);
    expect(&pps, 9 * SECOND, PROTOCOL_PPS_LOCKED, 1);
    expect(&pps, 9 * SECOND + 700000000, PROTOCOL_PPS_ERROR, 1);
    expect(&pps, 10 * SECOND + 700000000, PROTOCOL_PPS_SYNCHRONISING, 1);
    expect(&pps, 11 * SECOND + 700000000, PROTOCOL_PPS_LOCKED, 1);
}

/* There are sentences without pulses: the time of day is not set before the first pulse. */
static void without_pulses_no_time_is_set(void **state)
{
    (void)state;
    struct pps pps = {0};
    pps_power_up(&pps, 0, 1);
    expect(&pps, 0, PROTOCOL_PPS_ABSENT, 0);
    expect(&pps, 100 * SECOND, PROTOCOL_PPS_ABSENT, 0);
    pps_take(&pps, 101 * SECOND, 7);
    expect(&pps, 100 * SECOND, PROTOCOL_PPS_ABSENT, 0);
    expect(&pps, 101 * SECOND, PROTOCOL_PPS_SYNCHRONISING, 1);
    pps_take(&pps, 102 * SECOND, 9); /* the clock jumped by a whole second */
    expect(&pps, 102 * SECOND, PROTOCOL_PPS_ERROR, 1);
}

/* A power cycle begins anew, and earlier facts stay known. */
static void a_power_cycle_begins_anew(void **state)
{
    (void)state;
    struct pps pps = {0};
    pps_power_up(&pps, 0, 1);
    for (int s = 1; s <= 200; s++)
        pps_take(&pps, s * SECOND, s);
    pps_power_up(&pps, 205 * SECOND, 1);
    expect(&pps, 200 * SECOND, PROTOCOL_PPS_LOCKED, 1);
    expect(&pps, 205 * SECOND, PROTOCOL_PPS_ABSENT, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(states_follow_the_pulses),
        cmocka_unit_test(without_pulses_no_time_is_set),
        cmocka_unit_test(a_power_cycle_begins_anew),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
