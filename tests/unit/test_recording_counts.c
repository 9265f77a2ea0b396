/* SPDX-License-Identifier: MIT */
/* The counts of a recording: a scan's losses on its way, and scans whose end did not come. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "drivers/protocol/native_encode.h"
#include "firmware_sim/app/studio/record/recording_counts.h"
#include "firmware_sim/command/head.h"

static int frames_lost; /* some were, by the time of an event or telemetry */

static int set_up(void **state)
{
    (void)state;
    frames_lost = 0;
    return 0;
}

static enum recording_news points(struct recording_counts *c, uint32_t n_pulses)
{
    const struct scanhead_frame frame = {.type = SCANHEAD_POINTS, .n_pulses = n_pulses};
    return recording_count(c, &frame, 0);
}

static enum recording_news event(struct recording_counts *c, uint32_t code, uint64_t a, uint64_t b, uint64_t lost)
{
    const struct scanhead_frame frame = {.type = SCANHEAD_EVENT, .event = code, .event_value = {a, b, lost}};
    return recording_count(c, &frame, frames_lost);
}

static enum recording_news descriptor(struct recording_counts *c, uint32_t scan)
{
    static uint8_t raw[4096];
    const struct native_descriptor d = {.idn = "a,b,c,d", .profile = "x", .layout = NATIVE_POLAR, .scan = scan};
    const size_t len = native_encode_descriptor(raw, sizeof raw, &d, 1, 0);
    assert_true(len > NATIVE_HEADER_LEN);
    const struct scanhead_frame frame = {
        .type = SCANHEAD_DESCRIPTOR, .payload = raw + NATIVE_HEADER_LEN, .payload_len = len - NATIVE_HEADER_LEN};
    return recording_count(c, &frame, 0);
}

static enum recording_news telemetry(struct recording_counts *c, enum head_state state, uint32_t scan, uint64_t fired,
                                     uint64_t cast, uint64_t lost)
{
    static uint8_t raw[1024];
    const struct native_telemetry t = {
        .state = state, .scan = scan, .scan_fired = fired, .scan_cast = cast, .scan_lost = lost};
    const size_t len = native_encode_telemetry(raw, sizeof raw, &t, 1, 0);
    assert_true(len > NATIVE_HEADER_LEN);
    const struct scanhead_frame frame = {
        .type = SCANHEAD_TELEMETRY, .payload = raw + NATIVE_HEADER_LEN, .payload_len = len - NATIVE_HEADER_LEN};
    return recording_count(c, &frame, frames_lost);
}

/* 100 pulses came of the 200 fired ones. The head left out 50 for a slow reader, and lost 10 itself. */
static void test_left_out(void **state)
{
    struct recording_counts c = {0};
    (void)state;
    event(&c, SCANHEAD_EV_SCAN_START, 1, 0, 0);
    points(&c, 60);
    event(&c, SCANHEAD_EV_READER_LOST, 3, 50, 0);
    event(&c, SCANHEAD_EV_OVERRUN, 60, 10, 0);
    points(&c, 40);
    assert_int_equal(event(&c, SCANHEAD_EV_SCAN_END, 1, 200, 10), RECORDING_SCAN_OVER);
    assert_true(c.scans == 1 && c.pulses == 100 && c.fired == 200);
    assert_true(c.cast == 160 && c.lost == 10 && c.left_out == 50 && c.missing == 50);
    /* The next scan does not include it. */
    event(&c, SCANHEAD_EV_SCAN_START, 2, 0, 0);
    points(&c, 70);
    event(&c, SCANHEAD_EV_SCAN_END, 2, 70, 0);
    assert_true(c.scans == 2 && c.cast == 230 && c.missing == 50);
}

/* Frames of another scan come: the end of the one before was lost. A head that started again and counts from 1 sends
 * another scan, too. */
static void test_end_lost(void **state)
{
    static const uint32_t next[] = {2, 7, 1};
    (void)state;
    for (size_t i = 0; i < sizeof next / sizeof next[0]; i++) {
        const uint32_t first = next[i] == 1 ? 5 : 1;
        struct recording_counts c = {0};
        assert_int_equal(descriptor(&c, first), RECORDING_NOTHING);
        points(&c, 100);
        assert_int_equal(descriptor(&c, first), RECORDING_NOTHING); /* said again */
        assert_int_equal(descriptor(&c, next[i]), RECORDING_END_LOST);
        assert_true(c.scans == 1 && c.cast == 100 && c.missing == 0 && c.unknown == 1);
        points(&c, 10);
        assert_int_equal(event(&c, SCANHEAD_EV_SCAN_END, next[i], 20, 0), RECORDING_SCAN_OVER);
        assert_true(c.scans == 2 && c.pulses == 110 && c.fired == 20);
    }
}

