#include "core/cast.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "core/cast/caster_private.h"

void caster_set_profile(struct caster *caster, struct cast_profile *profile)
{
    caster->profile = profile;
}

int caster_create(struct caster **out, struct sh_err *err)
{
    *out = aligned_alloc(64, (sizeof **out + 63) / 64 * 64);
    if (*out == NULL) return sh_fail(err, SH_ENOMEM, "cast: no memory for a caster");
    memset(*out, 0, offsetof(struct caster, list)); /* what is behind is not touched until it is needed */
    int rc = beam_work_create(&(*out)->beam, err);
    if (rc != SH_OK) free(*out);
    return rc;
}

void caster_free(struct caster *caster)
{
    if (caster == NULL) return;
    beam_work_free(caster->beam);
    free(caster);
}

void caster_get_counters(const struct caster *caster, struct cast_counters *counters)
{
    *counters = caster->counters;
}

void cast_attitude(double heading_rad, double pitch_rad, double roll_rad, double rotation[9])
{
    double sh = sin(heading_rad), ch = cos(heading_rad), sp = sin(pitch_rad), cp = cos(pitch_rad);
    double sr = sin(roll_rad), cr = cos(roll_rad);
    const double r[9] = {ch * cr + sh * sp * sr,
                         sh * cp,
                         ch * sr - sh * sp * cr,
                         -sh * cr + ch * sp * sr,
                         ch * cp,
                         -sh * sr - ch * sp * cr,
                         -cp * sr,
                         sp,
                         cp * cr};
    memcpy(rotation, r, sizeof r);
}

void cast_rotation(double heading_rad, double rotation[9])
{
    cast_attitude(heading_rad, 0.0, 0.0, rotation);
    for (int i = 0; i < 9; i++)
        rotation[i] += 0.0; /* no negative zeros */
}

uint32_t cast_encoder_count(double turn, double counts_per_turn)
{
    double within = turn - floor(turn);
    double count = floor(within * counts_per_turn + 0.5);
    return count >= counts_per_turn ? 0 : (uint32_t)(uint64_t)count;
}

static void set_origin(struct decide_ray *ray, double x, double y, double z)
{
    const double at[3] = {x, y, z};
    for (int i = 0; i < 3; i++) {
        ray->station_m[i] = at[i];
        ray->o_local[i] = at[i] - ray->bvh->origin_m[i];
    }
}

static void decide_one(struct caster *c, struct decide_ray *ray, const struct origins *from,
                       const struct kernel_hits *hits, uint32_t *prim, uint32_t i)
{
    struct decide_hit hit;
    if (from->px != NULL) set_origin(ray, from->px[i], from->py[i], from->pz[i]);
    ray->dir[0] = hits->dx[i];
    ray->dir[1] = hits->dy[i];
    ray->dir[2] = hits->dz[i];
    decide_hit(ray, prim[i], c->t[i], &c->counters, &hit);
    prim[i] = hit.prim;
    hits->label[i] =
        hit.prim == RTC_INVALID_GEOMETRY_ID ? (uint32_t)LINE_LABEL_NONE : bvh_label(&ray->bvh->triangle[hit.prim]);
    hits->range_m[i] = hit.prim == RTC_INVALID_GEOMETRY_ID ? (double)NAN : hit.range_m;
    if (hits->steep != NULL) kernel_steep(ray->bvh, hit.prim, ray->dir, &hits->steep[i]);
}

/* Doubts are few: whole packets without any are passed at once. Each costs a chain of cache misses, so they are looked
 * up together. */
static void decide(struct caster *c, struct decide_ray *ray, const struct origins *from, const struct kernel_hits *hits,
                   uint32_t *prim, uint32_t n)
{
    uint32_t doubts = 0, in_doubt[CHUNK];
    for (uint32_t base = 0; base < n; base += SCHEDULE_PACKET) {
        uint32_t any = 0, end = n - base < SCHEDULE_PACKET ? n : base + SCHEDULE_PACKET;
        for (uint32_t i = base; i < base + SCHEDULE_PACKET; i++)
            any |= c->doubt[i]; /* beyond n: stale, but there; a doubt too many costs a look */
        for (uint32_t i = base; any != 0 && i < end; i++)
            if (c->doubt[i]) in_doubt[doubts++] = i;
    }
    if (doubts == 0) return;
    decide_prefetch(ray->bvh, prim, in_doubt, doubts);
    for (uint32_t k = 0; k < doubts; k++)
        decide_one(c, ray, from, hits, prim, in_doubt[k]);
}

