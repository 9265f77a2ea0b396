/* SPDX-License-Identifier: MIT */
/* With libscanhead, waveforms and deviations belong to the points before them, and to no others. */
#include <math.h>

#include "drivers/protocol/native_waves.h"

#include "tests/unit/host_rig.h"

enum { WINDOWS = 5, SAMPLES = 3 };

static uint16_t sample[WINDOWS * SAMPLES], deviation[MAX_POINTS], width[MAX_POINTS];
static int16_t amplitude[MAX_POINTS];
static struct line_wave wave[WINDOWS];

/* Windows of the pulses 0, 0, 1, 1, 2. */
static struct line_waves make_waves(void)
{
    for (uint32_t i = 0; i < WINDOWS; i++)
        wave[i] =
            (struct line_wave){.pulse = i / 2, .dt_ns = 1000 * i, .first = 100 * i, .n = SAMPLES, .at = SAMPLES * i};
    for (uint32_t i = 0; i < WINDOWS * SAMPLES; i++)
        sample[i] = (uint16_t)(200 + 10 * i);
    return (struct line_waves){.n = WINDOWS,
                               .n_samples = WINDOWS * SAMPLES,
                               .wave = wave,
                               .sample = sample,
                               .n_left_out = 11,
                               .sample_ps = 2000,
                               .baseline_16 = 8 * 16 + 8,
                               .bits = 12,
                               .count_signal = 0.5F};
}

static void put(int fd, size_t len)
{
    native_finish_frame(out, rig_next_seq());
    put_all(fd, out, len);
}

static void put_descriptor_of(int fd, int geo, uint32_t content)
{
    struct native_descriptor d = make_descriptor(geo, 1);
    d.content = content;
    put(fd, native_encode_descriptor(out, sizeof out, &d, 1, 0));
}

/* Three points and what follows them; frames whose bit of `lost` is set are lost. */
static void put_block(int fd, const struct line_block *block, unsigned lost)
{
    static uint8_t copy[1 << 18];
    const size_t all = native_encode_points(out, sizeof out, block, 500);
    assert_true(all > 0);
    memcpy(copy, out, all);
    for (size_t at = 0, len; at < all; at += len, lost >>= 1) {
        len = native_frame_len(copy + at);
        memcpy(out, copy + at, len);
        native_finish_frame(out, rig_next_seq());
        if ((lost & 1) == 0) put_all(fd, out, len);
    }
}

static void skip_to_points(struct scanhead *sh, struct scanhead_frame *f)
{
    do
        assert_int_equal(scanhead_next(sh, f, WAIT_MS), 0);
    while (f->type != SCANHEAD_POINTS);
}

/* Sample 1 of window 3, by hand: 200 + 10 x (3 x 3 + 1) = 300 counts; (300 - 8.5) x 0.5; at 301 x 2 ns. */
static void test_values(void **state)
{
    (void)state;
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    struct scanhead_wave w[WINDOWS + 1];
    struct line_waves waves = make_waves();
    struct line_block block = make_block(3, 40);
    const struct native_descriptor d = make_descriptor(0, 1);
    block.waves = &waves;
    wave[3].b = (uint32_t)(d.mirror_counts_per_turn / 12); /* 30 degrees */
    wave[3].c = (uint32_t)(d.pan_counts_per_turn / 4);
    assert_int_equal(scanhead_has_waves(sh), SCANHEAD_ESTATE);
    put_descriptor_of(head, 0, NATIVE_HAS_WAVES);
    put_anchor(head, 0);
    put_block(head, &block, 0);
    skip_to_points(sh, &f);
    const int64_t t0_ns = f.scan_t0_ns;
    assert_int_equal(scanhead_waves(sh, &f, 0, w, WINDOWS), SCANHEAD_EINPUT);
    expect_frame(sh, SCANHEAD_WAVES, &f);
    assert_int_equal(scanhead_has_waves(sh), 1);
    assert_int_equal(scanhead_has_deviations(sh), 0);
    assert_int_equal(f.n_points, WINDOWS);
    assert_int_equal(f.pulse0, 40);
    assert_int_equal(scanhead_waves_lost(sh, &f), 11);
    assert_int_equal(scanhead_waves(sh, &f, 0, w, WINDOWS + 1), WINDOWS);
    assert_true(w[4].pulse == 42 && w[3].pulse == 41 && w[0].pulse == 40);
    assert_int_equal(w[3].t_ns, t0_ns + 3000);
    assert_true(w[3].first == 300 && w[3].n == SAMPLES && w[3].sample_ps == 2000 && w[3].bits == 12);
    assert_true(fabs(w[3].range_m - 300 * 0.299792458) < 1e-12);
    assert_true(fabs(w[3].step_m - 0.299792458) < 1e-15);
    assert_true(scanhead_wave_signal(&w[3], 1) == 145.75);
    /* Each angle is wrong by a count at most, 2 pi / counts in radians, and moves the direction by as much. */
    const double error = 7 / d.mirror_counts_per_turn + 7 / d.pan_counts_per_turn;
    assert_true(fabs(w[3].direction[0] - sqrt(0.75)) < error && fabs(w[3].direction[1]) < error);
    assert_true(fabs(w[3].direction[2] - 0.5) < error);
    assert_int_equal(scanhead_waves(sh, &f, 3, w, 9), 2);
    assert_true(w[0].first == 300 && w[1].first == 400);
    assert_int_equal(scanhead_waves(sh, &f, 1, w, 1), 1);
    assert_int_equal(w[0].first, 100);
    assert_int_equal(scanhead_waves(sh, &f, WINDOWS, w, 9), 0);
    close(head);
    scanhead_close(sh);
}

