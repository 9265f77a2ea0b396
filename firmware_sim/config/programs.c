/* SPDX-License-Identifier: MIT */
/* Programs of a head profile: the figures that depend on its pulse rate. In: the figures of the file. Out: each
 * program complete, or diagnostics with their lines. Also converts the widths of the beam from the maker's definition
 * to this project's. */
#include "core/digits.h"
#include "firmware_sim/config/check_head.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/table/given.h"
#include "firmware_sim/config/table/reader.h"
#include "firmware_sim/config/table/row.h"
#include "firmware_sim/config/table/value.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const double WHITE = 0.9, GREY = 0.2; /* reflectances that data sheets give ranges for */
static const double USED_WITHIN = 0.02;      /* relative, of used_hz: data sheets round it, 42 kHz for 41.67 */

/* ---- widths */

void cfg_convert_widths(struct cfg_reader *rd, struct config_profile *p)
{
    if (CFG_SOUND(rd, "beam_exit_m")) p->beam_exit_m = p->beam_exit_given_m * beam_widening(p->beam_exit_definition);
    if (CFG_SOUND(rd, "beam_divergence_rad"))
        p->beam_divergence_rad = p->beam_divergence_given_rad * beam_widening(p->beam_divergence_definition);
}

/* ---- look-ups */

uint32_t config_program_of(const struct config_profile *profile, int64_t prr_uhz)
{
    for (uint32_t i = 0; i < profile->n_programs; i++)
        if (profile->program[i].prr_uhz == prr_uhz) return i;
    return 0;
}

int64_t config_rate_below(const struct config_profile *profile, int64_t prr_uhz)
{
    uint32_t i = profile->n_programs;
    if (i == 0) {
        if (prr_uhz > profile->prr_max_uhz) return profile->prr_max_uhz;
        return prr_uhz < profile->prr_min_uhz ? profile->prr_min_uhz : prr_uhz;
    }
    while (i > 1 && profile->program[i - 1].prr_uhz > prr_uhz)
        i--;
    return profile->program[i - 1].prr_uhz;
}

double cfg_used_share(const struct config_profile *p)
{
    if (!(p->optical_gain > 0.0)) return 1.0;
    return from_micro(p->fov_max_udeg - p->fov_min_udeg) * p->facets / (360.0 * p->optical_gain);
}

/* ---- the pulse rates */

static void check_ends(struct cfg_reader *rd, const struct config_profile *p)
{
    const int64_t first = p->program[0].prr_uhz, last = p->program[p->n_programs - 1].prr_uhz;
    if (first > p->prr_min_uhz)
        cfg_fail_key(rd, "prr_min_hz", "%.15g is not a rate of a program; allowed %.15g, the slowest one",
                     from_micro(p->prr_min_uhz), from_micro(first));
    if (last < p->prr_max_uhz)
        cfg_fail_key(rd, "prr_max_hz", "%.15g is not a rate of a program; allowed %.15g, the fastest one",
                     from_micro(p->prr_max_uhz), from_micro(last));
}

static void check_rates(struct cfg_reader *rd, const struct config_profile *p)
{
    static const char key[] = "programs[].prr_hz";
    int sound = CFG_SOUND(rd, "prr_min_hz", "prr_max_hz");
    for (uint32_t i = 0; i < p->n_programs; i++) {
        const double rate_hz = from_micro(p->program[i].prr_uhz);
        const int64_t before = i > 0 ? p->program[i - 1].prr_uhz : 0;
        if (!CFG_ITEM_SOUND(rd, i, key)) {
            sound = 0;
            continue;
        }
        if (sound && (p->program[i].prr_uhz < p->prr_min_uhz || p->program[i].prr_uhz > p->prr_max_uhz))
            cfg_fail_item(rd, key, i, "%.15g is outside of prr_min_hz and prr_max_hz; allowed %.15g to %.15g Hz",
                          rate_hz, from_micro(p->prr_min_uhz), from_micro(p->prr_max_uhz));
        else if (p->program[i].prr_uhz <= before)
            cfg_fail_item(rd, key, i, "%.15g is not above the rate before it; allowed above %.15g Hz", rate_hz,
                          from_micro(before));
        else if (rate_hz < from_micro(p->lines_min_uhz) && CFG_SOUND(rd, "lines_min_hz"))
            cfg_fail_item(rd, key, i, "less than a pulse per line; allowed at least %.15g Hz, lines_min_hz",
                          from_micro(p->lines_min_uhz));
        sound &= CFG_ITEM_SOUND(rd, i, key);
    }
    if (sound) check_ends(rd, p);
}

/* ---- one program */

static void check_reach(struct cfg_reader *rd, const struct config_profile *p, uint32_t i, int others_have)
{
    const struct config_program *program = &p->program[i];
    if (program->reach_90_m == 0.0) {
        if (others_have || program->reach_20_m > 0.0)
            cfg_fail_item(rd, "programs[].reach_90_m", i, "missing; required, since %s; allowed 0.1 to %.10g m",
                          others_have ? "other programs have this key" : "there is a reach_20_m", p->range_max_m);
        return;
    }
    if (program->reach_90_m > p->range_max_m && CFG_SOUND(rd, "range_max_m"))
        cfg_fail_item(rd, "programs[].reach_90_m", i, "%.10g m is beyond range_max_m; allowed up to %.10g m",
                      program->reach_90_m, p->range_max_m);
    if (program->reach_20_m >= program->reach_90_m)
        cfg_fail_item(rd, "programs[].reach_20_m", i, "%.10g m is not below reach_90_m; allowed below %.10g m",
                      program->reach_20_m, program->reach_90_m);
}

