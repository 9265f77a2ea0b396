/* SPDX-License-Identifier: MIT */
/* Numbers of the native protocol as its pages have them (PROTOCOL.md and those that it lists). A head and a client of
 * this program would still agree on a wrong one. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "drivers/host/scanhead.h"
#include "drivers/protocol/native.h"
#include "drivers/protocol/native_waves.h"

/* A number that the client library has, too. */
#define BOTH(name, number)                   \
    assert_int_equal(NATIVE_##name, number); \
    assert_int_equal(SCANHEAD_##name, number)

static void test_frames(void **state)
{
    (void)state;
    BOTH(DESCRIPTOR, 1);
    BOTH(ANCHOR, 2);
    BOTH(POINTS, 3);
    BOTH(LINE_END, 4);
    BOTH(TELEMETRY, 5);
    BOTH(EVENT, 6);
    BOTH(SURFACES, 7);
    BOTH(POSES, 8);
    BOTH(ATTRIBUTES, 9);
    BOTH(EMITTER, 10);
    BOTH(COLOURS, 11);
    BOTH(WAVES, 12);
    BOTH(REPEAT, 1);
    BOTH(LOCAL, 2);
    assert_int_equal(NATIVE_SYNC, 0xd5);
    assert_int_equal(NATIVE_VERSION, 1);
    assert_int_equal(NATIVE_HEADER_LEN, 28);
    assert_int_equal(NATIVE_MAX_PAYLOAD, 65536);
    assert_int_equal(NATIVE_MAX_FRAME, 28 + 65536);
}

static void test_events(void **state)
{
    (void)state;
    BOTH(EV_STATE, 1);
    BOTH(EV_SCAN_START, 2);
    BOTH(EV_SCAN_END, 3);
    BOTH(EV_OVERRUN, 4);
    BOTH(EV_READER_LOST, 5);
    BOTH(EV_CONTROL, 6);
    BOTH(EV_ERROR, 7);
    BOTH(EV_SETTINGS, 8);
    BOTH(EV_POSE_LATE, 9);
    BOTH(EV_PPS, 10);
    BOTH(EV_TIME, 11);
    BOTH(EV_SITE, 12);
    BOTH(EV_PTP, 13);
}

/* Lengths of payloads: what comes before the records, a record, and how many of them there may be. */
static void test_lengths(void **state)
{
    (void)state;
    assert_true(NATIVE_POINTS_HEAD_LEN == 40 && NATIVE_POINT_LEN == 20 && NATIVE_MAX_POINTS == 3274);
    assert_true(NATIVE_POSES_HEAD_LEN == 8 && NATIVE_POSE_LEN == 80 && NATIVE_MAX_POSES == 819);
    assert_true(NATIVE_ATTRIBUTES_HEAD_LEN == 16 && NATIVE_ATTRIBUTE_LEN == 4 && NATIVE_DEVIATION_LEN == 2);
    assert_true(NATIVE_COLOURS_HEAD_LEN == 16 && NATIVE_COLOUR_LEN == 3);
    assert_true(NATIVE_EMITTER_HEAD_LEN == 64 && NATIVE_BEAM_LEN == 12 && NATIVE_MAX_BEAMS == 128);
    assert_int_equal(SCANHEAD_MAX_BEAMS, 128);
    assert_int_equal(NATIVE_SURFACES_HEAD_LEN, 8);
    assert_true(NATIVE_WAVES_HEAD_LEN == 32 && NATIVE_WAVE_LEN == 28 && NATIVE_SAMPLE_LEN == 2);
    assert_true(NATIVE_MAX_SAMPLES == 4096 && NATIVE_MIN_BITS == 8 && NATIVE_MAX_BITS == 14);
    assert_int_equal(NATIVE_MAX_TEXT, 512); /* COMMANDS.md: a reply line with its CR LF */
}

/* How far back the client library looks (LOSSES.md), and the notices that its header numbers. */
static void test_sequence(void **state)
{
    (void)state;
    assert_true(NATIVE_SEEN == 256 && NATIVE_GAPS == 64 && NATIVE_GAP_MOST == 65536 && NATIVE_LATE_RUN == 256);
    assert_int_equal(SCANHEAD_NOTICE_GAP, NATIVE_GAP);
    assert_int_equal(SCANHEAD_NOTICE_REPEATED, NATIVE_REPEATED);
    assert_int_equal(SCANHEAD_NOTICE_LATE, NATIVE_LATE);
    assert_int_equal(SCANHEAD_NOTICE_RESTARTED, NATIVE_RESTARTED);
    assert_int_equal(SCANHEAD_NOTICE_BAD_PAYLOAD, NATIVE_BAD_PAYLOAD);
    assert_int_equal(SCANHEAD_NOTICE_BAD_BYTES, NATIVE_BAD_BYTES);
    assert_int_equal(SCANHEAD_NOTICE_CUT, NATIVE_CUT);
}

/* Values of fields, and bits. */
static void test_values(void **state)
{
    (void)state;
    assert_true(NATIVE_POLAR == 0 && NATIVE_GEO == 1);
    assert_true(NATIVE_HAS_ATTRIBUTES == 1 && NATIVE_HAS_COLOURS == 2);
    assert_true(NATIVE_HAS_WAVES == 4 && NATIVE_HAS_DEVIATIONS == 8);
    assert_true(NATIVE_CRS_LOCAL == 0 && NATIVE_CRS_ECEF == 1 && NATIVE_CRS_UTM == 2 && NATIVE_CRS_GEODETIC == 3);
    assert_true(NATIVE_HEIGHTS_ELLIPSOID == 0 && NATIVE_HEIGHTS_GEOID == 1);
    assert_true(NATIVE_MOVING == 1 && NATIVE_STOP == 2);
    BOTH(EMIT_LINE, 0);
    BOTH(EMIT_PLANAR, 1);
    BOTH(EMIT_BEAMS, 2);
    BOTH(EMIT_SPHERE, 3);
    BOTH(EMIT_DIRECTIONS, 4);
    assert_true(NATIVE_ECHOES_ALL == 0 && NATIVE_ECHOES_FIRST == 1);
    assert_true(NATIVE_ECHOES_LAST == 2 && NATIVE_ECHOES_STRONGEST == 3);
    BOTH(POSE_EXTRAPOLATED, 1);
    BOTH(POSE_LATE, 2);
    BOTH(POSE_NONE, 4);
    assert_true(NATIVE_PTP_NONE == 0 && NATIVE_PTP_INITIALIZING == 1 && NATIVE_PTP_FAULTY == 2);
    assert_true(NATIVE_PTP_LISTENING == 4 && NATIVE_PTP_UNCALIBRATED == 8 && NATIVE_PTP_SLAVE == 9); /* IEEE 1588 */
    assert_true(NATIVE_PTP_UNLOCKED == 0 && NATIVE_PTP_JUMP == 1 && NATIVE_PTP_LOCKED == 2);
    assert_int_equal(NATIVE_PTP_UTC_VALID, 1);
    assert_true(LINE_LAST_OF_FRAME == 1 && LINE_PARTIAL == 2 && LINE_MAX_ECHOES == 15);
    assert_true(LINE_REFL_NONE == -32768 && LINE_AMPLITUDE_NONE == -32768 && NATIVE_AMPLITUDE_NONE == -32768);
    assert_true(LINE_WIDTH_NONE == 0 && NATIVE_WIDTH_NONE == 0 && NATIVE_WIDTH_MOST == 65535);
    assert_true(LINE_LABEL_NONE == 0xffff && SCANHEAD_NO_LABEL == 0xffff);
    assert_true(LINE_XYZ_NONE == INT32_MIN);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_frames),   cmocka_unit_test(test_events), cmocka_unit_test(test_lengths),
        cmocka_unit_test(test_sequence), cmocka_unit_test(test_values),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
