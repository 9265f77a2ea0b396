/* SPDX-License-Identifier: MIT */
/* CoLa: LMPoutputRange, as written, read back, reported and sent. */
#include "tests/unit/cola_rig.h"

static struct cola_lmd lmd;

static void a_narrowed_range_is_narrower(void **state)
{
    (void)state;
    cola_open_tim("TiM571");
    cola_authorise();
    cola_expect("sWN LMPoutputRange 1 D05 +0 +1800000", "sWA LMPoutputRange");
    cola_expect("sRN LMPoutputRange", "sRA LMPoutputRange 1 D05 0 1B7740");
    cola_stream(0);
    cola_scan(0, 1.0, &lmd);
    for (int k = 0; k < 2; k++) {
        assert_int_equal(lmd.channel[k].start_e4, 0);
        assert_int_equal(lmd.channel[k].n, 541);
    }
    for (uint32_t i = 0; i < 541; i++)
        assert_int_equal(lmd.channel[0].value[i], 1000 + 10 * (135 + i));
    cola_expect("sWN LMPoutputRange 1 D05 +900000 +900000", "sWA LMPoutputRange");
    cola_scan(1, 1.0, &lmd);
    assert_int_equal(lmd.channel[0].n, 1);
    assert_int_equal(lmd.channel[0].value[0], 1000 + 10 * 405);
}

/* The range that is read back agrees with the header of a telegram, and with its values. Ends off the grid move to the
 * nearest beams. */
static void expect_range(uint32_t line, const char *step, int32_t start_e4, int32_t stop_e4, uint32_t first, uint32_t n)
{
    char request[80], answer[80];
    unsigned read_step, start, stop;
    snprintf(request, sizeof request, "sWN LMPoutputRange 1 %s %+d %+d", step, (int)start_e4, (int)stop_e4);
    cola_expect(request, "sWA LMPoutputRange");
    snprintf(answer, sizeof answer, "%s", cola_ask("sRN LMPoutputRange"));
    assert_int_equal(sscanf(answer, "sRA LMPoutputRange 1 %X %X %X", &read_step, &start, &stop), 3);
    cola_scan(line, 1.0, &lmd);
    const struct cola_channel *dist = &lmd.channel[0];
    assert_int_equal(dist->n, n);
    for (uint32_t i = 0; i < n; i++)
        assert_int_equal(dist->value[i], 1000 + 10 * (first + i));
    assert_int_equal(dist->start_e4, (int32_t)start);
    assert_int_equal(dist->step_e4, read_step);
    /* The last angle is rounded by itself; the rounded step is up to 1/2 wrong, and that adds up. */
    assert_true(labs((int32_t)stop - (dist->start_e4 + (int32_t)((n - 1) * read_step))) <= (long)n / 2 + 1);
    assert_int_equal(((int32_t)stop - (int32_t)start) / (int32_t)read_step + 1, n); /* clients count like this */
}

static void a_range_off_the_grid_goes_to_the_nearest_beams(void **state)
{
    (void)state;
    cola_open_lms();
    cola_authorise();
    cola_stream(0);
    expect_range(0, "9C4", -449997, 2249997, 0, 1081); /* as sick_scan_xd writes it */
    cola_expect("sRN LMPoutputRange", "sRA LMPoutputRange 1 9C4 FFF92230 225510");
    expect_range(1, "9C4", -450250, 2250250, 0, 1081); /* a tenth of a step beyond */
    expect_range(2, "9C4", -448751, 2248751, 0, 1081);
    expect_range(3, "9C4", -448749, 2248749, 1, 1079);
    expect_range(4, "9C4", 10, 20, 180, 1);
    expect_range(5, "9C4", 1240, 1260, 180, 2);
    cola_open_tim("TiM571");
    cola_authorise();
    cola_stream(0);
    expect_range(0, "D05", -449997, 2249997, 0, 811);
    expect_range(1, "D05", -450333, 2250333, 0, 811);
    expect_range(2, "D05", 900001, 906666, 405, 3);
    for (uint32_t i = 0; i < 9; i++) /* each time the start is 1/3 step later, and the stop 0.27 earlier */
        expect_range(3 + i, "D05", -450000 + (int32_t)i * 1111, 2250000 - (int32_t)i * 900, (i + 1) / 3,
                     811 - (i + 1) / 3 - (i * 27 + 50) / 100);
}

int main(void)
{
#define CASE(f) cmocka_unit_test_teardown(f, cola_teardown)
    const struct CMUnitTest tests[] = {
        CASE(a_narrowed_range_is_narrower),
        CASE(a_range_off_the_grid_goes_to_the_nearest_beams),
    };
    return cmocka_run_group_tests_name("cola range", tests, NULL, NULL);
}
