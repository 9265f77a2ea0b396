/* SPDX-License-Identifier: MIT */
/* This measures pulses as single rays, as rings of sub-rays, and adaptive ones: their cost, and their error against
 * 1,000 sub-rays.
 *
 *   build/tests/bench/beam [--chart|--speed] [house|wires|foliage|leaves ...]
 *
 * ns is the cost of a pulse for the whole cast, the median of interleaved rounds in processor time of the thread. ratio
 * is that time over the single-ray cast's of the same rounds, without sight. seen means with a sight (core/sight.h).
 * count is the share of pulses whose number of echoes differs from the reference: of all pulses, and of those with
 * several echoes or a partial hit. rms, p99.9 and max are the range errors of the pulses whose number agrees. off is
 * how many of their echoes are off by more than the resolution, as on another leaf. The rms without those follows,
 * because a few decide the rms of a tree. --chart prints rows of the chart's table, without the methods with a sight.
 * --speed measures single and adaptive pulses alone, and only their ns and ratios. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/rng.h"
#include "firmware_sim/config/keys.h"
#include "firmware_sim/config/table/row.h"
#include "tests/bench/bench.h"
#include "tests/bench/pin.h"
#include "tests/common/beam_reference.h"
#include "tests/common/generate.h"

enum { ROUNDS = 15, FEW_ROUNDS = 3, MAX_METHODS = 10, LINES = 200 };

static int as_chart, only_speed;

struct method {
    const char *name;
    enum beam_mode mode;
    uint32_t rings;
    int seen;
};
static const struct method methods[] = {{"single", BEAM_SINGLE, 0, 0},      {"adaptive", BEAM_ADAPTIVE, 4, 0},
                                        {"single seen", BEAM_SINGLE, 0, 1}, {"adaptive seen", BEAM_ADAPTIVE, 4, 1},
                                        {"rings 1", BEAM_RINGS, 0, 0},      {"rings 7", BEAM_RINGS, 1, 0},
                                        {"rings 19", BEAM_RINGS, 2, 0},     {"rings 37", BEAM_RINGS, 3, 0},
                                        {"rings 61", BEAM_RINGS, 4, 0},     {"rings 127", BEAM_RINGS, 6, 0}};
enum { N_METHODS = sizeof methods / sizeof methods[0] };
_Static_assert((int)N_METHODS <= (int)MAX_METHODS, "room");

/* Says whether this method is measured. */
static int is_asked(const struct method *m)
{
    return !(as_chart && m->seen) && !(only_speed && m->mode == BEAM_RINGS);
}

struct result {
    double ns[ROUNDS], ratio[ROUNDS];
    struct beam_tally tally;
    uint64_t n_off, capacity;
    double *off_m; /* [n_off] */
    /* These are set in the end: */
    double ns_median, ratio_median, rms_m, p999_m, max_m, wrong_part;
    int front;
};

static void *must(void *memory)
{
    if (memory != NULL) return memory;
    fprintf(stderr, "beam: no memory\n");
    exit(1);
}

static void compare(struct result *t, const struct line_block *b, uint32_t *at, const struct beam_ref *ref)
{
    uint32_t first = *at;
    beam_compare(&t->tally, b, at, ref);
    for (uint32_t k = 0; t->n_off < t->tally.echoes; k++) {
        if (t->n_off == t->capacity) {
            t->capacity = 2 * t->capacity + 1024;
            t->off_m = must(realloc(t->off_m, t->capacity * sizeof *t->off_m));
        }
        t->off_m[t->n_off++] = fabs(1e-6 * b->a[first + k] - ref->echo[k].range_m);
    }
}

static void set_method(struct beam_rig *rig, const struct sight *sight, const struct method *m)
{
    beam_rig_mode(rig, m->mode, m->rings);
    rig->setup.sight = m->seen ? sight : NULL;
}

/* Compares every sample-th line. */
static void accuracy(struct beam_rig *rig, const struct sight *sight, const struct beam_view *view, uint32_t sample,
                     struct result *result)
{
    double *d = must(malloc(3 * view->pulses * sizeof *d));
    struct beam_ref *ref = must(malloc(view->pulses * sizeof *ref));
    for (uint32_t l = 0; l < view->lines; l += sample) {
        beam_rig_directions(rig, l, d, d + view->pulses, d + 2 * view->pulses);
        for (uint32_t i = 0; i < view->pulses; i++) {
            const double dir[3] = {d[i], d[view->pulses + i], d[2 * view->pulses + i]};
            beam_ref_pulse(rig->caster, rig->bvh, &rig->beam.beam, rig->setup.station_m, dir, rig->setup.range_max_m,
                           &ref[i]);
        }
        for (uint32_t m = 0; m < N_METHODS; m++) {
            uint32_t at = 0;
            if (!is_asked(&methods[m])) continue;
            set_method(rig, sight, &methods[m]);
            beam_rig_line(rig, l);
            for (uint32_t i = 0; i < view->pulses; i++)
                compare(&result[m], &rig->block, &at, &ref[i]);
        }
    }
    free(d);
    free(ref);
}

