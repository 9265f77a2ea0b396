/* SPDX-License-Identifier: MIT */
/* Frames are encoded and decoded: every field is at its place, with extreme values. */
#include <math.h>

#include "tests/unit/native_rig.h"

static uint8_t out[1 << 20];

static void test_descriptor(void **state)
{
    (void)state;
    struct native_descriptor d = make_descriptor(), back;
    size_t len = native_encode_descriptor(out, sizeof out, &d, INT64_MIN, NATIVE_REPEAT);
    check_frame(out, len, 1, 1, 272, INT64_MIN);
    const uint8_t *p = out + 28;
    assert_string_equal((const char *)p, d.idn);
    for (size_t i = strlen(d.idn); i < 96; i++)
        assert_int_equal(p[i], 0);
    assert_string_equal((const char *)p + 96, d.profile);
    assert_int_equal(wire(p, 128, 4), 1);
    assert_int_equal(wire(p, 132, 4), 16);
    assert_int_equal(wire(p, 136, 8), UINT64_MAX);
    assert_int_equal(wire(p, 144, 8), 1);
    assert_int_equal(wire(p, 152, 8), 18000000);
    assert_int_equal(wire(p, 160, 8), (uint64_t)INT64_MIN);
    assert_int_equal(wire(p, 168, 8), 360000000);
    assert_int_equal(wire(p, 176, 8), (uint64_t)-40000000);
    assert_int_equal(wire(p, 184, 8), 60000000);
    assert_int_equal(wire(p, 192, 8), (uint64_t)-1);
    assert_int_equal(wire(p, 200, 8), INT64_MAX);
    assert_true(wire_double(p, 208) == 4294967296.0);
    assert_true(wire_double(p, 216) == DBL_MAX);
    assert_true(wire_double(p, 224) == DBL_MIN);
    assert_int_equal(wire(p, 232, 8), UINT64_C(1) << 63);
    assert_true(wire_double(p, 240) == 0.1);
    assert_int_equal(wire(p, 248, 4), 15);
    assert_int_equal(wire(p, 252, 4), 65534);
    assert_int_equal(wire(p, 256, 4), UINT32_MAX);
    assert_int_equal(wire(p, 260, 4), 7);
    assert_int_equal(wire(p, 264, 8), 0x0123456789abcdefu);
    assert_int_equal(native_decode_descriptor(p, 272, &back), 0);
    memset(d.idn + strlen(d.idn), 0, sizeof d.idn - strlen(d.idn));
    assert_memory_equal(&d, &back, sizeof d);
}

static void test_descriptor_refused(void **state)
{
    (void)state;
    struct native_descriptor d = make_descriptor(), back;
    uint8_t *p = out + 28;
    size_t len = native_encode_descriptor(out, sizeof out, &d, 0, 0);
    assert_int_equal(native_encode_descriptor(out, len - 1, &d, 0, 0), 0);
    assert_int_equal(native_decode_descriptor(p, 271, &back), SH_EFORMAT);
    assert_int_equal(native_decode_descriptor(p, 300, &back), 0); /* later versions grow at the end */
    p[128] = 2;
    assert_int_equal(native_decode_descriptor(p, 272, &back), SH_EFORMAT);
    p[128] = 0;
    memset(p + 96, 'x', 32); /* no NUL */
    assert_int_equal(native_decode_descriptor(p, 272, &back), SH_EFORMAT);
    p[127] = 0;
    assert_int_equal(native_decode_descriptor(p, 272, &back), 0);
    memset(p + 208, 0xff, 8); /* NaN */
    assert_int_equal(native_decode_descriptor(p, 272, &back), SH_EFORMAT);
}

