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
    "the head's range_max_m; one row for all where they get the same method, else one each. A stage with the method\n"
    "none is left out: nothing in the configuration asks for it. Costs are rounded figures of `make chart` on one "
    "core\n"
    "with AVX2, to compare methods by; what hangs on the scene is measured by `make bench`.\n";

enum { OPT_JSON = 256 };
static const struct option OPTIONS[] = {{"set", required_argument, NULL, 's'},
                                        {"json", no_argument, NULL, OPT_JSON},
                                        {"help", no_argument, NULL, 'h'},
                                        {NULL, 0, NULL, 0}};

struct plan {
    struct plan_row *row; /* of the head, then of each station */
    size_t n;
};

static void name_row(struct plan_row *row, const char *whose)
{
    char why[sizeof row->why];
    snprintf(why, sizeof why, "%.60s: %.125s", whose, row->why);
    memcpy(row->why, why, sizeof row->why);
}

/* A row for each station; one for all, with the largest bound, where they have the same method. */
static void add_georef(const struct site *site, struct plan *plan)
{
    const struct site_station *s = site->station;
    uint32_t same = 1, worst = 0;
    for (uint32_t i = 1; i < site->n_stations; i++) {
        same += strcmp(s[i].plan.method, s[0].plan.method) == 0;
        if (s[i].plan.error_m > s[worst].plan.error_m) worst = i;
    }
    if (same == site->n_stations) {
        struct plan_row *row = &plan->row[plan->n++];
        *row = s[worst].plan;
        if (site->n_stations > 1) name_row(row, "all stations");
        return;
    }
    for (uint32_t i = 0; i < site->n_stations; i++) {
        char whose[64];
        snprintf(whose, sizeof whose, "station %u %.40s", i + 1, s[i].station->name);
        plan->row[plan->n] = s[i].plan;
        name_row(&plan->row[plan->n++], whose);
    }
}

static int is_zero(const struct config_instrument *k)
{
    static const struct config_instrument zero;
    return memcmp(k, &zero, sizeof zero) == 0;
}

static void ask_head(const struct config *cfg, const struct site *site, struct plan_head *head)
{
    const struct site_detect *d = &site->detect;
    const struct cast_beam *beam = site->station[0].beam;
    struct bvh_info info;
    bvh_get_info(site->station[0].bvh, &info);
    *head = (struct plan_head){
        .packet = info.packet,
        .order_exactly = cfg->order_exactly,
        .range_max_m = cfg->profile.range_max_m,
        .n_movers = site->n_movers,
        .beam_adaptive = beam != NULL && beam->mode == BEAM_ADAPTIVE,
        .beam_rays = beam != NULL ? beam->pattern.n : 0,
        .noise_on = cfg->noise_range != RANGE_NOISE_OFF,
        .range_sigma_m = cfg->profile.range_sigma_m,
        .range_sigma_ppm = cfg->profile.range_sigma_ppm,
        .range_sigma_at_m = cfg->noise_range == RANGE_NOISE_SIGNAL ? cfg->profile.range_sigma_at_m : 0.0,
        .ball_radius_m = cfg->ball.radius_m,
        .depth = d->cast.depth,
        .signal = d->cast.signal != NULL,
        .sharp = cfg->signal.sharp,
        .ambiguity = cfg->ambiguity,
        .instrument = !is_zero(&cfg->instrument),
        .angle_noise = cfg->noise_angle,
    };
    for (uint32_t i = 0; i < d->surfaces.n; i++)
        head->n_glass += d->surfaces.surface[i].glass > 0.0 || d->surfaces.surface[i].mirror > 0.0;
    for (uint32_t i = 0; i < cfg->profile.n_reaches; i++)
        head->reach_m = fmax(head->reach_m, cfg->profile.reach[i].range_m);
    if (cfg->profile.n_reaches == 0) head->reach_m = cfg->profile.range_max_m;
}

static void make_plan(const struct config *cfg, const struct site *site, struct plan *plan)
{
    struct plan_head head;
    ask_head(cfg, site, &head);
    plan->n = plan_head(&head, plan->row);
    if (cfg->layout == LINE_POLAR) {
        plan_georef_polar(&plan->row[plan->n++]);
        return;
    }
    add_georef(site, plan);
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
    struct plan plan = {0};
    struct config *cfg = cmd_load_config(path, sets, &status);
    if (cfg == NULL) return status;
    int rc = site_load(cfg, &cmd_report_stderr, &site, &err);
    if (rc == SH_OK) plan.row = calloc(PLAN_HEAD_ROWS + site->n_stations, sizeof *plan.row);
    if (rc == SH_OK && plan.row == NULL) rc = sh_fail(&err, SH_ENOMEM, "no memory");
    if (rc == SH_OK) {
        make_plan(cfg, site, &plan);
        rc = as_json ? print_json(&plan, &err) : print_text(&plan);
    }
    free(plan.row);
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
