/* SPDX-License-Identifier: MIT */
#include "core/emitter.h"

#include <stdio.h>
#include <string.h>

#include "core/schedule/schedule_inside.h"

const char *const emitter_names[] = {
    [EMITTER_LINE] = "line",     [EMITTER_PLANAR] = "planar",         [EMITTER_BEAMS] = "beams",
    [EMITTER_SPHERE] = "sphere", [EMITTER_DIRECTIONS] = "directions", NULL};

void emitter_set_planar(struct emitter *e, uint32_t steps, uint32_t first, uint32_t last, uint32_t front, int turn)
{
    *e = (struct emitter){.kind = EMITTER_PLANAR,
                          .steps = steps,
                          .first_step = first,
                          .last_step = last,
                          .front_step = front,
                          .turn = turn};
}

static int check_beams(const struct emitter_beam *beam, uint32_t n, uint64_t sequence_ps, struct sh_err *err)
{
    if (n < 1 || n > EMITTER_MAX_BEAMS)
        return sh_fail(err, SH_EINPUT, "%u beams; allowed 1 to %d", n, (int)EMITTER_MAX_BEAMS);
    if (beam[0].offset_ns != 0)
        return sh_fail(err, SH_EINPUT, "the first beam fires after %u ns; allowed 0: it begins the sequence",
                       beam[0].offset_ns);
    for (uint32_t i = 1; i < n; i++)
        if (beam[i].offset_ns <= beam[i - 1].offset_ns)
            return sh_fail(err, SH_EINPUT,
                           "beam %u fires after %u ns, but the beam before it after %u ns; allowed more", i + 1,
                           beam[i].offset_ns, beam[i - 1].offset_ns);
    if (sequence_ps <= 1000ull * beam[n - 1].offset_ns)
        return sh_fail(err, SH_EINPUT, "a sequence of %.15g ns ends before its last firing; allowed more than %u ns",
                       1e-3 * (double)sequence_ps, beam[n - 1].offset_ns);
    return SH_OK;
}

int emitter_set_beams(struct emitter *e, const struct emitter_beam *beam, uint32_t n, uint64_t sequence_ps, int turn,
                      struct sh_err *err)
{
    int rc = check_beams(beam, n, sequence_ps, err);
    if (rc != SH_OK) return rc;
    *e = (struct emitter){.kind = EMITTER_BEAMS, .n_beams = n, .turn = turn};
    uint64_t tick_ps = sequence_ps;
    for (uint32_t i = 0; i < n; i++)
        tick_ps = (uint64_t)gcd(tick_ps, 1000ull * beam[i].offset_ns);
    const uint64_t g = (uint64_t)gcd(tick_ps, 1000);
    e->tick_num = tick_ps / g;
    e->tick_den = 1000 / g;
    e->sequence_ticks = sequence_ps / tick_ps;
    memcpy(e->beam, beam, n * sizeof *beam);
    for (uint32_t i = 0; i < n; i++)
        e->firing[i] = (struct emitter_firing){1000ull * beam[i].offset_ns / tick_ps,
                                               (double)beam[i].elevation_udeg / (double)TURN_UDEG,
                                               (double)beam[i].azimuth_udeg / (double)TURN_UDEG};
    return SH_OK;
}

void emitter_set_sphere(struct emitter *e, int64_t step_udeg)
{
    const int64_t half = step_udeg / 2;
    *e = (struct emitter){.kind = EMITTER_SPHERE,
                          .steps = emitter_sphere_steps(step_udeg),
                          .gaps = (uint32_t)((TURN_UDEG / 2 + half) / step_udeg),
                          .asked_udeg = step_udeg,
                          .turn = 1};
    e->rings = e->gaps + 1;
    e->last_step = e->steps - 1;
}

int emitter_sphere_is_exact(const struct emitter *e)
{
    return TURN_UDEG % e->asked_udeg == 0 && TURN_UDEG / 2 % e->asked_udeg == 0;
}

double emitter_ring_turn(const struct emitter *e, uint64_t ring)
{
    if (e->gaps == 0) return (double)e->circle_udeg / (double)TURN_UDEG;
    return (double)(e->first_ring + ring) * 0.5 / (double)e->gaps - 0.25;
}

int emitter_ring_is_pole(const struct emitter *e, uint64_t ring)
{
    if (e->gaps == 0) return e->circle_udeg == -TURN_UDEG / 4 || e->circle_udeg == TURN_UDEG / 4;
    return e->first_ring + ring == 0 || e->first_ring + ring == e->gaps;
}

