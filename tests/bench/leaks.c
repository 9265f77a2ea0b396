/* SPDX-License-Identifier: MIT */
/* Rays are aimed at edges and corners of closed meshes, from inside, and none may slip through.
 *
 * A ray leaks when it hits nothing, or when it reports the outer wall of nested meshes. It also leaks when it hits,
 * behind its target, a face from outside, because then it has left the mesh. A ray that hits the inside of the mesh
 * behind its target has passed an edge that it was aimed at. Such a ray is wrong, too, but no leak, and is counted
 * apart.
 *
 * Every second batch is a moving head's. This head goes about the station, up to half as far as the nearest wall. The
 * rays of the other batches are looked up in a sight of the station, too. Each answer must equal the cast's, bit by
 * bit. */
#include <math.h>
#include <stdio.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "tests/common/hits.h"
#include "tests/common/sight_beside.h"
#include "tests/common/generate.h"
#include "core/rng.h"
#include "core/vec3.h"
#include "tests/bench/bench.h"
#include "tests/bench/closed_mesh.h"
#include "firmware_sim/base/clock.h"

enum { BATCH = 4096, ROW = 256, MAX_THREADS = 64, PLAIN_RAYS = 1000000 / BENCH_LEAK_MESHES };

struct job {
    const struct bench_mesh *mesh;
    struct bvh *bvh;
    struct sight_beside sight; /* a sight of the station, which the threads join */
    double room_m;             /* how far from the station a moving head goes */
    uint64_t n, key;
    _Atomic uint64_t next; /* the first ray that no thread has taken yet */
    pthread_mutex_t lock;  /* it guards the members below */
    struct bench_leaks *out;
    double cpu_s;
};

struct batch {
    double dx[BATCH], dy[BATCH], dz[BATCH], target_m[BATCH], range_m[BATCH];
    struct {
        double x[BATCH], y[BATCH], z[BATCH];
    } o; /* the points where rays begin */
    float fx[BATCH], fy[BATCH], fz[BATCH];
    uint32_t prim[BATCH];
};

/* Moves the ray onto the nearest border of two cells of the sight, or up to 4 units in the last place beside it. */
static void to_border(uint32_t cells, uint64_t r, double d[3], double *length)
{
    int axis = fabs(d[0]) >= fabs(d[1]) ? 0 : 1;
    if (fabs(d[2]) > fabs(d[axis])) axis = 2;
    const double most = fabs(d[axis]), half = 0.5 * cells;
    double *x = &d[(axis + 1 + (int)(r & 1)) % 3];
    *x = floor((*x / most + 1.0) * half + 0.5) / half - 1.0;
    for (uint32_t i = (uint32_t)(r >> 1) % 5; i > 0; i--)
        *x = nextafter(*x, r & 64 ? INFINITY : -INFINITY);
    *x *= most;
    *length = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
}

static int is_moving(uint64_t i)
{
    return i / BATCH % 2 == 1;
}

static void origin_of(const struct job *job, uint64_t i, double from[3])
{
    static const double turn[3] = {1.1e-5, 0.7e-5, 1.7e-5};
    for (int j = 0; j < 3; j++)
        from[j] = job->mesh->station_m[j] + (is_moving(i) ? job->room_m * sin(turn[j] * (double)i) / sqrt(3.0) : 0.0);
}

/* Aims ray number i at a corner, or at a point of an edge. Four rays go to each of some neighbouring triangles, from
 * a random one on. So rays of a packet are near each other, as in a scan. One ray of four goes on to a border of the
 * sight's cells. */
static void aim(const struct job *job, uint64_t i, struct batch *b, uint32_t k)
{
    const struct scene *scene = job->mesh->scene;
    uint64_t r = rng_u64(job->key, i);
    uint64_t row = rng_u64(job->key + 2 * BENCH_LEAK_MESHES, i / ROW) >> 32;
    uint32_t n = job->mesh->n_aim, prim = ((uint32_t)(row * n >> 32) + (uint32_t)(i % ROW) / 4) % n;
    uint32_t corner = (uint32_t)(r >> 32) % 3;
    const double *p = scene->vertex_m[scene->triangle[prim][corner]];
    const double *q = scene->vertex_m[scene->triangle[prim][(corner + 1) % 3]];
    double s = r >> 63 != 0 ? 0.0 : (double)(rng_u64(job->key + 1, i) >> 11) * 0x1p-53, d[3], from[3], length2 = 0.0;
    origin_of(job, i, from);
    for (int j = 0; j < 3; j++) {
        d[j] = p[j] + s * (q[j] - p[j]) - from[j];
        length2 += d[j] * d[j];
    }
    double length = sqrt(length2);
    b->target_m[k] = length;
    VEC3_SET(b->o, k, from);
    if (job->sight.sight != NULL && i % 4 == 3 && !is_moving(i)) {
        to_border(job->sight.info.cells, r, d, &length);
        b->target_m[k] = INFINITY; /* it has left the edge, so only leaving the mesh counts */
    }
    b->dx[k] = d[0] / length;
    b->dy[k] = d[1] / length;
    b->dz[k] = d[2] / length;
}

