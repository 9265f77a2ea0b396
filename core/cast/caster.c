#include "core/cast.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/cast/bvh.h"
#include "core/rng.h"
#include "core/vecmath.h"

enum { CHUNK = 256 }; /* pulses worked on at a time: all arrays together stay in the first-level cache */

struct caster {
    double mirror_turn[CHUNK], pan_turn[CHUNK];
    double dx[CHUNK], dy[CHUNK], dz[CHUNK]; /* true direction, then the one the encoders read; prcs */
    double range_m[CHUNK];
    float fx[CHUNK], fy[CHUNK], fz[CHUNK];  /* the direction as Embree gets it */
    uint32_t prim[CHUNK];
    float t[CHUNK], u[CHUNK], v[CHUNK];
    uint8_t doubt[CHUNK];                   /* the proposal has to be decided in double */
    struct cast_counters counters;
};

int caster_create(uint32_t max_pulses, struct caster **out, struct sh_err *err)
{
    *out = aligned_alloc(64, (sizeof **out + 63) / 64 * 64);
    if (*out == NULL) return sh_fail(err, SH_ENOMEM, "cast: no memory for a caster");
    memset(*out, 0, sizeof **out);
    (void)max_pulses; /* chunks have one size */
    return SH_OK;
}

void caster_free(struct caster *caster)
{
    free(caster);
}

void caster_get_counters(const struct caster *caster, struct cast_counters *counters)
{
    *counters = caster->counters;
}

void cast_rotation(double heading_rad, double rotation[9])
{
    double s = sin(heading_rad), c = cos(heading_rad);
    const double r[9] = {c, s, 0.0, -s, c, 0.0, 0.0, 0.0, 1.0};
    memcpy(rotation, r, sizeof r);
}

uint32_t cast_encoder_count(double turn, double counts_per_turn)
{
    double within = turn - floor(turn);
    double count = floor(within * counts_per_turn + 0.5);
    return count >= counts_per_turn ? 0 : (uint32_t)(uint64_t)count;
}

VEC_CLONES
static void angles(struct caster *c, const struct schedule_run *run, uint32_t first, uint32_t n)
{
    uint64_t r0 = run->r + first * run->num;
    double place0 = (double)(run->in_line + first);
    for (uint32_t i = 0; i < n; i++) {
        c->mirror_turn[i] = run->mirror0_turn + (double)(int64_t)(r0 + i * run->num) * run->mirror_turn_per_r;
        c->pan_turn[i] = run->pan0_turn + (place0 + (double)(int32_t)i) * run->pan_step_turn;
    }
}

VEC_CLONES
static void directions(struct caster *c, const double m[9], uint32_t n)
{
    for (uint32_t i = 0; i < n; i++) {
        double sm, cm, sp, cp;
        vec_sincos_turn(c->mirror_turn[i], &sm, &cm);
        vec_sincos_turn(c->pan_turn[i], &sp, &cp);
        double x = sp * cm, y = cp * cm;
        c->dx[i] = m[0] * x + m[1] * y + m[2] * sm;
        c->dy[i] = m[3] * x + m[4] * y + m[5] * sm;
        c->dz[i] = m[6] * x + m[7] * y + m[8] * sm;
    }
}

VEC_CLONES
static void to_float(struct caster *c, uint32_t n)
{
    for (uint32_t i = 0; i < n; i++) {
        c->fx[i] = (float)c->dx[i];
        c->fy[i] = (float)c->dy[i];
        c->fz[i] = (float)c->dz[i];
    }
}

/* Exact range R = (d - n.o) / (n.dir) from the plane of the triangle that Embree proposed, NaN for none; and whether the
 * hit is so near to the border, across the ray, that the proposal is in doubt. */
VEC_CLONES
static void refine(struct caster *c, const struct bvh *bvh, const double o[3], uint32_t n)
{
    const struct bvh_triangle *triangle = bvh->triangle;
    double ox = o[0], oy = o[1], oz = o[2];
    for (uint32_t i = 0; i < n; i++) {
        uint32_t miss = c->prim[i] == RTC_INVALID_GEOMETRY_ID;
        const struct bvh_triangle *tri = &triangle[miss ? 0 : c->prim[i]];
        double along = tri->n[0] * c->dx[i] + tri->n[1] * c->dy[i] + tri->n[2] * c->dz[i];
        double range = (tri->d - (tri->n[0] * ox + tri->n[1] * oy + tri->n[2] * oz)) / along;
        float w = 1.0f - c->u[i] - c->v[i];
        float least = c->u[i] < c->v[i] ? c->u[i] : c->v[i];
        least = w < least ? w : least;
        float margin = least * (float)fabs(along);
        c->range_m[i] = miss ? NAN : range;
        c->doubt[i] = !miss & !(margin >= tri->guard);
    }
}

