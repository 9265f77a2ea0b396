#include "core/cast.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/cast/kernels.h"

/* Pulses worked on at a time: the arrays stay in the second-level cache, the hits' planes are on their way. */
enum { CHUNK = BVH_CHUNK };

struct mover_rays {
    double dx[CHUNK], dy[CHUNK], dz[CHUNK], range_m[CHUNK];
    uint32_t hit[CHUNK];
};

struct caster {
    struct bvh_packets packets;
    double mirror_turn[CHUNK], pan_turn[CHUNK];
    double dx[CHUNK], dy[CHUNK], dz[CHUNK]; /* direction of the beam, prcs */
    double ex[CHUNK], ey[CHUNK], ez[CHUNK]; /* direction as the encoders read it, then the position; geo layout */
    double range_m[CHUNK];
    float fx[CHUNK], fy[CHUNK], fz[CHUNK]; /* the direction as Embree gets it */
    uint32_t prim[CHUNK], hit[CHUNK];      /* as proposed; as decided */
    float t[CHUNK], u[CHUNK], v[CHUNK];
    uint32_t doubt[CHUNK];              /* the proposal has to be decided in double */
    uint32_t seen[CHUNK], label[CHUNK]; /* labels of the last hits; of what counts in the end */
    struct mover_rays mover;            /* touched only where something moves */
    struct cast_counters counters;
    struct cast_profile *profile;
};

/* What has passed since the stage before belongs to this one. */
static inline void ends(struct caster *c, enum cast_stage stage)
{
    if (c->profile == NULL) return;
    uint64_t now = c->profile->now();
    c->profile->spent[stage] += now - c->profile->last;
    c->profile->last = now;
}

void caster_set_profile(struct caster *caster, struct cast_profile *profile)
{
    caster->profile = profile;
}

