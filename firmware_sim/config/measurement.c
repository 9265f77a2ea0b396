/* SPDX-License-Identifier: MIT */
/* Noise, signal and surfaces: checks that concern more than one key. */
#include "firmware_sim/config/check_signal.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/table/given.h"

#include <math.h>

void config_signal_spec(const struct config_profile *p, const struct config_program *program,
                        struct detect_signal_spec *spec)
{
    *spec = (struct detect_signal_spec){.n_reaches = program->n_reaches,
                                        .threshold_snr = p->threshold_snr,
                                        .overlap_m = p->overlap_m,
                                        .sigma_m = p->range_sigma_m,
                                        .sigma_at_m = p->range_sigma_at_m,
                                        .sigma_reflectance = p->range_sigma_reflectance,
                                        .sigma_floor_m = p->range_sigma_floor_m,
                                        .sigma_ppm = p->range_sigma_ppm};
    for (uint32_t i = 0; i < program->n_reaches; i++)
        spec->reach[i] = (struct detect_reach){program->reach[i].reflectance, program->reach[i].range_m};
}

/* Checks that some attenuation by air explains a program's reaches. The diagnostic names the key that has them. */
static void check_signal_of(struct cfg_reader *rd, const struct config_profile *profile, uint32_t program,
                            const char *key)
{
    struct detect_signal_spec spec;
    struct detect_signal signal;
    struct sh_err why;
    config_signal_spec(profile, &profile->program[program], &spec);
    if (detect_signal_set_up(&spec, &signal, &why) != SH_OK)
        cfg_fail_item(rd, key, program,
                      "%.200s; allowed ranges that rise with the reflectance, and not faster than its square root",
                      why.text);
}

void cfg_check_reaches(struct cfg_reader *rd, struct config_profile *profile)
{
    const uint32_t n = profile->n_programs;
    if (!CFG_SOUND(rd, "reaches", "range_max_m", "range_sigma_m", "range_sigma_at_m", "range_sigma_reflectance",
                   "range_sigma_floor_m", "range_sigma_ppm", "threshold_snr", "overlap_m"))
        return;
    for (uint32_t i = 0; i < (n > 0 ? n : 1); i++)
        if (n == 0 || profile->program[i].reach_90_m == 0.0)
            check_signal_of(rd, profile, 0, "reaches");
        else if (CFG_ITEM_SOUND(rd, i, "programs[]"))
            check_signal_of(rd, profile, i, "programs[].reach_90_m");
}

/* Members that an entry does not give become NaN, except gloss, which becomes 100. */
static void mark_not_given(const struct cfg_reader *rd, uint32_t i, struct surface *s)
{
    const struct {
        const char *path;
        double *value;
    } figures[] = {{"surfaces[].reflectance", &s->reflectance},
                   {"surfaces[].specular", &s->specular},
                   {"surfaces[].gloss", &s->gloss},
                   {"surfaces[].retro", &s->retro},
                   {"surfaces[].glass", &s->glass},
                   {"surfaces[].mirror", &s->mirror}};
    for (size_t k = 0; k < sizeof figures / sizeof figures[0]; k++)
        if (!cfg_is_item_given(rd, figures[k].path, i)) *figures[k].value = (double)NAN;
    if (isnan(s->gloss)) s->gloss = 100.0;
}

static void check_surface(struct cfg_reader *rd, uint32_t i, const struct surface *s)
{
    double sum = s->reflectance + s->specular + s->glass + s->mirror;
    if (!CFG_ITEM_SOUND(rd, i, "surfaces[]")) return;
    if (s->glass > 0.0 && s->mirror > 0.0)
        cfg_fail_item(rd, "surfaces[].mirror", i, "glass and a mirror at once; allowed either glass or mirror");
    else if (sum > 1.0 + 1e-9)
        cfg_fail_item(rd, "surfaces[]", i, "reflectance, specular, glass and mirror add up to %.10g; allowed at most 1",
                      sum);
}

static void check_sigma(struct cfg_reader *rd, struct config *cfg)
{
    const double least_m = cfg->profile.range_sigma_floor_m;
    if (!cfg_has_profile(rd) || !CFG_SOUND(rd, "noise.sigma_m")) return;
    if (cfg->signal.on && cfg_is_given(rd, "noise.sigma_m") && cfg->noise.sigma_m < least_m)
        cfg_fail_key(rd, "noise.sigma_m",
                     "%.10g is below range_sigma_floor_m of head profile %s; allowed %.10g to 10 m", cfg->noise.sigma_m,
                     cfg->profile.name, least_m);
    cfg->profile.range_sigma_m = cfg->noise.sigma_m;
}

static void check_noise(struct cfg_reader *rd, struct config *cfg)
{
    check_sigma(rd, cfg);
    if (!cfg_is_given(rd, "noise.ball.seed")) cfg->noise.ball.seed = cfg->noise.seed;
    if (cfg->noise.range == RANGE_NOISE_SIGNAL && !cfg->signal.on && CFG_SOUND(rd, "signal.model"))
        cfg_fail_key(rd, "noise.range", "signal, but no signal is modelled; allowed with signal.model: on");
    if (cfg->noise.angle && cfg_has_profile(rd) && cfg->profile.mirror_sigma_deg == 0.0 &&
        cfg->profile.pan_sigma_deg == 0.0)
        cfg_fail_key(rd, "noise.angle",
                     "head profile %s gives no angle noise; required is mirror_sigma_deg or pan_sigma_deg there",
                     cfg->profile.name);
    if (cfg->noise.ball.radius_m > 0.0 && !cfg->noise.ball.local && cfg->platform.kind != PLATFORM_STATIC &&
        CFG_SOUND(rd, "noise.ball", "platform.kind"))
        cfg_fail_key(rd, cfg_is_given(rd, "noise.ball.axes") ? "noise.ball.axes" : "noise.ball.radius_m",
                     "axes of the scene on a platform that moves; allowed axes: beam");
}

void cfg_check_signal(struct cfg_reader *rd, struct config *cfg)
{
    check_noise(rd, cfg);
    cfg->signal.has_extinction = cfg_is_given(rd, "signal.extinction_1_km");
    if (cfg->signal.has_extinction && cfg_is_given(rd, "signal.visibility_m"))
        cfg_fail_key(rd, "signal.extinction_1_km", "given together with visibility_m; allowed one of them");
    for (uint32_t i = 0; i < cfg->n_surfaces; i++) {
        check_surface(rd, i, &cfg->surface[i].surface);
        mark_not_given(rd, i, &cfg->surface[i].surface);
    }
}
