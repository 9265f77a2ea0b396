/* SPDX-License-Identifier: MIT */
/* libscanhead over socket pairs and files, and its view of a stream. */
#include <fcntl.h>
#include <math.h>

#include "tests/unit/host_rig.h"

static void test_open_refused(void **state)
{
    (void)state;
    static const struct {
        const char *source;
        int code;
    } bad[] = {
        {"fd:999", SCANHEAD_EINPUT},
        {"fd:x", SCANHEAD_EINPUT},
        {"fd:", SCANHEAD_EINPUT},
        {"/nonexistent.shs", SCANHEAD_EINPUT},
        {"/", SCANHEAD_EINPUT},
        {"tty:/dev/null", SCANHEAD_EINPUT},
        {"tty:/nonexistent", SCANHEAD_ELOST},
        {"tcp:localhost", SCANHEAD_EINPUT},
        {"tcp::4000", SCANHEAD_EINPUT},
        {"tcp:h:", SCANHEAD_EINPUT},
        {"tcp:h:70000", SCANHEAD_EINPUT},
        {"tcp:h:0", SCANHEAD_EINPUT},
        {"tcp:::1:4000", SCANHEAD_EINPUT},
        {"tcp:[::1]4000", SCANHEAD_EINPUT},
        {"tcp:[::1", SCANHEAD_EINPUT},
        {"tcp:h:12x", SCANHEAD_EINPUT},
    };
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        struct scanhead *sh = (struct scanhead *)&bad;
        char err[256] = "";
        assert_int_equal(scanhead_open(bad[i].source, &sh, err, sizeof err), bad[i].code);
        assert_null(sh);
        assert_non_null(strstr(err, bad[i].source));
        assert_int_equal(scanhead_open(bad[i].source, &sh, NULL, 0), bad[i].code);
    }
}

static void test_frames(void **state)
{
    (void)state;
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    struct scanhead_info info;
    struct scanhead_point p;
    assert_int_equal(scanhead_next(sh, &f, 0), SCANHEAD_ETIMEOUT);
    assert_int_equal(scanhead_next(sh, &f, 1), SCANHEAD_ETIMEOUT);
    put_points(head, 1, 7);
    expect_frame(sh, SCANHEAD_POINTS, &f);
    assert_int_equal(scanhead_points(sh, &f, 0, &p, 1), SCANHEAD_ESTATE);
    assert_int_equal(scanhead_get_info(sh, &info), SCANHEAD_ESTATE);
    put_descriptor(head, 1, 3, NATIVE_REPEAT);
    put_anchor(head, NATIVE_REPEAT);
    put_points(head, 3, 8);
    put_event(head, NATIVE_EV_STATE, 1, 2, 3, 0);
    expect_frame(sh, SCANHEAD_DESCRIPTOR, &f);
    assert_int_equal(f.flags, SCANHEAD_REPEAT);
    assert_int_equal(scanhead_get_info(sh, &info), SCANHEAD_ESTATE);
    assert_int_equal(scanhead_points(sh, &f, 0, &p, 1), SCANHEAD_EINPUT);
    expect_frame(sh, SCANHEAD_ANCHOR, &f);
    expect_frame(sh, SCANHEAD_POINTS, &f);
    assert_int_equal(f.scan_frame, 4);
    assert_int_equal(f.scan_line, 5);
    assert_int_equal(f.pulse0, 8);
    assert_int_equal(f.n_points, 3);
    assert_int_equal(f.n_pulses, 3);
    assert_int_equal(f.scan_t0_ns, 1000000);
    assert_int_equal(f.line_t0_ns, 900000);
    assert_int_equal(f.t_ns, 1000500);
    assert_int_equal(f.raw_len, 28 + 40 + 60);
    assert_ptr_equal(f.raw + 28, f.payload);
    assert_int_equal(scanhead_points(sh, &f, 2, &p, 5), 1);
    assert_int_equal(scanhead_points(sh, &f, 3, &p, 5), 0);
    expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_int_equal(f.event, SCANHEAD_EV_STATE);
    assert_int_equal(f.event_value[2], 3);
    assert_string_equal(f.event_text, "why");
    assert_int_equal(scanhead_get_info(sh, &info), 0);
    assert_string_equal(info.idn, "Maker,Model,SN1,1.0");
    assert_string_equal(info.profile, "model");
    assert_true(info.geo == 1 && info.crs == 1 && info.epsg == 4978 && info.station == 2 && info.scan == 3);
    assert_true(info.prr_hz == 300000 && info.lines_hz == 100.5 && info.pan_deg_s == 18);
    assert_true(info.lat_deg == 49 && info.lon_deg == 11 && info.height_m == 400);
    assert_true(info.anchor[2] == 4.8e6 && info.station_m[1] == 2 && info.rotation[3] == -1 && info.scale_m == 1e-5);
    assert_true(info.range_min_m == 1.5 && info.range_max_m == 600 && info.n_surfaces == 2 && info.frames == 9);
    close(head);
    assert_int_equal(scanhead_next(sh, &f, -1), SCANHEAD_ECLOSED);
    assert_int_equal(scanhead_next(sh, &f, -1), SCANHEAD_ECLOSED);
    scanhead_close(sh);
}

