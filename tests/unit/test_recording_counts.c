/* SPDX-License-Identifier: MIT */
/* The counts of a recording: a scan's losses on its way, and scans whose end did not come. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "drivers/protocol/native_encode.h"
#include "firmware_sim/app/studio/record/recording_counts.h"

static enum recording_news points(struct recording_counts *c, uint32_t n_pulses)
{
    const struct scanhead_frame frame = {.type = SCANHEAD_POINTS, .n_pulses = n_pulses};
    return recording_count(c, &frame, 0);
}

static enum recording_news event(struct recording_counts *c, uint32_t code, uint64_t a, uint64_t b, uint64_t lost)
{
    const struct scanhead_frame frame = {.type = SCANHEAD_EVENT, .event = code, .event_value = {a, b, lost}};
    return recording_count(c, &frame, 0);
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
        assert_true(c.scans == 1 && c.cast == 100 && c.missing == 0);
        points(&c, 10);
        assert_int_equal(event(&c, SCANHEAD_EV_SCAN_END, next[i], 20, 0), RECORDING_SCAN_OVER);
        assert_true(c.scans == 2 && c.pulses == 110 && c.fired == 20);
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

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_left_out), cmocka_unit_test(test_end_lost),
                                       cmocka_unit_test(test_counts_without_an_end)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
