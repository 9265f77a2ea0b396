/* SPDX-License-Identifier: MIT */
/* The head's clock: full seconds to the nanosecond, its errors, and the parts of the device that follow it. */
#include "tests/unit/device_rig.h"

#include <math.h>
#include <sys/timex.h>
#include <time.h>

#include "firmware_sim/config/config.h"
#include "firmware_sim/device/head_clock.h"

__extension__ typedef __int128 i128;

static struct head_clock make_clock(double offset_s, double drift_ppm, double jump_s, double jump_at_s)
{
    static struct config cfg;
    struct head_clock clock;
    struct sh_err err;
    memset(&cfg, 0, sizeof cfg);
    strcpy(cfg.time.epoch, "2026-01-01T00:00:00.3Z");
    cfg.time.offset_s = offset_s;
    cfg.time.drift_ppm = drift_ppm;
    cfg.time.jump_s = jump_s;
    cfg.time.jump_at_s = jump_at_s;
    need(head_clock_create(&cfg.time, &clock, &err), &err);
    return clock;
}

/* 2026-01-01T00:00:00Z is 1767225600 s after 1970 (date -u -d 2026-01-01 +%s), and TAI 37 s more. */
#define TAI0_S INT64_C(1767225637)

struct edges {
    int n;
    int64_t at_ns[64], tai_s[64];
};

/* Finds all edges up to a time, in ticks of a size that does not divide anything. */
static struct edges find_edges(const struct head_clock *clock, int64_t tick_ns, int64_t until_ns)
{
    struct edges e = {0};
    for (int64_t t = 0; t < until_ns && e.n < 64; t += tick_ns)
        e.n += head_clock_edge(clock, t, t + tick_ns, &e.at_ns[e.n], &e.tai_s[e.n]);
    return e;
}

static void exact_seconds(void **state)
{
    (void)state;
    struct head_clock clock = make_clock(0, 0, 0, 0);
    static const int64_t ticks_ns[] = {100000, 1000000, 10000000, 9999991};
    for (int k = 0; k < 4; k++) {
        struct edges e = find_edges(&clock, ticks_ns[k], INT64_C(20000000000));
        assert_int_equal(e.n, 20);
        for (int i = 0; i < e.n; i++)
            assert_true(e.at_ns[i] == 700000000 + i * UTC_SECOND_NS && e.tai_s[i] == TAI0_S + 1 + i);
    }
    assert_true(head_clock_ns(&clock, 0) == TAI0_S * UTC_SECOND_NS + 300000000);
    assert_true(head_clock_true_ns(&clock, 5) == head_clock_ns(&clock, 5));
}

/* An edge at power-up counts. */
static void the_first_nanosecond(void **state)
{
    (void)state;
    struct head_clock clock = make_clock(-0.3, 0, 0, 0);
    struct edges e = find_edges(&clock, 1000000, 1500000000);
    assert_true(e.n == 2 && e.at_ns[0] == 0 && e.tai_s[0] == TAI0_S && e.at_ns[1] == UTC_SECOND_NS);
}

/* The clock gains d for each second. It shows second s at the smallest t with t + floor(t d) >= s - tai0, that is at
 * ceil((s - tai0) / (1 + d)), within one for the two roundings. The test searches around it. */
static void drift(void **state)
{
    (void)state;
    static const double ppm[] = {1000, 12.345678, 0.000001, -0.000001, -7, -1000};
    for (int k = 0; k < 6; k++) {
        struct head_clock clock = make_clock(0, ppm[k], 0, 0);
        struct edges e = find_edges(&clock, 1000000, INT64_C(30000000000));
        assert_true(e.n == 30 || e.n == 29);
        for (int i = 0; i < e.n; i++) {
            int64_t wanted_ns = 700000000 + i * UTC_SECOND_NS, ppt = llround(ppm[k] * 1e6);
            int64_t about_ns = (int64_t)((long double)wanted_ns / (1 + (long double)ppt / 1e12L));
            int64_t t_ns = about_ns - 3;
            for (;; t_ns++) { /* floor(t d) in 128 bits; 1000 s are added, so that the division rounds down */
                i128 product = (i128)t_ns * ppt + (i128)1000000000000 * 1000000000000;
                if (t_ns + (int64_t)(product / 1000000000000 - 1000000000000) >= wanted_ns) break;
            }
            assert_true(e.at_ns[i] == t_ns && e.tai_s[i] == TAI0_S + 1 + i);
            assert_true(head_clock_ns(&clock, t_ns) >= e.tai_s[i] * UTC_SECOND_NS);
            assert_true(head_clock_ns(&clock, t_ns - 1) < e.tai_s[i] * UTC_SECOND_NS);
        }
    }
}

