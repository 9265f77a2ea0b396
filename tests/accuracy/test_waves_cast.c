/* SPDX-License-Identifier: MIT */
/* These tests cast pulses with waveforms. They compare the energy with the link budget, worked out by hand, the
 * windows with the points, and the echoes that are found with the closed forms. */
#include "core/light.h"
#include "tests/accuracy/lit_plates.h"

enum { PULSES = 16, ACROSS_LINES = 60, ROOM = 16384 };

/* Two plates with waveforms. Signals are about 1,000 thresholds, and a count is an eighth of a threshold. */
struct waves {
    struct lit lit;
    struct cast_waves cast;
    double gain; /* of all signals; 0: 1 */
    double count_signal;
    const struct waveform_spec *spec; /* NULL: SPEC below */
};

static const struct waveform_spec SPEC = {.shape = WAVEFORM_GAUSSIAN,
                                          .width_s = 4e-9,
                                          .sample_s = 1e-9,
                                          .bits = 14,
                                          .baseline_counts = 200.0,
                                          .full_scale = 2000.0,
                                          .keep = 0.01,
                                          .before_s = 12e-9,
                                          .after_s = 12e-9,
                                          .seed = 1};

static double least_of(const struct waves *w)
{
    return 1e-3 / (w->lit.near_m * w->lit.near_m) / (w->gain > 0.0 ? w->gain : 1.0);
}

static void open_waves(struct waves *w, const struct beam_view *view, enum beam_mode mode, uint32_t room)
{
    struct sh_err err;
    struct waveform *waveform;
    struct line_block *b = &w->lit.rig.block;
    open_lit(&w->lit, plates(w->lit.near_m, w->lit.far_m, 1), view, least_of(w));
    beam_rig_mode(&w->lit.rig, mode, 4);
    w->lit.rig.setup.pulse_m = w->lit.rig.beam.beam.resolution_m;
    w->count_signal = SPEC.full_scale / (16383.0 - SPEC.baseline_counts);
    if (waveform_create(w->spec != NULL ? w->spec : &SPEC, &waveform, &err) != 0 ||
        caster_add_waves(w->lit.rig.caster, &err) != 0 || line_block_alloc_attributes(b, &err) != 0 ||
        line_block_alloc_deviations(b, &err) != 0 || line_block_alloc_waves(b, room, room, &err) != 0)
        fail_msg("%s", err.text);
    w->cast.waveform = waveform;
    w->cast.beam = &w->lit.rig.beam.beam;
    w->lit.rig.setup.waves = &w->cast;
}

static void close_waves(struct waves *w)
{
    waveform_free((struct waveform *)(uintptr_t)w->cast.waveform);
    close_lit(&w->lit);
}

/* Returns the amplitude whose energy the samples of a pulse have. */
static double energy_of(const struct waves *w, uint32_t pulse)
{
    const struct line_waves *waves = w->lit.rig.block.waves;
    double sum = 0.0;
    for (uint32_t i = 0; i < waves->n; i++)
        for (uint32_t k = 0; k < waves->wave[i].n && waves->wave[i].pulse == pulse; k++)
            sum += waves->sample[waves->wave[i].at + k] - SPEC.baseline_counts;
    return sum * w->count_signal * SPEC.sample_s / waveform_pulse_area_s(w->cast.waveform);
}

/* A of a return: back / (least R^2). */
static double budget(const struct waves *w, const struct edge *e)
{
    const double least = least_of(w);
    return e->back[FRONT] / (least * e->range_m[FRONT] * e->range_m[FRONT]) +
           e->back[BACK] / (least * e->range_m[BACK] * e->range_m[BACK]);
}

