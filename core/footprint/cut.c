/* SPDX-License-Identifier: MIT */
/* The parts that outlines cut a footprint into. */
#include <string.h>

#include "core/footprint.h"
#include "core/vecmath.h"

#define LEAST_PART 0.0005

/* Takes a portion away: its energy, and its moments about the footprint's centre. */
static void take_from(struct beam_part *a, const struct beam_part *b)
{
    a->energy -= b->energy;
    a->x -= b->x;
    a->y -= b->y;
    a->xx -= b->xx;
    a->xy -= b->xy;
    a->yy -= b->yy;
}

/* Adds a portion as a part, with moments about its own centre. */
static void cut_add_part(struct beam_parts *parts, const struct beam_part *p, int centre)
{
    if (p->energy < LEAST_PART) return;
    uint32_t i = parts->n++;
    double x = p->x / p->energy, y = p->y / p->energy;
    parts->part[i] = (struct beam_part){
        p->energy, x, y, p->xx / p->energy - x * x, p->xy / p->energy - x * y, p->yy / p->energy - y * y};
    if (centre) parts->centre = i;
}

/* Returns the portion beyond a line; its second moments only where they are asked for. */
static struct beam_part cap_of(const struct beam *beam, const struct beam_line *line, int squares)
{
    struct beam_part p = {.xx = 0.0};
    double moment, along, across, nx = line->n[0], ny = line->n[1];
    beam_half(beam, line->h, &p.energy, &moment);
    p.x = moment * nx;
    p.y = moment * ny;
    if (!squares) return p;
    beam_half_squares(beam, line->h, &along, &across);
    p.xx = along * nx * nx + across * ny * ny;
    p.xy = (along - across) * nx * ny;
    p.yy = along * ny * ny + across * nx * nx;
    return p;
}

/* Adds the parts that one or two lines cut off, in closed form. All h are >= 0, so that no cap has the centre in it.
 * Returns 0 where the lines cross in the disc. */
static int cut_caps(const struct beam *beam, const struct beam_line *line, uint32_t n, int spreads,
                    struct beam_parts *parts)
{
    struct beam_part cap[2], rest = {.energy = 1.0};
    int nested = -1; /* the line whose cap contains the other's */
    if (n == 2) {
        double cross = line[0].n[0] * line[1].n[1] - line[0].n[1] * line[1].n[0];
        double x = line[0].h * line[1].n[1] - line[1].h * line[0].n[1];
        double y = line[1].h * line[0].n[0] - line[0].h * line[1].n[0];
        if (x * x + y * y < cross * cross) return 0;
        if (line[0].n[0] * line[1].n[0] + line[0].n[1] * line[1].n[1] > 0.0) {
            /* one cap is in the other, unless they are side by side */
            int inner = line[0].h > line[1].h ? 0 : 1, outer = 1 - inner;
            const struct beam_line *in = &line[inner], *out = &line[outer];
            double middle = in->h * (in->n[0] * out->n[0] + in->n[1] * out->n[1]);
            if (middle > out->h) nested = outer;
        }
    }
    if (spreads) rest.xx = rest.yy = beam->along[0];
    for (uint32_t i = 0; i < n; i++)
        cap[i] = cap_of(beam, &line[i], spreads);
    if (nested >= 0) take_from(&cap[nested], &cap[1 - nested]);
    for (uint32_t i = 0; i < n; i++) {
        take_from(&rest, &cap[i]);
        cut_add_part(parts, &cap[i], 0);
    }
    cut_add_part(parts, &rest, 1);
    return 1;
}

/* A set of places of the fine pattern is held as bits: place 16 r + i is bit r of lane i. So one comparison of vectors
 * decides one bit in every lane. */
enum { LANES = 16, MAX_ROWS = 32 };
_Static_assert(1 + 3 * BEAM_FINE_RINGS * (BEAM_FINE_RINGS + 1) <= LANES * MAX_ROWS, "a bit for each place");
typedef float lanes_f __attribute__((vector_size(4 * LANES)));
typedef int32_t lanes_i __attribute__((vector_size(4 * LANES)));

struct sums {
    lanes_f x, y;
};

/* Finds the places beyond a line. */
VEC_INLINE void beyond_line(const struct beam_pattern *fine, int rows, const struct beam_line *line, lanes_i *set)
{
    const float nx = (float)line->n[0], ny = (float)line->n[1], h = (float)line->h;
    lanes_i beyond = {0};
    for (int r = 0; r < rows; r++) {
        lanes_f x, y;
        memcpy(&x, fine->x + LANES * r, sizeof x);
        memcpy(&y, fine->y + LANES * r, sizeof y);
        beyond |= (x * nx + y * ny > h) & (int32_t)(1U << r);
    }
    *set = beyond;
}

