/* SPDX-License-Identifier: MIT */
/* Groups of triangles: where each group is seen, and whether its triangles are too small to be examined one by one. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/sight/build_inside.h"
#include "core/vec3.h"

enum { GROUPS_LOOKED_AT = 1024 };

static uint32_t triangles_of(const struct build_shared *b, uint32_t group)
{
    const uint32_t left = bvh_scene(b->sight->bvh)->n_triangles - group * BUILD_GROUP;
    return left < BUILD_GROUP ? left : BUILD_GROUP;
}

static void find_box(const struct build_shared *b, uint32_t group, uint32_t n, struct build_group *g)
{
    vec3_bound_nothing(g->lo_m, g->hi_m);
    for (uint32_t i = 0; i < n; i++) {
        double v[3][3];
        sight_corners(b->sight, group * BUILD_GROUP + i, v);
        for (int c = 0; c < 3; c++)
            vec3_bound(g->lo_m, g->hi_m, v[c]);
    }
    g->far_m = 0.0;
    for (int k = 0; k < 3; k++)
        g->far_m = fmax(g->far_m, fmax(-g->lo_m[k], g->hi_m[k]));
}

/* The interval that a box takes along an axis of a face. */
struct reach {
    double lo_m, hi_m;
};

static void to_face(const struct build_group *g, uint32_t face, struct reach at[3])
{
    const uint32_t axis = face / 2;
    for (uint32_t i = 0; i < 3; i++)
        at[i] = (struct reach){g->lo_m[(axis + i) % 3], g->hi_m[(axis + i) % 3]};
    if (face & 1) at[0] = (struct reach){-at[0].hi_m, -at[0].lo_m};
}

/* Returns whether the whole box lies beyond one side of the face's pyramid, or behind the station. bins.c asks the same
 * of a triangle. */
static int is_beside(const struct build_group *g, uint32_t face)
{
    struct reach at[3];
    to_face(g, face, at);
    const double edge_m = BUILD_BESIDE * g->far_m, side_m = BUILD_WIDER * at[0].hi_m + edge_m;
    return at[0].hi_m < -edge_m || at[1].lo_m > side_m || -at[1].hi_m > side_m || at[2].lo_m > side_m ||
           -at[2].hi_m > side_m;
}

int build_group_rect(const struct build_group *g, uint32_t face, double rect[2][2])
{
    struct reach at[3];
    to_face(g, face, at);
    const double near_m = at[0].lo_m, far_m = at[0].hi_m;
    if (!(near_m > 1e-5 * far_m)) return 0;
    const double pad = 4.0 * SIGHT_PAD + BUILD_BESIDE * g->far_m / near_m;
    for (int i = 0; i < 2; i++) {
        const double lo_m = at[1 + i].lo_m, hi_m = at[1 + i].hi_m;
        rect[i][0] = lo_m / (lo_m > 0.0 ? far_m : near_m) - pad;
        rect[i][1] = hi_m / (hi_m > 0.0 ? near_m : far_m) + pad;
    }
    return 1;
}

/* Returns the area of the group's rectangle that lies on a face. */
static double area_on(const double rect[2][2])
{
    double area = 1.0;
    for (int i = 0; i < 2; i++)
        area *= fmax(0.0, fmin(rect[i][1], 1.0) - fmax(rect[i][0], -1.0));
    return area;
}

/* Returns whether so few rays come to the group that it is a candidate as a whole. */
static int is_whole(const struct build_shared *b, const struct build_group *g, uint32_t n)
{
    const double faces_area = 4.0 * SIGHT_FACES;
    double area = 0.0, rect[2][2];
    for (uint32_t face = 0; face < SIGHT_FACES; face++) {
        if (g->beside >> face & 1) continue;
        if (!build_group_rect(g, face, rect)) return 0;
        area += area_on((const double(*)[2])rect);
    }
    return area * b->spec->rays < n * SIGHT_GROUP_RAYS * faces_area;
}

static void set_group(const struct build_shared *b, uint32_t i, struct build_group *g)
{
    find_box(b, i, triangles_of(b, i), g);
    g->beside = 0;
    for (uint32_t face = 0; face < SIGHT_FACES; face++)
        g->beside |= (uint8_t)(is_beside(g, face) << face);
    g->whole = (int8_t)is_whole(b, g, triangles_of(b, i));
}

static uint32_t groups_of(const struct build_shared *b)
{
    return (bvh_scene(b->sight->bvh)->n_triangles + BUILD_GROUP - 1) / BUILD_GROUP;
}

/* Looks at some of the groups, evenly spread over the list. */
double sight_examined(const struct sight_spec *spec)
{
    struct sight sight = {.bvh = spec->bvh};
    const struct build_shared b = {.sight = &sight, .spec = spec};
    const uint32_t n = groups_of(&b), step = n / GROUPS_LOOKED_AT + 1;
    double all = 0.0, examined = 0.0;
    memcpy(sight.station_m, spec->station_m, sizeof sight.station_m);
    for (uint32_t i = 0; i < n; i += step) {
        struct build_group g;
        set_group(&b, i, &g);
        all += triangles_of(&b, i);
        examined += g.whole ? 0.0 : triangles_of(&b, i);
    }
    return n != 0 ? bvh_scene(spec->bvh)->n_triangles * examined / all : 0.0;
}

int build_groups(struct build_shared *b, struct sh_err *err)
{
    const uint32_t n = groups_of(b);
    const uint64_t bytes = n * sizeof *b->group;
    b->group = malloc(bytes + 1);
    if (b->group == NULL) return sh_fail(err, SH_ENOMEM, "sight: no memory for %u groups", n);
    b->n_groups = n;
    b->bytes += bytes;
    b->given_back += bytes;
    for (uint32_t i = 0; i < n; i++) {
        if ((i & 0xfff) == 0 && sh_check_stop(b->report, err) != SH_OK) return SH_ESTOPPED;
        set_group(b, i, &b->group[i]);
    }
    return SH_OK;
}

/* near_m is the distance of the box's nearest point, less 1e-12 of it. The rounding of the squares is smaller. */
void build_group_candidate(const struct build_group *g, uint32_t face, struct build_candidate *c)
{
    double rect[2][2], near2 = 0.0;
    build_group_rect(g, face, rect);
    *c = (struct build_candidate){.graze = 1e300, .triangle = BVH_NO_TRIANGLE, .record = BUILD_NO_RECORD};
    for (int i = 0; i < 2; i++) {
        c->rect[i][0] = 0.5 * (rect[i][0] + rect[i][1]);
        c->rect[i][1] = 0.5 * (rect[i][1] - rect[i][0]);
    }
    for (int k = 0; k < 3; k++) {
        const double beyond_m = fmax(0.0, fmax(g->lo_m[k], -g->hi_m[k]));
        near2 += beyond_m * beyond_m;
    }
    c->near_m = sqrt(near2) * (1.0 - 1e-12);
}
