/* scanhead plan: which method each stage will use. It loads the scene, as a run does, and asks what the run asks. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/plan.h"
#include "firmware_sim/app/app.h"
#include "firmware_sim/base/json.h"
#include "firmware_sim/site/plan_rows.h"

static const char HELP[] =
    "scanhead plan CONFIG [options]: the method each stage will use, its error bound, its cost, why, and what was left "
    "out\n\n"
    "  --json           an array of {stage, method, error_m, echo_share, cost_ns, forced, why, left_out}, left_out an\n"
    "                   array of {method, error_m, echo_share, cost_ns, why}; null: not known, or hangs on the scene\n"
    "  --set KEY=VALUE  another value of a configuration key\n\n"
    "Of each stage the cheapest method is used whose bounds hold plan.tolerance_m (root mean square of the ranges) "
    "and\n"
    "plan.echo_tolerance (share of the pulses with another number of echoes), unless beam.mode, "
    "optics.depth,\n"
    "scene.order_exactly or output.georef force one. Beam and optics are tried on some thousands of the head's own "
    "pulses\n"
    "in the scene, always the same ones, against 1,027 sub-rays, or the deepest way; bounds are upper limits of what "
    "was\n"
    "found, from up to four of the stations, for the settings at power-up. Each stage may use the whole tolerance; they are not added up. georef is planned for "
    "each\n"
    "station, from output.crs, output.tolerance_m, the scene's extent and the head's range_max_m; one row for all "
    "where\n"
    "they get the same method, else one each. A stage with the method none is left out: nothing in the configuration "
    "asks\n"
    "for it. Costs count beyond a single ray: rounded figures of `make chart` and `make "
    "bench-beam` on\n"
    "one core with AVX2, to compare methods by; what hangs on the scene is measured by `make bench`.\n";

enum { OPT_JSON = 256 };
static const struct option OPTIONS[] = {{"set", required_argument, NULL, 's'},
                                        {"json", no_argument, NULL, OPT_JSON},
                                        {"help", no_argument, NULL, 'h'},
                                        {NULL, 0, NULL, 0}};

static void put_option(struct json *json, const struct plan_option *option)
{
    json_open_object(json, NULL);
    json_string(json, "method", option->method);
    json_double(json, "error_m", option->error_m);
    json_double(json, "echo_share", option->echo_share);
    json_double(json, "cost_ns", option->cost_ns);
    json_string(json, "why", option->why_not);
    json_close_object(json);
}

static int print_json(const struct site_plan *plan, struct sh_err *err)
{
    struct json json;
    json_begin(&json, stdout);
    json_open_array(&json, NULL);
    for (size_t i = 0; i < plan->n; i++) {
        const struct plan_row *row = &plan->row[i];
        json_open_object(&json, NULL);
        json_string(&json, "stage", row->stage);
        json_string(&json, "method", row->method);
        json_double(&json, "error_m", row->error_m);
        json_double(&json, "echo_share", row->echo_share);
        json_double(&json, "cost_ns", row->cost_ns);
        json_bool(&json, "forced", row->forced);
        json_string(&json, "why", row->why);
        json_open_array(&json, "left_out");
        for (uint32_t k = 0; k < row->n_left; k++)
            put_option(&json, &row->left[k]);
        json_close_array(&json);
        json_close_object(&json);
    }
    json_close_array(&json);
    return json_end(&json, err);
}

static void print_line(const char *stage, const char *method, const double figure[3], const char *why)
{
    static const char *const format[] = {"%.2g", "%.2g", "%.3g"};
    char shown[3][16];
    for (int i = 0; i < 3; i++) {
        snprintf(shown[i], sizeof shown[i], "-");
        if (isfinite(figure[i])) snprintf(shown[i], sizeof shown[i], format[i], figure[i]);
    }
    printf("%-8s %-22s %8s %8s %6s  %s\n", stage, method, shown[0], shown[1], shown[2], why);
}

/* Not measured, for the same reason: told once. */
static int is_like(const struct plan_option *a, const struct plan_option *b)
{
    return isnan(a->error_m) && isnan(b->error_m) && strcmp(a->why_not, b->why_not) == 0;
}

static void print_left(const struct plan_option *left, uint32_t more)
{
    const double figure[3] = {left->error_m, left->echo_share, left->cost_ns};
    char method[40], why[sizeof left->why_not + 32];
    snprintf(method, sizeof method, "  not %s", left->method);
    snprintf(why, sizeof why, "%s", left->why_not);
    if (more != 0) snprintf(why, sizeof why, "%s; the same goes for %u more", left->why_not, more);
    print_line("", method, figure, why);
}

static int print_text(const struct site_plan *plan)
{
    printf("%-8s %-22s %8s %8s %6s  %s\n", "stage", "method", "error m", "echoes", "ns", "why");
    for (size_t i = 0; i < plan->n; i++) {
        const struct plan_row *row = &plan->row[i];
        const double figure[3] = {row->error_m, row->echo_share, row->cost_ns};
        print_line(row->stage, row->method, figure, row->why);
        for (uint32_t k = 0, end; k < row->n_left; k = end) {
            for (end = k + 1; end < row->n_left && is_like(&row->left[k], &row->left[end]);)
                end++;
            print_left(&row->left[k], end - k - 1);
        }
    }
    return SH_OK;
}

static int plan_config(const struct app_sets *sets, const char *path, int as_json)
{
    int status = APP_OK;
    struct sh_err err = {0};
    struct site *site = NULL;
    struct config *cfg = app_load_config(path, sets, &status);
    if (cfg == NULL) return status;
    cfg->beam.measures = 1;
    int rc = site_load(cfg, &app_report_stderr, &site, &err);
    if (rc == SH_OK) rc = site_plan_rows(site, &app_report_stderr, &err);
    if (rc == SH_OK) rc = as_json ? print_json(&site->plan, &err) : print_text(&site->plan);
    site_free(site);
    free(cfg);
    return rc == SH_OK ? APP_OK : app_fail(&err);
}

int app_plan(int argc, char **argv)
{
    struct app_sets sets;
    memset(&sets, 0, sizeof sets);
    int opt, as_json = 0;
    opterr = 0;
    while ((opt = getopt_long(argc, argv, ":h", OPTIONS, NULL)) != -1) {
        int status = APP_OK;
        if (opt == 'h') {
            fputs(HELP, stdout);
            return APP_OK;
        }
        if (opt == OPT_JSON)
            as_json = 1;
        else
            status = opt == 's' ? app_add_set(&sets, optarg) : app_bad_option("plan", opt, argv);
        if (status != APP_OK) return status;
    }
    if (optind != argc - 1) return app_usage("plan", "one CONFIG is needed");
    return plan_config(&sets, argv[optind], as_json);
}
