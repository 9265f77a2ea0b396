/* Outlines across a footprint, and the parts that they cut it into. */
#include <math.h>
#include <string.h>

#include "core/beam/outlines.h"
#include "core/vec3.h"
#include "core/vecmath.h"

enum { WORDS = (BEAM_MAX_SUBRAYS + 63) / 64 };
#define LEAST_PART 0.0005
#define SAME_LINE  1e-3 /* of the footprint's radius, and of a radian */

/* An edge in the beam's frame: across, and along. */
struct local_edge {
    double a[3], b[3];
};

static void turn_in(const float p[3], const double e1[3], const double e2[3], const double dir[3], double out[3])
{
    const double at[3] = {(double)p[0], (double)p[1], (double)p[2]};
    out[0] = vec3_dot(at, e1);
    out[1] = vec3_dot(at, e2);
    out[2] = vec3_dot(at, dir);
}

/* Where the segment is within w(z) of the axis: a quadratic inequality, for w^2 is quadratic too. Returns 0 where it
 * never is. */
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
        t0 = fmax(t0, (-bb - root) / aa);
        t1 = fmin(t1, (-bb + root) / aa);
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

/* The sub-ray through a point is (x, y) of the unit disc: (l1 + i l2) / (w0 + i s z) as complex numbers. */
static void to_disc(const struct beam *beam, const double p[3], double u[2])
{
    double re = beam->exit_radius_m, im = beam->slope * p[2], w2 = re * re + im * im;
    u[0] = (p[0] * re + p[1] * im) / w2;
    u[1] = (p[1] * re - p[0] * im) / w2;
}

