/* SPDX-License-Identifier: MIT */
#include "firmware_sim/site/plan_rows.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/plan/cost.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/places.h"
#include "firmware_sim/site/waves.h"
#include "firmware_sim/site/steps.h"

static void name_row(struct plan_row *row, const char *whose)
{
    char why[sizeof row->why];
    snprintf(why, sizeof why, "%.68s: %.150s", whose, row->why);
    memcpy(row->why, why, sizeof row->why);
}

/* Adds a row for each station; or one for all, with the largest bound, where they have the same method. */
static void add_georef(const struct site *site, struct site_plan *plan)
{
    const struct site_station *s = site->station;
    uint32_t same = 1, worst = 0;
    for (uint32_t i = 1; i < site->n_stations; i++) {
        same += strcmp(s[i].plan.method, s[0].plan.method) == 0;
        if (s[i].plan.error_m > s[worst].plan.error_m) worst = i;
    }
    if (same == site->n_stations) {
        struct plan_row *row = &plan->row[plan->n++];
        *row = s[worst].plan;
        if (site->n_stations > 1) name_row(row, "all stations");
        return;
    }
    for (uint32_t i = 0; i < site->n_stations; i++) {
        char whose[CONFIG_STATION_NAME_LEN + 24];
        snprintf(whose, sizeof whose, "station %u %s", i + 1, s[i].station->name);
        plan->row[plan->n] = s[i].plan;
        name_row(&plan->row[plan->n++], whose);
    }
}

static int is_zero(const struct config_instrument *k)
{
    static const struct config_instrument zero;
    return memcmp(k, &zero, sizeof zero) == 0;
}

static void ask_head(const struct site *site, struct plan_head *head)
{
    const struct config *cfg = site->cfg;
    *head = (struct plan_head){
        .n_movers = site->n_movers,
        .noise_on = cfg->noise.range != RANGE_NOISE_OFF,
        .range_sigma_m = cfg->profile.range_sigma_m,
        .range_sigma_ppm = cfg->profile.range_sigma_ppm,
        .range_sigma_at_m = cfg->noise.range == RANGE_NOISE_SIGNAL ? cfg->profile.range_sigma_at_m : 0.0,
        .ball_radius_m = cfg->noise.ball.radius_m,
        .signal = site->detect.cast.signal != NULL,
        .sharp = cfg->signal.sharp,
        .ambiguity = cfg->head.ambiguity,
        .instrument = !is_zero(&cfg->instrument),
        .angle_noise = cfg->noise.angle,
    };
    const struct config_program *program =
        &cfg->profile.program[config_program_of(&cfg->profile, cfg->head.settings.prr_uhz)];
    for (uint32_t i = 0; i < program->n_reaches; i++)
        head->reach_m = fmax(head->reach_m, program->reach[i].range_m);
}

/* Adds a row for heads that are no line heads, although there is nothing to choose. */
static void add_emitter(const struct site *site, struct site_plan *plan)
{
    char why[160];
    if (site->emitter.kind == EMITTER_LINE) return;
    emitter_describe(&site->emitter, why, sizeof why);
    plan_say(&plan->row[plan->n++], "emitter", emitter_names[site->emitter.kind], 0.0, 0.0, why);
}

/* Adds the figures of the configured pulse rate, if the head has programs. HEAD:PRR changes them. */
static void add_program(const struct site *site, struct site_plan *plan)
{
    const struct config_profile *p = &site->cfg->profile;
    const uint32_t in_use = config_program_of(p, site->cfg->head.settings.prr_uhz);
    const struct config_program *program = &p->program[in_use];
    char method[32], why[sizeof plan->row->why];
    if (p->n_programs == 0) return;
    snprintf(method, sizeof method, "%.10g kHz", 1e-9 * (double)program->prr_uhz);
    size_t used =
        (size_t)snprintf(why, sizeof why, "%u echoes, %.4g to %.4g m, %.4g kHz used; %s also has", program->max_echoes,
                         program->range_min_m, program->range_max_m, 1e-9 * (double)program->used_uhz, p->name);
    if (p->n_programs == 1) used = (size_t)(strrchr(why, ';') - why);
    for (uint32_t i = 0, k = 0; i < p->n_programs && used < sizeof why; i++)
        if (i != in_use)
            used += (size_t)snprintf(why + used, sizeof why - used, "%s %.10g", k++ > 0 ? "," : "",
                                     1e-9 * (double)p->program[i].prr_uhz);
    if (used < sizeof why) snprintf(why + used, sizeof why - used, "%s", p->n_programs > 1 ? " kHz" : "");
    plan_say(&plan->row[plan->n++], "program", method, 0.0, 0.0, why);
}

static void add_range(const struct site *site, struct site_plan *plan)
{
    const struct config_head *head = &site->cfg->head;
    char method[32], why[160];
    if (!config_limits_range(site->cfg)) return;
    snprintf(method, sizeof method, "%.6g to %.6g m", head->range_min_m, head->range_max_m);
    snprintf(why, sizeof why,
             "head.range_min_m, range_max_m: there is no echo outside of them; the profile has %.6g to %.6g m",
             head->profile_min_m, head->profile_max_m);
    plan_say(&plan->row[plan->n++], "range", method, 0.0, 0.0, why);
}

