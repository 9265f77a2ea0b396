/* SPDX-License-Identifier: MIT */
/* Recordings of a stream with attributes. Points wait for them, and are written with their own or with none. */
#include "tests/unit/recorder_rig.h"

enum { SHOTS = 10, LONG = 600 };

static uint8_t out[1 << 16];
static uint32_t seq;

/* Numbers the frames at `out`. The one numbered `lost` (from 0 in each call) is only counted. */
static void put(size_t len, int lost)
{
    int n = 0;
    for (size_t at = 0, frame_len; at < len; at += frame_len, n++) {
        frame_len = native_finish_frame(out + at, seq++);
        if (n != lost) rig_put(out + at, frame_len);
    }
}

static void put_descriptor(uint32_t scan, uint32_t content)
{
    const struct native_descriptor d = {.idn = "a,b,c,d",
                                        .profile = "model",
                                        .scan = scan,
                                        .layout = NATIVE_POLAR,
                                        .prr_uhz = 1000000000,
                                        .mirror_counts_per_turn = 3600,
                                        .pan_counts_per_turn = 3600,
                                        .range_scale_m = 1e-3,
                                        .content = content};
    put(native_encode_descriptor(out, sizeof out, &d, 0, 0), -1);
}

static void put_anchor(uint32_t moving)
{
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 1);
    a.moving = moving;
    put(native_encode_anchor(out, sizeof out, &a, 0, 0), -1);
}

static void put_event(uint32_t code, uint64_t a, uint64_t b, uint64_t c, int flags)
{
    const struct native_event e = {.code = code, .a = a, .b = b, .c = c};
    size_t len = native_encode_event(out, sizeof out, &e, 0, flags);
    if ((flags & NATIVE_LOCAL) != 0)
        rig_put(out, len);
    else
        put(len, -1);
}

/* The head stands still from then to 100 ms later. */
static void put_poses(int64_t from_ms)
{
    struct native_pose pose[2];
    for (int i = 0; i < 2; i++)
        pose[i] = (struct native_pose){.t_ns = (from_ms + 100 * i) * 1000000, .quat = {1, 0, 0, 0}};
    put(native_encode_poses(out, sizeof out, pose, 2, 0, 0), -1);
}

/* Shots are a millisecond apart, and the fourth one is empty. Shot i at pulse0 + i has pulse0 + i as amplitude (0.01
 * dB) and 400 more as width. local: a frame for this reader alone comes between. */
static void put_points(uint32_t line, uint64_t pulse0, int with, int lost, int local)
{
    uint32_t a[SHOTS], zero[SHOTS] = {0}, dt[SHOTS];
    int16_t refl[SHOTS] = {0}, amplitude[SHOTS];
    uint16_t label[SHOTS] = {0}, width[SHOTS];
    uint8_t echo[SHOTS];
    for (uint32_t i = 0; i < SHOTS; i++) {
        a[i] = i == 3 ? 0 : 5000;
        echo[i] = i == 3 ? 0 : 0x11;
        label[i] = i == 3 ? 0xffff : 0;
        dt[i] = i * 1000000;
        amplitude[i] = (int16_t)(i == 3 ? INT16_MIN : (int)pulse0 + (int)i);
        width[i] = (uint16_t)(i == 3 ? 0 : 400 + pulse0 + i);
    }
    struct line_block block = {.line = line,
                               .pulse0 = pulse0,
                               .n_pulses = SHOTS,
                               .t0_ns = (int64_t)pulse0 * 1000000,
                               .line_t0_ns = (int64_t)pulse0 * 1000000,
                               .n_points = SHOTS,
                               .dt_ns = dt,
                               .a = a,
                               .b = zero,
                               .c = zero,
                               .refl_cdb = refl,
                               .echo = echo,
                               .label = label};
    if (with) {
        block.amplitude_cdb = amplitude;
        block.width_cns = width;
    }
    size_t len = native_encode_points(out, sizeof out, &block, 0), points_len = 28 + 40 + SHOTS * 20;
    if (!local) {
        put(len, lost);
        return;
    }
    put(points_len, lost);
    memmove(out, out + points_len, len - points_len);
    len -= points_len;
    static uint8_t attributes[1024];
    memcpy(attributes, out, len);
    put_event(NATIVE_EV_READER_LOST, 0, 0, 0, NATIVE_LOCAL);
    memcpy(out, attributes, len);
    put(len, -1);
}

