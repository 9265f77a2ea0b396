/* What double precision makes of Embree's proposals: ranges from the planes, and which proposals are in
 * doubt. Loops over arrays that compilers turn into vectors. */
#include <math.h>

#include "core/bvh/bvh_inside.h"
#include "core/vec3.h"
#include "core/vecmath.h"

/* Embree sorts a packet's directions by their signs, but takes what is smaller than 1e-18 for positive when
 * it divides by it: with a component of -1e-22, all rays of that packet with its signs would be lost. So
 * there are none. */
VEC_INLINE float direction_component(double d)
{
    float f = (float)d;
    return f < 0.0f && f > -1e-15f ? 0.0f : f;
}

VEC_CLONES
void bvh_to_float(const struct vec3_in *dir, uint32_t n, float *restrict x, float *restrict y, float *restrict z)
{
    const struct vec3_in d = *dir;
    VEC_LOOP
    for (uint32_t i = 0; i < n; i++) {
        x[i] = direction_component(d.x[i]);
        y[i] = direction_component(d.y[i]);
        z[i] = direction_component(d.z[i]);
    }
}

VEC_INLINE uint32_t label_of(double ny, double nz)
{
    uint64_t low, high;
    memcpy(&low, &ny, sizeof low);
    memcpy(&high, &nz, sizeof high);
    return (uint32_t)((low & ((1U << BVH_SPARE_BITS) - 1)) | (high & 15) << BVH_SPARE_BITS);
}

/* Whether a hit is so near to its triangle's border that the proposal is in doubt, or the triangle has
 * holes. slope: what the guard counts in, bvh_inside.h. */
VEC_INLINE uint32_t in_doubt(double nx, double nz, double slope, float u, float v)
{
    float w = 1.0f - u - v;
    float least = u < v ? u : v;
    least = w < least ? w : least;
    uint64_t bits, high;
    double guard;
    memcpy(&bits, &nx, sizeof bits);
    bits = ((bits & ((1U << BVH_SPARE_BITS) - 1)) + BVH_GUARD_BASE) << BVH_GUARD_SHIFT;
    memcpy(&guard, &bits, sizeof guard);
    memcpy(&high, &nz, sizeof high);
    return ((double)least * slope < guard) | (uint32_t)((high & BVH_HOLES_BIT) != 0);
}

enum how { FROM_ONE, FROM_ONE_STEEP, FROM_OWN };

/* A miss has the highest number there is and reads the record after the last triangle, which is all NaN.
 * judge 0: the triangles are what the rays meet, and nothing is in doubt. */
VEC_INLINE uint32_t refine(const struct bvh_proposals *p, enum how how, int judge)
{
    const double *tri = (const double *)p->bvh->triangle, *dx = p->dir.x, *dy = p->dir.y, *dz = p->dir.z;
    const double *px = p->own.x, *py = p->own.y, *pz = p->own.z, ox = p->o[0], oy = p->o[1], oz = p->o[2];
    const uint32_t n_triangles = p->bvh->scene->n_triangles, n = p->n, *prim = p->prim;
    const float *u = p->u, *v = p->v;
    const int slanted = p->bvh->station_reach_m > 0.0;
    double *range_m = p->range_m;
    float *steep = p->steep;
    uint32_t *label = p->label, *doubt = p->doubt, doubts = 0;
    VEC_LOOP
    for (uint32_t i = 0; i < n; i++) {
        int64_t at = (int64_t)(prim[i] < n_triangles ? prim[i] : n_triangles) * 4;
        double nx = tri[at], ny = tri[at + 1], nz = tri[at + 2];
        double along = nx * dx[i] + ny * dy[i] + nz * dz[i];
        double off = how == FROM_OWN ? nx * px[i] + ny * py[i] + nz * pz[i] : nx * ox + ny * oy + nz * oz;
        range_m[i] = (tri[at + 3] - off) / along;
        if (how == FROM_ONE_STEEP) steep[i] = (float)(nx * nx + ny * ny + nz * nz) / (float)(along * along);
        label[i] = label_of(ny, nz);
        if (!judge) continue;
        doubt[i] = (in_doubt(nx, nz, slanted ? fabs(along) : 1.0, u[i], v[i]) | (range_m[i] <= BVH_AT_ORIGIN_M)) &
                   (prim[i] < n_triangles);
        doubts += doubt[i];
    }
    return doubts;
}

