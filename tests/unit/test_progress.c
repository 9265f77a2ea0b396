/* SPDX-License-Identifier: MIT */
/* The progress of work, and the time that it will take. */
#include "firmware_sim/app/progress.h"
#include "tests/unit/recorder_rig.h"

static const int64_t S = 1000000000;

static void test_left(void **state)
{
    (void)state;
    struct progress_pace pace = {0};
    assert_true(progress_left_s(&pace, "recording: 1 point", 0.2, 5 * S) < 0); /* no pace yet */
    assert_true(fabs(progress_left_s(&pace, "recording: 2 points", 0.4, 6 * S) - 3) < 1e-9);
    assert_true(fabs(progress_left_s(&pace, "recording: 3 points", 0.6, 9 * S) - 4) < 1e-9);
    assert_true(progress_left_s(&pace, "recording: 3 points", 1.0, 10 * S) == 0);
    assert_true(progress_left_s(&pace, "comparing", 0.5, 11 * S) < 0); /* other work */
    assert_true(progress_left_s(&pace, "comparing", 0.5, 12 * S) < 0); /* nothing done since */
    assert_true(fabs(progress_left_s(&pace, "comparing", 0.75, 13 * S) - 2) < 1e-9);
    assert_true(progress_left_s(&pace, "comparing", 0.1, 14 * S) < 0); /* the same again, from the beginning */
    assert_true(progress_left_s(&pace, "comparing", -1, 15 * S) < 0);
}

/* Work is told apart by its name up to a colon. Only the beginning of a long name is kept. */
static void test_names(void **state)
{
    (void)state;
    struct progress_pace pace = {0};
    char name[300];
    progress_left_s(&pace, "comparing points", 0.1, S);
    assert_true(progress_left_s(&pace, "comparing", 0.2, 2 * S) < 0); /* a shorter name is another work ... */
    assert_true(fabs(progress_left_s(&pace, "comparing: 1", 0.4, 3 * S) - 3) < 1e-9);
    assert_true(fabs(progress_left_s(&pace, "comparing", 0.6, 4 * S) - 2) < 1e-9); /* ... and stays so */
    memset(name, 'x', sizeof name);
    name[sizeof name - 1] = '\0';
    assert_true(progress_left_s(&pace, name, 0.5, 5 * S) < 0);
    assert_true(fabs(progress_left_s(&pace, name, 0.75, 6 * S) - 1) < 1e-9);
    assert_true(fabs(progress_left_s(&pace, name, 1.5, 7 * S)) < 1e-9); /* more than all is all */
    assert_true(progress_left_s(&pace, name, 1.75, 5 * S) < 0);         /* no time has passed */
}

static double scan_s(const struct native_descriptor *d)
{
    static uint8_t out[1024];
    struct scanhead_frame frame = {.type = SCANHEAD_DESCRIPTOR};
    size_t len = native_encode_descriptor(out, sizeof out, d, 0, 0);
    frame.payload = out + NATIVE_HEADER_LEN;
    frame.payload_len = (uint32_t)(len - NATIVE_HEADER_LEN);
    return progress_scan_s(&frame);
}

static void test_scan(void **state)
{
    (void)state;
    struct native_descriptor d = {.layout = NATIVE_GEO,
                                  .lines_uhz = 50000000,
                                  .pan_udeg_s = 20000000,
                                  .pan_start_udeg = -90000000,
                                  .pan_stop_udeg = 270000000,
                                  .frames = 3};
    assert_true(fabs(scan_s(&d) - 3 * 360.0 / 20) < 1e-9);
    d.pan_udeg_s = 0; /* a line each */
    assert_true(fabs(scan_s(&d) - 3.0 / 50) < 1e-9);
    d.frames = 0;
    assert_true(scan_s(&d) == 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_left), cmocka_unit_test(test_names),
                                       cmocka_unit_test(test_scan)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