/* Checks the next vertex of a PLY as text; number -1: its attributes are lost. */
static char *expect(char *at, int number)
{
    char amplitude[32], width[32], want[32];
    int used;
    assert_int_equal(sscanf(at, "%*f %*f %*f %*f %*f %*f 1 1 0 1 %*s %31s %31s\n%n", amplitude, width, &used), 2);
    snprintf(want, sizeof want, "%.2f", 0.01 * number);
    assert_string_equal(amplitude, number < 0 ? "nan" : want);
    snprintf(want, sizeof want, "%.2f", 4.0 + 0.01 * number);
    assert_string_equal(width, number < 0 ? "nan" : want);
    return at + used;
}

/* The head moves, and points whose poses were lost are left out. The others keep their own attributes, even with a
 * frame in between that is not of the sequence, and where attributes, or points, were lost. */
static void test_moving(void **state)
{
    (void)state;
    rig_begin();
    seq = 7;
    put_descriptor(1, NATIVE_HAS_ATTRIBUTES);
    put_anchor(NATIVE_MOVING);
    put_poses(0); /* up to 100 ms: of the second line's shots, six */
    put_points(0, 0, 1, -1, 0);
    put_points(1, 95, 1, -1, 1);
    put_poses(200);
    put_points(2, 195, 1, -1, 0); /* the last five */
    put_points(3, 210, 1, 1, 0);  /* attributes lost */
    put_points(4, 220, 1, 0, 0);  /* points lost */
    put_points(5, 240, 1, -1, 0);
    put_points(6, 260, 1, 1, 0); /* lost, at the end */
    char *text = rig_record_bytes("a.ply", (struct recorder_options){.ascii = 1}, NULL);
    assert_non_null(strstr(text, "comment points_without_attributes 18\n"));
    assert_non_null(strstr(rig_notes, "18 points without amplitude and width, which were lost"));
    char *at = strstr(text, "property double frame\nproperty float amplitude\nproperty float width\nend_header\n");
    assert_non_null(at);
    at = strstr(at, "end_header\n") + 11;
    static const struct {
        int pulse0, first, end, known;
    } lines[] = {{0, 0, 10, 1}, {95, 0, 6, 1}, {195, 5, 10, 1}, {210, 0, 10, 0}, {240, 0, 10, 1}, {260, 0, 10, 0}};
    for (int l = 0; l < 6; l++)
        for (int i = lines[l].first; i < lines[l].end; i++)
            if (i != 3) at = expect(at, lines[l].known ? lines[l].pulse0 + i : -1);
    assert_int_equal(*at, 0);
    free(text);
}

/* Every other pulse has a second echo, so echoes come as 1 of 1, 1 of 2 and 2 of 2. */
static void put_long_frame(void)
{
    static uint32_t a[LONG], zero[LONG], dt[LONG];
    static int16_t refl[LONG], amplitude[LONG];
    static uint16_t label[LONG], width[LONG];
    static uint8_t echo[LONG];
    for (uint32_t i = 0; i < LONG; i++) {
        a[i] = 5000 + i;
        dt[i] = (i - i / 3) * 10000;
        refl[i] = (int16_t)-i;
        label[i] = (uint16_t)(i % 7);
        echo[i] = i % 3 == 0 ? 0x11 : i % 3 == 1 ? 0x21 : 0x22;
        amplitude[i] = (int16_t)i;
        width[i] = (uint16_t)(400 + i);
    }
    const struct line_block block = {.n_pulses = LONG - LONG / 3,
                                     .n_points = LONG,
                                     .dt_ns = dt,
                                     .a = a,
                                     .b = zero,
                                     .c = zero,
                                     .refl_cdb = refl,
                                     .echo = echo,
                                     .label = label,
                                     .amplitude_cdb = amplitude,
                                     .width_cns = width};
    put(native_encode_points(out, sizeof out, &block, 0), -1);
}

