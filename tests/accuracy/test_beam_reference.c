/* SPDX-License-Identifier: MIT */
/* The beam against 1,000 sub-rays a pulse. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "tests/common/generate.h"
#include "tests/common/beam_reference.h"
#include "tests/common/made.h"
#include "tests/common/thorough.h"

/* SH_SANITIZE: sanitizers are for the code, not for the count. */
#ifdef SH_SANITIZE
#define SHARE 20u
#else
#define SHARE ((uint32_t)thorough(1, 5))
#endif

/* Bars that 1,000 sub-rays are needed for, where a footprint can reach one. */
struct bars {
    struct generate_bar at[64];
    uint32_t n;
};

/* Returns whether the footprint can reach the bar: the distance of its axis's line from the ray. For long bars across
 * the view that is the distance of the bar. */
static int may_reach(const struct beam *beam, const struct generate_bar *bar, const double dir[3])
{
    double axis[3], n[3], length = 0.0, off = 0.0,
                          range_m = 1.02 * sqrt(bar->a[1] * bar->a[1] + bar->b[0] * bar->b[0] + bar->b[2] * bar->b[2]);
    for (int i = 0; i < 3; i++)
        axis[i] = bar->b[i] - bar->a[i];
    for (int i = 0; i < 3; i++)
        n[i] = dir[(i + 1) % 3] * axis[(i + 2) % 3] - dir[(i + 2) % 3] * axis[(i + 1) % 3];
    for (int i = 0; i < 3; i++) {
        length += n[i] * n[i];
        off += n[i] * bar->a[i];
    }
    return fabs(off) / sqrt(length) < 1.1 * beam_radius(beam, range_m) + bar->diameter_m;
}

static int may_reach_some(const struct beam *beam, const struct bars *bars, const double dir[3])
{
    int near = 0;
    for (uint32_t k = 0; k < bars->n; k++)
        near |= may_reach(beam, &bars->at[k], dir);
    return near;
}

/* Compares adaptive pulses, and rings of 61 sub-rays, with the reference on every `step`th line of the view. The
 * reference of a pulse that reaches no bar has 128 sub-rays if these see only one smooth surface, else 1,000. With bars
 * NULL all have 1,000. */
static void against_reference(struct beam_rig *rig, const struct beam_view *view, uint32_t step,
                              const struct bars *bars, struct beam_tally *adaptive, struct beam_tally *rings)
{
    double *d = malloc(3 * view->pulses * sizeof *d);
    struct beam_ref *ref = malloc(view->pulses * sizeof *ref);
    for (uint32_t l = 0; l < view->lines; l += step) {
        beam_rig_directions(rig, l, d, d + view->pulses, d + 2 * view->pulses);
        for (uint32_t i = 0; i < view->pulses; i++) {
            const double dir[3] = {d[i], d[view->pulses + i], d[2 * view->pulses + i]};
            int all = bars == NULL || may_reach_some(&rig->beam.beam, bars, dir);
            if (all || !beam_ref_plain(rig, dir, &ref[i]))
                beam_ref_pulse(rig->caster, rig->bvh, &rig->beam.beam, rig->setup.station_m, dir,
                               rig->setup.range_max_m, &ref[i]);
        }
        for (int method = 0; method < 2; method++) {
            beam_rig_mode(rig, method == 0 ? BEAM_ADAPTIVE : BEAM_RINGS, 4);
            beam_rig_line(rig, l);
            for (uint32_t i = 0, at = 0; i < view->pulses; i++)
                beam_compare(method == 0 ? adaptive : rings, &rig->block, &at, &ref[i]);
        }
    }
    free(d);
    free(ref);
}

static void print_tally(const char *name, const struct beam_tally *t)
{
    printf("# %s: other echo counts in %.4f %% of all pulses, %.2f %% of the %.2f %% with several or a part; ranges "
           "%.3f mm rms\n",
           name, 100.0 * (double)t->wrong / (double)t->pulses, 100.0 * (double)t->wrong / (double)t->mixed,
           100.0 * (double)t->mixed / (double)t->pulses, 1e3 * sqrt(t->range2 / (double)t->echoes));
}

