/* SPDX-License-Identifier: MIT */
/* States of the pulses per second, by pulses that come, don't come, or come at another time; and the counter of time
 * since the top of the hour, which pulses and sentences set. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#include "firmware_sim/device/pps.h"

static const int64_t SECOND = 1000000000, MS = 1000000;

/* The head's clock is right, and 100 s ahead of device time. */
static struct pps_moment at(int64_t t_ns)
{
    return (struct pps_moment){t_ns, 100 * SECOND + t_ns};
}

static void expect(const struct pps *pps, int64_t t_ns, enum protocol_pps state, int64_t hour_ns)
{
    int64_t was_ns;
    assert_int_equal(pps_at(pps, at(t_ns), &was_ns), state);
    assert_int_equal(was_ns, hour_ns);
}

/* Pulses come at seconds 1 to 4, not at 5 and 6, and at 7 to 9. After that, pulses come 0.3 s early. */
static void states_follow_the_pulses(void **state)
{
    (void)state;
    struct pps pps = {0};
    pps_power_up(&pps, at(0), 10 * SECOND, 1);
    for (int s = 1; s <= 9; s++)
        if (s != 5 && s != 6) pps_take(&pps, at(s * SECOND));
    for (int s = 0; s <= 3; s++)
        pps_take(&pps, at((9 + s) * SECOND + 700 * MS));
    expect(&pps, 500 * MS, PROTOCOL_PPS_SYNCHRONISING, 10 * SECOND + 500 * MS);
    expect(&pps, 2 * SECOND, PROTOCOL_PPS_SYNCHRONISING, 12 * SECOND);
    expect(&pps, 3 * SECOND, PROTOCOL_PPS_LOCKED, 13 * SECOND);
    expect(&pps, 5 * SECOND, PROTOCOL_PPS_LOCKED, 15 * SECOND);
    expect(&pps, 5 * SECOND + PPS_TOLERANCE_NS + 1, PROTOCOL_PPS_ABSENT, 15 * SECOND + PPS_TOLERANCE_NS + 1);
    expect(&pps, 7 * SECOND - 1, PROTOCOL_PPS_ABSENT, 17 * SECOND - 1);
    expect(&pps, 7 * SECOND, PROTOCOL_PPS_SYNCHRONISING, 17 * SECOND);
    expect(&pps, 9 * SECOND, PROTOCOL_PPS_LOCKED, 19 * SECOND);
    expect(&pps, 9 * SECOND + 700 * MS, PROTOCOL_PPS_ERROR, 19 * SECOND + 700 * MS);
    expect(&pps, 10 * SECOND + 700 * MS, PROTOCOL_PPS_SYNCHRONISING, 20 * SECOND + 700 * MS);
    expect(&pps, 11 * SECOND + 700 * MS, PROTOCOL_PPS_LOCKED, 22 * SECOND); /* to the nearest full second */
}

/* Where a receiver gives no pulse, the state is absent after a second. Without a receiver it is absent at once. */
static void absent_without_a_first_pulse(void **state)
{
    (void)state;
    struct pps pps = {0};
    int64_t hour_ns;
    assert_int_equal(pps_at(&pps, at(0), &hour_ns), PROTOCOL_PPS_ABSENT);
    pps_power_up(&pps, at(0), 0, 1);
    expect(&pps, SECOND + PPS_TOLERANCE_NS, PROTOCOL_PPS_SYNCHRONISING, SECOND + PPS_TOLERANCE_NS);
    expect(&pps, SECOND + PPS_TOLERANCE_NS + 1, PROTOCOL_PPS_ABSENT, SECOND + PPS_TOLERANCE_NS + 1);
    pps_power_up(&pps, at(2 * SECOND), -1, 0); /* UTC from before 1970: the hour begins where UTC's does */
    expect(&pps, 2 * SECOND, PROTOCOL_PPS_ABSENT, 3600 * SECOND - 1);
    expect(&pps, 2 * SECOND + 1, PROTOCOL_PPS_ABSENT, 0);
    pps_power_up(&pps, at(2 * SECOND), 0, 0);
    expect(&pps, 2 * SECOND, PROTOCOL_PPS_ABSENT, 0);
    pps_take(&pps, at(3 * SECOND));
    expect(&pps, 3 * SECOND, PROTOCOL_PPS_SYNCHRONISING, SECOND);
}

/* The counter begins at power-up. Sentences alone don't set it, nor do pulses before they are locked; a locked pulse
 * sets its part of a second, and the next sentence the rest. Without sentences it goes on. */
