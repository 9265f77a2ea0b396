/* SPDX-License-Identifier: MIT */
/* These tests compare frames of waveforms byte by byte. The frames are sent after their points, attributes and colours,
 * cut with them, and refused where they are wrong. Deviations are behind the attributes. */
#include "drivers/protocol/native_waves.h"
#include "tests/unit/native_rig.h"

enum { MOST = 2 * NATIVE_MAX_POINTS + 100, MOST_SAMPLES = 1 << 19 };

static uint8_t out[1 << 21];
static int16_t amplitude[MOST];
static uint16_t width[MOST], deviation[MOST], sample[MOST_SAMPLES];
static uint8_t rgb[MOST][3];
static struct line_wave wave[MOST];
static struct line_waves waves;

/* One point a pulse, 500 ns apart, and no window yet. */
static struct line_block with_waves(uint32_t n_points)
{
    struct line_block block = make_pulses(n_points, 1);
    for (uint32_t i = 0; i < n_points; i++)
        deviation[i] = (uint16_t)(i * 3);
    waves = (struct line_waves){.wave = wave,
                                .sample = sample,
                                .capacity = MOST,
                                .sample_capacity = MOST_SAMPLES,
                                .sample_ps = 1500,
                                .baseline_16 = 3205,
                                .bits = 12,
                                .count_signal = 0.25F};
    block.waves = &waves;
    return block;
}

/* Adds a window of n samples, which count up over all windows. */
static void add_window(uint32_t pulse, uint32_t first, uint32_t n)
{
    assert_true(waves.n < MOST && waves.n_samples + n <= MOST_SAMPLES);
    wave[waves.n++] = (struct line_wave){.pulse = pulse,
                                         .dt_ns = pulse * 500,
                                         .first = first,
                                         .n = n,
                                         .at = waves.n_samples,
                                         .a = 0xa0000000u + pulse,
                                         .b = 0xb0000000u + pulse,
                                         .c = 0xc0000000u + pulse};
    for (uint32_t i = 0; i < n; i++, waves.n_samples++)
        sample[waves.n_samples] = (uint16_t)(waves.n_samples & 0xfff);
}

static void add_attributes(struct line_block *block)
{
    block->amplitude_cdb = amplitude;
    block->width_cns = width;
    block->deviation = deviation;
}

/* WAVEFORMS.md, 12: one window of three samples, and one of two. */
static void test_bytes(void **state)
{
    (void)state;
    for (int beside = 0; beside < 2; beside++) {
        struct line_block block = with_waves(3);
        add_window(1, 20, 3);
        add_window(2, 0x10000, 2);
        waves.n_left_out = 9;
        if (beside) add_attributes(&block), block.rgb = rgb;
        const size_t before = 28 + 40 + 3 * 20 + (beside ? 28 + 16 + 3 * 6 + 28 + 16 + 9 : 0);
        const size_t len = native_encode_points(out, sizeof out, &block, 5000);
        const uint8_t *f = out + before, *p = f + 28, *w = p + 32;
        assert_int_equal(len, before + 28 + 32 + 28 + 8 + 28 + 4);
        assert_int_equal(f[0], 0xd5);
        assert_int_equal(f[1], 12);
        assert_int_equal(f[3], 0);
        assert_int_equal(wire(f, 4, 4), 32 + 28 + 8 + 28 + 4);
        assert_int_equal(wire(f, 16, 8), wire(out, 16, 8)); /* the device time of its points */
        assert_int_equal(wire(p, 0, 8), 0x123456789a);
        assert_int_equal(wire(p, 8, 4), 77);
        assert_int_equal(wire(p, 12, 4), 2);
        assert_int_equal(wire(p, 16, 4), 1500);
        assert_int_equal(wire(p, 20, 2), 3205);
        assert_int_equal(p[22], 12);
        assert_int_equal(p[23], 0);
        assert_int_equal(wire(p, 24, 4), 0x3e800000); /* 0.25 by IEEE 754 */
        assert_int_equal(wire(p, 28, 4), 9);
        assert_int_equal(wire(w, 0, 4), 1);
        assert_int_equal(wire(w, 4, 4), 500);
        assert_int_equal(wire(w, 8, 4), 20);
        assert_int_equal(wire(w, 12, 4), 3); /* and the zero behind it */
        assert_int_equal(wire(w, 16, 4), 0xa0000001);
        assert_int_equal(wire(w, 20, 4), 0xb0000001);
        assert_int_equal(wire(w, 24, 4), 0xc0000001);
        assert_memory_equal(w + 28, "\0\0\1\0\2\0\0\0", 8);
        assert_int_equal(wire(w, 36, 4), 2);
        assert_int_equal(wire(w, 44, 4), 0x10000);
        assert_memory_equal(w + 64, "\3\0\4\0", 4);
    }
}

