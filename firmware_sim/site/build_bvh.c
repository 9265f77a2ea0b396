/* Whether rays are refined: what goes with it, what it is off in this scene, and the BVHs. */
#include "firmware_sim/site/beam_choice.h"

#include <math.h>
#include <stdlib.h>

#include "firmware_sim/site/look.h"

enum { MOST_TRIANGLES = 1000000 }; /* a second BVH of so many takes a few seconds */

/* Why plain BVHs can't be had; NULL: they can. With config_check's, the one place that says what they go with. */
static const char *not_plain(const struct site *site)
{
    if (site->plan.methods.beam != BEAM_SINGLE) return "sub-rays and outlines need exact planes";
    if (site->detect.on) return "signal, optics, ambiguity, instrument, angle and ball noise need exact planes";
    if (site->plan.methods.order_exactly) return "surfaces are ordered in double";
    return NULL;
}

/* Why they can't be compared with exact ones. */
static const char *not_tried(const struct site *site)
{
    if (config_moves(site->cfg)) return "not tried where the head or a mesh moves";
    if (site->scene->n_triangles > MOST_TRIANGLES) return "not tried on so large a scene, where it takes a second BVH";
    return NULL;
}

/* Why the plan does not take them by itself. */
static const char *not_by_itself(const struct site *site)
{
    if (!site->cfg->plan.tolerance_given) return "plan.tolerance_m is not given: ranges stay within a micrometre";
    return not_tried(site);
}

int site_check_cast(const struct site *site, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    if (cfg->cast.refine != CHOICE_OFF || !site->detect.on) return SH_OK;
    return sh_fail(err, SH_EINPUT, "%s: cast.refine: off, but %s; allowed without them", cfg->file, not_plain(site));
}

int site_build_bvh(const struct site *site, const struct scene *scene, const double origin_m[3], double reach_m,
                   const struct sh_report *report, struct bvh **out, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    if (cfg->cast.refine == CHOICE_OFF && !cfg->beam.measures)
        return bvh_create_plain(scene, origin_m, reach_m, cfg->loop.threads, report, out, err);
    int rc = bvh_create(scene, origin_m, reach_m, cfg->loop.threads, report, out, err);
    return rc == SH_OK && site->plan.methods.order_exactly ? bvh_order_exactly(*out, err) : rc;
}

/* Takes `by` in place of site->bvh. */
static void replace(struct site *site, struct bvh *by[])
{
    for (uint32_t i = 0; i < site->n_bvh; i++) {
        for (uint32_t s = 0; s < site->n_stations; s++)
            if (site->station[s].bvh == site->bvh[i]) site->station[s].bvh = by[i];
        bvh_free(site->bvh[i]);
        site->bvh[i] = by[i];
    }
}

static void drop(const struct site *site, struct bvh *bvh[])
{
    for (uint32_t i = 0; i < site->n_bvh; i++)
        bvh_free(bvh[i]);
}

/* Exact BVHs are there; makes plain ones and compares, from all stations. */
static int compare(struct site *site, struct bvh *plain[], struct plan_option *as_is, const struct sh_report *report,
                   struct sh_err *err)
{
    struct site_look look = {0};
    struct plan_place *other = calloc(site->n_stations, sizeof *other);
    int rc = other != NULL ? SH_OK : sh_fail(err, SH_ENOMEM, "no memory");
    for (uint32_t i = 0; i < site->n_bvh && rc == SH_OK; i++)
        rc = bvh_create_other(site->bvh[i], site->cfg->loop.threads, report, &plain[i], err);
    if (rc == SH_OK) rc = site_look_open(&look, site, site->n_stations, report, err);
    for (uint32_t i = 0; i < look.n && rc == SH_OK; i++) {
        other[i] = look.place[i];
        for (uint32_t k = 0; k < site->n_bvh; k++)
            if (other[i].setup.bvh == site->bvh[k]) other[i].setup.bvh = plain[k];
    }
    if (rc == SH_OK) plan_sample_cast(look.sample, other, PLAN_CAST_SHARE * site->cfg->plan.tolerance_m, as_is);
    site_look_close(&look);
    free(other);
    return rc;
}

int site_choose_cast(struct site *site, int measure, const struct sh_report *report, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    struct bvh *plain[CONFIG_MAX_STATIONS] = {NULL};
    struct bvh_info info;
    bvh_get_info(site->station[0].bvh, &info);
    const struct plan_cast_need need = {.packet = info.packet,
                                        .forced = cfg->cast.refine == CHOICE_AUTO ? -1 : cfg->cast.refine == CHOICE_ON,
                                        .not_plain = not_plain(site),
                                        .not_by_itself = not_by_itself(site),
                                        .tolerance = {cfg->plan.tolerance_m, cfg->plan.echo_tolerance}};
    struct plan_option as_is = {.error_m = (double)NAN, .echo_share = (double)NAN};
    int by_choice = need.forced < 0 && need.not_by_itself == NULL, rc = SH_OK;
    if (need.not_plain == NULL && not_tried(site) == NULL && (by_choice || measure))
        rc = compare(site, plain, &as_is, report, err);
    if (rc == SH_OK) site->plan.methods.plain = plan_cast(&need, &as_is, &site->plan.cast);
    if (rc == SH_OK && by_choice && site->plan.methods.plain && !cfg->beam.measures)
        replace(site, plain);
    else
        drop(site, plain);
    return rc;
}
