/* SPDX-License-Identifier: MIT */
#include "firmware_sim/site/bvhs.h"
#include "firmware_sim/site/site.h"

/* The sites of a world share the BVHs: the first site builds them. */
int site_build_bvhs(struct site *site, unsigned threads, const struct sh_report *report, struct sh_err *err)
{
    struct site_world *world = site->world;
    int rc = world->bvh != NULL ? SH_OK : bvh_create(site->scene, threads, report, &world->bvh, err);
    for (uint32_t i = 0; i < site->n_movers && rc == SH_OK; i++) {
        struct site_mover *m = &site->mover[i];
        if (m->bvh == NULL) rc = bvh_create(m->scene, threads, report, &m->bvh, err);
        world->mover[i].bvh = m->bvh;
    }
    site->bvh = world->bvh;
    return rc;
}
