/* SPDX-License-Identifier: MIT */
/* Emitters of head profiles: the keys that belong to each, and the values that follow from them: pulse rates,
 * limits of line angles, the schedule of a head. */
#include "core/digits.h"
#include "firmware_sim/config/check_head.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/profile_keys.h"
#include "firmware_sim/config/table/given.h"
#include "firmware_sim/config/table/row.h"
#include "firmware_sim/config/table/value.h"

#include <math.h>
#include <stdlib.h>

static const double PRR_MOST_HZ = 1e7;

int cfg_needed_by_emitter(const struct cfg_key *key, char *words, size_t len)
{
    if (key->needed) cfg_list_kinds(key->of, emitter_names, words, len);
    return key->needed;
}

static void check_owners(struct cfg_reader *rd, unsigned emitter)
{
    char words[64];
    for (size_t i = 0; i < cfg_profile_table.n; i++) {
        const struct cfg_key *key = &cfg_profile_table.keys[i];
        if (key->of == 0) continue;
        const int given = cfg_is_given(rd, key->path), has = (key->of & emitter) != 0;
        if (given && !has)
            cfg_fail_key(rd, key->path, "this emitter has no such key; allowed only with emitter: %s",
                         cfg_list_kinds(key->of, emitter_names, words, sizeof words));
        else if (!given && has && key->needed)
            cfg_fail_missing(rd, key->path, 0);
    }
}

/* Sets the pulse rates from the pulses of a line and the line rates. */
static void set_rates(struct cfg_reader *rd, const char *key, struct config_profile *p)
{
    const uint32_t n = p->emitter.steps;
    const double most_hz = from_micro(p->lines_max_uhz) * n;
    p->prr_min_uhz = p->lines_min_uhz * n;
    p->prr_max_uhz = p->lines_max_uhz * n;
    if (most_hz > PRR_MOST_HZ && CFG_SOUND(rd, "lines_max_hz"))
        cfg_fail_key(rd, key, "%u pulses a line and lines_max_hz %.10g make %.10g pulses/s; allowed up to %.10g", n,
                     from_micro(p->lines_max_uhz), most_hz, PRR_MOST_HZ);
}

static void set_planar(struct cfg_reader *rd, struct config_profile *p)
{
    const struct config_emitter *c = &p->arrangement;
    if (!CFG_SOUND(rd, "steps_per_turn", "first_step", "last_step", "front_step", "step_direction")) return;
    if (c->last_step >= c->steps_per_turn)
        cfg_fail_key(rd, "last_step", "%u, and a turn has %u steps; allowed up to %u", c->last_step, c->steps_per_turn,
                     c->steps_per_turn - 1);
    else if (c->last_step == 0)
        cfg_fail_key(rd, "last_step", "0, so no angle lies between the first and the last step; allowed 1 to %u",
                     c->steps_per_turn - 1);
    else if (c->first_step >= c->last_step)
        cfg_fail_key(rd, "first_step", "%u, but last_step is %u; allowed 0 to %u", c->first_step, c->last_step,
                     c->last_step - 1);
    else if (c->front_step >= c->steps_per_turn)
        cfg_fail_key(rd, "front_step", "%u, and a turn has %u steps; allowed up to %u", c->front_step,
                     c->steps_per_turn, c->steps_per_turn - 1);
    else {
        config_set_steps(p, c->steps_per_turn);
        p->fov_min_udeg = emitter_step_udeg(&p->emitter, c->first_step);
        p->fov_max_udeg = emitter_step_udeg(&p->emitter, c->last_step);
        set_rates(rd, "steps_per_turn", p);
        cfg_check_geometries(rd, p);
    }
}

