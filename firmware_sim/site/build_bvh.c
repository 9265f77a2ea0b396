/* BVHs as planned. */
#include "firmware_sim/site/beam_choice.h"

int site_build_bvh(const struct site *site, const struct scene *scene, const double origin_m[3], double reach_m,
                   const struct sh_report *report, struct bvh **out, struct sh_err *err)
{
    int rc = bvh_create(scene, origin_m, reach_m, site->cfg->loop.threads, report, out, err);
    return rc == SH_OK && site->plan.methods.order_exactly ? bvh_order_exactly(*out, err) : rc;
}
