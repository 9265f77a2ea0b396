/* SPDX-License-Identifier: MIT */
/* Copies of meshes in a BVH: a packet that reaches one is cast in the mesh's own frame. bvh_inside.h says why that is
 * exact. */
#include <math.h>
#include <stdlib.h>

#include "core/bvh/leaves.h"
#include "core/bvh/nearest.h"
#include "core/bvh/packet.h"
#include "core/vec3.h"

/* ---- making them */

int bvh_make_copies(struct bvh *bvh, unsigned threads, const struct sh_report *report, struct sh_err *err)
{
    const struct scene *scene = bvh->scene;
    uint32_t at = 0;
    int rc = SH_OK;
    if (scene->n_copies == 0) return SH_OK;
    bvh->mesh = calloc(scene->n_copied, sizeof(struct bvh *));
    bvh->copy = calloc(scene->n_copies, sizeof *bvh->copy);
    if (bvh->mesh == NULL || bvh->copy == NULL)
        return sh_fail(err, SH_ENOMEM, "bvh: no memory for %u copies", scene->n_copies);
    for (uint32_t i = 0; i < scene->n_copied && rc == SH_OK; i++) {
        const struct scene_copied *of = &scene->copied[i];
        rc = bvh_create_whole(of->mesh, 1, threads, report, &bvh->mesh[i], err);
        if (rc == SH_OK) bvh->info.bytes += bvh->mesh[i]->info.bytes;
        for (uint32_t k = 0; k < of->n && rc == SH_OK; k++)
            bvh->copy[at++] = (struct bvh_copy){
                .at = &of->copy[k], .mesh = bvh->mesh[i], .first = of->first + k * of->mesh->n_triangles};
    }
    return rc;
}

void bvh_free_copies(struct bvh *bvh)
{
    for (uint32_t i = 0; bvh->mesh != NULL && i < bvh->scene->n_copied; i++)
        bvh_free(bvh->mesh[i]);
    free(bvh->mesh);
    free(bvh->copy);
}

void embree_asks_copy_bounds(const struct RTCBoundsFunctionArguments *args)
{
    const struct bvh *bvh = args->geometryUserPtr;
    const struct scene_copy *copy = bvh->copy[args->primID].at;
    double lo[3], hi[3], far[3];
    vec3_sub(copy->min_m, bvh->origin_m, lo);
    vec3_sub(copy->max_m, bvh->origin_m, hi);
    for (int k = 0; k < 3; k++)
        far[k] = fmax(fabs(lo[k]), fabs(hi[k]));
    bvh_pad_box(bvh, lo, hi, vec3_length(far), args->bounds_o);
}

/* ---- into a mesh's frame, and back */

/* Turns the directions into the mesh's frame, in double. */
VEC_CLONES
static void turn_directions(const struct bvh_query *query, const struct scene_copy *copy, struct bvh_query *in)
{
    const double *x = query->dir[0], *y = query->dir[1], *z = query->dir[2], c = copy->cosine, s = copy->sine;
    VEC_LOOP
    for (uint32_t i = 0; i < BVH_PACKET; i++) {
        in->room[0][i] = c * x[i] - s * y[i];
        in->room[1][i] = c * y[i] + s * x[i];
        in->room[2][i] = z[i];
    }
}

/* Finds where rays begin, and how far along them the float rays begin. */
static void find_origin(const struct bvh_query *query, const struct bvh_copy *copy, struct bvh_query *in)
{
    scene_copy_put_back(copy->at, query->at, in->at);
    vec3_sub(in->at, copy->mesh->origin_m, in->at_local);
    const double start_m = fmax(0.0, vec3_length(in->at_local) - copy->mesh->radius_m);
    for (uint32_t i = 0; i < BVH_PACKET; i++)
        in->start_m[i] = start_m;
}

