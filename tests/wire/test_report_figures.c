/* SPDX-License-Identifier: MIT */
/* Each key of `report --json`, beside what report_rig.c works out by itself. Keys are read in their order: none is left
 * out, and none comes that the test does not know. */
#include <math.h>

#include "tests/wire/report_rig.h"

enum { N_INCIDENCES = 9, MOST_BINS = 80 };

static const char BEYOND[] = "Not within the expected error: ";

static const char *next_key(const char **at, const char *key)
{
    char quoted[64];
    *at += strspn(*at, " \n,{}[]");
    snprintf(quoted, sizeof quoted, "\"%s\": ", key);
    if (strncmp(*at, quoted, strlen(quoted)) != 0) fail_msg("no %s at %.60s", key, *at);
    return *at += strlen(quoted);
}

/* The report keeps deviations as float, which rounds them by 6e-8 of themselves. Means of values of both signs may be
 * smaller than that, so 1e-7 of the longest deviation (5 mm, 2 sigma) is added. */
static void next_number(const char **at, const char *key, double value)
{
    const char *text = next_key(at, key);
    const double least = strstr(key, "sigmas") != NULL ? 2e-7 : 5e-10;
    char *end;
    if (!isfinite(value)) {
        if (strncmp(text, "null", 4) != 0) fail_msg("%s is not null: %.60s", key, text);
        *at += 4;
        return;
    }
    const double found = strtod(text, &end);
    if (end == text || fabs(found - value) > least + 1e-6 * fabs(value))
        fail_msg("%s is %.12g by hand, not %.60s", key, value, text);
    *at = end;
}

static void next_text(const char **at, const char *key, const char *value)
{
    char quoted[400];
    const char *text = next_key(at, key);
    snprintf(quoted, sizeof quoted, value != NULL ? "\"%s\"" : "null", value);
    if (strncmp(text, quoted, strlen(quoted)) != 0) fail_msg("%s is not %s: %.200s", key, quoted, text);
    *at += strlen(quoted);
}

static void next_figures(const char **at, const struct wanted *w)
{
    next_number(at, "points", w->points);
    next_number(at, "far", w->far);
    next_number(at, "mean_m", w->mean_m);
    next_number(at, "rms_m", w->rms_m);
    next_number(at, "p95_m", w->p95_m);
    next_number(at, "max_m", w->max_m);
    next_key(at, "along_beam");
    next_number(at, "points", w->near);
    next_number(at, "mean_m", w->along_mean_m);
    next_number(at, "rms_m", w->along_rms_m);
    next_number(at, "max_m", w->along_max_m);
    next_number(at, "judged", w->near);
    next_number(at, "judged_mean_m", w->along_mean_m);
    next_number(at, "judged_rms_m", w->along_rms_m);
    next_number(at, "expected_rms_m", w->near > 0.0 ? w->expected_rms_m : (double)NAN);
    next_number(at, "noisy", w->near);
    next_number(at, "mean_sigmas", w->z_mean);
    next_number(at, "rms_sigmas", w->z_rms);
    next_number(at, "counts_sigmas", w->z_counts);
}

static void next_density(const char **at, struct density d)
{
    next_key(at, "density");
    next_number(at, "cells", d.cells);
    next_number(at, "p5_m2", d.p5);
    next_number(at, "p50_m2", d.p50);
    next_number(at, "p95_m2", d.p95);
}

static void next_times(const char **at, struct times t)
{
    next_key(at, "time");
    next_number(at, "first_s", t.first_s);
    next_number(at, "last_s", t.last_s);
    next_number(at, "span_s", t.span_s);
    next_number(at, "points_s", t.n / t.span_s);
    next_number(at, "scans", t.scans);
    next_number(at, "gap_s", 2.0 / REPORT_LINES_HZ);
    next_number(at, "gaps", t.gaps);
    next_number(at, "longest_gap_s", t.longest_s);
}

/* Normal noise has no bound, so no point is beyond it. One far point is enough for the verdict "beyond". */
static void next_verdict(const char **at, const char *judgement, const char *text, double judged)
{
    next_key(at, "verdict");
    next_text(at, "judgement", judgement);
    next_text(at, "text", text);
    next_number(at, "judged", judged);
    next_number(at, "beyond", 0);
    next_number(at, "bound_m", INFINITY);
    next_number(at, "least_rms_sigmas", NAN);
    next_number(at, "most_rms_sigmas", NAN);
}

static void next_totals(const char **at, const struct made *all)
{
    const struct wanted w = report_want(all, BY_NOTHING, 0, 1);
    int beyond = 1, is_hit[4][2] = {{0}}, triangles = 0;
    for (int i = 0; i < N_NEAR; i++) {
        beyond += all[i].distance_m > REPORT_TOLERANCE_M;
        is_hit[all[i].wall][all[i].triangle] = 1;
    }
    for (int k = 0; k < 4; k++)
        triangles += is_hit[k][0] + is_hit[k][1];
    next_number(at, "points", w.points);
    next_number(at, "empty", 1);
    next_number(at, "ghosts", 0);
    next_number(at, "mean_m", w.mean_m);
    next_number(at, "rms_m", w.rms_m);
    next_number(at, "p50_m", w.p50_m);
    next_number(at, "p95_m", w.p95_m);
    next_number(at, "p999_m", w.p999_m);
    next_number(at, "max_m", w.max_m);
    next_number(at, "beyond", beyond);
    next_number(at, "far", 1);
    next_number(at, "tolerance_m", REPORT_TOLERANCE_M);
    next_number(at, "surfaces_hit", 4);
    next_number(at, "surfaces", 6);
    next_number(at, "triangles_hit", triangles);
    next_number(at, "triangles", 12);
}

