/* SPDX-License-Identifier: MIT */
#include "tests/common/odd_scenes.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/rng.h"
#include "core/vec3.h"
#include "tests/common/odd_maker.h"

/* Rounds to a grid of powers of two. Many corners then lie in one plane, or on one line, exactly. */
static void snap(struct odd_scene *odd, double grid_m)
{
    double *x = odd->corner[0][0];
    for (uint32_t i = 0; i < 9 * odd->n; i++)
        x[i] = grid_m * floor(x[i] / grid_m + 0.5);
}

static void shift(struct odd_scene *odd, const double by_m[3])
{
    for (uint32_t i = 0; i < 3 * odd->n; i++)
        for (int k = 0; k < 3; k++)
            odd->corner[i / 3][i % 3][k] += by_m[k];
}

/* Places the station relative to a triangle: on it, beside its edge, in its plane, or at a corner. */
static void stand(struct odd_maker *m)
{
    struct odd_scene *odd = m->odd;
    const int t = odd_pick(m, (int)odd->n);
    const double *a = odd->corner[t][0], *b = odd->corner[t][1], *c = odd->corner[t][2];
    double e[3], f[3], n[3], off_m = 0.0, x = odd_between(m, 0.1, 0.5), y = odd_between(m, 0.1, 0.5);
    const char *where = "on a face";
    switch (odd_pick(m, 6)) {
    case 0:
        break;
    case 1:
        off_m = odd_sign(m) * odd_decades(m, -9.0, -6.3);
        where = "close to a face";
        break;
    case 2:
        x = odd_pick(m, 2) ? -1.0 : 2.0;
        y = 0.0;
        where = "on an edge's line";
        break;
    case 3:
        x = odd_between(m, -3.0, 3.0);
        y = odd_pick(m, 2) ? 2.0 : -1.0;
        where = "in a plane";
        break;
    case 4:
        x = y = 0.0;
        where = "at a corner";
        break;
    default:
        off_m = odd_sign(m) * odd_decades(m, -6.3, -2.0);
        where = "near a face";
    }
    vec3_sub(b, a, e);
    vec3_sub(c, a, f);
    vec3_cross(e, f, n);
    double length = vec3_length(n);
    for (int k = 0; k < 3; k++)
        odd->station_m[k] = a[k] + x * e[k] + y * f[k] + (length > 0.0 ? off_m * n[k] / length : 0.0);
    snprintf(odd->stands, sizeof odd->stands, "%s", where);
}

void odd_scene_make(uint64_t number, uint32_t at_most, struct odd_scene *out)
{
    static const double UTM_M[3] = {500000.0, 5800000.0, 100.0};
    struct odd_maker m = {
        .odd = out, .at_most = at_most < ODD_MOST ? at_most : ODD_MOST, .random = rng_mix(number + 1)};
    double by_m[3] = {0.0, 0.0, 0.0};
    out->n = out->parts = 0;
    odd_add_behind(&m);
    if (odd_pick(&m, 4) == 0) {
        odd_add_room(&m);
        out->parts |= 1U << (ODD_PARTS - 1);
    }
    for (int i = 1 + odd_pick(&m, 5); i > 0; i--)
        odd_add_part(&m);
    if (odd_pick(&m, 4) == 0) snap(out, pow(2.0, odd_between(&m, -20.0, -3.0) > -10.0 ? -4.0 : -14.0));
    int place = odd_pick(&m, 4);
    for (int k = 0; k < 3; k++)
        by_m[k] = place == 0   ? 0.0
                  : place == 1 ? odd_between(&m, -1000.0, 1000.0)
                               : UTM_M[k] + (place == 2) * odd_unit(&m);
    shift(out, by_m);
    memcpy(out->station_m, by_m, sizeof by_m);
    snprintf(out->stands, sizeof out->stands, "in the middle");
    if (odd_pick(&m, 4) == 0) stand(&m);
}

int odd_scene_build(const struct odd_scene *odd, int weld, struct scene **out, struct sh_err *err)
{
    static const struct scene_surface surface[ODD_LABELS] = {{.object = ""}};
    double vertex[3 * ODD_MOST][3];
    uint32_t triangle[ODD_MOST][3], n = 0;
    for (uint32_t i = 0; i < 3 * odd->n; i++) {
        const double *p = odd->corner[i / 3][i % 3];
        uint32_t at = weld ? 0 : n;
        while (at < n && memcmp(vertex[at], p, sizeof vertex[at]) != 0)
            at++;
        if (at == n) memcpy(vertex[n++], p, sizeof vertex[at]);
        triangle[i / 3][i % 3] = at;
    }
    return scene_from_arrays(&(struct scene_arrays){(const double(*)[3])vertex, n, (const uint32_t(*)[3])triangle,
                                                    odd->n, odd->label, surface, ODD_LABELS},
                             out, err);
}
