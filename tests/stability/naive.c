/* SPDX-License-Identifier: MIT */
#include "tests/stability/naive.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "tests/common/embree_alone.h"

enum { CHUNK = 512 }; /* a multiple of every packet */

struct naive {
    struct embree_alone embree;
    double origin_m[3];
};

struct naive *naive_create(const struct scene *scene, const double origin_m[3], int robust, unsigned build_threads)
{
    struct embree_alone_spec spec = {.robust = robust, .threads = build_threads, .range_max_m = INFINITY};
    struct naive *naive = calloc(1, sizeof *naive);
    if (naive == NULL) return NULL;
    memcpy(spec.origin_m, origin_m, sizeof spec.origin_m);
    memcpy(naive->origin_m, origin_m, sizeof naive->origin_m);
    if (embree_alone_create(scene, &spec, &naive->embree, NULL) == SH_OK) return naive;
    free(naive);
    return NULL;
}

void naive_free(struct naive *naive)
{
    if (naive == NULL) return;
    embree_alone_free(&naive->embree);
    free(naive);
}

void naive_hits(const struct naive *naive, unsigned packet, const double station_m[3], uint32_t n, const double *dx,
                const double *dy, const double *dz, double *range_m, uint32_t *triangle)
{
    float fx[CHUNK], fy[CHUNK], fz[CHUNK], t[CHUNK];
    uint32_t prim[CHUNK];
    struct embree_alone e = naive->embree; /* its rays and results: this thread's */
    e.fx = fx;
    e.fy = fy;
    e.fz = fz;
    e.t = t;
    e.prim = prim;
    for (int k = 0; k < 3; k++)
        e.ray_origin[k] = (float)(station_m[k] - naive->origin_m[k]);
    for (uint32_t first = 0; first < n; first += CHUNK) {
        uint32_t some = n - first < CHUNK ? n - first : CHUNK, padded = (some + 15) / 16 * 16;
        for (uint32_t i = 0; i < padded; i++) { /* the last packet is filled up with its first ray */
            uint32_t at = first + (i < some ? i : some / 16 * 16);
            fx[i] = (float)dx[at];
            fy[i] = (float)dy[at];
            fz[i] = (float)dz[at];
        }
        embree_alone_pass(&e, packet, EMBREE_LOADED, 0, padded);
        for (uint32_t i = 0; i < some; i++) {
            triangle[first + i] = prim[i];
            range_m[first + i] = prim[i] == RTC_INVALID_GEOMETRY_ID ? (double)NAN : (double)t[i];
        }
    }
}