static void test_anchor(void **state)
{
    (void)state;
    struct native_anchor a = make_anchor(), back;
    size_t len = native_encode_anchor(out, sizeof out, &a, 5, NATIVE_LOCAL);
    check_frame(out, len, 2, 2, 280, 5);
    const uint8_t *p = out + 28;
    assert_int_equal(wire(p, 0, 4), 2);
    assert_int_equal(wire(p, 4, 4), 32632);
    assert_int_equal(wire(p, 8, 4), UINT32_MAX);
    assert_int_equal(wire(p, 12, 4), 2);
    assert_true(wire_double(p, 16) == 500000.125 && wire_double(p, 24) == 6e6 && wire_double(p, 32) == -11000.5);
    assert_true(wire_double(p, 40) == 1e-5);
    assert_true(wire_double(p, 48) == -90 && wire_double(p, 56) == 180 && wire_double(p, 64) == 8848.86);
    assert_true(wire_double(p, 72) == 1.5 && wire_double(p, 80) == -2.5 && wire_double(p, 88) == 3.5);
    for (size_t i = 0; i < 9; i++)
        assert_true(wire_double(p, 96 + 8 * i) == (double)i - 4.25);
    assert_true(wire_double(p, 168) == 0.25 && wire_double(p, 176) == 0.5 && wire_double(p, 184) == 0.75);
    assert_true(wire(p, 192, 4) == 1 && wire(p, 196, 4) == 0);
    for (size_t i = 0; i < 9; i++)
        assert_true(wire_double(p, 200 + 8 * i) == 0.5 * (double)i - 1.75);
    assert_true(wire_double(p, 272) == 1207.25);
    assert_int_equal(native_decode_anchor(p, 280, &back), 0);
    assert_memory_equal(&a, &back, sizeof a);
    assert_int_equal(native_decode_anchor(p, 279, &back), SH_EFORMAT);
    out[28] = 3;
    assert_int_equal(native_decode_anchor(p, 280, &back), 0);
    assert_int_equal(back.crs, NATIVE_CRS_GEODETIC);
    out[28] = 4;
    assert_int_equal(native_decode_anchor(p, 280, &back), SH_EFORMAT);
    out[28] = 2;
    out[28 + 192] = 2;
    assert_int_equal(native_decode_anchor(p, 280, &back), SH_EFORMAT);
    out[28 + 192] = 1;
    memset(out + 28 + 168, 0, 24); /* scales and axes that are 0 */
    memset(out + 28 + 200, 0, 72);
    assert_int_equal(native_decode_anchor(p, 280, &back), 0);
    assert_true(back.scale[0] == 1e-5 && back.scale[1] == 1e-5 && back.scale[2] == 1e-5);
    for (int i = 0; i < 9; i++)
        assert_true(back.axes[i] == (i % 4 == 0));
    for (size_t k = 0; k < 9; k++) { /* one that is not 0 makes all of them count */
        const double two = 2;
        memset(out + 28 + 200, 0, 72);
        memcpy(out + 28 + 200 + 8 * k, &two, 8);
        assert_int_equal(native_decode_anchor(p, 280, &back), 0);
        for (size_t i = 0; i < 9; i++)
            assert_true(back.axes[i] == (i == k ? 2 : 0));
    }
}

static void test_line_end(void **state)
{
    (void)state;
    struct line_end e = {1,  UINT32_MAX, UINT64_MAX - 1, 3, 4, 5, -6, 7000, UINT32_MAX - 2, 9, LINE_PARTIAL,
                         10, 11,         UINT32_MAX - 3};
    size_t len = native_encode_line_end(out, sizeof out, &e, 1000);
    check_frame(out, len, 4, 0, 68, 1000 + e.t1_ns);
    const uint8_t *p = out + 28;
    struct line_end back;
    assert_int_equal(native_decode_line_end(p, 67, &back), SH_EFORMAT);
    assert_int_equal(native_decode_line_end(p, 68, &back), 0);
    assert_int_equal(wire(p, 56, 4), e.n_crowded);
    assert_int_equal(wire(p, 60, 4), e.n_faint);
    assert_int_equal(wire(p, 64, 4), e.n_unfit);
    assert_int_equal(back.n_crowded, e.n_crowded);
    assert_int_equal(back.n_unfit, e.n_unfit);
    assert_int_equal(wire(p, 0, 4), e.frame);
    assert_int_equal(wire(p, 4, 4), e.line);
    assert_int_equal(wire(p, 8, 8), e.pulse0);
    assert_int_equal(wire(p, 16, 8), (uint64_t)e.t0_ns);
    assert_int_equal(wire(p, 24, 8), (uint64_t)e.t1_ns);
    assert_int_equal(wire(p, 32, 4), e.n_fired);
    assert_int_equal(wire(p, 36, 4), e.n_cast);
    assert_int_equal(wire(p, 40, 4), e.n_echoes);
    assert_int_equal(wire(p, 44, 4), e.mirror_count);
    assert_int_equal(wire(p, 48, 4), e.pan_count);
    assert_int_equal(wire(p, 52, 4), e.status);
    assert_int_equal(back.frame, e.frame);
    assert_int_equal(back.pulse0, e.pulse0);
    assert_int_equal(back.t1_ns, e.t1_ns);
    assert_int_equal(back.status, e.status);
}