/* Says whether the ray hits a face from outside. */
static int hits_outside(const struct bench_mesh *mesh, uint32_t prim, const double dir[3])
{
    double e1[3], e2[3];
    const uint32_t *t = mesh->scene->triangle[prim];
    for (int j = 0; j < 3; j++) {
        e1[j] = mesh->scene->vertex_m[t[1]][j] - mesh->scene->vertex_m[t[0]][j];
        e2[j] = mesh->scene->vertex_m[t[2]][j] - mesh->scene->vertex_m[t[0]][j];
    }
    double along = dir[0] * (e1[1] * e2[2] - e1[2] * e2[1]) + dir[1] * (e1[2] * e2[0] - e1[0] * e2[2]) +
                   dir[2] * (e1[0] * e2[1] - e1[1] * e2[0]);
    return prim < mesh->n_turned ? along > 0.0 : along < 0.0;
}

/* Returns 1 for a leak and 2 for a ray that passed its target. tolerance is a share of the range. */
static int judge(const struct bench_mesh *mesh, const struct batch *b, uint32_t k, double range_m, uint32_t prim,
                 double tolerance)
{
    const double dir[3] = {b->dx[k], b->dy[k], b->dz[k]};
    if (prim >= mesh->scene->n_triangles || prim >= mesh->n_inner) return 1;
    if (range_m <= b->target_m[k] * (1.0 + tolerance)) return 0;
    return hits_outside(mesh, prim, dir) ? 1 : 2;
}

static void cast(struct caster *caster, const struct job *job, uint64_t first, uint32_t n, struct batch *b)
{
    if (is_moving(first))
        caster_hits(caster, job->bvh,
                    &(struct bvh_rays){.n = n,
                                       .from.own = {b->o.x, b->o.y, b->o.z},
                                       .dir = {b->dx, b->dy, b->dz},
                                       .range_max_m = BENCH_RANGE_MAX_M,
                                       .range_m = b->range_m,
                                       .triangle = b->prim});
    else
        hits_from(caster, job->bvh, job->mesh->station_m, BENCH_RANGE_MAX_M, n, b->dx, b->dy, b->dz, b->range_m,
                  b->prim);
}

static void *job_main(void *arg)
{
    struct job *job = arg;
    struct sh_err err;
    struct caster *caster = NULL;
    struct sight_beside sight = {0};
    struct batch *b = aligned_alloc(64, sizeof *b);
    if (b == NULL || caster_create(&caster, &err) != SH_OK || sight_beside_join(&job->sight, &sight, &err) != SH_OK) {
        caster_free(caster);
        free(b);
        return NULL;
    }
    uint64_t counts[3] = {0}, first;
    struct cast_counters c;
    double start_s = bench_thread_s();
    while ((first = atomic_fetch_add(&job->next, BATCH)) < job->n) {
        uint32_t n = job->n - first < BATCH ? (uint32_t)(job->n - first) : BATCH;
        for (uint32_t k = 0; k < n; k++)
            aim(job, first + k, b, k);
        cast(caster, job, first, n, b);
        for (uint32_t k = 0; k < n; k++)
            counts[judge(job->mesh, b, k, b->range_m[k], b->prim[k], 1e-9)]++;
        if (!is_moving(first))
            sight_beside_check(&sight, n, &(const struct vec3_in){b->dx, b->dy, b->dz}, BENCH_RANGE_MAX_M, b->range_m,
                               b->prim);
    }
    caster_get_counters(caster, &c);
    pthread_mutex_lock(&job->lock);
    job->cpu_s += bench_thread_s() - start_s;
    job->out->rays += counts[0] + counts[1] + counts[2];
    job->out->leaks += counts[1];
    job->out->passed += counts[2];
    job->out->sight_rays += sight.rays;
    job->out->sight_differ += sight.differ;
    job->out->sight_asked += sight.asked;
    job->out->counters.decided += c.decided;
    pthread_mutex_unlock(&job->lock);
    sight_beside_free(&sight);
    caster_free(caster);
    free(b);
    return NULL;
}

static void tell(const struct sh_report *report, const struct job *job)
{
    uint64_t done = atomic_load(&job->next);
    char what[96];
    snprintf(what, sizeof what, "rays at edges and corners, %s", job->mesh->name);
    sh_progress(report, what, (double)(done < job->n ? done : job->n) / (double)job->n);
}

static int run_job(struct job *job, uint32_t threads, const struct sh_report *report, struct sh_err *err)
{
    pthread_t thread[MAX_THREADS];
    uint32_t begun = 0;
    int64_t told_ns = clock_now_ns();
    while (begun < threads && begun < MAX_THREADS && pthread_create(&thread[begun], NULL, job_main, job) == 0)
        begun++;
    while (begun != 0 && atomic_load(&job->next) < job->n) {
        int64_t now_ns = clock_now_ns();
        if (now_ns - told_ns >= 2000000000) {
            tell(report, job);
            told_ns = now_ns;
        }
        clock_sleep_until_ns(now_ns + 20000000);
    }
    for (uint32_t i = 0; i < begun; i++)
        pthread_join(thread[i], NULL);
    if (job->out->rays != job->n) return sh_fail(err, SH_ENOMEM, "bench: no memory or no thread for the rays");
    job->out->ns_per_ray = 1e9 * job->cpu_s / (double)job->n;
    return SH_OK;
}