/* A scan whose beginning did not reach us must not be placed with the anchor of the one before. */
static void test_new_scan_forgets(void **state)
{
    (void)state;
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    struct scanhead_point p;
    struct scanhead_info info;
    put_descriptor(head, 1, 1, 0);
    put_anchor(head, 0);
    put_points(head, 1, 100);
    put_points(head, 1, 101);
    put_points(head, 1, 0); /* pulse numbers begin anew: another scan */
    for (int i = 0; i < 4; i++) {
        assert_int_equal(scanhead_next(sh, &f, WAIT_MS), 0);
        if (i > 1) assert_int_equal(scanhead_points(sh, &f, 0, &p, 1), 1);
    }
    expect_frame(sh, SCANHEAD_POINTS, &f);
    assert_int_equal(scanhead_points(sh, &f, 0, &p, 1), SCANHEAD_ESTATE);
    put_descriptor(head, 1, 2, NATIVE_REPEAT);
    put_anchor(head, NATIVE_REPEAT);
    put_points(head, 1, 1);
    for (int i = 0; i < 3; i++)
        assert_int_equal(scanhead_next(sh, &f, WAIT_MS), 0);
    assert_int_equal(scanhead_points(sh, &f, 0, &p, 1), 1);
    /* The first event is of the same scan, which began at 500 ns. The second is of a head that has started again. */
    for (int is_other = 0; is_other < 2; is_other++) {
        put_event(head, NATIVE_EV_SCAN_START, 2, 500u + (uint64_t)is_other, 0, 0);
        expect_frame(sh, SCANHEAD_EVENT, &f);
        assert_int_equal(scanhead_get_info(sh, &info), is_other ? SCANHEAD_ESTATE : 0);
    }
    put_descriptor(head, 1, 2, 0);
    put_anchor(head, 0);
    put_event(head, NATIVE_EV_SCAN_START, 2, 77, 0,
              0); /* no points came: a client that joins gets the descriptor first */
    for (int i = 0; i < 3; i++)
        assert_int_equal(scanhead_next(sh, &f, WAIT_MS), 0);
    assert_int_equal(scanhead_get_info(sh, &info), 0);
    put_event(head, NATIVE_EV_SCAN_START, 3, 0, 0, 0);
    expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_int_equal(scanhead_get_info(sh, &info), SCANHEAD_ESTATE);
    put_anchor(head, 0); /* of whichever scan: the descriptor must come first */
    expect_frame(sh, SCANHEAD_ANCHOR, &f);
    assert_int_equal(scanhead_get_info(sh, &info), SCANHEAD_ESTATE);
    put_descriptor(head, 1, 4, 0);
    expect_frame(sh, SCANHEAD_DESCRIPTOR, &f);
    assert_int_equal(scanhead_get_info(sh, &info), SCANHEAD_ESTATE);
    put_anchor(head, 0);
    expect_frame(sh, SCANHEAD_ANCHOR, &f);
    assert_int_equal(scanhead_get_info(sh, &info), 0);
    close(head);
    scanhead_close(sh);
}