static void decide(struct caster *c, const struct cast_setup *s, const double o[3], uint32_t n, float t_max)
{
    struct decide_ray ray = {.bvh = s->bvh, .t_max = t_max};
    memcpy(ray.station_m, s->station_m, sizeof ray.station_m);
    memcpy(ray.o_local, o, sizeof ray.o_local);
    for (uint32_t i = 0; i < n; i++) {
        if (!c->doubt[i]) continue;
        struct decide_hit hit;
        ray.dir[0] = c->dx[i];
        ray.dir[1] = c->dy[i];
        ray.dir[2] = c->dz[i];
        decide_hit(&ray, c->prim[i], c->t[i], &c->counters, &hit);
        c->prim[i] = hit.prim;
        c->range_m[i] = hit.prim == RTC_INVALID_GEOMETRY_ID ? (double)NAN : hit.range_m;
    }
}

VEC_CLONES
static void add_noise(struct caster *c, const struct cast_setup *s, uint64_t pulse0, uint32_t n)
{
    for (uint32_t i = 0; i < n; i++) {
        double sigma = s->range_sigma_m + 1e-6 * s->range_sigma_ppm * c->range_m[i];
        c->range_m[i] += sigma * rng_normal(s->noise_key, pulse0 + i);
    }
}

/* An echo is there when the true range lies within the head's limits. Returns how many. */
static uint32_t detect(struct caster *c, const struct cast_setup *s, struct line_block *block, uint32_t at, uint32_t n)
{
    const struct bvh_triangle *triangle = s->bvh->triangle;
    uint32_t echoes = 0;
    for (uint32_t i = 0; i < n; i++) {
        int hit = c->range_m[i] >= s->range_min_m && c->range_m[i] <= s->range_max_m;
        block->echo[at + i] = hit ? 0x11 : 0;
        block->label[at + i] = hit ? triangle[c->prim[i]].label : LINE_LABEL_NONE;
        block->refl_cdb[at + i] = LINE_REFL_NONE;
        if (!hit) c->range_m[i] = NAN;
        echoes += (uint32_t)hit;
    }
    return echoes;
}

static void times(const struct schedule_run *run, struct line_block *block)
{
    uint64_t acc = run->ns_acc;
    uint32_t dt = 0, quot = (uint32_t)run->ns_quot;
    for (uint32_t i = 0; i < run->n; i++) {
        block->dt_ns[i] = dt;
        acc += run->ns_rem;
        dt += quot;
        if (acc >= run->ns_den) {
            acc -= run->ns_den;
            dt++;
        }
    }
}

static int is_ideal(const struct cast_setup *s)
{
    return s->mirror_counts >= 4294967296.0 && s->pan_counts >= 4294967296.0;
}

VEC_INLINE uint32_t count_of(double turn, double counts)
{
    uint64_t bits;
    double below = vec_round(turn - 0.5, &bits);      /* floor, up to a tie that the next line undoes */
    double within = turn - below;
    within = within >= 1.0 ? within - 1.0 : within;
    double count = vec_round(within * counts, &bits);
    return count >= counts ? 0 : (uint32_t)bits;
}

VEC_CLONES
static void fill_polar(const struct caster *c, const struct cast_setup *s, struct line_block *block, uint32_t at, uint32_t n)
{
    double per_m = 1.0 / s->range_scale_m;
    for (uint32_t i = 0; i < n; i++) {
        uint64_t bits;
        double range = c->range_m[i] > 0.0 ? c->range_m[i] : 0.0; /* NaN and noise below zero read 0 */
        vec_round(range * per_m, &bits);
        block->a[at + i] = (uint32_t)bits;
        block->b[at + i] = count_of(c->mirror_turn[i], s->mirror_counts);
        block->c[at + i] = count_of(c->pan_turn[i], s->pan_counts);
    }
}

