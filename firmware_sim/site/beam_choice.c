/* Beam and optics: looks at the scene as the head does, has core/plan choose, and makes the beams. */
#include "firmware_sim/site/beam_choice.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "firmware_sim/site/detection.h"
#include "firmware_sim/site/look.h"

enum { MAX_PLACES = 4, FOOTPRINT_OPTIONS = 9 };

static struct plan_tolerance tolerance_of(const struct site *site)
{
    return (struct plan_tolerance){site->cfg->plan.tolerance_m, site->cfg->plan.echo_tolerance};
}

/* ---- beams */

/* Why footprints can't be had at all; NULL: they can. The one place that says what they go together with. */
static const char *no_footprint(const struct site *site)
{
    const struct config_profile *p = &site->cfg->profile;
    if (p->beam_exit_m == 0.0 && p->beam_divergence_rad == 0.0) return "the head profile has no footprint";
    return NULL;
}

/* Why an adaptive one can't be had, where footprints can; NULL: it can. */
static const char *no_outlines(const struct site *site)
{
    if (config_beam_fixed(site->cfg)) return NULL;
    return config_moves(site->cfg) ? "the head or a mesh moves" : "an offset of the instrument moves the beam";
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
    if (!adaptive || s->outlines != NULL) return SH_OK;
    if (site->scene->n_triangles > 1000000) sh_progress(report, "looking for outlines", -1.0);
    const struct beam_outlines_spec spec = {site->scene, s->at.position_m, &beam->beam, p->range_max_m,
                                            site->detect.kind};
    int rc = cast_outlines(&spec, s->bvh, &s->outlines, err);
    beam->outlines = s->outlines;
    return rc;
}

static void drop_beam(struct site_station *s, int with_beam)
{
    beam_outlines_free(s->outlines);
    s->outlines = NULL;
    if (s->beam != NULL) s->beam->outlines = NULL;
    if (!with_beam) return;
    free(s->beam);
    s->beam = NULL;
}

/* Each station's, as planned. */
static int apply_beam(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    const struct plan_methods *methods = &site->plan.methods;
    int rc = SH_OK, adaptive = methods->beam == BEAM_ADAPTIVE;
    for (uint32_t i = 0; i < site->n_stations && rc == SH_OK; i++) {
        struct site_station *s = &site->station[i];
        if (!adaptive) drop_beam(s, methods->beam == BEAM_SINGLE);
        if (methods->beam == BEAM_SINGLE) continue;
        rc = make_beam(site, s, adaptive, report, err);
        if (rc != SH_OK) return rc;
        s->beam->mode = methods->beam;
        beam_rings(methods->rings, &s->beam->pattern);
    }
    return rc;
}

/* ---- the choice of a beam */

/* Footprints for the stations that are looked at. */
static int open_look(struct site_look *look, struct site *site, const struct sh_report *report, struct sh_err *err)
{
    int rc = SH_OK;
    for (uint32_t i = 0; i < site_look_count(site, MAX_PLACES) && rc == SH_OK; i++)
        rc = make_beam(site, &site->station[site_look_station(site, MAX_PLACES, i)], 0, report, err);
    return rc == SH_OK ? site_look_open(look, site, MAX_PLACES, report, err) : rc;
}

static int add_outlines(const struct site_look *look, const struct sh_report *report, struct sh_err *err)
{
    int rc = SH_OK;
    for (uint32_t i = 0; i < look->n && rc == SH_OK; i++)
        rc = make_beam(look->site, &look->site->station[look->at[i].station], 1, report, err);
    return rc;
}

struct beam_choice {
    enum beam_mode mode;
    uint32_t rings;
};

/* What there is: those of known costs in their order. */
static void list_beams(const struct site *site, struct beam_choice *choice, struct plan_option *option)
{
    static const uint32_t rings[FOOTPRINT_OPTIONS - 2] = {1, 2, 3, 4, 6, 8, 12};
    const char *none = no_footprint(site);
    for (uint32_t i = 0; i < FOOTPRINT_OPTIONS; i++) {
        choice[i] = (struct beam_choice){i == 0   ? BEAM_SINGLE
                                         : i == 1 ? BEAM_ADAPTIVE
                                                  : BEAM_RINGS,
                                         i < 2 ? site->cfg->beam.rings : rings[i - 2]};
        plan_beam_option(choice[i].mode, choice[i].rings, &option[i]);
        if (i > 0 && none != NULL)
            snprintf(option[i].why_not, sizeof option[i].why_not, "%s", none);
        else if (i == 1 && no_outlines(site) != NULL)
            snprintf(option[i].why_not, sizeof option[i].why_not, "%s", no_outlines(site));
    }
}

/* Measures what can be had, up to what costs more than one that holds. Outlines take time to find, and only the
 * adaptive beam needs them. Returns whether one holds. */
static int measure_beams(struct site_look *look, const struct beam_choice *choice, struct plan_option *option,
                         const struct sh_report *report, struct sh_err *err, int *holds)
{
    const struct plan_tolerance tolerance = tolerance_of(look->site);
    double cost_ns = (double)INFINITY;
    int rc = SH_OK;
    for (uint32_t i = 0; i < FOOTPRINT_OPTIONS && rc == SH_OK; i++) {
        if (option[i].why_not[0] != '\0' || option[i].cost_ns > cost_ns) continue;
        if (choice[i].mode == BEAM_ADAPTIVE) {
            if (*holds) continue; /* single rays do */
            rc = add_outlines(look, report, err);
            if (rc != SH_OK) return rc;
        }
        plan_sample_beam(look->sample, choice[i].mode, choice[i].rings, &option[i]);
        if (!plan_holds(&option[i], &tolerance)) continue;
        *holds = 1;
        cost_ns = option[i].cost_ns;
    }
    return rc;
}