/* WAVEFORMS.md, Deviations. */
static void test_deviations(void **state)
{
    (void)state;
    struct line_block block = with_waves(3);
    struct native_attributes head;
    add_attributes(&block);
    deviation[1] = 65535;
    block.waves = NULL;
    const size_t len = native_encode_points(out, sizeof out, &block, 0), points_len = 28 + 40 + 3 * 20;
    const uint8_t *p = out + points_len + 28;
    assert_int_equal(len, points_len + 28 + 16 + 3 * 6);
    assert_memory_equal(p + 16 + 12, "\0\0\xff\xff\6\0", 6);
    assert_int_equal(native_decode_attributes(p, 34, &head), 0);
    assert_int_equal(native_check_deviations(34, 3), 0);
    assert_int_equal(native_check_deviations(40, 3), 0);
    assert_int_equal(native_check_deviations(33, 3), SH_EFORMAT);
    assert_int_equal(native_check_deviations(34, UINT32_MAX), SH_EFORMAT);
    assert_int_equal(native_decode_deviation(p, 3, 1), 65535);
    assert_int_equal(native_decode_deviation(p, 3, 2), 6);
    assert_true(len <= native_points_bound(3) + native_attributes_bound(3));
}

/* A payload is cut anywhere, and has counts that it can't hold. Without room for it there is no room for the block. */
static void test_refused(void **state)
{
    (void)state;
    struct line_block block = with_waves(3);
    struct native_waves head;
    static const struct {
        size_t at;
        uint8_t value;
    } wrong[] = {{12, 3}, {15, 255}, {17, 0},    {22, 7}, {22, 15}, {27, 0xbe}, {27, 0x7f},
                 {44, 0}, {44, 5},   {45, 0x11}, {80, 0}, {80, 3},  {81, 1}};
    add_window(1, 20, 3);
    add_window(2, 40, 2);
    const size_t len = native_encode_points(out, sizeof out, &block, 0), n = 32 + 28 + 8 + 28 + 4;
    uint8_t *p = out + len - n;
    for (size_t cut = 0; cut < n; cut++) { /* in memory of its own, where a sanitizer sees its end */
        uint8_t *part = malloc(cut + (cut == 0));
        assert_non_null(part);
        memcpy(part, p, cut);
        assert_int_equal(native_decode_waves(part, cut, &head), SH_EFORMAT);
        free(part);
    }
    assert_int_equal(native_decode_waves(p, n, &head), 0);
    assert_int_equal(native_decode_waves(p, n + 9, &head), 0); /* later versions grow at the end */
    p[16] = 0;                                                 /* sample_ps 1280: only its second byte is left */
    p[26] = 0x80;
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        const uint8_t was = p[wrong[i].at];
        p[wrong[i].at] = wrong[i].value;
        if (native_decode_waves(p, n, &head) == 0) fail_msg("byte %zu is %u", wrong[i].at, wrong[i].value);
        p[wrong[i].at] = was;
    }
    assert_int_equal(native_decode_waves(p, n, &head), 0);
    for (size_t room = 0; room < len; room++)
        assert_int_equal(native_encode_points(out, room, &block, 0), 0);
    for (uint32_t samples = 0; samples <= 4097; samples += 4097) {
        wave[1].n = samples;
        assert_int_equal(native_encode_points(out, sizeof out, &block, 0), 0);
    }
}

/* Counts of what came back; each window is compared with the next one that went in. */
struct seen {
    uint32_t windows, points_frames, waves_frames, most_waves_frames, lost;
};