/* At 5.25 s the clock, which then shows x.55, is set ahead or back by 2.2 s. Seconds are left out or come again, and
 * the jump itself is no edge. */
static void jumps(void **state)
{
    (void)state;
    struct head_clock on = make_clock(0, 0, 2.2, 5.25), back = make_clock(0, 0, -2.2, 5.25);
    struct edges e = find_edges(&on, 1000000, INT64_C(9000000000));
    assert_int_equal(e.n, 9);
    assert_true(e.at_ns[4] == 4700000000 && e.tai_s[4] == TAI0_S + 5);
    assert_true(e.at_ns[5] == 5500000000 && e.tai_s[5] == TAI0_S + 8); /* 5.55 + 2.2 s at 5.25 s: 7.75, so in 0.25 s */
    e = find_edges(&back, 1000000, INT64_C(9000000000));
    assert_true(e.at_ns[4] == 4700000000 && e.tai_s[4] == TAI0_S + 5);
    assert_true(e.at_ns[5] == 5900000000 && e.tai_s[5] == TAI0_S + 4); /* 3.35 s at 5.25 s */
    /* With a jump onto a full second within a tick, that second begins at the jump. */
    struct head_clock onto = make_clock(0, 0, 0.45, 5.25);
    e = find_edges(&onto, 10000000, INT64_C(6500000000));
    assert_true(e.at_ns[5] == 5250000000 && e.tai_s[5] == TAI0_S + 6);
}

/* The expected clock is one sum of exact integers. Each gain counts for the time of its window, without the time in
 * which the clock stands. Windows are in ns, gains in 1e-12. */
static const struct {
    int64_t from_ns, until_ns, ppt;
} GAIN[] = {{0, INT64_MAX, -3000000}, {1234567891, 7777777777, 123456789}, {2000000000, 9100000001, -31000000000}};
static const int64_t STANDS[][2] = {{3000000000, 3900000000}, {3500000000, 4200000007}, {6700000000, 6700000001}};
static const int64_t JUMP[][2] = {{2500000000, 1900000000}, {3600000000, 77}, {5000000000, -2400000000}};

static int64_t overlap_ns(int64_t from_ns, int64_t until_ns, int64_t from2_ns, int64_t until2_ns)
{
    const int64_t from = from_ns > from2_ns ? from_ns : from2_ns, until = until_ns < until2_ns ? until_ns : until2_ns;
    return until > from ? until - from : 0;
}

static int64_t expected_ns(int64_t t_ns)
{
    static const int64_t stood[2][2] = {{3000000000, 4200000007}, {6700000000, 6700000001}}; /* STANDS, joined */
    const i128 ppt = 1000000000000;
    i128 sum = 0;
    int64_t shown_ns = TAI0_S * UTC_SECOND_NS + 300000000 + t_ns;
    for (int s = 0; s < 2; s++)
        sum -= ppt * overlap_ns(stood[s][0], stood[s][1], 0, t_ns);
    for (int g = 0; g < 3; g++) {
        int64_t for_ns = overlap_ns(GAIN[g].from_ns, GAIN[g].until_ns, 0, t_ns);
        for (int s = 0; s < 2; s++)
            for_ns -= overlap_ns(stood[s][0], stood[s][1], GAIN[g].from_ns,
                                 t_ns < GAIN[g].until_ns ? t_ns : GAIN[g].until_ns);
        sum += (i128)for_ns * GAIN[g].ppt;
    }
    for (int j = 0; j < 3; j++)
        if (t_ns >= JUMP[j][0]) shown_ns += JUMP[j][1];
    /* Whole hours are added, so that the division rounds down. */
    return shown_ns + (int64_t)((sum + ppt * INT64_C(3600000000000)) / ppt - INT64_C(3600000000000));
}

static struct head_clock changed_clock(void)
{
    struct head_clock clock = make_clock(0, -3, 0, 0); /* GAIN[0] */
    for (int g = 2; g > 0; g--) {                      /* in no order */
        head_clock_change(&clock, GAIN[g].until_ns, &(struct head_clock_change){.gain_ppt = -GAIN[g].ppt});
        head_clock_change(&clock, GAIN[g].from_ns, &(struct head_clock_change){.gain_ppt = GAIN[g].ppt});
    }
    for (int i = 0; i < 3; i++) {
        head_clock_change(&clock, STANDS[i][1], &(struct head_clock_change){.stands = -1});
        head_clock_change(&clock, STANDS[i][0], &(struct head_clock_change){.stands = 1});
        head_clock_change(&clock, JUMP[i][0], &(struct head_clock_change){.jump_ns = JUMP[i][1]});
    }
    return clock;
}

