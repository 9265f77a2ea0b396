/* SPDX-License-Identifier: MIT */
/* Outlines by direction: each cell lists the edges that footprints within it can reach. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/footprint/outlines.h"
#include "core/grow.h"
#include "core/vec3.h"

enum { N_CELLS = 6 * OUTLINE_CELLS * OUTLINE_CELLS };
#define NEAREST_M 0.02 /* nearer pieces of edges are left out: most cells would list them */
#define PIECE     0.1  /* length of the longest piece of an edge, as a share of its distance */

/* COUNT counts the entries of cell c in first[c + 1]. FILL writes each entry at first[c]++. AROUND sets the cell's bit
 * in the array `around`. */
enum draw_what { COUNT, FILL, AROUND };

struct draw {
    struct beam_outlines *o;
    const struct beam *beam;
    enum draw_what what;
    uint32_t edge;
    float normal[3]; /* of the edge's plane */
    uint64_t n;
};

/* Stretches of edges that count as outlines. */
struct stretches {
    struct outline_stretch *at;
    size_t n, room;
};

static void add_to_cell(struct draw *d, uint32_t cell, float range_m)
{
    struct beam_outlines *o = d->o;
    if (d->what == AROUND) {
        o->around[cell / 32] |= 1U << cell % 32;
        return;
    }
    d->n++;
    if (d->what == COUNT) {
        o->first[cell + 1]++;
        return;
    }
    o->entry[o->first[cell]++] = (struct outline_entry){range_m, {d->normal[0], d->normal[1], d->normal[2]}, d->edge};
    o->any[cell / 32] |= 1U << cell % 32;
}

static void draw_row(struct draw *d, uint32_t face, int32_t row, double from, double to, float range_m)
{
    int32_t i0 = (int32_t)floor(fmax(from, 0.0)), i1 = (int32_t)floor(fmin(to, OUTLINE_CELLS - 1));
    for (int32_t i = i0; i <= i1; i++)
        add_to_cell(d, outline_place(face, (uint32_t)i, (uint32_t)row), range_m);
}

/* Draws a piece from p to q (in cells), and all cells within `wide` of it, row by row. */
static void draw_on_face(struct draw *d, uint32_t face, const double p[2], const double q[2], double wide,
                         float range_m)
{
    double low = fmin(p[1], q[1]), high = fmax(p[1], q[1]);
    if (high + wide < 0.0 || low - wide >= OUTLINE_CELLS) return;
    int32_t j0 = (int32_t)floor(fmax(low - wide, 0.0)), j1 = (int32_t)floor(fmin(high + wide, OUTLINE_CELLS - 1));
    for (int32_t j = j0; j <= j1; j++) {
        /* the part of the piece that this row can be near to */
        double t0 = 0.0, t1 = 1.0, rise = q[1] - p[1];
        if (fabs(rise) > 1e-9) {
            double ta = (j - wide - p[1]) / rise, tb = (j + 1 + wide - p[1]) / rise;
            t0 = fmax(0.0, fmin(ta, tb));
            t1 = fmin(1.0, fmax(ta, tb));
        }
        if (t0 > t1) continue;
        double x0 = p[0] + t0 * (q[0] - p[0]), x1 = p[0] + t1 * (q[0] - p[0]);
        draw_row(d, face, j, fmin(x0, x1) - wide, fmax(x0, x1) + wide, range_m);
    }
}

/* Draws a short piece on each face that the piece, or a footprint on the piece, may reach. */
static void draw_piece(struct draw *d, const double p[3], const double q[3], double range_m)
{
    const double half = 0.5 * OUTLINE_CELLS;
    double angle = 1.02 * beam_radius(d->beam, range_m) / range_m + 1e-6;
    if (d->what == AROUND) angle += 1.02 * OUTLINE_AROUND_RAD;
    for (uint32_t face = 0; face < 6; face++) {
        int axis = (int)face / 2, ua = (axis + 1) % 3, va = (axis + 2) % 3;
        double sign = face % 2 == 0 ? 1.0 : -1.0, zp = sign * p[axis], zq = sign * q[axis];
        /* Along the face's axis, a point seen at a corner of the face has 0.577 of its distance. 0.35 leaves room
         * for a footprint or a short piece that reaches beyond the face. */
        double least = 0.35 * range_m;
        if (zp < least || zq < least) continue;
        double a[2] = {p[ua] / zp, p[va] / zp}, b[2] = {q[ua] / zq, q[va] / zq};
        /* On the face a small angle appears larger by 1 / cos^2 of its distance from the face's middle. */
        double more = fmax(1.0 + a[0] * a[0] + a[1] * a[1], 1.0 + b[0] * b[0] + b[1] * b[1]);
        double wide = 1.1 * angle * more * half + 0.01;
        for (int i = 0; i < 2; i++) {
            a[i] = (a[i] + 1.0) * half;
            b[i] = (b[i] + 1.0) * half;
        }
        draw_on_face(d, face, a, b, wide, (float)(0.999999 * range_m));
    }
}