/* The frame holds more points than a batch, so batch after batch is filled again from the points that waited. Each has
 * its own figures. */
static void test_long_frame(void **state)
{
    (void)state;
    rig_begin();
    put_descriptor(1, NATIVE_HAS_ATTRIBUTES);
    put_anchor(0);
    put_long_frame();
    char *text = rig_record_bytes("a.ply", (struct recorder_options){.ascii = 1}, NULL);
    const char *at = strstr(text, "end_header\n") + 11;
    for (int i = 0; i < LONG; i++) {
        double place[3], v[5];
        int n[4], used;
        assert_int_equal(sscanf(at, "%lf %lf %lf %lf %lf %lf %d %d %d %d %lf %lf\n%n", place, place + 1, place + 2, v,
                                v + 1, v + 2, n, n + 1, n + 2, n + 3, v + 3, v + 4, &used),
                         12);
        at += used;
        const double want[] = {5 + 1e-3 * i, -0.01 * i, 1e-5 * (i - i / 3), 0.01 * i, 4 + 0.01 * i};
        for (int k = 0; k < 5; k++) /* reflectance, amplitude and width have two decimals, and steps of 0.01 */
            if (fabs(v[k] - want[k]) > (k == 0 || k == 2 ? 1e-9 : 5e-3))
                fail_msg("point %d, figure %d: %g", i, k, v[k]);
        assert_true(fabs(place[0] - 15 - 1e-3 * i) < 1e-6 && fabs(place[1] - 20) < 1e-6 && fabs(place[2] - 30) < 1e-6);
        assert_true(n[0] == 1 + (i % 3 == 2) && n[1] == 1 + (i % 3 != 0) && n[2] == i % 7 && n[3] == 1);
    }
    assert_int_equal(*at, 0);
    free(text);
}

/* The file is binary, with the empty shot: two floats after each vertex. */
static void test_binary(void **state)
{
    (void)state;
    size_t len;
    rig_begin();
    put_descriptor(1, NATIVE_HAS_ATTRIBUTES);
    put_anchor(0);
    put_points(0, 0, 1, -1, 0);
    uint8_t *file = rig_record_bytes("a.ply", (struct recorder_options){.empty_shots = 1}, &len);
    uint8_t *at = (uint8_t *)strstr((char *)file, "end_header\n") + 11;
    assert_int_equal(len, (size_t)(at - file) + SHOTS * (50 + 8));
    for (int i = 0; i < SHOTS; i++, at += 58) {
        float v[2];
        memcpy(v, at + 50, sizeof v);
        if (i == 3) assert_true(isnan(v[0]) && isnan(v[1]));
        if (i != 3)
            assert_true(fabsf(v[0] - 0.01f * (float)i) < 1e-6f && fabsf(v[1] - 4.0f - 0.01f * (float)i) < 1e-6f);
    }
    free(file);
}

/* Points that wait keep the time that the head's clock gave with them. After them another scan began. */
static void test_time(void **state)
{
    (void)state;
    const uint64_t gps_ns[2] = {UINT64_C(1400000000) * 1000000000, UINT64_C(1400001000) * 1000000000};
    rig_begin();
    for (uint32_t scan = 1; scan <= 2; scan++) {
        put_event(NATIVE_EV_SCAN_START, scan, 0, gps_ns[scan - 1], 0);
        put_descriptor(scan, NATIVE_HAS_ATTRIBUTES);
        put_anchor(0);
        put_points(0, 100, 1, scan == 1 ? 1 : -1, 0);
    }
    uint8_t *las = rig_record_bytes("a.las", (struct recorder_options){0}, NULL), *p = las + rig_uint(las + 96, 4);
    assert_int_equal(rig_uint(las + 105, 2), 36);
    assert_int_equal(rig_uint(las + 247, 8), 2 * (SHOTS - 1));
    for (int i = 0; i < 2 * SHOTS; i++) {
        int scan = i / SHOTS, shot = i % SHOTS;
        if (shot == 3) continue;
        double want_s = 1e-9 * (double)gps_ns[scan] - 1e9 + 0.1 + 1e-3 * shot;
        assert_true(fabs(rig_double(p + 22) - want_s) < 2e-7); /* a double has steps of 0.06 us there */
        assert_int_equal((int16_t)rig_uint(p + 32, 2), scan == 0 ? INT16_MIN : 100 + shot);
        assert_int_equal(rig_uint(p + 34, 2), scan == 0 ? 0 : 500 + shot);
        p += 36;
    }
    free(las);
}