static void check_energies(enum beam_mode mode, const struct beam_view *view, const double at_m[2], double slack)
{
    struct waves w = {.lit = {.near_m = at_m[0], .far_m = at_m[1], .rho = {0.8, 0.5}}};
    double d[3][PULSES];
    uint32_t cut = 0;
    open_waves(&w, view, mode, ROOM);
    for (uint32_t line = 0; line < view->lines; line++) {
        beam_rig_line(&w.lit.rig, line);
        beam_rig_directions(&w.lit.rig, line, d[0], d[1], d[2]);
        for (uint32_t p = 0; p < PULSES; p++) {
            struct edge e = at_edge(&w.lit, d[0][p], d[1][p]);
            if (mode == BEAM_SINGLE && e.front > 0.0 && e.front < 1.0) continue; /* one ray meets one of the plates */
            const double want = budget(&w, &e), told = energy_of(&w, p);
            const int is_cut = e.front > 0.0 && e.front < 1.0;
            cut += (uint32_t)is_cut;
            if (!(fabs(told - want) < 1e-3 * want + (is_cut ? slack * 1000.0 : 0.0)))
                fail_msg("mode %d, line %u, pulse %u: energy %.4f, link budget %.4f", mode, line, p, told, want);
        }
    }
    assert_true(mode == BEAM_SINGLE || slack == 0.0 || cut > PULSES);
    assert_int_equal(w.lit.rig.block.waves->n_left_out, 0);
    close_waves(&w);
}

/* The energy agrees to 0.1 %: rounding at 10,000 counts, and the light outside of the windows, are less. Plates are
 * hit at up to 44 deg. */
static void energy_is_the_link_budget(void **state)
{
    (void)state;
    static const struct beam_view OBLIQUE = {0.0, 1.0, -44.0, -10.0, 4, PULSES};
    for (int mode = BEAM_SINGLE; mode <= BEAM_ADAPTIVE; mode++) {
        const enum beam_mode m = (enum beam_mode)mode;
        check_energies(m, &OBLIQUE, (const double[]){20.0, 200.0}, 0.0);
        check_energies(m, &ACROSS, (const double[]){60.0, 100.0}, m == BEAM_RINGS ? 2.0 * RINGS_OFF : 2.0 * PARTS_OFF);
    }
}

/* Fills the signal by sample of the pulse's grid, from the first one that is kept in `like`. */
static void spread_samples(const struct line_waves *waves, uint32_t pulse, uint32_t from, double out[512])
{
    for (uint32_t i = 0; i < 512; i++)
        out[i] = SPEC.baseline_counts;
    for (uint32_t i = 0; i < waves->n; i++)
        for (uint32_t k = 0; k < waves->wave[i].n && waves->wave[i].pulse == pulse; k++) {
            const uint32_t at = waves->wave[i].first + k - from;
            if (at < 512) out[at] = waves->sample[waves->wave[i].at + k];
        }
}

/* A plane at 80 deg, 300 m away, is 0.6 m deep within a footprint, as long as the pulse. The closed form agrees with
 * 1,027 sub-rays to a count of 12 bits, RMS: 4 counts of the 14 bits here. The closed form neglects that the far side
 * is hit more steeply, by 0.3 % at the rim. */
static void closed_form_agrees_with_sub_rays(void **state)
{
    (void)state;
    static const struct beam_view GRAZING = {0.0, 0.1, -80.1, -80.0, 1, PULSES};
    struct waves w = {.lit = {.near_m = 52.0, .far_m = 5200.0, .rho = {0.8, 0.5}}, .gain = 300.0};
    const struct line_waves *waves;
    double closed[PULSES][512], rings[512], sum2 = 0.0, most = 0.0;
    uint32_t from[PULSES], n = 0;
    open_waves(&w, &GRAZING, BEAM_ADAPTIVE, ROOM);
    waves = w.lit.rig.block.waves;
    beam_rig_line(&w.lit.rig, 0);
    assert_int_equal(waves->n, PULSES);
    for (uint32_t p = 0; p < PULSES; p++) {
        from[p] = waves->wave[p].first - 8;
        spread_samples(waves, p, from[p], closed[p]);
    }
    beam_rig_mode(&w.lit.rig, BEAM_RINGS, BEAM_MAX_RINGS);
    beam_rig_line(&w.lit.rig, 0);
    assert_int_equal(waves->n_left_out, 0);
    for (uint32_t p = 0; p < PULSES; p++) {
        spread_samples(waves, p, from[p], rings);
        for (uint32_t k = 0; k < waves->wave[p].n; k++, n++) {
            most = fmax(most, closed[p][k]);
            sum2 += (closed[p][k] - rings[k]) * (closed[p][k] - rings[k]);
        }
    }
    assert_true(most > 4000.0 && most < 16000.0);
    if (!(sqrt(sum2 / n) < 4.0)) fail_msg("RMS %.2f counts, of up to %.0f", sqrt(sum2 / n), most);
    print_message("    a plane at 80 deg: %.2f counts of 14 bits RMS from 1,027 sub-rays, of up to %.0f\n",
                  sqrt(sum2 / n), most);
    close_waves(&w);
}