static void test_telemetry(void **state)
{
    (void)state;
    struct native_telemetry t = {4, 2,  UINT64_MAX, 1, 2, 3, 4, 5, 6, 7, INT64_MIN, 8,
                                 9, 10, 0,          0, 0, 0, 0, 0, 0, 0, 0,         0},
                            back;
    size_t len = native_encode_telemetry(out, sizeof out, &t, -1, 0);
    check_frame(out, len, 5, 0, 96, -1);
    const uint8_t *p = out + 28;
    assert_int_equal(wire(p, 0, 4), 4);
    assert_int_equal(wire(p, 4, 4), 2);
    assert_int_equal(wire(p, 8, 8), UINT64_MAX);
    for (size_t i = 0; i < 4; i++)
        assert_int_equal(wire(p, 16 + 8 * i, 8), i + 1);
    assert_int_equal(wire(p, 48, 4), 5);
    assert_int_equal(wire(p, 52, 4), 6);
    assert_int_equal(wire(p, 56, 8), 7);
    assert_int_equal(wire(p, 64, 8), (uint64_t)INT64_MIN);
    for (size_t i = 0; i < 3; i++)
        assert_int_equal(wire(p, 72 + 8 * i, 8), 8 + i);
    assert_int_equal(native_decode_telemetry(p, 96, &back), 0);
    assert_memory_equal(&t, &back, sizeof t);
    assert_int_equal(native_decode_telemetry(p, 95, &back), SH_EFORMAT);
    t.lost_lines = 11; /* without PTP nothing else makes telemetry longer */
    len = native_encode_telemetry(out, sizeof out, &t, -1, 0);
    check_frame(out, len, 5, 0, 104, -1);
    assert_int_equal(wire(p, 96, 8), 11);
    assert_int_equal(native_decode_telemetry(p, 104, &back), 0);
    assert_memory_equal(&t, &back, sizeof t);
    assert_int_equal(native_decode_telemetry(p, 103, &back), 0);
    assert_int_equal(back.lost_lines, 0);
    assert_int_equal(back.scan_lost, 10);
    assert_int_equal(back.ptp_port, 0);
}

/* The offsets are those of EVENTS.md. */
static void test_telemetry_of_a_follower(void **state)
{
    (void)state;
    struct native_telemetry t = {.state = 2, .scan_lost = 10, .ptp_port = 9}, back;
    t.ptp_servo = 2, t.ptp_offset_ns = -3, t.ptp_delay_ns = 4, t.ptp_grandmaster = UINT64_C(0xec4670fffe0a1b2c);
    t.ptp_class = 6, t.ptp_accuracy = 0x21, t.ptp_flags = NATIVE_PTP_UTC_VALID;
    const size_t len = native_encode_telemetry(out, sizeof out, &t, -1, 0);
    check_frame(out, len, 5, 0, 152, -1);
    const uint8_t *p = out + 28;
    assert_true(wire(p, 96, 8) == 0 && wire(p, 104, 4) == 9 && wire(p, 108, 4) == 2);
    assert_true(wire(p, 112, 8) == UINT64_MAX - 2 && wire(p, 120, 8) == 4);
    assert_true(wire(p, 128, 8) == UINT64_C(0xec4670fffe0a1b2c));
    assert_true(wire(p, 136, 4) == 6 && wire(p, 140, 4) == 0x21 && wire(p, 144, 4) == 1 && wire(p, 148, 4) == 0);
    assert_int_equal(native_decode_telemetry(p, 152, &back), 0);
    assert_memory_equal(&t, &back, sizeof t);
    assert_int_equal(native_decode_telemetry(p, 151, &back), 0);
    assert_true(back.ptp_port == 0 && back.ptp_offset_ns == 0 && back.scan_lost == 10);
}

