/* SPDX-License-Identifier: MIT */
/* Streams that lost frames between scans, or whose settings change. No point gets another station, row or pose than its
 * own. */
#include "tests/unit/e57_rig.h"

static const struct rig_point one = {3000, -4000, 12000, -1234, 7, 1, 1};
static uint8_t out[4096];

static void put_descriptor_again(uint32_t scan)
{
    const struct native_descriptor d = {
        .idn = "a,b,c,d", .profile = "model", .scan = scan, .layout = NATIVE_GEO, .prr_uhz = 1000000000};
    rig_put(out, native_encode_descriptor(out, sizeof out, &d, 0, NATIVE_REPEAT));
}

static void put_line_end(uint32_t line, uint64_t pulse0, uint32_t n_fired)
{
    const struct line_end end = {.line = line, .pulse0 = pulse0, .n_fired = n_fired};
    rig_put(out, native_encode_line_end(out, sizeof out, &end, 0));
}

static void put_anchor(uint32_t station)
{
    const struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, station);
    rig_anchor(&a);
}

static void expect_scans(int n)
{
    e57rig_record_one((struct recorder_options){0});
    assert_int_equal(rig_count(e57rig_xml, "<points type="), n);
}

static void begin(void)
{
    rig_begin();
    rig_descriptor(1, 1);
    put_anchor(1);
    rig_points(0, 0, 100, &one, 1);
}

/* A head that started again gives its scan the number of the unfinished one. Its first descriptor is lost, and so are
 * its first points: only SCAN_START says that the scan is another one. The event may also come late in the scan. */
static void test_same_number_with_another_start(void **state)
{
    (void)state;
    for (int is_other = 0; is_other < 2; is_other++) {
        const struct native_event start = {.code = NATIVE_EV_SCAN_START, .a = 1, .b = is_other ? 5000 : 0};
        begin();
        rig_put(out, native_encode_event(out, sizeof out, &start, 200000000, 0));
        put_descriptor_again(1);
        put_anchor(1);
        rig_scan_t0_ns = (int64_t)start.b;
        rig_points(0, 0, 300, &one, 1);
        expect_scans(1 + is_other);
    }
}

/* The descriptor of the second scan is lost, but not its anchor: the points are of another station. */
static void test_another_station(void **state)
{
    (void)state;
    begin();
    put_anchor(2);
    rig_points(1, 200, 201, &one, 1);
    expect_scans(2);
    assert_non_null(strstr(e57rig_xml, "scan 2, station 2"));
}

/* All frames of the second scan's beginning are lost. Pulses go back, or the number of the scan differs. */
static void test_same_station(void **state)
{
    (void)state;
    static const uint64_t pulse[] = {20, 300};
    for (int i = 0; i < 2; i++) {
        begin();
        put_descriptor_again(2);
        put_anchor(1);
        rig_points(1, 10, pulse[i], &one, 1);
        expect_scans(2);
        begin(); /* a repetition alone begins nothing */
        put_descriptor_again(1);
        put_anchor(1);
        rig_points(1, 200, 201, &one, 1);
        expect_scans(1);
    }
}

/* A head that started again counts its scans from 1 again, so only its pulses go back. The first frame is lost for want
 * of a descriptor. */
static void test_same_number(void **state)
{
    (void)state;
    begin();
    rig_points(0, 0, 20, &one, 1);
    put_descriptor_again(1);
    put_anchor(1);
    rig_points(1, 10, 30, &one, 1);
    expect_scans(2);
    assert_non_null(strstr(rig_notes, "1 points left out that came before the descriptor"));
}

/* The end of a line shows where the next one begins, but not in another scan. Row 2 follows from the times. */
static void test_rows_of_another_scan(void **state)
{
    (void)state;
    begin();
    put_line_end(3, 30, 10); /* line 4 begins at 40 */
    rig_descriptor(1, 2);
    put_anchor(1);
    rig_points(4, 48, 50, &one, 1);
    expect_scans(2);
    e57rig_scan(1, 0, 0);
    assert_int_equal(e57rig_record[0].row, 2);
    assert_int_equal(e57rig_record[0].column, 4);
}

static void put_rates(uint32_t lines_hz)
{
    const struct native_descriptor d = {.idn = "a,b,c,d",
                                        .profile = "model",
                                        .scan = 1,
                                        .layout = NATIVE_GEO,
                                        .prr_uhz = 1000000000,
                                        .lines_uhz = lines_hz * 1000000};
    rig_put(out, native_encode_descriptor(out, sizeof out, &d, 0, 0));
}

