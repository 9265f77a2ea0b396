/* Whether rays are refined: what goes with it, and what it is off in this scene. */
#include "firmware_sim/site_choose.h"

#include <math.h>

#include "firmware_sim/site_look.h"

/* Why Embree's own hits can't be had; NULL: they can. The one place that says what they go together with. */
static const char *not_float(const struct site *site)
{
    if (site->plan.methods.beam != BEAM_SINGLE) return "sub-rays and outlines need the exact planes";
    if (site->detect.on) return "what is detected, and how the beam is bent, needs the exact planes";
    if (site->plan.methods.order_exactly) return "surfaces are ordered in double";
    return NULL;
}

/* Why they are not taken unless asked for. */
static const char *not_by_itself(const struct site *site)
{
    if (!site->cfg->plan_tolerance_given) return "plan.tolerance_m is not given: ranges stay within a micrometre";
    if (site->moving && site->n_knots == 0) return "a live head may go where the plan can't look";
    return NULL;
}

static int look_at_scene(struct site *site, struct plan_option *as_is, const struct sh_report *report,
                         struct sh_err *err)
{
    struct site_look look = {0};
    int rc = site_look_open(&look, site, report, err);
    if (rc == SH_OK) plan_sample_cast(look.sample, PLAN_CAST_SHARE * site->cfg->plan_tolerance_m, as_is);
    plan_sample_free(look.sample);
    return rc;
}

int site_choose_cast(struct site *site, int measure, const struct sh_report *report, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    struct bvh_info info;
    bvh_get_info(site->station[0].bvh, &info);
    const struct plan_cast_need need = {.packet = info.packet,
                                        .forced = cfg->refine == CHOICE_AUTO ? -1 : cfg->refine == CHOICE_ON,
                                        .not_float = not_float(site),
                                        .not_by_itself = not_by_itself(site),
                                        .tolerance = {cfg->plan_tolerance_m, cfg->echo_tolerance}};
    struct plan_option as_is = {.error_m = (double)NAN, .echo_share = (double)NAN};
    if (need.forced == 0 && need.not_float != NULL)
        return sh_fail(err, SH_EINPUT, "%s: cast.refine: off, but %s; allowed auto, on", cfg->file, need.not_float);
    int by_choice = need.forced < 0 && need.not_by_itself == NULL;
    if (need.not_float == NULL && (by_choice || measure)) {
        int rc = look_at_scene(site, &as_is, report, err);
        if (rc != SH_OK) return rc;
    }
    site->plan.methods.unrefined = plan_cast(&need, &as_is, &site->plan.cast);
    return SH_OK;
}
