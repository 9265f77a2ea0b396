/* SPDX-License-Identifier: MIT */
/* Points of a frame as doubles. The hot path of every recorder. */
#include <math.h>

#include "core/vecmath.h"
#include "drivers/host/host.h"

#define TWO_PI 6.283185307179586476925

void host_turn_table(struct scanhead *sh)
{
    for (int i = 0; i < HOST_TURN_PARTS; i++) {
        double a = TWO_PI * i / HOST_TURN_PARTS;
        sh->sin_part[i] = sin(a);
        sh->cos_part[i] = cos(a);
    }
}

/* Point i as on the wire; members that all layouts share are set in p. */
static inline struct native_point decode_points_take(const uint8_t *payload, uint32_t i, int64_t t0_ns,
                                                     struct scanhead_point *p)
{
    struct native_point w;
    native_decode_point(payload, i, &w);
    p->label = w.label;
    p->t_ns = (int64_t)((uint64_t)t0_ns + w.dt_ns); /* wraps where a broken stream's t0_ns is the largest */
    p->echo = w.echo;
    p->echo_count = w.echo_count;
    p->reflectance_db = w.refl_cdb == INT16_MIN ? NAN : w.refl_cdb / 100.0;
    return w;
}

/* WGS 84, NIMA TR8350.2: geodetic to geocentric. */
static void geocentric(double lat_deg, double lon_deg, double h, double p[3])
{
    const double a = 6378137.0, f = 1 / 298.257223563, e2 = f * (2 - f), rad = NATIVE_RAD_PER_DEG;
    double s = sin(lat_deg * rad), c = cos(lat_deg * rad), n = a / sqrt(1 - e2 * s * s);
    p[0] = (n + h) * c * cos(lon_deg * rad);
    p[1] = (n + h) * c * sin(lon_deg * rad);
    p[2] = (n * (1 - e2) + h) * s;
}

/* Sets the other members of a geo point, once x, y, z and range_m are set. */
static inline void end_geo(struct scanhead_point *p)
{
    p->mirror_rad = p->pan_rad = NAN;
    if (p->echo_count == 0) p->x = p->y = p->z = p->range_m = NAN;
}

static void points_geodetic(const struct scanhead *sh, const struct scanhead_frame *frame, uint32_t first,
                            struct scanhead_point *p, uint32_t n)
{
    const double *anchor = sh->anchor.anchor, *scale = sh->anchor.scale;
    double from[3], to[3];
    geocentric(anchor[0], anchor[1], anchor[2], from);
    for (uint32_t i = first; i < first + n; i++, p++) {
        const struct native_point w = decode_points_take(frame->payload, i, frame->scan_t0_ns, p);
        p->x = anchor[0] + scale[0] * (int32_t)w.a;
        p->y = anchor[1] + scale[1] * (int32_t)w.b;
        p->z = anchor[2] + scale[2] * (int32_t)w.c;
        if (p->y > 180) p->y -= 360;
        if (p->y < -180) p->y += 360;
        geocentric(p->x, p->y, p->z, to);
        double dx = to[0] - from[0], dy = to[1] - from[1], dz = to[2] - from[2];
        p->range_m = sqrt(dx * dx + dy * dy + dz * dz);
        end_geo(p);
    }
}

static void points_geo(const struct scanhead *sh, const struct scanhead_frame *frame, uint32_t first,
                       struct scanhead_point *p, uint32_t n)
{
    const double *anchor = sh->anchor.anchor, *scale = sh->anchor.scale;
    for (uint32_t i = first; i < first + n; i++, p++) {
        const struct native_point w = decode_points_take(frame->payload, i, frame->scan_t0_ns, p);
        double dx = scale[0] * (int32_t)w.a, dy = scale[1] * (int32_t)w.b, dz = scale[2] * (int32_t)w.c;
        p->x = anchor[0] + dx;
        p->y = anchor[1] + dy;
        p->z = anchor[2] + dz;
        p->range_m = sh->anchor.moving & NATIVE_MOVING ? NAN : sqrt(dx * dx + dy * dy + dz * dz);
        end_geo(p);
    }
}

