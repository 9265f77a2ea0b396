/* SPDX-License-Identifier: MIT */
/* Any client of a head can switch its waveforms on and off (SCAN:WAVeform), within a scan and between scans. No
 * recording ends by that. A LAS file that began with waveforms has descriptor 0 at points without one. A file that
 * began without has no place for them, and counts the points. */
#include "drivers/protocol/native.h"
#include "tests/unit/waves_rig.h"

enum { N = 3, WAVES = 4, PARTS = 3, FORMAT_9_WAVE = 30 };

static const struct rig_point points[N] = {
    {5000, 0, 0, 0, 1, 1, 1}, {6000, 0, 0, 0, 1, 1, 1}, {7000, 0, 0, 0, 1, 1, 1}};

/* A line of N pulses, each with a window of 16 samples about its point, where the head sends windows. */
static void put_line(uint32_t line, uint64_t pulse0, int has_waves)
{
    static uint8_t out[256];
    struct rig_window w[N];
    const struct line_end end = {.line = line, .pulse0 = pulse0, .n_fired = N, .n_cast = N, .n_echoes = N};
    for (uint32_t i = 0; i < N; i++) {
        const double sample = 1e-3 * points[i].a / (0.5 * RIG_C_M_S * 1e-9);
        w[i] = (struct rig_window){i, (uint32_t)sample - 8, 16, {0, 0, 0}};
    }
    rig_points(line, pulse0, pulse0, points, N);
    if (has_waves) rig_waves(line, pulse0, &rig_12_bits, w, N);
    rig_put(out, native_encode_line_end(out, sizeof out, &end, 0));
}

/* Two parts are lines of one scan, with an event of changed settings between them. The third is another scan. */
static void put_stream(const int has_waves[PARTS])
{
    static uint8_t out[256];
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 1);
    const struct native_event event = {.code = NATIVE_EV_SETTINGS, .a = N};
    rig_begin();
    rig_wave_descriptor(0, 1, has_waves[0] ? WAVES : 0);
    rig_anchor(&a);
    put_line(0, 0, has_waves[0]);
    rig_put(out, native_encode_event(out, sizeof out, &event, 0, 0));
    rig_wave_descriptor(0, 1, has_waves[1] ? WAVES : 0);
    rig_anchor(&a);
    put_line(1, N, has_waves[1]);
    rig_wave_descriptor(0, 2, has_waves[2] ? WAVES : 0);
    rig_anchor(&a);
    put_line(0, 0, has_waves[2]);
}

static void check_file(const uint8_t *las, size_t len, const int has_waves[PARTS], int minor)
{
    const int format = minor == 2 ? 1 : has_waves[0] ? 9 : 6;
    const size_t front = (size_t)rig_uint(las + 96, 4), row = (size_t)rig_uint(las + 105, 2);
    assert_int_equal(las[104], format);
    assert_int_equal(rig_uint(las + (minor == 2 ? 107 : 247), minor == 2 ? 4 : 8), PARTS * N);
    assert_true(len >= front + PARTS * N * row);
    for (int i = 0; format == 9 && i < PARTS * N; i++) {
        const uint8_t *wave = las + front + (size_t)i * row + FORMAT_9_WAVE;
        if ((wave[0] != 0) != has_waves[i / N]) fail_msg("point %d has descriptor %d", i, wave[0]);
        if (!has_waves[i / N]) assert_int_equal(rig_uint(wave + 1, 8) | rig_uint(wave + 9, 4), 0);
    }
}

static void check_notes(const int has_waves[PARTS], int minor)
{
    char want[160];
    const int n = has_waves[0] + has_waves[1] + has_waves[2], is_held = minor == 4 && has_waves[0];
    snprintf(want, sizeof want, "%d points whose waveforms are left out%s", n * N,
             minor == 2 ? "; LAS 1.2 has no place" : ": the file began without waveforms, as the head sent none");
    if ((strstr(rig_notes, want) != NULL) != (n > 0 && !is_held)) fail_msg("'%s', not '%s'", rig_notes, want);
    assert_null(strstr(rig_notes, "points without a waveform"));
}

static void test_switched(void **state)
{
    (void)state;
    for (int mask = 0; mask < 1 << PARTS; mask++)
        for (int kind = 0; kind < 3; kind++) { /* LAS 1.4, the same with a .wdp, LAS 1.2 */
            const int has_waves[PARTS] = {mask & 1, mask >> 1 & 1, mask >> 2 & 1}, minor = kind == 2 ? 2 : 4;
            struct recorder_options options = {.las_minor = minor, .las_wdp = kind == 1};
            size_t len;
            put_stream(has_waves);
            uint8_t *las = rig_record_bytes("a.las", options, &len);
            check_file(las, len, has_waves, minor);
            check_notes(has_waves, minor);
            free(las);
            assert_int_equal(unlink(rig_path("a.wdp")), kind == 1 && has_waves[0] ? 0 : -1);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_switched)};
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
