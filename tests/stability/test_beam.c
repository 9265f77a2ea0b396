/* SPDX-License-Identifier: MIT */
/* Thin bodies, where a beam of few sub-rays goes wrong. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/common/generate.h"
#include "tests/common/beam_reference.h"
#include "tests/common/made.h"
#include "tests/common/thorough.h"
#include "tests/stability/table.h"

#ifdef SH_SANITIZE
#define LINES 2u
#else
#define LINES ((uint32_t)thorough(3, 2))
#endif

static const double STATION_M[3] = {0.0, 0.0, 0.0};

/* Pulses with another number of echoes than 1,000 sub-rays give, in percent of the mixed pulses. */
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
    double percent[2];
    made_beam_rig(&rig, scene, view);
    wrong_counts(&rig, view, percent);
    table_row(regime, "37 sub-rays", percent[0], percent[1], 3.0, "%");
    beam_rig_close(&rig);
}

/* Wires across the view, one above the other. */
static void wires(double diameter_m, double range_m)
{
    char regime[64];
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
    snprintf(regime, sizeof regime, "wires of %g mm at %g m", 1e3 * diameter_m, range_m);
    row(regime, scene, &view);
}

/* A railing across the view, or turned away from it, so that its bars stand close behind each other. */
static void railing(const char *regime, double turned_rad)
{
    struct generate_bar bar[60];
    struct scene *scene;
    struct sh_err err;
    const struct beam_view view = {-1.5, 1.5, -0.6, 0.6, 8 * LINES, 40};
    for (int k = 0; k < 60; k++) {
        double along = -3.0 + 0.1 * k, x = along * cos(turned_rad), y = 25.0 + along * sin(turned_rad);
        bar[k] = (struct generate_bar){.a = {x, y, -1.0}, .b = {x, y, 1.0}, .diameter_m = 0.016, .label = 1};
    }
    if (generate_bars(bar, 60, 150.0, &scene, &err) != 0) fail_msg("%s", err.text);
    row(regime, scene, &view);
}

static void test_thin_things(void **state)
{
    (void)state;
    static const double range_m[] = {10.0, 20.0, 50.0, 100.0};
    for (int k = 0; k < 4; k++) {
        wires(0.003, range_m[k]);
        wires(0.010, range_m[k]);
    }
    railing("railing of 16 mm at 25 m", 0.0);
    railing("the same, seen at 80 deg", 80.0 * M_PI / 180.0);
    struct scene *scene;
    struct sh_err err;
    const struct generate_crown crown = {{0.0, 15.0, 0.0}, 3.0, 0.06, 20000};
    const struct beam_view leaves = {-10.0, 10.0, -8.0, 8.0, LINES, 300};
    if (generate_foliage(&crown, 1, 60.0, 1, &scene, &err) != 0) fail_msg("%s", err.text);
    row("foliage of 20,000 leaves", scene, &leaves);
    table_check();
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_thin_things)};
    table_head("Footprints on thin things: wrong echo counts among mixed pulses, against 1,000 sub-rays.");
    return cmocka_run_group_tests(tests, NULL, NULL);
}
