/* SPDX-License-Identifier: MIT */
/* This measures a forest of copies: 10,000 of a tree of 100,000 triangles. It shows the memory, and the cost of a ray.
 * In turns with it come one tree by itself, the nearest copies alone, and these trees as triangles of their own.
 * Figures are processor time of the thread, medians of the rounds.
 *
 *   build/tests/bench/copies */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "core/bvh.h"
#include "core/scene_copies.h"
#include "tests/bench/bench.h"
#include "tests/bench/pin.h"

enum { LEAVES = 50000, SIDE = 100, ROUNDS = 15, LINES = 256, LINE = 512, RAYS = LINES * LINE };
enum { ALONE, FOREST, NEAR_COPIES, NEAR_TRIANGLES, SCENES };
static const char *const NAMES[SCENES] = {"one tree", "10,000 copies", "36 copies", "36 as triangles"};
static const double SPACING_M = 8.0, NEAR_M = 24.0, STEP_RAD = 0.0007;

static uint64_t seed = 1;

static double between(double lo, double hi)
{
    seed = seed * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return lo + (hi - lo) * (double)(seed >> 11) * 0x1p-53;
}

/* Writes a crown of leaves of 6 cm. Each leaf has two triangles and lies at random. */
static int write_tree(const char *path)
{
    FILE *f = fopen(path, "w");
    if (f == NULL) return 0;
    for (int i = 0; i < LEAVES; i++) {
        double c[3], a[3], b[3], r2;
        do {
            r2 = 0.0;
            for (int k = 0; k < 3; k++) {
                c[k] = between(-1, 1);
                r2 += c[k] * c[k];
            }
        } while (r2 > 1.0 || r2 < 0.3);
        for (int k = 0; k < 3; k++) {
            a[k] = between(-0.03, 0.03);
            b[k] = between(-0.03, 0.03);
        }
        for (int corner = 0; corner < 4; corner++) {
            const double s = corner == 0 || corner == 3 ? -1 : 1, t = corner < 2 ? -1 : 1;
            fprintf(f, "v %.5f %.5f %.5f\n", 3 * c[0] + s * a[0] + t * b[0], 3 * c[1] + s * a[1] + t * b[1],
                    7 + 3.5 * c[2] + s * a[2] + t * b[2]);
        }
        fprintf(f, "f -4 -3 -2 -1\n");
    }
    return fclose(f) == 0;
}

static size_t plant(struct scene_place *place, double within_m)
{
    size_t n = 0;
    seed = 2;
    for (int i = 0; i < SIDE * SIDE; i++) {
        const double x = SPACING_M * (i / SIDE - 0.5 * (SIDE - 1)), y = SPACING_M * (i % SIDE - 0.5 * (SIDE - 1));
        const struct scene_place here = {
            {x + between(-1, 1), y + between(-1, 1), 0}, between(0, 360), between(0.8, 1.2)};
        if (fmax(fabs(x), fabs(y)) <= within_m) place[n++] = here;
    }
    return n;
}

static int load(const char *path, int which, struct scene **scene, struct bvh **bvh, struct sh_err *err)
{
    static struct scene_place place[SIDE * SIDE];
    size_t n = plant(place, which == FOREST ? INFINITY : which == ALONE ? 0.5 * SPACING_M : NEAR_M);
    if (which == ALONE) n = 1;
    const struct scene_mesh_spec spec = {.file = path, .scale = 1, .places = {.place = place, .n = n, .says = path}};
    int rc = scene_load(&spec, 1, 1e-3, NULL, scene, err);
    if (rc == SH_OK && (which == ALONE || which == NEAR_TRIANGLES))
        rc = scene_write_out_copies(*scene, UINT32_MAX, NULL, err);
    return rc == SH_OK ? bvh_create(*scene, 0, NULL, bvh, err) : rc;
}

static double x[RAYS], y[RAYS], z[RAYS], range_m[RAYS];
static uint32_t triangle[RAYS];