static int try_beams(struct site *site, const struct beam_choice *choice, struct plan_option *option,
                     const struct sh_report *report, struct sh_err *err)
{
    struct site_look look = {0};
    int holds = 0, rc = open_look(&look, site, report, err);
    if (rc == SH_OK) rc = measure_beams(&look, choice, option, report, err, &holds);
    if (rc == SH_OK && !holds)
        sh_warn(report, "%s: beam.mode: auto: no beam holds plan.tolerance_m and plan.echo_tolerance here",
                site->cfg->file);
    site_look_close(&look);
    return rc;
}

static int choose_beam(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    const struct plan_tolerance tolerance = tolerance_of(site);
    struct plan_option option[FOOTPRINT_OPTIONS];
    struct beam_choice choice[FOOTPRINT_OPTIONS];
    list_beams(site, choice, option);
    int rc = no_footprint(site) == NULL ? try_beams(site, choice, option, report, err) : SH_OK;
    if (rc != SH_OK) return rc;
    uint32_t chosen = plan_choose(&site->plan.beam, "beam", option, FOOTPRINT_OPTIONS, -1, "", &tolerance);
    site->plan.methods.beam = choice[chosen].mode;
    site->plan.methods.rings = choice[chosen].rings;
    return SH_OK;
}

/* measure: the bound, too. */
static int force_beam(struct site *site, int measure, const struct sh_report *report, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    const struct plan_tolerance tolerance = tolerance_of(site);
    struct plan_option option;
    struct site_look look = {0};
    plan_beam_option(cfg->beam.mode, cfg->beam.rings, &option);
    if (measure && no_footprint(site) == NULL) {
        int rc = open_look(&look, site, report, err);
        if (rc == SH_OK && cfg->beam.mode == BEAM_ADAPTIVE) rc = add_outlines(&look, report, err);
        if (rc == SH_OK) plan_sample_beam(look.sample, cfg->beam.mode, cfg->beam.rings, &option);
        site_look_close(&look);
        if (rc != SH_OK) return rc;
    }
    site->plan.methods.beam = cfg->beam.mode;
    site->plan.methods.rings = cfg->beam.rings;
    plan_choose(&site->plan.beam, "beam", &option, 1, 0, "beam.mode", &tolerance);
    return SH_OK;
}

/* ---- glass and mirrors */

static int choose_optics(struct site *site, int measure, const struct sh_report *report, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    const struct plan_tolerance tolerance = tolerance_of(site);
    struct plan_option option[CAST_MAX_DEPTH + 1];
    struct site_look look = {0};
    int forced = cfg->optics.depth_given ? (int)cfg->optics.depth : -1, holds = 0;
    if (!site->detect.surfaces.has_optics) {
        plan_say(&site->plan.optics, "optics", "none", 0.0, 0.0,
                 "no surface is of glass or a mirror: no pulse is cast twice");
        return SH_OK;
    }
    if (forced < 0 || measure) {
        int rc = site_look_open(&look, site, MAX_PLACES, report, err);
        if (rc != SH_OK) {
            site_look_close(&look);
            return rc;
        }
    }
    for (uint32_t d = 0; d <= CAST_MAX_DEPTH; d++) {
        option[d] = (struct plan_option){
            .method = "none", .error_m = (double)NAN, .echo_share = (double)NAN, .cost_ns = d == 0 ? 0.0 : (double)NAN};
        if (d > 0) snprintf(option[d].method, sizeof option[d].method, "depth %u", d);
        if (look.sample == NULL || holds) continue;
        plan_sample_optics(look.sample, d, &option[d]);
        holds = forced < 0 && plan_holds(&option[d], &tolerance);
    }
    site_look_close(&look);
    site->plan.methods.depth =
        plan_choose(&site->plan.optics, "optics", option, CAST_MAX_DEPTH + 1, forced, "optics.depth", &tolerance);
    if (forced < 0 && holds && site->plan.methods.depth == 0)
        sh_warn(report,
                "%s: plan.tolerance_m and plan.echo_tolerance allow to take glass and mirrors as other surfaces; "
                "optics.depth has them followed",
                cfg->file);
    if (forced < 0 && !holds)
        sh_warn(report, "%s: ways through glass and off mirrors are longer than the %u that are followed", cfg->file,
                site->plan.methods.depth);
    return SH_OK;
}

int site_choose_methods(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    int rc = choose_optics(site, 0, report, err);
    if (rc == SH_OK)
        rc = site->cfg->beam.mode == BEAM_AUTO ? choose_beam(site, report, err) : force_beam(site, 0, report, err);
    if (rc == SH_OK) rc = apply_beam(site, report, err);
    if (rc == SH_OK) site_set_depth(site, site->plan.methods.depth);
    return rc;
}

int site_measure_forced(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    int rc = SH_OK;
    if (site->plan.optics.forced) rc = choose_optics(site, 1, report, err);
    if (rc == SH_OK && site->plan.beam.forced) rc = force_beam(site, 1, report, err);
    return rc == SH_OK ? apply_beam(site, report, err) : rc;
}