/* The room is half as far as the nearest wall. Samples all around find that within a tenth. */
static int find_room(struct job *job, struct sh_err *err)
{
    struct caster *caster;
    struct batch *b = aligned_alloc(64, sizeof *b);
    double nearest_m = BENCH_RANGE_MAX_M;
    int rc = b != NULL ? caster_create(&caster, err) : sh_fail(err, SH_ENOMEM, "bench: no memory");
    for (uint32_t k = 0; k < BATCH && rc == SH_OK; k++) { /* a spiral that is even over the sphere */
        const double z = (2.0 * k + 1.0) / BATCH - 1.0, r = sqrt(1.0 - z * z), turn = 2.399963229728653 * k;
        b->dx[k] = r * cos(turn);
        b->dy[k] = r * sin(turn);
        b->dz[k] = z;
    }
    if (rc == SH_OK) {
        hits_from(caster, job->bvh, job->mesh->station_m, BENCH_RANGE_MAX_M, BATCH, b->dx, b->dy, b->dz, b->range_m,
                  b->prim);
        caster_free(caster);
    }
    for (uint32_t k = 0; k < BATCH && rc == SH_OK; k++)
        nearest_m = b->range_m[k] < nearest_m ? b->range_m[k] : nearest_m;
    job->room_m = 0.5 * nearest_m;
    free(b);
    return rc;
}

/* Casts the rays from the station with Embree alone. */
static int plain(struct job *job, struct sh_err *err)
{
    struct embree_alone e;
    struct batch *b = aligned_alloc(64, sizeof *b);
    int rc = bench_embree(job->mesh->scene, job->mesh->station_m, 1, &e, err);
    if (rc == SH_OK && b == NULL) rc = sh_fail(err, SH_ENOMEM, "bench: no memory");
    if (rc == SH_OK) rc = embree_alone_rays(&e, b->fx, b->fy, b->fz, BATCH, err);
    uint64_t want = job->n < PLAIN_RAYS ? job->n : PLAIN_RAYS;
    for (uint64_t first = 0; rc == SH_OK && first < 2 * want; first += 2 * BATCH) {
        for (uint32_t k = 0; k < BATCH; k++) {
            aim(job, first + k, b, k);
            b->fx[k] = (float)b->dx[k];
            b->fy[k] = (float)b->dy[k];
            b->fz[k] = (float)b->dz[k];
        }
        embree_alone_pass(&e, 16, EMBREE_LOADED, 0, BATCH);
        for (uint32_t k = 0; k < BATCH; k++)
            job->out->plain_leaks += judge(job->mesh, b, k, (double)e.t[k], e.prim[k], 1e-3) == 1;
        job->out->plain_rays += BATCH;
    }
    embree_alone_free(&e);
    free(b);
    return rc;
}

static int one_mesh(int which, uint64_t rays, uint64_t seed, uint32_t threads, const struct sh_report *report,
                    struct bench_leaks *out, struct sh_err *err)
{
    struct bench_mesh mesh;
    struct job job = {.mesh = &mesh, .n = rays, .key = rng_key(seed, RNG_SCENE) + 2 * (uint64_t)which, .out = out};
    pthread_mutex_init(&job.lock, NULL);
    int rc = bench_mesh_create(which, &mesh, err);
    if (rc == SH_OK) rc = bvh_create(mesh.scene, 0, report, &job.bvh, err);
    if (rc == SH_OK) rc = find_room(&job, err);
    if (rc == SH_OK) {
        out->mesh = mesh.name;
        out->triangles = mesh.scene->n_triangles;
        rc = plain(&job, err);
    }
    if (rc == SH_OK) {
        struct sight_spec spec = {.bvh = job.bvh, .rays = (double)rays, .memory_bytes = 64 << 20};
        memcpy(spec.station_m, mesh.station_m, sizeof spec.station_m);
        rc = sight_beside_create(&spec, &job.sight, err);
    }
    if (rc == SH_OK) rc = run_job(&job, threads, report, err);
    sight_beside_free(&job.sight);
    bvh_free(job.bvh);
    scene_free(mesh.scene);
    pthread_mutex_destroy(&job.lock);
    return rc;
}

int bench_leaks(uint64_t rays, uint64_t seed, uint32_t threads, const struct sh_report *report,
                struct bench_leaks out[BENCH_LEAK_MESHES], struct sh_err *err)
{
    memset(out, 0, BENCH_LEAK_MESHES * sizeof *out);
    for (int i = 0; i < BENCH_LEAK_MESHES; i++) {
        uint64_t share = rays / BENCH_LEAK_MESHES + (i == 0 ? rays % BENCH_LEAK_MESHES : 0);
        int rc = one_mesh(i, share, seed, threads, report, &out[i], err);
        if (rc != SH_OK) return rc;
    }
    return SH_OK;
}