/* Angles as the encoders read them: whole counts. */
VEC_CLONES
static void read_encoders(struct caster *c, double mirror_counts, double pan_counts, uint32_t n)
{
    for (uint32_t i = 0; i < n; i++) {
        uint64_t bits;
        c->mirror_turn[i] = vec_round(c->mirror_turn[i] * mirror_counts, &bits) / mirror_counts;
        c->pan_turn[i] = vec_round(c->pan_turn[i] * pan_counts, &bits) / pan_counts;
    }
}

VEC_CLONES
static void fill_geo(struct caster *c, const struct cast_setup *s, struct line_block *block, uint32_t at, uint32_t n)
{
    double per_m = 1.0 / s->xyz_scale_m;
    for (uint32_t i = 0; i < n; i++) {
        uint64_t x, y, z;
        vec_round(c->dx[i] * per_m, &x);
        vec_round(c->dy[i] * per_m, &y);
        vec_round(c->dz[i] * per_m, &z);
        int miss = block->echo[at + i] == 0;
        block->a[at + i] = miss ? (uint32_t)LINE_XYZ_NONE : (uint32_t)x;
        block->b[at + i] = miss ? (uint32_t)LINE_XYZ_NONE : (uint32_t)y;
        block->c[at + i] = miss ? (uint32_t)LINE_XYZ_NONE : (uint32_t)z;
    }
}

static void positions(struct caster *c, const struct cast_setup *s, struct line_block *block, uint32_t at, uint32_t n)
{
    if (!is_ideal(s)) {
        read_encoders(c, s->mirror_counts, s->pan_counts, n);
        directions(c, s->rotation, n);
    }
    for (uint32_t i = 0; i < n; i++) {
        c->dx[i] *= c->range_m[i];
        c->dy[i] *= c->range_m[i];
        c->dz[i] *= c->range_m[i];
    }
    georef_forward(s->georef, n, c->dx, c->dy, c->dz, c->dx, c->dy, c->dz);
    fill_geo(c, s, block, at, n);
}

static uint32_t cast_chunk(struct caster *c, const struct cast_setup *s, const struct schedule_run *run,
                           struct line_block *block, uint32_t at, uint32_t n)
{
    double o[3];
    for (int i = 0; i < 3; i++)
        o[i] = s->station_m[i] - s->bvh->origin_m[i];
    struct bvh_rays rays = {.org = {(float)o[0], (float)o[1], (float)o[2]},
                            .t_max = (float)(s->range_max_m * 1.001),
                            .dx = c->fx, .dy = c->fy, .dz = c->fz, .prim = c->prim, .t = c->t, .u = c->u, .v = c->v};
    angles(c, run, at, n);
    directions(c, s->rotation, n);
    to_float(c, n);
    bvh_intersect(s->bvh, &rays, n);
    refine(c, s->bvh, o, n);
    decide(c, s, o, n, rays.t_max);
    uint32_t echoes = detect(c, s, block, at, n);
    if (s->noise_on) add_noise(c, s, run->pulse0 + at, n);
    if (s->layout == LINE_POLAR)
        fill_polar(c, s, block, at, n);
    else
        positions(c, s, block, at, n);
    return echoes;
}

uint32_t caster_cast(struct caster *caster, const struct cast_setup *setup, const struct schedule_run *run,
                     struct line_block *block)
{
    uint32_t echoes = 0;
    block->frame = run->frame;
    block->line = run->line;
    block->pulse0 = run->pulse0;
    block->n_pulses = run->n;
    block->t0_ns = run->t0_ns;
    block->line_t0_ns = run->line_t0_ns;
    block->layout = setup->layout;
    block->n_points = run->n;
    times(run, block);
    /* The first packet of a run may begin within a packet of the line; later chunks begin at one. */
    uint32_t lead = run->in_line % SCHEDULE_PACKET;
    for (uint32_t at = 0; at < run->n;) {
        uint32_t n = lead != 0 ? SCHEDULE_PACKET - lead : CHUNK;
        if (n > run->n - at) n = run->n - at;
        echoes += cast_chunk(caster, setup, run, block, at, n);
        at += n;
        lead = 0;
    }
    return echoes;
}