/* Adds a row for the first tripod. Where there are several, the row names that tripod's station. */
static void add_tripods(const struct site *site, struct site_plan *plan)
{
    char text[200], why[sizeof plan->row->why];
    const struct site_station *first = NULL;
    uint32_t n = 0;
    for (uint32_t i = 0; i < site->n_stations; i++) {
        if (site->station[i].tripod.from == NULL) continue;
        if (n++ == 0) first = &site->station[i];
    }
    if (n == 0) return;
    site_describe_tripod(first, text, sizeof text);
    snprintf(why, sizeof why, "%s%s%.150s", n > 1 ? first->station->name : "", n > 1 ? ": " : "", text);
    const char *method = !first->tripod.cast.has_legs           ? "cone"
                         : first->tripod.cast.cos_opening > 1.0 ? "legs"
                                                                : "cone and legs";
    plan_say(&plan->row[plan->n++], "tripod", method, 0.0, 0.0, why);
}

int site_plan_rows(struct site *site, struct sh_err *err)
{
    struct site_plan *plan = &site->plan;
    struct plan_row of_head[PLAN_HEAD_ROWS];
    struct plan_head head;
    ask_head(site, &head);
    size_t n = plan_head(&head, of_head);
    free(plan->row);
    plan->row = calloc(n + 13 + site->n_stations, sizeof *plan->row);
    if (plan->row == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    plan->n = 0;
    add_emitter(site, plan);
    add_program(site, plan);
    add_range(site, plan);
    add_tripods(site, plan);
    plan_mesh(site_mesh_error_m(site), &plan->row[plan->n++]);
    plan_cast(bvh_get_info(site->bvh)->packet, &plan->row[plan->n++]);
    plan->row[plan->n++] = plan->sight;
    for (size_t i = 0; i < n; i++) {
        plan->row[plan->n++] = of_head[i];
        if (i != 0) continue; /* beam and optics come after the movers' row */
        plan->row[plan->n++] = plan->beam;
        plan->row[plan->n++] = plan->optics;
    }
    site_wave_row(site, &plan->row[plan->n++]);
    if (site->cfg->output.layout == LINE_POLAR)
        plan_georef_polar(&plan->row[plan->n++]);
    else
        add_georef(site, plan);
    return site_rate_row(site, &plan->row[plan->n++], err);
}

/* The cost of a row. Where that depends on the scene, the row has no figure, and `most` is returned. */
static double cost_ns(const struct plan_row *row, double most)
{
    return isnan(row->cost_ns) ? most : row->cost_ns;
}

double site_planned_ns(const struct site *site)
{
    struct plan_row of_head[PLAN_HEAD_ROWS];
    struct plan_head head;
    const struct plan_methods *methods = &site->plan.methods;
    const uint32_t packet = bvh_get_info(site->bvh)->packet;
    ask_head(site, &head);
    const size_t n = plan_head(&head, of_head);
    double sum_ns = plan_pulse_ns(site->scene->n_triangles, packet) + cost_ns(&site->plan.sight, 0.0) +
                    cost_ns(&site->plan.beam, PLAN_COST_OUTLINES + PLAN_COST_CUT) +
                    cost_ns(&site->plan.optics, methods->depth * PLAN_COST_SUB_RAY) + site_wave_ns(site);
    for (uint32_t i = 0; i < site->n_movers; i++)
        sum_ns += plan_pulse_ns(site->mover[i].scene->n_triangles, packet);
    for (size_t i = 0; i < n; i++)
        sum_ns += cost_ns(&of_head[i], 0.0);
    if (site->cfg->output.layout != LINE_POLAR && site->n_stations > 0) sum_ns += cost_ns(&site->station[0].plan, 0.0);
    return sum_ns;
}

void site_cost_reason(const struct site *site, char *text, size_t room)
{
    static const uint64_t MANY_TRIANGLES = 32; /* fewer fill only some leaves of the BVH */
    const struct plan_methods *methods = &site->plan.methods;
    if (methods->beam != BEAM_SINGLE)
        snprintf(text, room, "the sub-rays of footprints (beam.mode single has none), a busy machine");
    else if (methods->depth > 0)
        snprintf(text, room, "glass and mirrors (optics.depth 0 leaves them out), a busy machine");
    else if (site->n_movers > 0)
        snprintf(text, room, "meshes that move (%u, each cast by itself), a busy machine", site->n_movers);
    else if (site->scene->n_triangles >= MANY_TRIANGLES)
        snprintf(text, room, "triangles that lie over one another as seen from the head, a busy machine");
    else
        snprintf(text, room, "a busy machine");
}

void site_plan_text(const struct site *site, char *text, size_t room)
{
    const struct site_plan *plan = &site->plan;
    int polar = site->cfg->output.layout == LINE_POLAR;
    snprintf(text, room, "sight %s; beam %s; optics %s; georef %s", plan->sight.method, plan->beam.method,
             plan->optics.method, polar ? "none" : site->station[0].plan.method);
}