/* ---- windows */

static void check_beam(const struct waves *w, const struct line_wave *wave, uint32_t point)
{
    const struct line_block *b = &w->lit.rig.block;
    float e[3];
    assert_int_equal(wave->dt_ns, b->dt_ns[point]);
    if (b->layout == LINE_POLAR) {
        assert_int_equal(wave->b, b->b[point]);
        assert_int_equal(wave->c, b->c[point]);
        return;
    }
    const uint32_t bits[3] = {wave->a, wave->b, wave->c}, at[3] = {b->a[point], b->b[point], b->c[point]};
    memcpy(e, bits, sizeof e);
    double length2 = 0.0;
    for (int i = 0; i < 3; i++)
        length2 += (double)e[i] * (double)e[i];
    assert_true(fabs(length2 - 1.0) < 1e-6); /* of floats */
    for (int i = 0; i < 3; i++)              /* a count of 10 um at 20 m and more, and floats */
        assert_true(fabs((double)e[i] - 1e-5 * (int32_t)at[i] / w->lit.near_m * (double)e[1]) < 2e-6);
}

/* Each pulse with an echo has a window around it, with the beam and the time of its points. */
static void windows_belong_to_points(void **state)
{
    (void)state;
    for (int geo = 0; geo < 2; geo++) {
        struct waves w = {.lit = {.near_m = 20.0, .far_m = 200.0, .rho = {0.8, 0.5}}};
        static const struct beam_view SIDE = {0.0, 1.0, -40.0, -30.0, 2, PULSES};
        const struct line_block *b = &w.lit.rig.block;
        uint32_t at = 0;
        open_waves(&w, &SIDE, BEAM_ADAPTIVE, ROOM);
        w.lit.rig.setup.layout = geo ? LINE_GEO : LINE_POLAR;
        beam_rig_line(&w.lit.rig, 1);
        assert_int_equal(b->waves->n, PULSES);
        for (uint32_t p = 0; p < PULSES; p++, at += b->echo[at] >> 4) {
            const struct line_wave *wave = &b->waves->wave[p];
            assert_int_equal(wave->pulse, p);
            assert_int_equal(b->echo[at], 0x11);
            check_beam(&w, wave, at);
            if (geo) continue;
            const double sample = 1e-6 * b->a[at] / (0.5 * LIGHT_SPEED_M_S * SPEC.sample_s);
            assert_true(wave->first < sample && sample < wave->first + wave->n);
        }
        close_waves(&w);
    }
}

/* In UTM the height is that above the ellipsoid. Its slope along a level beam is the range over the Earth's radius,
 * which is 6,371 km to 0.7 %: at the first sample, 800 m away, 1.26e-4 +- 0.9e-6. Floats add 1e-9. */
static void beams_bend_with_the_earth(void **state)
{
    (void)state;
    static const struct beam_view LEVEL = {0.0, 1.0, -5.0, -1.0, 1, PULSES};
    const struct georef_spec place = {.crs = GEOREF_UTM, .station_m = {0, 0, 0}, .lat_deg = 47.0, .lon_deg = 9.0};
    struct waves w = {.lit = {.near_m = 800.0, .far_m = 900.0, .rho = {0.8, 0.5}}};
    struct beam_rig *rig = &w.lit.rig;
    struct georef *utm;
    struct sh_err err;
    double d[3][PULSES];
    open_waves(&w, &LEVEL, BEAM_SINGLE, ROOM);
    assert_int_equal(georef_create(&place, &utm, &err), 0);
    rig->setup.georef = utm;
    rig->setup.layout = LINE_GEO;
    beam_rig_line(rig, 0);
    beam_rig_directions(rig, 0, d[0], d[1], d[2]);
    assert_int_equal(rig->block.waves->n, PULSES);
    for (uint32_t p = 0; p < PULSES; p++) {
        const struct line_wave *wave = &rig->block.waves->wave[p];
        const double from_m = wave->first * 0.5 * LIGHT_SPEED_M_S * SPEC.sample_s;
        float up;
        memcpy(&up, &wave->c, sizeof up);
        const double want = d[2][p] + from_m * (1.0 - d[2][p] * d[2][p]) / 6371e3;
        if (!(fabs((double)up - want) < 1e-6)) fail_msg("pulse %u: a slope of %.9g, not %.9g", p, (double)up, want);
    }
    georef_free(utm);
    close_waves(&w);
}

