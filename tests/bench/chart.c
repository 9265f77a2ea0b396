/* SPDX-License-Identifier: MIT */
/* This measures speed against accuracy of the ways to cast, and prints rows of the chart's table. README.md says how
 * to read it.
 *
 * A method's name is its family and, as the last word, the value that is varied in it: "robust decided 16". */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/cast.h"
#include "tests/common/hits.h"
#include "tests/common/generate.h"
#include "core/rng.h"
#include "core/vecmath.h"
#include "tests/bench/bench.h"
#include "tests/bench/ground_truth.h"
#include "tests/bench/pin.h"
#include "tests/bench/sight.h"

enum { LINES = 104 /* cast, of a whole scan's */, ROUNDS = 9, CHUNK = 256, WIDTHS = 4, METHODS = 21 };
enum kind { FLOAT, REFINED, DECIDED, SIGHT }; /* the last two are the program's own */
#define WHOLE_SCAN 22.5e6                     /* pulses of a turn at 0.04 degrees, which share the cost of a sight */

static const uint32_t WIDTH[WIDTHS] = {1, 4, 8, 16};

struct method {
    enum kind kind;
    int robust;
    uint32_t width;
    double ns[ROUNDS], ns_median, err_p999_m, err_max_m;
    int front, is_default;
};

struct chart_scene {
    const char *name;
    uint32_t triangles;
    double side_m, rough_m;
    int at_edges;
};
/* Near scenes have ranges to 100 m. The far one has flat ground to 1.5 km seen from 4.7 m above it, up to 89.9 degrees
 * of incidence. The last scene is near, too, but each ray is turned to a corner, or to a point of an edge, of the
 * triangle that it would hit. */
static const struct chart_scene SCENES[] = {{"terrain 200 m wide", 100000, 200.0, 3.0, 0},
                                            {"terrain 3 km wide", 100000, 3000.0, 3.0, 0},
                                            {"200 m; each ray at an edge or corner", 100000, 200.0, 3.0, 1}};

struct chart {
    const struct chart_scene *spec;
    struct scene *scene;
    double station_m[3];
    struct bench_rays rays;
    struct embree_alone embree[2]; /* not robust, robust */
    struct bvh *bvh;
    struct caster *caster;
    struct bench_scan scan;
    int planned; /* the plan takes a map */
    struct sight *sight;
    struct sight_work *work;
    struct bvh_work *bvh_work;
    double *plane; /* n, d of each triangle from the station; one more, all NaN, for misses */
    double *range_m;
    uint32_t *prim;
    uint32_t native;
    struct method method[METHODS];
    double *reference_m, *error_m;
    uint32_t *sample, n_sample; /* rays that are compared */
};

static void add_methods(struct chart *c)
{
    struct method *m = c->method;
    const int sight = c->planned;
    for (int kind = FLOAT; kind <= DECIDED; kind++)
        for (int robust = kind == DECIDED; robust < 2; robust++)
            for (int w = 0; w < WIDTHS; w++, m++) {
                *m = (struct method){.kind = (enum kind)kind, .robust = robust, .width = WIDTH[w]};
                m->is_default = !sight && kind == DECIDED && m->width == c->native;
            }
    *m = (struct method){.kind = SIGHT, .robust = 1, .width = c->native, .is_default = sight};
}

/* Makes the planes through the double vertices. */
static int fill_planes(struct chart *c)
{
    uint32_t n = c->scene->n_triangles;
    c->plane = aligned_alloc(64, ((size_t)n + 2) / 2 * 64);
    if (c->plane == NULL) return 0;
    for (uint32_t i = 0; i < n; i++) {
        double v[3][3], e1[3], e2[3], *p = c->plane + 4 * (size_t)i;
        for (int k = 0; k < 3; k++)
            for (int j = 0; j < 3; j++)
                v[k][j] = c->scene->vertex_m[c->scene->triangle[i][k]][j] - c->station_m[j];
        for (int j = 0; j < 3; j++) {
            e1[j] = v[1][j] - v[0][j];
            e2[j] = v[2][j] - v[0][j];
        }
        p[0] = e1[1] * e2[2] - e1[2] * e2[1];
        p[1] = e1[2] * e2[0] - e1[0] * e2[2];
        p[2] = e1[0] * e2[1] - e1[1] * e2[0];
        p[3] = p[0] * v[0][0] + p[1] * v[0][1] + p[2] * v[0][2];
    }
    for (int j = 0; j < 4; j++)
        c->plane[4 * (size_t)n + (size_t)j] = (double)NAN;
    return 1;
}