/* ---- polar points, in blocks of arrays: the loops that compute are vectors */

enum { BLOCK = 64 };
struct polar_block {
    double mirror[BLOCK], pan[BLOCK]; /* turns */
    int one_mirror;                   /* all mirror angles are equal, as along a ring: only index 0 is computed */
    double sin_m[BLOCK], cos_m[BLOCK], sin_pan[BLOCK], cos_pan[BLOCK];
    double mirror_rad[BLOCK], pan_rad[BLOCK];
};

/* The largest whole number that is not above |x| < 2^51. */
VEC_INLINE double floor_of(double x, uint64_t *bits)
{
    const double near = vec_round(x, bits);
    const uint64_t above = near > x;
    *bits -= above;
    return near - (double)(int)above;
}

/* sin and cos of u[n] >= 0 turns: the table gives whole 1/256 turns, the series the rest. |r| <= pi/256, so the
 * first terms left out, r^7/7! and r^8/8!, are below 2^-56 and 2^-66, far below the rounding of u itself. Angles in
 * turns need no reduction by an inexact pi. */
VEC_CLONES static void sincos_turns(const double *restrict sin_part, const double *restrict cos_part,
                                    const double *restrict u, int n, double *restrict s, double *restrict c)
{
    for (int i = 0; i < n; i++) {
        const double part = u[i] * HOST_TURN_PARTS;
        uint64_t k;
        const double whole = floor_of(part + 0.5, &k);
        const double r = (part - whole) * (TWO_PI / HOST_TURN_PARTS), r2 = r * r;
        const double sin_r = r + r * r2 * (-1.0 / 6 + r2 * (1.0 / 120));
        const double cos_r_1 = r2 * (-0.5 + r2 * (1.0 / 24 - r2 * (1.0 / 720)));
        const double sk = sin_part[k & (HOST_TURN_PARTS - 1)], ck = cos_part[k & (HOST_TURN_PARTS - 1)];
        s[i] = sk + (ck * sin_r + sk * cos_r_1);
        c[i] = ck + (ck * cos_r_1 - sk * sin_r);
    }
}

/* u[n] turns, folded into [lo, lo + 1), as radians. */
VEC_CLONES static void fold(const double *restrict u, int n, double lo, double *restrict rad)
{
    for (int i = 0; i < n; i++) {
        uint64_t unused;
        rad[i] = TWO_PI * (u[i] - floor_of(u[i] - lo, &unused));
    }
}

static void points_of_block(const struct scanhead *sh, const struct scanhead_frame *frame, uint32_t first,
                            const struct polar_block *b, struct scanhead_point *p, uint32_t n)
{
    const double scale = sh->descriptor.range_scale_m;
    for (uint32_t i = 0; i < n; i++, p++) {
        const struct native_point w = decode_points_take(frame->payload, first + i, frame->scan_t0_ns, p);
        p->range_m = p->echo_count == 0 ? NAN : scale * w.a;
        const uint32_t m = b->one_mirror ? 0 : i;
        const double flat = p->range_m * b->cos_m[m];
        p->x = flat * b->sin_pan[i];
        p->y = flat * b->cos_pan[i];
        p->z = p->range_m * b->sin_m[m];
        p->mirror_rad = b->mirror_rad[m];
        p->pan_rad = b->pan_rad[i];
    }
}