VEC_CLONES
static void find_origins(const struct bvh_query *query, const struct bvh_copy *copy, struct bvh_query *in)
{
    const double *x = query->org[0], *y = query->org[1], *z = query->org[2], *at = copy->at->shift_m;
    const double *origin = copy->mesh->origin_m, c = copy->at->cosine, s = copy->at->sine, scale = copy->at->scale;
    const double radius_m = copy->mesh->radius_m, ax = at[0], ay = at[1], az = at[2];
    const double ox = origin[0], oy = origin[1], oz = origin[2];
    VEC_LOOP
    for (uint32_t i = 0; i < BVH_PACKET; i++) {
        const double vx = x[i] - ax, vy = y[i] - ay, vz = z[i] - az;
        const double px = (c * vx - s * vy) / scale, py = (c * vy + s * vx) / scale, pz = vz / scale;
        const double lx = px - ox, ly = py - oy, lz = pz - oz;
        in->room[3][i] = px;
        in->room[4][i] = py;
        in->room[5][i] = pz;
        in->room[6][i] = lx;
        in->room[7][i] = ly;
        in->room[8][i] = lz;
        const double start_m = sqrt(lx * lx + ly * ly + lz * lz) - radius_m;
        in->start_m[i] = start_m > 0.0 ? start_m : 0.0;
    }
}

/* The float rays begin at start_m. nested->rays has the layout of `width` rays. */
VEC_INLINE void set_floats(const struct bvh_query *in, struct bvh_nested *nested, uint32_t width)
{
    float *org = bvh_field(&nested->rays, width, org_x), *dir = bvh_field(&nested->rays, width, dir_x);
    for (uint32_t j = 0; j < 3; j++)
        for (uint32_t i = 0; i < width; i++) {
            const double d = in->dir[j][i], o = in->has_own ? in->local[j][i] : in->at_local[j];
            dir[j * width + i] = embree_direction(d);
            org[j * width + i] = (float)(o + in->start_m[i] * d);
        }
}

/* The rays end at the nearest hit so far. A hit that is as near is still found. */
static int set_ends(const struct bvh_query *query, double scale, const float *tfar, const int *valid,
                    struct bvh_nested *nested, uint32_t width)
{
    struct bvh_query *in = &nested->query;
    float *to = bvh_field(&nested->rays, width, tfar);
    int any = 0;
    for (uint32_t i = 0; i < width; i++) {
        const double end_m = ((double)tfar[i] + query->start_m[i]) / scale - in->start_m[i];
        nested->valid[i] = valid[i] != 0 && end_m >= 0.0 ? -1 : 0;
        any |= nested->valid[i];
        to[i] = float_above(end_m > 0.0 ? end_m : 0.0);
    }
    for (uint32_t i = 0; i < BVH_PACKET; i++) {
        in->range_m[i] = in->hit_m[i] = query->range_m[i] / scale;
        in->triangle[i] = BVH_NO_TRIANGLE;
    }
    bvh_forget_near(in);
    in->unsure = 0;
    return any;
}

static void begin_fields(struct bvh_nested *nested, uint32_t width)
{
    float *tnear = bvh_field(&nested->rays, width, tnear), *time = bvh_field(&nested->rays, width, time),
          *mask = bvh_field(&nested->rays, width, mask);
    memset(tnear, 0, width * sizeof *tnear);
    memset(time, 0, width * sizeof *time);
    memset(mask, 0xff, width * sizeof *mask);
}

/* Turns the query's rays into the mesh's frame. Returns whether any of them can hit something there. */
VEC_CLONES
static int enter(const struct bvh_query *query, const struct bvh_copy *copy, const float *tfar, const int *valid,
                 struct bvh_nested *nested)
{
    struct bvh_query *in = &nested->query;
    in->width = query->width;
    in->has_own = query->has_own;
    in->at_origin_m = query->at_origin_m / copy->at->scale;
    in->counters = (struct bvh_counters){0};
    for (int j = 0; j < 3; j++) {
        in->dir[j] = in->room[j];
        in->org[j] = in->room[3 + j];
        in->local[j] = in->room[6 + j];
    }
    turn_directions(query, copy->at, in);
    if (query->has_own)
        find_origins(query, copy, in);
    else
        find_origin(query, copy, in);
    if (!set_ends(query, copy->at->scale, tfar, valid, nested, query->width)) return 0;
    begin_fields(nested, query->width);
    if (query->width == BVH_PACKET)
        set_floats(in, nested, BVH_PACKET);
    else
        set_floats(in, nested, query->width);
    in->dir_float = bvh_field(&nested->rays, query->width, dir_x);
    if (in->has_own) bvh_find_apart(in);
    return 1;
}