/* Line 1 has 100 rows, then the line rate becomes four times as high: half way a line has 12.5 of its 25 rows behind
 * it, and the pulse at the same angle is in row 12. Where the event that names the pulse is lost, times remain. */
static void test_settings_change_within_a_line(void **state)
{
    (void)state;
    const struct native_event change = {.code = NATIVE_EV_SETTINGS, .a = 150};
    rig_begin();
    put_rates(10);
    put_anchor(1);
    rig_points(0, 0, 30, &one, 1);
    put_line_end(0, 0, 100);
    rig_points(1, 100, 149, &one, 1);
    rig_put(out, native_encode_event(out, sizeof out, &change, 0, 0));
    put_rates(40);
    put_anchor(1);
    rig_points(1, 100, 150, &one, 1);
    rig_points(1, 100, 156, &one, 1);
    put_line_end(1, 100, 63);
    rig_points(2, 163, 170, &one, 1);
    expect_scans(2);
    static const struct {
        uint32_t row, column;
    } want[2][3] = {{{30, 0}, {49, 1}}, {{12, 1}, {18, 1}, {7, 2}}};
    for (int scan = 0; scan < 2; scan++) {
        e57rig_scan(scan, 0, 0);
        assert_int_equal(e57rig_n_records, 2 + scan);
        for (int i = 0; i < 2 + scan; i++) {
            assert_int_equal(e57rig_record[i].row, want[scan][i].row);
            assert_int_equal(e57rig_record[i].column, want[scan][i].column);
        }
    }
}

static void put_poses(int64_t from_ms, int64_t to_ms, double y_m)
{
    const struct native_pose pose[2] = {{.t_ns = from_ms * 1000000, .position_m = {0, y_m, 0}, .quat = {1, 0, 0, 0}},
                                        {.t_ns = to_ms * 1000000, .position_m = {0, y_m, 0}, .quat = {1, 0, 0, 0}}};
    rig_put(out, native_encode_poses(out, sizeof out, pose, 2, 0, 0));
}

/* A moving head's second scan loses its first poses. The first scan's poses have the same times, but do not count. */
static void test_poses_of_another_scan(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 1);
    static const struct rig_point ahead = {5000, 0, 0, INT16_MIN, 3, 1, 1};
    double x, y, z;
    a.moving = NATIVE_MOVING;
    rig_begin();
    for (uint32_t scan = 1; scan <= 2; scan++) {
        rig_descriptor(0, scan);
        rig_anchor(&a);
        if (scan == 1) put_poses(0, 100, 1000);
        rig_points(0, 0, 50, &ahead, 1);
    }
    put_poses(100, 200, 2000);
    rig_points(1, 100, 150, &ahead, 1);
    char *text = rig_record_bytes("a.ply", (struct recorder_options){.ascii = 1}, NULL),
         *at = strstr(text, "end_header\n") + strlen("end_header\n");
    assert_non_null(strstr(rig_notes, "1 points left out whose pose was lost"));
    assert_int_equal(sscanf(at, "%lf %lf %lf", &x, &y, &z), 3);
    assert_true(fabs(y - 1005) < 1e-6);
    at = strchr(at, '\n') + 1;
    assert_int_equal(sscanf(at, "%lf %lf %lf", &x, &y, &z), 3);
    assert_true(fabs(y - 2005) < 1e-6);
    assert_int_equal(strchr(at, '\n')[1], 0);
    free(text);
}

/* An anchor is valid up to 100 ms, and the next anchor is lost: points after that have no place. */
static void test_anchor_of_another_stretch(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    a.moving = NATIVE_MOVING;
    a.until_ms = 100;
    rig_begin();
    rig_descriptor(1, 1);
    rig_anchor(&a);
    rig_points(0, 0, 99, &one, 1);
    rig_points(1, 100, 100, &one, 1);
    expect_scans(1);
    e57rig_scan(0, 0, 0);
    assert_int_equal(e57rig_n_records, 1);
    assert_non_null(strstr(rig_notes, "1 points left out that came before the descriptor"));
}

static int tear_down(void **state)
{
    e57rig_free();
    return rig_tear_down(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_same_number_with_another_start),
        cmocka_unit_test(test_another_station),
        cmocka_unit_test(test_same_station),
        cmocka_unit_test(test_same_number),
        cmocka_unit_test(test_rows_of_another_scan),
        cmocka_unit_test(test_settings_change_within_a_line),
        cmocka_unit_test(test_poses_of_another_scan),
        cmocka_unit_test(test_anchor_of_another_stretch),
    };
    return cmocka_run_group_tests(tests, rig_set_up, tear_down);
}
