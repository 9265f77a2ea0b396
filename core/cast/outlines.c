/* Outlines, looked at by casting. */
#include <string.h>

#include "core/cast.h"

struct look {
    struct caster *caster;
    const struct bvh *bvh;
    const struct scene *scene;
    const uint16_t *kind;
    double station_m[3], range_max_m;
    uint32_t triangle[2048];
};

static void look(void *ctx, uint32_t n, const double *dx, const double *dy, const double *dz, double *range_m,
                 uint16_t *kind)
{
    struct look *l = ctx;
    const uint32_t most = sizeof l->triangle / sizeof l->triangle[0];
    for (uint32_t at = 0, part; at < n; at += part) {
        part = n - at < most ? n - at : most;
        caster_hits(l->caster, l->bvh, l->station_m, l->range_max_m, part, dx + at, dy + at, dz + at, range_m + at,
                    l->triangle);
        for (uint32_t i = 0; i < part; i++)
            kind[at + i] =
                l->kind != NULL && l->triangle[i] != CAST_NO_TRIANGLE ? l->kind[l->scene->label[l->triangle[i]]] : 0;
    }
}

int cast_outlines(const struct scene *scene, const struct bvh *bvh, const double station_m[3], const struct beam *beam,
                  double range_max_m, const uint16_t *kind, struct beam_outlines **out, struct sh_err *err)
{
    struct look l = {.bvh = bvh, .scene = scene, .kind = kind, .range_max_m = range_max_m};
    const struct beam_probe probe = {look, &l};
    memcpy(l.station_m, station_m, sizeof l.station_m);
    int rc = caster_create(&l.caster, err);
    if (rc != SH_OK) return rc;
    rc = beam_outlines_create(scene, station_m, beam, range_max_m, kind, &probe, out, err);
    caster_free(l.caster);
    return rc;
}
