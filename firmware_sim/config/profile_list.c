/* SPDX-License-Identifier: MIT */
/* Prints a head profile for `scanhead list`: its programs, the protocols that can describe it, and how sure its
 * figures are. */
#include "firmware_sim/config/check_head.h"
#include "firmware_sim/config/check_links.h"
#include "firmware_sim/config/profile.h"
#include "firmware_sim/config/profiles.h"
#include "firmware_sim/config/table/given.h"
#include "firmware_sim/config/table/reader.h"
#include "firmware_sim/config/table/row.h"
#include "firmware_sim/config/table/value.h"

#include <stdio.h>
#include <string.h>

/* Writes `5 to 20`, or `25` where both are the same. */
static const char *span(double low, double high, char buf[64])
{
    snprintf(buf, 64, low < high ? "%.10g to %.10g" : "%.10g", low, high);
    return buf;
}

/* ---- protocols */

static void put_protocols(const struct config_profile *p, FILE *out)
{
    struct sh_err why;
    int n = 0;
    fputs("  protocols ", out);
    for (int id = 0; id < PROTOCOL_N; id++) {
        const struct protocol_ops *ops = protocol_ops_get((enum protocol_id)id);
        if (cfg_protocol_fits(ops, p, &why)) fprintf(out, "%s %s", n++ > 0 ? "," : "", ops->name);
    }
    fputc('\n', out);
}

/* ---- programs */

static void put_reach(const struct config_program *program, FILE *out)
{
    fputs("  ", out);
    for (uint32_t i = 0; i < program->n_reaches; i++)
        fprintf(out, "%s%.4g m on %.3g %%", i > 0 ? ", " : "", program->reach[i].range_m,
                100.0 * program->reach[i].reflectance);
    fputc('\n', out);
}

static void put_program(const struct config_program *program, const char *rates, FILE *out)
{
    fprintf(out, "  %-20s %9.4g %6u %7.3g m", rates, from_micro(program->used_uhz) / 1e3, program->max_echoes,
            program->range_min_m);
    put_reach(program, out);
}

static void put_programs(const struct config_profile *p, FILE *out)
{
    char rates[64];
    fputs("  pulse rate, kHz      used kHz echoes   nearest  reach\n", out);
    for (uint32_t i = 0; i < p->n_programs; i++) {
        snprintf(rates, sizeof rates, "%.10g", from_micro(p->program[i].prr_uhz) / 1e3);
        put_program(&p->program[i], rates, out);
    }
    if (p->n_programs > 0) return;
    struct config_program fastest = p->program[0];
    fastest.used_uhz = (int64_t)((double)p->prr_max_uhz * cfg_used_share(p));
    put_program(&fastest, span(from_micro(p->prr_min_uhz) / 1e3, from_micro(p->prr_max_uhz) / 1e3, rates), out);
}

/* ---- beam and accuracy */

/* Prints `3.5 mm FWHM (5.95 mm at 1/e2)`: the width by the maker's definition, then at 1/e2. */
static void put_width(const struct cfg_reader *rd, const char *key, double given, double at_1_e2, FILE *out)
{
    const struct cfg_key *row = cfg_find(&rd->table, key);
    const char *unit = strcmp(row->unit, "rad") == 0 ? "mrad" : "mm";
    int definition;
    memcpy(&definition, (const char *)rd->base + row->definition_offset, sizeof definition);
    fprintf(out, "%.4g %s %s", 1e3 * given, unit, row->definitions[definition]);
    if (definition != BEAM_AT_1_E2) fprintf(out, " (%.3g %s at 1/e2)", 1e3 * at_1_e2, unit);
}

static void put_beam(const struct cfg_reader *rd, const struct config_profile *p, FILE *out)
{
    fputs("  beam       exit ", out);
    put_width(rd, "beam_exit_m", p->beam_exit_given_m, p->beam_exit_m, out);
    fputs(", divergence ", out);
    put_width(rd, "beam_divergence_rad", p->beam_divergence_given_rad, p->beam_divergence_rad, out);
    fprintf(out, ", %.4g nm\n", p->wavelength_nm);
}

static void put_errors(const struct cfg_reader *rd, const struct config_profile *p, FILE *out)
{
    fprintf(out, "  noise      %.3g mm", 1e3 * p->range_sigma_m);
    if (cfg_is_given(rd, "range_sigma_at_m")) fprintf(out, " at %.4g m", p->range_sigma_at_m);
    if (p->range_sigma_ppm > 0.0) fprintf(out, " + %.4g ppm", p->range_sigma_ppm);
    if (p->accuracy_m > 0.0 || p->accuracy_ppm > 0.0) fprintf(out, "; accuracy %.3g mm", 1e3 * p->accuracy_m);
    if (p->accuracy_ppm > 0.0) fprintf(out, " + %.4g ppm", p->accuracy_ppm);
    if (p->angle_accuracy_deg > 0.0) fprintf(out, ", angles %.4g deg", p->angle_accuracy_deg);
    fputc('\n', out);
}

