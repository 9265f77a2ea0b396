/* SPDX-License-Identifier: MIT */
/* The size of a count of the stream, by the head's longest range. Run from the top of the source tree. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "firmware_sim/config/config.h"
#include "firmware_sim/config/load.h"
#include "firmware_sim/site/site.h"

static char dir[64], warned[512];
static struct config *cfg;
static struct sh_err err;

static void keep_warning(void *ctx, const char *text)
{
    (void)ctx;
    snprintf(warned, sizeof warned, "%s", text);
}
static const struct sh_report report = {.warn = keep_warning};

static FILE *open_in(const char *name, const char *mode)
{
    char path[128];
    snprintf(path, sizeof path, "%s/%s", dir, name);
    FILE *f = fopen(path, mode);
    assert_non_null(f);
    return f;
}

/* Writes the profile of full-sweep with another range. */
static void write_profile(double range_max_m)
{
    char line[512];
    FILE *from = fopen("config/heads/full-sweep.yaml", "r"), *to = open_in("head.yaml", "w");
    assert_non_null(from);
    while (fgets(line, sizeof line, from) != NULL)
        if (strncmp(line, "range_max_m:", 12) == 0)
            fprintf(to, "range_max_m: { value: %.3f, from: assumed }\n", range_max_m);
        else
            fputs(line, to);
    fclose(from);
    assert_int_equal(fclose(to), 0);
}

/* Returns metres per count; 0: refused. */
static double scale_of(double range_max_m, const char *output, const char *noise, double range_scale_ppm)
{
    char path[128];
    struct site *site = NULL;
    write_profile(range_max_m);
    FILE *f = open_in("test.yaml", "w");
    fprintf(f,
            "head: {profile: head.yaml}\nscene:\n  meshes: [{file: floor.obj, up: z, scale: 1}]\n"
            "stations: [{position_m: [0, 0, 1.7]}]\noutput: {%s}\nnoise: {%s}\n",
            output, noise);
    if (range_scale_ppm != 0) fprintf(f, "instrument: {range_scale_ppm: %g}\n", range_scale_ppm);
    assert_int_equal(fclose(f), 0);
    snprintf(path, sizeof path, "%s/test.yaml", dir);
    warned[0] = err.text[0] = '\0';
    int rc = config_load(path, NULL, 0, cfg, &err);
    if (rc == SH_OK) rc = site_load(cfg, &report, &site, &err);
    const double scale_m = rc == SH_OK ? site->scale_m : 0.0;
    if (rc != SH_OK) assert_int_equal(rc, SH_EINPUT);
    site_free(site);
    return scale_m;
}