static void set_beams(struct cfg_reader *rd, struct config_profile *p)
{
    static const int64_t FS_PER_PS = 1000;
    const struct config_emitter *c = &p->arrangement;
    struct emitter_beam beam[EMITTER_MAX_BEAMS];
    struct sh_err why;
    if (!CFG_SOUND(rd, "firing_ns", "beams", "step_direction")) return;
    for (uint32_t i = 0; i < c->n_beams; i++)
        beam[i] = (struct emitter_beam){c->beam[i].elevation_udeg, c->beam[i].azimuth_udeg, c->beam[i].offset_ns};
    const double firing_ns = from_micro(c->firing_fs), lines_max_hz = from_micro(p->lines_max_uhz);
    if (c->firing_fs % FS_PER_PS != 0)
        cfg_fail_key(rd, "firing_ns", "%.15g is too fine; allowed multiples of 0.001 ns", firing_ns);
    else if (emitter_set_beams(&p->emitter, beam, c->n_beams, (uint64_t)(c->firing_fs / FS_PER_PS),
                               c->step_direction == TURN_CLOCKWISE ? 1 : -1, &why) != SH_OK)
        cfg_fail_key(rd, "beams", "%s", why.text);
    else if (p->lines_max_uhz > emitter_most_lines_uhz(&p->emitter))
        cfg_fail_key(rd, "firing_ns", "%.15g ns is longer than a turn at lines_max_hz; allowed up to %.15g ns",
                     firing_ns, 1e9 / lines_max_hz);
    else if (1e9 * c->n_beams / firing_ns > PRR_MOST_HZ)
        cfg_fail_key(rd, "firing_ns", "%u beam%s in %.15g ns make %.10g pulses/s; allowed up to %.10g", c->n_beams,
                     c->n_beams == 1 ? "" : "s", firing_ns, 1e9 * c->n_beams / firing_ns, PRR_MOST_HZ);
    else
        p->prr_min_uhz = p->prr_max_uhz = emitter_rate_uhz(&p->emitter);
}

static void set_sphere(struct cfg_reader *rd, struct config_profile *p)
{
    if (!CFG_SOUND(rd, "step_deg")) return;
    emitter_set_sphere(&p->emitter, p->arrangement.step_udeg);
    set_rates(rd, "step_deg", p);
}

/* Reads the list only to check and count it; the site reads it again (firmware_sim/site). */
static void set_directions(struct cfg_reader *rd, struct config_profile *p)
{
    struct emitter_firing *direction;
    struct sh_err why;
    uint32_t n;
    if (!CFG_SOUND(rd, "directions") || p->arrangement.directions[0] == '\0') return;
    if (emitter_read_directions(p->arrangement.directions, &direction, &n, &why) != SH_OK) {
        cfg_fail_key(rd, "directions", "%.300s", why.text);
        return;
    }
    free(direction);
    emitter_set_directions(&p->emitter, NULL, n);
    set_rates(rd, "directions", p);
}

void cfg_check_emitter(struct cfg_reader *rd, struct config_profile *p)
{
    const enum emitter_kind kind = p->arrangement.kind;
    if (!CFG_SOUND(rd, "emitter")) return;
    check_owners(rd, CFG_KIND(kind));
    if (kind == EMITTER_LINE) return;
    p->facets = 1;
    p->optical_gain = 1.0;
    p->fov_min_udeg = 0;
    p->fov_max_udeg = 360000000;
    if (kind == EMITTER_PLANAR) set_planar(rd, p);
    if (kind == EMITTER_BEAMS) set_beams(rd, p);
    if (kind == EMITTER_SPHERE) set_sphere(rd, p);
    if (kind == EMITTER_DIRECTIONS) set_directions(rd, p);
}

/* Refuses a key that the head's emitter lacks, if it is given. */
static void refuse_key_of_other(struct cfg_reader *rd, const struct config *cfg, const char *key, const char *why,
                                const char *allowed)
{
    if (cfg_is_given(rd, key))
        cfg_fail_key(rd, key, "%shead profile %s has emitter: %s; allowed %s", why, cfg->profile.name,
                     emitter_names[cfg->profile.emitter.kind], allowed);
}

/* Refuses errors of a mirror, which only a line head has. */
static void check_instrument(struct cfg_reader *rd, const struct config *cfg)
{
    static const char *const of_mirror[] = {
        "instrument.collimation_deg",  "instrument.trunnion_deg",     "instrument.mirror_offset_m",
        "instrument.mirror_index_deg", "instrument.mirror_scale_ppm", "instrument.mirror_eccentricity_deg",
        "instrument.mirror_phase_deg",
    };
    for (size_t i = 0; i < CFG_LEN(of_mirror); i++)
        refuse_key_of_other(rd, cfg, of_mirror[i], "an error of a mirror, but ", "with a line head");
}

static const char *given_line_key(const struct cfg_reader *rd)
{
    return cfg_is_given(rd, "head.line_start_deg") ? "head.line_start_deg" : "head.line_stop_deg";
}