static int make_line(const struct beam *beam, const struct local_edge *e, struct beam_line *line)
{
    double p[2], q[2];
    to_disc(beam, e->a, p);
    to_disc(beam, e->b, q);
    double ex = q[0] - p[0], ey = q[1] - p[1], length = sqrt(ex * ex + ey * ey);
    if (!(length > 1e-9)) return 0;
    line->n[0] = -ey / length;
    line->n[1] = ex / length;
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

/* The beam passes clear of the plane through the station and the edge: most do. The footprint is widest, as an angle,
 * where the edge is nearest. */
static int is_clear(const struct beam *beam, const struct outline_edge *edge, const float d[3], float range_m)
{
    const float exit = 1.01f * (float)beam->exit_radius_m, slope = 1.01f * (float)beam->slope;
    float off = edge->normal[0] * d[0] + edge->normal[1] * d[1] + edge->normal[2] * d[2], away = off * range_m;
    return away * away > exit * exit + slope * slope * range_m * range_m;
}

uint32_t beam_find_lines(const struct beam_outlines *o, const struct beam *beam, const double dir[3], double limit_m,
                         struct beam_line *line, double *next_m)
{
    uint32_t cell = outline_cell((float)dir[0], (float)dir[1], (float)dir[2]), n = 0;
    const float d[3] = {(float)dir[0], (float)dir[1], (float)dir[2]};
    double e1[3], e2[3];
    int axes = 0;
    *next_m = INFINITY;
    for (uint32_t k = o->first[cell]; k < o->first[cell + 1]; k++) {
        const struct outline_entry *entry = &o->entry[k];
        const struct outline_edge *edge = &o->edge[entry->edge];
        struct local_edge e;
        struct beam_line one;
        if ((double)entry->range_m > limit_m) {
            *next_m = n > 0 ? (double)entry->range_m : (double)INFINITY;
            break;
        }
        if (is_clear(beam, edge, d, entry->range_m)) continue;
        if (!axes) beam_axes(dir, e1, e2);
        axes = 1;
        turn_in(edge->a, e1, e2, dir, e.a);
        turn_in(edge->b, e1, e2, dir, e.b);
        if (!clip_to_beam(beam, &e)) continue;
        if (fmin(e.a[2], e.b[2]) > limit_m) continue; /* it is nearer elsewhere */
        if (!make_line(beam, &e, &one) || is_known(line, n, &one)) continue;
        if (n == BEAM_MAX_LINES) return n + 1;
        line[n++] = one;
    }
    return n;
}

/* ---- parts */

static void add_part(struct beam_parts *parts, double energy, double mx, double my, int centre)
{
    if (energy < LEAST_PART) return;
    uint32_t i = parts->n++;
    parts->energy[i] = energy;
    parts->x[i] = mx / energy;
    parts->y[i] = my / energy;
    if (centre) parts->centre = i;
}

/* What one or two lines cut off, in closed form. All h >= 0: the caps lie beyond. Returns 0 where the lines meet in the
 * disc. */
static int cut_caps(const struct beam *beam, const struct beam_line *line, uint32_t n, struct beam_parts *parts)
{
    double energy[2], moment[2], rest = 1.0, mx = 0.0, my = 0.0;
    int nested = -1; /* the line whose cap contains the other's */
    if (n == 2) {
        double cross = line[0].n[0] * line[1].n[1] - line[0].n[1] * line[1].n[0];
        double x = line[0].h * line[1].n[1] - line[1].h * line[0].n[1];
        double y = line[1].h * line[0].n[0] - line[0].h * line[1].n[0];
        if (x * x + y * y < cross * cross) return 0;
        if (line[0].n[0] * line[1].n[0] + line[0].n[1] * line[1].n[1] > 0.0) {
            /* one cap in the other, unless they stand beside each other */
            int inner = line[0].h > line[1].h ? 0 : 1, outer = 1 - inner;
            const struct beam_line *in = &line[inner], *out = &line[outer];
            double middle = in->h * (in->n[0] * out->n[0] + in->n[1] * out->n[1]);
            if (middle > out->h) nested = outer;
        }
    }
    for (uint32_t i = 0; i < n; i++)
        beam_half(beam, line[i].h, &energy[i], &moment[i]);
    for (uint32_t i = 0; i < n; i++) {
        double e = energy[i], cx = moment[i] * line[i].n[0], cy = moment[i] * line[i].n[1];
        if (nested == (int)i) {
            uint32_t in = 1 - i;
            e -= energy[in];
            cx -= moment[in] * line[in].n[0];
            cy -= moment[in] * line[in].n[1];
        }
        rest -= e;
        mx -= cx;
        my -= cy;
        add_part(parts, e, cx, cy, 0);
    }
    add_part(parts, rest, mx, my, 1);
    return 1;
}

/* Sub-rays of the fine pattern as sets of bits: eight truth values of a byte each make eight bits by a product that
 * brings each to its place. Beyond the pattern's end: whatever, the sets are cut to it. */
VEC_CLONES
static void half_bits(const float *restrict x, const float *restrict y, float nx, float ny, float h, uint32_t words,
                      uint64_t *restrict bits)
{
    for (uint32_t w = 0; w < words; w++) {
        uint8_t beyond[64];
        for (uint32_t i = 0; i < 64; i++)
            beyond[i] = x[64 * w + i] * nx + y[64 * w + i] * ny > h;
        uint64_t word = 0;
        for (uint32_t i = 0; i < 8; i++) {
            uint64_t eight;
            memcpy(&eight, beyond + 8 * i, sizeof eight);
            word |= (eight * 0x0102040810204080ULL) >> 56 << (8 * i);
        }
        bits[w] = word;
    }
}

static void sum_part(const struct beam_pattern *fine, const uint64_t *bits, struct beam_parts *parts)
{
    double mx = 0.0, my = 0.0, each = 1.0 / fine->n;
    uint32_t n = 0;
    for (uint32_t w = 0; 64 * w < fine->n; w++)
        for (uint64_t left = bits[w]; left != 0; left &= left - 1, n++) {
            uint32_t i = 64 * w + (uint32_t)__builtin_ctzll(left);
            mx += (double)fine->x[i];
            my += (double)fine->y[i];
        }
    add_part(parts, n * each, mx * each, my * each, (int)(bits[0] & 1));
}

static int cut_bits(const struct beam_pattern *fine, const struct beam_line *line, uint32_t n, struct beam_parts *parts)
{
    uint64_t part[BEAM_MAX_PARTS][WORDS], half[WORDS];
    uint32_t n_parts = 1, words = (fine->n + 63) / 64;
    for (uint32_t w = 0; w < words; w++)
        part[0][w] = 64 * (w + 1) <= fine->n ? ~(uint64_t)0
                     : 64 * w < fine->n      ? ((uint64_t)1 << (fine->n % 64)) - 1
                                             : 0;
    for (uint32_t i = 0; i < n; i++) {
        half_bits(fine->x, fine->y, (float)line[i].n[0], (float)line[i].n[1], (float)line[i].h, words, half);
        for (uint32_t p = 0, end = n_parts; p < end; p++) {
            uint64_t beyond = 0, before = 0;
            for (uint32_t w = 0; w < words; w++) {
                beyond |= part[p][w] & half[w];
                before |= part[p][w] & ~half[w];
            }
            if (beyond == 0 || before == 0) continue;
            if (n_parts == BEAM_MAX_PARTS) return 1;
            for (uint32_t w = 0; w < words; w++) {
                part[n_parts][w] = part[p][w] & half[w];
                part[p][w] &= ~half[w];
            }
            n_parts++;
        }
    }
    for (uint32_t p = 0; p < n_parts; p++)
        sum_part(fine, part[p], parts);
    return 0;
}

int beam_cut(const struct beam *beam, const struct beam_pattern *fine, const struct beam_line *line, uint32_t n,
             struct beam_parts *parts)
{
    parts->n = 0;
    parts->centre = BEAM_MAX_PARTS;
    if (n <= 2 && cut_caps(beam, line, n, parts)) return 0;
    parts->n = 0;
    return cut_bits(fine, line, n, parts);
}