static void test_house(void **state)
{
    (void)state;
    static const char file[] = "/usr/share/assimp/models/IFC/AC14-FZK-Haus.ifc";
    static const double station_m[3] = {5.5, 2.2, 1.6};
    if (access(file, R_OK) != 0) {
        printf("# %s is not there: package assimp-testmodels\n", file);
        skip();
    }
    const struct beam_view view = {-40.0, 60.0, 0.0, 360.0, 200, 2500};
    struct scene_mesh_spec spec = {.file = file, .up = SCENE_UP_Y, .scale = 1.0};
    const struct bars none = {.n = 0};
    struct beam_tally adaptive = {0}, rings = {0};
    struct scene *scene;
    struct beam_rig rig;
    struct sh_err err;
    if (scene_load(&spec, 1, 1e-4, NULL, &scene, &err) != 0 || beam_rig_open(&rig, scene, station_m, &view, &err) != 0)
        fail_msg("%s", err.text);
    against_reference(&rig, &view, 5 * SHARE, &none, &adaptive, &rings);
    print_tally("house, adaptive", &adaptive);
    print_tally("house, 61 sub-rays", &rings);
    assert_true((double)adaptive.wrong <= 1e-4 * (double)adaptive.pulses);
    assert_true((double)adaptive.wrong <= 0.03 * (double)adaptive.mixed);
    assert_true(adaptive.range2 <= 1e-6 * (double)adaptive.echoes);
    beam_rig_close(&rig);
}

/* ---- wires */

enum { WIRES = 8 };

/* Wires of 3 and 10 mm at 10 to 100 m, one above the other, a little inclined; and a railing at 15 m. */
static uint32_t make_wires(struct generate_bar *bar)
{
    static const double far_m[] = {10.0, 20.0, 50.0, 100.0};
    uint32_t n = 0;
    for (uint16_t k = 0; k < WIRES; k++) {
        double r = far_m[k / 2], z = r * tan((-7.0 + 2.0 * k) * M_PI / 180.0), half = 0.2 * r;
        bar[n++] = (struct generate_bar){.a = {-half, r, z - 0.03 * half},
                                         .b = {half, r, z + 0.04 * half},
                                         .diameter_m = k % 2 == 0 ? 0.003 : 0.010,
                                         .label = (uint16_t)(k + 1)};
    }
    for (uint16_t k = 0; k < 40; k++)
        bar[n++] = (struct generate_bar){.a = {-2.0 + 0.1 * k, 15.0, 2.6},
                                         .b = {-2.0 + 0.1 * k, 15.0, 3.6},
                                         .diameter_m = 0.016,
                                         .label = WIRES + 1};
    return n;
}

static void count_labels(const struct line_block *b, uint32_t at, uint64_t *seen)
{
    uint32_t n = b->echo[at] >> 4;
    for (uint32_t k = 0; k < n; k++)
        if (b->label[at + k] >= 1 && b->label[at + k] <= WIRES) seen[b->label[at + k] - 1]++;
}

/* The number of pulses that see each wire is the reference's within 2 %. In two pulses of 100, at the wire's edge, the
 * wire's energy is within a quarter of the threshold. There 1,000 sub-rays themselves are wrong by a tenth. */
static void test_wires_are_seen(void **state)
{
    (void)state;
    struct generate_bar bar[64];
    uint32_t n = make_wires(bar);
    uint64_t seen[WIRES] = {0}, want[WIRES] = {0}, single[WIRES] = {0};
    const struct beam_view view = {-8.0, 8.0, -6.0, 6.0, 97, 5000};
    struct scene *scene;
    struct beam_rig rig;
    struct sh_err err;
    if (generate_bars(bar, n, 150.0, &scene, &err) != 0) fail_msg("%s", err.text);
    made_beam_rig(&rig, scene, &view);
    double *d = malloc(3 * view.pulses * sizeof *d);
    for (uint32_t l = 0; l < view.lines; l += SHARE) {
        beam_rig_directions(&rig, l, d, d + view.pulses, d + 2 * view.pulses);
        beam_rig_mode(&rig, BEAM_SINGLE, 0);
        beam_rig_line(&rig, l);
        for (uint32_t i = 0; i < view.pulses; i++)
            count_labels(&rig.block, i, single);
        beam_rig_mode(&rig, BEAM_ADAPTIVE, 4);
        beam_rig_line(&rig, l);
        for (uint32_t i = 0, at = 0; i < view.pulses; i++) {
            const double dir[3] = {d[i], d[view.pulses + i], d[2 * view.pulses + i]};
            int near = 0;
            count_labels(&rig.block, at, seen);
            at += rig.block.echo[at] >> 4 > 1 ? rig.block.echo[at] >> 4 : 1;
            for (uint32_t w = 0; w < WIRES; w++)
                near |= may_reach(&rig.beam.beam, &bar[w], dir);
            if (!near) continue;
            struct beam_ref ref;
            beam_ref_pulse(rig.caster, rig.bvh, &rig.beam.beam, rig.setup.station_m, dir, rig.setup.range_max_m, &ref);
            for (uint32_t k = 0; k < ref.n; k++)
                if (ref.echo[k].label >= 1 && ref.echo[k].label <= WIRES) want[ref.echo[k].label - 1]++;
        }
    }
    for (uint32_t w = 0; w < WIRES; w++) {
        printf("# wire of %2.0f mm at %3.0f m: seen by %llu pulses, the reference's %llu; by single rays %llu\n",
               1e3 * bar[w].diameter_m, bar[w].a[1], (unsigned long long)seen[w], (unsigned long long)want[w],
               (unsigned long long)single[w]);
        assert_true(SHARE > 1 || want[w] >= 300);
        assert_true(fabs((double)seen[w] - (double)want[w]) <= 0.02 * (double)want[w] + (SHARE > 1 ? 2.0 : 0.0));
        assert_true(single[w] < want[w]);
    }
    free(d);
    beam_rig_close(&rig);
}