static void points_polar(const struct scanhead *sh, const struct scanhead_frame *frame, uint32_t first,
                         struct scanhead_point *p, uint32_t n)
{
    const struct native_descriptor *d = &sh->descriptor;
    /* The mirror angle lies within half a turn of the line's middle, so that it has no jump along the line. With other
     * heads it is an elevation. */
    const double middle = ((double)d->line_start_udeg + (double)d->line_stop_udeg) / 720e6;
    const double lo = (sh->emitter.kind == NATIVE_EMIT_LINE ? middle : 0) - 0.5;
    const double mirror_turns = 1 / d->mirror_counts_per_turn, pan_turns = 1 / d->pan_counts_per_turn;
    struct polar_block b = {.mirror = {0}, .pan = {0}};
    for (uint32_t at = 0; at < n; at += BLOCK) {
        const int m = (int)(n - at < BLOCK ? n - at : BLOCK);
        b.one_mirror = 1;
        for (int i = 0; i < m; i++) {
            struct native_point w;
            native_decode_point(frame->payload, first + at + (uint32_t)i, &w);
            b.mirror[i] = w.b * mirror_turns;
            b.pan[i] = w.c * pan_turns;
            b.one_mirror &= b.mirror[i] == b.mirror[0];
        }
        sincos_turns(sh->sin_part, sh->cos_part, b.mirror, b.one_mirror ? 1 : m, b.sin_m, b.cos_m);
        sincos_turns(sh->sin_part, sh->cos_part, b.pan, m, b.sin_pan, b.cos_pan);
        fold(b.mirror, b.one_mirror ? 1 : m, lo, b.mirror_rad);
        fold(b.pan, m, 0, b.pan_rad);
        points_of_block(sh, frame, first + at, &b, p + at, (uint32_t)m);
    }
}

int scanhead_points(struct scanhead *sh, const struct scanhead_frame *frame, uint32_t first,
                    struct scanhead_point *points, uint32_t max)
{
    int rc = host_check_last(sh, frame, SCANHEAD_POINTS);
    if (rc != 0) return rc;
    if (!sh->have_descriptor || !sh->have_anchor)
        return sh_fail(&sh->err, SCANHEAD_ESTATE, "%s: points came before the descriptor and the anchor of their scan",
                       sh->source.name);
    if (first >= frame->n_points) return 0;
    uint32_t n = frame->n_points - first;
    if (n > max) n = max;
    if (sh->descriptor.layout == NATIVE_GEO && sh->anchor.crs == NATIVE_CRS_GEODETIC)
        points_geodetic(sh, frame, first, points, n);
    else if (sh->descriptor.layout == NATIVE_GEO)
        points_geo(sh, frame, first, points, n);
    else
        points_polar(sh, frame, first, points, n);
    return (int)n;
}

/* Stand-in until the library decodes into columns itself. */
int scanhead_columns(struct scanhead *sh, const struct scanhead_frame *frame, uint32_t first,
                     const struct scanhead_columns *to, uint32_t max)
{
    struct scanhead_point p[BLOCK];
    uint32_t at = 0;
    while (at < max) {
        const int n = scanhead_points(sh, frame, first + at, p, max - at < BLOCK ? max - at : BLOCK);
        if (n < 0) return n;
        if (n == 0) break;
        for (int i = 0; i < n; i++, at++) {
            if (to->x != NULL) to->x[at] = p[i].x;
            if (to->y != NULL) to->y[at] = p[i].y;
            if (to->z != NULL) to->z[at] = p[i].z;
            if (to->range_m != NULL) to->range_m[at] = p[i].range_m;
            if (to->mirror_rad != NULL) to->mirror_rad[at] = p[i].mirror_rad;
            if (to->pan_rad != NULL) to->pan_rad[at] = p[i].pan_rad;
            if (to->reflectance_db != NULL) to->reflectance_db[at] = p[i].reflectance_db;
            if (to->t_ns != NULL) to->t_ns[at] = p[i].t_ns;
            if (to->label != NULL) to->label[at] = p[i].label;
            if (to->echo != NULL) to->echo[at] = p[i].echo;
            if (to->echo_count != NULL) to->echo_count[at] = p[i].echo_count;
        }
    }
    return (int)at;
}
