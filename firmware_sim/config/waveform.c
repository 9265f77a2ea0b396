/* SPDX-License-Identifier: MIT */
/* Full waveforms: checks that concern more than one key, and steps and gaps that a key's row can't have. The limits of
 * the digitiser and of the pulse are checked in core/waveform, and the stream's rate in firmware_sim/site. */
#include <math.h>

#include "core/digits.h"
#include "core/light.h"
#include "drivers/protocol/protocol.h"
#include "firmware_sim/config/check_signal.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/table/given.h"

/* Checks keys that only one shape of the pulse has. */
static void check_pulse(struct cfg_reader *rd, const struct config *cfg)
{
    const struct config_waveform *w = &cfg->waveform;
    const int has_file = w->pulse_file[0] != '\0';
    if (!CFG_SOUND(rd, "waveform.pulse", "waveform.pulse_file")) return;
    if (w->pulse == WAVEFORM_TABLE && !has_file)
        cfg_fail_key(rd, "waveform.pulse", "table, but there is no pulse_file; required is waveform.pulse_file");
    else if (w->pulse != WAVEFORM_TABLE && has_file)
        cfg_fail_key(rd, "waveform.pulse_file", "a file, but waveform.pulse is %s; allowed with pulse: table",
                     cfg_word(rd, "waveform.pulse", (int)w->pulse));
    else if (w->pulse != WAVEFORM_ASYMMETRIC && cfg_is_given(rd, "waveform.skew"))
        cfg_fail_key(rd, "waveform.skew", "a skew, but waveform.pulse is %s; allowed with pulse: asymmetric",
                     cfg_word(rd, "waveform.pulse", (int)w->pulse));
}

static void check_digits(struct cfg_reader *rd, const struct config_waveform *w)
{
    const double ps = 1e3 * w->sample_ns, steps = 16.0 * w->baseline_counts;
    const double most_counts = 0.5 * (ldexp(1.0, (int)w->bits) - 1.0);
    if (fabs(ps - rint(ps)) > 1e-6)
        cfg_fail_key(rd, "waveform.sample_ns", "%.10g is no whole number of ps; allowed 0.05 to 100 in steps of 0.001",
                     w->sample_ns);
    if (CFG_SOUND(rd, "waveform.bits", "waveform.baseline_counts") &&
        (steps != floor(steps) || w->baseline_counts > most_counts))
        cfg_fail_key(rd, "waveform.baseline_counts",
                     "%.10g with %u bits; allowed 0 to %.10g, half of the largest count, in steps of 1/16",
                     w->baseline_counts, w->bits, most_counts);
    if (w->bandwidth_mhz > 0.0 && w->bandwidth_mhz < 1.0)
        cfg_fail_key(rd, "waveform.bandwidth_mhz", "%.10g MHz; allowed 1 to 100000, or 0 for no limit",
                     w->bandwidth_mhz);
    if (w->dead_ns > 0.0 && w->saturation_db == 0.0 && CFG_SOUND(rd, "waveform.saturation_db"))
        cfg_fail_key(rd, "waveform.dead_ns",
                     "a dead time, but saturation_db is 0: nothing saturates; allowed with saturation_db above 0");
}

/* Checks windows around returns, with the limit of core/waveform. */
static void check_margins(struct cfg_reader *rd, const struct config_waveform *w)
{
    const double most_ns = 0.5 * WAVEFORM_MAX_SAMPLES * w->sample_ns;
    if (w->before_ns + w->after_ns <= most_ns) return;
    cfg_fail_key(rd, cfg_is_given(rd, "waveform.after_ns") ? "waveform.after_ns" : "waveform.before_ns",
                 "%.10g ns before an echo and %.10g ns after it; allowed together up to %.10g, %d samples",
                 w->before_ns, w->after_ns, most_ns, WAVEFORM_MAX_SAMPLES / 2);
}

/* Checks the window that each pulse has with far_m. */
static void check_gate(struct cfg_reader *rd, const struct config_waveform *w)
{
    const double sample_m = 0.5e-9 * LIGHT_SPEED_M_S * w->sample_ns, long_m = w->far_m - w->near_m;
    const double most_m = (WAVEFORM_MAX_SAMPLES - 1) * sample_m;
    if (long_m >= sample_m && long_m <= most_m) return;
    cfg_fail_key(rd, "waveform.far_m",
                 "a window from %.10g to %.10g m; allowed are %.4g to %.6g m of length, 1 to %d samples", w->near_m,
                 w->far_m, digits_up(sample_m, 4), digits_down(most_m, 6), WAVEFORM_MAX_SAMPLES - 1);
}

static void check_windows(struct cfg_reader *rd, const struct config *cfg)
{
    const struct config_waveform *w = &cfg->waveform;
    if (!CFG_SOUND(rd, "waveform.near_m", "waveform.far_m", "waveform.before_ns", "waveform.after_ns",
                   "waveform.sample_ns"))
        return;
    if (w->near_m < w->far_m)
        check_gate(rd, w);
    else if (w->near_m == 0.0 && w->far_m == 0.0)
        check_margins(rd, w);
    else
        cfg_fail_key(rd, cfg_is_given(rd, "waveform.far_m") ? "waveform.far_m" : "waveform.near_m",
                     "a window from %.10g to %.10g m; allowed a far_m above %.10g, or 0 for both", w->near_m, w->far_m,
                     w->near_m);
}

static void check_waveform_links(struct cfg_reader *rd, const struct config *cfg)
{
    if (cfg->head.settings.waves == 0 || cfg->n_links == 0 || config_speaks(cfg, PROTOCOL_NATIVE)) return;
    if (CFG_SOUND(rd, "links"))
        cfg_fail_key(rd, "waveform.send",
                     "on, but no link has the protocol native, which alone has waveforms; allowed with such a link, or "
                     "without links");
}

void cfg_check_waveform(struct cfg_reader *rd, const struct config *cfg)
{
    const struct config_waveform *w = &cfg->waveform;
    const int finds = w->echoes != WAVE_ECHOES_MODEL;
    const char *key = cfg->head.settings.waves != 0 ? "waveform.send" : "waveform.echoes";
    check_pulse(rd, cfg);
    check_digits(rd, w);
    if (!config_has_waves(cfg)) return;
    check_windows(rd, cfg);
    check_waveform_links(rd, cfg);
    if (!cfg->signal.on && CFG_SOUND(rd, "signal.model"))
        cfg_fail_key(rd, key, "%s, but no signal is modelled; required is signal.model: on",
                     finds && cfg->head.settings.waves == 0 ? cfg_word(rd, key, (int)w->echoes) : "on");
    if (w->pulse != WAVEFORM_TABLE && cfg_has_profile(rd) && !(cfg->profile.pulse_width_ns >= 0.01))
        cfg_fail_key(rd, key,
                     "pulse_width_ns of head profile %s is %.10g; required is 0.01 or more, or waveform.pulse: table",
                     cfg->profile.name, cfg->profile.pulse_width_ns);
    if (finds && cfg->noise.range != RANGE_NOISE_OFF && CFG_SOUND(rd, "waveform.echoes"))
        cfg_fail_key(rd, "noise.range",
                     "%s, but echoes are found in samples, which have noise already (waveform.echoes); allowed off",
                     cfg_word(rd, "noise.range", (int)cfg->noise.range));
}