static double nearest_on(const double p[3], const double q[3])
{
    double e[3] = {q[0] - p[0], q[1] - p[1], q[2] - p[2]}, ee = vec3_dot(e, e);
    double t = ee > 0.0 ? fmin(1.0, fmax(0.0, -vec3_dot(p, e) / ee)) : 0.0;
    double x[3] = {p[0] + t * e[0], p[1] + t * e[1], p[2] + t * e[2]};
    return sqrt(vec3_dot(x, x));
}

static int add_stretch(struct stretches *s, const double p[3], const double q[3], uint32_t edge)
{
    if (!grow(&s->at, &s->room, s->n + 1, sizeof *s->at)) return SH_ENOMEM;
    struct outline_stretch *one = &s->at[s->n++];
    memcpy(one->p, p, sizeof one->p);
    memcpy(one->q, q, sizeof one->q);
    one->edge = edge;
    return SH_OK;
}

/* Cuts an edge into pieces that are short as seen from the station, and keeps the stretches that count. */
static int cut_edge(struct stretches *s, struct outline_prober *prober, const double p[3], const double q[3],
                    uint32_t edge, double range_max_m)
{
    double e[3] = {q[0] - p[0], q[1] - p[1], q[2] - p[2]}, middle[3];
    double range_m = nearest_on(p, q), length = sqrt(vec3_dot(e, e));
    if (range_m > range_max_m) return SH_OK;
    if (length > PIECE * fmax(range_m, NEAREST_M)) {
        for (int i = 0; i < 3; i++)
            middle[i] = p[i] + 0.5 * e[i];
        int rc = cut_edge(s, prober, p, middle, edge, range_max_m);
        return rc == SH_OK ? cut_edge(s, prober, middle, q, edge, range_max_m) : rc;
    }
    if (range_m <= NEAREST_M) return SH_OK;
    if (prober->probe == NULL) return add_stretch(s, p, q, edge);
    uint32_t n = outline_probe(prober, p, q, range_m);
    for (uint32_t i = 0, end; i < n; i = end) {
        double a[3], b[3];
        for (end = i + 1; end < n && prober->counts[end] == prober->counts[i];)
            end++;
        if (!prober->counts[i]) continue;
        for (int k = 0; k < 3; k++) {
            a[k] = p[k] + e[k] * i / n;
            b[k] = p[k] + e[k] * end / n;
        }
        if (add_stretch(s, a, b, edge) != SH_OK) return SH_ENOMEM;
    }
    return SH_OK;
}

static int find_stretches(const struct beam_outlines *o, struct outline_prober *prober,
                          const struct beam_outlines_spec *spec, struct stretches *s, struct sh_err *err)
{
    for (uint32_t k = 0; k < o->n_edges; k++) {
        double p[3], q[3];
        if ((k & 0xfff) == 0 && sh_check_stop(spec->report, err) != SH_OK) return SH_ESTOPPED;
        for (int i = 0; i < 3; i++) {
            p[i] = o->edge[k].a[i];
            q[i] = o->edge[k].b[i];
        }
        if (cut_edge(s, prober, p, q, k, spec->range_max_m * 1.01) != SH_OK)
            return sh_fail(err, SH_ENOMEM, "beam: no memory for outlines");
    }
    return SH_OK;
}

static int by_range(const void *a, const void *b)
{
    const struct outline_entry *x = a, *y = b;
    if (x->range_m != y->range_m) return (x->range_m > y->range_m) - (x->range_m < y->range_m);
    return (x->edge > y->edge) - (x->edge < y->edge);
}

static void edge_normal(const struct outline_edge *edge, float normal[3])
{
    double a[3], b[3], n[3];
    for (int i = 0; i < 3; i++) {
        a[i] = (double)edge->a[i];
        b[i] = (double)edge->b[i];
    }
    vec3_cross(a, b, n);
    double length = sqrt(vec3_dot(n, n));
    for (int i = 0; i < 3; i++)
        normal[i] = length > 0.0 ? (float)(n[i] / length) : 0.0f;
}

static int draw_all(struct beam_outlines *o, const struct beam_outlines_spec *spec, const struct stretches *s,
                    enum draw_what what, uint64_t *n, struct sh_err *err)
{
    struct draw d = {.o = o, .beam = spec->beam, .what = what};
    for (size_t i = 0; i < s->n; i++) {
        if ((i & 0xfff) == 0 && sh_check_stop(spec->report, err) != SH_OK) return SH_ESTOPPED;
        d.edge = s->at[i].edge;
        if (d.what == FILL) edge_normal(&o->edge[d.edge], d.normal);
        draw_piece(&d, s->at[i].p, s->at[i].q, nearest_on(s->at[i].p, s->at[i].q));
    }
    if (n != NULL) *n = d.n;
    return SH_OK;
}

