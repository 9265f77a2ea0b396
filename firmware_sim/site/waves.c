/* SPDX-License-Identifier: MIT */
#include "firmware_sim/site/waves.h"
#include "firmware_sim/site/site.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "core/csv.h"
#include "core/light.h"
#include "core/plan/cost.h"
#include "drivers/protocol/native_waves.h"
#include "firmware_sim/config/config.h"

/* ---- the outgoing pulse as a table */

struct pulse_table {
    double power[WAVEFORM_MAX_TABLE];
    uint32_t n;
    double t0_ns, step_ns;
};

/* Takes a line of the file. Times rise by one step, up to the rounding of decimals. */
static int take_power(struct pulse_table *table, const struct csv *csv, const char *path, struct sh_err *err)
{
    const double t_ns = csv->value[0], power = csv->value[1];
    const unsigned long long line = csv->line;
    if (table->n == WAVEFORM_MAX_TABLE)
        return sh_fail(err, SH_EINPUT, "%s:%llu: too many lines; allowed are up to %d", path, line, WAVEFORM_MAX_TABLE);
    if (!(power >= 0.0))
        return sh_fail(err, SH_EINPUT, "%s:%llu: a power of %.10g; allowed is 0 or more", path, line, power);
    if (table->n == 0) table->t0_ns = t_ns;
    if (table->n == 1 && !(t_ns > table->t0_ns))
        return sh_fail(err, SH_EINPUT, "%s:%llu: t_ns is %.10g; allowed is more than %.10g", path, line, t_ns,
                       table->t0_ns);
    if (table->n == 1) table->step_ns = t_ns - table->t0_ns;
    const double want_ns = table->t0_ns + table->n * table->step_ns;
    if (table->n > 1 && !(fabs(t_ns - want_ns) <= 0.01 * table->step_ns))
        return sh_fail(err, SH_EINPUT, "%s:%llu: t_ns is %.10g; allowed are times that rise by one step, here %.10g",
                       path, line, t_ns, want_ns);
    table->power[table->n++] = power;
    return SH_OK;
}

static int read_pulse(const char *path, const struct sh_report *report, struct pulse_table *table, struct sh_err *err)
{
    static const char *const known[] = {"t_ns", "power", NULL};
    struct csv csv;
    int rc = csv_open(&csv, path, known, report, err), got = 0;
    if (rc == SH_OK && csv.has != 3)
        rc = sh_fail(err, SH_EINPUT, "%s: a column is missing; required are t_ns and power", path);
    while (rc == SH_OK && (got = csv_next(&csv, err)) > 0)
        rc = take_power(table, &csv, path, err);
    csv_close(&csv);
    if (rc == SH_OK) rc = got;
    if (rc == SH_OK && table->n < 3)
        rc = sh_fail(err, SH_EINPUT, "%s: %u lines; allowed are 3 to %d", path, table->n, WAVEFORM_MAX_TABLE);
    return rc;
}

/* ---- the digitiser */

static double ratio_of(double db)
{
    return pow(10.0, 0.1 * db);
}

/* A quotient by 1e9 is rounded once. So a key at its limit in ns is exactly at the limit in s of core/waveform.h. */
static void fill_spec(const struct config *cfg, const struct pulse_table *table, struct waveform_spec *spec)
{
    const struct config_waveform *w = &cfg->waveform;
    *spec = (struct waveform_spec){.shape = w->pulse,
                                   .width_s = cfg->profile.pulse_width_ns / 1e9,
                                   .skew = w->skew,
                                   .table = table->power,
                                   .n_table = table->n,
                                   .table_step_s = table->step_ns / 1e9,
                                   .bandwidth_hz = 1e6 * w->bandwidth_mhz,
                                   .sample_s = w->sample_ns / 1e9,
                                   .bits = w->bits,
                                   .baseline_counts = w->baseline_counts,
                                   .full_scale = ratio_of(w->full_scale_db),
                                   .saturation = w->saturation_db > 0.0 ? ratio_of(w->saturation_db) : 0.0,
                                   .dead_s = w->dead_ns / 1e9,
                                   .noise = cfg->signal.sharp ? 0.0 : 1.0 / cfg->profile.threshold_snr,
                                   .keep = ratio_of(w->keep_db),
                                   .before_s = w->before_ns / 1e9,
                                   .after_s = w->after_ns / 1e9,
                                   .near_m = w->near_m,
                                   .far_m = w->far_m,
                                   .seed = cfg->noise.seed};
}