VEC_CLONES
static void refine(const double *restrict plane, uint32_t n_triangles, const uint32_t *restrict prim,
                   const double *restrict dx, const double *restrict dy, const double *restrict dz, uint32_t n,
                   double *restrict range_m)
{
    for (uint32_t i = 0; i < n; i++) {
        int64_t at = (int64_t)(prim[i] < n_triangles ? prim[i] : n_triangles) * 4;
        range_m[i] = plane[at + 3] / (plane[at] * dx[i] + plane[at + 1] * dy[i] + plane[at + 2] * dz[i]);
    }
}

/* A sight is made anew for each round, because its cost belongs to the cast. */
static int make_sight(struct chart *c, double *cost_s, struct sh_err *err)
{
    struct sight_spec spec;
    bench_scan_spec(&c->scan, c->bvh, c->station_m, &spec);
    sight_free(c->sight);
    c->sight = NULL;
    double start_s = bench_process_s();
    int rc = sight_create(&spec, 1, NULL, &c->sight, err);
    *cost_s = bench_process_s() - start_s;
    return rc;
}

static void look_up(struct chart *c)
{
    const struct bench_rays *r = &c->rays;
    struct bvh_rays rays = {.n = r->n,
                            .dir = {r->dx, r->dy, r->dz},
                            .range_max_m = BENCH_RANGE_MAX_M,
                            .range_m = c->range_m,
                            .triangle = c->prim};
    memcpy(rays.from.at_m, c->station_m, sizeof rays.from.at_m);
    sight_hits(c->work, c->bvh_work, c->sight, &rays);
}

static void cast(struct chart *c, const struct method *m)
{
    const struct embree_alone *e = &c->embree[m->robust];
    const struct bench_rays *rays = &c->rays;
    if (m->kind >= DECIDED) bvh_set_packet(c->bvh, m->width);
    if (m->kind == SIGHT) {
        look_up(c);
        return;
    }
    if (m->kind == DECIDED) {
        hits_from(c->caster, c->bvh, c->station_m, BENCH_RANGE_MAX_M, rays->n, rays->dx, rays->dy, rays->dz, c->range_m,
                  c->prim);
        return;
    }
    for (uint32_t at = 0; at < rays->n; at += CHUNK) {
        uint32_t n = rays->n - at < CHUNK ? rays->n - at : CHUNK;
        embree_alone_pass(e, m->width, EMBREE_LOADED, at, n);
        if (m->kind == REFINED)
            refine(c->plane, c->scene->n_triangles, e->prim + at, rays->dx + at, rays->dy + at, rays->dz + at, n,
                   c->range_m + at);
    }
}

/* A ray that misses is wrong by the whole range. */
static void measure_error(struct chart *c, struct method *m)
{
    const struct embree_alone *e = &c->embree[m->robust];
    cast(c, m);
    for (uint32_t i = 0; i < c->n_sample; i++) {
        uint32_t at = c->sample[i];
        double range_m = m->kind != FLOAT                         ? c->range_m[at]
                         : e->prim[at] == RTC_INVALID_GEOMETRY_ID ? (double)NAN
                                                                  : (double)e->t[at];
        c->error_m[i] = isnan(range_m) ? c->reference_m[i] : fabs(range_m - c->reference_m[i]);
    }
    bench_sort(c->error_m, c->n_sample);
    m->err_p999_m = c->error_m[(uint32_t)ceil(0.999 * c->n_sample) - 1];
    m->err_max_m = c->error_m[c->n_sample - 1];
}

static int measure_speed(struct chart *c, struct sh_err *err)
{
    double build_s = 0.0;
    for (int round = 0; round < ROUNDS; round++)
        for (int i = 0; i < METHODS; i++) {
            struct method *m = &c->method[i];
            if (m->kind == SIGHT && make_sight(c, &build_s, err) != SH_OK) return err->code;
            double start_s = bench_thread_s();
            cast(c, m);
            m->ns[round] = 1e9 * (bench_thread_s() - start_s) / c->rays.n;
            if (m->kind == SIGHT) m->ns[round] += 1e9 * build_s / (double)c->scan.pulses;
        }
    for (int i = 0; i < METHODS; i++)
        c->method[i].ns_median = bench_median(c->method[i].ns, ROUNDS);
    return SH_OK;
}

