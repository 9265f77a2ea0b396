#include "core/cast/kernels.h"

#include <math.h>

#include "core/rng.h"
#include "core/vecmath.h"

VEC_CLONES
void kernel_angles(const struct schedule_run *run, uint32_t first, uint32_t n, double *restrict mirror_turn,
                   double *restrict pan_turn)
{
    const double mirror0 = run->mirror0_turn, per_r = run->mirror_turn_per_r, pan0 = run->pan0_turn;
    const double step = run->pan_step_turn, place0 = (double)(run->in_line + first);
    const int64_t r0 = (int64_t)(run->r + first * run->num), num = (int64_t)run->num;
    for (uint32_t i = 0; i < n; i++) {
        mirror_turn[i] = mirror0 + (double)(r0 + (int64_t)i * num) * per_r;
        pan_turn[i] = pan0 + (place0 + (double)(int32_t)i) * step;
    }
}

VEC_CLONES
void kernel_directions(const double *restrict mirror_turn, const double *restrict pan_turn, const double m[9],
                       uint32_t n, double *restrict dx, double *restrict dy, double *restrict dz)
{
    const double m0 = m[0], m1 = m[1], m2 = m[2], m3 = m[3], m4 = m[4], m5 = m[5], m6 = m[6], m7 = m[7], m8 = m[8];
    for (uint32_t i = 0; i < n; i++) {
        double sm, cm, sp, cp;
        vec_sincos_turn(mirror_turn[i], &sm, &cm);
        vec_sincos_turn(pan_turn[i], &sp, &cp);
        double x = sp * cm, y = cp * cm;
        dx[i] = m0 * x + m1 * y + m2 * sm;
        dy[i] = m3 * x + m4 * y + m5 * sm;
        dz[i] = m6 * x + m7 * y + m8 * sm;
    }
}

/* An encoder is off by at most half a count, d: sin(a + d) = sin a + d cos a - d^2/2 sin a leaves d^3/6, below 1e-12
 * for 2^12 counts per turn and more. */
VEC_CLONES
static void directions_read(const double *restrict mirror_turn, const double *restrict pan_turn, double mirror_counts,
                            double pan_counts, double use, const double m[9], const double q[9], uint32_t n,
                            double *restrict dx, double *restrict dy, double *restrict dz, double *restrict ex,
                            double *restrict ey, double *restrict ez)
{
    const double m0 = m[0], m1 = m[1], m2 = m[2], m3 = m[3], m4 = m[4], m5 = m[5], m6 = m[6], m7 = m[7], m8 = m[8];
    const double q0 = q[0], q1 = q[1], q2 = q[2], q3 = q[3], q4 = q[4], q5 = q[5], q6 = q[6], q7 = q[7], q8 = q[8];
    const double mirror_step = use * VEC_TURN_RAD / mirror_counts, pan_step = use * VEC_TURN_RAD / pan_counts;
    for (uint32_t i = 0; i < n; i++) {
        double sm, cm, sp, cp;
        uint64_t bits;
        vec_sincos_turn(mirror_turn[i], &sm, &cm);
        vec_sincos_turn(pan_turn[i], &sp, &cp);
        double x = sp * cm, y = cp * cm;
        dx[i] = m0 * x + m1 * y + m2 * sm;
        dy[i] = m3 * x + m4 * y + m5 * sm;
        dz[i] = m6 * x + m7 * y + m8 * sm;
        double mc = mirror_turn[i] * mirror_counts, pc = pan_turn[i] * pan_counts;
        double dm = (vec_round(mc, &bits) - mc) * mirror_step, dp = (vec_round(pc, &bits) - pc) * pan_step;
        double hm = 1.0 - 0.5 * dm * dm, hp = 1.0 - 0.5 * dp * dp;
        double rsm = sm * hm + cm * dm, rcm = cm * hm - sm * dm, rsp = sp * hp + cp * dp, rcp = cp * hp - sp * dp;
        double rx = rsp * rcm, ry = rcp * rcm;
        ex[i] = q0 * rx + q1 * ry + q2 * rsm;
        ey[i] = q3 * rx + q4 * ry + q5 * rsm;
        ez[i] = q6 * rx + q7 * ry + q8 * rsm;
    }
}

