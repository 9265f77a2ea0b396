/* SPDX-License-Identifier: MIT */
/* True directions and origins of a chunk's beams, and the directions that the head reads from its
 * encoders. */
#include "core/cast/aim.h"

#include <string.h>

#include "core/cast/caster.h"
#include "core/cast/kernels_aim.h"
#include "core/cast/kernels_moving.h"
#include "core/cast/kernels_sweep.h"
#include "core/cast/disturbance.h"
#include "core/mat3.h"

/* Sets to_crs to the rotation of differences from socs to the CRS, where that is a rotation, and returns 1. Elsewhere
 * to_crs is the rotation from socs to prcs, and 0 is returned. */
static int reading_rotation(const struct cast_setup *s, double to_crs[9])
{
    double g[9];
    int linear = georef_rotation(s->georef, g);
    memcpy(to_crs, s->rotation, 9 * sizeof *to_crs);
    if (linear) mat3_multiply(g, s->rotation, to_crs);
    return linear;
}

/* Vectors d and r are turned from socs to prcs, each by the pose of its pulse's time. `place` gets the head's place. */
struct move {
    struct vec3_in d, r; /* r.x NULL: only d */
    struct vec3_out to_d, to_r, place;
};

/* Finds the leg that pulse i lies in, which is the way between two poses. Returns the first of the n pulses beyond it;
 * pulses are in order of time. */
static uint32_t find_leg(const struct cast_setup *s, const struct chunk *k, const uint32_t *dt_ns, uint32_t i,
                         uint32_t n, struct kernel_leg *leg)
{
    const int64_t t0_ns = k->run->t0_ns;
    const size_t at = pose_find_knot(s->knot, s->n_knots, t0_ns + dt_ns[i]);
    const int last = at + 1 >= s->n_knots, before = s->knot[at].t_ns > t0_ns + (int64_t)dt_ns[i];
    const struct pose_knot *from = &s->knot[at], *to = last || before ? from : from + 1;
    kernel_leg(from, to, t0_ns, leg);
    if (last && !before) return n;
    const int64_t end_ns = (before ? from : to)->t_ns - t0_ns;
    if ((int64_t)dt_ns[n - 1] < end_ns) return n;
    while ((int64_t)dt_ns[i] < end_ns)
        i++;
    return i;
}

static void move(const struct cast_setup *s, const struct chunk *k, const uint32_t *dt_ns, uint32_t n,
                 const struct move *m)
{
    struct kernel_leg leg;
    for (uint32_t i = 0, end; i < n; i = end) {
        end = find_leg(s, k, dt_ns, i, n, &leg);
        kernel_turn_leg(&leg, dt_ns + i, end - i, &VEC3_IN(m->d, i), &VEC3_OUT(m->to_d, i));
        if (m->r.x != NULL) kernel_turn_leg(&leg, dt_ns + i, end - i, &VEC3_IN(m->r, i), &VEC3_OUT(m->to_r, i));
        kernel_place_leg(&leg, dt_ns + i, end - i, &VEC3_OUT(m->place, i));
    }
}

/* Returns the rotation of the true beams where the pan has slipped; the encoders don't see the slip. */
static const double *slipped_rotation(const struct cast_setup *s, const double rotation[9], double out[9])
{
    double slip[9];
    if (s->disturbance == NULL || s->disturbance->slip_turn == 0.0) return rotation;
    caster_slip(s->disturbance, slip);
    mat3_multiply(rotation, slip, out);
    return out;
}