/* One chunk: what Embree proposes and double precision makes of it. */
static void cast_rays(struct caster *c, struct decide_ray *ray, struct bvh_rays *rays, const struct origins *from,
                      const struct kernel_hits *hits, uint32_t n)
{
    struct moving_rays *m = &c->moving;
    const struct bvh *bvh = ray->bvh;
    kernel_to_float(hits->dx, hits->dy, hits->dz, n, c->fx, c->fy, c->fz);
    if (from->px != NULL) {
        kernel_subtract(from->px, from->py, from->pz, bvh->origin_m, n, m->ox, m->oy, m->oz);
        kernel_to_float(m->ox, m->oy, m->oz, n, m->fx, m->fy, m->fz);
        rays->ox = m->fx;
        rays->oy = m->fy;
        rays->oz = m->fz;
    }
    caster_ends(c, CAST_DIRECTIONS);
    bvh_intersect(bvh, from->px != NULL ? &c->placed : &c->packets, rays, n);
    caster_ends(c, CAST_EMBREE);
    if (bvh->plain) {
        kernel_plain(bvh, c->prim, c->t, n, hits->range_m, hits->label);
        caster_ends(c, CAST_REFINE);
        return;
    }
    uint32_t doubts = from->px != NULL ? kernel_refine_from(bvh, hits, m->ox, m->oy, m->oz, n)
                                       : kernel_refine(bvh, hits, ray->o_local, n);
    caster_ends(c, CAST_REFINE);
    if (doubts != 0) decide(c, ray, from, hits, c->prim, n);
}

void caster_hits_from(struct caster *c, const struct bvh *bvh, const struct origins *from, double range_max_m,
                      uint32_t n, const double *dx, const double *dy, const double *dz, double *range_m,
                      uint32_t *triangle)
{
    struct decide_ray ray = {.bvh = bvh, .t_max = (float)(range_max_m * 1.001)};
    struct bvh_rays rays = {.t_max = ray.t_max,
                            .scattered = c->scattered,
                            .dx = c->fx,
                            .dy = c->fy,
                            .dz = c->fz,
                            .t = c->t,
                            .u = bvh->plain ? NULL : c->u,
                            .v = c->v,
                            .prim = c->prim};
    set_origin(&ray, from->at_m[0], from->at_m[1], from->at_m[2]);
    for (int i = 0; i < 3; i++)
        rays.org[i] = (float)ray.o_local[i];
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
                                   .steep = c->steep,
                                   .doubt = c->doubt};
        rays.begins = c->begins != NULL ? c->begins + at : NULL;
        cast_rays(c, &ray, &rays, from, &hits, m);
        memcpy(triangle + at, c->prim, m * sizeof *triangle);
        caster_ends(c, CAST_DECIDE);
    }
}

void caster_hits(struct caster *c, const struct bvh *bvh, const double station_m[3], double range_max_m, uint32_t n,
                 const double *dx, const double *dy, const double *dz, double *range_m, uint32_t *triangle)
{
    const struct origins from = {.at_m = {station_m[0], station_m[1], station_m[2]}};
    caster_hits_from(c, bvh, &from, range_max_m, n, dx, dy, dz, range_m, triangle);
}

/* Moves entry `from`, which has no echo where it does not fit. */
static void keep_entry(struct line_block *b, uint32_t to, uint32_t from, int fits)
{
    b->a[to] = b->a[from];
    b->b[to] = b->b[from];
    b->c[to] = b->c[from];
    b->dt_ns[to] = b->dt_ns[from];
    b->refl_cdb[to] = fits ? b->refl_cdb[from] : (int16_t)LINE_REFL_NONE;
    b->label[to] = fits ? b->label[from] : (uint16_t)LINE_LABEL_NONE;
    if (b->width_cns == NULL) return;
    b->amplitude_cdb[to] = fits ? b->amplitude_cdb[from] : (int16_t)LINE_AMPLITUDE_NONE;
    b->width_cns[to] = fits ? b->width_cns[from] : (uint16_t)LINE_WIDTH_NONE;
}