static void check_used(struct cfg_reader *rd, const struct config_profile *p, uint32_t i)
{
    const double rate_hz = from_micro(p->program[i].prr_uhz), said_hz = from_micro(p->program[i].used_uhz);
    if (said_hz == 0.0 || !CFG_SOUND(rd, "fov_min_deg", "fov_max_deg", "facets", "optical_gain")) return;
    const double share = cfg_used_share(p), used_hz = share * rate_hz;
    if (fabs(said_hz - used_hz) > USED_WITHIN * used_hz)
        cfg_fail_item(
            rd, "programs[].used_hz", i,
            "%.10g is not the share of %.10g Hz in the field of view; allowed %.6g to %.6g Hz, within 2 %% of the "
            "share %.4g",
            said_hz, rate_hz, digits_up((1.0 - USED_WITHIN) * used_hz, 6),
            digits_down((1.0 + USED_WITHIN) * used_hz, 6), share);
}

static void check_limits(struct cfg_reader *rd, const struct config_profile *p, uint32_t i)
{
    const struct config_program *program = &p->program[i];
    if (program->max_echoes > p->max_echoes && CFG_SOUND(rd, "max_echoes"))
        cfg_fail_item(rd, "programs[].max_echoes", i, "%u is more than max_echoes of the head; allowed up to %u",
                      program->max_echoes, p->max_echoes);
    if (!CFG_SOUND(rd, "range_min_m", "range_max_m")) return;
    if (cfg_is_item_given(rd, "programs[].range_min_m", i) && program->range_min_m < p->range_min_m)
        cfg_fail_item(rd, "programs[].range_min_m", i,
                      "%.10g m is below range_min_m of the head; allowed at least %.10g", program->range_min_m,
                      p->range_min_m);
}

/* Returns the grade of a figure that was read. */
static enum config_from grade_of(const struct cfg_reader *rd, const char *path, uint32_t i)
{
    return (enum config_from)(rd->from[cfg_row(rd, cfg_find(&rd->table, path))][i] - 1);
}

/* Gives the program the figures of the head as a whole where the file leaves figures out. */
static void complete(const struct cfg_reader *rd, const struct config_profile *p, uint32_t i,
                     struct config_program *program)
{
    if (program->max_echoes == 0) program->max_echoes = p->max_echoes;
    if (p->n_programs == 0 || !cfg_is_item_given(rd, "programs[].range_min_m", i))
        program->range_min_m = p->range_min_m;
    if (program->used_uhz == 0) program->used_uhz = llround(cfg_used_share(p) * (double)program->prr_uhz);
    program->range_max_m = program->reach_90_m > 0.0 ? program->reach_90_m : p->range_max_m;
    memcpy(program->reach, p->reach, sizeof program->reach);
    program->n_reaches = p->n_reaches;
    if (!(program->reach_90_m > 0.0)) return;
    program->reach[0] = (struct config_reach){WHITE, program->reach_90_m, grade_of(rd, "programs[].reach_90_m", i)};
    program->n_reaches = 1;
    if (!(program->reach_20_m > 0.0)) return;
    program->reach[program->n_reaches++] =
        (struct config_reach){GREY, program->reach_20_m, grade_of(rd, "programs[].reach_20_m", i)};
}

static void check_program(struct cfg_reader *rd, const struct config_profile *p, uint32_t i, int others_have)
{
    const struct config_program *program = &p->program[i];
    check_reach(rd, p, i, others_have);
    check_used(rd, p, i);
    check_limits(rd, p, i);
    if (program->range_min_m > 0.0 && program->reach_90_m > 0.0 && program->range_min_m >= program->reach_90_m)
        cfg_fail_item(rd, "programs[].range_min_m", i, "%.10g m is not below reach_90_m; allowed below %.10g m",
                      program->range_min_m, program->reach_90_m);
}

void cfg_check_programs(struct cfg_reader *rd, struct config_profile *p)
{
    const uint32_t n = p->n_programs;
    int have = 0;
    for (uint32_t i = 0; i < n; i++)
        have |= p->program[i].reach_90_m > 0.0;
    if (n > 0 && have && p->n_reaches > 0)
        cfg_fail_key(rd, "reaches", "given together with programs[].reach_90_m; allowed one of them");
    if (n > 0 && !have && p->n_reaches == 0 && CFG_SOUND(rd, "programs", "reaches"))
        cfg_fail_key(rd, "programs", "no program has a reach; required is reach_90_m in each, or reaches of the head");
    if (p->n_reaches == 0) p->reach[p->n_reaches++] = (struct config_reach){WHITE, p->range_max_m, FROM_ASSUMED};
    if (n > 0) check_rates(rd, p);
    for (uint32_t i = 0; i < n; i++)
        if (CFG_ITEM_SOUND(rd, i, "programs[]")) check_program(rd, p, i, have);
    for (uint32_t i = 0; i < (n > 0 ? n : 1); i++)
        complete(rd, p, i, &p->program[i]);
}

/* ---- head.prr_hz */

void cfg_check_rate(struct cfg_reader *rd, const struct config *cfg)
{
    const struct config_profile *p = &cfg->profile;
    const int64_t rate = cfg->head.settings.prr_uhz;
    char rates[200] = "", rate_hz[32];
    if (!cfg_has_profile(rd) || p->n_programs == 0) return;
    if (p->program[config_program_of(p, rate)].prr_uhz == rate) return;
    for (uint32_t i = 0; i < p->n_programs; i++) {
        snprintf(rate_hz, sizeof rate_hz, "%.15g", from_micro(p->program[i].prr_uhz));
        cfg_list_add(rates, sizeof rates, rate_hz);
    }
    cfg_fail_key(rd, "head.prr_hz", "%.15g is not a pulse rate of head profile %s; allowed %s Hz", from_micro(rate),
                 p->name, rates);
}