/* Points are the same, byte by byte, whether there are waveforms or not. */
static void points_stay_as_they_are(void **state)
{
    (void)state;
    struct waves w = {.lit = {.near_m = 60.0, .far_m = 63.0, .rho = {0.8, 0.5}}};
    struct line_block *b = &w.lit.rig.block;
    static uint32_t range[2][ACROSS_LINES][PULSES * LINE_MAX_ECHOES];
    open_waves(&w, &ACROSS, BEAM_ADAPTIVE, ROOM);
    for (int with = 0; with < 2; with++)
        for (uint32_t line = 0; line < ACROSS_LINES; line++) {
            w.lit.rig.setup.waves = with ? &w.cast : NULL;
            beam_rig_line(&w.lit.rig, line);
            assert_true(with == (b->waves->n > 0));
            for (uint32_t i = 0; i < b->n_points; i++)
                range[with][line][i] = b->a[i] ^ b->b[i] * 3u ^ b->c[i] * 5u ^ (uint32_t)b->echo[i] * 7u ^
                                       (uint32_t)b->width_cns[i] * 11u ^ (uint32_t)b->amplitude_cdb[i] * 13u;
        }
    assert_memory_equal(range[0], range[1], sizeof range[0]);
    close_waves(&w);
}

/* Samples that find no room are counted, and no window is cut. */
static void lost_samples_are_counted(void **state)
{
    (void)state;
    static const struct beam_view SIDE = {0.0, 1.0, -40.0, -30.0, 1, PULSES};
    struct waves w = {.lit = {.near_m = 20.0, .far_m = 200.0, .rho = {0.8, 0.5}}};
    struct cast_counters counters;
    const struct line_block *b = &w.lit.rig.block;
    open_waves(&w, &SIDE, BEAM_SINGLE, ROOM);
    beam_rig_line(&w.lit.rig, 0);
    const uint32_t all = b->waves->n_samples, each = b->waves->wave[0].n;
    assert_true(all >= PULSES * each / 2 && each > 8);
    b->waves->sample_capacity = all - 1;
    beam_rig_line(&w.lit.rig, 0);
    assert_int_equal(b->waves->n, PULSES - 1);
    assert_int_equal(b->waves->n_samples + b->waves->n_left_out, all);
    caster_get_counters(w.lit.rig.caster, &counters);
    assert_int_equal(counters.lost_samples, b->waves->n_left_out);
    close_waves(&w);
}

/* ---- echoes */

/* Without noise, echoes of one plate are where the closed form has them, to the rounding of counts. Half a count is
 * 0.06 thresholds. From the sample below the threshold to the one above it the signal rises by 1 or more, so half a
 * count is 9 mm there at most. A detector that takes a straight line at half of the peak, between samples 1 ns apart,
 * has an error of P'' / 8, 3.6 mm. The amplitude is the link budget's to 0.02 dB: 0.5 %. */