int cfg_line_has_width(const struct config *cfg)
{
    const struct head_settings *s = &cfg->head.settings;
    const int round = cfg->profile.emitter.kind == EMITTER_SPHERE;
    return round ? s->line_start_udeg != s->line_stop_udeg : s->line_start_udeg < s->line_stop_udeg;
}

static const char *const of_sphere[] = {"head.step_deg", "head.ring_start_deg", "head.ring_stop_deg"};

/* Sets the step and the rings that the configuration asks for. With many pulses a line the fastest line rate falls, so
 * that the pulse rate stays within PRR_MOST_HZ. */
static void set_sphere_settings(struct cfg_reader *rd, struct config *cfg)
{
    struct config_profile *p = &cfg->profile;
    struct config_head *h = &cfg->head;
    struct sh_err why;
    if (!CFG_SOUND(rd, "head.step_deg", "head.ring_start_deg", "head.ring_stop_deg")) return;
    if (cfg_is_given(rd, "head.step_deg")) {
        const int64_t most_uhz = (int64_t)(1e6 * PRR_MOST_HZ) / emitter_sphere_steps(h->step_udeg);
        if (most_uhz < p->lines_min_uhz) {
            cfg_fail_key(rd, "head.step_deg",
                         "%.15g makes more than %.10g pulses/s at %.15g lines/s, lines_min_hz of head profile %s; "
                         "allowed at least %.6g deg",
                         from_micro(h->step_udeg), PRR_MOST_HZ, from_micro(p->lines_min_uhz), p->name,
                         digits_up(360.0 * from_micro(p->lines_min_uhz) / PRR_MOST_HZ, 6));
            return;
        }
        emitter_set_sphere(&p->emitter, h->step_udeg);
        if (p->lines_max_uhz > most_uhz) p->lines_max_uhz = most_uhz;
        if (!cfg_is_given(rd, "head.lines_hz")) h->settings.lines_uhz = p->lines_max_uhz;
        set_rates(rd, "head.step_deg", p);
        if (!cfg_is_given(rd, "head.prr_hz")) h->settings.prr_uhz = p->prr_max_uhz;
    }
    if (h->ring_start_udeg > h->ring_stop_udeg)
        cfg_fail_key(rd, cfg_is_given(rd, of_sphere[2]) ? of_sphere[2] : of_sphere[1],
                     "the rings go from %.15g to %.15g deg; allowed a ring_start_deg of at most %.15g, or a "
                     "ring_stop_deg of at least %.15g",
                     from_micro(h->ring_start_udeg), from_micro(h->ring_stop_udeg), from_micro(h->ring_stop_udeg),
                     from_micro(h->ring_start_udeg));
    else if (emitter_set_rings(&p->emitter, h->ring_start_udeg, h->ring_stop_udeg, &why) != SH_OK)
        cfg_fail_key(rd, cfg_is_given(rd, of_sphere[2]) ? of_sphere[2] : of_sphere[1], "%.300s", why.text);
}

static void refuse_sphere_settings(struct cfg_reader *rd, const struct config *cfg)
{
    if (cfg->profile.arrangement.n_geometries == 0)
        refuse_key_of_other(rd, cfg, of_sphere[0], "", "only with emitter: sphere, or a planar one with geometries");
    for (size_t i = 1; i < CFG_LEN(of_sphere); i++)
        refuse_key_of_other(rd, cfg, of_sphere[i], "", "only with emitter: sphere");
}

/* Only a head with `emitter: beams` has a rotor that runs free of the pulses. */
static void refuse_rotor_settings(struct cfg_reader *rd, const struct config *cfg)
{
    static const char *const of_rotor[] = {"head.phase_lock", "head.phase_deg", "head.motor_ppm"};
    for (size_t i = 0; i < CFG_LEN(of_rotor); i++)
        refuse_key_of_other(rd, cfg, of_rotor[i], "", "only with emitter: beams");
}

/* The rotor may be set to any line rate up to the profile's, and motor_ppm comes on top. A turn still needs a whole
 * firing sequence. */