static enum recording_news points_at(struct recording_counts *c, uint32_t n_pulses, int64_t t_ns, int64_t t0_ns)
{
    const struct scanhead_frame frame = {
        .type = SCANHEAD_POINTS, .n_pulses = n_pulses, .t_ns = t_ns, .scan_t0_ns = t0_ns};
    return recording_count(c, &frame, 0);
}

static enum recording_news start_at(struct recording_counts *c, uint32_t scan, int64_t t_ns, int64_t b_ns)
{
    const struct scanhead_frame frame = {
        .type = SCANHEAD_EVENT, .event = SCANHEAD_EV_SCAN_START, .event_value = {scan, (uint64_t)b_ns}, .t_ns = t_ns};
    return recording_count(c, &frame, frames_lost);
}

/* LOSSES.md: a head that started again gives its scan the number of the unfinished one. The new scan has another start,
 * or time goes back. The event of the scan at hand may come after its first points. */
static void test_the_same_number_again(void **state)
{
    static const struct {
        int64_t t_ns, b_ns;
        enum recording_news news;
    } row[] = {{900, 500, RECORDING_NOTHING},
               {600, 500, RECORDING_NOTHING},
               {900, 800, RECORDING_END_LOST},
               {900, 200, RECORDING_END_LOST},
               {510, 500, RECORDING_END_LOST}};
    (void)state;
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        const int is_other = row[i].news == RECORDING_END_LOST;
        struct recording_counts c = {0};
        assert_int_equal(start_at(&c, 3, 500, 500), RECORDING_NOTHING);
        descriptor(&c, 3);
        points_at(&c, 100, 600, 100);
        assert_int_equal(start_at(&c, 3, row[i].t_ns, row[i].b_ns), row[i].news);
        descriptor(&c, 3);
        points_at(&c, 40, row[i].b_ns + 700, 700);
        assert_int_equal(telemetry(&c, HEAD_SPIN_DOWN, 3, 60, 50, 0), RECORDING_NOTHING);
        assert_int_equal(event(&c, SCANHEAD_EV_SCAN_END, 3, 60, 0), RECORDING_SCAN_OVER);
        assert_true(c.scans == 1u + (unsigned)is_other && c.pulses == 140 && c.fired == 60);
        /* The final counts of the first scan never came: what came of it is the least. */
        if (is_other) assert_true(c.cast == 150 && c.missing == 10 && c.unknown == 1);
    }
}

/* Without the end of a scan its pulses are those that came, that the head lost and that it left out. */
static void test_counts_without_an_end(void **state)
{
    struct recording_counts c = {0};
    (void)state;
    event(&c, SCANHEAD_EV_SCAN_START, 1, 0, 0);
    points(&c, 100);
    event(&c, SCANHEAD_EV_OVERRUN, 60, 10, 3);
    event(&c, SCANHEAD_EV_OVERRUN, 70, 20, 3);
    event(&c, SCANHEAD_EV_READER_LOST, 3, 50, 7);
    assert_int_equal(event(&c, SCANHEAD_EV_SCAN_START, 2, 0, 0), RECORDING_END_LOST);
    assert_true(c.scans == 1 && c.fired == 0 && c.cast == 180 && c.lost == 30 && c.left_out == 50 && c.missing == 50);
    recording_count_end(&c);
    assert_int_equal(c.scans, 1); /* nothing of the second one has come */
}

/* A scan fires 200 pulses and casts 160. The head loses 10 of these, and 100 come. So 50 are missing. A telemetry
 * within the scan says less. */
static void begin(struct recording_counts *c, uint32_t scan)
{
    *c = (struct recording_counts){0};
    frames_lost = 0;
    event(c, SCANHEAD_EV_SCAN_START, scan, 0, 0);
    points(c, 60);
    frames_lost = 1;
    telemetry(c, HEAD_SCANNING, scan, 150, 120, 5);
    points(c, 40);
}

static void expect_whole(const struct recording_counts *c)
{
    assert_true(c->scans == 1 && c->pulses == 100 && c->fired == 200 && c->cast == 160 && c->lost == 10);
    assert_true(c->missing == 50 && c->unknown == 0);
}

/* The final counts come before SCAN_END or, where that telemetry was lost, with the next one of the same scan. Until
 * then the counts of the scan are those that are known at least. */