static void test_event(void **state)
{
    (void)state;
    struct native_event e = {.code = NATIVE_EV_OVERRUN, .a = UINT64_MAX, .b = 2, .c = 3, .text = "100 pulses"}, back;
    size_t len = native_encode_event(out, sizeof out, &e, 9, 0);
    check_frame(out, len, 6, 0, 128, 9);
    const uint8_t *p = out + 28;
    assert_int_equal(wire(p, 0, 4), 4);
    assert_int_equal(wire(p, 8, 8), UINT64_MAX);
    assert_int_equal(wire(p, 16, 8), 2);
    assert_int_equal(wire(p, 24, 8), 3);
    assert_string_equal((const char *)p + 32, "100 pulses");
    assert_int_equal(native_decode_event(p, 128, &back), 0);
    assert_memory_equal(&e, &back, sizeof e);
    assert_int_equal(native_decode_event(p, 127, &back), SH_EFORMAT);
}

/* ---- surfaces */

struct seen {
    uint32_t n, first;
    char last[600];
};

static void see(void *ctx, uint32_t label, const char *object, const char *material)
{
    struct seen *seen = ctx;
    if (seen->n++ == 0) seen->first = label;
    snprintf(seen->last, sizeof seen->last, "%s|%s", object, material);
}

static void test_surfaces(void **state)
{
    (void)state;
    struct seen seen = {0};
    struct native_names labels = {3, 3, name_of, NULL};
    strcpy(names[0], "wall");
    strcpy(names[1], "");
    memset(names[2], 'n', 255);
    names[2][255] = 0;
    size_t len = native_encode_surfaces(out, sizeof out, 4096, &labels, 1);
    const size_t payload = 8 + (5 + 2) + (1 + 2) + (256 + 2);
    check_frame(out, len, 7, 0, payload, 1);
    assert_true(labels.first == 6 && labels.n == 0);
    assert_memory_equal(out + 28, "\x03\0\0\0\x03\0\0\0\x04wall\x01m\0\x01m\xff", 19);
    assert_int_equal(native_decode_surfaces(out + 28, payload, see, &seen), 0);
    assert_int_equal(seen.n, 3);
    assert_int_equal(seen.first, 3);
    assert_int_equal(strlen(seen.last), 257);
    /* No call is made for a payload that is wrong at its end. */
    seen.n = 0;
    assert_int_equal(native_decode_surfaces(out + 28, payload - 1, see, &seen), SH_EFORMAT);
    out[28 + 2] = 1; /* first label beyond 65534 */
    assert_int_equal(native_decode_surfaces(out + 28, payload, see, &seen), SH_EFORMAT);
    assert_int_equal(seen.n, 0);
}

static void test_surfaces_split(void **state)
{
    (void)state;
    struct seen seen = {0};
    struct native_names labels = {0, 100, name_of, NULL}, one = {0, 1, name_of, NULL}, none = {0, 0, name_of, NULL};
    strcpy(names[0], "wall");
    strcpy(names[1], "door");
    strcpy(names[2], "roof"); /* 7 bytes each with their material */
    size_t len = native_encode_surfaces(out, sizeof out, 8 + 7 * 10 + 6, &labels, 1);
    assert_true(labels.first == 10 && labels.n == 90);
    assert_int_equal(len, 28 + 8 + 70);
    assert_int_equal(native_decode_surfaces(out + 28, 78, see, &seen), 0);
    assert_string_equal(seen.last, "wall|m");
    assert_int_equal(native_encode_surfaces(out, sizeof out, 14, &one, 1), 0);
    assert_true(one.first == 0 && one.n == 1);
    assert_int_equal(native_encode_surfaces(out, 28 + 8, 4096, &none, 1), 36);
    memset(names[0], 'n', 256);
    names[0][256] = 0; /* a length that has no byte */
    assert_int_equal(native_encode_surfaces(out, sizeof out, 4096, &one, 1), 0);
}