/* One function a case, so that the common one has no branch in its loop. */
VEC_CLONES
static uint32_t refine_from_one(const struct bvh_proposals *p)
{
    return refine(p, FROM_ONE, 1);
}

VEC_CLONES
static uint32_t refine_steep(const struct bvh_proposals *p)
{
    return refine(p, FROM_ONE_STEEP, 1);
}

VEC_CLONES
static uint32_t refine_from_own(const struct bvh_proposals *p)
{
    return refine(p, FROM_OWN, 1);
}

/* All hits on triangles that have rivals are in doubt, too. A hit of whose border there is no doubt stands, as it does
 * without rivals, but for these. */
VEC_CLONES
static uint32_t doubt_rivals(const struct bvh_proposals *p)
{
    const uint32_t *first = p->bvh->rival_first, n_triangles = p->bvh->scene->n_triangles, n = p->n, *prim = p->prim;
    uint32_t *doubt = p->doubt, doubts = 0;
    VEC_LOOP
    for (uint32_t i = 0; i < n; i++) {
        const int64_t at = (int64_t)(prim[i] < n_triangles ? prim[i] : n_triangles);
        const uint32_t rivals = first[at] != first[at + 1];
        doubts += doubt[i] | rivals;
        doubt[i] |= rivals * BVH_DOUBT_ORDER;
    }
    return doubts;
}

uint32_t bvh_refine(const struct bvh_proposals *p)
{
    const uint32_t doubts = p->own.x != NULL   ? refine_from_own(p)
                            : p->steep != NULL ? refine_steep(p)
                                               : refine_from_one(p);
    return p->bvh->rival_first != NULL ? doubt_rivals(p) : doubts;
}

enum { LANES = 8 };
typedef double lanes __attribute__((vector_size(LANES * sizeof(double))));
typedef float float_lanes __attribute__((vector_size(LANES * sizeof(float))));
typedef uint32_t number_lanes __attribute__((vector_size(LANES * sizeof(uint32_t))));

/* A plane, and where rays meet it. */
struct one_plane {
    double nx, ny, nz, nn, above; /* above: d - n . o */
    uint32_t triangle, label;
};

VEC_INLINE void range_of_one(const struct one_plane *p, const struct bvh_rays *rays, uint32_t i)
{
    const double along = p->nx * rays->dir.x[i] + p->ny * rays->dir.y[i] + p->nz * rays->dir.z[i];
    rays->range_m[i] = p->above / along;
    rays->triangle[i] = p->triangle;
    if (rays->label != NULL) rays->label[i] = p->label;
    if (rays->steep != NULL) rays->steep[i] = (float)p->nn / (float)(along * along);
}

/* Lanes by hand: compilers leave so short a loop as it is. */
VEC_INLINE void ranges_of_lanes(const struct one_plane *p, const struct bvh_rays *rays, uint32_t at)
{
    const number_lanes triangle = (number_lanes){0} + p->triangle, label = (number_lanes){0} + p->label;
    lanes x, y, z;
    memcpy(&x, rays->dir.x + at, sizeof x);
    memcpy(&y, rays->dir.y + at, sizeof y);
    memcpy(&z, rays->dir.z + at, sizeof z);
    const lanes along = p->nx * x + p->ny * y + p->nz * z, range_m = p->above / along;
    memcpy(rays->range_m + at, &range_m, sizeof range_m);
    memcpy(rays->triangle + at, &triangle, sizeof triangle);
    if (rays->label != NULL) memcpy(rays->label + at, &label, sizeof label);
    if (rays->steep == NULL) return;
    const float_lanes steep = (float)p->nn / __builtin_convertvector(along * along, float_lanes);
    memcpy(rays->steep + at, &steep, sizeof steep);
}