/* Aims lines upward, from the middle to the crown of the tree that stands alone. */
static void aim(const double at_m[3])
{
    const double azimuth = atan2(at_m[0], at_m[1]), elevation = atan2(at_m[2], hypot(at_m[0], at_m[1]));
    for (int i = 0; i < RAYS; i++) {
        const double a = azimuth + STEP_RAD * (i / LINE - 0.5 * LINES),
                     e = elevation + STEP_RAD * (i % LINE - 0.5 * LINE);
        x[i] = sin(a) * cos(e);
        y[i] = cos(a) * cos(e);
        z[i] = sin(e);
    }
}

static double cast_ns(struct bvh_work *work, const struct bvh *bvh, double *hit)
{
    const struct bvh_rays rays = {.n = RAYS,
                                  .from.at_m = {0, 0, 1.6},
                                  .dir = {x, y, z},
                                  .range_max_m = 1000,
                                  .range_m = range_m,
                                  .triangle = triangle};
    const double start_s = bench_thread_s();
    bvh_hits(work, bvh, &rays);
    const double spent_s = bench_thread_s() - start_s;
    uint32_t n = 0;
    for (int i = 0; i < RAYS; i++)
        n += isnan(range_m[i]) ? 0 : 1;
    *hit = (double)n / RAYS;
    return 1e9 * spent_s / RAYS;
}

static void measure(struct bvh_work *work, struct bvh *const bvh[SCENES])
{
    static double ns[SCENES][ROUNDS], ratio[SCENES][ROUNDS];
    double hit[SCENES];
    for (int round = -1; round < ROUNDS; round++) /* the first round warms up */
        for (int k = 0; k < SCENES; k++) {
            const double now = cast_ns(work, bvh[k], &hit[k]);
            if (round < 0) continue;
            ns[k][round] = now;
            ratio[k][round] = now / ns[k == NEAR_COPIES ? FOREST : k == NEAR_TRIANGLES ? NEAR_COPIES : ALONE][round];
        }
    printf("%-16s %10s %8s %s\n", "", "ns a ray", "hits", "ratio");
    for (int k = 0; k < SCENES; k++)
        printf("%-16s %10.1f %7.0f%% %.2f of %s\n", NAMES[k], bench_median(ns[k], ROUNDS), 100.0 * hit[k],
               bench_median(ratio[k], ROUNDS),
               NAMES[k == NEAR_COPIES      ? FOREST
                     : k == NEAR_TRIANGLES ? NEAR_COPIES
                                           : ALONE]);
}

int main(void)
{
    char path[] = "/tmp/scanhead-tree-XXXXXX.obj";
    struct scene *scene[SCENES] = {NULL};
    struct bvh *bvh[SCENES] = {NULL};
    struct bvh_work *work = NULL;
    struct sh_err err = {.text = ""};
    struct rusage used;
    const int fd = mkstemps(path, 4);
    int rc =
        fd >= 0 && close(fd) == 0 && write_tree(path) ? SH_OK : sh_fail(&err, SH_EIO, "%s: can't be written", path);
    if (rc == SH_OK) rc = load(path, FOREST, &scene[FOREST], &bvh[FOREST], &err);
    getrusage(RUSAGE_SELF, &used);
    if (rc == SH_OK)
        printf("%u copies, %u triangles: %.0f MB at the peak\n", scene[FOREST]->n_copies, scene[FOREST]->n_all,
               (double)used.ru_maxrss * 1024e-6);
    for (int k = 0; k < SCENES && rc == SH_OK; k++)
        if (k != FOREST) rc = load(path, k, &scene[k], &bvh[k], &err);
    if (rc == SH_OK) rc = bvh_work_create(&work, &err);
    if (rc == SH_OK) {
        const struct scene *tree = scene[ALONE];
        double middle_m[3];
        for (int k = 0; k < 3; k++)
            middle_m[k] = 0.5 * (tree->min_m[k] + tree->max_m[k]) - (k == 2 ? 1.6 : 0.0);
        pin(NULL);
        aim(middle_m);
        measure(work, bvh);
    }
    if (rc != SH_OK) fprintf(stderr, "copies: %s\n", err.text);
    unlink(path);
    bvh_work_free(work);
    for (int k = 0; k < SCENES; k++) {
        bvh_free(bvh[k]);
        scene_free(scene[k]);
    }
    return rc == SH_OK ? 0 : 1;
}