/* Returns the signal of one count, in detection thresholds. */
static double count_signal(const struct waveform_spec *spec)
{
    return spec->full_scale / (ldexp(1.0, (int)spec->bits) - 1.0 - spec->baseline_counts);
}

static void warn_digits(const struct config *cfg, const struct waveform_spec *spec, const struct sh_report *report)
{
    const double count = count_signal(spec);
    if (count <= 1.0) return;
    sh_warn(
        report,
        "%s: waveform.full_scale_db: a count of the samples is %.3g times the detection threshold, so they don't show "
        "weak echoes; with %u bits a full scale up to %.3g dB does",
        cfg->file, count, spec->bits, 0.1 * floor(100.0 * log10(spec->full_scale / count)));
}

/* The least level, in sigma of the noise. A sample of noise alone reaches 5 sigma once in 3.5 million times. */
#define LEAST_SNR 5.0

/* Returns the receiver's bandwidth, to 10 %, with which the pulse's peak is `least` of the outgoing one; 0: the
 * sampling allows none. */
static double bandwidth_of(const struct waveform_spec *spec, double least)
{
    struct waveform_spec wide = *spec;
    struct sh_err none;
    double peak = 0.0;
    while (peak < least) {
        struct waveform *w;
        wide.bandwidth_hz *= 1.1;
        if (waveform_create(&wide, &w, &none) != SH_OK) return 0.0;
        peak = waveform_pulse_peak(w);
        waveform_free(w);
    }
    return wide.bandwidth_hz;
}

/* The level falls with the pulse's peak, the noise does not. */
static void warn_noise(const struct config *cfg, const struct waveform *waveform, const struct sh_report *report)
{
    const struct waveform_spec *spec = waveform_spec_of(waveform);
    const double peak = waveform_pulse_peak(waveform), least = LEAST_SNR * spec->noise;
    char advice[128] = "";
    if (peak >= least) return;
    const double enough_hz = spec->bandwidth_hz > 0.0 && least < 1.0 ? bandwidth_of(spec, least) : 0.0;
    if (enough_hz > 0.0)
        snprintf(advice, sizeof advice, "; waveform.bandwidth_mhz=%.0f is enough", ceil(1e-6 * enough_hz));
    sh_warn(report,
            "%s: waveform.echoes: the level of an echo is %.2g times the noise (threshold_snr %.3g, times %.2g, the "
            "peak of a pulse after the receiver): many echoes are of noise alone; at %g times or more, few are%s",
            cfg->file, peak / spec->noise, 1.0 / spec->noise, peak, LEAST_SNR, advice);
}

/* Echoes are found in windows of samples only, and these lie where the signal reaches keep_db. */
static void warn_windows(const struct config *cfg, const struct waveform *waveform, const struct sh_report *report)
{
    const struct waveform_spec *spec = waveform_spec_of(waveform);
    const double peak = 1.001 * waveform_pulse_peak(waveform); /* the digits of a level in dB */
    if (spec->near_m < spec->far_m || spec->keep <= peak) return;
    sh_warn(report,
            "%s: waveform.keep_db: samples are kept from %.3g dB above the level of an echo on, so weaker echoes are "
            "not found; at %.3g dB or less, all are",
            cfg->file, 10.0 * log10(spec->keep / peak), 0.1 * floor(100.0 * log10(peak)));
}

/* No light from beyond the profile's ranges is in the samples. */
static void warn_gate(const struct config *cfg, const struct sh_report *report)
{
    const struct config_waveform *w = &cfg->waveform;
    const struct config_profile *p = &cfg->profile;
    if (!(w->near_m < w->far_m) || (w->near_m < p->range_max_m && w->far_m > p->range_min_m)) return;
    sh_warn(report,
            "%s: waveform.near_m: the window from %.10g to %.10g m has no light; the ranges of head profile %s are "
            "%.10g to %.10g m",
            cfg->file, w->near_m, w->far_m, p->name, p->range_min_m, p->range_max_m);
}