int caster_create(struct caster **out, struct sh_err *err)
{
    *out = aligned_alloc(64, (sizeof **out + 63) / 64 * 64);
    if (*out == NULL) return sh_fail(err, SH_ENOMEM, "cast: no memory for a caster");
    memset(*out, 0, sizeof **out);
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

static void decide_one(struct caster *c, struct decide_ray *ray, const struct kernel_hits *hits, uint32_t *prim,
                       uint32_t i)
{
    struct decide_hit hit;
    ray->dir[0] = hits->dx[i];
    ray->dir[1] = hits->dy[i];
    ray->dir[2] = hits->dz[i];
    decide_hit(ray, prim[i], c->t[i], &c->counters, &hit);
    prim[i] = hit.prim;
    hits->label[i] =
        hit.prim == RTC_INVALID_GEOMETRY_ID ? (uint32_t)LINE_LABEL_NONE : bvh_label(&ray->bvh->triangle[hit.prim]);
    hits->range_m[i] = hit.prim == RTC_INVALID_GEOMETRY_ID ? (double)NAN : hit.range_m;
}

/* Doubts are few: whole packets without any are passed at once. Each costs a chain of cache misses, so they are looked
 * up together. */
static void decide(struct caster *c, struct decide_ray *ray, const struct kernel_hits *hits, uint32_t *prim, uint32_t n)
{
    uint32_t doubts = 0, in_doubt[CHUNK];
    for (uint32_t base = 0; base < n; base += SCHEDULE_PACKET) {
        uint32_t any = 0, end = n - base < SCHEDULE_PACKET ? n : base + SCHEDULE_PACKET;
        for (uint32_t i = base; i < base + SCHEDULE_PACKET; i++)
            any |= c->doubt[i]; /* beyond n: stale, but there; a doubt too many costs a look */
        for (uint32_t i = base; any != 0 && i < end; i++)
            if (c->doubt[i]) in_doubt[doubts++] = i;
    }
    decide_prefetch(ray->bvh, prim, in_doubt, doubts);
    for (uint32_t k = 0; k < doubts; k++)
        decide_one(c, ray, hits, prim, in_doubt[k]);
}

void caster_hits(struct caster *c, const struct bvh *bvh, const double station_m[3], double range_max_m, uint32_t n,
                 const double *dx, const double *dy, const double *dz, double *range_m, uint32_t *triangle)
{
    struct decide_ray ray = {.bvh = bvh, .t_max = (float)(range_max_m * 1.001)};
    struct bvh_rays rays = {
        .t_max = ray.t_max, .dx = c->fx, .dy = c->fy, .dz = c->fz, .t = c->t, .u = c->u, .v = c->v, .prim = c->prim};
    for (int i = 0; i < 3; i++) {
        ray.station_m[i] = station_m[i];
        ray.o_local[i] = station_m[i] - bvh->origin_m[i];
        rays.org[i] = (float)ray.o_local[i];
    }
    for (uint32_t at = 0; at < n; at += CHUNK) {
        uint32_t m = n - at < CHUNK ? n - at : CHUNK;
        struct kernel_hits hits = {.dx = dx + at,
                                   .dy = dy + at,
                                   .dz = dz + at,
                                   .prim = c->prim,
                                   .u = c->u,
                                   .v = c->v,
                                   .range_m = range_m + at,
                                   .label = c->seen,
                                   .doubt = c->doubt};
        kernel_to_float(hits.dx, hits.dy, hits.dz, m, c->fx, c->fy, c->fz);
        ends(c, CAST_DIRECTIONS);
        bvh_intersect(bvh, &c->packets, &rays, m);
        ends(c, CAST_EMBREE);
        uint32_t doubts = kernel_refine(bvh, &hits, ray.o_local, m);
        ends(c, CAST_REFINE);
        if (doubts != 0) decide(c, &ray, &hits, c->prim, m);
        memcpy(triangle + at, c->prim, m * sizeof *triangle);
        ends(c, CAST_DECIDE);
    }
}

/* Socs to where positions go: straight to the CRS where that is a rotation, else to prcs. Returns 1 in the first case.
 */
static int reading_rotation(const struct cast_setup *s, double to_crs[9])
{
    double g[9];
    int linear = georef_rotation(s->georef, g);
    memcpy(to_crs, s->rotation, 9 * sizeof *to_crs);
    for (int i = 0; i < 9 && linear; i++)
        to_crs[i] = g[i / 3 * 3] * s->rotation[i % 3] + g[i / 3 * 3 + 1] * s->rotation[3 + i % 3] +
                    g[i / 3 * 3 + 2] * s->rotation[6 + i % 3];
    return linear;
}

/* What could not be said is no echo, and counted. */
static uint32_t take_back(struct caster *c, struct line_block *block, uint32_t at, uint32_t n)
{
    uint32_t taken = 0;
    for (uint32_t i = at; i < at + n; i++) {
        if (block->echo[i] == 0) continue;
        if (block->a[i] != (uint32_t)LINE_XYZ_NONE && block->b[i] != (uint32_t)LINE_XYZ_NONE &&
            block->c[i] != (uint32_t)LINE_XYZ_NONE)
            continue;
        block->a[i] = block->b[i] = block->c[i] = (uint32_t)LINE_XYZ_NONE;
        block->echo[i] = 0;
        block->label[i] = LINE_LABEL_NONE;
        taken++;
    }
    c->counters.unfit += taken;
    return taken;
}

/* Positions as a head computes them: from the range and from what its encoders read. Returns how many echoes had to be
 * taken back. */
static uint32_t positions(struct caster *c, const struct cast_setup *s, int linear, struct line_block *block,
                          uint32_t at, uint32_t n)
{
    kernel_scale(c->range_m, n, c->ex, c->ey, c->ez);
    if (!linear) georef_forward(s->georef, n, c->ex, c->ey, c->ez, c->ex, c->ey, c->ez);
    uint32_t unfit = kernel_geo(c->ex, c->ey, c->ez, s->xyz_scale, n, block->a + at, block->b + at, block->c + at);
    return unfit == 0 ? 0 : take_back(c, block, at, n);
}

/* A moving body, cast in its own frame: what it hides gives way. */
static void cast_mover(struct caster *c, const struct cast_setup *s, const struct cast_mover *m, uint32_t n)
{
    double v[3], station_m[3], w[3];
    for (int i = 0; i < 3; i++) {
        const double *row = m->rotation + 3 * i;
        v[i] = row[0] * m->centre_m[0] + row[1] * m->centre_m[1] + row[2] * m->centre_m[2] + m->shift_m[i] -
               s->station_m[i];
        w[i] = s->station_m[i] - m->shift_m[i];
    }
    if (!kernel_meets_sphere(c->dx, c->dy, c->dz, n, v, m->radius_m)) return;
    for (int i = 0; i < 3; i++)
        station_m[i] = m->rotation[i] * w[0] + m->rotation[3 + i] * w[1] + m->rotation[6 + i] * w[2];
    struct mover_rays *r = &c->mover;
    kernel_turn_back(c->dx, c->dy, c->dz, m->rotation, n, r->dx, r->dy, r->dz);
    caster_hits(c, m->bvh, station_m, s->range_max_m, n, r->dx, r->dy, r->dz, r->range_m, r->hit);
    for (uint32_t i = 0; i < n; i++) {
        if (!(r->range_m[i] < c->range_m[i]) && !(isnan(c->range_m[i]) && !isnan(r->range_m[i]))) continue;
        c->range_m[i] = r->range_m[i];
        c->label[i] = c->seen[i];
    }
}

static uint32_t cast_chunk(struct caster *c, const struct cast_setup *s, const struct schedule_run *run,
                           struct line_block *block, uint32_t at, uint32_t n)
{
    if (c->profile != NULL) c->profile->last = c->profile->now();
    kernel_angles(run, at, n, c->mirror_turn, c->pan_turn);
    double to_crs[9];
    int geo = s->layout == LINE_GEO, linear = geo ? reading_rotation(s, to_crs) : 0;
    if (geo)
        kernel_directions_read(s, c->mirror_turn, c->pan_turn, to_crs, n, c->dx, c->dy, c->dz, c->ex, c->ey, c->ez);
    else
        kernel_directions(c->mirror_turn, c->pan_turn, s->rotation, n, c->dx, c->dy, c->dz);
    caster_hits(c, s->bvh, s->station_m, s->range_max_m, n, c->dx, c->dy, c->dz, c->range_m, c->hit);
    memcpy(c->label, c->seen, n * sizeof *c->label);
    for (uint32_t i = 0; i < s->n_movers; i++)
        cast_mover(c, s, &s->mover[i], n);
    uint32_t echoes = kernel_detect(c->range_m, s->range_min_m, s->range_max_m, n, block->echo + at);
    kernel_labels(c->label, block->echo + at, n, block->label + at);
    for (uint32_t i = 0; i < n; i++)
        block->refl_cdb[at + i] = LINE_REFL_NONE;
    ends(c, CAST_DETECT);
    if (s->noise_on) kernel_noise(s, run->pulse0 + at, n, c->range_m);
    ends(c, CAST_NOISE);
    if (geo)
        echoes -= positions(c, s, linear, block, at, n);
    else
        kernel_polar(s, c->range_m, c->mirror_turn, c->pan_turn, n, block->a + at, block->b + at, block->c + at);
    ends(c, CAST_POSITIONS);
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
    kernel_times(run, block->dt_ns);
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