/* Gains, jumps and standstills overlap. The sampled nanoseconds and each full second are checked. */
static void changes(void **state)
{
    (void)state;
    const struct head_clock clock = changed_clock();
    for (int64_t t_ns = 0; t_ns < INT64_C(11000000000); t_ns += 999331)
        assert_true(head_clock_ns(&clock, t_ns) == expected_ns(t_ns));
    for (uint32_t i = 0; i < clock.n; i++)
        for (int64_t d = -2; d < 3 && clock.piece[i].from_ns + d >= 0; d++)
            assert_true(head_clock_ns(&clock, clock.piece[i].from_ns + d) == expected_ns(clock.piece[i].from_ns + d));
    struct edges e = find_edges(&clock, 1000000, INT64_C(11000000000));
    int n = 0;
    for (int64_t t_ns = 1; t_ns < INT64_C(11000000000);
         t_ns += 1000000) { /* ends of ticks: all jumps are at their starts */
        int64_t low_ns = t_ns - 1, high_ns = t_ns + 999998;
        const int64_t s = expected_ns(high_ns) / UTC_SECOND_NS;
        int jumps = 0;
        for (int j = 0; j < 3; j++)
            jumps |= JUMP[j][0] == low_ns;
        if (!jumps && low_ns > 0) low_ns--; /* the edge may be the tick's first nanosecond */
        if (expected_ns(low_ns) / UTC_SECOND_NS == s) continue;
        while (high_ns - low_ns > 1) {
            const int64_t mid_ns = low_ns + (high_ns - low_ns) / 2;
            *(expected_ns(mid_ns) / UTC_SECOND_NS < s ? &low_ns : &high_ns) = mid_ns;
        }
        assert_true(n < e.n && e.at_ns[n] == high_ns && e.tai_s[n] == s);
        n++;
    }
    assert_true(n == e.n && n > 6);
}

/* The clock reaches a full second as it begins to stand. Later a gain would make it run backwards, so it stands. */
static void stands_on_a_second(void **state)
{
    (void)state;
    struct head_clock clock = make_clock(0, 0, 0, 0);
    head_clock_change(&clock, 1700000000, &(struct head_clock_change){.stands = 1});
    head_clock_change(&clock, 2900000000, &(struct head_clock_change){.stands = -1});
    head_clock_change(&clock, 4000000000, &(struct head_clock_change){.gain_ppt = -1500000000000});
    struct edges e = find_edges(&clock, 1000000, 6000000000);
    assert_int_equal(e.n, 3);
    assert_true(e.at_ns[1] == 1700000000 && e.at_ns[2] == 3900000000 && e.tai_s[2] == TAI0_S + 3);
    assert_true(head_clock_ns(&clock, 4000000000) == head_clock_ns(&clock, 99000000000));
}

/* There are more changes than are kept. The time since the first of the kept ones is right. */
static void forgets_the_oldest(void **state)
{
    (void)state;
    struct head_clock clock = make_clock(0, 0, 0, 0);
    enum { N = 3 * HEAD_CLOCK_CHANGES };
    for (int64_t i = 1; i <= N; i++)
        head_clock_change(&clock, i * 1000000, &(struct head_clock_change){.jump_ns = 1, .gain_ppt = 1000000});
    /* In its i-th millisecond it gains i ppm, that is i ns: N (N - 1) / 2 up to change N. N jumps add 1 ns each. */
    assert_true(head_clock_ns(&clock, N * 1000000) ==
                head_clock_true_ns(&clock, N * 1000000) + (int64_t)N * (N - 1) / 2 + N);
}

