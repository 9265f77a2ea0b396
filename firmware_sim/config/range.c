/* SPDX-License-Identifier: MIT */
/* head.range_min_m and head.range_max_m: the head's smallest and largest range, within its profile. This file also
 * turns ranges, noise and the step into settings, which commands may change, and back. */
#include "firmware_sim/config/check_head.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/table/given.h"
#include "firmware_sim/config/table/value.h"

#include <math.h>

static int check_one(struct cfg_reader *rd, const struct config *cfg, const char *path, double value_m)
{
    const double low_m = cfg->head.profile_min_m, high_m = cfg->head.profile_max_m;
    if (!CFG_SOUND(rd, path)) return 0;
    if (value_m >= low_m && value_m <= high_m) return 1;
    cfg_fail_key(rd, path, "%.10g is outside the limits of head profile %s; allowed %.10g to %.10g m", value_m,
                 cfg->profile.name, low_m, high_m);
    return 0;
}

/* Limits a program to the range of the head's keys. A program without any range left is refused: the head would see
 * nothing at that rate. */
static void limit_program(struct cfg_reader *rd, const struct config *cfg, struct config_program *program)
{
    const double least_m = program->range_min_m, most_m = program->range_max_m;
    program->range_min_m = fmax(program->range_min_m, cfg->head.range_min_m);
    program->range_max_m = fmin(program->range_max_m, cfg->head.range_max_m);
    if (program->range_min_m < program->range_max_m) return;
    const int is_min = cfg_is_given(rd, "head.range_min_m") && cfg->head.range_min_m >= most_m;
    cfg_fail_key(rd, is_min ? "head.range_min_m" : "head.range_max_m",
                 "%.10g excludes all of the %.10g to %.10g m that the head measures at %.15g Hz; allowed %s %.10g m",
                 is_min ? cfg->head.range_min_m : cfg->head.range_max_m, least_m, most_m, from_micro(program->prr_uhz),
                 is_min ? "below" : "above", is_min ? most_m : least_m);
}

void cfg_limit_range(struct cfg_reader *rd, struct config *cfg)
{
    struct config_profile *p = &cfg->profile;
    struct config_head *head = &cfg->head;
    if (!cfg_has_profile(rd)) return;
    head->profile_min_m = p->range_min_m;
    head->profile_max_m = p->range_max_m;
    for (uint32_t i = 0; i < HEAD_MAX_RATES; i++) {
        p->program[i].own_min_m = p->program[i].range_min_m;
        p->program[i].own_max_m = p->program[i].range_max_m;
    }
    const int min_fits = check_one(rd, cfg, "head.range_min_m", head->range_min_m);
    const int max_fits = check_one(rd, cfg, "head.range_max_m", head->range_max_m);
    if (!min_fits || !max_fits || !config_limits_range(cfg)) return;
    if (head->range_min_m >= head->range_max_m) {
        cfg_fail_key(
            rd, cfg_is_given(rd, "head.range_max_m") ? "head.range_max_m" : "head.range_min_m",
            "the head measures from %.10g to %.10g m; allowed a range_min_m below %.10g, or a range_max_m above %.10g",
            head->range_min_m, head->range_max_m, head->range_max_m, head->range_min_m);
        return;
    }
    for (uint32_t i = 0; i < (p->n_programs > 0 ? p->n_programs : 1); i++)
        limit_program(rd, cfg, &p->program[i]);
    p->range_min_m = head->range_min_m;
    p->range_max_m = head->range_max_m;
}

static int64_t to_nm(double m)
{
    return llround(1e9 * m);
}

void cfg_take_scan_settings(struct config *cfg)
{
    struct head_settings *s = &cfg->head.settings;
    s->range_min_nm = to_nm(cfg->head.range_min_m);
    s->range_max_nm = to_nm(cfg->head.range_max_m);
    s->noise = (uint32_t)cfg->noise.range;
    s->angle_noise = cfg->noise.angle != 0;
    s->sigma_nm = to_nm(cfg->noise.sigma_m);
    s->ball_nm = to_nm(cfg->noise.ball.radius_m);
    s->step_udeg = cfg->profile.emitter.kind == EMITTER_SPHERE ? cfg->profile.emitter.asked_udeg
                   : cfg->profile.arrangement.n_geometries > 0 ? head_step_udeg(cfg->profile.emitter.steps)
                                                               : 0;
}

/* Returns a length of the settings, in metres. Where it wasn't changed it is the configuration's, to the last bit. Else
 * it is the double that the configuration would have read: nm and 1e9 are below 2^53, so their quotient is the nearest
 * double. */
static double take_length(int64_t nm, int64_t own_nm, double own_m)
{
    return nm == own_nm ? own_m : (double)nm / 1e9;
}

int config_apply_settings(struct config *cfg, const struct head_settings *s, struct sh_err *err)
{
    struct config_profile *p = &cfg->profile;
    struct config_head *head = &cfg->head;
    const struct head_settings own = head->settings;
    head->range_min_m = take_length(s->range_min_nm, own.range_min_nm, head->range_min_m);
    head->range_max_m = take_length(s->range_max_nm, own.range_max_nm, head->range_max_m);
    cfg->noise.range = (enum config_range_noise)s->noise;
    cfg->noise.angle = (int)s->angle_noise;
    cfg->noise.sigma_m = take_length(s->sigma_nm, own.sigma_nm, cfg->noise.sigma_m);
    cfg->noise.ball.radius_m = take_length(s->ball_nm, own.ball_nm, cfg->noise.ball.radius_m);
    head->settings = *s;
    p->range_min_m = head->range_min_m;
    p->range_max_m = head->range_max_m;
    p->range_sigma_m = cfg->noise.sigma_m;
    for (uint32_t i = 0; i < (p->n_programs > 0 ? p->n_programs : 1); i++) {
        p->program[i].range_min_m = fmax(p->program[i].own_min_m, head->range_min_m);
        p->program[i].range_max_m = fmin(p->program[i].own_max_m, head->range_max_m);
    }
    if (s->step_udeg == own.step_udeg) return SH_OK;
    if (p->emitter.kind == EMITTER_PLANAR) {
        config_set_steps(p, emitter_sphere_steps(s->step_udeg));
        return SH_OK;
    }
    emitter_set_sphere(&p->emitter, s->step_udeg);
    return emitter_set_rings(&p->emitter, head->ring_start_udeg, head->ring_stop_udeg, err);
}