uint32_t caster_drop_unfit(struct caster *c, struct line_block *b, uint32_t at, uint32_t n, uint32_t *echoes)
{
    uint32_t to = at;
    *echoes = 0;
    for (uint32_t i = at, end; i < at + n; i = end) {
        uint32_t first = to, count = 0;
        for (end = i + 1; end < at + n && (b->echo[end] & 15) > 1;)
            end++;
        for (uint32_t k = i; k < end; k++) {
            int fits = b->a[k] != (uint32_t)LINE_XYZ_NONE && b->b[k] != (uint32_t)LINE_XYZ_NONE &&
                       b->c[k] != (uint32_t)LINE_XYZ_NONE;
            if (!fits && b->echo[k] != 0) c->counters.unfit++;
            if (!fits && (k + 1 < end || to > first)) continue; /* but one entry stays */
            keep_entry(b, to++, k, fits);
            count += (uint32_t)fits;
        }
        *echoes += count;
        for (uint32_t k = first; k < to; k++)
            b->echo[k] = (uint8_t)(count == 0 ? 0 : (k - first + 1) | count << 4);
        if (count == 0) b->a[first] = b->b[first] = b->c[first] = (uint32_t)LINE_XYZ_NONE;
    }
    return to - at;
}

uint32_t caster_wire(struct caster *c, const struct cast_setup *s, int linear, const double *range_m,
                     struct line_block *block, uint32_t at, uint32_t n)
{
    const struct moving_rays *m = &c->moving;
    if (s->layout != LINE_GEO) {
        kernel_polar(s, range_m, c->mirror_turn, c->pan_turn, n, block->a + at, block->b + at, block->c + at);
        return 0;
    }
    if (s->n_knots != 0)
        kernel_scale_from(range_m, m->px, m->py, m->pz, s->station_m, n, c->ex, c->ey, c->ez);
    else
        kernel_scale(range_m, n, c->ex, c->ey, c->ez);
    if (!linear)
        georef_forward(s->georef, n, (struct vec3_in){c->ex, c->ey, c->ez}, (struct vec3_out){c->ex, c->ey, c->ez});
    return kernel_geo(c->ex, c->ey, c->ez, s->xyz_scale, n, block->a + at, block->b + at, block->c + at);
}

/* How far the origins lie from the first of them. */
static double spread_m(const struct origins *from, uint32_t n)
{
    double most2 = 0.0;
    for (uint32_t i = 1; i < n; i++) {
        double x = from->px[i] - from->px[0], y = from->py[i] - from->py[0], z = from->pz[i] - from->pz[0];
        most2 = fmax(most2, x * x + y * y + z * z);
    }
    return sqrt(most2);
}

/* A moving body, cast in its own frame: what it hides gives way. */
static void cast_mover(struct caster *c, const struct cast_setup *s, uint32_t which, const struct origins *from,
                       const struct ray_set *set, uint32_t n)
{
    const struct cast_mover *m = &s->mover[which];
    double v[3], w[3];
    struct origins own = {.px = NULL};
    for (int i = 0; i < 3; i++) {
        const double *row = m->rotation + 3 * i;
        double at = from->px != NULL ? (i == 0 ? from->px : i == 1 ? from->py : from->pz)[0] : from->at_m[i];
        v[i] = row[0] * m->centre_m[0] + row[1] * m->centre_m[1] + row[2] * m->centre_m[2] + m->shift_m[i] - at;
        w[i] = at - m->shift_m[i];
    }
    double radius_m = m->radius_m + (from->px != NULL ? spread_m(from, n) : 0.0);
    if (!kernel_meets_sphere(set->dx, set->dy, set->dz, n, v, radius_m)) return;
    for (int i = 0; i < 3; i++)
        own.at_m[i] = m->rotation[i] * w[0] + m->rotation[3 + i] * w[1] + m->rotation[6 + i] * w[2];
    if (from->px != NULL) {
        struct moving_rays *o = &c->moving;
        kernel_subtract(from->px, from->py, from->pz, m->shift_m, n, o->ox, o->oy, o->oz);
        kernel_turn_back(o->ox, o->oy, o->oz, m->rotation, n, o->qx, o->qy, o->qz);
        own.px = o->qx;
        own.py = o->qy;
        own.pz = o->qz;
    }
    struct mover_rays *r = &c->mover;
    kernel_turn_back(set->dx, set->dy, set->dz, m->rotation, n, r->dx, r->dy, r->dz);
    caster_hits_from(c, m->bvh, &own, s->range_max_m, n, r->dx, r->dy, r->dz, r->range_m, r->hit);
    for (uint32_t i = 0; i < n; i++) {
        if (!(r->range_m[i] < set->range_m[i]) && !(isnan(set->range_m[i]) && !isnan(r->range_m[i]))) continue;
        set->range_m[i] = r->range_m[i];
        set->label[i] = c->seen[i];
        set->hit[i] = r->hit[i];
        if (set->body == NULL) continue;
        set->body[i] = (uint8_t)(which + 1);
        kernel_cosines(m->bvh, r->hit + i, r->dx + i, r->dy + i, r->dz + i, 1, set->cosine + i);
    }
}