/* Returns the full width at half maximum of the table, ns. Where the table begins or ends above half, the pulse does. */
static double width_of(const struct pulse_table *table)
{
    uint32_t top = 0;
    for (uint32_t i = 1; i < table->n; i++)
        if (table->power[i] > table->power[top]) top = i;
    const double half = 0.5 * table->power[top];
    uint32_t a = top, b = top;
    while (a > 0 && table->power[a] > half)
        a--;
    while (b + 1 < table->n && table->power[b] > half)
        b++;
    const double at_a = table->power[a], at_b = table->power[b];
    const double before = at_a < half ? (half - at_a) / (table->power[a + 1] - at_a) : 0.0;
    const double after = at_b < half ? (half - at_b) / (table->power[b - 1] - at_b) : 0.0;
    return (b - a - before - after) * table->step_ns;
}

/* Points that are not found in the samples are those of a pulse as wide as the profile's. */
static void warn_width(const struct config *cfg, const struct pulse_table *table, const struct sh_report *report)
{
    const double width_ns = width_of(table), want_ns = cfg->profile.pulse_width_ns;
    if (cfg->waveform.echoes != WAVE_ECHOES_MODEL || fabs(width_ns - want_ns) <= 0.1 * want_ns) return;
    sh_warn(report,
            "%s: waveform.pulse_file: the pulse is %.3g ns wide, but points are those of a pulse of %.3g ns "
            "(pulse_width_ns of head profile %s): they differ from the samples; with waveform.echoes they are found in "
            "them",
            cfg->file, width_ns, want_ns, cfg->profile.name);
}

static int make_waveform(const struct site *site, const struct sh_report *report, struct waveform **out,
                         struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    struct pulse_table table = {.n = 0};
    struct waveform_spec spec;
    struct sh_err why;
    int rc = cfg->waveform.pulse == WAVEFORM_TABLE ? read_pulse(cfg->waveform.pulse_file, report, &table, err) : SH_OK;
    if (rc != SH_OK) return rc;
    fill_spec(cfg, &table, &spec);
    rc = waveform_create(&spec, out, &why);
    if (rc != SH_OK) /* Keys are within their limits: the pulse does not fit the sampling. */
        return sh_fail(err, rc, "%s: waveform.%s: %.300s", cfg->file,
                       cfg->waveform.pulse == WAVEFORM_TABLE ? "pulse_file" : "sample_ns", why.text);
    if (cfg->waveform.echoes != WAVE_ECHOES_MODEL) rc = waveform_check_detection(*out, &why);
    if (rc != SH_OK) return sh_fail(err, rc, "%s: waveform.echoes: %.300s", cfg->file, why.text);
    warn_digits(cfg, &spec, report);
    warn_gate(cfg, report);
    if (cfg->waveform.pulse == WAVEFORM_TABLE) warn_width(cfg, &table, report);
    if (cfg->waveform.echoes == WAVE_ECHOES_MODEL) return SH_OK;
    warn_noise(cfg, *out, report);
    warn_windows(cfg, *out, report);
    return SH_OK;
}

/* ---- what a usual pulse makes */

static const double USUAL_SIGNAL = 100.0;
/* Queues hold 0.3 s and more of the stream, which must fit into memory. */
static const double MOST_BYTES_S = 4e8;

/* Returns the windows and samples of a return from a surface that is hit at a right angle. Eight places between two
 * samples are tried, and the largest counts are taken. */
