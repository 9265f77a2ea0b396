/* SPDX-License-Identifier: MIT */
/* Finds the density of points. The cells of surfaces lie in a hash table. */
#include <math.h>
#include <stdlib.h>

#include "core/studio/figures.h"
#include "core/vec3.h"

enum { KEY_BITS = 15, MOST_CELLS_BITS = 22, FIRST_BITS = 12, PLANES_SHIFT = 137 };

struct table {
    struct figures_cell *cell; /* [1 << bits], n 0: free */
    unsigned bits;
    size_t used;
};

/* Divides a scene into cells of one size, which are counted from the corner low_m. */
struct cutter {
    const struct scene *scene;
    double low_m[3], cell_m;
};

static size_t slot_of(const struct table *t, uint64_t key)
{
    size_t mask = ((size_t)1 << t->bits) - 1, at = (size_t)((key * 0x9e3779b97f4a7c15ULL) >> (64 - t->bits));
    while (t->cell[at].n != 0 && t->cell[at].key != key)
        at = (at + 1) & mask;
    return at;
}

/* Makes the table larger. Returns 0 where there is no memory. */
static int figures_density_make_room(struct table *t)
{
    struct table larger = {.bits = t->bits == 0 ? FIRST_BITS : t->bits + 1, .used = t->used};
    larger.cell = calloc((size_t)1 << larger.bits, sizeof *larger.cell);
    if (larger.cell == NULL) return 0;
    for (size_t i = 0; t->bits != 0 && i < (size_t)1 << t->bits; i++)
        if (t->cell[i].n != 0) larger.cell[slot_of(&larger, t->cell[i].key)] = t->cell[i];
    free(t->cell);
    *t = larger;
    return 1;
}

/* Returns the key of the cell that the point p of a triangle lies in, and sets the area of that cell. The key has the
 * height of the triangle's plane at the cell's middle, in steps of cell_m. Triangles in one plane must get the same
 * step, but rounding makes their heights differ a little. So PLANES_SHIFT / 1000 of a step is added: planes at round
 * heights then don't lie on the border of two steps. */
static uint64_t key_of(const struct cutter *cut, uint32_t triangle, const double p[3], unsigned station,
                       double *area_m2)
{
    const uint32_t *corner = cut->scene->triangle[triangle];
    const double *a = cut->scene->vertex_m[corner[0]];
    double n[3];
    vec3_normal(a, cut->scene->vertex_m[corner[1]], cut->scene->vertex_m[corner[2]], n);
    int w = fabs(n[0]) > fabs(n[1]) ? 0 : 1;
    if (fabs(n[2]) > fabs(n[w])) w = 2;
    const int u = (w + 1) % 3, v = (w + 2) % 3;
    const double iu = floor((p[u] - cut->low_m[u]) / cut->cell_m), iv = floor((p[v] - cut->low_m[v]) / cut->cell_m);
    const double mu = cut->low_m[u] + (iu + 0.5) * cut->cell_m, mv = cut->low_m[v] + (iv + 0.5) * cut->cell_m;
    const double mw = a[w] - (n[u] * (mu - a[u]) + n[v] * (mv - a[v])) / n[w];
    const double iw = floor((mw - cut->low_m[w]) / cut->cell_m + PLANES_SHIFT / 1000.0);
    const uint64_t mask = (1U << KEY_BITS) - 1;
    *area_m2 = cut->cell_m * cut->cell_m * vec3_length(n) / fabs(n[w]);
    return (uint64_t)station << (3 * KEY_BITS + 2) | (uint64_t)w << (3 * KEY_BITS) |
           ((uint64_t)(int64_t)iu & mask) << (2 * KEY_BITS) | ((uint64_t)(int64_t)iv & mask) << KEY_BITS |
           ((uint64_t)(int64_t)iw & mask);
}

/* Returns 1 where there would be too many cells, SH_ENOMEM where there is no memory for more. */
static int figures_density_add(struct table *t, uint64_t key, double area_m2, double range_m)
{
    if (t->bits == 0 || t->used * 4 >= (size_t)3 << t->bits) {
        if (t->bits == MOST_CELLS_BITS) return 1;
        if (!figures_density_make_room(t)) return SH_ENOMEM;
    }
    struct figures_cell *c = &t->cell[slot_of(t, key)];
    if (c->n == 0) {
        *c = (struct figures_cell){.key = key, .area_m2 = area_m2};
        t->used++;
    }
    if (c->n == UINT32_MAX) return 0;
    c->n++;
    c->range_sum_m += (float)range_m;
    return 0;
}