void caster_nearest(struct caster *c, const struct cast_setup *s, const struct origins *from, const struct ray_set *set,
                    uint32_t n)
{
    caster_hits_from(c, s->bvh, from, s->range_max_m, n, set->dx, set->dy, set->dz, set->range_m, set->hit);
    memcpy(set->label, c->seen, n * sizeof *set->label);
    if (set->body != NULL) {
        kernel_cosines(s->bvh, set->hit, set->dx, set->dy, set->dz, n, set->cosine);
        memset(set->body, 0, n * sizeof *set->body);
    }
    for (uint32_t i = 0; i < s->n_movers; i++)
        cast_mover(c, s, i, from, set, n);
    if (set->body != NULL) caster_texels(s, from, set, n);
}

/* Each pulse is one ray: its echo, if there is one. */
static uint32_t single_chunk(struct caster *c, const struct cast_setup *s, int linear, uint64_t pulse0, uint32_t n,
                             struct line_block *block, uint32_t at)
{
    uint32_t echoes = kernel_detect(c->range_m, s->range_min_m, s->range_max_m, n, block->echo + at);
    kernel_labels(c->label, block->echo + at, n, block->label + at);
    caster_no_reflectance(block, at, n);
    caster_ends(c, CAST_DETECT);
    if (s->noise_on) kernel_noise(s, pulse0, n, c->range_m);
    caster_ends(c, CAST_NOISE);
    if (caster_wire(c, s, linear, c->range_m, block, at, n) != 0) caster_drop_unfit(c, block, at, n, &echoes);
    if (c->attributes) caster_pulse_attributes(s, block, at, n);
    caster_ends(c, CAST_POSITIONS);
    return echoes;
}

/* dt_ns: of the run's pulses. */
static uint32_t cast_chunk(struct caster *c, const struct cast_setup *s, const struct schedule_run *run,
                           const uint32_t *dt_ns, uint32_t first, uint32_t n, struct line_block *block, uint32_t *at)
{
    struct origins from;
    if (c->profile != NULL) c->profile->last = c->profile->now();
    int linear = caster_aim(c, s, run, dt_ns, first, n, &from);
    if (s->beam != NULL) {
        beam_cast(c, s, &from, n);
        return beam_write_points(c, s, linear, run->pulse0 + first, dt_ns + first, n, block, at);
    }
    const struct ray_set set = {
        .dx = c->dx, .dy = c->dy, .dz = c->dz, .range_m = c->range_m, .label = c->label, .hit = c->hit};
    caster_nearest(c, s, &from, &set, n);
    uint32_t echoes = single_chunk(c, s, linear, run->pulse0 + first, n, block, *at);
    *at += n;
    return echoes;
}

uint32_t caster_cast(struct caster *caster, const struct cast_setup *setup, const struct schedule_run *run,
                     struct line_block *block)
{
    uint32_t echoes = 0, at = 0;
    caster->attributes = block->width_cns != NULL;
    block->frame = run->frame;
    block->line = run->line;
    block->pulse0 = run->pulse0;
    block->n_pulses = run->n;
    block->t0_ns = run->t0_ns;
    block->line_t0_ns = run->line_t0_ns;
    block->layout = setup->layout;
    /* With several entries a pulse, the pulses' times wait at the end of the array: no entry overtakes the pulses that
     * are still to come. */
    int several = setup->beam != NULL || setup->detect != NULL;
    uint32_t *dt_ns = several ? block->dt_ns + block->capacity - run->n : block->dt_ns;
    kernel_times(run, dt_ns);
    /* The first packet of a run may begin within a packet of the line; later chunks begin at one. */
    uint32_t lead = run->in_line % SCHEDULE_PACKET;
    for (uint32_t first = 0; first < run->n;) {
        uint32_t n = lead != 0 ? SCHEDULE_PACKET - lead : CHUNK;
        if (n > run->n - first) n = run->n - first;
        if (setup->detect != NULL)
            echoes += caster_detected(caster, setup, run, dt_ns + first, first, n, block, &at);
        else
            echoes += cast_chunk(caster, setup, run, dt_ns, first, n, block, &at);
        first += n;
        lead = 0;
    }
    block->n_points = at;
    return echoes;
}