static struct site_wave_room sample_return(const struct waveform *waveform, double amplitude)
{
    enum { PLACES = 8 };
    const double sample_m = 0.5 * LIGHT_SPEED_M_S * waveform_spec_of(waveform)->sample_s;
    uint16_t sample[2 * WAVEFORM_MAX_SAMPLES];
    struct site_wave_room most = {0, 0};
    for (int i = 0; i < PLACES; i++) {
        /* Nothing of the window lies before the emission. */
        const struct waveform_return one = {.range_m = (2 * WAVEFORM_MAX_SAMPLES + (double)i / PLACES) * sample_m,
                                            .amplitude = amplitude};
        struct waveform_record record = {.sample = sample, .capacity = 2 * WAVEFORM_MAX_SAMPLES};
        waveform_sample(waveform, 0, 0, &one, 1, &record);
        if (record.n_windows > most.windows) most.windows = record.n_windows;
        if (record.n_samples > most.samples) most.samples = record.n_samples;
    }
    return most;
}

/* Where the usual signal does not reach keep_db, it is doubled until it does. */
static struct site_wave_room find_usual(const struct waveform *waveform)
{
    struct site_wave_room usual = {0, 0};
    for (double amplitude = USUAL_SIGNAL; usual.windows == 0; amplitude *= 2.0)
        usual = sample_return(waveform, amplitude);
    return usual;
}

double site_wave_bytes_s(const struct site *site)
{
    const struct site_wave_room one = site_usual_waves(site, 1);
    if (one.windows == 0) return 0.0;
    return config_cast_hz(site->cfg) * one.windows * (double)native_wave_len((one.samples - 1) / one.windows + 1);
}

static int check_rate(const struct site *site, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    const double rate_bytes = site_wave_bytes_s(site);
    if (rate_bytes <= MOST_BYTES_S) return SH_OK;
    return sh_fail(err, SH_EINPUT,
                   "%s: %s: windows of %u samples for %.10g pulses/s are %.4g MB/s; allowed up to %.4g MB/s", cfg->file,
                   cfg->waveform.near_m < cfg->waveform.far_m ? "waveform.far_m" : "waveform.after_ns",
                   site->waves->usual.samples, config_cast_hz(cfg), 1e-6 * rate_bytes, 1e-6 * MOST_BYTES_S);
}

static const enum waveform_detector detectors[] = {[WAVE_ECHOES_THRESHOLD] = WAVEFORM_THRESHOLD,
                                                   [WAVE_ECHOES_FRACTION] = WAVEFORM_FRACTION,
                                                   [WAVE_ECHOES_GAUSSIANS] = WAVEFORM_GAUSSIANS};

int site_set_up_waves(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    const struct config_profile *p = &cfg->profile;
    if (!config_has_waves(cfg)) return SH_OK;
    struct site_waves *w = site->waves = calloc(1, sizeof *w);
    if (w == NULL) return sh_fail(err, SH_ENOMEM, "no memory for waveforms");
    beam_init(&w->beam, p->beam_exit_m, p->beam_divergence_rad, 1e-9 * p->pulse_width_ns);
    w->cast.beam = &w->beam;
    w->cast.finds = cfg->waveform.echoes != WAVE_ECHOES_MODEL;
    w->cast.detector = detectors[w->cast.finds ? cfg->waveform.echoes : WAVE_ECHOES_THRESHOLD];
    int rc = make_waveform(site, report, &w->waveform, err);
    w->cast.waveform = w->waveform;
    if (rc == SH_OK) w->usual = find_usual(w->waveform);
    return rc == SH_OK ? check_rate(site, err) : rc;
}

void site_free_waves(struct site *site)
{
    if (site->waves == NULL) return;
    waveform_free(site->waves->waveform);
    free(site->waves);
}

/* ---- room */

/* A block has room for up to this many windows a pulse, on average, and for this many samples. So 32 bits can count its
 * bytes. At 10 MHz and 100 ticks a second there is room for 9000 samples a pulse. */
enum { MOST_WINDOWS = 4, MOST_SAMPLES = 1 << 30 };