VEC_INLINE void sum_places(const struct beam_pattern *fine, int rows, const lanes_i *set, struct sums *sums)
{
    lanes_i left = *set;
    sums->x = sums->y = (lanes_f){0};
    for (int r = 0; r < rows; r++, left >>= 1) {
        lanes_i x, y, in = -(left & 1);
        memcpy(&x, fine->x + LANES * r, sizeof x);
        memcpy(&y, fine->y + LANES * r, sizeof y);
        sums->x += (lanes_f)(x & in);
        sums->y += (lanes_f)(y & in);
    }
}

VEC_INLINE int is_empty(const lanes_i *set)
{
    uint64_t word[sizeof *set / 8], any = 0;
    memcpy(word, set, sizeof word);
    for (size_t i = 0; i < sizeof word / sizeof word[0]; i++)
        any |= word[i];
    return any == 0;
}

/* Returns the number of parts, or 0 where there are too many. */
VEC_CLONES
static uint32_t cut_places(const struct beam_pattern *fine, const struct beam_line *line, uint32_t n, lanes_i *part,
                           struct sums *sums)
{
    const int rows = (int)(fine->n + LANES - 1) / LANES;
    uint32_t n_parts = 1;
    for (uint32_t i = 0; i < LANES; i++) /* all places */
        part[0][i] =
            (int32_t)((fine->n + LANES - 1 - i) / LANES == MAX_ROWS ? ~0U
                                                                    : (1U << (fine->n + LANES - 1 - i) / LANES) - 1);
    for (uint32_t i = 0; i < n; i++) {
        lanes_i beyond;
        beyond_line(fine, rows, &line[i], &beyond);
        for (uint32_t p = 0, end = n_parts; p < end; p++) {
            lanes_i far = part[p] & beyond, near = part[p] & ~beyond;
            if (is_empty(&far) || is_empty(&near)) continue;
            if (n_parts == BEAM_MAX_PARTS) return 0;
            part[n_parts++] = far;
            part[p] = near;
        }
    }
    for (uint32_t p = 0; p < n_parts; p++)
        sum_places(fine, rows, &part[p], &sums[p]);
    return n_parts;
}

/* Adds the squares of a set's places, and the spread around each place. */
static void sum_squares(const struct beam_pattern *fine, const lanes_i *set, struct beam_part *p)
{
    for (uint32_t k = 0; k < fine->n; k++) {
        if (((uint32_t)(*set)[k % LANES] >> k / LANES & 1) == 0) continue;
        double x = (double)fine->x[k], y = (double)fine->y[k];
        p->xx += x * x + fine->rest;
        p->xy += x * y;
        p->yy += y * y + fine->rest;
    }
}

static int add_places(const struct beam_pattern *fine, const struct beam_line *line, uint32_t n, int spreads,
                      struct beam_parts *parts)
{
    lanes_i part[BEAM_MAX_PARTS];
    struct sums sums[BEAM_MAX_PARTS];
    const double each = 1.0 / fine->n;
    uint32_t n_parts = cut_places(fine, line, n, part, sums);
    for (uint32_t p = 0; p < n_parts; p++) {
        struct beam_part portion = {.energy = 0.0};
        uint32_t places = 0;
        double mx = 0.0, my = 0.0;
        for (int i = 0; i < LANES; i++) {
            places += (uint32_t)__builtin_popcount((uint32_t)part[p][i]);
            mx += (double)sums[p].x[i];
            my += (double)sums[p].y[i];
        }
        if (spreads) sum_squares(fine, &part[p], &portion);
        portion = (struct beam_part){.energy = places * each,
                                     .x = mx * each,
                                     .y = my * each,
                                     .xx = portion.xx * each,
                                     .xy = portion.xy * each,
                                     .yy = portion.yy * each};
        cut_add_part(parts, &portion, part[p][0] & 1);
    }
    return n_parts == 0;
}

int beam_cut(const struct beam *beam, const struct beam_pattern *fine, const struct beam_line *line, uint32_t n,
             int spreads, struct beam_parts *parts)
{
    parts->n = 0;
    parts->centre = BEAM_MAX_PARTS;
    if (n <= 2 && cut_caps(beam, line, n, spreads, parts)) return 0;
    return add_places(fine, line, n, spreads, parts);
}