/* ---- grades */

static int has_grade(const struct cfg_reader *rd, size_t row, int grade)
{
    const struct config_profile *p = rd->base;
    const char *path = rd->table.keys[row].path;
    for (uint32_t i = 0; strcmp(path, "reaches") == 0 && cfg_is_given(rd, path) && i < p->n_reaches; i++)
        if ((int)p->reach[i].from == grade) return 1;
    for (uint32_t i = 0; strcmp(path, "beams") == 0 && i < p->arrangement.n_beams; i++)
        if ((int)p->arrangement.beam[i].from == grade) return 1;
    for (uint32_t i = 0; strcmp(path, "geometries") == 0 && i < p->arrangement.n_geometries; i++)
        if ((int)p->arrangement.geometry[i].from == grade) return 1;
    for (size_t item = 0; item < CFG_MAX_ITEMS; item++)
        if (rd->from[row][item] == grade + 1) return 1;
    return 0;
}

/* Prints `grade  N: key, key, ...`, within 110 columns. */
static void put_figures(const struct cfg_reader *rd, int grade, FILE *out)
{
    enum { WIDTH = 110, INDENT = 13 };
    int n = 0;
    for (size_t row = 0; row < rd->table.n; row++)
        n += has_grade(rd, row, grade);
    if (n == 0) return;
    int column = fprintf(out, "  %-10s %d:", cfg_from_names[grade], n);
    for (size_t row = 0, k = 0; row < rd->table.n; row++) {
        const char *path = rd->table.keys[row].path;
        if (!has_grade(rd, row, grade)) continue;
        if (column + (int)strlen(path) + 2 > WIDTH) {
            fprintf(out, "\n%*s", INDENT - 1, "");
            column = INDENT - 1;
        }
        column += fprintf(out, " %s%s", path, ++k < (size_t)n ? "," : "");
    }
    fputc('\n', out);
}

/* ---- the emitter: how pulses are arranged, and how fast it turns */

static const char *turn_of(const struct config_profile *p)
{
    return p->emitter.turn < 0 ? "counter-clockwise" : "clockwise";
}

static void put_emitter(const struct cfg_reader *rd, const struct config_profile *p, FILE *out)
{
    const struct config_emitter *c = &p->arrangement;
    char lines[64];
    fprintf(out, "  %-10s ", cfg_word(rd, "emitter", (int)c->kind));
    if (c->kind == EMITTER_LINE)
        fprintf(out, "%.10g to %.10g deg; pan %.10g to %.10g deg, up to %.10g deg/s", from_micro(p->fov_min_udeg),
                from_micro(p->fov_max_udeg), from_micro(p->pan_min_udeg), from_micro(p->pan_max_udeg),
                from_micro(p->pan_max_udeg_s));
    if (c->kind == EMITTER_PLANAR)
        fprintf(out, "%u steps a turn, %u to %u cast, %u ahead, %s", c->steps_per_turn, c->first_step, c->last_step,
                c->front_step, turn_of(p));
    if (c->kind == EMITTER_BEAMS)
        fprintf(out, "%u beam%s, %.10g ns a sequence, %s", c->n_beams, c->n_beams == 1 ? "" : "s",
                from_micro(c->firing_fs), turn_of(p));
    if (c->kind == EMITTER_SPHERE)
        fprintf(out, "%u pulses a ring, %u rings; any step by head.step_deg", p->emitter.steps, p->emitter.rings);
    if (c->kind == EMITTER_DIRECTIONS) fprintf(out, "%u directions", p->emitter.steps);
    fprintf(out, "; %s lines/s\n", span(from_micro(p->lines_min_uhz), from_micro(p->lines_max_uhz), lines));
}

void cfg_list_profile(const struct cfg_reader *rd, const struct config_profile *p, FILE *out)
{
    fprintf(out, "%s: %s %s\n", p->name, p->maker, p->model);
    put_emitter(rd, p, out);
    put_beam(rd, p, out);
    put_errors(rd, p, out);
    put_protocols(p, out);
    put_programs(p, out);
    for (int grade = 0; cfg_from_names[grade] != NULL; grade++)
        put_figures(rd, grade, out);
}
