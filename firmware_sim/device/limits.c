/* SPDX-License-Identifier: MIT */
/* The limits of settings that commands change. */
#include "firmware_sim/device/limits.h"

#include <math.h>

#include "firmware_sim/config/config.h"
#include "firmware_sim/site/site.h"

static int64_t to_nm(double m)
{
    return llround(1e9 * m);
}

/* Whether commands may only narrow the ranges of power-up. Methods that were chosen by trying them on the scene, and
 * the outlines of an adaptive beam, hold only for these ranges. */
static int was_tried(const struct site *site)
{
    const struct config *cfg = site->cfg;
    const int beam = config_has_footprint(cfg) && (cfg->beam.mode == BEAM_AUTO || cfg->beam.mode == BEAM_ADAPTIVE);
    return beam || (site->detect.surfaces.has_optics && !cfg->optics.depth_given);
}

/* Sets the limits for commands that set ranges: within the profile, and with some range left at each pulse rate. */
static void set_range_limits(const struct site *site, struct head_limits *l)
{
    const struct config *cfg = site->cfg;
    const struct config_profile *p = &cfg->profile;
    double near_most_m = INFINITY, far_least_m = 0.0;
    for (uint32_t i = 0; i < (p->n_programs > 0 ? p->n_programs : 1); i++) {
        near_most_m = fmin(near_most_m, p->program[i].own_max_m);
        far_least_m = fmax(far_least_m, p->program[i].own_min_m);
    }
    const int tried = was_tried(site);
    l->range_min_nm = tried ? cfg->head.settings.range_min_nm : to_nm(cfg->head.profile_min_m);
    l->range_max_nm = tried ? cfg->head.settings.range_max_nm : to_nm(cfg->head.profile_max_m);
    l->near_most_nm = to_nm(near_most_m) - 1;
    l->far_least_nm = to_nm(far_least_m) + 1;
}

static void set_noise_limits(const struct config *cfg, struct head_limits *l)
{
    static const double BALL_MOST_M = 100.0; /* as noise.ball.radius_m */
    const int may_move = cfg->platform.kind == PLATFORM_STATIC || cfg->noise.ball.local;
    const int finds = cfg->waveform.echoes != WAVE_ECHOES_MODEL; /* then noise is that of samples */
    l->noise_most = finds ? RANGE_NOISE_OFF : cfg->signal.on ? RANGE_NOISE_SIGNAL : RANGE_NOISE_ON;
    l->angle_most = cfg->profile.mirror_sigma_deg > 0.0 || cfg->profile.pan_sigma_deg > 0.0;
    l->sigma_min_nm = cfg->signal.on ? to_nm(cfg->profile.range_sigma_floor_m) : 0;
    l->ball_max_nm = may_move ? to_nm(BALL_MOST_M) : 0;
}

static void set_pattern(const struct config *cfg, struct head_limits *l)
{
    const struct config_profile *p = &cfg->profile;
    l->emitter = p->emitter.kind;
    l->line_pulses = emitter_line_pulses(&p->emitter);
    l->round = p->emitter.kind == EMITTER_SPHERE;
    l->step_fixed = config_head_moves(&cfg->platform);
    for (uint32_t i = 0; i < p->arrangement.n_geometries; i++) {
        const struct config_geometry *g = &p->arrangement.geometry[i];
        if (l->step_fixed && g->steps_per_turn != p->emitter.steps) continue;
        l->geometry[l->n_geometries++] = (struct head_geometry){g->lines_uhz, g->steps_per_turn};
    }
    l->phase_lock_most = l->emitter == EMITTER_BEAMS;
    l->waves_most = cfg->head.settings.waves;
    l->sweep_udeg = l->emitter == EMITTER_LINE ? llround(360e6 * p->optical_gain / p->facets) : 0;
    l->sequence_ps = p->arrangement.firing_fs / 1000;
}

void device_set_limits(const struct site *site, struct head_limits *l)
{
    const struct config *cfg = site->cfg;
    const struct config_profile *p = &cfg->profile;
    *l = (struct head_limits){.prr_min_uhz = p->prr_min_uhz,
                              .prr_max_uhz = p->prr_max_uhz,
                              .lines_min_uhz = p->lines_min_uhz,
                              .lines_max_uhz = p->lines_max_uhz,
                              .pan_max_udeg_s = p->pan_max_udeg_s,
                              .fov_min_udeg = p->fov_min_udeg,
                              .fov_max_udeg = p->fov_max_udeg,
                              .pan_min_udeg = p->pan_min_udeg,
                              .pan_max_udeg = p->pan_max_udeg,
                              .n_rates = p->n_programs,
                              .n_stations = site->n_stations};
    set_pattern(cfg, l);
    set_range_limits(site, l);
    set_noise_limits(cfg, l);
    for (uint32_t i = 0; i < p->n_programs; i++)
        l->rate_uhz[i] = p->program[i].prr_uhz;
    for (uint32_t i = 0; i < site->n_stations && i < 64; i++)
        if (!config_serves(cfg, i)) l->elsewhere |= (uint64_t)1 << i;
}
