/* SPDX-License-Identifier: MIT */
/* Leaves: two triangles that share an edge and are near in the scene's list can make one leaf, where their common box
 * is no larger than their two boxes together. */
#include "core/bvh/leaves.h"

#include <math.h>
#include <stdlib.h>

#include "core/huge_pages.h"

/* The corner of a triangle that is not on its common edge with another one; 3: they share no edge. */
static int odd_corner(const uint32_t a[3], const uint32_t b[3])
{
    int odd = 3, n = 0;
    for (int i = 0; i < 3; i++)
        if (a[i] != b[0] && a[i] != b[1] && a[i] != b[2]) {
            odd = i;
            n++;
        }
    return n == 1 ? odd : 3;
}

/* A call of fmax would cost more. */
static double larger(double x, double y)
{
    return y > x ? y : x;
}

static float below(double x)
{
    const float f = (float)x;
    return f < x ? f : nextafterf(f, -INFINITY);
}

static float above(double x)
{
    return -below(-x);
}

/* Returns the length, rounded up, in the bits that bvh_leaf_size_m reads. */
static uint32_t length_bits(double length_m)
{
    return (float_bits(above(length_m)) + (UINT32_C(1) << BVH_LENGTH_BITS) - 1) >> BVH_LENGTH_BITS;
}

/* Sets v to the corners, counted from the BVH's origin. ahead: how far triangle 1 follows triangle 0 in the scene's
 * list; 0: there is no triangle 1. */
static void find_corners(const struct bvh *bvh, uint32_t first, uint32_t ahead, double v[4][3])
{
    const struct scene *scene = bvh->scene;
    const uint32_t *a = scene->triangle[first], *b = scene->triangle[first + ahead];
    const int odd = ahead != 0 ? odd_corner(a, b) : 0;
    const uint32_t corner[4] = {a[odd], a[(odd + 1) % 3], a[(odd + 2) % 3], ahead != 0 ? b[odd_corner(b, a)] : a[0]};
    for (int i = 0; i < 4; i++)
        vec3_sub(scene->vertex_m[corner[i]], bvh->origin_m, v[i]);
}

/* Sets base_m to corner 0 in single precision. The lowest bits of its three numbers hold `rest` instead. */
static void set_base(struct bvh_leaf *leaf, const double corner0_m[3], uint32_t rest)
{
    const uint32_t mask = (1U << BVH_LEAF_BITS) - 1;
    for (int j = 0; j < 3; j++)
        leaf->base_m[j] = bits_float((float_bits((float)corner0_m[j]) & ~mask) | (rest >> j * BVH_LEAF_BITS & mask));
}

/* Setting the base's lowest bits moves it by up to 2^-17 of its distance. The size includes that. */
static void fill_leaf(const struct bvh *bvh, uint32_t first, uint32_t ahead, struct bvh_leaf *leaf)
{
    double v[4][3], size_m2 = 0.0;
    find_corners(bvh, first, ahead, v);
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < i; j++) {
            double d[3];
            vec3_sub(v[i], v[j], d);
            size_m2 = larger(size_m2, vec3_dot(d, d));
        }
    const double size_m = sqrt(size_m2) + 0x1p-16 * vec3_length(v[0]);
    set_base(leaf, v[0], length_bits(size_m) << BVH_LEAF_AHEAD_BITS | ahead);
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 3; j++)
            leaf->corner_m[j][i] = (float)(v[i][j] - (double)leaf->base_m[j]);
    leaf->triangle = first;
    bvh_set_plane(bvh, first, &leaf->plane[0]);
    bvh_set_plane(bvh, first + ahead, &leaf->plane[1]);
}

/* Returns the radius of the scene about the BVH's origin. */
static double radius_of(const struct bvh *bvh)
{
    const struct scene *scene = bvh->scene;
    double half[3];
    for (int i = 0; i < 3; i++)
        half[i] = fmax(scene->max_m[i] - bvh->origin_m[i], bvh->origin_m[i] - scene->min_m[i]);
    return (double)above(vec3_length(half));
}

static double pad_units_m(const struct bvh *bvh, double far_m)
{
    const double whole_m = 8.0 * (far_m + 2.0 * bvh->radius_m);
    return fmin(whole_m, 9.0 * bvh->stretch_m + 17.0 * far_m);
}