static void see_waves(const uint8_t *payload, size_t len, const struct native_points *points, struct seen *seen)
{
    struct native_waves head;
    assert_int_equal(native_decode_waves(payload, len, &head), 0);
    assert_true(head.pulse0 == points->pulse0 && head.line == points->line);
    size_t at = NATIVE_WAVES_HEAD_LEN;
    for (uint32_t i = 0; i < head.n_windows; i++, seen->windows++) {
        const struct line_wave *in = &wave[seen->windows];
        struct native_wave w;
        at = native_decode_wave(payload, at, &w);
        assert_true(w.pulse < points->n_pulses);
        assert_int_equal(points->pulse0 + w.pulse, UINT64_C(0x123456789a) + in->pulse);
        assert_int_equal(points->t0_ns + w.dt_ns, 1000 + in->dt_ns);
        assert_true(w.first == in->first && w.n == in->n && w.a == in->a && w.b == in->b && w.c == in->c);
        for (uint32_t k = 0; k < w.n; k++)
            assert_int_equal(le_get16(w.sample + 2 * (size_t)k), sample[in->at + k]);
    }
    assert_int_equal(at, len);
    seen->lost += head.n_lost;
}

static struct seen see_all(size_t len)
{
    struct seen seen = {0};
    struct native_points points = {0};
    uint32_t here = 0;
    for (size_t at = 0; at < len; at += native_frame_len(out + at)) {
        const size_t payload_len = native_frame_len(out + at) - NATIVE_HEADER_LEN;
        const uint8_t *payload = out + at + NATIVE_HEADER_LEN;
        assert_true(payload_len <= NATIVE_MAX_PAYLOAD);
        here = out[at + 1] == NATIVE_WAVES ? here + 1 : 0;
        if (here > seen.most_waves_frames) seen.most_waves_frames = here;
        seen.waves_frames += out[at + 1] == NATIVE_WAVES;
        seen.points_frames += out[at + 1] == NATIVE_POINTS;
        if (out[at + 1] == NATIVE_POINTS) assert_int_equal(native_decode_points(payload, payload_len, &points), 0);
        if (out[at + 1] == NATIVE_WAVES) see_waves(payload, payload_len, &points, &seen);
    }
    return seen;
}

/* Every window comes after the points of its pulse, in the room that is promised to be enough. */
static void test_cut_with_their_points(void **state)
{
    (void)state;
    const uint32_t n = 2 * NATIVE_MAX_POINTS + 2;
    struct line_block block = with_waves(n);
    for (uint32_t i = 0; i < n; i++)
        if (i % 7 != 3) add_window(i, 3 * i, 1 + i % 90);
    add_attributes(&block);
    block.rgb = rgb;
    waves.n_left_out = 5;
    const size_t room = native_points_bound(n) + native_attributes_bound(n) + native_colours_bound(n) +
                        native_waves_bound(n, waves.n, waves.n_samples);
    const struct seen seen = see_all(native_encode_points(out, room, &block, 0));
    assert_int_equal(seen.windows, waves.n);
    assert_int_equal(seen.points_frames, 3);
    assert_true(seen.most_waves_frames > 5); /* 2806 windows: 92 bytes of samples and 28 more */
    assert_int_equal(seen.lost, 5);
}

/* A frame has room for seven of the longest windows: 32 + 7 x 8220 of 65536 bytes. */
static void test_longest(void **state)
{
    (void)state;
    struct line_block block = with_waves(3);
    for (uint32_t i = 0; i < 24; i++)
        add_window(i / 8, i * 5000, NATIVE_MAX_SAMPLES);
    const size_t room = native_points_bound(3) + native_waves_bound(3, waves.n, waves.n_samples);
    const struct seen seen = see_all(native_encode_points(out, room, &block, 0));
    assert_int_equal(seen.windows, 24);
    assert_int_equal(seen.waves_frames, 4);
}

/* Without a window there is no frame, but lost samples are said, once. */
static void test_none(void **state)
{
    (void)state;
    struct line_block block = with_waves(NATIVE_MAX_POINTS + 5);
    assert_int_equal(see_all(native_encode_points(out, sizeof out, &block, 0)).waves_frames, 0);
    waves.n_left_out = 77;
    const size_t room = native_points_bound(block.n_points) + native_waves_bound(block.n_points, 0, 0);
    const struct seen seen = see_all(native_encode_points(out, room, &block, 0));
    assert_int_equal(seen.waves_frames, 1);
    assert_int_equal(seen.lost, 77);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_bytes),   cmocka_unit_test(test_deviations),
        cmocka_unit_test(test_refused), cmocka_unit_test(test_cut_with_their_points),
        cmocka_unit_test(test_longest), cmocka_unit_test(test_none),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