static void name_of(void *ctx, uint32_t i, const char **object, const char **material)
{
    const char *const(*names)[2] = ctx;
    *object = names[i][0];
    *material = names[i][1];
}

static void put_surfaces(int fd, const char *const (*names)[2], uint32_t first, uint32_t n)
{
    struct native_names labels = {first, n, name_of, (void *)(uintptr_t)names};
    size_t len = native_encode_surfaces(out, sizeof out, 4096, &labels, 1);
    assert_int_equal(labels.n, 0);
    native_finish_frame(out, rig_next_seq());
    put_all(fd, out, len);
}

static void test_surfaces(void **state)
{
    (void)state;
    static const char *const names[][2] = {{"wall", "brick"}, {"door", ""}, {"roof", "tile"}};
    static const char *const other[][2] = {{"wall", "brick"}, {"gate", "iron"}, {"roof", "tile"}};
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    const char *object, *material, *wall;
    put_surfaces(head, names, 1, 2);
    put_surfaces(head, names, 0, 1);
    assert_int_equal(scanhead_surface(sh, 1, &object, &material), 0);
    expect_frame(sh, SCANHEAD_SURFACES, &f);
    assert_int_equal(scanhead_surface(sh, 0, &object, &material), 0);
    assert_int_equal(scanhead_surface(sh, 1, &object, &material), 1);
    assert_string_equal(object, "door");
    assert_string_equal(material, "");
    expect_frame(sh, SCANHEAD_SURFACES, &f);
    assert_int_equal(scanhead_surface(sh, 0, &wall, &material), 1);
    assert_string_equal(material, "brick");
    assert_int_equal(scanhead_surface(sh, 3, &object, &material), 0);
    assert_int_equal(scanhead_surface(sh, SCANHEAD_NO_LABEL, &object, &material), 0);
    put_surfaces(head, other, 0, 3);
    expect_frame(sh, SCANHEAD_SURFACES, &f);
    assert_int_equal(scanhead_surface(sh, 0, &object, &material), 1);
    assert_ptr_equal(object, wall); /* names that stay keep their place */
    assert_int_equal(scanhead_surface(sh, 1, &object, &material), 1);
    assert_string_equal(object, "gate");
    close(head);
    scanhead_close(sh);
}

static void test_file(void **state)
{
    (void)state;
    char path[] = "/tmp/test_host_XXXXXX", err[256], reply[32];
    int fd = mkstemp(path);
    struct scanhead *sh;
    struct scanhead_frame f;
    put_descriptor(fd, 1, 1, 0);
    put_anchor(fd, 0);
    put_points(fd, 1, 0);
    /* One frame is cut at its end, and its length covers the whole frame after it. */
    struct line_block block = make_block(100, 1);
    native_encode_points(out, sizeof out, &block, 0);
    native_finish_frame(out, rig_next_seq());
    put_all(fd, out, 200);
    put_points(fd, 2, 1);
    close(fd);
    assert_int_equal(scanhead_open(path, &sh, err, sizeof err), 0);
    for (int i = 0; i < 3; i++)
        assert_int_equal(scanhead_next(sh, &f, -1), 0);
    expect_frame(sh, SCANHEAD_POINTS, &f);
    assert_int_equal(f.n_points, 2);
    assert_int_equal(scanhead_command(sh, "*IDN?", reply, sizeof reply, 10), SCANHEAD_ESTATE);
    assert_int_equal(scanhead_next(sh, &f, -1), SCANHEAD_ECLOSED);
    scanhead_close(sh);
    assert_int_equal(truncate(path, 0), 0);
    fd = open(path, O_WRONLY);
    put_all(fd, "PK\x03\x04 something else", 18);
    close(fd);
    assert_int_equal(scanhead_open(path, &sh, err, sizeof err), 0);
    assert_int_equal(scanhead_next(sh, &f, -1), SCANHEAD_EFORMAT);
    scanhead_close(sh);
    unlink(path);
}