/* A method is on the front unless another one is at least as fast and, in both figures, at least as exact, and better
 * in one of them. */
static void mark_front(struct method *method)
{
    for (int i = 0; i < METHODS; i++) {
        struct method *a = &method[i];
        a->front = 1;
        for (int k = 0; k < METHODS; k++) {
            const struct method *b = &method[k];
            int no_worse =
                b->ns_median <= a->ns_median && b->err_p999_m <= a->err_p999_m && b->err_max_m <= a->err_max_m;
            int better = b->ns_median < a->ns_median || b->err_p999_m < a->err_p999_m || b->err_max_m < a->err_max_m;
            if (no_worse && better) a->front = 0;
        }
    }
}

static int make_reference(struct chart *c)
{
    uint32_t most = c->rays.n, misses = 0, doubtful = 0;
    c->reference_m = malloc(most * sizeof *c->reference_m);
    c->error_m = malloc(most * sizeof *c->error_m);
    c->sample = malloc(most * sizeof *c->sample);
    struct ground_truth *r = ground_truth_create(c->scene, c->station_m);
    if (c->reference_m == NULL || c->error_m == NULL || c->sample == NULL || r == NULL) return 0;
    for (uint32_t at = 0; at < most; at++) {
        const double dir[3] = {c->rays.dx[at], c->rays.dy[at], c->rays.dz[at]};
        int in_doubt;
        double range_m = (double)ground_truth_range(r, dir, &in_doubt);
        doubtful += in_doubt ? 1U : 0U;
        misses += !in_doubt && !isfinite(range_m) ? 1U : 0U;
        if (in_doubt) continue;
        c->reference_m[c->n_sample] = range_m;
        c->sample[c->n_sample++] = at;
    }
    ground_truth_free(r);
    fprintf(stderr, "chart: %u rays compared, %u left out that graze a silhouette\n", c->n_sample, doubtful);
    if (misses != 0) fprintf(stderr, "chart: the reference misses %u rays in a closed scene\n", misses);
    return misses == 0 && c->n_sample > most / 2;
}

/* Turns each ray to a corner, or to a point of an edge, of the triangle that it hits. */
static void aim_at_edges(struct chart *c)
{
    const struct embree_alone *e = &c->embree[1];
    const uint64_t key = rng_key(1, RNG_SCENE);
    embree_alone_pass(e, 16, EMBREE_LOADED, 0, c->rays.n);
    for (uint32_t i = 0; i < c->rays.n; i++) {
        if (e->prim[i] == RTC_INVALID_GEOMETRY_ID) continue;
        uint64_t r = rng_u64(key, i);
        const uint32_t *t = c->scene->triangle[e->prim[i]];
        const double *p = c->scene->vertex_m[t[r % 3]], *q = c->scene->vertex_m[t[(r + 1) % 3]];
        double s = r >> 63 != 0 ? 0.0 : (double)(r << 1 >> 12) * 0x1p-52, d[3];
        for (int j = 0; j < 3; j++)
            d[j] = p[j] + s * (q[j] - p[j]) - c->station_m[j];
        double length = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        c->rays.fx[i] = (float)(c->rays.dx[i] = d[0] / length);
        c->rays.fy[i] = (float)(c->rays.dy[i] = d[1] / length);
        c->rays.fz[i] = (float)(c->rays.dz[i] = d[2] / length);
    }
}

static int set_up(struct chart *c, struct sh_err *err)
{
    static const double centre_m[2] = {0.0, 0.0};
    struct schedule_spec spec;
    struct bvh_info info;
    c->station_m[2] = 4.7;
    int rc = generate_terrain(c->spec->triangles, c->spec->side_m, c->spec->rough_m, centre_m, 1, &c->scene, err);
    bench_scan_of(WHOLE_SCAN, 1, &c->scan);
    bench_schedule(c->scan.lines, c->scan.line_pulses, 0, &spec);
    if (rc == SH_OK) rc = bench_rays_room(&spec, LINES, c->scan.line_pulses, &c->rays, err);
    if (rc == SH_OK) bench_rays_spread(&c->rays, c->scan.bundle, c->scan.lines / LINES);
    for (int robust = 0; robust < 2 && rc == SH_OK; robust++) {
        struct embree_alone *e = &c->embree[robust];
        rc = bench_embree(c->scene, c->station_m, robust, e, err);
        if (rc == SH_OK) rc = embree_alone_rays(e, c->rays.fx, c->rays.fy, c->rays.fz, c->rays.n, err);
    }
    if (rc == SH_OK) rc = bvh_create(c->scene, 0, NULL, &c->bvh, err);
    if (rc == SH_OK) rc = caster_create(&c->caster, err);
    if (rc == SH_OK) rc = bvh_work_create(&c->bvh_work, err);
    if (rc == SH_OK) rc = sight_work_create(&c->work, err);
    double cost_s;
    if (rc == SH_OK) rc = bench_scan_plan(&c->scan, c->bvh, c->station_m, &c->planned, err);
    if (rc == SH_OK) rc = make_sight(c, &cost_s, err);
    if (rc != SH_OK) return rc;
    if (c->spec->at_edges) aim_at_edges(c);
    info = *bvh_get_info(c->bvh);
    c->native = info.packet;
    c->range_m = aligned_alloc(64, c->rays.n * sizeof *c->range_m);
    c->prim = aligned_alloc(64, c->rays.n * sizeof *c->prim);
    if (c->range_m == NULL || c->prim == NULL || !fill_planes(c)) return sh_fail(err, SH_ENOMEM, "no memory");
    return SH_OK;
}