void kernel_directions_read(const struct cast_setup *setup, const double *mirror_turn, const double *pan_turn,
                            const double rotation[9], const double to_crs[9], uint32_t n, double *dx, double *dy,
                            double *dz, double *ex, double *ey, double *ez)
{
    int ideal = setup->mirror_counts >= 4294967296.0 && setup->pan_counts >= 4294967296.0;
    directions_read(mirror_turn, pan_turn, setup->mirror_counts, setup->pan_counts, ideal ? 0.0 : 1.0, rotation, to_crs,
                    n, dx, dy, dz, ex, ey, ez);
}

/* Embree tells a packet's directions apart by their signs, but takes what is smaller than 1e-18 for positive when it
 * divides by it: with a component of -1e-22, all rays of that packet with its signs would be lost. So there are none.
 */
VEC_INLINE float direction_component(double d)
{
    float f = (float)d;
    return f < 0.0f && f > -1e-15f ? 0.0f : f;
}

VEC_CLONES
void kernel_to_float(const double *restrict dx, const double *restrict dy, const double *restrict dz, uint32_t n,
                     float *restrict fx, float *restrict fy, float *restrict fz)
{
    for (uint32_t i = 0; i < n; i++) {
        fx[i] = direction_component(dx[i]);
        fy[i] = direction_component(dy[i]);
        fz[i] = direction_component(dz[i]);
    }
}

/* Whether a hit is so near to its triangle's border that the proposal is in doubt, and the triangle's label. slope:
 * what the guard counts in, bvh.h. */
VEC_INLINE uint32_t in_doubt(double nx, double ny, double nz, double slope, float u, float v, int hit, uint32_t *label)
{
    float w = 1.0f - u - v;
    float least = u < v ? u : v;
    least = w < least ? w : least;
    uint64_t bits;
    double guard;
    memcpy(&bits, &nx, sizeof bits);
    bits = ((bits & ((1U << BVH_SPARE_BITS) - 1)) + BVH_GUARD_BASE) << BVH_GUARD_SHIFT;
    memcpy(&guard, &bits, sizeof guard);
    uint64_t low, high;
    memcpy(&low, &ny, sizeof low);
    memcpy(&high, &nz, sizeof high);
    *label = (uint32_t)((low & ((1U << BVH_SPARE_BITS) - 1)) | (high & 15) << BVH_SPARE_BITS);
    uint32_t near = ((double)least * slope < guard) | (uint32_t)((high & BVH_RIVAL_BIT) != 0);
    return near & (uint32_t)hit;
}

/* A miss has the highest number there is and reads the record behind the last triangle, which is all NaN. */
VEC_CLONES
static uint32_t refine(const double *restrict tri, uint32_t n_triangles, const uint32_t *restrict prim,
                       const double *restrict dx, const double *restrict dy, const double *restrict dz,
                       const float *restrict u, const float *restrict v, const double o[3], int slanted, uint32_t n,
                       double *restrict range_m, uint32_t *restrict label, uint32_t *restrict doubt)
{
    const double ox = o[0], oy = o[1], oz = o[2];
    uint32_t doubts = 0;
    for (uint32_t i = 0; i < n; i++) {
        int64_t at = (int64_t)(prim[i] < n_triangles ? prim[i] : n_triangles) * 4;
        double nx = tri[at], ny = tri[at + 1], nz = tri[at + 2];
        double along = nx * dx[i] + ny * dy[i] + nz * dz[i];
        range_m[i] = (tri[at + 3] - (nx * ox + ny * oy + nz * oz)) / along;
        doubt[i] = in_doubt(nx, ny, nz, slanted ? fabs(along) : 1.0, u[i], v[i], prim[i] < n_triangles, &label[i]);
        doubts += doubt[i];
    }
    return doubts;
}

