/* SPDX-License-Identifier: MIT */
/* Finds the outlines that cross a footprint, as lines in its unit disc. */
#include <math.h>

#include "core/footprint/outlines.h"
#include "core/vec3.h"

#define SAME_LINE 1e-3 /* of the footprint's radius, and of a radian */

/* The ends of an edge along the beam's axes: e1, e2, and its direction. */
struct local_edge {
    double a[3], b[3];
};

static void turn_in(const float p[3], const struct beam_sight *sight, double out[3])
{
    const double at[3] = {(double)p[0], (double)p[1], (double)p[2]};
    out[0] = vec3_dot(at, sight->e1);
    out[1] = vec3_dot(at, sight->e2);
    out[2] = vec3_dot(at, sight->dir);
}

/* Cuts an edge to where it lies within w(z) of the beam's axis. The condition is a quadratic inequality, since w^2 is
 * quadratic in z. Returns 0 where the edge never does. */
static int clip_to_beam(const struct beam *beam, struct local_edge *e)
{
    double d[3] = {e->b[0] - e->a[0], e->b[1] - e->a[1], e->b[2] - e->a[2]}, s2 = beam->slope * beam->slope;
    double t0 = 0.0, t1 = 1.0;
    if (e->a[2] <= 0.0 && e->b[2] <= 0.0) return 0;
    if (e->a[2] < 0.0) t0 = -e->a[2] / d[2];
    if (e->b[2] < 0.0) t1 = -e->a[2] / d[2];
    double aa = d[0] * d[0] + d[1] * d[1] - s2 * d[2] * d[2];
    double bb = e->a[0] * d[0] + e->a[1] * d[1] - s2 * e->a[2] * d[2];
    double cc =
        e->a[0] * e->a[0] + e->a[1] * e->a[1] - s2 * e->a[2] * e->a[2] - beam->exit_radius_m * beam->exit_radius_m;
    if (aa > 0.0) {
        double root = bb * bb - aa * cc;
        if (root <= 0.0) return 0;
        root = sqrt(root);
        double over = 1.0 / aa, in = (-bb - root) * over, out = (-bb + root) * over;
        t0 = in > t0 ? in : t0;
        t1 = out < t1 ? out : t1;
    } else if (cc > 0.0 && aa + 2.0 * bb + cc > 0.0) {
        return 0; /* steeper than the beam's own edge, and outside at both ends */
    }
    if (!(t0 < t1)) return 0;
    struct local_edge whole = *e;
    for (int i = 0; i < 3; i++) {
        e->a[i] = whole.a[i] + t0 * d[i];
        e->b[i] = whole.a[i] + t1 * d[i];
    }
    return 1;
}

/* Finds the sub-ray (x, y) through p. In complex numbers, x + i y = (p0 + i p1) / (exit_radius + i slope p2). */
static void to_disc(const struct beam *beam, const double p[3], double u[2])
{
    double re = beam->exit_radius_m, im = beam->slope * p[2], over = 1.0 / (re * re + im * im);
    u[0] = (p[0] * re + p[1] * im) * over;
    u[1] = (p[1] * re - p[0] * im) * over;
}

static int make_line(const struct beam *beam, const struct local_edge *e, struct beam_line *line)
{
    double p[2], q[2];
    to_disc(beam, e->a, p);
    to_disc(beam, e->b, q);
    double ex = q[0] - p[0], ey = q[1] - p[1], length2 = ex * ex + ey * ey;
    if (!(length2 > 1e-18)) return 0;
    double over = 1.0 / sqrt(length2);
    line->n[0] = -ey * over;
    line->n[1] = ex * over;
    line->h = line->n[0] * p[0] + line->n[1] * p[1];
    if (line->h < 0.0) {
        line->h = -line->h;
        line->n[0] = -line->n[0];
        line->n[1] = -line->n[1];
    }
    return line->h < 1.0;
}

static int is_known(const struct beam_line *line, uint32_t n, const struct beam_line *one)
{
    for (uint32_t i = 0; i < n; i++) {
        double cross = line[i].n[0] * one->n[1] - line[i].n[1] * one->n[0];
        double same = line[i].n[0] * one->n[0] + line[i].n[1] * one->n[1] > 0.0 ? 1.0 : -1.0;
        if (fabs(cross) < SAME_LINE && fabs(line[i].h - same * one->h) < SAME_LINE) return 1;
    }
    return 0;
}

uint32_t beam_find_lines(const struct beam_outlines *o, const struct beam *beam, struct beam_near *near,
                         const struct beam_sight *sight, double limit_m, struct beam_line *line)
{
    uint32_t n = 0;
    const float d[3] = {(float)sight->dir[0], (float)sight->dir[1], (float)sight->dir[2]};
    near->next_m = INFINITY;
    for (uint32_t k = near->first; k < near->end; k++) {
        const struct outline_entry *entry = &o->entry[k];
        const struct outline_edge *edge = &o->edge[entry->edge];
        struct local_edge e;
        struct beam_line one;
        if ((double)entry->range_m > limit_m) {
            near->next_m = n > 0 ? (double)entry->range_m : (double)INFINITY;
            break;
        }
        if (outline_is_clear(beam, entry, d)) continue;
        turn_in(edge->a, sight, e.a);
        turn_in(edge->b, sight, e.b);
        if (!clip_to_beam(beam, &e)) continue;
        if (e.a[2] > limit_m && e.b[2] > limit_m) continue; /* the part inside the beam is too far */
        if (!make_line(beam, &e, &one) || is_known(line, n, &one)) continue;
        if (n == BEAM_MAX_LINES) return n + 1;
        line[n++] = one;
    }
    return n;
}