static void echoes_are_found_in_samples(void **state)
{
    (void)state;
    static const struct beam_view SIDE = {0.0, 1.0, -40.0, -10.0, 4, PULSES};
    static const double most_m[] = {
        [WAVEFORM_THRESHOLD] = 18e-3, [WAVEFORM_FRACTION] = 3.6e-3, [WAVEFORM_GAUSSIANS] = 2e-4};
    for (int detector = WAVEFORM_THRESHOLD; detector <= WAVEFORM_GAUSSIANS; detector++)
        for (uint32_t line = 0; line < 4; line++) {
            struct waves w = {.lit = {.near_m = 20.0, .far_m = 200.0, .rho = {0.8, 0.5}}};
            const struct line_block *b = &w.lit.rig.block;
            uint32_t range[PULSES];
            int16_t amplitude_cdb[PULSES], refl_cdb[PULSES];
            open_waves(&w, &SIDE, BEAM_ADAPTIVE, ROOM);
            beam_rig_line(&w.lit.rig, line);
            memcpy(range, b->a, sizeof range);
            memcpy(amplitude_cdb, b->amplitude_cdb, sizeof amplitude_cdb);
            memcpy(refl_cdb, b->refl_cdb, sizeof refl_cdb);
            w.cast.finds = 1;
            w.cast.detector = (enum waveform_detector)detector;
            beam_rig_line(&w.lit.rig, line);
            assert_int_equal(b->n_points, PULSES);
            for (uint32_t p = 0; p < PULSES; p++) {
                assert_int_equal(b->echo[p], 0x11);
                assert_int_equal(b->label[p], FRONT);
                const double off_m = 1e-6 * ((double)b->a[p] - (double)range[p]);
                if (!(fabs(off_m) < most_m[detector]))
                    fail_msg("detector %d, pulse %u: %.3f mm off", detector, p, 1e3 * off_m);
                assert_true(abs(b->amplitude_cdb[p] - amplitude_cdb[p]) <= 2);
                assert_true(abs(b->refl_cdb[p] - refl_cdb[p]) <= 2);
                assert_true(abs(b->width_cns[p] - 400) <= 8); /* 4 ns, to 2 % */
                /* rounding: counts are 1 in 10,000; 4 mm of range are 0.016 of a pulse's sigma */
                assert_true(b->deviation[p] <= (detector == WAVEFORM_THRESHOLD ? 20 : 3));
            }
            close_waves(&w);
        }
}

/* The echoes of a pulse: how many, their surfaces and ranges. */
struct seen {
    uint32_t n, label[LINE_MAX_ECHOES];
    double range_m[LINE_MAX_ECHOES];
};

static void look(const struct line_block *b, struct seen seen[PULSES])
{
    uint32_t p = UINT32_MAX;
    for (uint32_t i = 0; i < b->n_points; i++) {
        const uint32_t number = b->echo[i] & 15;
        if (number <= 1) seen[++p].n = b->echo[i] >> 4;
        if (number == 0) continue;
        seen[p].label[number - 1] = b->label[i];
        seen[p].range_m[number - 1] = 1e-6 * b->a[i];
    }
    assert_int_equal(p, PULSES - 1);
}

/* An edge cuts footprints on two plates 40 m apart. Where each has 2 % of the light or more, or nothing, the echoes
 * are those of the closed forms. 2 % are 8 thresholds and more. Half a count is 1 % of these, and 1 % of a pulse's
 * sigma is 3 mm. (Below 1 % the model makes no echo, and below the threshold the detector finds none.) */
static void cut_footprints_have_two_echoes(void **state)
{
    (void)state;
    struct waves w = {.lit = {.near_m = 60.0, .far_m = 100.0, .rho = {0.8, 0.5}}};
    struct seen seen[2][PULSES];
    double d[3][PULSES];
    uint32_t several = 0;
    open_waves(&w, &ACROSS, BEAM_ADAPTIVE, ROOM);
    w.cast.detector = WAVEFORM_GAUSSIANS;
    for (uint32_t line = 0; line < ACROSS_LINES; line++) {
        beam_rig_directions(&w.lit.rig, line, d[0], d[1], d[2]);
        for (w.cast.finds = 0; w.cast.finds < 2; w.cast.finds++) {
            beam_rig_line(&w.lit.rig, line);
            look(&w.lit.rig.block, seen[w.cast.finds]);
        }
        for (uint32_t p = 0; p < PULSES; p++) {
            const struct edge e = at_edge(&w.lit, d[0][p], d[1][p]);
            const struct seen *a = &seen[0][p], *b = &seen[1][p];
            if (e.front > 0.0 && e.front < 1.0 && !(e.front > 0.02 && e.front < 0.98)) continue;
            assert_int_equal(a->n, b->n);
            several += a->n == 2;
            for (uint32_t i = 0; i < a->n; i++) {
                assert_int_equal(a->label[i], b->label[i]);
                assert_true(fabs(a->range_m[i] - b->range_m[i]) < 3e-3);
            }
        }
    }
    assert_true(several > 2 * PULSES);
    close_waves(&w);
}