/* The mean of the triangles' corners: vertices that no triangle uses may be anywhere. */
static void mean_corner(const struct scene *scene, double mean_m[3])
{
    double sum[3] = {0};
    for (size_t i = 0; i < 3 * (size_t)scene->n_triangles; i++)
        vec3_add(sum, scene->vertex_m[scene->triangle[i / 3][i % 3]], sum);
    for (int i = 0; i < 3; i++)
        mean_m[i] = fmin(fmax(sum[i] / (3.0 * scene->n_triangles), scene->min_m[i]), scene->max_m[i]);
}

/* The origin is the middle of the scene. In large scenes a long ray is cast in pieces, which are no longer than
 * stretch_m (bvh_inside.h). The origin of such a scene without copies is the mean of the triangles' corners, so that it
 * lies near most triangles. */
static void measure(struct bvh *bvh)
{
    const struct scene *scene = bvh->scene;
    if (scene->n_all == 0) return;
    for (int i = 0; i < 3; i++)
        bvh->origin_m[i] = scene->min_m[i] + 0.5 * (scene->max_m[i] - scene->min_m[i]);
    bvh->radius_m = radius_of(bvh);
    if (pad_units_m(bvh, 0.0) >= 16.0 * bvh->radius_m) bvh->stretch_m = INFINITY;
    if (bvh->stretch_m == INFINITY || scene->n_triangles == 0 || scene->n_copies > 0) return;
    mean_corner(scene, bvh->origin_m);
    bvh->radius_m = radius_of(bvh);
}

/* Half the surface of the box around two triangles, which may be the same one. */
static double box_m2(const struct scene *scene, uint32_t first, uint32_t second)
{
    double d[3];
    for (int j = 0; j < 3; j++) {
        double lo = INFINITY, hi = -INFINITY;
        for (int i = 0; i < 6; i++) {
            const double x = scene->vertex_m[scene->triangle[i < 3 ? first : second][i % 3]][j];
            lo = x < lo ? x : lo;
            hi = x > hi ? x : hi;
        }
        d[j] = hi - lo;
    }
    return d[0] * d[1] + d[1] * d[2] + d[2] * d[0];
}

static int is_taken(const uint64_t *taken, uint32_t triangle)
{
    return (taken[triangle / 64] >> triangle % 64 & 1) != 0;
}

/* Finds the partner that makes the smallest box with the triangle, among the next ones of the list that a leaf can
 * name. Returns how far it follows the triangle; 0: there is none. */
static uint32_t partner(const struct scene *scene, uint32_t triangle, const uint64_t *taken)
{
    const uint32_t left = scene->n_triangles - triangle,
                   end = triangle + (left < BVH_LEAF_AHEAD ? left : BVH_LEAF_AHEAD);
    uint32_t best = 0;
    double best_m2 = INFINITY, own_m2 = -1.0;
    for (uint32_t i = triangle + 1; i < end; i++) {
        if (is_taken(taken, i) || odd_corner(scene->triangle[triangle], scene->triangle[i]) == 3 ||
            odd_corner(scene->triangle[i], scene->triangle[triangle]) == 3)
            continue;
        if (own_m2 < 0.0) own_m2 = box_m2(scene, triangle, triangle);
        const double both_m2 = box_m2(scene, triangle, i);
        if (both_m2 >= best_m2 || both_m2 > own_m2 + box_m2(scene, i, i)) continue;
        best = i - triangle;
        best_m2 = both_m2;
    }
    return best;
}

/* ---- their order */

/* Leaves lie in memory in the order of a curve through space (G. Morton, 1966): rays that follow each other meet leaves
 * that lie together. The order changes no hit. */
struct place {
    uint64_t key;
    uint32_t first, ahead; /* its first triangle, and how far its second one follows that */
};
enum { KEY_BITS = 16 };

/* Returns the bits of x with two zeros between each two of them. */
static uint64_t spread_bits(uint64_t x)
{
    x = (x | x << 16) & UINT64_C(0x0000ff0000ff);
    x = (x | x << 8) & UINT64_C(0x00f00f00f00f);
    x = (x | x << 4) & UINT64_C(0x0c30c30c30c3);
    return (x | x << 2) & UINT64_C(0x249249249249);
}

