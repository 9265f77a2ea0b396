/* SPDX-License-Identifier: MIT */
/* Numbers of libscanhead's header and of the native protocol. Programs are compiled with the first, and streams
 * recorded with the second. So none ever changes, and both are the same (drivers/protocol/native.h). */
#include "tests/common/cases.h"

#include "core/err.h"
#include "drivers/host/scanhead.h"
#include "drivers/protocol/native.h"

struct row {
    int number, host, native;
};

static void check(const struct row *row, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        assert_int_equal(row[i].host, row[i].number);
        assert_int_equal(row[i].native, row[i].number);
    }
}

#define CHECK(rows) check(rows, sizeof(rows) / sizeof(rows)[0])
#define ROW(number, name)                      \
    {                                          \
        number, SCANHEAD_##name, NATIVE_##name \
    }

static void test_frames(void **state)
{
    (void)state;
    static const struct row types[] = {ROW(1, DESCRIPTOR), ROW(2, ANCHOR),   ROW(3, POINTS),   ROW(4, LINE_END),
                                       ROW(5, TELEMETRY),  ROW(6, EVENT),    ROW(7, SURFACES), ROW(8, POSES),
                                       ROW(9, ATTRIBUTES), ROW(10, EMITTER), ROW(11, COLOURS), ROW(12, WAVES)};
    static const struct row flags[] = {ROW(1, REPEAT), ROW(2, LOCAL)};
    static const struct row poses[] = {ROW(1, POSE_EXTRAPOLATED), ROW(2, POSE_LATE), ROW(4, POSE_NONE)};
    static const struct row emitters[] = {ROW(0, EMIT_LINE),   ROW(1, EMIT_PLANAR),     ROW(2, EMIT_BEAMS),
                                          ROW(3, EMIT_SPHERE), ROW(4, EMIT_DIRECTIONS), ROW(128, MAX_BEAMS)};
    CHECK(types);
    CHECK(flags);
    CHECK(poses);
    CHECK(emitters);
    assert_true(SCANHEAD_NO_TIME == NATIVE_NO_TIME);
}

static void test_events(void **state)
{
    (void)state;
    static const struct row events[] = {
        ROW(1, EV_STATE),   ROW(2, EV_SCAN_START), ROW(3, EV_SCAN_END), ROW(4, EV_OVERRUN),   ROW(5, EV_READER_LOST),
        ROW(6, EV_CONTROL), ROW(7, EV_ERROR),      ROW(8, EV_SETTINGS), ROW(9, EV_POSE_LATE), ROW(10, EV_PPS),
        ROW(11, EV_TIME),   ROW(12, EV_SITE),      ROW(13, EV_PTP)};
    CHECK(events);
}

/* Notices and errors are of the library alone. */
static void test_notices_and_errors(void **state)
{
    (void)state;
    static const int notices[] = {SCANHEAD_NOTICE_GAP,       SCANHEAD_NOTICE_REPEATED,    SCANHEAD_NOTICE_LATE,
                                  SCANHEAD_NOTICE_RESTARTED, SCANHEAD_NOTICE_BAD_PAYLOAD, SCANHEAD_NOTICE_BAD_BYTES,
                                  SCANHEAD_NOTICE_CUT,       SCANHEAD_NOTICE_ECHO,        SCANHEAD_NOTICE_LATE_REPLY,
                                  SCANHEAD_NOTICE_UNASKED,   SCANHEAD_NOTICE_CLOSED,      SCANHEAD_NOTICE_REATTACHED,
                                  SCANHEAD_NOTICE_REFUSED};
    for (int i = 0; i < (int)(sizeof notices / sizeof notices[0]); i++)
        assert_int_equal(notices[i], i + 1);
    assert_string_equal(scanhead_notice_name(SCANHEAD_NOTICE_GAP), "gap");
    assert_string_equal(scanhead_notice_name(SCANHEAD_NOTICE_REFUSED), "refused");
    assert_string_equal(scanhead_notice_name(0), "?");
    assert_string_equal(scanhead_notice_name(SCANHEAD_NOTICE_REFUSED + 1), "?");
    static const int errors[][2] = {
        {SCANHEAD_OK, SH_OK},           {SCANHEAD_EINPUT, SH_EINPUT},   {SCANHEAD_EIO, SH_EIO},
        {SCANHEAD_ENOMEM, SH_ENOMEM},   {SCANHEAD_EPERM, SH_EPERM},     {SCANHEAD_ETIMEOUT, SH_ETIMEOUT},
        {SCANHEAD_ECLOSED, SH_ECLOSED}, {SCANHEAD_EFORMAT, SH_EFORMAT}, {SCANHEAD_ESTATE, SH_ESTATE},
        {SCANHEAD_ELOST, SH_ELOST},     {SCANHEAD_ERESET, SH_ERESET}};
    for (int i = 0; i < (int)(sizeof errors / sizeof errors[0]); i++) {
        assert_int_equal(errors[i][0], -i);
        assert_int_equal(errors[i][1], -i);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_frames), cmocka_unit_test(test_events),
                                       cmocka_unit_test(test_notices_and_errors)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