static void leap_seconds(void **state)
{
    (void)state;
    struct head_clock clock = make_clock(0, 0, 0, 0);
    struct utc_time utc;
    int64_t posix_s;
    assert_true(head_clock_add_leap(&clock, 0, &posix_s) && posix_s == 1767225660);
    assert_true(head_clock_add_leap(&clock, 0, &posix_s) && posix_s == 1767225720);
    utc_from_tai(&clock.table, head_clock_ns(&clock, 59700000000), &utc);
    assert_true(utc.minute == 0 && utc.second == 60);
    utc_from_tai(&clock.table, head_clock_ns(&clock, 60700000000), &utc);
    assert_true(utc.minute == 1 && utc.second == 0);
    utc_from_tai(&clock.table, head_clock_ns(&clock, 120700000000), &utc);
    assert_true(utc.minute == 1 && utc.second == 60);
    const uint32_t n = clock.table.n;
    for (uint32_t i = n; i < UTC_MAX_LEAPS; i++)
        assert_true(head_clock_add_leap(&clock, 0, &posix_s));
    assert_false(head_clock_add_leap(&clock, 0, &posix_s));
    /* A leap second is added before a known one, whose difference grows by one. */
    struct utc_table table = *utc_table_builtin();
    const int32_t last = table.leap[table.n - 1].tai_minus_utc;
    assert_true(utc_table_add(&table, 1451606460) && !utc_table_add(&table, 1451606460)); /* 2016-01-01 00:01 */
    assert_true(table.leap[table.n - 1].tai_minus_utc == last + 1);
    assert_true(table.leap[table.n - 2].posix_s == 1451606460 && table.leap[table.n - 2].tai_minus_utc == last);
}

/* It is 00:00:00.3. The head's clock is 100 s behind or ahead, and shares its table with the receiver. The minute of the
 * one that is ahead gets the second 60, so the other one has it later, and neither goes back. */
static void a_leap_second_is_ahead_of_both_clocks(void **state)
{
    (void)state;
    static const struct {
        double offset_s;
        int64_t posix_s, true_60_ns;
    } rows[] = {{-100, 1767225660, 59700000000}, {100, 1767225720, 119700000000}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct head_clock clock = make_clock(rows[i].offset_s, 0, 0, 0);
        const int64_t head_60_ns = rows[i].true_60_ns - llround(1e9 * rows[i].offset_s);
        struct utc_time utc;
        int64_t posix_s;
        assert_true(head_clock_add_leap(&clock, 0, &posix_s) && posix_s == rows[i].posix_s);
        utc_from_tai(&clock.table, head_clock_true_ns(&clock, 700000000), &utc);
        assert_true(utc.minute == 0 && utc.second == 1);
        utc_from_tai(&clock.table, head_clock_true_ns(&clock, rows[i].true_60_ns), &utc);
        assert_int_equal(utc.second, 60);
        utc_from_tai(&clock.table, head_clock_ns(&clock, head_60_ns), &utc);
        assert_int_equal(utc.second, 60);
    }
}

static void epochs(void **state)
{
    (void)state;
    enum epoch_source source;
    struct sh_err err;
    int64_t tai_ns;
    const struct utc_table *table = utc_table_builtin();
    assert_true(epoch_parse("none", table, &source, NULL, &err) == SH_OK && source == EPOCH_NONE);
    assert_true(epoch_parse("utc", table, &source, NULL, &err) == SH_OK && source == EPOCH_UTC);
    assert_true(epoch_parse("tai", table, &source, NULL, &err) == SH_OK && source == EPOCH_TAI);
    assert_int_equal(epoch_parse("2016-12-31T23:59:60.5Z", table, &source, &tai_ns, &err), SH_OK);
    assert_true(source == EPOCH_DATE && tai_ns == INT64_C(1483228836500000000)); /* 2017-01-01 less 0.5 s, and 37 */
    assert_int_equal(epoch_parse("now", table, &source, NULL, &err), SH_EINPUT);
    assert_true(epoch_parse("", table, &source, NULL, &err) == SH_OK && source == EPOCH_NONE);
}

/* The system's clock lies between its values before and after. */
static void the_systems_clock(void **state)
{
    (void)state;
    static struct config cfg;
    struct head_clock clock;
    struct sh_err err;
    struct timespec before, after;
    strcpy(cfg.time.epoch, "utc");
    clock_gettime(CLOCK_REALTIME, &before);
    need(head_clock_create(&cfg.time, &clock, &err), &err);
    clock_gettime(CLOCK_REALTIME, &after);
    int64_t utc_ns = utc_posix_from_tai(&clock.table, head_clock_ns(&clock, 0));
    assert_true(utc_ns >= before.tv_sec * UTC_SECOND_NS + before.tv_nsec - 1000000);
    assert_true(utc_ns <=
                after.tv_sec * UTC_SECOND_NS + after.tv_nsec + 1000000); /* slewing moves it far less than 1 ms here */
}