/* The same, and 1 / cos^2 of the incidence. */
VEC_CLONES
static uint32_t refine_steep(const double *restrict tri, uint32_t n_triangles, const uint32_t *restrict prim,
                             const double *restrict dx, const double *restrict dy, const double *restrict dz,
                             const float *restrict u, const float *restrict v, const double o[3], uint32_t n,
                             double *restrict range_m, uint32_t *restrict label, uint32_t *restrict doubt,
                             float *restrict steep)
{
    const double ox = o[0], oy = o[1], oz = o[2];
    uint32_t doubts = 0;
    for (uint32_t i = 0; i < n; i++) {
        int64_t at = (int64_t)(prim[i] < n_triangles ? prim[i] : n_triangles) * 4;
        double nx = tri[at], ny = tri[at + 1], nz = tri[at + 2];
        double along = nx * dx[i] + ny * dy[i] + nz * dz[i];
        range_m[i] = (tri[at + 3] - (nx * ox + ny * oy + nz * oz)) / along;
        steep[i] = (float)(nx * nx + ny * ny + nz * nz) / (float)(along * along);
        doubt[i] = in_doubt(nx, ny, nz, fabs(along), u[i], v[i], prim[i] < n_triangles, &label[i]);
        doubts += doubt[i];
    }
    return doubts;
}

uint32_t kernel_refine(const struct bvh *bvh, const struct kernel_hits *hits, const double o[3], uint32_t n)
{
    if (hits->steep != NULL)
        return refine_steep((const double *)bvh->triangle, bvh->scene->n_triangles, hits->prim, hits->dx, hits->dy,
                            hits->dz, hits->u, hits->v, o, n, hits->range_m, hits->label, hits->doubt, hits->steep);
    return refine((const double *)bvh->triangle, bvh->scene->n_triangles, hits->prim, hits->dx, hits->dy, hits->dz,
                  hits->u, hits->v, o, bvh->station_reach_m > 0.0, n, hits->range_m, hits->label, hits->doubt);
}

/* refine with an origin for each ray, and so slanted; kept apart, so that the common case stays as fast as it is. */
VEC_CLONES
static uint32_t refine_from(const double *restrict tri, uint32_t n_triangles, const uint32_t *restrict prim,
                            const double *restrict dx, const double *restrict dy, const double *restrict dz,
                            const float *restrict u, const float *restrict v, const double *restrict ox,
                            const double *restrict oy, const double *restrict oz, uint32_t n, double *restrict range_m,
                            uint32_t *restrict label, uint32_t *restrict doubt)
{
    uint32_t doubts = 0;
    for (uint32_t i = 0; i < n; i++) {
        int64_t at = (int64_t)(prim[i] < n_triangles ? prim[i] : n_triangles) * 4;
        double nx = tri[at], ny = tri[at + 1], nz = tri[at + 2];
        double along = nx * dx[i] + ny * dy[i] + nz * dz[i];
        range_m[i] = (tri[at + 3] - (nx * ox[i] + ny * oy[i] + nz * oz[i])) / along;
        doubt[i] = in_doubt(nx, ny, nz, fabs(along), u[i], v[i], prim[i] < n_triangles, &label[i]);
        doubts += doubt[i];
    }
    return doubts;
}

uint32_t kernel_refine_from(const struct bvh *bvh, const struct kernel_hits *hits, const double *ox, const double *oy,
                            const double *oz, uint32_t n)
{
    return refine_from((const double *)bvh->triangle, bvh->scene->n_triangles, hits->prim, hits->dx, hits->dy, hits->dz,
                       hits->u, hits->v, ox, oy, oz, n, hits->range_m, hits->label, hits->doubt);
}

VEC_CLONES
static void plain(const uint16_t *restrict label_of, uint32_t n_triangles, const uint32_t *restrict prim,
                  const float *restrict t, uint32_t n, double *restrict range_m, uint32_t *restrict label)
{
    for (uint32_t i = 0; i < n; i++)
        range_m[i] = prim[i] < n_triangles ? (double)t[i] : (double)NAN;
    for (uint32_t i = 0; i < n; i++)
        label[i] = prim[i] < n_triangles ? label_of[prim[i]] : (uint32_t)LINE_LABEL_NONE;
}