static void check_motor(struct cfg_reader *rd, const struct config *cfg)
{
    const int64_t max_uhz = cfg->profile.lines_max_uhz, most_uhz = emitter_most_lines_uhz(&cfg->profile.emitter);
    if (!CFG_SOUND(rd, "head.motor_ppm") || max_uhz + config_motor_uhz(cfg->head.motor_ppm, max_uhz) <= most_uhz)
        return;
    cfg_fail_key(rd, "head.motor_ppm",
                 "%.10g makes a turn at %.15g lines per second shorter than the firing sequence of head profile %s; "
                 "allowed up to %.10g",
                 cfg->head.motor_ppm, from_micro(max_uhz), cfg->profile.name,
                 floor(1e6 * (1e6 * (double)(most_uhz - max_uhz) / (double)max_uhz)) / 1e6);
}

void cfg_check_emitter_settings(struct cfg_reader *rd, struct config *cfg)
{
    struct head_settings *s = &cfg->head.settings;
    const enum emitter_kind kind = cfg->profile.emitter.kind;
    if (cfg_has_profile(rd) && kind == EMITTER_SPHERE) set_sphere_settings(rd, cfg);
    if (cfg_has_profile(rd) && kind != EMITTER_SPHERE) refuse_sphere_settings(rd, cfg);
    if (cfg_has_profile(rd) && kind != EMITTER_BEAMS) refuse_rotor_settings(rd, cfg);
    if (cfg_has_profile(rd) && cfg->profile.arrangement.n_geometries > 0) cfg_choose_geometry(rd, cfg);
    if (!cfg_has_profile(rd) || kind == EMITTER_LINE) return;
    if (s->phase_lock && CFG_SOUND(rd, "head.lines_hz", "head.phase_lock") && s->lines_uhz % 1000000 != 0)
        cfg_fail_key(rd, "head.phase_lock",
                     "on, but with head.lines_hz %.15g the rotor is at another azimuth each second; allowed with whole "
                     "turns per second",
                     from_micro(s->lines_uhz));
    check_instrument(rd, cfg);
    if (cfg_has_profile(rd) && kind == EMITTER_BEAMS) check_motor(rd, cfg);
    if (kind == EMITTER_BEAMS && cfg->head.ambiguity != DETECT_AMBIGUITY_NONE)
        cfg_fail_key(rd, "head.ambiguity", "the pulses of head profile %s are not evenly spaced in time; allowed none",
                     cfg->profile.name);
    if (kind == EMITTER_DIRECTIONS && (s->line_start_udeg != 0 || s->line_stop_udeg != cfg->profile.fov_max_udeg))
        cfg_fail_key(rd, given_line_key(rd), "head profile %s has a list of directions; allowed without it",
                     cfg->profile.name);
    const uint32_t n = cfg->profile.emitter.steps;
    if (n == 0 || !CFG_SOUND(rd, "head.lines_hz", "head.prr_hz")) return;
    if (s->lines_uhz < cfg->profile.lines_min_uhz || s->lines_uhz > cfg->profile.lines_max_uhz) return;
    const int64_t prr_uhz = s->lines_uhz * n;
    if (cfg_is_given(rd, "head.prr_hz") && s->prr_uhz != prr_uhz)
        cfg_fail_key(rd, "head.prr_hz",
                     "%.15g, but a line of head profile %s has %u pulses; allowed %.15g, or none: it follows from "
                     "head.lines_hz",
                     from_micro(s->prr_uhz), cfg->profile.name, n, from_micro(prr_uhz));
    s->prr_uhz = prr_uhz;
}

void config_fill_spec(const struct config_profile *profile, const struct head_settings *s, struct schedule_spec *spec)
{
    const struct emitter *emitter = &profile->emitter;
    *spec = (struct schedule_spec){.prr_uhz = s->prr_uhz,
                                   .lines_uhz = s->lines_uhz,
                                   .pan_udeg_s = s->pan_udeg_s,
                                   .fov_min_udeg = profile->fov_min_udeg,
                                   .sweep_udeg = llround(360e6 * profile->optical_gain / profile->facets),
                                   .line_start_udeg = s->line_start_udeg,
                                   .line_stop_udeg = s->line_stop_udeg,
                                   .pan_start_udeg = s->pan_start_udeg,
                                   .pan_stop_udeg = s->pan_stop_udeg,
                                   .frames = s->frames};
    if (emitter->kind == EMITTER_LINE) return;
    spec->emitter = emitter;
    if (emitter->kind == EMITTER_PLANAR) spec->fov_min_udeg = emitter_step_udeg(emitter, 0);
}
