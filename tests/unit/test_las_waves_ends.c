/* SPDX-License-Identifier: MIT */
/* Which window a point's range is in, at the ends of windows. A sample stands for half a sample's way before it and
 * after it. */
#include "tests/unit/waves_rig.h"

enum { WAVE_AT = 30 }; /* in a point's record of format 9 */

/* Each pulse has one echo and two windows: samples 30 to 37, and 42 to 45. */
static const struct {
    double sample; /* where the echo is */
    uint32_t n;    /* samples of its window; 0: it is in none */
} rows[] = {{29.4, 0}, {29.6, 8}, {30.0, 8}, {37.0, 8}, {37.4, 8}, {37.6, 0},
            {41.4, 0}, {41.6, 4}, {42.0, 4}, {45.4, 4}, {45.6, 0}};
enum { N = sizeof rows / sizeof rows[0] };

static void a_sample_reaches_half_way_to_the_next(void **state)
{
    (void)state;
    const double step_m = 0.5e-12 * rig_12_bits.sample_ps * RIG_C_M_S; /* 15 cm; ranges are in mm */
    const struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    struct rig_point point[N];
    struct rig_window window[2 * N];
    size_t len;
    for (uint32_t i = 0; i < N; i++) {
        point[i] = (struct rig_point){(int32_t)lrint(1e3 * rows[i].sample * step_m), 0, 0, -1000, 1, 1, 1};
        window[2 * i] = (struct rig_window){i, 30, 8, {0, 0, 0}};
        window[2 * i + 1] = (struct rig_window){i, 42, 4, {0, 0, 0}};
    }
    rig_begin();
    rig_wave_descriptor(0, 1, 4);
    rig_anchor(&a);
    rig_points(0, 0, 0, point, N);
    rig_waves(0, 0, &rig_12_bits, window, 2 * N);
    uint8_t *las = rig_record_bytes("a.las", (struct recorder_options){0}, &len);
    assert_int_equal(rig_uint(las + 247, 8), N);
    for (uint32_t i = 0; i < N; i++) {
        const uint8_t *w = las + rig_uint(las + 96, 4) + i * rig_uint(las + 105, 2) + WAVE_AT;
        assert_int_equal(w[0] != 0, rows[i].n != 0);
        assert_int_equal(rig_uint(w + 9, 4), 2 * rows[i].n); /* bytes of the packet */
        if (rows[i].n == 0) continue;
        const double location_ps = 2e12 * 1e-3 * point[i].a / RIG_C_M_S - (rows[i].n == 8 ? 30.0 : 42.0) * 1000;
        assert_true(fabs((double)rig_float(w + 13) - location_ps) < 1e-2);
    }
    free(las);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_sample_reaches_half_way_to_the_next)};
    return cmocka_run_group_tests_name("ends of waveforms", tests, rig_set_up, rig_tear_down);
}