/* The error is at most a third of that of rings, which cost more than twenty times as much. */
static void test_wires_against_rings(void **state)
{
    (void)state;
    struct bars bars;
    bars.n = make_wires(bars.at);
    const struct beam_view view = {-8.0, 16.0, -8.0, 8.0, 20, 1000};
    struct beam_tally adaptive = {0}, rings = {0};
    struct scene *scene;
    struct beam_rig rig;
    struct sh_err err;
    struct cast_counters before, after;
    if (generate_bars(bars.at, bars.n, 150.0, &scene, &err) != 0) fail_msg("%s", err.text);
    made_beam_rig(&rig, scene, &view);
    against_reference(&rig, &view, SHARE, &bars, &adaptive, &rings);
    print_tally("wires, adaptive", &adaptive);
    print_tally("wires, 61 sub-rays", &rings);
    assert_true(SHARE > 1 || rings.wrong >= 30);
    assert_true(3 * adaptive.wrong <= rings.wrong);
    caster_get_counters(rig.caster, &before);
    beam_rig_mode(&rig, BEAM_ADAPTIVE, 4);
    beam_rig_line(&rig, 7);
    caster_get_counters(rig.caster, &after);
    assert_true(after.sub_rays - before.sub_rays < 2 * view.pulses);
    beam_rig_close(&rig);
}

static void test_foliage(void **state)
{
    (void)state;
    const struct generate_crown crown[2] = {{{-4.0, 14.0, 1.0}, 3.0, 0.06, 20000},
                                            {{3.0, 18.0, 0.0}, 4.0, 0.06, 20000}};
    const struct beam_view view = {-12.0, 16.0, -30.0, 25.0, 10, 1000};
    struct beam_tally adaptive = {0}, rings = {0};
    struct cast_counters before, after;
    struct scene *scene;
    struct beam_rig rig;
    struct sh_err err;
    if (generate_foliage(crown, 2, 60.0, 1, &scene, &err) != 0) fail_msg("%s", err.text);
    made_beam_rig(&rig, scene, &view);
    caster_get_counters(rig.caster, &before);
    beam_rig_mode(&rig, BEAM_ADAPTIVE, 4);
    for (uint32_t l = 0; l < view.lines; l++)
        beam_rig_line(&rig, l);
    caster_get_counters(rig.caster, &after);
    against_reference(&rig, &view, SHARE, NULL, &adaptive, &rings);
    print_tally("foliage, adaptive", &adaptive);
    print_tally("foliage, 61 sub-rays", &rings);
    printf("# foliage, adaptive: %.2f sub-rays a pulse\n",
           (double)(after.sub_rays - before.sub_rays) / (view.lines * view.pulses));
    assert_true(adaptive.wrong <= rings.wrong);
    assert_true(after.sub_rays - before.sub_rays < 20 * view.lines * view.pulses);
    beam_rig_close(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_wires_are_seen),
        cmocka_unit_test(test_wires_against_rings),
        cmocka_unit_test(test_foliage),
        cmocka_unit_test(test_house),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
