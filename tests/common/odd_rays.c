/* SPDX-License-Identifier: MIT */
#include "tests/common/odd_rays.h"

#include <math.h>
#include <string.h>

#include "core/vec3.h"
#include "tests/common/cases.h"

#define PI 3.14159265358979323846

static double unit(struct odd_rays *r)
{
    return case_unit(&r->random);
}

static uint32_t pick(struct odd_rays *r, uint32_t n)
{
    return (uint32_t)(case_u64(&r->random) % n);
}

static double sign(struct odd_rays *r)
{
    return pick(r, 2) ? 1.0 : -1.0;
}

static double decades(struct odd_rays *r, double lo, double hi)
{
    return pow(10.0, lo + (hi - lo) * unit(r));
}

static void any_direction(struct odd_rays *r, double d[3])
{
    double z = 2.0 * unit(r) - 1.0, turn = 2.0 * PI * unit(r), flat = sqrt(1.0 - z * z);
    d[0] = flat * cos(turn);
    d[1] = flat * sin(turn);
    d[2] = z;
}

/* Corner i of a triangle, as seen from the station. */
static void corner_of(const struct odd_rays *r, uint32_t triangle, uint32_t i, double out[3])
{
    vec3_sub(r->scene->vertex_m[r->scene->triangle[triangle][i % 3]], r->station_m, out);
}

static uint32_t any_triangle(struct odd_rays *r)
{
    return pick(r, r->scene->n_triangles);
}

static void step(double *x, int32_t by)
{
    for (; by > 0; by--)
        *x = nextafter(*x, INFINITY);
    for (; by < 0; by++)
        *x = nextafter(*x, -INFINITY);
}

static int32_t few(struct odd_rays *r)
{
    return (int32_t)pick(r, 9) - 4;
}

/* Shifts the direction a little: not at all, by units in the last place, or by up to a millionth. */
static void nudge(struct odd_rays *r, double d[3])
{
    uint32_t how = pick(r, 3);
    double size = vec3_length(d) * decades(r, -16.0, -6.0);
    for (int k = 0; k < 3; k++) {
        if (how == 1) step(&d[k], few(r));
        if (how == 2) d[k] += size * (2.0 * unit(r) - 1.0);
    }
}

static void to_corner(struct odd_rays *r, double d[3])
{
    corner_of(r, any_triangle(r), pick(r, 3), d);
    nudge(r, d);
}

static void on_edge(struct odd_rays *r, double d[3])
{
    uint32_t t = any_triangle(r), i = pick(r, 3);
    double a[3], b[3], part = pick(r, 4) ? unit(r) : 1.2 * unit(r) - 0.1;
    corner_of(r, t, i, a);
    corner_of(r, t, i + 1, b);
    for (int k = 0; k < 3; k++)
        d[k] = a[k] + part * (b[k] - a[k]);
}

static void to_edge(struct odd_rays *r, double d[3])
{
    on_edge(r, d);
    nudge(r, d);
}

static void inside(struct odd_rays *r, double d[3])
{
    uint32_t t = any_triangle(r);
    double a[3], b[3], c[3], x = unit(r), y = unit(r) * (1.0 - x);
    corner_of(r, t, 0, a);
    corner_of(r, t, 1, b);
    corner_of(r, t, 2, c);
    for (int k = 0; k < 3; k++)
        d[k] = a[k] + x * (b[k] - a[k]) + y * (c[k] - a[k]);
}

/* ---- the cube */

/* Gives a coordinate on a border between cells, or of the face, or a few units in the last place beside it. */
static double border(struct odd_rays *r)
{
    double x = 2.0 * (double)pick(r, r->cells + 1) / (double)r->cells - 1.0;
    step(&x, few(r));
    return x;
}

static void at_border(struct odd_rays *r, double d[3])
{
    uint32_t axis = pick(r, 3), which = pick(r, 3);
    double u = which == 1 ? 2.0 * unit(r) - 1.0 : border(r), v = which == 2 ? 2.0 * unit(r) - 1.0 : border(r);
    d[axis] = sign(r);
    d[(axis + 1) % 3] = u;
    d[(axis + 2) % 3] = v;
}

static void at_cube(struct odd_rays *r, double d[3])
{
    uint32_t corner = pick(r, 2);
    for (int k = 0; k < 3; k++) {
        d[k] = sign(r);
        step(&d[k], few(r));
    }
    if (!corner) d[pick(r, 3)] = 2.0 * unit(r) - 1.0;
}

static void to_bordered(struct odd_rays *r, double d[3])
{
    on_edge(r, d);
    int axis = fabs(d[0]) >= fabs(d[1]) ? 0 : 1;
    if (fabs(d[2]) > fabs(d[axis])) axis = 2;
    double most = fabs(d[axis]), half = 0.5 * (double)r->cells;
    uint32_t which = pick(r, 3);
    for (int k = 0; k < 3; k++)
        d[k] /= most;
    for (uint32_t i = 1; i <= 2; i++) {
        double *x = &d[(axis + (int)i) % 3];
        if (which == i) continue;
        *x = floor((*x + 1.0) * half + 0.5) / half - 1.0;
        step(x, few(r));
    }
}

