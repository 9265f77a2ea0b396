/* SPDX-License-Identifier: MIT */
/* scanhead plan: which method each stage will use. The command loads the scene as a run does and prints what the run
 * uses. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/plan.h"
#include "firmware_sim/app/app.h"
#include "firmware_sim/base/json.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/site/site.h"

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

static void put_rows(struct json *json, const void *ctx)
{
    const struct site_plan *plan = ctx;
    json_open_array(json, NULL);
    for (size_t i = 0; i < plan->n; i++) {
        const struct plan_row *row = &plan->row[i];
        json_open_object(json, NULL);
        json_string(json, "stage", row->stage);
        json_string(json, "method", row->method);
        json_double(json, "error_m", row->error_m);
        json_double(json, "echo_share", row->echo_share);
        json_double(json, "cost_ns", row->cost_ns);
        json_bool(json, "forced", row->forced);
        json_string(json, "why", row->why);
        json_open_array(json, "left_out");
        for (uint32_t k = 0; k < row->n_left; k++)
            put_option(json, &row->left[k]);
        json_close_array(json);
        json_close_object(json);
    }
    json_close_array(json);
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

/* Returns whether both methods were left out for the same reason, and have no measured error. They share one line. */
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
    if (more != 0) snprintf(why, sizeof why, "%s; the same applies to %u more", left->why_not, more);
    print_line("", method, figure, why);
}

static void print_text(const struct site_plan *plan)
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
}

struct plan_options {
    int json;
    struct app_input in;
};

static int plan(struct config *cfg, void *ctx, struct sh_err *err)
{
    const struct plan_options *o = ctx;
    struct site *site = NULL;
    if (!config_is_alone(cfg))
        app_say("the plan of the scanner of station %u; others have other scanners: --set head.station=N",
                cfg->head.settings.station);
    int rc = site_load_for(cfg, SITE_FOR_PLAN, NULL, &app_report_stderr, &site, err);
    if (rc == SH_OK && o->json) rc = app_write_json("-", put_rows, &site->plan, err);
    if (rc == SH_OK && !o->json) print_text(&site->plan);
    site_free(site);
    return rc;
}

static int plan_run(int argc, char **argv)
{
    struct plan_options o = {0};
    int status = app_parse(&app_plan, argc, argv, &o.in, &o);
    return status == APP_GO_ON ? app_with_config(&o.in, plan, &o) : status;
}

/* clang-format off */
static const struct app_option OPTIONS[] = {
    {APP_FLAG, "json", NULL, .at = offsetof(struct plan_options, json),
     .help = "an array of {stage, method, error_m, echo_share, cost_ns, forced, why, left_out}, where left_out is an "
             "array of {method, error_m, echo_share, cost_ns, why}; null: not known, or it depends on the scene"},
    OPTION_SET,
    OPTION_END
};
/* clang-format on */

static const char NOTES[] =
    "For each stage the cheapest method is used whose error keeps the bounds. The bounds are plan.tolerance_m (RMS\n"
    "of the ranges) and plan.echo_tolerance (share of the pulses with another number of echoes). beam.mode,\n"
    "optics.depth, cast.sight and output.georef force a method.\n"
    "\n"
    "Beam and optics are tried on some thousands of the head's own pulses in the scene, always the same ones. A\n"
    "beam is compared with 1,027 sub-rays, a depth of optics with the largest depth. The bounds are upper limits of\n"
    "the errors found, from up to four of the stations, for the settings at power-up. Each stage may use the whole\n"
    "tolerance: their errors are not added up.\n"
    "\n"
    "sight is a visibility map of the station, made where it saves more time than it takes. A scan without end\n"
    "(head.frames: 0) counts as an hour. The map changes no hit. Its cost is negative: the time to make it minus\n"
    "the time that it saves, per pulse.\n"
    "\n"
    "Where stations have scanners of their own, the plan is that of the scanner of head.station.\n"
    "\n"
    "georef is planned for each station, from output.crs, output.tolerance_m, the scene's extent and the head's\n"
    "range_max_m. There is one row for all stations where they get the same method, else one row each.\n"
    "\n"
    "A stage with the method none is left out: nothing in the configuration asks for it. The lines below each\n"
    "stage are the methods that were not chosen, each with its reason.\n"
    "\n"
    "The last row, total, is measured on this machine, now. Its cost is the processor time of one cast pulse in\n"
    "ns, from its direction to its frame. It gives the pulses per second that the processors (or loop.threads of\n"
    "them) compute, and the share of them that the configured rate needs. Pulses in the blind part of the sweep\n"
    "are not cast. In real time, `run` warns above 80 %. No method is chosen by this row; only its figures differ\n"
    "from call to call.\n"
    "\n"
    "Other costs are in ns per pulse, added to the cost of a single ray. They are rounded figures of `make chart`\n"
    "and `make bench-beam` on one core with AVX2, for comparing methods. `make bench` measures the part that\n"
    "depends on the scene.\n";

const struct app_command app_plan = {
    .name = "plan",
    .operand = {"CONFIG"},
    .summary = "which method each stage will use, its error bound, its cost, and the total",
    .options = OPTIONS,
    .notes = NOTES,
    .run = plan_run,
};