static void leave(struct bvh_query *query, const struct bvh_copy *copy, float *tfar, const struct bvh_nested *nested)
{
    const struct bvh_query *in = &nested->query;
    const double scale = copy->at->scale;
    for (uint32_t i = 0; i < query->width; i++) {
        if (!nested->valid[i] || in->triangle[i] == BVH_NO_TRIANGLE) continue;
        const double first_m = fmin(in->range_m[i] * scale, query->range_m[i]);
        bvh_take_hit(query, tfar + i, i, copy->first + in->triangle[i], in->hit_m[i] * scale, first_m);
    }
    query->unsure |= in->unsure;
    query->counters.leaves += in->counters.leaves;
    query->counters.decided += in->counters.decided;
    for (uint32_t i = 0; in->counters.decided != 0 && i < query->width; i++) {
        if (!nested->valid[i] || in->near[i] == BVH_NO_TRIANGLE) continue;
        bvh_note_miss(query, i, copy->first + in->near[i], in->near_m[i] * scale);
    }
}

void bvh_meet_copy(const struct RTCIntersectFunctionNArguments *args)
{
    struct bvh_query *query = (struct bvh_query *)(void *)args->context;
    const struct bvh_copy *copy = &query->bvh->copy[args->primID];
    struct bvh_nested *nested = query->nested;
    float *tfar = bvh_field(args->rayhit, args->N, tfar);
    if (!enter(query, copy, tfar, args->valid, nested)) return;
    bvh_begin_query(&nested->query, copy->mesh);
    bvh_call_embree(copy->mesh, &nested->query, nested->valid, &nested->rays, args->N);
    leave(query, copy, tfar, nested);
}

/* ---- planes, cosines and steepness of hits */

void bvh_get_plane(const struct bvh *bvh, uint32_t triangle, struct bvh_plane *plane)
{
    struct scene_part part;
    if (triangle < bvh->scene->n_triangles) {
        *plane = *bvh_plane(bvh, triangle);
        return;
    }
    scene_find_part(bvh->scene, triangle, &part);
    const struct bvh *mesh = bvh->mesh[part.copied];
    const struct bvh_plane *in = bvh_plane(mesh, part.triangle);
    const double s = part.copy->scale, above = in->d + vec3_dot(in->n, mesh->origin_m);
    double off[3];
    scene_copy_turn(part.copy, in->n, plane->n);
    vec3_sub(part.copy->shift_m, bvh->origin_m, off);
    for (int k = 0; k < 3; k++)
        plane->n[k] *= s * s;
    plane->d = s * s * s * above + vec3_dot(plane->n, off);
}

/* Cosine of the incidence of a ray on the triangle; the length of the normal does not matter. */
static double cosine_of(const struct bvh *bvh, uint32_t triangle, const struct vec3_in *dir, uint32_t i)
{
    const double d[3] = VEC3_AT(*dir, i);
    struct bvh_plane plane;
    if (triangle == BVH_NO_TRIANGLE) return NAN;
    bvh_get_plane(bvh, triangle, &plane);
    return fabs(vec3_dot(plane.n, d)) / vec3_length(plane.n);
}

void bvh_cosines_copies(const struct bvh *bvh, const uint32_t *triangle, const struct vec3_in *dir, uint32_t n,
                        double *cosine)
{
    for (uint32_t i = 0; i < n; i++) {
        const double c = cosine_of(bvh, triangle[i], dir, i);
        cosine[i] = c > 1.0 ? 1.0 : c;
    }
}

void bvh_steepness_copies(const struct bvh *bvh, const struct bvh_rays *rays)
{
    for (uint32_t i = 0; i < rays->n; i++) {
        const double c = cosine_of(bvh, rays->triangle[i], &rays->dir, i);
        rays->steep[i] = (float)(1.0 / (c * c));
    }
}