/* Aims the beams of an ideal head, which go where its encoders say, except for the encoders' steps. */
static void aim_ideal(struct caster *c, struct chunk *k, const struct kernel_turns *turns)
{
    const struct cast_setup *s = k->s;
    const int geo = s->layout == LINE_GEO, moves = s->n_knots != 0;
    const int wobbles = s->disturbance != NULL && s->disturbance->n_wobbles != 0;
    struct kernel_leg leg;
    /* Where the head moves without turning, one rotation holds for the chunk, as for a head that stands. */
    const int straight = moves && find_leg(s, k, k->dt_ns, 0, k->n, &leg) == k->n && leg.turn == 0.0 &&
                         (s->disturbance == NULL || s->disturbance->slip_turn == 0.0);
    const int turns_later = moves && !straight;
    const double *pose = straight ? leg.rotation : moves ? mat3_unit : s->rotation;
    double slipped[9];
    const double *rotation = slipped_rotation(s, pose, slipped);
    const struct vec3_out d = turns_later ? VEC3_OUT(c->socs, 0) : VEC3_OUT(c->d, 0);
    const struct kernel_pulses sweep = {k->run, k->first, *turns};
    const int even = !wobbles && kernel_sweep_steps(&c->steps, k->run);
    double to_crs[9];
    if (geo) k->linear = !moves && reading_rotation(s, to_crs);
    const struct kernel_reading reading = {s, moves ? pose : to_crs,
                                           turns_later ? VEC3_OUT(c->read, 0) : VEC3_OUT(c->list.e, 0)};
    if (even)
        kernel_sweep(&c->steps, &sweep, rotation, &d, geo ? &reading : NULL);
    else
        kernel_directions(turns, rotation, &d, geo ? &reading : NULL);
    if (straight) kernel_place_leg(&leg, k->dt_ns, k->n, &VEC3_OUT(c->list.p, 0));
    if (!turns_later) return;
    const struct move m = {VEC3_IN(c->socs, 0), geo ? VEC3_IN(c->read, 0) : (struct vec3_in){0}, VEC3_OUT(c->d, 0),
                           VEC3_OUT(c->list.e, 0), VEC3_OUT(c->list.p, 0)};
    move(s, k, k->dt_ns, k->n, &m);
}

/* Turns directions and origins in socs by the slip, as slipped_rotation turns a rotation. */
static void slip_bent(struct caster *c, const struct chunk *k, int offset)
{
    double slip[9], back[9];
    if (k->s->disturbance == NULL || k->s->disturbance->slip_turn == 0.0) return;
    caster_slip(k->s->disturbance, slip);
    mat3_transpose(slip, back);
    kernel_turn_back(&VEC3_IN(c->socs, 0), back, k->n, &VEC3_OUT(c->socs, 0));
    if (offset) kernel_turn_back(&VEC3_IN(c->read, 0), back, k->n, &VEC3_OUT(c->read, 0));
}

/* Aims the beams of a head with errors of mechanics and encoders. The turns become the encoders' readings. */
static void aim_bent(struct caster *c, struct chunk *k, const struct instrument *instrument)
{
    const struct cast_setup *s = k->s;
    struct echo_list *l = &c->list;
    const int offset = instrument_has_offset(instrument), moves = s->n_knots != 0;
    const struct vec3_out origin = offset ? VEC3_OUT(c->read, 0) : (struct vec3_out){0};
    const struct vec3_in around = offset ? VEC3_IN(c->read, 0) : (struct vec3_in){0};
    const struct instrument_turns turns = {k->pulse0, k->n, l->mirror_turn, l->pan_turn, k->s->scan_key};
    double back[9];
    instrument_aim(instrument, &turns, &VEC3_OUT(c->socs, 0), &origin);
    slip_bent(c, k, offset);
    instrument_read(instrument, k->n, l->mirror_turn, l->pan_turn);
    if (moves) {
        const struct move m = {VEC3_IN(c->socs, 0), around, VEC3_OUT(c->d, 0), VEC3_OUT(c->origin, 0),
                               VEC3_OUT(l->p, 0)};
        move(s, k, k->dt_ns, k->n, &m);
    } else {
        mat3_transpose(s->rotation, back);
        kernel_turn_back(&VEC3_IN(c->socs, 0), back, k->n, &VEC3_OUT(c->d, 0));
        if (offset) kernel_turn_back(&around, back, k->n, &VEC3_OUT(c->origin, 0));
    }
    for (uint32_t i = 0; i < k->n && offset; i++) {
        c->origin.x[i] += moves ? l->p.x[i] : s->station_m[0];
        c->origin.y[i] += moves ? l->p.y[i] : s->station_m[1];
        c->origin.z[i] += moves ? l->p.z[i] : s->station_m[2];
    }
    if (offset) k->from.own = VEC3_IN(c->origin, 0);
    l->n = k->n;
    caster_aim_read(c, k);
}