static void test_final_counts(void **state)
{
    struct recording_counts c;
    (void)state;
    begin(&c, 3);
    telemetry(&c, HEAD_SPIN_DOWN, 3, 200, 160, 10);
    event(&c, SCANHEAD_EV_SCAN_END, 3, 200, 10);
    expect_whole(&c);

    static const enum head_state later[] = {HEAD_SPIN_DOWN, HEAD_IDLE, HEAD_SPIN_UP, HEAD_FAULT};
    for (size_t i = 0; i < sizeof later / sizeof later[0]; i++) {
        begin(&c, 3);
        assert_int_equal(event(&c, SCANHEAD_EV_SCAN_END, 3, 200, 10), RECORDING_SCAN_OVER);
        assert_true(c.scans == 1 && c.fired == 200 && c.cast == 120 && c.missing == 10 && c.unknown == 1);
        telemetry(&c, HEAD_SCANNING, 4, 9, 9, 9);
        telemetry(&c, HEAD_IDLE, 4, 9, 9, 9);
        assert_int_equal(c.unknown, 1); /* these are of another scan */
        assert_int_equal(telemetry(&c, later[i], 3, 200, 160, 10), RECORDING_NOTHING);
        expect_whole(&c);
        telemetry(&c, HEAD_IDLE, 3, 200, 160, 10);
        expect_whole(&c);
    }
}

/* SCAN_END is lost, too. */
static void test_final_counts_without_an_end(void **state)
{
    struct recording_counts c;
    (void)state;
    begin(&c, 3);
    telemetry(&c, HEAD_SPIN_DOWN, 3, 200, 160, 10);
    assert_int_equal(descriptor(&c, 4), RECORDING_END_LOST);
    expect_whole(&c);
    begin(&c, 3);
    assert_int_equal(telemetry(&c, HEAD_IDLE, 3, 200, 160, 10), RECORDING_END_LOST);
    expect_whole(&c);
    begin(&c, 3);
    recording_count_end(&c);
    assert_true(c.scans == 1 && c.fired == 150 && c.cast == 120 && c.lost == 0 && c.missing == 20 && c.unknown == 1);
    telemetry(&c, HEAD_IDLE, 3, 200, 160, 10);
    expect_whole(&c);
}

/* The counts of a scan are known without telemetry if all frames came from its start on. */
static void test_unknown(void **state)
{
    struct recording_counts c = {0};
    (void)state;
    points(&c, 100); /* the recording begins within the scan */
    event(&c, SCANHEAD_EV_SCAN_END, 3, 200, 0);
    assert_true(c.cast == 100 && c.missing == 0 && c.unknown == 1);
    event(&c, SCANHEAD_EV_SCAN_START, 4, 0, 0);
    points(&c, 100);
    event(&c, SCANHEAD_EV_SCAN_END, 4, 200, 0);
    assert_true(c.scans == 2 && c.cast == 200 && c.unknown == 1);
    /* Another head, or the same one after a start, has a scan of the same number: its telemetry is of that scan. */
    for (int is_seen = 0; is_seen < 2; is_seen++) {
        begin(&c, 3);
        event(&c, SCANHEAD_EV_SCAN_END, 3, 200, 10);
        if (is_seen) event(&c, SCANHEAD_EV_SCAN_START, 3, 0, 0);
        points(&c, 1);
        telemetry(&c, HEAD_SPIN_DOWN, 3, 1, 1, 0);
        assert_true(c.cast == 120 && c.unknown == 1);
    }
}

/* Another head, or the same one after a start, has a scan of the same number. What was said of the earlier scan is not
 * said of it. Heads count their scans from 1. */
static void test_what_was_said_of_an_earlier_scan(void **state)
{
    (void)state;
    for (uint32_t number = 1; number <= 3; number += 2) {
        struct recording_counts c;
        begin(&c, number);
        telemetry(&c, HEAD_SPIN_DOWN, number, 200, 160, 10);
        event(&c, SCANHEAD_EV_SCAN_END, number, 200, 10);
        expect_whole(&c);
        event(&c, SCANHEAD_EV_SCAN_START, number, 0, 0);
        points(&c, 1);
        event(&c, SCANHEAD_EV_SCAN_END, number, 2, 0);
        assert_true(c.scans == 2 && c.pulses == 101 && c.fired == 202 && c.cast == 161 && c.lost == 10);
        assert_true(c.missing == 50 && c.unknown == 1);
        /* The counts of a scan that is due are not those of a scan of that number that began after it. */
        begin(&c, number);
        event(&c, SCANHEAD_EV_SCAN_END, number, 200, 10);
        event(&c, SCANHEAD_EV_SCAN_START, number, 0, 0);
        telemetry(&c, HEAD_SPIN_DOWN, number, 7, 6, 0);
        assert_true(c.scans == 1 && c.fired == 200 && c.cast == 120 && c.unknown == 1);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test_setup(test_left_out, set_up),
                                       cmocka_unit_test_setup(test_end_lost, set_up),
                                       cmocka_unit_test_setup(test_the_same_number_again, set_up),
                                       cmocka_unit_test_setup(test_counts_without_an_end, set_up),
                                       cmocka_unit_test_setup(test_final_counts, set_up),
                                       cmocka_unit_test_setup(test_final_counts_without_an_end, set_up),
                                       cmocka_unit_test_setup(test_unknown, set_up),
                                       cmocka_unit_test_setup(test_what_was_said_of_an_earlier_scan, set_up)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