static int figures_density_fill(const struct figures_on_scene *in, const struct cutter *cut,
                                const struct sh_report *report, struct table *t)
{
    const struct cloud *cloud = in->compared->cloud;
    const uint32_t *triangle = in->compared->triangle;
    for (size_t i = 0; i < cloud->n; i++) {
        double p[3], area_m2;
        if ((i & 0xffff) == 0) {
            sh_progress(report, "counting points by area", (double)i / (double)cloud->n);
            if (sh_stopped(report)) return SH_ESTOPPED;
        }
        if (triangle[i] == CLOUD_TRIANGLE_NONE || !isfinite(in->compared->distance_m[i])) continue;
        cloud_to_scene(cloud, in->compared->site, i, p);
        const uint64_t key = key_of(cut, triangle[i], p, cloud_station(cloud, i), &area_m2);
        const double range_m = (double)in->range_m[i];
        int rc = isfinite(area_m2) ? figures_density_add(t, key, area_m2, range_m) : 0;
        if (rc != 0) return rc;
    }
    return 0;
}

static double density_of(const struct figures_cell *c)
{
    return (double)c->n / c->area_m2;
}

static int by_density(const void *a, const void *b)
{
    const double x = density_of(a), y = density_of(b);
    const uint64_t k = ((const struct figures_cell *)a)->key, l = ((const struct figures_cell *)b)->key;
    return x != y ? (x > y) - (x < y) : (k > l) - (k < l);
}

static void figures_density_keep(struct table *t, struct figures_density *out)
{
    size_t n = 0;
    for (size_t i = 0; t->bits != 0 && i < (size_t)1 << t->bits; i++)
        if (t->cell[i].n != 0) t->cell[n++] = t->cell[i];
    if (n > 1) qsort(t->cell, n, sizeof *t->cell, by_density);
    out->n = n;
    out->cell = t->cell;
}

int figures_density_of(const struct figures_on_scene *in, double cell_m, const struct sh_report *report,
                       struct figures_density *out, struct sh_err *err)
{
    const struct scene *scene = in->scene;
    struct cutter cut = {.scene = scene, .cell_m = cell_m};
    const double most_m = in->compared->site->max_m;
    double longest_m = 0.0;
    *out = (struct figures_density){0};
    for (int k = 0; k < 3; k++) {
        longest_m = fmax(longest_m, scene->max_m[k] - scene->min_m[k]);
        cut.low_m[k] = scene->min_m[k];
    }
    const double reach_m = most_m < longest_m ? most_m : longest_m; /* points may lie this far outside the scene */
    while ((longest_m + 2.0 * reach_m) / cut.cell_m > (double)((1 << KEY_BITS) - 2))
        cut.cell_m *= 2.0;
    for (int rc = 1; rc != 0; cut.cell_m *= 2.0) {
        struct table t = {0};
        rc = figures_density_fill(in, &cut, report, &t);
        if (rc == 0) {
            out->cell_m = cut.cell_m;
            figures_density_keep(&t, out);
            break;
        }
        free(t.cell);
        if (rc == SH_ESTOPPED) return sh_fail_stopped(err);
        if (rc == SH_ENOMEM) return sh_fail(err, rc, "no memory for cells of the surfaces");
    }
    return SH_OK;
}

static const double MOST_CELL_M = 50.0, CELL_POINTS = 16.0;

int figures_density_fit(const struct figures_on_scene *in, double first_m, const struct sh_report *report,
                        struct figures_density *out, struct figures_density_row *all, struct sh_err *err)
{
    for (double cell_m = first_m;; cell_m *= 2.0) {
        const int rc = figures_density_of(in, cell_m, report, out, err);
        if (rc != SH_OK) return rc;
        figures_density_within(out, 0, 0.0, (double)INFINITY, all);
        if (!(all->p50 * out->cell_m * out->cell_m < CELL_POINTS) || 2.0 * cell_m > MOST_CELL_M) return SH_OK;
        figures_density_free(out);
    }
}

void figures_density_free(struct figures_density *density)
{
    free(density->cell);
    *density = (struct figures_density){0};
}

static int is_within(const struct figures_cell *c, unsigned station, double from_m, double to_m)
{
    const double range_m = (double)c->range_sum_m / (double)c->n;
    if (station != 0 && c->key >> (3 * KEY_BITS + 2) != station) return 0;
    if (isnan(range_m)) return !(from_m > 0.0) && isinf(to_m);
    return range_m >= from_m && range_m < to_m;
}

void figures_density_within(const struct figures_density *density, unsigned station, double from_m, double to_m,
                            struct figures_density_row *row)
{
    const double part[3] = {0.05, 0.5, 0.95};
    double *const to[3] = {&row->p5, &row->p50, &row->p95};
    *row = (struct figures_density_row){0, 0, (double)NAN, (double)NAN, (double)NAN};
    for (size_t i = 0; i < density->n; i++) {
        if (!is_within(&density->cell[i], station, from_m, to_m)) continue;
        row->cells++;
        row->points += density->cell[i].n;
    }
    size_t sum = 0;
    int k = 0;
    for (size_t i = 0; i < density->n && k < 3; i++) {
        if (!is_within(&density->cell[i], station, from_m, to_m)) continue;
        sum += density->cell[i].n;
        for (; k < 3 && (double)sum >= part[k] * (double)row->points; k++)
            *to[k] = density_of(&density->cell[i]);
    }
}
