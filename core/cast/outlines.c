/* SPDX-License-Identifier: MIT */
/* Casts the rays that outlines are probed with. */

#include "core/cast.h"

struct prober {
    struct caster *caster;
    const struct bvh *bvh;
    const struct beam_outlines_spec *spec;
    uint32_t triangle[BEAM_PROBE_MOST];
};

static void outlines_probe(void *ctx, uint32_t n, const struct vec3_in *dir, double *range_m, uint16_t *kind)
{
    struct prober *prober = ctx;
    const struct beam_outlines_spec *spec = prober->spec;
    const struct bvh_rays rays = {.n = n,
                                  .from.at_m = {spec->station_m[0], spec->station_m[1], spec->station_m[2]},
                                  .dir = *dir,
                                  .range_max_m = spec->range_max_m,
                                  .range_m = range_m,
                                  .triangle = prober->triangle};
    caster_hits(prober->caster, prober->bvh, &rays);
    for (uint32_t i = 0; i < n; i++)
        kind[i] = spec->kind != NULL && prober->triangle[i] != BVH_NO_TRIANGLE
                      ? spec->kind[spec->scene->label[prober->triangle[i]]]
                      : 0;
}

int cast_outlines(const struct beam_outlines_spec *spec, const struct bvh *bvh, struct beam_outlines **out,
                  struct sh_err *err)
{
    struct prober prober = {.bvh = bvh, .spec = spec};
    const struct beam_probe probe = {outlines_probe, &prober};
    int rc = caster_create(&prober.caster, err);
    if (rc != SH_OK) return rc;
    rc = beam_outlines_create(spec, &probe, out, err);
    caster_free(prober.caster);
    return rc;
}