/* CLOCK_TAI is taken where the system has set its offset, and refused where it equals UTC. */
static void the_systems_tai(void **state)
{
    (void)state;
    static struct config cfg;
    struct head_clock clock;
    struct sh_err err;
    struct timespec before;
    struct timex timex = {.modes = 0};
    strcpy(cfg.time.epoch, "tai");
    adjtimex(&timex);
    clock_gettime(CLOCK_TAI, &before);
    int rc = head_clock_create(&cfg.time, &clock, &err);
    if (timex.tai == 0) {
        assert_int_equal(rc, SH_ESTATE);
        assert_non_null(strstr(err.text, "time.epoch: tai"));
        return;
    }
    need(rc, &err);
    int64_t late_ns = head_clock_ns(&clock, 0) - (before.tv_sec * UTC_SECOND_NS + before.tv_nsec);
    assert_true(late_ns >= -1000000); /* as above */
}

/* The device runs from 23:59:57.75 on, over the leap second, with its clock 0.25 s ahead and 100 ppm fast. */
static void the_device_goes_by_it(void **state)
{
    (void)state;
    static const struct device_options options = {.start = 1};
    static const char *const sets[] = {"time.epoch=2016-12-31T23:59:57.75Z", "time.offset_s=0.25",
                                       "time.drift_ppm=100"};
    static const char *const utc[] = {"2016-12-31T23:59:58Z", "2016-12-31T23:59:59Z", "2016-12-31T23:59:60Z",
                                      "2017-01-01T00:00:00Z"};
    static const uint64_t posix[] = {1483228798, 1483228799, 1483228800, 1483228800};
    struct rig *rig = rig_open(&options, sets, 3);
    int n = 0;
    while (rig->next < 3500) {
        assert_true(rig_claim(rig));
        const struct native_event *pps = rig_event(rig, NATIVE_EV_PPS), *start = rig_event(rig, NATIVE_EV_SCAN_START);
        if (pps != NULL) {
            assert_string_equal(pps->text, utc[n]);
            assert_true(pps->a == posix[n] && pps->c == (uint64_t)(1167264015 + n)); /* 23:59:60 is GPS 1167264017 */
            int64_t about_ns = (int64_t)(n * 1e9 / 1.0001);
            assert_true(llabs((int64_t)pps->b - about_ns) <= 1);
            assert_true(rig->work.tick == pps->b / 1000000);
            n++;
        }
        if (start != NULL) {
            int64_t t_ns = (int64_t)start->b; /* 1e-4 of it: exact, it is in ms */
            assert_true((int64_t)start->c == INT64_C(1167264015000000000) + t_ns + t_ns / 10000);
        }
    }
    assert_int_equal(n, 4);
    assert_string_equal(rig_tell(rig, "TIME?", 3000), "3000000000");
    assert_string_equal(rig_tell(rig, "TIME:UTC?", 3000), "2017-01-01T00:00:00.000300000Z");
    assert_string_equal(rig_tell(rig, "TIME:GPS?", 3000), "1930,18.000300000");
    assert_string_equal(rig_tell(rig, "TIME:UTC?", 2500), "2016-12-31T23:59:60.500250000Z");
    rig_close(rig);
}

/* Without a time there is no event, no GPS time, and telemetry without UTC. */
static void a_device_that_does_not_know(void **state)
{
    (void)state;
    static const struct device_options options = {.start = 1};
    struct rig *rig = rig_open(&options, NULL, 0);
    int telemetry = 0;
    while (rig->next < 2500) {
        assert_true(rig_claim(rig));
        assert_null(rig_event(rig, NATIVE_EV_PPS));
        const struct native_event *start = rig_event(rig, NATIVE_EV_SCAN_START);
        assert_true(start == NULL || start->c == 0);
        assert_true(!rig->work.telemetry || rig->work.telemetry_frame.utc_ns == 0);
        telemetry += rig->work.telemetry;
    }
    assert_int_equal(telemetry, 3);
    struct command_result result;
    device_command(rig->device, 1, "TIME:UTC?", 0, &result);
    assert_int_equal(result.error, CMD_E_SETTINGS);
    rig_close(rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(exact_seconds),
        cmocka_unit_test(the_first_nanosecond),
        cmocka_unit_test(drift),
        cmocka_unit_test(jumps),
        cmocka_unit_test(changes),
        cmocka_unit_test(stands_on_a_second),
        cmocka_unit_test(forgets_the_oldest),
        cmocka_unit_test(leap_seconds),
        cmocka_unit_test(a_leap_second_is_ahead_of_both_clocks),
        cmocka_unit_test(epochs),
        cmocka_unit_test(the_systems_clock),
        cmocka_unit_test(the_systems_tai),
        cmocka_unit_test(the_device_goes_by_it),
        cmocka_unit_test(a_device_that_does_not_know),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