static void tear_down(struct chart *c)
{
    caster_free(c->caster);
    sight_work_free(c->work);
    bvh_work_free(c->bvh_work);
    sight_free(c->sight);
    bvh_free(c->bvh);
    embree_alone_free(&c->embree[0]);
    embree_alone_free(&c->embree[1]);
    bench_rays_free(&c->rays);
    scene_free(c->scene);
    free(c->plane);
    free(c->range_m);
    free(c->prim);
    free(c->reference_m);
    free(c->error_m);
    free(c->sample);
}

static void print_rows(const struct method *method, const char *scene)
{
    static const char *const kind[] = {"float", "refined", "decided"};
    for (int i = 0; i < METHODS; i++) {
        const struct method *m = &method[i];
        if (m->kind == SIGHT)
            printf("cast,sight");
        else
            printf("cast,%s%s %u", m->kind == DECIDED ? "" : m->robust ? "robust " : "plain ", kind[m->kind], m->width);
        printf(",%s,%.3f,%.3g,%.3g,%d,%d,,\n", scene, m->ns_median, m->err_p999_m, m->err_max_m, m->front,
               m->is_default);
    }
    fflush(stdout);
}

/* Adds the cost of a method in the two normal scans, and its worst error in any scan. */
static void add_to_all(struct method *all, const struct chart *c)
{
    for (int i = 0; i < METHODS; i++) {
        const struct method *m = &c->method[i];
        all[i].kind = m->kind;
        all[i].robust = m->robust;
        all[i].width = m->width;
        all[i].is_default = m->is_default;
        if (!c->spec->at_edges) all[i].ns_median += m->ns_median / 2.0;
        all[i].err_p999_m = fmax(all[i].err_p999_m, m->err_p999_m);
        all[i].err_max_m = fmax(all[i].err_max_m, m->err_max_m);
    }
}

static int draw_scene(const struct chart_scene *spec, struct method *all, struct sh_err *err)
{
    struct chart *c = calloc(1, sizeof *c);
    if (c == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    c->spec = spec;
    fprintf(stderr, "chart: cast, %s\n", spec->name);
    int rc = set_up(c, err);
    if (rc == SH_OK && !make_reference(c)) rc = sh_fail(err, SH_ESTATE, "%s: no reference", spec->name);
    if (rc == SH_OK) {
        add_methods(c);
        for (int i = 0; i < METHODS; i++)
            measure_error(c, &c->method[i]);
        rc = measure_speed(c, err);
    }
    if (rc == SH_OK) {
        mark_front(c->method);
        print_rows(c->method, spec->name);
        add_to_all(all, c);
    }
    tear_down(c);
    free(c);
    return rc;
}

int main(void)
{
    struct sh_err err;
    static struct method all[METHODS];
    pin(NULL);
    printf("panel,method,scene,ns_per_pulse,err_p999_m,err_max_m,front,default,err_rms_m,wrong_counts\n");
    for (size_t i = 0; i < sizeof SCENES / sizeof SCENES[0]; i++)
        if (draw_scene(&SCENES[i], all, &err) != SH_OK) {
            fprintf(stderr, "chart: %s\n", err.text);
            return 1;
        }
    mark_front(all);
    print_rows(all, "cost of a normal scan; worst error of all three");
    return fflush(stdout) == 0 ? 0 : 1;
}