/* The view's lines are as far apart as the pulses on a line. Only a few lines are cast, in groups of neighbours all
 * over the view. The cache then holds for a line what the line before it has read, as in a whole scan. */
enum { NEIGHBOURS = 20 };
static uint32_t line_of(const struct beam_view *view, uint32_t i)
{
    const uint32_t groups = (LINES + NEIGHBOURS - 1) / NEIGHBOURS;
    return i / NEIGHBOURS * (view->lines / groups) + i % NEIGHBOURS;
}

static double pass_ns(struct beam_rig *rig, const struct beam_view *view, uint32_t step)
{
    uint32_t lines = 0;
    double start_s = bench_thread_s();
    for (uint32_t i = 0; i < LINES; i += step, lines++)
        beam_rig_line(rig, line_of(view, i));
    return 1e9 * (bench_thread_s() - start_s) / ((double)lines * view->pulses);
}

/* Measures each method in turn. Many sub-rays get fewer rounds and only each fourth line. */
static void speed(struct beam_rig *rig, const struct sight *sight, const struct beam_view *view, struct result *result)
{
    for (int r = 0; r < ROUNDS; r++)
        for (uint32_t m = 0; m < N_METHODS; m++) {
            int slow = methods[m].mode == BEAM_RINGS && methods[m].rings >= 2;
            if (!is_asked(&methods[m])) continue;
            set_method(rig, sight, &methods[m]);
            result[m].ns[r] = slow && r >= FEW_ROUNDS ? result[m].ns[r - FEW_ROUNDS] : pass_ns(rig, view, slow ? 4 : 1);
            result[m].ratio[r] = result[m].ns[r] / result[0].ns[r];
        }
}

static void sum_up(struct result *r)
{
    const struct beam_tally *t = &r->tally;
    r->ns_median = bench_median(r->ns, ROUNDS);
    r->ratio_median = bench_median(r->ratio, ROUNDS);
    if (only_speed) return;
    bench_sort(r->off_m, r->n_off);
    r->rms_m = sqrt(t->range2 / (double)t->echoes);
    r->p999_m = r->off_m[(uint64_t)ceil(0.999 * (double)r->n_off) - 1];
    r->max_m = r->off_m[r->n_off - 1];
    r->wrong_part = (double)t->wrong / (double)t->mixed;
}

/* A method is on the front unless another one is at least as fast and, in both figures, at least as exact, and better
 * in one. */
static void mark_front(struct result *result)
{
    for (uint32_t i = 0; i < N_METHODS; i++) {
        struct result *a = &result[i];
        a->front = is_asked(&methods[i]);
        for (uint32_t k = 0; k < N_METHODS; k++) {
            const struct result *b = &result[k];
            int no_worse = b->ns_median <= a->ns_median && b->rms_m <= a->rms_m && b->wrong_part <= a->wrong_part;
            int better = b->ns_median < a->ns_median || b->rms_m < a->rms_m || b->wrong_part < a->wrong_part;
            if (no_worse && better && is_asked(&methods[k])) a->front = 0;
        }
    }
}

static void print_rows(const char *scene, const struct result *result)
{
    const char *by_default = cfg_find(&cfg_config_table, "beam.mode")->def;
    if (strcmp(by_default, "auto") == 0) by_default = "adaptive"; /* auto means adaptive for a head that stands still */
    for (uint32_t m = 0; m < N_METHODS; m++) {
        const struct result *r = &result[m];
        if (!is_asked(&methods[m]) || (methods[m].mode == BEAM_RINGS && methods[m].rings == 0)) continue;
        printf("beam,%s,%s,%.3f,%.3g,%.3g,%d,%d,%.3g,%.3g\n", methods[m].name, scene, r->ns_median, r->p999_m, r->max_m,
               r->front, strcmp(methods[m].name, by_default) == 0, r->rms_m, r->wrong_part);
    }
}

static void print_table(const struct result *result)
{
    for (uint32_t m = 0; m < N_METHODS; m++) {
        const struct result *r = &result[m];
        const struct beam_tally *t = &r->tally;
        if (!is_asked(&methods[m])) continue;
        printf("  %-13s %8.1f ns  ratio %6.2f", methods[m].name, r->ns_median, r->ratio_median);
        if (only_speed)
            printf("\n");
        else
            printf("  count %.4f %% of all, %.2f %% of mixed  rms %.3f mm, p99.9 %.3f mm, "
                   "%llu off, else rms %.3f mm\n",
                   100.0 * (double)t->wrong / (double)t->pulses, 100.0 * (double)t->wrong_mixed / (double)t->mixed,
                   1e3 * r->rms_m, 1e3 * r->p999_m, (unsigned long long)t->off,
                   1e3 * sqrt(t->near2 / (double)(t->echoes - t->off)));
    }
    if (only_speed) return;
    printf("  (%llu pulses, %.3f %% mixed)\n", (unsigned long long)result[0].tally.pulses,
           100.0 * (double)result[0].tally.mixed / (double)result[0].tally.pulses);
}

