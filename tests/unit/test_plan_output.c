/* SPDX-License-Identifier: MIT */
/* `scanhead plan` prints the rows of the site's plan, as JSON and as text, member by member. The last row is measured
 * anew each time, so only its words are compared. */
#include "firmware_sim/app/app.h"
#include "tests/unit/device_rig.h"
#include "tests/unit/output_rig.h"

#include <math.h>

#include "firmware_sim/config/config.h"
#include "firmware_sim/config/load.h"
#include "firmware_sim/site/site.h"

static char config_file[96];
/* A beam, and coordinates in UTM, have several methods each, most of which the plan leaves out. The second station has
 * another scanner, which this plan does not cover. */
static const char *const SETS[] = {"beam.mode=auto", "output.crs=utm", "output.layout=geo",
                                   "scene.anchor={source: explicit, origin_m: [0, 0, 0], lat_deg: 52, lon_deg: 15, "
                                   "height_m: 40}",
                                   "stations[1].scanner={head: {profile: full-sweep, prr_hz: 20000, lines_hz: 100}}"};
enum { N_SETS = sizeof SETS / sizeof SETS[0] };

static char *print_plan(const char *option)
{
    char name[] = "plan", form[16], set[] = "--set", kept[N_SETS][160];
    char *argv[3 + 2 * N_SETS + 1] = {name, config_file};
    struct output output, messages;
    int argc = 2;
    for (int i = 0; i < N_SETS; i++) {
        snprintf(kept[i], sizeof kept[i], "%s", SETS[i]);
        argv[argc++] = set;
        argv[argc++] = kept[i];
    }
    snprintf(form, sizeof form, "%s", option != NULL ? option : "");
    if (option != NULL) argv[argc++] = form;
    output_take(&output, stdout);
    output_take(&messages, stderr);
    const int status = app_plan.run(argc, argv);
    char *said = output_give_said(&messages), *text = output_give(&output);
    if (strstr(said, "the plan of the scanner of station 1; others have other scanners: --set head.station=N\n") ==
        NULL)
        fail_msg("%s", said);
    free(said);
    assert_int_equal(status, APP_OK);
    return text;
}

static struct config *cfg;
static struct site *site; /* of this configuration, with its plan */

/* The next member after *at has this key; *at goes on to its value. */
static void go_to(const char **at, const char *key)
{
    char name[64];
    snprintf(name, sizeof name, "\"%s\": ", key);
    const char *next = strchr(*at, '"');
    if (next == NULL || strncmp(next, name, strlen(name)) != 0) fail_msg("no %s at: %.80s", key, *at);
    *at = next + strlen(name);
}

static void expect_text(const char **at, const char *key, const char *want)
{
    go_to(at, key);
    const size_t len = strlen(want);
    if (**at != '"' || strncmp(*at + 1, want, len) != 0 || (*at)[1 + len] != '"')
        fail_msg("%s: %.80s, not %s", key, *at, want);
    *at += len + 2;
}

/* NaN stands for what is not known. */
static void expect_number(const char **at, const char *key, double want, int is_measured)
{
    char *end;
    go_to(at, key);
    const double got = strncmp(*at, "null", 4) == 0 ? (double)NAN : strtod(*at, &end);
    if (!is_measured && got != want && !(isnan(got) && !isfinite(want))) fail_msg("%s: %g, not %g", key, got, want);
}

static void expect_row(const char **at, const struct plan_row *row, int is_measured)
{
    expect_text(at, "stage", row->stage);
    expect_text(at, "method", row->method);
    expect_number(at, "error_m", row->error_m, is_measured);
    expect_number(at, "echo_share", row->echo_share, is_measured);
    expect_number(at, "cost_ns", row->cost_ns, is_measured);
    go_to(at, "forced");
    assert_int_equal(strncmp(*at, row->forced ? "true" : "false", 4), 0);
    if (is_measured) return;
    expect_text(at, "why", row->why);
    go_to(at, "left_out");
    for (uint32_t k = 0; k < row->n_left; k++) {
        expect_text(at, "method", row->left[k].method);
        expect_number(at, "error_m", row->left[k].error_m, 0);
        expect_number(at, "echo_share", row->left[k].echo_share, 0);
        expect_number(at, "cost_ns", row->left[k].cost_ns, 0);
        expect_text(at, "why", row->left[k].why_not);
    }
}