/* ANCHOR.md, 8 poses: each byte of a pose is where the table says; wrong ones are refused. */
static void test_poses(void **state)
{
    (void)state;
    const struct native_pose pose[2] = {
        {.t_ns = -2, .position_m = {1.0, -2.5, 1e-3}, .quat = {1, 0, 0, 0}, .frame = 7.25, .flags = 3},
        {.t_ns = INT64_C(0x123456789a), .position_m = {4, 5, 6}, .quat = {0.6, 0, 0, -0.8}, .frame = 8},
    };
    uint8_t *payload = out + NATIVE_HEADER_LEN;
    struct native_pose back;
    uint32_t n;
    size_t len = native_encode_poses(out, sizeof out, pose, 2, 99, 0);
    assert_int_equal(len, NATIVE_HEADER_LEN + 8 + 2 * 80);
    assert_int_equal(out[1], 8);
    static const uint8_t head[8] = {2};
    assert_memory_equal(payload, head, 8);
    const uint8_t *second = payload + 8 + 80;
    assert_true(le_get64(second) == 0x123456789a);
    static const double want[] = {4, 5, 6, 0.6, 0, 0, -0.8, 8};
    for (int i = 0; i < 8; i++) {
        uint64_t bits;
        memcpy(&bits, &want[i], sizeof bits);
        assert_true(le_get64(second + 8 + 8 * (size_t)i) == bits);
    }
    assert_int_equal(le_get32(payload + 8 + 72), 3);
    assert_int_equal(le_get32(payload + 8 + 76), 0);
    size_t body = len - NATIVE_HEADER_LEN;
    assert_int_equal(native_decode_poses(payload, body, &n), 0);
    assert_int_equal(n, 2);
    native_decode_pose(payload, 0, &back);
    assert_memory_equal(&back, &pose[0], sizeof back);
    assert_int_equal(native_decode_poses(payload, body - 1, &n), SH_EFORMAT);
    assert_int_equal(native_decode_poses(payload, 7, &n), SH_EFORMAT);
    assert_int_equal(native_encode_poses(out, len - 1, pose, 2, 99, 0), 0);
    assert_int_equal(native_encode_poses(out, sizeof out, pose, NATIVE_MAX_POSES + 1, 99, 0), 0);
    struct native_pose wrong[2] = {pose[0], pose[1]};
    wrong[1].t_ns = wrong[0].t_ns; /* times rise */
    native_encode_poses(out, sizeof out, wrong, 2, 99, 0);
    assert_int_equal(native_decode_poses(payload, body, &n), SH_EFORMAT);
    wrong[1] = pose[1];
    wrong[1].quat[0] = 0.7; /* a rotation */
    native_encode_poses(out, sizeof out, wrong, 2, 99, 0);
    assert_int_equal(native_decode_poses(payload, body, &n), SH_EFORMAT);
    native_encode_poses(out, sizeof out, pose, 1, 99, 0); /* one alone says nothing of the time around it */
    assert_int_equal(native_decode_poses(payload, 8 + 80, &n), SH_EFORMAT);
}

/* Each pose is a rotation, the first one, too, and later than the one before. */
static void test_poses_refused(void **state)
{
    (void)state;
    static const double norm2[] = {1 - 2e-9, 1 - 5e-10, 1 + 5e-10, 1 + 2e-9, 0, (double)NAN};
    for (int k = 0; k < 3; k++) {
        uint32_t n;
        for (int i = 0; i < 6 + 3; i++) {
            struct native_pose pose[3] = {{.t_ns = INT64_MIN, .quat = {0, 1, 0, 0}},
                                          {.t_ns = 0, .quat = {0, 0, 1, 0}},
                                          {.t_ns = INT64_MAX, .quat = {0.5, 0.5, 0.5, 0.5}}};
            int is_right = i == 1 || i == 2;
            for (int q = 0; q < 4 && i < 6; q++)
                pose[k].quat[q] *= sqrt(norm2[i]);
            if (i >= 6) pose[k].t_ns = (int64_t[]){INT64_MIN, 0, INT64_MAX}[i - 6];
            if (i >= 6) is_right = k == i - 6;
            const size_t len = native_encode_poses(out, sizeof out, pose, 3, 99, 0);
            assert_int_equal(native_decode_poses(out + NATIVE_HEADER_LEN, len - NATIVE_HEADER_LEN, &n),
                             is_right ? 0 : SH_EFORMAT);
        }
    }
}