static void next_worst(const char **at, const struct made *all)
{
    const struct made *far = &all[N_NEAR + 1];
    next_key(at, "worst");
    next_number(at, "point", N_NEAR + 2); /* counted from 1 */
    next_number(at, "x", far->p[0]);
    next_number(at, "y", far->p[1]);
    next_number(at, "z", far->p[2]);
    next_text(at, "object", "east");
    next_text(at, "material", "paint-east");
}

static void next_stations(const char **at, const struct made *all)
{
    static const char *const names[] = {"first", "second"}, *const judgement[] = {"beyond", "not judged"};
    next_key(at, "stations");
    for (int s = 0; s < N_STATIONS; s++) {
        const struct wanted w = report_want(all, BY_STATION, s, s + 1);
        char text[200];
        if (s == 0)
            snprintf(text, sizeof text, "%s1 of %g points are farther from everything than --max-m.", BEYOND, w.points);
        else
            snprintf(text, sizeof text,
                     "Not judged: only %g points on smooth faces have a known noise; 100 are needed.", w.points);
        next_number(at, "station", s + 1);
        next_text(at, "name", names[s]);
        next_figures(at, &w);
        next_density(at, report_density(all, s, 0.0, INFINITY));
        next_times(at, report_times(all, s));
        next_verdict(at, judgement[s], text, w.points);
    }
}

static void next_bins(const char **at, const struct made *all)
{
    int n;
    const double step_m = report_range_step(all, &n);
    next_key(at, "by_range");
    for (int k = 0; k < n; k++) {
        const struct wanted w = report_want(all, BY_RANGE, k * step_m, (k + 1) * step_m);
        next_number(at, "from_m", k * step_m);
        next_number(at, "to_m", (k + 1) * step_m);
        next_figures(at, &w);
        next_density(at, report_density(all, -1, k * step_m, (k + 1) * step_m));
    }
    next_key(at, "by_incidence");
    for (int k = 0; k < N_INCIDENCES; k++) {
        const struct wanted w = report_want(all, BY_INCIDENCE, 10 * k, 10 * (k + 1));
        next_number(at, "from_deg", 10 * k);
        next_number(at, "to_deg", 10 * (k + 1));
        next_figures(at, &w);
    }
}

static void next_surfaces(const char **at, const struct made *all)
{
    next_key(at, "by_surface");
    for (int w = 0; w <= 4; w++) {
        char material[32];
        const int label = w < 4 ? w : 0xffff;
        const struct wanted figures = report_want(all, BY_LABEL, label, label + 1);
        snprintf(material, sizeof material, "paint-%s", WALLS[w]);
        next_text(at, "object", w < 4 ? WALLS[w] : NULL);
        next_text(at, "material", w < 4 ? material : NULL);
        next_figures(at, &figures);
    }
}

/* All values of so few points are shown. Bins of one width begin at 0, or reach equally far to both sides. */
static void next_histogram(const char **at, const char *key, const struct made *all, int is_signed)
{
    uint64_t count[MOST_BINS] = {0};
    int bins = 0;
    next_key(at, key);
    const double from_m = strtod(next_key(at, "from_m"), (char **)at);
    const double width_m = strtod(next_key(at, "width_m"), (char **)at);
    next_number(at, "below", 0);
    next_number(at, "above", 0);
    assert_true(width_m > 0.0);
    for (int i = 0; i < N_NEAR; i++) {
        const double bin = floor(((is_signed ? all[i].along_m : all[i].distance_m) - from_m) / width_m);
        assert_true(bin >= 0 && bin < MOST_BINS);
        count[(int)bin]++;
    }
    next_key(at, "counts");
    for (*at = strchr(*at, '[') + 1; **at != ']'; bins++) {
        assert_true(bins < MOST_BINS);
        assert_int_equal(strtoull(*at, (char **)at, 10), count[bins]);
        *at += strspn(*at, ", \n");
    }
    assert_true(fabs(from_m + (is_signed ? 0.5 * bins * width_m : 0.0)) < 1e-9 * width_m);
}

static void each_key_is_right(void **state)
{
    struct wire *wire = *state;
    struct made all[N_POINTS];
    uint64_t shots[16] = {0};
    char text[200];
    report_make(all);
    report_write(wire, all);
    report_run(wire, (const char *const[]){"--json", NULL});
    char *json = wire_read(wire_path(wire, "out"), NULL);
    const char *at = json;
    const struct wanted w = report_want(all, BY_NOTHING, 0, 1);
    next_totals(&at, all);
    next_worst(&at, all);
    snprintf(text, sizeof text, "%sof 2 stations, 0 are within the expected error, 1 are not, 1 can't be judged.",
             BEYOND);
    next_verdict(&at, "beyond", text, w.points);
    next_key(&at, "all");
    next_figures(&at, &w);
    next_density(&at, report_density(all, -1, 0.0, INFINITY));
    next_number(&at, "density_cell_m", 1.0);
    next_stations(&at, all);
    next_bins(&at, all);
    next_surfaces(&at, all);
    next_histogram(&at, "distances", all, 0);
    next_histogram(&at, "along_beam", all, 1);
    for (int i = 0; i < N_POINTS; i++)
        shots[all[i].echo_count < 15 ? all[i].echo_count : 15] += all[i].echo <= 1;
    next_key(&at, "shots_by_echoes");
    for (int k = 0; k < 16; k++) {
        at += strspn(at, "[, \n");
        assert_int_equal(strtoull(at, (char **)&at, 10), shots[k]);
    }
    assert_int_equal(at[strspn(at, " \n}]")], '\0');
    free(json);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test_setup_teardown(each_key_is_right, wire_setup, wire_teardown)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