static void the_json_has_each_figure(void **state)
{
    (void)state;
    char *text = print_plan("--json");
    const char *at = text;
    assert_true(site->plan.n > 2);
    for (size_t i = 0; i < site->plan.n; i++)
        expect_row(&at, &site->plan.row[i], i + 1 == site->plan.n);
    assert_null(strstr(at, "\"stage\"")); /* no further row */
    free(text);
}

/* Reads a line of the table: a method after the 8 columns of the stage, three figures, and a reason. A figure that is
 * not known is "-". */
static void expect_line(const char **at, const char *method, const double is[3], const char *why)
{
    const char *from = *at + 9, *end = strchr(*at, '\n');
    char figure[3][32], want[32];
    assert_non_null(end);
    if (strncmp(from, method, strlen(method)) != 0) fail_msg("no %s in %.200s", method, *at);
    assert_int_equal(sscanf(from + strlen(method), "%31s %31s %31s", figure[0], figure[1], figure[2]), 3);
    for (int k = 0; k < 3; k++) {
        snprintf(want, sizeof want, k < 2 ? "%.2g" : "%.3g", is[k]);
        assert_string_equal(figure[k], isfinite(is[k]) ? want : "-");
    }
    assert_true((size_t)(end - *at) >= strlen(why));
    if (strncmp(end - strlen(why), why, strlen(why)) != 0) fail_msg("no %s in %.*s", why, (int)(end - *at), *at);
    *at = end + 1;
}

/* Methods that were left out. Where some that follow each other have no measured error and one reason, the first of
 * them stands for all. */
static uint32_t expect_left(const char **at, const struct plan_option *left, uint32_t n)
{
    uint32_t more = 0;
    char method[64], why[512];
    while (more + 1 < n && isnan(left[0].error_m) && isnan(left[more + 1].error_m) &&
           strcmp(left[0].why_not, left[more + 1].why_not) == 0)
        more++;
    snprintf(method, sizeof method, "  not %s", left->method);
    snprintf(why, sizeof why, "  %s", left->why_not);
    if (more > 0) snprintf(why, sizeof why, "  %s; the same applies to %u more", left->why_not, more);
    expect_line(at, method, (const double[3]){left->error_m, left->echo_share, left->cost_ns}, why);
    return 1 + more;
}

static void the_text_has_each_row(void **state)
{
    (void)state;
    char *text = print_plan(NULL);
    assert_int_equal(strncmp(text, "stage ", 6), 0);
    const char *at = strchr(text, '\n') + 1;
    uint32_t n_left = 0;
    for (size_t i = 0; i + 1 < site->plan.n; i++) {
        const struct plan_row *row = &site->plan.row[i];
        char stage[32];
        assert_int_equal(sscanf(at, "%31s", stage), 1);
        assert_string_equal(stage, row->stage);
        expect_line(&at, row->method, (const double[3]){row->error_m, row->echo_share, row->cost_ns}, row->why);
        for (uint32_t k = 0; k < row->n_left;)
            k += expect_left(&at, &row->left[k], row->n_left - k);
        n_left += row->n_left;
    }
    if (n_left <= 3) fail_msg("%u left out", n_left);
    assert_int_equal(strncmp(at, "total ", 6), 0);
    free(text);
}

static int make_all(void **state)
{
    const int failed = make_folder(state);
    struct sh_err err;
    snprintf(config_file, sizeof config_file, "%s/run.yaml", folder);
    cfg = calloc(1, sizeof *cfg);
    assert_non_null(cfg);
    need(config_load(config_file, SETS, N_SETS, cfg, &err), &err);
    need(site_load_for(cfg, SITE_FOR_PLAN, NULL, NULL, &site, &err), &err);
    return failed;
}

static int remove_all(void **state)
{
    site_free(site);
    free(cfg);
    return remove_folder(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_json_has_each_figure),
        cmocka_unit_test(the_text_has_each_row),
    };
    return cmocka_run_group_tests_name("plan's output", tests, make_all, remove_all);
}