void kernel_plain(const struct bvh *bvh, const uint32_t *prim, const float *t, uint32_t n, double *range_m,
                  uint32_t *label)
{
    plain(bvh->scene->label, bvh->scene->n_triangles, prim, t, n, range_m, label);
}

VEC_CLONES
static void cosines(const double *restrict tri, uint32_t n_triangles, const uint32_t *restrict hit,
                    const double *restrict dx, const double *restrict dy, const double *restrict dz, uint32_t n,
                    double *restrict cosine)
{
    for (uint32_t i = 0; i < n; i++) {
        int64_t at = (int64_t)(hit[i] < n_triangles ? hit[i] : n_triangles) * 4;
        double nx = tri[at], ny = tri[at + 1], nz = tri[at + 2];
        double c = fabs(nx * dx[i] + ny * dy[i] + nz * dz[i]) / sqrt(nx * nx + ny * ny + nz * nz);
        cosine[i] = c > 1.0 ? 1.0 : c;
    }
}

void kernel_cosines(const struct bvh *bvh, const uint32_t *hit, const double *dx, const double *dy, const double *dz,
                    uint32_t n, double *cosine)
{
    cosines((const double *)bvh->triangle, bvh->scene->n_triangles, hit, dx, dy, dz, n, cosine);
}

VEC_CLONES
int kernel_meets_sphere(const double *restrict dx, const double *restrict dy, const double *restrict dz, uint32_t n,
                        const double v[3], double radius_m)
{
    const double x = v[0], y = v[1], z = v[2], v2 = x * x + y * y + z * z, r2 = radius_m * radius_m;
    uint64_t meets = v2 <= r2;
    for (uint32_t i = 0; i < n; i++) {
        double along = x * dx[i] + y * dy[i] + z * dz[i];
        uint64_t near = v2 - along * along <= r2, ahead = along > 0.0;
        meets |= near & ahead;
    }
    return meets != 0;
}

VEC_CLONES
void kernel_turn_back(const double *restrict dx, const double *restrict dy, const double *restrict dz,
                      const double m[9], uint32_t n, double *restrict ex, double *restrict ey, double *restrict ez)
{
    const double m0 = m[0], m1 = m[1], m2 = m[2], m3 = m[3], m4 = m[4], m5 = m[5], m6 = m[6], m7 = m[7], m8 = m[8];
    for (uint32_t i = 0; i < n; i++) {
        ex[i] = m0 * dx[i] + m3 * dy[i] + m6 * dz[i];
        ey[i] = m1 * dx[i] + m4 * dy[i] + m7 * dz[i];
        ez[i] = m2 * dx[i] + m5 * dy[i] + m8 * dz[i];
    }
}

VEC_CLONES
static void noise(double sigma0, double sigma1, uint64_t key, uint64_t pulse0, uint32_t n, double *restrict range_m)
{
    for (uint32_t i = 0; i < n; i++)
        range_m[i] += (sigma0 + sigma1 * range_m[i]) * rng_normal(key, pulse0 + i);
}

void kernel_noise(const struct cast_setup *setup, uint64_t pulse0, uint32_t n, double *range_m)
{
    noise(setup->range_sigma_m, 1e-6 * setup->range_sigma_ppm, setup->noise_key, pulse0, n, range_m);
}

VEC_CLONES
uint32_t kernel_detect(double *restrict range_m, double min_m, double max_m, uint32_t n, uint8_t *restrict echo)
{
    uint32_t echoes = 0;
    for (uint32_t i = 0; i < n; i++) {
        uint32_t hit = (range_m[i] >= min_m) & (range_m[i] <= max_m);
        range_m[i] = hit ? range_m[i] : (double)NAN;
        echo[i] = (uint8_t)(hit * 0x11);
        echoes += hit;
    }
    return echoes;
}

