/* SPDX-License-Identifier: MIT */
/* Limits of a waveform's figures: each limit itself is taken, and what lies beyond is refused with the figure and the
 * limits. (Other checks may refuse a limit for another reason.) */
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "tests/common/thorough.h"
#include "tests/unit/waveform_rig.h"

static const double measured[4] = {0.1, 1.0, 0.5, 0.0};

/* low and high in SI; the text has them in a unit, times scale. */
struct limit {
    const char *what, *unit;
    size_t at;
    double low, high, scale;
    enum waveform_shape shape;
    const char *rest; /* of the text; a limit with one allows 0, too */
};

#define AT(member) offsetof(struct waveform_spec, member)
static const struct limit limits[] = {
    {"a pulse's width", "ns", AT(width_s), 1e-11, 1e-6, 1e9, WAVEFORM_GAUSSIAN, ""},
    {"a pulse's width", "ns", AT(width_s), 1e-11, 1e-6, 1e9, WAVEFORM_ASYMMETRIC, ""},
    {"a pulse's fall/rise ratio", "times", AT(skew), 1.0, 3.0, 1.0, WAVEFORM_ASYMMETRIC, ""},
    {"the step of a pulse's table", "ns", AT(table_step_s), 1e-12, 1e-7, 1e9, WAVEFORM_TABLE, ""},
    {"a receiver's bandwidth", "MHz", AT(bandwidth_hz), 1e6, 1e11, 1e-6, WAVEFORM_GAUSSIAN, ", or 0 for none"},
    {"the time between samples", "ns", AT(sample_s), 5e-11, 1e-7, 1e9, WAVEFORM_GAUSSIAN, ""},
    {"the largest count's signal", "times the threshold", AT(full_scale), 1e-3, 1e9, 1.0, WAVEFORM_GAUSSIAN, ""},
    {"the signal that saturates", "times the threshold", AT(saturation), 1e-3, 1e9, 1.0, WAVEFORM_GAUSSIAN,
     ", or 0 for none"},
    {"a dead time", "ns", AT(dead_s), 0.0, 1e-3, 1e9, WAVEFORM_GAUSSIAN, ""},
    {"noise", "times the threshold", AT(noise), 0.0, 1e6, 1.0, WAVEFORM_GAUSSIAN, ""},
    {"time kept before an echo", "ns", AT(before_s), 0.0, 1e-5, 1e9, WAVEFORM_GAUSSIAN, ""},
    {"time kept after an echo", "ns", AT(after_s), 0.0, 1e-5, 1e9, WAVEFORM_GAUSSIAN, ""},
    {"the near end of the window", "m", AT(near_m), 0.0, 1e7, 1.0, WAVEFORM_GAUSSIAN, ""},
    {"the far end of the window", "m", AT(far_m), 0.0, 1e7, 1.0, WAVEFORM_GAUSSIAN, ""}};

/* Returns whether the figure is refused, with its text. */
static int is_refused(const struct limit *l, double value)
{
    struct waveform_spec spec = waveform_rig_spec();
    struct waveform *w = NULL;
    struct sh_err err = {0};
    char want[200];
    spec.shape = l->shape;
    spec.skew = 1.5;
    spec.table = measured;
    spec.n_table = 4;
    spec.table_step_s = 4e-9;
    spec.saturation = 50.0;
    memcpy((char *)&spec + l->at, &value, sizeof value);
    const int rc = waveform_create(&spec, &w, &err);
    waveform_free(w);
    snprintf(want, sizeof want, "%s of %.6g %s: %.6g to %.6g is allowed%s", l->what, value * l->scale, l->unit,
             l->low * l->scale, l->high * l->scale, l->rest);
    return rc == SH_EINPUT && strcmp(err.text, want) == 0;
}

static void each_figure_has_limits(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof limits / sizeof limits[0]; i++) {
        const struct limit *l = &limits[i];
        const double beyond[] = {l->low - 1e-9 * fmax(l->low, 1e-3), l->high * (1.0 + 1e-9), (double)NAN, -l->high};
        if (is_refused(l, l->low) || is_refused(l, l->high)) fail_msg("%s: a limit is refused", l->what);
        for (size_t k = 0; k < sizeof beyond / sizeof beyond[0]; k++)
            if (!is_refused(l, beyond[k])) fail_msg("%s: %g is not refused", l->what, beyond[k]);
        if (is_refused(l, 0.0) != (l->low > 0.0 && l->rest[0] == '\0')) fail_msg("%s: 0", l->what);
    }
}

/* A return keeps its energy however wide it is, up to the widest spread that has nodes of its own and beyond. That of a
 * pulse of 4 ns is 231 m for a disc and 80 m for a bell. Steps of 1 m leave an error of about (1 m / extent)^1.5, at
 * the ends of the disc. */
static void wide_returns_keep_their_energy(void **state)
{
    (void)state;
    static const double extents_m[3][2] = {{0}, {200.0, 400.0}, {70.0, 200.0}};
    const double range_m = 1e7, s_1_m = 1e-9 / SAMPLE_M;
    struct waveform_spec spec = waveform_rig_spec();
    struct waveform *w = waveform_rig_open(&spec);
    for (int spread = WAVEFORM_DISC; spread <= WAVEFORM_BELL; spread++)
        for (int e = SANITIZED ? 1 : 0; e < 2; e++) {
            const struct waveform_return wide = {range_m, 5.0, extents_m[spread][e], (enum waveform_spread)spread};
            double sum = 0.0;
            for (int i = -500; i <= 500; i++)
                sum += waveform_signal(w, &wide, 1, range_m + i);
            const double energy = sum * s_1_m, want = 5.0 * waveform_pulse_area_s(w);
            if (!(fabs(energy - want) < 1e-3 * want)) fail_msg("%d, %g m: %g", spread, wide.extent_m, energy / want);
        }
    waveform_free(w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(each_figure_has_limits),
                                       cmocka_unit_test(wide_returns_keep_their_energy)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