static void at_axis(struct odd_rays *r, double d[3])
{
    static const double small[] = {0.0, -0.0, 1e-300, -1e-300, 1e-22, -1e-22, 1e-16, -1e-9};
    for (int k = 0; k < 3; k++)
        d[k] = small[pick(r, 8)];
    d[pick(r, 3)] = sign(r);
    if (pick(r, 2)) d[pick(r, 3)] = 2.0 * unit(r) - 1.0;
}

/* ---- planes */

/* Gives the normal of the plane through the station and an edge. */
static void edge_plane(struct odd_rays *r, double n[3])
{
    uint32_t t = any_triangle(r), i = pick(r, 3);
    double a[3], b[3], e[3];
    corner_of(r, t, i, a);
    corner_of(r, t, i + 1, b);
    vec3_sub(b, a, e);
    vec3_cross(a, e, n);
}

static void to_crossing(struct odd_rays *r, double d[3])
{
    double m[3], n[3], s = sign(r);
    edge_plane(r, m);
    edge_plane(r, n);
    vec3_cross(m, n, d);
    for (int k = 0; k < 3; k++)
        d[k] *= s;
    nudge(r, d);
}

static void in_plane(struct odd_rays *r, double d[3])
{
    uint32_t t = any_triangle(r);
    double a[3], b[3], e[3], f[3], x = 2.0 * unit(r) - 1.0, y = 2.0 * unit(r) - 1.0;
    corner_of(r, t, 0, a);
    corner_of(r, t, 1, b);
    vec3_sub(b, a, e);
    corner_of(r, t, 2, b);
    vec3_sub(b, a, f);
    for (int k = 0; k < 3; k++)
        d[k] = x * e[k] + y * f[k];
}

/* Gives the point where an edge of one triangle meets the plane of another. */
static void to_meeting(struct odd_rays *r, double d[3])
{
    uint32_t t = any_triangle(r), other = any_triangle(r), i = pick(r, 3);
    double a[3], b[3], c[3], e[3], f[3], n[3];
    corner_of(r, t, 0, a);
    corner_of(r, t, 1, b);
    corner_of(r, t, 2, c);
    vec3_sub(b, a, e);
    vec3_sub(c, a, f);
    vec3_cross(e, f, n);
    corner_of(r, other, i, b);
    corner_of(r, other, i + 1, c);
    vec3_sub(c, b, e);
    double along = vec3_dot(n, e), at = along != 0.0 ? (vec3_dot(n, a) - vec3_dot(n, b)) / along : 0.5;
    for (int k = 0; k < 3; k++) /* and from there a little towards a corner */
        d[k] = b[k] + at * e[k] + (pick(r, 2) ? decades(r, -12.0, -2.0) * (a[k] - b[k]) : 0.0);
}

static void (*const AIM[ODD_KINDS])(struct odd_rays *r, double d[3]) = {
    [ODD_ANYWHERE] = any_direction, [ODD_CORNERS] = to_corner,    [ODD_EDGES] = to_edge,       [ODD_INSIDE] = inside,
    [ODD_BORDERS] = at_border,      [ODD_BORDERED] = to_bordered, [ODD_CUBE] = at_cube,        [ODD_AXES] = at_axis,
    [ODD_CROSSINGS] = to_crossing,  [ODD_PLANES] = in_plane,      [ODD_MEETINGS] = to_meeting,
};

/* Makes a line through the scene, in steps of a thousandth of a degree up to three degrees. */
static void line(struct odd_rays *r, uint32_t n, double *x, double *y, double *z)
{
    double from[3], to[3], across[3];
    inside(r, from);
    any_direction(r, to);
    vec3_cross(from, to, across);
    vec3_cross(across, from, to);
    double p = vec3_length(from), q = vec3_length(to), turn = decades(r, -4.8, -1.3);
    for (uint32_t i = 0; i < n; i++) {
        double angle = turn * ((double)i - 0.5 * n), c = cos(angle) / p, s = sin(angle) / q;
        x[i] = c * from[0] + s * to[0];
        y[i] = c * from[1] + s * to[1];
        z[i] = c * from[2] + s * to[2];
    }
}

void odd_rays_fill(struct odd_rays *r, enum odd_kind kind, uint32_t n, double *x, double *y, double *z)
{
    if (kind == ODD_LINE) line(r, n, x, y, z);
    for (uint32_t i = 0; i < n; i++) {
        double d[3];
        if (kind != ODD_LINE)
            AIM[kind](r, d);
        else
            memcpy(d, (const double[3]){x[i], y[i], z[i]}, sizeof d);
        double length = vec3_length(d);
        if (!(length > 1e-150 && length < 1e150)) { /* a corner where the station is */
            any_direction(r, d);
            length = vec3_length(d);
        }
        x[i] = d[0] / length;
        y[i] = d[1] / length;
        z[i] = d[2] / length;
    }
}

void odd_rays_mix(struct odd_rays *r, uint32_t n, double *x, double *y, double *z)
{
    const uint32_t mixed = n / 4 * 3;
    uint32_t kind = pick(r, ODD_KINDS);
    for (uint32_t at = 0; at < mixed; at += ODD_RUN, kind = (kind + 1) % ODD_KINDS)
        odd_rays_fill(r, kind, mixed - at < ODD_RUN ? mixed - at : ODD_RUN, x + at, y + at, z + at);
    for (uint32_t at = mixed; at < n; at++)
        odd_rays_fill(r, pick(r, ODD_KINDS), 1, x + at, y + at, z + at);
}