struct site_wave_room site_wave_room(const struct site *site, uint32_t n_pulses)
{
    const struct config *cfg = site->cfg;
    if (cfg->head.settings.waves == 0) return (struct site_wave_room){0, 0};
    const int gate = cfg->waveform.near_m < cfg->waveform.far_m;
    const struct site_wave_room one = site->waves->usual;
    const uint32_t points = site_most_points_per_pulse(site);
    uint32_t each = gate ? 1 : points < MOST_WINDOWS ? points : MOST_WINDOWS;
    while (each > 1 && (uint64_t)n_pulses * each * one.samples > MOST_SAMPLES)
        each--;
    return (struct site_wave_room){n_pulses * each * one.windows + WAVEFORM_MAX_WINDOWS,
                                   n_pulses * each * one.samples + 2 * WAVEFORM_MAX_SAMPLES};
}

struct site_wave_room site_usual_waves(const struct site *site, uint32_t n_pulses)
{
    if (site->cfg->head.settings.waves == 0) return (struct site_wave_room){0, 0};
    const struct site_wave_room one = site->waves->usual;
    return (struct site_wave_room){n_pulses * one.windows, n_pulses * one.samples};
}

static void describe_digitiser(const struct waveform_spec *spec, struct line_waves *waves)
{
    waves->sample_ps = (uint32_t)lrint(1e12 * spec->sample_s);
    waves->baseline_16 = (uint16_t)lrint(16.0 * spec->baseline_counts);
    waves->bits = (uint8_t)spec->bits;
    waves->count_signal = (float)count_signal(spec);
}

int site_make_block(const struct site *site, uint32_t n_pulses, uint32_t n_points, struct caster *caster,
                    struct line_block *block, struct sh_err *err)
{
    const struct site_wave_room room = site_wave_room(site, n_pulses);
    int rc = line_block_alloc(block, n_points, err);
    if (rc == SH_OK && site->cfg->output.attributes) rc = line_block_alloc_attributes(block, err);
    if (rc == SH_OK && site->cfg->output.colour != COLOUR_NONE) rc = line_block_alloc_colours(block, err);
    if (rc != SH_OK || site->waves == NULL) return rc;
    rc = caster_add_waves(caster, err);
    if (rc == SH_OK && room.windows != 0) rc = line_block_alloc_waves(block, room.windows, room.samples, err);
    if (rc == SH_OK && room.windows != 0) describe_digitiser(waveform_spec_of(site->waves->waveform), block->waves);
    if (rc == SH_OK && site->waves->cast.finds && block->width_cns != NULL)
        rc = line_block_alloc_deviations(block, err);
    return rc;
}

/* ---- the plan */

static double find_ns(const struct site *site)
{
    if (!site->waves->cast.finds) return 0.0;
    return site->waves->cast.detector == WAVEFORM_GAUSSIANS ? PLAN_COST_GAUSSIANS : PLAN_COST_FLANK;
}

double site_wave_ns(const struct site *site)
{
    if (site->waves == NULL) return 0.0;
    return PLAN_COST_WAVE + site->waves->usual.samples * PLAN_COST_WAVE_SAMPLE + find_ns(site);
}

void site_wave_row(const struct site *site, struct plan_row *row)
{
    const struct config *cfg = site->cfg;
    char why[sizeof row->why];
    if (site->waves == NULL) {
        plan_say(row, "waveform", "none", 0.0, 0.0, "waveform.send is off, and waveform.echoes is model");
        return;
    }
    const enum beam_mode beam = site->plan.methods.beam;
    size_t used = (size_t)snprintf(why, sizeof why, "%u samples for a usual pulse", site->waves->usual.samples);
    if (cfg->head.settings.waves != 0)
        used += (size_t)snprintf(why + used, sizeof why - used, ", %.3g MB/s", 1e-6 * site_wave_bytes_s(site));
    if (site->waves->cast.finds)
        used += (size_t)snprintf(why + used, sizeof why - used,
                                 "; echoes are found in them, with the noise of the samples");
    if (beam == BEAM_SINGLE) snprintf(why + used, sizeof why - used, "; single rays: an edge has no second return");
    const double error_m = site->waves->cast.finds ? (double)NAN /* the detector's errors of range are not known here */
                           : beam == BEAM_SINGLE   ? site->plan.beam.error_m
                                                   : 0.0;
    plan_say(row, "waveform", beam == BEAM_RINGS ? "sub-rays" : "closed form", error_m, site_wave_ns(site), why);
}