/* A file holds one kind. Formats that hold no attributes take both. */
static void test_kinds(void **state)
{
    (void)state;
    for (int which = 0; which < 3; which++) {
        static const char *const name[] = {"a.ply", "a.las", "a.ptx"};
        struct sh_err err = {0};
        const char *path = rig_path(name[which]);
        rig_begin();
        put_descriptor(1, NATIVE_HAS_ATTRIBUTES);
        put_anchor(0);
        put_points(0, 0, 1, -1, 0);
        put_descriptor(2, 0);
        put_anchor(0);
        put_points(0, 0, 0, -1, 0);
        int rc = rig_record(path, (struct recorder_options){0}, 1, &err);
        assert_int_equal(rc, which < 2 ? SH_EFORMAT : 0);
        if (which == 2)
            assert_non_null(strstr(
                rig_notes, "9 points whose amplitude and width are left out; this format has no place for them"));
        if (which < 2)
            assert_non_null(strstr(err.text, "the stream continued without attributes; a file holds one kind"));
        unlink(path);
    }
}

/* The library: attributes belong to the frame before and to no other. A wrong call is reported. */
static void test_library(void **state)
{
    (void)state;
    struct scanhead *sh;
    struct scanhead_frame frame;
    struct scanhead_attribute a[SHOTS];
    int given = 0, refused = 0;
    rig_begin();
    put_descriptor(1, NATIVE_HAS_ATTRIBUTES);
    put_anchor(0);
    put_points(0, 0, 1, -1, 0);
    put_points(1, 20, 1, 0, 0); /* no points */
    put_points(2, 40, 1, -1, 1);
    fclose(rig_stream);
    rig_stream = NULL;
    assert_int_equal(scanhead_open(rig_shs, &sh, NULL, 0), 0);
    assert_int_equal(scanhead_has_attributes(sh), SCANHEAD_ESTATE);
    while (scanhead_next(sh, &frame, 0) == 0) {
        if (frame.type != SCANHEAD_ATTRIBUTES) {
            assert_int_equal(scanhead_attributes(sh, &frame, 0, a, SHOTS), SCANHEAD_EINPUT);
            continue;
        }
        assert_int_equal(scanhead_has_attributes(sh), 1);
        assert_int_equal(frame.n_points, SHOTS);
        assert_int_equal(frame.pulse0, 20 * frame.scan_line);
        int n = scanhead_attributes(sh, &frame, 2, a, 5);
        if (frame.scan_line == 1) {
            assert_int_equal(n, SCANHEAD_ESTATE);
            refused++;
            continue;
        }
        assert_int_equal(n, 5);
        assert_true(fabs(a[0].amplitude_db - 0.01 * (double)(frame.pulse0 + 2)) < 1e-9);
        assert_true(isnan(a[1].amplitude_db) && isnan(a[1].width_ns));
        assert_int_equal(scanhead_attributes(sh, &frame, SHOTS, a, 5), 0);
        given++;
    }
    scanhead_close(sh);
    assert_int_equal(given, 2);
    assert_int_equal(refused, 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_moving), cmocka_unit_test(test_long_frame), cmocka_unit_test(test_binary),
        cmocka_unit_test(test_time),   cmocka_unit_test(test_kinds),      cmocka_unit_test(test_library),
    };
    return cmocka_run_group_tests_name("track_attributes", tests, rig_set_up, rig_tear_down);
}
