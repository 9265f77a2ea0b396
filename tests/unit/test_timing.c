/* SPDX-License-Identifier: MIT */
/* The times at which a head released the frames of a recording, from the frames alone. Expected times follow from the
 * rules of the schedule, written out here once more: a packet is 16 pulses from the line's first, and is sent with its
 * last. */
#include "tests/unit/native_rig.h"

#include "firmware_sim/replay/timing.h"

__extension__ typedef unsigned __int128 u128;

enum { PACKET = 16 };
static const int64_t T0_NS = 123456789; /* device time of pulse 0 */
static uint8_t frame[NATIVE_MAX_FRAME];
static struct timing timing;

static struct timing_moment take(void)
{
    struct native_header header;
    native_read_header(frame, &header);
    return timing_take(&timing, &header, frame + NATIVE_HEADER_LEN);
}

static void is(struct timing_moment got, enum timing_kind kind, int64_t t_ns)
{
    assert_int_equal(got.kind, kind);
    assert_int_equal(got.t_ns, t_ns);
}

static struct timing_moment descriptor(uint64_t prr_uhz, int flags)
{
    struct native_descriptor d = make_descriptor();
    d.prr_uhz = prr_uhz;
    assert_true(native_encode_descriptor(frame, sizeof frame, &d, T0_NS - 1000, flags) > 0);
    return take();
}

static struct timing_moment emitter(const struct native_emitter *e, const struct native_beam *beam)
{
    assert_true(native_encode_emitter(frame, sizeof frame, e, beam, T0_NS - 1000, 0) > 0);
    return take();
}

static struct timing_moment event(uint32_t code, uint64_t a, int64_t t_ns)
{
    const struct native_event e = {.code = code, .a = a};
    assert_true(native_encode_event(frame, sizeof frame, &e, t_ns, 0) > 0);
    return take();
}

/* n pulses from pulse0 on, in a line from line_t0 on. The last fires dt after the first. Each pulse has two points. */
static struct timing_moment points(uint32_t line, uint64_t pulse0, uint32_t n, int64_t t0_ns, int64_t line_t0_ns,
                                   uint32_t dt_ns)
{
    struct line_block block = make_block(2 * n);
    block.line = line;
    block.pulse0 = pulse0;
    block.n_pulses = n;
    block.t0_ns = t0_ns;
    block.line_t0_ns = line_t0_ns;
    for (uint32_t i = 0; i < 2 * n; i++) {
        block.dt_ns[i] = n > 1 ? (uint32_t)((uint64_t)dt_ns * (i / 2) / (n - 1)) : dt_ns;
        block.echo[i] = (uint8_t)(0x20 | (i % 2 + 1));
    }
    assert_true(native_encode_points(frame, sizeof frame, &block, T0_NS) > 0);
    return take();
}

static struct timing_moment line_end(uint32_t line, uint64_t pulse0, uint32_t n_fired, int64_t t1_ns, uint32_t status)
{
    const struct line_end end = {.line = line, .pulse0 = pulse0, .n_fired = n_fired, .t1_ns = t1_ns, .status = status};
    assert_true(native_encode_line_end(frame, sizeof frame, &end, T0_NS) > 0);
    return take();
}

/* 300007.7 Hz: a pulse lasts 3333.24 ns. */
static const uint64_t PRR_UHZ = 300007700000;

static int64_t fired(uint64_t k)
{
    return (int64_t)((u128)k * 1000000000000000u / PRR_UHZ);
}

/* Pulses from..to of a line that begins with pulse `first`. */
static struct timing_moment shot(uint32_t line, uint64_t first, uint64_t from, uint64_t to)
{
    return points(line, from, (uint32_t)(to - from + 1), fired(from), fired(first),
                  (uint32_t)(fired(to) - fired(from)));
}

static void begin(void)
{
    memset(&timing, 0, sizeof timing);
    is(descriptor(PRR_UHZ, 0), TIMING_KNOWN, T0_NS - 1000);
    is(event(NATIVE_EV_SCAN_START, 1, T0_NS), TIMING_KNOWN, T0_NS);
}

