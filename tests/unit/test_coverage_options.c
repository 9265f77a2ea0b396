/* SPDX-License-Identifier: MIT */
/* The options of `coverage` for the next station reach the search, with their defaults. This test replaces the search,
 * whose failure ends the command. */
#include "tests/unit/commands_rig.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "firmware_sim/app/studio/coverage/next.h"

extern const struct app_command app_coverage;

static struct coverage_next_options got;
static char candidates[64]; /* a copy: the option's text ends with the command */
static int n_opened;

int coverage_next_open(const struct coverage_next_options *options, const struct coverage_result *result,
                       const struct sh_report *report, struct coverage_next *next, struct coverage_finder *finder,
                       struct sh_err *err)
{
    assert_true(result->site->n_stations == 2 && result->base == 1 && result->cell_m == 0.5);
    assert_true(report->stop != NULL && next != NULL && finder != NULL);
    got = *options;
    snprintf(candidates, sizeof candidates, "%s", options->candidates != NULL ? options->candidates : "");
    n_opened++;
    return sh_fail(err, SH_EINPUT, "no places");
}

static int go_there(void **state)
{
    (void)state;
    if (commands_begin() != 0) return -1;
    write_text("r.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    write_text("c.yaml", "head: {profile: sphere, step_deg: 10, station: 2}\nscene: {meshes: [{file: r.obj, up: z, "
                         "scale: 1}]}\nstations: [{position_m: [0, 0, 1]}, {position_m: [1, 0, 1]}]\noutput: {crs: "
                         "local}\ncoverage: {cell_m: 0.5}\n");
    write_text("p.csv", "x_m,y_m,z_m\n1,2,3\n");
    return 0;
}

static void ask(const char *words)
{
    char text[256];
    snprintf(text, sizeof text, "c.yaml --quiet %s", words);
    n_opened = 0;
    does(&app_coverage, text, 2);
    assert_string_equal(on_err, "scanhead: no places\n");
    assert_int_equal(n_opened, 1);
}

static void defaults(void **state)
{
    (void)state;
    ask("--grid 0.25");
    assert_true(got.stations == 1 && got.grid_m == 0.25 && got.height_m == 1.6 && got.step_deg == 1 && got.scans == 3);
    assert_true(got.step_given == 0 && got.candidates == NULL);
    for (int i = 0; i < 3; i++)
        assert_true(isnan(got.area_m[0][i]) && isnan(got.area_m[1][i]));
    ask("--candidates p.csv");
    assert_true(got.stations == 1 && got.grid_m == 0 && strcmp(candidates, "p.csv") == 0);
}

static void all_options(void **state)
{
    (void)state;
    ask("--grid 0.25 --next 4 --height 0 --at 1,2,3,4 --step-deg 0.2 --scans 20");
    assert_true(got.stations == 4 && got.height_m == 0 && got.step_deg == 0.2 && got.scans == 20 &&
                got.step_given == 1);
    assert_true(got.area_m[0][0] == 1 && got.area_m[0][1] == 2 && got.area_m[1][0] == 3 && got.area_m[1][1] == 4);
    assert_true(isnan(got.area_m[0][2]) && isnan(got.area_m[1][2]));
    ask("--candidates p.csv --scans 1 --step-deg 30");
    assert_true(got.scans == 1 && got.step_deg == 30);
    does(&app_coverage, "c.yaml --quiet", 0); /* nothing is looked for */
    assert_int_equal(n_opened, 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(defaults), cmocka_unit_test(all_options)};
    return cmocka_run_group_tests(tests, go_there, commands_end);
}