VEC_CLONES
void kernel_labels(const uint32_t *restrict label, const uint8_t *restrict echo, uint32_t n, uint16_t *restrict out)
{
    for (uint32_t i = 0; i < n; i++)
        out[i] = (uint16_t)(echo[i] != 0 ? label[i] : (uint32_t)LINE_LABEL_NONE);
}

/* Whole counts of an angle modulo a turn. */
VEC_INLINE uint32_t count_of(double turn, double counts)
{
    uint64_t bits;
    double below = vec_round(turn - 0.5, &bits); /* floor, up to a tie that the next line undoes */
    double within = turn - below;
    within = within >= 1.0 ? within - 1.0 : within;
    double count = vec_round(within * counts, &bits);
    bits = count >= counts ? 0 : bits;
    return (uint32_t)bits;
}

VEC_CLONES
static void polar(const double *restrict range_m, const double *restrict mirror_turn, const double *restrict pan_turn,
                  double per_m, double mirror_counts, double pan_counts, uint32_t n, uint32_t *restrict a,
                  uint32_t *restrict b, uint32_t *restrict c)
{
    for (uint32_t i = 0; i < n; i++) {
        uint64_t bits;
        double range = range_m[i] > 0.0 ? range_m[i] : 0.0; /* NaN, and noise below zero, read 0 */
        vec_round(range * per_m, &bits);
        a[i] = (uint32_t)bits;
    }
    for (uint32_t i = 0; i < n; i++)
        b[i] = count_of(mirror_turn[i], mirror_counts);
    for (uint32_t i = 0; i < n; i++)
        c[i] = count_of(pan_turn[i], pan_counts);
}

void kernel_polar(const struct cast_setup *setup, const double *range_m, const double *mirror_turn,
                  const double *pan_turn, uint32_t n, uint32_t *a, uint32_t *b, uint32_t *c)
{
    polar(range_m, mirror_turn, pan_turn, 1.0 / setup->range_scale_m, setup->mirror_counts, setup->pan_counts, n, a, b,
          c);
}

VEC_CLONES
static uint32_t counts_of(const double *restrict x, double per_unit, uint32_t n, uint32_t *restrict out)
{
    uint64_t unfit = 0;
    for (uint32_t i = 0; i < n; i++) {
        uint64_t bits;
        double count = x[i] * per_unit;
        vec_round(count, &bits);
        uint64_t fits = fabs(count) < 2147483647.0; /* not-a-number does not */
        unfit += (uint64_t)(x[i] == x[i]) & (fits ^ 1);
        bits = fits ? bits : (uint64_t)(uint32_t)LINE_XYZ_NONE;
        out[i] = (uint32_t)bits;
    }
    return (uint32_t)unfit;
}

uint32_t kernel_geo(const double *x, const double *y, const double *z, const double scale[3], uint32_t n, uint32_t *a,
                    uint32_t *b, uint32_t *c)
{
    return counts_of(x, 1.0 / scale[0], n, a) + counts_of(y, 1.0 / scale[1], n, b) + counts_of(z, 1.0 / scale[2], n, c);
}

VEC_CLONES
void kernel_scale(const double *restrict range_m, uint32_t n, double *restrict x, double *restrict y,
                  double *restrict z)
{
    for (uint32_t i = 0; i < n; i++) {
        x[i] *= range_m[i];
        y[i] *= range_m[i];
        z[i] *= range_m[i];
    }
}

/* The remainder is below the divisor, so each step adds the quotient or one more. */
void kernel_times(const struct schedule_run *run, uint32_t *dt_ns)
{
    uint64_t acc = run->ns_acc;
    const uint64_t rem = run->ns_rem, den = run->ns_den;
    uint32_t dt = 0;
    const uint32_t quot = (uint32_t)run->ns_quot;
    for (uint32_t i = 0; i < run->n; i++) {
        dt_ns[i] = dt;
        acc += rem;
        uint64_t carry = acc >= den;
        acc -= carry ? den : 0;
        dt += quot + (uint32_t)carry;
    }
}