static void packets_of_a_line(void **state)
{
    (void)state;
    begin();
    /* 100..699 of 1003 pulses are cast: frames of whole packets, with both ends within one. */
    is(shot(0, 0, 100, 111), TIMING_KNOWN, T0_NS + fired(111));
    is(shot(0, 0, 112, 367), TIMING_KNOWN, T0_NS + fired(367));
    is(shot(0, 0, 368, 699), TIMING_AT_MOST, T0_NS + fired(703));
    is(line_end(0, 0, 1003, fired(1003), 0), TIMING_KNOWN, T0_NS + fired(1002));
    /* Packets of the next line count from its own first pulse. */
    is(shot(1, 1003, 1003, 1018), TIMING_KNOWN, T0_NS + fired(1018));
    is(shot(1, 1003, 1019, 1023), TIMING_AT_MOST, T0_NS + fired(1003 + 2 * PACKET - 1));
    /* If a line begins with blind pulses, its first pulse is still known from the line before. */
    is(line_end(1, 1003, 1000, fired(2003), 0), TIMING_KNOWN, T0_NS + fired(2002));
    is(shot(2, 2003, 2103, 2104), TIMING_AT_MOST, T0_NS + fired(2003 + 7 * PACKET - 1));
}

static void frames_beside_points(void **state)
{
    (void)state;
    const struct native_telemetry t = {.lines = 1};
    const struct native_anchor a = make_anchor();
    begin();
    assert_true(native_encode_telemetry(frame, sizeof frame, &t, 77, 0) > 0);
    is(take(), TIMING_KNOWN, 77);
    assert_true(native_encode_anchor(frame, sizeof frame, &a, 78, 0) > 0);
    is(take(), TIMING_KNOWN, 78);
    assert_true(native_encode_anchor(frame, sizeof frame, &a, 78, NATIVE_LOCAL) > 0);
    assert_int_equal(take().kind, TIMING_FOLLOWS);
    /* A descriptor for one reader changes nothing: by then it may have other rates than the stream. */
    assert_int_equal(descriptor(1000000, NATIVE_LOCAL).kind, TIMING_FOLLOWS);
    is(shot(0, 0, 0, 17), TIMING_AT_MOST, T0_NS + fired(2 * PACKET - 1));
}

static void attributes_follow(void **state)
{
    (void)state;
    begin();
    struct line_block block = make_block(1);
    static int16_t amplitude[1];
    static uint16_t width[1];
    static uint8_t rgb[1][3];
    block.n_pulses = 1;
    block.amplitude_cdb = amplitude;
    block.width_cns = width;
    block.rgb = rgb;
    block.dt_ns[0] = 0;
    const size_t len = native_encode_points(frame, sizeof frame, &block, T0_NS);
    int n = 0;
    for (size_t at = 0; at < len; at += native_frame_len(frame + at), n++) {
        struct native_header header;
        native_read_header(frame + at, &header);
        const struct timing_moment moment = timing_take(&timing, &header, frame + at + NATIVE_HEADER_LEN);
        assert_int_equal(moment.kind == TIMING_FOLLOWS, n > 0);
    }
    assert_int_equal(n, 3);
}

static void a_stop_within_a_line(void **state)
{
    (void)state;
    begin();
    is(shot(0, 0, 0, 15), TIMING_KNOWN, T0_NS + fired(15));
    /* The scan was stopped after 20 pulses. The last pulses were sent with the tick of the stop, before their packet
     * was full. */
    is(shot(0, 0, 16, 19), TIMING_AT_MOST, T0_NS + fired(31));
    assert_int_equal(line_end(0, 0, 20, fired(20), LINE_PARTIAL).kind, TIMING_STOPS);
    is(event(NATIVE_EV_SCAN_END, 1, T0_NS + 70000), TIMING_KNOWN, T0_NS + 70000);
    /* The next scan counts from 0 again. */
    is(event(NATIVE_EV_SCAN_START, 2, T0_NS), TIMING_KNOWN, T0_NS);
    is(shot(0, 0, 0, 15), TIMING_KNOWN, T0_NS + fired(15));
}