static void test_counts(void **state)
{
    (void)state;
    static const struct {
        double range_max_m;
        const char *output, *noise;
        double scale_m;
        const char *warning; /* NULL: none */
    } cases[] = {
        {1000, "layout: polar", "range: off", 1e-6, NULL},
        {2126, "layout: polar", "range: off", 1e-6, NULL},
        {2147, "layout: polar", "range: off", 1e-6, NULL}, /* 31 bits end at 2147.48 m */
        {2147.4, "layout: polar", "range: on", 1e-6, NULL},
        {4294.9, "layout: polar", "range: off", 1e-6, NULL}, /* 32 bits at 4294.967 m, and a range has no sign */
        {4294.95, "layout: polar", "range: on", 1e-5, "ranges up to 429"}, /* ten sigma more do not fit */
        {4300, "layout: polar", "range: off", 1e-5,
         "4300 m must fit into 32 bits, but at 1e-06 m only those up to 4295 m"},
        {1000, "layout: polar", "ball: {radius_m: 100, distance_1_m: 0.05}", 1e-5, "ranges up to 6100 m"},
        /* The polar scale has no end: ranges of 1e10 m need more than a metre a count, since 32 bits end at 4.29e9. */
        {1000, "layout: polar", "ball: {radius_m: 100, distance_1_m: 100, factor: [1000, 1, 1]}", 10, "ranges up to 1"},
        /* Errors of the instrument's readings count: 1.5 m more or less, or 0.1 % of it, each alone. */
        {4294, "layout: polar", "range: off}\ninstrument: {range_offset_m: 1.5", 1e-5, "ranges up to 4295.5 m"},
        {4294, "layout: polar", "range: off}\ninstrument: {range_offset_m: -1.5", 1e-5, "ranges up to 4295.5 m"},
        {4294, "layout: polar", "range: off}\ninstrument: {range_scale_ppm: 1000", 1e-5, "ranges up to 4298.29 m"},
        {4294, "layout: polar", "range: off}\ninstrument: {range_scale_ppm: 100", 1e-6, NULL},
        {2147.4, "layout: geo", "range: off", 1e-6, NULL},
        {2147.4, "layout: geo", "range: off}\ninstrument: {range_scale_ppm: -1000", 1e-5,
         "coordinates up to 2149.55 m"},
        {2147.6, "layout: geo", "range: off", 1e-5, "coordinates up to 2147.6 m must fit into 31 bits"},
        {3000, "layout: polar, scale_m: 1e-3", "range: off", 1e-3, NULL}, /* as asked for */
        {5000, "layout: polar, scale_m: 1e-6", "range: off", 0, NULL},    /* by the configuration alone */
        {4294.9, "layout: polar, scale_m: 1e-6", "ball: {radius_m: 100}", 0, NULL},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const double scale_m = scale_of(cases[i].range_max_m, cases[i].output, cases[i].noise, 0);
        if (!(scale_m >= 0.999 * cases[i].scale_m && scale_m <= 1.001 * cases[i].scale_m))
            fail_msg("%g m, %s: %g m instead of %g; %s", cases[i].range_max_m, cases[i].output, scale_m,
                     cases[i].scale_m, err.text);
        if (cases[i].warning == NULL ? strstr(warned, "count") != NULL : strstr(warned, cases[i].warning) == NULL)
            fail_msg("%g m, %s: \"%s\"", cases[i].range_max_m, cases[i].output, warned);
    }
    assert_non_null(strstr(err.text, "output.scale_m: 1e-06: ranges up to 4394.9 m do not fit into 32 bits"));
    assert_non_null(strstr(err.text, "from 1.03e-06 m on")); /* 4394.9 m / (2^32 - 1) is 1.0233e-6 */
    assert_true(scale_of(4294.9, "layout: polar, scale_m: 1.03e-6", "ball: {radius_m: 100}", 0) > 0);
}

/* The instrument reads ranges 100 ppm longer: 0.2 m of 2147.4 m, 0.4 m of 4294.9 m. Nothing else is set. */
static void test_range_scale(void **state)
{
    (void)state;
    const double geo = scale_of(2147.4, "layout: geo", "range: off", 100);
    assert_true(geo >= 0.999e-5 && geo <= 1.001e-5);
    assert_non_null(strstr(warned, "coordinates up to 2147.6"));
    const double polar = scale_of(4294.9, "layout: polar", "range: off", 100);
    assert_true(polar >= 0.999e-5 && polar <= 1.001e-5);
    assert_non_null(strstr(warned, "ranges up to 4295.3"));
}

static int set_up(void **state)
{
    (void)state;
    snprintf(dir, sizeof dir, "/tmp/test_site_scale.XXXXXX");
    cfg = calloc(1, sizeof *cfg);
    if (cfg == NULL || mkdtemp(dir) == NULL) return -1;
    FILE *f = open_in("floor.obj", "w");
    fputs("v -9 -9 0\nv 9 -9 0\nv 9 9 0\nv -9 9 0\nf 1 2 3 4\n", f);
    return fclose(f);
}

static int tear_down(void **state)
{
    static const char *const names[] = {"floor.obj", "head.yaml", "test.yaml"};
    char path[128];
    (void)state;
    for (int i = 0; i < 3; i++) {
        snprintf(path, sizeof path, "%s/%s", dir, names[i]);
        unlink(path);
    }
    free(cfg);
    return rmdir(dir);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_counts), cmocka_unit_test(test_range_scale)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
