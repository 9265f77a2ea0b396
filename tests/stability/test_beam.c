/* Footprints where a beam of few sub-rays goes wrong: thin things, and steps smaller than the pulse. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/generate.h"
#include "tests/accuracy/beam_reference.h"
#include "tests/stability/table.h"

#ifdef SH_SANITIZE
enum { LINES = 2 };
#else
enum { LINES = 12 };
#endif

static const double STATION_M[3] = {0.0, 0.0, 0.0};

/* Pulses of all that have another number of echoes than 1,000 sub-rays give, in percent of those that are mixed. */
static void wrong_counts(struct beam_rig *rig, const struct beam_view *view, double percent[2])
{
    double *d = malloc(3 * view->pulses * sizeof *d);
    struct beam_ref *ref = malloc(view->pulses * sizeof *ref);
    uint64_t wrong[2] = {0, 0}, mixed = 0;
    for (uint32_t l = 0; l < view->lines; l++) {
        beam_rig_directions(rig, l, d, d + view->pulses, d + 2 * view->pulses);
        for (uint32_t i = 0; i < view->pulses; i++) {
            const double dir[3] = {d[i], d[view->pulses + i], d[2 * view->pulses + i]};
            beam_ref_pulse(rig->caster, rig->bvh, &rig->beam.beam, STATION_M, dir, rig->setup.range_max_m, &ref[i]);
            mixed += ref[i].n > 1 || ref[i].partial;
        }
        for (int method = 0; method < 2; method++) {
            beam_rig_mode(rig, method == 0 ? BEAM_RINGS : BEAM_ADAPTIVE, 3);
            beam_rig_line(rig, l);
            for (uint32_t i = 0, at = 0; i < view->pulses; i++) {
                uint32_t n = rig->block.echo[at] >> 4;
                wrong[method] += n != ref[i].n;
                at += n == 0 ? 1 : n;
            }
        }
    }
    for (int method = 0; method < 2; method++)
        percent[method] = 100.0 * (double)wrong[method] / (double)mixed;
    free(d);
    free(ref);
}

static void row(const char *regime, struct scene *scene, const struct beam_view *view)
{
    struct beam_rig rig;
    struct sh_err err;
    double percent[2];
    if (beam_rig_open(&rig, scene, STATION_M, view, &err) != 0) fail_msg("%s", err.text);
    wrong_counts(&rig, view, percent);
    table_row(regime, "37 sub-rays", percent[0], percent[1], 3.0, "%");
    beam_rig_close(&rig);
}

/* Wires across the view, one above the other. */
static void wires(const char *regime, double range_m, double diameter_m)
{
    struct generate_bar bar[8];
    struct scene *scene;
    struct sh_err err;
    for (int k = 0; k < 8; k++) {
        double z = range_m * (0.01 * k - 0.035), half = 0.2 * range_m;
        bar[k] = (struct generate_bar){.a = {-half, range_m, z - 0.002 * half},
                                       .b = {half, range_m, z + 0.003 * half},
                                       .diameter_m = diameter_m,
                                       .label = 1};
    }
    const struct beam_view view = {-2.1, 2.1, -6.0, 6.0, LINES, 600};
    if (generate_bars(bar, 8, 150.0, &scene, &err) != 0) fail_msg("%s", err.text);
    row(regime, scene, &view);
}

static void test_thin_things(void **state)
{
    (void)state;
    wires("wires of 3 mm at 10 m", 10.0, 0.003);
    wires("wires of 3 mm at 50 m", 50.0, 0.003);
    wires("wires of 10 mm at 100 m", 100.0, 0.010);
    struct generate_bar bar[60];
    struct scene *scene;
    struct sh_err err;
    for (int k = 0; k < 60; k++)
        bar[k] = (struct generate_bar){
            .a = {-3.0 + 0.1 * k, 25.0, -1.0}, .b = {-3.0 + 0.1 * k, 25.0, 1.0}, .diameter_m = 0.016, .label = 1};
    const struct beam_view railing = {-1.5, 1.5, -0.6, 0.6, 8 * LINES, 40};
    if (generate_bars(bar, 60, 150.0, &scene, &err) != 0) fail_msg("%s", err.text);
    row("railing of 16 mm at 25 m", scene, &railing);
    const struct generate_crown crown = {{0.0, 15.0, 0.0}, 3.0, 0.06, 20000};
    const struct beam_view leaves = {-10.0, 10.0, -8.0, 8.0, LINES, 300};
    if (generate_foliage(&crown, 1, 60.0, 1, &scene, &err) != 0) fail_msg("%s", err.text);
    row("foliage of 20,000 leaves", scene, &leaves);
    table_check();
}

/* A door edge: the left half of the view at 20 m, the rest deeper by step_m. */
static struct scene *door(double step_m)
{
    double vertex[8][3];
    static const uint32_t triangle[4][3] = {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}};
    struct scene *scene;
    struct sh_err err;
    for (int v = 0; v < 8; v++) {
        int back = v / 4, right = v % 4 == 1 || v % 4 == 2;
        vertex[v][0] = right ? (back ? 5.0 : 0.0) : -5.0;
        vertex[v][1] = 20.0 + back * step_m;
        vertex[v][2] = v % 4 >= 2 ? 5.0 : -5.0;
    }
    if (scene_from_arrays((const double(*)[3])vertex, 8, triangle, 4, NULL, NULL, 0, &scene, &err) != 0)
        fail_msg("%s", err.text);
    return scene;
}

/* Steps below the resolution: one echo between the two. Error against 1,000 sub-rays, as a part of the step; those
 * 1,000 are a part in 100 off themselves where the edge runs along one of their rows. */
static void test_door_edge(void **state)
{
    (void)state;
    static const double step_m[] = {0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 0.59};
    const struct beam_view view = {0.0, 0.01, -0.03, 0.03, 4 * LINES, 8};
    double d[3][8];
    for (size_t k = 0; k < sizeof step_m / sizeof step_m[0]; k++) {
        struct beam_rig rig;
        struct sh_err err;
        double worst[2] = {0.0, 0.0};
        char regime[40];
        if (beam_rig_open(&rig, door(step_m[k]), STATION_M, &view, &err) != 0) fail_msg("%s", err.text);
        for (uint32_t l = 0; l < view.lines; l++) {
            beam_rig_directions(&rig, l, d[0], d[1], d[2]);
            for (int method = 0; method < 2; method++) {
                beam_rig_mode(&rig, method == 0 ? BEAM_SINGLE : BEAM_ADAPTIVE, 3);
                beam_rig_line(&rig, l);
                assert_int_equal(rig.block.n_points, view.pulses);
                for (uint32_t i = 0; i < view.pulses; i++) {
                    const double dir[3] = {d[0][i], d[1][i], d[2][i]};
                    struct beam_ref ref;
                    beam_ref_pulse(rig.caster, rig.bvh, &rig.beam.beam, STATION_M, dir, rig.setup.range_max_m, &ref);
                    assert_int_equal(ref.n, 1);
                    worst[method] = fmax(worst[method], fabs(1e-6 * rig.block.a[i] - ref.echo[0].range_m) / step_m[k]);
                }
            }
        }
        snprintf(regime, sizeof regime, "door edge, a step of %g m", step_m[k]);
        table_row(regime, "single ray", worst[0], worst[1], 0.01, "of the step");
        beam_rig_close(&rig);
    }
    table_check();
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_thin_things), cmocka_unit_test(test_door_edge)};
    table_head("Footprints: wrong echo counts among mixed pulses, and mixed ranges, against 1,000 sub-rays.");
    return cmocka_run_group_tests(tests, NULL, NULL);
}