/* After filling, each of o->first stands at its cell's end. */
static int sort_cells(struct beam_outlines *o, const struct beam_outlines_spec *spec, struct sh_err *err)
{
    memmove(o->first + 1, o->first, N_CELLS * sizeof *o->first);
    o->first[0] = 0;
    for (uint32_t c = 0; c < N_CELLS; c++) {
        if ((c & 0xfff) == 0 && sh_check_stop(spec->report, err) != SH_OK) return SH_ESTOPPED;
        if (o->first[c + 1] - o->first[c] > 1)
            qsort(o->entry + o->first[c], o->first[c + 1] - o->first[c], sizeof *o->entry, by_range);
    }
    return SH_OK;
}

/* Puts edges in the order in which cells name them, so that neighbouring pulses read neighbouring edges.
 * Edges that no cell names are left out. */
static int order_edges(struct beam_outlines *o, struct sh_err *err)
{
    const uint32_t none = 0xffffffff;
    uint32_t *to = malloc((size_t)(o->n_edges + 1) * sizeof *to), n = 0;
    struct outline_edge *was = o->edge, *edge = malloc((size_t)(o->n_edges + 1) * sizeof *edge);
    if (to == NULL || edge == NULL) {
        free(to);
        free(edge);
        return sh_fail(err, SH_ENOMEM, "beam: no memory for outlines");
    }
    memset(to, 0xff, (size_t)o->n_edges * sizeof *to);
    for (uint64_t i = 0; i < o->n_entries; i++) {
        uint32_t from = o->entry[i].edge;
        if (to[from] == none) {
            edge[n] = was[from];
            to[from] = n++;
        }
        o->entry[i].edge = to[from];
    }
    o->edge = edge;
    o->n_edges = n;
    free(was);
    free(to);
    return SH_OK;
}

static int fill_cells(struct beam_outlines *o, const struct beam_outlines_spec *spec, const struct stretches *s,
                      struct sh_err *err)
{
    uint64_t n;
    o->first = calloc(N_CELLS + 1, sizeof *o->first);
    o->any = calloc(N_CELLS / 32, sizeof *o->any);
    o->around = calloc(N_CELLS / 32, sizeof *o->around);
    if (o->first == NULL || o->any == NULL || o->around == NULL) return sh_fail(err, SH_ENOMEM, "beam: no memory");
    int rc = draw_all(o, spec, s, COUNT, &n, err);
    if (rc != SH_OK) return rc;
    if (n >= UINT32_MAX) return sh_fail(err, SH_EINPUT, "beam: too many outlines; beam.mode: rings does without them");
    for (uint32_t c = 0; c < N_CELLS; c++)
        o->first[c + 1] += o->first[c];
    o->entry = malloc((size_t)(n + 1) * sizeof *o->entry);
    if (o->entry == NULL) return sh_fail(err, SH_ENOMEM, "beam: no memory for outlines");
    rc = draw_all(o, spec, s, FILL, NULL, err);
    if (rc == SH_OK) rc = draw_all(o, spec, s, AROUND, NULL, err);
    if (rc == SH_OK) rc = sort_cells(o, spec, err);
    o->n_entries = n;
    return rc == SH_OK ? order_edges(o, err) : rc;
}

int beam_outlines_create(const struct beam_outlines_spec *spec, const struct beam_probe *probe,
                         struct beam_outlines **out, struct sh_err *err)
{
    struct stretches stretches = {.at = NULL};
    struct outline_prober *prober = calloc(1, sizeof *prober);
    struct beam_outlines *o = calloc(1, sizeof *o);
    *out = NULL;
    int rc = o != NULL && prober != NULL ? outline_find(spec, o, err) : sh_fail(err, SH_ENOMEM, "beam: no memory");
    if (rc == SH_OK) {
        prober->probe = probe;
        prober->beam = spec->beam;
    }
    if (rc == SH_OK) rc = find_stretches(o, prober, spec, &stretches, err);
    if (rc == SH_OK) rc = fill_cells(o, spec, &stretches, err);
    free(stretches.at);
    free(prober);
    if (rc == SH_OK)
        *out = o;
    else
        beam_outlines_free(o);
    return rc;
}

void beam_outlines_free(struct beam_outlines *o)
{
    if (o == NULL) return;
    free(o->edge);
    free(o->first);
    free(o->any);
    free(o->around);
    free(o->entry);
    free(o);
}