/* Times of an array equal those one by one: within a second, across its end, back and forth, at the ends of int64. */
static void expect_same_times(const struct scanhead *sh)
{
    static const int64_t from_step_ns[][2] = {
        {0, 1},           {123456789, 3333333}, {999999990, 1},           {-5, 1},
        {7000000000, -7}, {INT64_MIN, 1},       {INT64_MAX - 99, 1},      {1250000000, 0},
        {0, 1 << 30},     {-1000000050, 1},     {-1315964790000000001, 1}};
    for (size_t k = 0; k < sizeof from_step_ns / sizeof *from_step_ns; k++) {
        int64_t t_ns[100];
        double seen_s[100], want_s;
        for (int i = 0; i < 100; i++)
            t_ns[i] = from_step_ns[k][0] + i * from_step_ns[k][1];
        assert_int_equal(scanhead_gps_times(sh, t_ns, 100, seen_s), 0);
        for (int i = 0; i < 100; i++) {
            assert_int_equal(scanhead_gps_time(sh, t_ns[i], &want_s), 0);
            assert_memory_equal(&seen_s[i], &want_s, sizeof want_s);
        }
    }
    assert_int_equal(scanhead_gps_times(sh, NULL, 0, NULL), 0);
}

/* 2011-09-14T01:46:25Z is GPS 1e9 s (published by LIGO's tconvert), so its adjusted standard time is 0. */
static void test_gps_time(void **state)
{
    (void)state;
    struct scanhead_frame f;
    double t_s = -1.0;
    int head;
    struct scanhead *sh = open_pair(&head);
    assert_int_equal(scanhead_gps_time(sh, 0, &t_s), SCANHEAD_ESTATE);
    put_event(head, NATIVE_EV_SCAN_START, 1, 5000000000, 1000000000000000000, 0);
    expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_int_equal(scanhead_gps_time(sh, 0, &t_s), 0);
    assert_true(t_s == 0.0);
    assert_int_equal(scanhead_gps_time(sh, 1234567890, &t_s), 0);
    assert_true(fabs(t_s - 1.23456789) < 1e-15); /* seconds and fraction are rounded apart */
    assert_int_equal(scanhead_gps_time(sh, -2500000000, &t_s), 0);
    assert_true(t_s == -2.5);
    expect_same_times(sh);
    /* The head's clock was set ahead by 3.75 s between: the second of GPS 1e9 + 5 began 1.25 s after the scan. */
    put_event(head, NATIVE_EV_PPS, 1315964790, 6250000000, 1000000005, 0);
    expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_int_equal(f.event, SCANHEAD_EV_PPS);
    assert_int_equal(scanhead_gps_time(sh, 1250000001, &t_s), 0);
    assert_true(fabs(t_s - 5.000000001) < 1e-15);
    /* The start of this scan was not seen. The scan's points give its time, here 500 ns after power-up. */
    put_points(head, 3, 0);
    expect_frame(sh, SCANHEAD_POINTS, &f);
    assert_int_equal(scanhead_gps_time(sh, 7000000000 - 500, &t_s), 0);
    assert_true(t_s == 5.75);
    expect_same_times(sh);
    /* This head doesn't know the time. */
    put_event(head, NATIVE_EV_SCAN_START, 2, 9000000000, 0, 0);
    expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_int_equal(scanhead_gps_time(sh, 0, &t_s), SCANHEAD_ESTATE);
    assert_int_equal(scanhead_gps_times(sh, &(const int64_t){0}, 1, &t_s), SCANHEAD_ESTATE);
    close(head);
    scanhead_close(sh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_open_refused), cmocka_unit_test(test_frames), cmocka_unit_test(test_new_scan_forgets),
        cmocka_unit_test(test_surfaces),     cmocka_unit_test(test_file),   cmocka_unit_test(test_gps_time),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