/* The rates change with pulse 40 of a line. The line keeps its time, and packets count from that pulse. */
static void rates_change_within_a_line(void **state)
{
    (void)state;
    begin();
    is(shot(0, 0, 0, 31), TIMING_KNOWN, T0_NS + fired(31));
    is(shot(0, 0, 32, 39), TIMING_AT_MOST, T0_NS + fired(47));
    is(event(NATIVE_EV_SETTINGS, 40, T0_NS + fired(39)), TIMING_KNOWN, T0_NS + fired(39));
    is(descriptor(100000000000, 0), TIMING_KNOWN, T0_NS - 1000); /* 100 kHz: 10 us each from now on */
    const int64_t at = fired(40);
    is(points(0, 40, 16, at, 0, 150000), TIMING_KNOWN, T0_NS + at + 150000);
    is(points(0, 56, 4, at + 160000, 0, 30000), TIMING_AT_MOST, T0_NS + at + 310000);
    /* The line's last pulse is the one before the next line's first. */
    is(line_end(0, 0, 60, at + 200000, 0), TIMING_KNOWN, T0_NS + at + 190000);
    is(points(1, 60, 16, at + 200000, at + 200000, 150000), TIMING_KNOWN, T0_NS + at + 350000);
}

/* If the end of the line before is missing, the line's first time gives its first pulse. */
static void frames_are_missing(void **state)
{
    (void)state;
    begin();
    is(shot(7, 7021, 7121, 7132), TIMING_KNOWN, T0_NS + fired(7132));
    is(shot(7, 7021, 7133, 7135), TIMING_AT_MOST, T0_NS + fired(7021 + 8 * PACKET - 1));
    is(line_end(7, 7021, 1003, fired(8024), 0), TIMING_KNOWN, T0_NS + fired(8023));
    is(shot(8, 8024, 8024, 8025), TIMING_AT_MOST, T0_NS + fired(8024 + PACKET - 1));
    /* Before any descriptor only the last pulse of the points counts, as nothing is known of packets. */
    memset(&timing, 0, sizeof timing);
    is(shot(7, 7021, 7133, 7135), TIMING_KNOWN, T0_NS + fired(7135));
    is(line_end(7, 7021, 1003, fired(8024), 0), TIMING_KNOWN, T0_NS + fired(8024));
}

/* Sequences of 3 beams are 20 us apart, and fire 0, 2 and 7 us after the first. */
static void beams(void **state)
{
    (void)state;
    static const struct native_beam beam[3] = {{0, 0, 0}, {1, 0, 2000}, {2, 0, 7000}};
    static const uint32_t offset[3] = {0, 2000, 7000};
    const struct native_emitter e = {
        .kind = NATIVE_EMIT_BEAMS, .n_beams = 3, .turn = 1, .sequence_ns_num = 20000, .sequence_ns_den = 1};
    begin();
    is(emitter(&e, beam), TIMING_KNOWN, T0_NS - 1000);
#define BEAM(k) ((int64_t)((k) / 3 * 20000 + offset[(k) % 3]))
    is(points(0, 0, 32, 0, 0, (uint32_t)BEAM(31)), TIMING_KNOWN, T0_NS + BEAM(31));
    is(points(0, 32, 5, BEAM(32), 0, (uint32_t)(BEAM(36) - BEAM(32))), TIMING_AT_MOST, T0_NS + BEAM(47));
    is(line_end(0, 0, 37, BEAM(37), 0), TIMING_KNOWN, T0_NS + BEAM(36));
    /* The time alone does not give a line's first pulse where beams fire together. */
    assert_int_equal(points(5, 500, 5, BEAM(500), BEAM(490), 1000).kind, TIMING_KNOWN);
#undef BEAM
}

/* A planar head and a sphere give a pulse's time as a ratio, which the descriptor has rounded. */
static void steps(void **state)
{
    (void)state;
    static const uint32_t kinds[] = {NATIVE_EMIT_PLANAR, NATIVE_EMIT_SPHERE, NATIVE_EMIT_DIRECTIONS};
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        const struct native_emitter e = {
            .kind = kinds[i], .steps = 36, .rings = 2, .turn = -1, .sequence_ns_num = 12500000, .sequence_ns_den = 9};
#define STEP(k) ((int64_t)(k)*12500000 / 9)
        begin();
        emitter(&e, NULL);
        is(points(0, 0, 32, 0, 0, (uint32_t)STEP(1)), TIMING_KNOWN, T0_NS + STEP(1));
        is(points(0, 32, 4, STEP(32), 0, (uint32_t)(STEP(35) - STEP(32))), TIMING_AT_MOST, T0_NS + STEP(47));
        is(line_end(0, 0, 36, STEP(36), 0), TIMING_KNOWN, T0_NS + STEP(35));
        is(points(9, 340, 2, STEP(340), STEP(324), 0), TIMING_AT_MOST, T0_NS + STEP(324 + 2 * PACKET - 1));
#undef STEP
    }
}