static void pulses_and_sentences_set_the_counter(void **state)
{
    (void)state;
    struct pps pps = {0};
    pps_power_up(&pps, at(0), 0, 0);
    pps_take_sentence(&pps, at(300 * MS), 1800);
    expect(&pps, 400 * MS, PROTOCOL_PPS_ABSENT, 400 * MS);
    for (int s = 0; s < 3; s++) {
        pps_take(&pps, at(s * SECOND + 700 * MS));
        if (s < 2) pps_take_sentence(&pps, at(s * SECOND + 800 * MS), 1801 + s);
    }
    expect(&pps, 2 * SECOND + 699 * MS, PROTOCOL_PPS_SYNCHRONISING, 2 * SECOND + 699 * MS);
    expect(&pps, 2 * SECOND + 750 * MS, PROTOCOL_PPS_LOCKED, 3 * SECOND + 50 * MS);
    pps_take_sentence(&pps, at(2 * SECOND + 800 * MS), 1803);
    expect(&pps, 2 * SECOND + 799 * MS, PROTOCOL_PPS_LOCKED, 3 * SECOND + 99 * MS);
    expect(&pps, 2 * SECOND + 800 * MS, PROTOCOL_PPS_LOCKED, 1803 * SECOND + 100 * MS);
    pps_take(&pps, at(3 * SECOND + 700 * MS));
    expect(&pps, 3 * SECOND + 900 * MS, PROTOCOL_PPS_LOCKED, 1804 * SECOND + 200 * MS);
    pps_take_sentence(&pps, at(4 * SECOND + 702 * MS), 7); /* too late: the next pulse is missing */
    expect(&pps, 4 * SECOND + 800 * MS, PROTOCOL_PPS_ABSENT, 1805 * SECOND + 100 * MS);
}

/* Second 60 of the hour's last minute is the next hour's first, and so is the second after it. */
static void the_counter_stays_within_the_hour(void **state)
{
    (void)state;
    struct pps pps = {0};
    pps_power_up(&pps, at(0), 3597 * SECOND, 1);
    for (int s = 1; s <= 4; s++) {
        pps_take(&pps, at(s * SECOND));
        pps_take_sentence(&pps, at(s * SECOND), s < 4 ? 3597 + s : 0);
    }
    expect(&pps, 3 * SECOND - 1, PROTOCOL_PPS_SYNCHRONISING, 3600 * SECOND - 1);
    expect(&pps, 3 * SECOND, PROTOCOL_PPS_LOCKED, 0);
    expect(&pps, 4 * SECOND - 1, PROTOCOL_PPS_LOCKED, SECOND - 1);
    expect(&pps, 4 * SECOND, PROTOCOL_PPS_LOCKED, 0);
}

/* The head's clock gains 500 ppm: each locked pulse sets it right, and without pulses it drifts. */
static void the_heads_own_clock_drifts(void **state)
{
    (void)state;
    struct pps pps = {0};
    int64_t hour_ns;
    pps_power_up(&pps, (struct pps_moment){0, 0}, 0, 1);
    for (int64_t s = 1; s <= 5; s++)
        pps_take(&pps, (struct pps_moment){s * SECOND, s * (SECOND + 500000)});
    assert_int_equal(pps_at(&pps, (struct pps_moment){3 * SECOND - 2000, 3 * (SECOND + 500000) - 2001}, &hour_ns),
                     PROTOCOL_PPS_SYNCHRONISING);
    assert_int_equal(hour_ns, 3 * SECOND + 1500000 - 2001);
    assert_int_equal(pps_at(&pps, (struct pps_moment){4 * SECOND, 4 * (SECOND + 500000)}, &hour_ns),
                     PROTOCOL_PPS_LOCKED);
    assert_int_equal(hour_ns, 4 * SECOND);
    pps_at(&pps, (struct pps_moment){15 * SECOND, 15 * (SECOND + 500000)}, &hour_ns);
    assert_int_equal(hour_ns, 15 * SECOND + 10 * 500000);
}

/* A power cycle begins anew, and earlier facts stay known. */
static void a_power_cycle_begins_anew(void **state)
{
    (void)state;
    struct pps pps = {0};
    pps_power_up(&pps, at(0), 0, 0);
    for (int s = 1; s <= 200; s++)
        pps_take(&pps, at(s * SECOND));
    pps_power_up(&pps, at(205 * SECOND), 0, 0);
    expect(&pps, 200 * SECOND, PROTOCOL_PPS_LOCKED, 200 * SECOND);
    expect(&pps, 206 * SECOND, PROTOCOL_PPS_ABSENT, SECOND);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(states_follow_the_pulses),
        cmocka_unit_test(absent_without_a_first_pulse),
        cmocka_unit_test(pulses_and_sentences_set_the_counter),
        cmocka_unit_test(the_counter_stays_within_the_hour),
        cmocka_unit_test(the_heads_own_clock_drifts),
        cmocka_unit_test(a_power_cycle_begins_anew),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