/* Noise of three times the level makes echoes all over a window of 40 m. Echoes within the head's ranges are sent, at
 * most max_echoes a pulse. Echoes outside are counted. */
static void check_echoes_of_noise(const struct cast_disturbance *disturbance)
{
    static const struct beam_view SIDE = {0.0, 1.0, -40.0, -30.0, 1, PULSES};
    struct waveform_spec noisy = SPEC;
    noisy.noise = 3.0;
    noisy.near_m = 40.0;
    noisy.far_m = 80.0;
    struct waves w = {.lit = {.near_m = 20.0, .far_m = 200.0, .rho = {0.8, 0.5}}, .spec = &noisy};
    const struct line_block *b = &w.lit.rig.block;
    struct cast_counters before, after;
    open_waves(&w, &SIDE, BEAM_ADAPTIVE, ROOM);
    w.cast.finds = 1;
    w.cast.detector = WAVEFORM_THRESHOLD;
    w.lit.rig.setup.disturbance = disturbance;
    for (uint32_t most = 1; most <= LINE_MAX_ECHOES; most += LINE_MAX_ECHOES - 1) {
        uint32_t echoes = 0;
        w.lit.rig.setup.range_min_m = 50.0;
        w.lit.rig.setup.range_max_m = 52.0; /* 13 samples, of which a third is above the level */
        w.lit.rig.setup.max_echoes = most;
        caster_get_counters(w.lit.rig.caster, &before);
        beam_rig_line(&w.lit.rig, 0);
        caster_get_counters(w.lit.rig.caster, &after);
        for (uint32_t i = 0; i < b->n_points; i++) {
            if (b->echo[i] == 0) continue; /* a shot without echo */
            echoes++;
            assert_true((b->echo[i] >> 4) <= most);
            assert_true(b->a[i] >= 50000000 && b->a[i] <= 52000000); /* micrometres */
        }
        assert_true(echoes > 0);
        assert_true(after.faint - before.faint > 2 * PULSES);
    }
    close_waves(&w);
}

/* The receiver has its noise whether the laser fires or not. */
static void found_echoes_are_in_range(void **state)
{
    (void)state;
    const struct cast_disturbance dark = {.dark = 1, .share = 1.0};
    check_echoes_of_noise(NULL);
    check_echoes_of_noise(&dark);
}

/* A laser that does not fire gives no window. */
static void dark_pulses_have_no_windows(void **state)
{
    (void)state;
    static const struct beam_view SIDE = {0.0, 1.0, -40.0, -10.0, 1, PULSES};
    const struct cast_disturbance dark = {.dark = 1, .share = 1.0};
    struct waves w = {.lit = {.near_m = 20.0, .far_m = 200.0, .rho = {0.8, 0.5}}};
    open_waves(&w, &SIDE, BEAM_SINGLE, ROOM);
    w.lit.rig.setup.disturbance = &dark;
    beam_rig_line(&w.lit.rig, 0);
    assert_int_equal(w.lit.rig.block.waves->n, 0);
    close_waves(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(energy_is_the_link_budget),      cmocka_unit_test(closed_form_agrees_with_sub_rays),
        cmocka_unit_test(windows_belong_to_points),       cmocka_unit_test(points_stay_as_they_are),
        cmocka_unit_test(lost_samples_are_counted),       cmocka_unit_test(echoes_are_found_in_samples),
        cmocka_unit_test(cut_footprints_have_two_echoes), cmocka_unit_test(dark_pulses_have_no_windows),
        cmocka_unit_test(found_echoes_are_in_range),      cmocka_unit_test(beams_bend_with_the_earth),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