/* Adds wobbles to the angles. */
static void wobble(const struct chunk *k, struct echo_list *l)
{
    for (uint32_t i = 0; i < k->n; i++)
        cast_wobble(k->s->disturbance, k->run->t0_ns + (int64_t)k->dt_ns[i], &l->mirror_turn[i], &l->pan_turn[i]);
}

void caster_aim(struct caster *c, struct chunk *k)
{
    const struct cast_setup *s = k->s;
    const struct instrument *instrument = s->detect != NULL ? s->detect->instrument : NULL;
    struct echo_list *l = &c->list;
    if (k->run->firing != NULL)
        kernel_angles_table(k->run, k->first, k->n, l->mirror_turn, l->pan_turn);
    else
        kernel_angles(k->run, k->first, k->n, l->mirror_turn, l->pan_turn);
    if (s->disturbance != NULL && s->disturbance->n_wobbles != 0) wobble(k, l);
    k->from = (struct bvh_origins){.at_m = {s->station_m[0], s->station_m[1], s->station_m[2]}};
    if (s->n_knots != 0) k->from.own = VEC3_IN(l->p, 0);
    k->linear = 0;
    if (instrument != NULL)
        aim_bent(c, k, instrument);
    else
        aim_ideal(c, k, &(struct kernel_turns){k->n, l->mirror_turn, l->pan_turn});
}

/* Computes what the encoders read of entries at .. at + n. Overwrites c->socs and, where the head moves, c->read.
 * dt_ns has the entries' times, which are used only where the head moves. */
static void read_part(struct caster *c, const struct chunk *k, uint32_t at, uint32_t n, const uint32_t *dt_ns)
{
    const struct cast_setup *s = k->s;
    struct echo_list *l = &c->list;
    const struct kernel_turns turns = {n, l->mirror_turn + at, l->pan_turn + at};
    const struct vec3_out socs = VEC3_OUT(c->socs, 0), e = VEC3_OUT(l->e, at);
    double to_crs[9];
    if (s->n_knots == 0) {
        reading_rotation(s, to_crs);
        kernel_directions(&turns, s->rotation, &socs, &(struct kernel_reading){s, to_crs, e});
        return;
    }
    kernel_directions(&turns, mat3_unit, &socs, &(struct kernel_reading){s, mat3_unit, VEC3_OUT(c->read, 0)});
    const struct move m = {VEC3_IN(c->read, 0), {0}, e, {0}, VEC3_OUT(l->p, at)};
    move(s, k, dt_ns, n, &m);
}

void caster_aim_read(struct caster *c, struct chunk *k)
{
    const struct echo_list *l = &c->list;
    uint32_t dt_ns[CHUNK], n = 0, done = k->n;
    double to_crs[9];
    if (k->s->layout != LINE_GEO) return;
    k->linear = k->s->n_knots == 0 && reading_rotation(k->s, to_crs);
    read_part(c, k, 0, k->n, k->dt_ns);
    for (uint32_t g = 0; g < l->n_secondary && l->n > k->n; g++)
        for (uint32_t i = 0; i < l->secondary[g].n; i++) {
            dt_ns[n++] = k->dt_ns[l->secondary[g].pulse];
            if (n < CHUNK) continue;
            read_part(c, k, done, n, dt_ns);
            done += n;
            n = 0;
        }
    if (n > 0) read_part(c, k, done, n, dt_ns);
}
