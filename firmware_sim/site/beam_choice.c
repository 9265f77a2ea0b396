/* SPDX-License-Identifier: MIT */
/* Beam and optics: tries methods on the head's own pulses, lets core/plan choose, and makes the beams. */
#include "firmware_sim/config/config.h"
#include "firmware_sim/site/steps.h"
#include "firmware_sim/site/look.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { FOOTPRINT_OPTIONS = 9, MANY_TRIANGLES = 1000000 }; /* more than MANY_TRIANGLES: progress is reported */

/* ---- trying methods */

struct trial {
    struct site *site;
    struct site_look look;
    struct plan_sample *sample;
};

/* The caller frees the sample, also after an error. */
static int open_trial(struct trial *trial, struct site *site, const struct sh_report *report, struct sh_err *err)
{
    if (site->scene->n_all > MANY_TRIANGLES) sh_progress(report, "trying methods on the scene", -1.0);
    trial->site = site;
    site_look_open(&trial->look, site);
    return plan_sample_create(&(struct plan_places){trial->look.place, trial->look.n}, report, &trial->sample, err);
}

/* ---- beams */

/* Returns why the scene, in which nothing moves, has no outlines; NULL: it has some. Outlines are not
 * made for holes that textures cut, and for copies. */
static const char *has_no_outlines(const struct scene *scene)
{
    return scene->cutout != NULL ? "outlines of holes that textures cut (scene.cutouts) are not known"
           : scene->n_copies > 0 ? "outlines of copies (scene.meshes[].copies) are not known"
                                 : NULL;
}

/* Returns why a beam is not possible here; NULL: it is. */
static const char *why_not(const struct site *site, enum beam_mode mode)
{
    if (mode == BEAM_SINGLE) return NULL;
    if (!config_has_footprint(site->cfg)) return "the head profile has no footprint";
    if (mode != BEAM_ADAPTIVE) return NULL;
    const char *moves = config_beam_moves(site->cfg);
    return moves != NULL ? moves : has_no_outlines(site->scene);
}

