/* SPDX-License-Identifier: MIT */
#include "tests/wire/dissected_waves.h"

#include "drivers/protocol/native_waves.h"
#include "tests/wire/wireshark_rig.h"

/* Compares the window's direction: its slopes in geo, else its angles with the tolerance of expect_point. */
static void expect_beam(const struct scanhead_wave *w, int is_geo)
{
    static const char *const slope[] = {S "wave.dx", S "wave.dy", S "wave.dz"};
    for (int i = 0; is_geo && i < 3; i++)
        expect_real(slope[i], w->direction[i], 0);
    if (is_geo) return;
    const double rad = 3.14159265358979323846 / 180;
    const double line = rad * atof(take_text(S "wave.line_deg")), pan = rad * atof(take_text(S "wave.pan_deg"));
    const double d[] = {sin(pan) * cos(line), cos(pan) * cos(line), sin(line)};
    assert_true(line >= -180 * rad && line <= 180 * rad); /* within half a turn of the lines' middle, 0 */
    for (int i = 0; i < 3; i++)
        assert_true(fabs(d[i] - w->direction[i]) < 1e-14);
}

static void expect_window(const struct scanhead_wave *w, int is_geo, int64_t points_t0_ns)
{
    static char counts[8 * NATIVE_MAX_SAMPLES];
    size_t len = 0;
    for (uint32_t k = 0; k < w->n; k++)
        len += (size_t)snprintf(counts + len, 8, k == 0 ? "%u" : " %u", le_get16(w->sample + 2 * k));
    expect_uint(S "wave.pulse", w->pulse);
    expect_uint(S "wave.dt_ns", (uint64_t)(w->t_ns - points_t0_ns));
    expect_uint(S "wave.first", w->first);
    expect_uint(S "wave.n", w->n);
    expect_real(S "wave.range_m", w->range_m, 0);
    expect_beam(w, is_geo);
    expect_text(S "wave.counts", counts);
}

void expect_waves(struct scanhead *sh, const struct scanhead_frame *f, int64_t points_t0_ns)
{
    static struct scanhead_wave wave[NATIVE_MAX_PAYLOAD / NATIVE_WAVE_LEN];
    struct native_waves v;
    struct scanhead_info info;
    assert_int_equal(native_decode_waves(f->payload, f->payload_len, &v), 0);
    expect_uint(S "waves.pulse0", v.pulse0);
    expect_uint(S "waves.line", v.line);
    expect_uint(S "waves.n_windows", v.n_windows);
    expect_uint(S "waves.sample_ps", v.sample_ps);
    expect_real(S "waves.baseline", v.baseline_16 / 16.0, 0);
    expect_uint(S "waves.bits", v.bits);
    expect_uint(S "waves.reserved", v.reserved);
    expect_uint(S "waves.n_lost", v.n_lost);
    expect_real(S "waves.count_signal", (double)v.count_signal, 0);
    take_text(S "points_in");
    assert_int_equal(scanhead_get_info(sh, &info), 0);
    assert_int_equal(scanhead_waves(sh, f, 0, wave, sizeof wave / sizeof wave[0]), v.n_windows);
    for (uint32_t i = 0; i < v.n_windows; i++)
        expect_window(&wave[i], info.geo, points_t0_ns);
}