/* DESCRIPTOR.md, 10 emitter: each field is where the table says; wrong ones are refused. */
static void test_emitter(void **state)
{
    (void)state;
    const struct native_emitter e = {.kind = NATIVE_EMIT_BEAMS,
                                     .n_beams = 2,
                                     .steps = 3,
                                     .first_step = -4,
                                     .last_step = 5,
                                     .front_step = -6,
                                     .turn = -1,
                                     .rings = 7,
                                     .sequence_ns_num = UINT64_C(0x1122334455667788),
                                     .sequence_ns_den = 9,
                                     .first_ring_udeg = -90000000,
                                     .echoes = NATIVE_ECHOES_LAST};
    const struct native_beam beam[2] = {{-15000000, 1, 2}, {3, -4, 4000000000u}};
    static const int fields[][3] = {{0, 4, 2},  {4, 4, 2},  {8, 4, 3},  {16, 4, 5},
                                    {28, 4, 7}, {40, 8, 9}, {56, 4, 2}, {60, 4, 0}};
    uint8_t *payload = out + NATIVE_HEADER_LEN;
    struct native_emitter back;
    struct native_beam second;
    size_t len = native_encode_emitter(out, sizeof out, &e, beam, 99, NATIVE_REPEAT);
    check_frame(out, len, 10, NATIVE_REPEAT, 64 + 2 * 12, 99);
    for (size_t i = 0; i < sizeof fields / sizeof fields[0]; i++)
        assert_int_equal(wire(payload, (size_t)fields[i][0], fields[i][1]), fields[i][2]);
    assert_int_equal((int32_t)wire(payload, 12, 4), -4);
    assert_int_equal((int32_t)wire(payload, 20, 4), -6);
    assert_int_equal((int32_t)wire(payload, 24, 4), -1);
    assert_int_equal(wire(payload, 32, 8), 0x1122334455667788);
    assert_int_equal((int64_t)wire(payload, 48, 8), -90000000);
    assert_int_equal((int32_t)wire(payload, 64, 4), -15000000);
    assert_int_equal((int32_t)wire(payload, 64 + 12 + 4, 4), -4);
    assert_int_equal(wire(payload, 64 + 12 + 8, 4), 4000000000u);
    const size_t body = len - NATIVE_HEADER_LEN;
    assert_int_equal(native_decode_emitter(payload, body, &back), 0);
    assert_memory_equal(&back, &e, sizeof e);
    native_decode_beam(payload, 1, &second);
    assert_memory_equal(&second, &beam[1], sizeof second);
    assert_int_equal(native_encode_emitter(out, len - 1, &e, beam, 99, 0), 0);
    assert_int_equal(native_decode_emitter(payload, body - 1, &back), SH_EFORMAT);
    assert_int_equal(native_decode_emitter(payload, 63, &back), SH_EFORMAT);
    for (size_t at = 0; at < 48; at += 4) { /* refused: kind 5, a third beam, a turn of 2, a denominator of 0 */
        const uint32_t was = le_get32(payload + at);
        le_put32(payload + at, at == 24 ? 2 : at == 40 ? 0 : at == 4 ? 3 : 5);
        const int wrong = at == 0 || at == 4 || at == 24 || at == 40;
        assert_int_equal(native_decode_emitter(payload, body, &back), wrong ? SH_EFORMAT : 0);
        le_put32(payload + at, was);
    }
}

static void test_is_hashed(void **state)
{
    (void)state;
    for (int type = 0; type < 256; type++)
        for (int flags = 0; flags < 8; flags++) {
            struct native_header h = {.type = (uint8_t)type, .flags = (uint8_t)flags};
            int want = ((type >= 1 && type <= 4) || type == NATIVE_POSES || type == NATIVE_ATTRIBUTES ||
                        type == NATIVE_EMITTER || type == NATIVE_COLOURS || type == NATIVE_WAVES) &&
                       (flags & 3) == 0;
            assert_int_equal(native_is_hashed(&h), want);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_descriptor),     cmocka_unit_test(test_descriptor_refused),
        cmocka_unit_test(test_anchor),         cmocka_unit_test(test_line_end),
        cmocka_unit_test(test_telemetry),      cmocka_unit_test(test_telemetry_of_a_follower),
        cmocka_unit_test(test_event),          cmocka_unit_test(test_surfaces),
        cmocka_unit_test(test_surfaces_split), cmocka_unit_test(test_emitter),
        cmocka_unit_test(test_is_hashed),      cmocka_unit_test(test_poses),
        cmocka_unit_test(test_poses_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