int emitter_set_rings(struct emitter *e, int64_t start_udeg, int64_t stop_udeg, struct sh_err *err)
{
    const int64_t half = TURN_UDEG / 2, from = start_udeg + half / 2, to = stop_udeg + half / 2, gaps = e->gaps;
    if (start_udeg == stop_udeg) {
        e->rings = 1;
        e->first_ring = e->gaps = 0;
        e->circle_udeg = start_udeg;
        return SH_OK;
    }
    int64_t first = ((from > 0 ? from - 1 : 0) * gaps + half - 1) / half, last = (to + 1) * gaps / half;
    if (last > gaps) last = gaps;
    if (first > last)
        return sh_fail(
            err, SH_EINPUT,
            "no ring lies from %.10g to %.10g deg; allowed are limits around a ring, such as %.10g or %.10g deg, or "
            "two equal limits: a circle",
            1e-6 * (double)start_udeg, 1e-6 * (double)stop_udeg, 180.0 * (double)last / (double)gaps - 90.0,
            180.0 * (double)first / (double)gaps - 90.0);
    e->first_ring = (uint32_t)first;
    e->rings = (uint32_t)(last - first) + 1;
    return SH_OK;
}

void emitter_set_directions(struct emitter *e, const struct emitter_firing *direction, uint32_t n)
{
    *e =
        (struct emitter){.kind = EMITTER_DIRECTIONS, .steps = n, .last_step = n - 1, .turn = 1, .direction = direction};
}

int64_t emitter_rate_uhz(const struct emitter *e)
{
    /* n / (sequence_ticks * tick_num / tick_den) per nanosecond */
    const double sequence_s = 1e-9 * (double)e->sequence_ticks * (double)e->tick_num / (double)e->tick_den;
    return (int64_t)(1e6 * e->n_beams / sequence_s + 0.5);
}

int64_t emitter_most_lines_uhz(const struct emitter *e)
{
    return (int64_t)((u128)e->tick_den * NS_TIMES_UHZ / ((u128)e->tick_num * e->sequence_ticks));
}

int64_t emitter_step_udeg(const struct emitter *e, int64_t step)
{
    const int64_t turned = (step - e->front_step) * TURN_UDEG, half = e->steps / 2;
    return (turned + (turned < 0 ? -half : half)) / (int64_t)e->steps;
}

static void describe_sphere(const struct emitter *e, char *buf, size_t len)
{
    int n;
    if (e->gaps == 0) {
        n = snprintf(buf, len, "sphere, a circle at %.10g deg, of %u steps of %.6g deg",
                     360.0 * emitter_ring_turn(e, 0), e->steps, 360.0 / e->steps);
    } else {
        n = snprintf(buf, len, "sphere, %u rings %.6g deg apart, of %u steps of %.6g deg", e->rings, 180.0 / e->gaps,
                     e->steps, 360.0 / e->steps);
        if (e->rings <= e->gaps && n > 0 && (size_t)n < len)
            n += snprintf(buf + n, len - (size_t)n, "; elevations %.6g to %.6g deg", 360.0 * emitter_ring_turn(e, 0),
                          360.0 * emitter_ring_turn(e, e->rings - 1));
    }
    if (!emitter_sphere_is_exact(e) && n > 0 && (size_t)n < len)
        snprintf(buf + n, len - (size_t)n, "; %.6g deg, as asked, does not divide 180 deg",
                 1e-6 * (double)e->asked_udeg);
}

void emitter_describe(const struct emitter *e, char *buf, size_t len)
{
    const char *way = e->turn > 0 ? "clockwise" : "counter-clockwise";
    switch (e->kind) {
    case EMITTER_LINE:
        snprintf(buf, len, "%s", "");
        break;
    case EMITTER_PLANAR:
        snprintf(buf, len, "planar, steps %u..%u of %u a turn, %u ahead, %s", e->first_step, e->last_step, e->steps,
                 e->front_step, way);
        break;
    case EMITTER_BEAMS:
        snprintf(buf, len, "beams, %u in a sequence of %.10g ns, turning %s", e->n_beams,
                 (double)e->sequence_ticks * (double)e->tick_num / (double)e->tick_den, way);
        break;
    case EMITTER_SPHERE:
        describe_sphere(e, buf, len);
        break;
    case EMITTER_DIRECTIONS:
        snprintf(buf, len, "directions, a list of %u", e->steps);
        break;
    }
}