double bvh_range_of(const struct bvh *bvh, uint32_t triangle, const double at_m[3], const double dir[3])
{
    const struct bvh_plane *tri = &bvh->triangle[triangle];
    double o[3];
    vec3_sub(at_m, bvh->origin_m, o);
    return (tri->d - vec3_dot(tri->n, o)) / vec3_dot(tri->n, dir);
}

/* What meets nothing, without arithmetic. */
static void say_nothing(const struct bvh_rays *rays, uint32_t from, uint32_t to)
{
    for (uint32_t i = from; i < to; i++)
        rays->range_m[i] = (double)NAN;
    for (uint32_t i = from; i < to; i++)
        rays->triangle[i] = BVH_NO_TRIANGLE;
    for (uint32_t i = from; rays->label != NULL && i < to; i++)
        rays->label[i] = BVH_NO_LABEL;
    for (uint32_t i = from; rays->steep != NULL && i < to; i++)
        rays->steep[i] = NAN;
}

VEC_INLINE void set_plane(struct one_plane *p, const struct bvh *bvh, uint32_t triangle, const double o[3])
{
    const struct bvh_plane *tri = &bvh->triangle[triangle];
    *p = (struct one_plane){.nx = tri->n[0],
                            .ny = tri->n[1],
                            .nz = tri->n[2],
                            .nn = vec3_dot(tri->n, tri->n),
                            .above = tri->d - vec3_dot(tri->n, o),
                            .triangle = triangle,
                            .label = label_of(tri->n[1], tri->n[2])};
}

VEC_CLONES
void bvh_ranges_of(const struct bvh *bvh, uint32_t triangle, const struct bvh_rays *rays, uint32_t from, uint32_t to)
{
    struct one_plane p;
    double o[3];
    if (triangle == BVH_NO_TRIANGLE) {
        say_nothing(rays, from, to);
        return;
    }
    vec3_sub(rays->from.at_m, bvh->origin_m, o);
    set_plane(&p, bvh, triangle, o);
    const struct bvh_rays r = *rays; /* what is written may not change it */
    for (; from < to && r.n - from >= LANES; from += LANES)
        ranges_of_lanes(&p, &r, from);
    for (; from < to; from++)
        range_of_one(&p, &r, from);
}

void bvh_ranges_each(const struct bvh *bvh, const uint32_t *triangle, const struct bvh_rays *rays, uint32_t from,
                     uint32_t to)
{
    struct one_plane p;
    double o[3];
    vec3_sub(rays->from.at_m, bvh->origin_m, o);
    for (uint32_t i = from; i < to; i++) {
        if (triangle[i - from] == BVH_NO_TRIANGLE) {
            say_nothing(rays, i, i + 1);
        } else if (triangle[i - from] < bvh->scene->n_triangles) {
            set_plane(&p, bvh, triangle[i - from], o);
            range_of_one(&p, rays, i);
        }
    }
}

VEC_CLONES
void bvh_cosines(const struct bvh *bvh, const uint32_t *restrict triangle, const struct vec3_in *dir, uint32_t n,
                 double *restrict cosine)
{
    const double *tri = (const double *)bvh->triangle, *dx = dir->x, *dy = dir->y, *dz = dir->z;
    const uint32_t n_triangles = bvh->scene->n_triangles;
    VEC_LOOP
    for (uint32_t i = 0; i < n; i++) {
        int64_t at = (int64_t)(triangle[i] < n_triangles ? triangle[i] : n_triangles) * 4;
        double nx = tri[at], ny = tri[at + 1], nz = tri[at + 2];
        double c = fabs(nx * dx[i] + ny * dy[i] + nz * dz[i]) / sqrt(nx * nx + ny * ny + nz * nz);
        cosine[i] = c > 1.0 ? 1.0 : c;
    }
}

/* The same operations as in refine: it does not matter who decides a ray. */
float bvh_steep(const struct bvh *bvh, uint32_t prim, const double dir[3])
{
    const uint32_t n_triangles = bvh->scene->n_triangles;
    const double *n = bvh->triangle[prim < n_triangles ? prim : n_triangles].n, along = vec3_dot(n, dir);
    return (float)vec3_dot(n, n) / (float)(along * along);
}
