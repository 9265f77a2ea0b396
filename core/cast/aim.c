/* Where the beams of a chunk go and begin. */
#include <math.h>
#include <string.h>

#include "core/cast/caster_private.h"

static const double AS_IT_IS[9] = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};

int caster_reading_rotation(const struct cast_setup *s, double to_crs[9])
{
    double g[9];
    int linear = georef_rotation(s->georef, g);
    memcpy(to_crs, s->rotation, 9 * sizeof *to_crs);
    for (int i = 0; i < 9 && linear; i++)
        to_crs[i] = g[i / 3 * 3] * s->rotation[i % 3] + g[i / 3 * 3 + 1] * s->rotation[3 + i % 3] +
                    g[i / 3 * 3 + 2] * s->rotation[6 + i % 3];
    return linear;
}

/* The last pose at or before t_ns, or the first. */
static uint32_t find_knot(const struct cast_setup *s, int64_t t_ns)
{
    uint32_t lo = 0, hi = s->n_knots;
    while (hi - lo > 1) {
        uint32_t mid = lo + (hi - lo) / 2;
        if (s->knot[mid].t_ns <= t_ns)
            lo = mid;
        else
            hi = mid;
    }
    return lo;
}

/* Directions and origins of pulses first .. first + n of a run, from what its socs directions are; stretch by stretch
 * between two poses. */
void caster_move(struct caster *c, const struct cast_setup *s, int64_t t0_ns, const uint32_t *dt_ns, uint32_t n,
                 int geo)
{
    struct moving_rays *m = &c->moving;
    for (uint32_t i = 0, k = find_knot(s, t0_ns + dt_ns[0]); i < n; k++) {
        int last = k + 1 >= s->n_knots, before = s->knot[k].t_ns > t0_ns + (int64_t)dt_ns[i];
        uint32_t end = i;
        while (end < n && (last || t0_ns + (int64_t)dt_ns[end] < s->knot[before ? k : k + 1].t_ns))
            end++;
        struct kernel_leg leg;
        kernel_leg(&s->knot[k], &s->knot[last || before ? k : k + 1], t0_ns, &leg);
        uint32_t part = end - i;
        const uint32_t *dt = dt_ns + i;
        kernel_turn_leg(&leg, dt, part, m->sx + i, m->sy + i, m->sz + i, c->dx + i, c->dy + i, c->dz + i);
        if (geo) kernel_turn_leg(&leg, dt, part, m->rx + i, m->ry + i, m->rz + i, c->ex + i, c->ey + i, c->ez + i);
        kernel_place_leg(&leg, dt, part, m->px + i, m->py + i, m->pz + i);
        if (before) k--;
        i = end;
    }
}

int caster_aim(struct caster *c, const struct cast_setup *s, const struct schedule_run *run, const uint32_t *dt_ns,
               uint32_t at, uint32_t n, struct origins *from)
{
    struct moving_rays *m = &c->moving;
    int geo = s->layout == LINE_GEO, linear = 0;
    double to_crs[9];
    kernel_angles(run, at, n, c->mirror_turn, c->pan_turn);
    *from = (struct origins){.at_m = {s->station_m[0], s->station_m[1], s->station_m[2]}};
    if (s->n_knots != 0) {
        if (geo)
            kernel_directions_read(s, c->mirror_turn, c->pan_turn, AS_IT_IS, AS_IT_IS, n, m->sx, m->sy, m->sz, m->rx,
                                   m->ry, m->rz);
        else
            kernel_directions(c->mirror_turn, c->pan_turn, AS_IT_IS, n, m->sx, m->sy, m->sz);
        caster_move(c, s, run->t0_ns, dt_ns + at, n, geo);
        from->px = m->px;
        from->py = m->py;
        from->pz = m->pz;
    } else if (geo) {
        linear = caster_reading_rotation(s, to_crs);
        kernel_directions_read(s, c->mirror_turn, c->pan_turn, s->rotation, to_crs, n, c->dx, c->dy, c->dz, c->ex,
                               c->ey, c->ez);
    } else {
        kernel_directions(c->mirror_turn, c->pan_turn, s->rotation, n, c->dx, c->dy, c->dz);
    }
    return linear;
}

static void transpose(const double m[9], double t[9])
{
    for (int i = 0; i < 9; i++)
        t[i] = m[i % 3 * 3 + i / 3];
}

void caster_aim_bent(struct caster *c, const struct cast_setup *s, const struct schedule_run *run,
                     const uint32_t *dt_ns, uint32_t at, uint32_t n, struct origins *from)
{
    const struct instrument *k = s->detect->instrument;
    struct moving_rays *m = &c->moving;
    int moves = s->n_knots != 0, offset = k != NULL && instrument_has_offset(k);
    double back[9];
    kernel_angles(run, at, n, c->mirror_turn, c->pan_turn);
    *from = (struct origins){.at_m = {s->station_m[0], s->station_m[1], s->station_m[2]}};
    if (k == NULL && !moves) {
        kernel_directions(c->mirror_turn, c->pan_turn, s->rotation, n, c->dx, c->dy, c->dz);
        return;
    }
    const struct instrument_beams beams = {m->sx, m->sy, m->sz, offset ? m->rx : NULL, m->ry, m->rz};
    if (k != NULL) {
        instrument_aim(k, run->pulse0 + at, n, c->mirror_turn, c->pan_turn, &beams);
        instrument_read(k, n, c->mirror_turn, c->pan_turn);
    } else {
        kernel_directions(c->mirror_turn, c->pan_turn, AS_IT_IS, n, m->sx, m->sy, m->sz);
    }
    if (moves) {
        caster_move(c, s, run->t0_ns, dt_ns, n, offset);
    } else {
        transpose(s->rotation, back);
        kernel_turn_back(m->sx, m->sy, m->sz, back, n, c->dx, c->dy, c->dz);
        if (!offset) return;
        kernel_turn_back(m->rx, m->ry, m->rz, back, n, c->ex, c->ey, c->ez);
    }
    for (uint32_t i = 0; i < n && offset; i++) {
        m->px[i] = (moves ? m->px[i] : s->station_m[0]) + c->ex[i];
        m->py[i] = (moves ? m->py[i] : s->station_m[1]) + c->ey[i];
        m->pz[i] = (moves ? m->pz[i] : s->station_m[2]) + c->ez[i];
    }
    from->px = m->px;
    from->py = m->py;
    from->pz = m->pz;
}