/* In the geo layout the record has floats. */
static void test_geo(void **state)
{
    (void)state;
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    struct scanhead_wave w[WINDOWS];
    struct line_waves waves = make_waves();
    struct line_block block = make_block(3, 0);
    block.waves = &waves;
    wave[0].a = 0xbf400000; /* -0.75, 0.5, 1e-5 by IEEE 754 */
    wave[0].b = 0x3f000000;
    wave[0].c = 0x3727c5ac;
    put_descriptor_of(head, 1, NATIVE_HAS_WAVES);
    put_anchor(head, 0);
    put_block(head, &block, 0);
    skip_to_points(sh, &f);
    expect_frame(sh, SCANHEAD_WAVES, &f);
    assert_int_equal(scanhead_waves(sh, &f, 0, w, WINDOWS), WINDOWS);
    assert_true(w[0].direction[0] == -0.75 && w[0].direction[1] == 0.5);
    assert_true(fabs(w[0].direction[2] - 1e-5) < 1e-12); /* 24 bits of 1e-5 */
    close(head);
    scanhead_close(sh);
}

/* Windows of many samples take several frames. A lost frame doesn't matter to the others; lost points do, also
 * where the same pulses came before them. */
static void test_lost(void **state)
{
    (void)state;
    static uint16_t many[WINDOWS * NATIVE_MAX_SAMPLES];
    static struct line_wave longer[3 * WINDOWS];
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    struct scanhead_wave w[1];
    struct line_waves waves = make_waves();
    struct line_block block = make_block(3, 0);
    block.waves = &waves;
    for (uint32_t i = 0; i < 3 * WINDOWS; i++) /* seven in a frame */
        longer[i] = (struct line_wave){.pulse = i / WINDOWS, .n = NATIVE_MAX_SAMPLES, .first = i};
    waves.wave = longer;
    waves.sample = many;
    waves.n = 3 * WINDOWS;
    put_descriptor_of(head, 0, NATIVE_HAS_WAVES);
    put_anchor(head, 0);
    put_block(head, &block, 2);
    skip_to_points(sh, &f);
    expect_frame(sh, SCANHEAD_WAVES, &f);
    assert_int_equal(scanhead_waves(sh, &f, 0, w, 1), 1);
    assert_int_equal(w[0].first, 7);
    expect_frame(sh, SCANHEAD_WAVES, &f);
    assert_int_equal(scanhead_waves(sh, &f, 0, w, 1), 1);
    assert_int_equal(w[0].first, 14);
    block.line++;
    put_block(head, &block, 1);
    expect_frame(sh, SCANHEAD_WAVES, &f);
    assert_int_equal(scanhead_waves(sh, &f, 0, w, 1), SCANHEAD_ESTATE);
    assert_int_equal(scanhead_waves_lost(sh, &f), 11);
    close(head);
    scanhead_close(sh);
}

/* Damaged contents of a frame of waveforms, with a good checksum, are refused, and the next frame comes. */
static void test_wrong(void **state)
{
    (void)state;
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    struct line_waves waves = make_waves();
    struct line_block block = make_block(3, 0);
    block.waves = &waves;
    put_descriptor_of(head, 0, NATIVE_HAS_WAVES);
    put_anchor(head, 0);
    const size_t all = native_encode_points(out, sizeof out, &block, 500), points_len = native_frame_len(out);
    memmove(out, out + points_len, all - points_len);
    le_put32(out + NATIVE_HEADER_LEN + 12, WINDOWS + 1);
    native_reseal(out, all - points_len);
    put(head, all - points_len);
    for (int i = 0; i < 2; i++)
        assert_int_equal(scanhead_next(sh, &f, WAIT_MS), 0);
    assert_non_null(strstr(expect_refused_frame(sh), "wrong waveforms"));
    put_points(head, 1, 0);
    expect_frame(sh, SCANHEAD_POINTS, &f);
    close(head);
    scanhead_close(sh);
}

/* The same attributes are whole for a head without deviations, and too short for one with them. */
static void test_deviations(void **state)
{
    (void)state;
    for (uint32_t content = 0; content <= NATIVE_HAS_DEVIATIONS; content += NATIVE_HAS_DEVIATIONS)
        for (int has = 0; has < 2; has++) {
            int head;
            struct scanhead *sh = open_pair(&head);
            struct scanhead_frame f;
            double of[3] = {0};
            struct line_block block = make_block(3, 0);
            block.amplitude_cdb = amplitude;
            block.width_cns = width;
            block.deviation = has ? deviation : NULL;
            deviation[1] = 1234;
            put_descriptor_of(head, 0, NATIVE_HAS_ATTRIBUTES | content);
            put_anchor(head, 0);
            put_block(head, &block, 0);
            skip_to_points(sh, &f);
            if (content != 0 && !has)
                assert_non_null(strstr(expect_refused_frame(sh), "too few deviations"));
            else
                assert_int_equal(scanhead_next(sh, &f, WAIT_MS), 0);
            if (content != 0 && has) {
                assert_int_equal(scanhead_has_deviations(sh), 1);
                assert_int_equal(scanhead_deviations(sh, &f, 0, of, 3), 3);
                assert_true(of[0] == 0 && of[1] == 1.234);
                assert_int_equal(scanhead_deviations(sh, &f, 1, of, 9), 2);
                assert_true(of[0] == 1.234);
            } else if (content == 0) {
                assert_int_equal(scanhead_deviations(sh, &f, 0, of, 3), SCANHEAD_ESTATE);
            }
            close(head);
            scanhead_close(sh);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_values), cmocka_unit_test(test_geo),        cmocka_unit_test(test_lost),
        cmocka_unit_test(test_wrong),  cmocka_unit_test(test_deviations),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
