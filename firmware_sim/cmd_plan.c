/* scanhead plan: which method each stage will use. It loads the scene, as a run does, and asks what the run asks. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/plan.h"
#include "firmware_sim/cmd.h"
#include "firmware_sim/json.h"
#include "firmware_sim/site.h"

static const char HELP[] =
    "scanhead plan CONFIG [options]: the method each stage will use, its error bound, its cost, and why\n\n"
    "  --json           an array of {stage, method, error_m, cost_ns, why}; null: hangs on the scene\n"
    "  --set KEY=VALUE  another value of a configuration key\n\n"
    "georef is planned for each station, from output.crs, output.tolerance_m, output.georef, the scene's extent and\n"
    "the head's range_max_m. A stage with the method none is left out: nothing in the configuration asks for it.\n";

enum { OPT_JSON = 256 };
static const struct option OPTIONS[] = {{"set", required_argument, NULL, 's'},
                                        {"json", no_argument, NULL, OPT_JSON},
                                        {"help", no_argument, NULL, 'h'},
                                        {NULL, 0, NULL, 0}};

struct plan {
    struct plan_row row[PLAN_HEAD_ROWS + CONFIG_MAX_STATIONS];
    size_t n;
};

static void make_plan(const struct config *cfg, const struct site *site, struct plan *plan)
{
    const struct cast_beam *beam = site->station[0].beam;
    struct bvh_info info;
    bvh_get_info(site->station[0].bvh, &info);
    const struct plan_head head = {.packet = info.packet,
                                   .order_exactly = cfg->order_exactly,
                                   .range_max_m = cfg->profile.range_max_m,
                                   .n_movers = site->n_movers,
                                   .beam_adaptive = beam != NULL && beam->mode == BEAM_ADAPTIVE,
                                   .beam_rays = beam != NULL ? beam->pattern.n : 0,
                                   .noise_on = cfg->noise_on,
                                   .range_sigma_m = cfg->profile.range_sigma_m,
                                   .range_sigma_ppm = cfg->profile.range_sigma_ppm};
    plan->n = plan_head(&head, plan->row);
    if (cfg->layout == LINE_POLAR) {
        plan_georef_polar(&plan->row[plan->n++]);
        return;
    }
    for (uint32_t i = 0; i < site->n_stations; i++) {
        struct plan_row *row = &plan->row[plan->n++];
        *row = site->station[i].plan;
        char why[sizeof row->why];
        snprintf(why, sizeof why, "station %u %s: %.120s", i + 1, site->station[i].station->name, row->why);
        memcpy(row->why, why, sizeof row->why);
    }
}

static int print_json(const struct plan *plan, struct sh_err *err)
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
        json_double(&json, "cost_ns", row->cost_ns);
        json_string(&json, "why", row->why);
        json_close_object(&json);
    }
    json_close_array(&json);
    return json_end(&json, err);
}

static int print_text(const struct plan *plan)
{
    printf("%-8s %-24s %10s %8s  %s\n", "stage", "method", "error m", "ns", "why");
    for (size_t i = 0; i < plan->n; i++) {
        const struct plan_row *row = &plan->row[i];
        char cost[16] = "-";
        if (!isnan(row->cost_ns)) snprintf(cost, sizeof cost, "%g", row->cost_ns);
        printf("%-8s %-24s %10.2g %8s  %s\n", row->stage, row->method, row->error_m, cost, row->why);
    }
    return SH_OK;
}

static int plan_config(const struct cmd_sets *sets, const char *path, int as_json)
{
    int status = CMD_OK;
    struct sh_err err = {0};
    struct site *site = NULL;
    struct plan plan;
    struct config *cfg = cmd_load_config(path, sets, &status);
    if (cfg == NULL) return status;
    int rc = site_load(cfg, &cmd_report_stderr, &site, &err);
    if (rc == SH_OK) {
        make_plan(cfg, site, &plan);
        rc = as_json ? print_json(&plan, &err) : print_text(&plan);
    }
    site_free(site);
    free(cfg);
    return rc == SH_OK ? CMD_OK : cmd_fail(&err);
}

int cmd_plan(int argc, char **argv)
{
    struct cmd_sets sets;
    memset(&sets, 0, sizeof sets);
    int opt, as_json = 0;
    opterr = 0;
    while ((opt = getopt_long(argc, argv, ":h", OPTIONS, NULL)) != -1) {
        int status = CMD_OK;
        if (opt == 'h') {
            fputs(HELP, stdout);
            return CMD_OK;
        }
        if (opt == OPT_JSON)
            as_json = 1;
        else
            status = opt == 's' ? cmd_add_set(&sets, optarg) : cmd_bad_option("plan", opt, argv);
        if (status != CMD_OK) return status;
    }
    if (optind != argc - 1) return cmd_usage("plan", "one CONFIG is needed");
    return plan_config(&sets, argv[optind], as_json);
}