static uint64_t key_of(const struct scene *scene, uint32_t triangle, double per_m)
{
    uint64_t key = 0;
    for (int j = 0; j < 3; j++) {
        double sum = 0.0;
        for (int i = 0; i < 3; i++)
            sum += scene->vertex_m[scene->triangle[triangle][i]][j] - scene->min_m[j];
        key |= spread_bits((uint64_t)(sum * per_m)) << j;
    }
    return key;
}

/* Places with the same key keep the order of the scene's list. */
static int compare_places(const void *a, const void *b)
{
    const struct place *p = a, *q = b;
    return p->key != q->key ? (p->key > q->key) - (p->key < q->key) : (p->first > q->first) - (p->first < q->first);
}

/* Finds the leaves, and sets n_leaves. */
static int find_places(struct bvh *bvh, uint64_t *taken, struct place *place, const struct sh_report *report,
                       struct sh_err *err)
{
    const struct scene *scene = bvh->scene;
    double size_m = 0.0;
    for (int j = 0; j < 3; j++)
        size_m = fmax(size_m, scene->max_m[j] - scene->min_m[j]);
    const double per_m = size_m > 0.0 ? (double)((1 << KEY_BITS) - 1) / (3.0 * size_m) : 0.0;
    for (uint32_t i = 0; i < scene->n_triangles; i++) {
        if ((i & 0xffff) == 0 && sh_check_stop(report, err) != SH_OK) return SH_ESTOPPED;
        if (is_taken(taken, i)) continue;
        const uint32_t ahead = partner(scene, i, taken), second = i + ahead;
        taken[second / 64] |= UINT64_C(1) << second % 64;
        place[bvh->n_leaves++] = (struct place){key_of(scene, i, per_m), i, ahead};
    }
    return SH_OK;
}

int bvh_make_leaves(struct bvh *bvh, const struct sh_report *report, struct sh_err *err)
{
    const struct scene *scene = bvh->scene;
    const size_t n = scene->n_triangles;
    measure(bvh);
    struct place *place = malloc((n + 1) * sizeof *place);
    uint64_t *taken = calloc(n / 64 + 1, sizeof *taken);
    int rc = place != NULL && taken != NULL ? find_places(bvh, taken, place, report, err) : SH_ENOMEM;
    if (rc == SH_OK) {
        qsort(place, bvh->n_leaves, sizeof *place, compare_places);
        bvh->leaf = huge_pages_alloc((bvh->n_leaves + 1) * sizeof *bvh->leaf);
        if (bvh->leaf == NULL) rc = SH_ENOMEM;
    }
    if (rc == SH_ENOMEM) sh_fail(err, rc, "bvh: no memory for %zu triangles", n);
    for (uint32_t i = 0; i < bvh->n_leaves && rc == SH_OK; i++) {
        if ((i & 0xffff) == 0) rc = sh_check_stop(report, err);
        fill_leaf(bvh, place[i].first, place[i].ahead, &bvh->leaf[i]);
    }
    free(place);
    free(taken);
    return rc;
}

void bvh_pad_box(const struct bvh *bvh, const double lo_m[3], const double hi_m[3], double far_m, struct RTCBounds *box)
{
    const double pad_m = 0x1p-24 * pad_units_m(bvh, far_m);
    *box = (struct RTCBounds){.lower_x = below(lo_m[0] - pad_m),
                              .lower_y = below(lo_m[1] - pad_m),
                              .lower_z = below(lo_m[2] - pad_m),
                              .upper_x = above(hi_m[0] + pad_m),
                              .upper_y = above(hi_m[1] + pad_m),
                              .upper_z = above(hi_m[2] + pad_m)};
}

void embree_asks_bounds(const struct RTCBoundsFunctionArguments *args)
{
    const struct bvh *bvh = args->geometryUserPtr;
    const struct bvh_leaf *leaf = &bvh->leaf[args->primID];
    double lo[3], hi[3], v[4][3], far_m2 = 0.0;
    find_corners(bvh, leaf->triangle, bvh_leaf_ahead(bvh_leaf_rest(leaf)), v);
    vec3_bound_nothing(lo, hi);
    for (int i = 0; i < 4; i++) {
        vec3_bound(lo, hi, v[i]);
        far_m2 = larger(far_m2, vec3_dot(v[i], v[i]));
    }
    bvh_pad_box(bvh, lo, hi, sqrt(far_m2), args->bounds_o);
}