static int make_beam(const struct site *site, struct site_station *s, int adaptive, const struct sh_report *report,
                     struct sh_err *err)
{
    const struct config_profile *p = &site->cfg->profile;
    struct cast_beam *beam = s->beam;
    if (beam == NULL) beam = s->beam = calloc(1, sizeof *beam);
    if (beam == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    beam->max_echoes = p->max_echoes;
    beam_init(&beam->beam, p->beam_exit_m, p->beam_divergence_rad, 1e-9 * p->pulse_width_ns);
    beam_rings(BEAM_FINE_RINGS, &beam->fine);
    if (!adaptive || beam->outlines != NULL) return SH_OK;
    if (site->scene->n_triangles > MANY_TRIANGLES) sh_progress(report, "looking for outlines", -1.0);
    const struct beam_outlines_spec spec = {site->scene,    s->at.position_m,  &beam->beam,
                                            p->range_max_m, site->detect.kind, report};
    return cast_outlines(&spec, site->bvh, &beam->outlines, err);
}

void site_free_beam(struct site_station *s)
{
    if (s->beam == NULL) return;
    beam_outlines_free(s->beam->outlines);
    free(s->beam);
    s->beam = NULL;
}

/* Makes the planned beam of each station. Trials leave beams, which may have outlines that no run needs. */
static int apply_beam(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    const struct plan_methods *methods = &site->plan.methods;
    const int adaptive = methods->beam == BEAM_ADAPTIVE;
    for (uint32_t i = 0; i < site->n_stations; i++) {
        struct site_station *s = &site->station[i];
        if (!adaptive) site_free_beam(s);
        if (methods->beam == BEAM_SINGLE || !config_serves(site->cfg, i)) continue;
        int rc = make_beam(site, s, adaptive, report, err);
        if (rc != SH_OK) return rc;
        s->beam->mode = methods->beam;
        beam_rings(methods->rings, &s->beam->pattern);
    }
    return SH_OK;
}

/* ---- the choice of a beam */

/* Makes footprints for the stations of the look; with `adaptive`, outlines, too. */
static int make_beams(struct trial *trial, int adaptive, const struct sh_report *report, struct sh_err *err)
{
    int rc = SH_OK;
    for (uint32_t i = 0; i < trial->look.n && rc == SH_OK; i++) {
        struct site_station *s = &trial->site->station[trial->look.at[i].station];
        rc = make_beam(trial->site, s, adaptive, report, err);
        trial->look.place[i].beam = s->beam;
    }
    return rc;
}

/* Lists all beams, those of known cost in the order of their cost. */
static void list_beams(const struct site *site, struct plan_option option[FOOTPRINT_OPTIONS])
{
    static const uint32_t rings[FOOTPRINT_OPTIONS - 2] = {1, 2, 3, 4, 6, 8, 12};
    plan_beam_option(BEAM_SINGLE, site->cfg->beam.rings, &option[0]);
    plan_beam_option(BEAM_ADAPTIVE, site->cfg->beam.rings, &option[1]);
    for (uint32_t i = 2; i < FOOTPRINT_OPTIONS; i++)
        plan_beam_option(BEAM_RINGS, rings[i - 2], &option[i]);
    for (uint32_t i = 0; i < FOOTPRINT_OPTIONS; i++) {
        const char *why = why_not(site, option[i].mode);
        if (why != NULL) snprintf(option[i].why_not, sizeof option[i].why_not, "%s", why);
    }
}

/* Measures the errors of the beams that are possible. Once one keeps the tolerance, those that cost more are left out.
 * Finding outlines takes time: the adaptive beam is measured only where single rays don't keep the tolerance. Warns
 * where no beam of several keeps it. */
static int measure_beams(struct trial *trial, struct plan_option *option, uint32_t n, const struct sh_report *report,
                         struct sh_err *err)
{
    const struct config *cfg = trial->site->cfg;
    double cost_ns = (double)INFINITY;
    int rc = SH_OK, holds = 0;
    for (struct plan_option *it = option; it < option + n && rc == SH_OK; it++) {
        if (it->why_not[0] != '\0' || it->cost_ns > cost_ns || (it->mode == BEAM_ADAPTIVE && holds)) continue;
        if (it->mode == BEAM_ADAPTIVE) rc = make_beams(trial, 1, report, err);
        if (rc != SH_OK) return rc;
        plan_sample_beam(trial->sample, it);
        rc = sh_check_stop(report, err);
        if (!plan_holds(it, &cfg->plan)) continue;
        holds = 1;
        cost_ns = it->cost_ns;
    }
    if (rc == SH_OK && !holds && cfg->beam.mode == BEAM_AUTO)
        sh_warn(report, "%s: beam.mode: auto: no mode keeps plan.tolerance_m and plan.echo_tolerance here", cfg->file);
    return rc;
}

static int try_beams(struct site *site, struct plan_option *option, uint32_t n, const struct sh_report *report,
                     struct sh_err *err)
{
    struct trial trial = {0};
    int rc = open_trial(&trial, site, report, err);
    if (rc == SH_OK) rc = make_beams(&trial, 0, report, err);
    if (rc == SH_OK) rc = measure_beams(&trial, option, n, report, err);
    plan_sample_free(trial.sample);
    return rc;
}

/* Adds the error at the ends of planes to the row. The tolerance is an RMS over all echoes, which hides it: few echoes
 * lie there. */
static void say_end_error(const struct plan_methods *methods, struct plan_row *row)
{
    const size_t used = strlen(row->why);
    if (methods->beam != BEAM_RINGS) return;
    snprintf(row->why + used, sizeof row->why - used, "; at a plane's end up to %.2g w tan i (beam radius, incidence)",
             beam_end_error(methods->rings));
}

/* A beam that the configuration forces is measured only for `plan`. */
static int choose_beam(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    const int forced = cfg->beam.mode != BEAM_AUTO;
    const uint32_t n = forced ? 1 : FOOTPRINT_OPTIONS;
    struct plan_option option[FOOTPRINT_OPTIONS];
    const char *why = cfg->beam.mode == BEAM_ADAPTIVE ? has_no_outlines(site->scene) : NULL;
    if (why != NULL)
        return sh_fail(err, SH_EINPUT, "%s: beam.mode: adaptive: %s; allowed here are single, rings and auto",
                       cfg->file, why);
    if (forced)
        plan_beam_option(cfg->beam.mode, cfg->beam.rings, option);
    else
        list_beams(site, option);
    const int tries = config_has_footprint(cfg) && (!forced || site->measures);
    int rc = tries ? try_beams(site, option, n, report, err) : SH_OK;
    if (rc != SH_OK) return rc;
    const struct plan_choice ask = {"beam", option, n, forced ? 0 : -1, forced ? "beam.mode" : "", cfg->plan};
    const struct plan_option *chosen = &option[plan_choose(&ask, &site->plan.beam)];
    site->plan.methods.beam = chosen->mode;
    site->plan.methods.rings = chosen->rings;
    say_end_error(&site->plan.methods, &site->plan.beam);
    return SH_OK;
}

/* ---- glass and mirrors */

/* Tries depths up to the first that holds the tolerance; with a forced depth, all of them. Returns whether one
 * holds it. */
static int try_depths(const struct trial *trial, int forced, struct plan_option *option)
{
    int holds = 0;
    for (uint32_t d = 0; d <= CAST_MAX_DEPTH; d++) {
        option[d] = (struct plan_option){
            .method = "none", .error_m = (double)NAN, .echo_share = (double)NAN, .cost_ns = d == 0 ? 0.0 : (double)NAN};
        if (d > 0) snprintf(option[d].method, sizeof option[d].method, "depth %u", d);
        if (trial->sample == NULL || holds) continue;
        plan_sample_optics(trial->sample, d, &option[d]);
        holds = forced < 0 && plan_holds(&option[d], &trial->site->cfg->plan);
    }
    return holds;
}

static int choose_optics(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    struct plan_option option[CAST_MAX_DEPTH + 1];
    struct trial trial = {0};
    int forced = cfg->optics.depth_given ? (int)cfg->optics.depth : -1, rc = SH_OK;
    if (!site->detect.surfaces.has_optics) {
        plan_say(&site->plan.optics, "optics", "none", 0.0, 0.0,
                 "no surface is glass or a mirror: no pulse needs a second ray");
        return SH_OK;
    }
    if (forced < 0 || site->measures) rc = open_trial(&trial, site, report, err);
    int holds = rc == SH_OK && try_depths(&trial, forced, option);
    plan_sample_free(trial.sample);
    if (rc == SH_OK) rc = sh_check_stop(report, err);
    if (rc != SH_OK) return rc;
    const struct plan_choice ask = {"optics", option, CAST_MAX_DEPTH + 1, forced, "optics.depth", cfg->plan};
    uint32_t depth = site->plan.methods.depth = plan_choose(&ask, &site->plan.optics);
    if (forced < 0 && holds && depth == 0)
        sh_warn(report,
                "%s: plan.tolerance_m and plan.echo_tolerance allow glass and mirrors to be treated as other surfaces; "
                "set optics.depth to follow them",
                cfg->file);
    if (forced < 0 && !holds)
        sh_warn(report, "%s: paths of pulses meet more glass and mirrors than the %u surfaces that are followed",
                cfg->file, depth);
    return SH_OK;
}

int site_choose_methods(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    int chooses = site->cfg->beam.mode == BEAM_AUTO;
    int rc = choose_optics(site, report, err);
    if (rc == SH_OK && chooses) rc = choose_beam(site, report, err);
    if (rc == SH_OK) site_set_depth(site, site->plan.methods.depth);
    if (rc == SH_OK && !chooses) rc = choose_beam(site, report, err);
    return rc == SH_OK ? apply_beam(site, report, err) : rc;
}