static void print_scene(const char *name, struct beam_rig *rig, const struct beam_view *view)
{
    struct cast_counters before, after;
    uint32_t n = LINES * view->pulses;
    printf("%s: %u triangles\n", name, rig->scene->n_triangles);
    beam_rig_mode(rig, BEAM_ADAPTIVE, 4);
    caster_get_counters(rig->caster, &before);
    for (uint32_t i = 0; i < LINES; i++)
        beam_rig_line(rig, line_of(view, i));
    caster_get_counters(rig->caster, &after);
    printf("  adaptive: %.4f %% cut, %.4f sub-rays a pulse, %.4f %% ragged\n",
           100.0 * (double)(after.outlined - before.outlined) / n, (double)(after.sub_rays - before.sub_rays) / n,
           100.0 * (double)(after.ragged - before.ragged) / n);
}

static struct sight *make_sight(const struct beam_rig *rig, const struct beam_view *view)
{
    const double step = (view->line_stop_deg - view->line_start_deg) * M_PI / 180.0 / view->pulses;
    struct sight_spec spec = {.bvh = rig->bvh, .rays = 4.0 * M_PI / (step * step), .memory_bytes = UINT64_C(64) << 20};
    struct sight *sight;
    struct sight_info info;
    struct sh_err err;
    memcpy(spec.station_m, rig->setup.station_m, sizeof spec.station_m);
    if (sight_create(&spec, 1, NULL, &sight, &err) != 0) {
        fprintf(stderr, "%s\n", err.text);
        exit(1);
    }
    info = *sight_get_info(sight);
    if (!as_chart)
        printf("  sight: %u cells, one %.4f, nothing %.4f, few %.4f, ask %.4f; built in %.1f ms\n", info.cells,
               info.one, info.nothing, info.few, info.ask, 1e3 * info.build_s);
    return sight;
}

static void measure(const char *name, struct scene *scene, const double station_m[3], const struct beam_view *view,
                    uint32_t sample)
{
    static struct result result[MAX_METHODS];
    struct beam_rig rig;
    struct sh_err err;
    memset(result, 0, sizeof result);
    if (as_chart) fprintf(stderr, "chart: beam, %s\n", name);
    if (beam_rig_open(&rig, scene, station_m, view, &err) != 0) {
        fprintf(stderr, "%s\n", err.text);
        exit(1);
    }
    if (!as_chart) print_scene(name, &rig, view);
    struct sight *sight = as_chart ? NULL : make_sight(&rig, view);
    speed(&rig, sight, view, result);
    if (!only_speed) accuracy(&rig, sight, view, sample, result);
    for (uint32_t m = 0; m < N_METHODS; m++)
        if (is_asked(&methods[m])) sum_up(&result[m]);
    mark_front(result);
    if (as_chart)
        print_rows(name, result);
    else
        print_table(result);
    for (uint32_t m = 0; m < N_METHODS; m++)
        free(result[m].off_m);
    sight_free(sight);
    beam_rig_close(&rig);
}

static void house(void)
{
    static const double station_m[3] = {5.5, 2.2, 1.6};
    struct beam_view view = {-40.0, 60.0, 0.0, 360.0, 9000, 2500};
    struct scene_mesh_spec spec = {
        .file = "/usr/share/assimp/models/IFC/AC14-FZK-Haus.ifc", .up = SCENE_UP_Y, .scale = 1.0};
    struct scene *scene;
    struct sh_err err;
    if (scene_load(&spec, 1, 1e-4, NULL, &scene, &err) != 0) {
        fprintf(stderr, "%s\n", err.text);
        return;
    }
    measure("house", scene, station_m, &view, 180);
}

/* Wires of 3 and 10 mm lie at 10 to 100 m, a little inclined, with a railing. The label is a wire's place in the
 * list. */
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
    for (uint16_t k = 0; k < 40; k++) /* a railing across the view, at 15 m */
        bar[n++] = (struct generate_bar){
            .a = {-2.0 + 0.1 * k, 15.0, 4.0}, .b = {-2.0 + 0.1 * k, 15.0, 5.0}, .diameter_m = 0.016, .label = 9};
    if (generate_bars(bar, n, 150.0, &scene, &err) != 0) exit(1);
    struct beam_view view = {-20.0, 20.0, -10.0, 10.0, 500, 1000};
    measure("wires", scene, station_m, &view, 25);
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
    struct beam_view view = {-12.0, 16.0, -30.0, 30.0, 2150, 1000};
    measure("foliage", scene, station_m, &view, 215);
}

int main(int argc, char **argv)
{
    pin(NULL);
    for (int i = 1; i < argc; i++) {
        as_chart |= strcmp(argv[i], "--chart") == 0;
        only_speed |= strcmp(argv[i], "--speed") == 0;
        if (strcmp(argv[i], "house") == 0) house();
        if (strcmp(argv[i], "wires") == 0) wires();
        if (strcmp(argv[i], "foliage") == 0) foliage(60000);
        if (strcmp(argv[i], "leaves") == 0) foliage(3000000);
    }
    return fflush(stdout) == 0 ? 0 : 1;
}