/* Frames with right checksums have any numbers. There is an answer, and (with sanitizers) no overflow. */
static void hostile_numbers(void **state)
{
    (void)state;
    static const uint64_t any[] = {0,
                                   1,
                                   15,
                                   16,
                                   UINT32_MAX,
                                   UINT64_C(1) << 52,
                                   INT64_MAX,
                                   INT64_MAX - 1,
                                   UINT64_C(1) << 63,
                                   UINT64_MAX,
                                   UINT64_MAX - 16};
    enum { N = sizeof any / sizeof *any };
    uint64_t random = 88172645463325252u;
    memset(&timing, 0, sizeof timing);
    for (int i = 0; i < 200000; i++) {
        uint64_t v[6];
        for (int j = 0; j < 6; j++) {
            random ^= random << 13, random ^= random >> 7, random ^= random << 17;
            v[j] = any[random % N];
        }
        struct native_event e = {.code = v[0] & 1 ? NATIVE_EV_SETTINGS : NATIVE_EV_SCAN_START, .a = v[1]};
        struct native_descriptor d = {.prr_uhz = v[1]};
        struct native_emitter m = {.kind = NATIVE_EMIT_BEAMS,
                                   .turn = 1,
                                   .n_beams = v[0] & 1 ? 3 : 0,
                                   .sequence_ns_num = v[1],
                                   .sequence_ns_den = v[2]};
        const struct native_beam beam[3] = {{0, 0, 0}, {1, 0, (uint32_t)v[3]}, {2, 0, UINT32_MAX}};
        struct line_end end = {.line = (uint32_t)v[0],
                               .pulse0 = v[1],
                               .n_fired = (uint32_t)v[2],
                               .t1_ns = (int64_t)v[3],
                               .status = (uint32_t)v[4] & 3};
        struct line_block block = make_block(2);
        block.line = (uint32_t)v[0];
        block.pulse0 = v[1];
        block.n_pulses = (uint32_t)v[2];
        block.t0_ns = (int64_t)v[3];
        block.line_t0_ns = (int64_t)v[4];
        block.dt_ns[0] = block.dt_ns[1] = 0xffffff;
        const int64_t t_ns = (int64_t)v[5];
        size_t len = 0;
        switch (random >> 32 & 7) {
        case 0:
            len = native_encode_event(frame, sizeof frame, &e, t_ns, 0);
            break;
        case 1:
            len = native_encode_descriptor(frame, sizeof frame, &d, t_ns, 0);
            break;
        case 2:
            len = native_encode_emitter(frame, sizeof frame, &m, beam, t_ns, 0);
            break;
        case 3:
        case 4:
            len = native_encode_line_end(frame, sizeof frame, &end, 0);
            break;
        default:
            len = native_encode_points(frame, sizeof frame, &block, 0);
        }
        if (len > 0) {
            for (int b = 0; b < 8; b++) /* the header's time */
                frame[16 + b] = (uint8_t)((uint64_t)t_ns >> 8 * b);
            take();
        }
    }
    assert_true(timing.n_beams <= NATIVE_MAX_BEAMS);
}

/* Payloads have any bytes, for each type, including more beams than allowed. */
static void hostile_bytes(void **state)
{
    (void)state;
    uint32_t random = 2463534242;
    static uint8_t payload[4096];
    memset(&timing, 0, sizeof timing);
    for (int i = 0; i < 20000; i++) {
        const struct native_header header = {
            .type = (uint8_t)(i % 13), .version = 1, .length = (uint32_t)i * 7 % sizeof payload, .t_ns = INT64_MIN};
        for (size_t j = 0; j < 128; j++) {
            random ^= random << 13, random ^= random >> 17, random ^= random << 5;
            payload[j] = i % 3 == 0 ? (uint8_t)random : i % 3 == 1 ? 0 : 0xff;
        }
        timing_take(&timing, &header, payload);
    }
    assert_true(timing.n_beams <= NATIVE_MAX_BEAMS);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(packets_of_a_line),
        cmocka_unit_test(frames_beside_points),
        cmocka_unit_test(attributes_follow),
        cmocka_unit_test(a_stop_within_a_line),
        cmocka_unit_test(rates_change_within_a_line),
        cmocka_unit_test(frames_are_missing),
        cmocka_unit_test(beams),
        cmocka_unit_test(steps),
        cmocka_unit_test(hostile_numbers),
        cmocka_unit_test(hostile_bytes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
