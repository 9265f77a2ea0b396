/* Pulses as single rays, as rings of sub-rays, and adaptive: cost, and error against 1,000 sub-rays.
 *
 *   build/tests/bench/beam [house|wires|foliage|leaves ...]
 *
 * ns: per pulse, the whole cast; median of interleaved rounds, processor time of the thread. ratio: by the single-ray
 * cast of the same rounds. count: pulses with another number of echoes than the reference, of all pulses, and of those
 * of several echoes or a partial hit. rms: of the echoes of pulses whose number agrees; off: how many of them are off
 * by more than the resolution (a different leaf, say: a few decide the rms of a tree), and the rms without those. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "core/generate.h"
#include "core/rng.h"
#include "tests/accuracy/beam_reference.h"

enum { ROUNDS = 15, MAX_METHODS = 8 };

struct method {
    const char *name;
    enum beam_mode mode;
    uint32_t rings;
};
static const struct method methods[] = {
    {"single", BEAM_SINGLE, 0}, {"adaptive", BEAM_ADAPTIVE, 4}, {"rings 0", BEAM_RINGS, 0}, {"rings 1", BEAM_RINGS, 1},
    {"rings 2", BEAM_RINGS, 2}, {"rings 3", BEAM_RINGS, 3},     {"rings 4", BEAM_RINGS, 4}, {"rings 6", BEAM_RINGS, 6}};
enum { N_METHODS = sizeof methods / sizeof methods[0] };

static double thread_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int by_value(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median(double *v, int n)
{
    qsort(v, (size_t)n, sizeof *v, by_value);
    return v[n / 2];
}

static void accuracy(struct beam_rig *rig, const struct beam_view *view, uint32_t sample, uint32_t n_methods,
                     struct beam_tally *tally)
{
    double *d = malloc(3 * view->pulses * sizeof *d);
    struct beam_ref *ref = malloc(view->pulses * sizeof *ref);
    for (uint32_t l = 0; l < view->lines; l += sample) {
        beam_rig_directions(rig, l, d, d + view->pulses, d + 2 * view->pulses);
        for (uint32_t i = 0; i < view->pulses; i++) {
            const double dir[3] = {d[i], d[view->pulses + i], d[2 * view->pulses + i]};
            beam_ref_pulse(rig->caster, rig->bvh, &rig->beam.beam, rig->setup.station_m, dir, rig->setup.range_max_m,
                           &ref[i]);
        }
        for (uint32_t m = 0; m < n_methods; m++) {
            uint32_t at = 0;
            beam_rig_mode(rig, methods[m].mode, methods[m].rings);
            beam_rig_line(rig, l);
            for (uint32_t i = 0; i < view->pulses; i++)
                beam_compare(&tally[m], &rig->block, &at, &ref[i]);
        }
    }
    free(d);
    free(ref);
}

static void measure(const char *name, struct scene *scene, const double station_m[3], const struct beam_view *view,
                    uint32_t sample)
{
    struct beam_rig rig;
    struct sh_err err;
    struct beam_outlines_info info;
    static double ns[MAX_METHODS][ROUNDS];
    struct beam_tally tally[MAX_METHODS] = {{0}};
    if (beam_rig_open(&rig, scene, station_m, view, &err) != 0) {
        fprintf(stderr, "%s\n", err.text);
        exit(1);
    }
    beam_outlines_get_info(rig.outlines, &info);
    printf("%s: %u triangles, %llu edges, %llu outlines, %llu stretches, %llu entries, %.1f MB\n", name,
           scene->n_triangles, (unsigned long long)info.edges, (unsigned long long)info.outlines,
           (unsigned long long)info.stretches, (unsigned long long)info.entries, 1e-6 * (double)info.bytes);
    uint32_t n = view->lines * view->pulses;
    for (int r = 0; r < ROUNDS; r++)
        for (uint32_t m = 0; m < N_METHODS; m++) {
            if (r >= 3 && methods[m].rings >= 2 && methods[m].mode == BEAM_RINGS) {
                ns[m][r] = ns[m][r - 3];
                continue;
            }
            beam_rig_mode(&rig, methods[m].mode, methods[m].rings);
            double start = thread_s();
            for (uint32_t l = 0; l < view->lines; l++)
                beam_rig_line(&rig, l);
            ns[m][r] = 1e9 * (thread_s() - start) / n;
        }
    struct cast_counters before, after;
    beam_rig_mode(&rig, BEAM_ADAPTIVE, 4);
    caster_get_counters(rig.caster, &before);
    for (uint32_t l = 0; l < view->lines; l++)
        beam_rig_line(&rig, l);
    caster_get_counters(rig.caster, &after);
    printf("  adaptive: %.4f %% cut, %.4f sub-rays a pulse, %.4f %% ragged\n",
           100.0 * (double)(after.outlined - before.outlined) / n, (double)(after.sub_rays - before.sub_rays) / n,
           100.0 * (double)(after.ragged - before.ragged) / n);
    if (sample > 0) accuracy(&rig, view, sample, N_METHODS, tally);
    for (uint32_t m = 0; m < N_METHODS; m++) {
        double ratio[ROUNDS];
        for (int r = 0; r < ROUNDS; r++)
            ratio[r] = ns[m][r] / ns[0][r];
        double by = median(ratio, ROUNDS);
        const struct beam_tally *t = &tally[m];
        printf("  %-9s %8.1f ns  ratio %6.2f", methods[m].name, median(ns[m], ROUNDS), by);
        if (sample > 0)
            printf("  count %.4f %% of all, %.2f %% of mixed  rms %.3f mm, %llu off, else %.3f mm",
                   100.0 * (double)t->wrong / (double)t->pulses, 100.0 * (double)t->wrong_mixed / (double)t->mixed,
                   1e3 * sqrt(t->range2 / (double)t->echoes), (unsigned long long)t->off,
                   1e3 * sqrt(t->near2 / (double)(t->echoes - t->off)));
        printf("\n");
    }
    if (sample > 0)
        printf("  (%llu pulses, %.3f %% mixed)\n", (unsigned long long)tally[0].pulses,
               100.0 * (double)tally[0].mixed / (double)tally[0].pulses);
    beam_rig_close(&rig);
}

static void house(void)
{
    static const double station_m[3] = {5.5, 2.2, 1.6};
    struct beam_view view = {-40.0, 60.0, 0.0, 360.0, 200, 2500};
    struct scene_mesh_spec spec = {
        .file = "/usr/share/assimp/models/IFC/AC14-FZK-Haus.ifc", .up = SCENE_UP_Y, .scale = 1.0};
    struct scene *scene;
    struct sh_err err;
    if (scene_load(&spec, 1, 1e-4, NULL, &scene, &err) != 0) {
        fprintf(stderr, "%s\n", err.text);
        return;
    }
    measure("house", scene, station_m, &view, 4);
}

/* Wires of 3 and 10 mm at 10 to 100 m, a little inclined, and a railing; label: its place in the list. */
static void wires(void)
{
    static const double station_m[3] = {0.0, 0.0, 0.0}, far_m[] = {10.0, 20.0, 50.0, 100.0};
    struct generate_bar bar[64];
    uint32_t n = 0;
    struct scene *scene;
    struct sh_err err;
    for (uint16_t k = 0; k < 8; k++) {
        double r = far_m[k / 2], z = r * tan((-16.0 + 4.0 * k) * M_PI / 180.0), half = 0.2 * r;
        bar[n++] = (struct generate_bar){.a = {-half, r, z - 0.03 * half},
                                         .b = {half, r, z + 0.04 * half},
                                         .diameter_m = k % 2 == 0 ? 0.003 : 0.010,
                                         .label = (uint16_t)(k + 1)};
    }
    for (uint16_t k = 0; k < 40; k++) /* a railing across the view, in 15 m */
        bar[n++] = (struct generate_bar){
            .a = {-2.0 + 0.1 * k, 15.0, 4.0}, .b = {-2.0 + 0.1 * k, 15.0, 5.0}, .diameter_m = 0.016, .label = 9};
    if (generate_bars(bar, n, 150.0, &scene, &err) != 0) exit(1);
    struct beam_view view = {-20.0, 20.0, -10.0, 10.0, 400, 1000};
    measure("wires", scene, station_m, &view, 20);
}

static void foliage(uint32_t n_leaves)
{
    static const double station_m[3] = {0.0, 0.0, 0.0};
    const struct generate_crown crown[3] = {{{-4.0, 14.0, 1.0}, 3.0, 0.06, n_leaves / 3},
                                            {{3.0, 18.0, 0.0}, 4.0, 0.06, n_leaves / 3},
                                            {{0.0, 30.0, 2.0}, 5.0, 0.06, n_leaves / 3}};
    struct scene *scene;
    struct sh_err err;
    if (generate_foliage(crown, 3, 60.0, 1, &scene, &err) != 0) exit(1);
    struct beam_view view = {-12.0, 16.0, -30.0, 30.0, 100, 1000};
    measure("foliage", scene, station_m, &view, 10);
}

int main(int argc, char **argv)
{
    for (int i = 1; i < argc; i++) {
        if (strcmp(argv[i], "house") == 0) house();
        if (strcmp(argv[i], "wires") == 0) wires();
        if (strcmp(argv[i], "foliage") == 0) foliage(60000);
        if (strcmp(argv[i], "leaves") == 0) foliage(3000000);
    }
    return 0;
}
