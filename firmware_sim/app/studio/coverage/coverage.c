/* SPDX-License-Identifier: MIT */
/* scanhead coverage: how much of the scene's surface the stations see, and where to stand next. */
#include "firmware_sim/app/studio/coverage/coverage.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/newfile.h"
#include "core/studio/mesh.h"
#include "firmware_sim/app/app.h"
#include "firmware_sim/app/sites.h"
#include "firmware_sim/app/studio/coverage/next.h"
#include "firmware_sim/config/config.h"

static const char *const COLOURS[] = {[COVERAGE_SEEN] = "seen",
                                      [COVERAGE_COUNT] = "count",
                                      [COVERAGE_DENSITY] = "density",
                                      [COVERAGE_INCIDENCE] = "incidence"},
                         *const BY[] = {"label"};

struct coverage_run {
    struct app_input in;
    const char *output, *at;
    struct coverage_next_options o;
    int json, written, quiet; /* app_parse hides progress */
    int by;                   /* number of a word of BY; negative: not given */
    enum coverage_colour colour;
    const struct config *cfg;
    struct sites sites;
    struct site *site; /* of the scanner of head.station, with all stations' places */
    struct coverage *coverage;
    struct coverage_result result;
    struct coverage_next next;
    struct coverage_finder finder;
};

/* ---- scans */

/* Puts moving bodies where they are at that time of the scan; at a stop, at the time of the stop. */
static void enter(void *ctx, int64_t t_ns, struct cast_setup *setup)
{
    const struct coverage_scan_at *at = ctx;
    site_move(at->site, at->station, 1e-9 * (double)t_ns, setup);
}

void coverage_scan_of(const struct site *site, uint32_t station, struct coverage_scan_at *at)
{
    struct head_settings settings = site->cfg->head.settings;
    struct schedule_spec spec;
    if (settings.frames == 0) settings.frames = 1;
    *at = (struct coverage_scan_at){.site = site, .station = station, .scan.ctx = at};
    site_fill_spec(site, &settings, &spec);
    schedule_start(&at->scan.segment, &spec);
    site_cast_setup(site, station, &at->scan.setup);
    if (site->n_movers > 0) at->scan.enter = enter;
}

/* Coverage needs heads that stand still: a moving head has no one place. */
static int check_platform(const struct config *cfg, struct sh_err *err)
{
    if (!config_head_moves(&cfg->platform)) return SH_OK;
    return sh_fail(err, SH_EINPUT,
                   "%s: platform.kind: %s, but coverage needs a head that stands still; allowed static, stops",
                   cfg->file, cfg->platform.kind == PLATFORM_LIVE ? "live" : "trajectory");
}

static int look_from(struct coverage_run *r, uint32_t i, struct sh_err *err)
{
    struct site *site = sites_of(&r->sites, i);
    struct coverage_scan_at *at = malloc(sizeof *at);
    struct coverage_result_station *s = &r->result.station[i];
    char what[CONFIG_STATION_NAME_LEN + 48];
    double gain_m2;
    if (at == NULL) return sh_fail(err, SH_ENOMEM, "no memory for a scan");
    snprintf(what, sizeof what, "station %u of %u (%s)", i + 1, r->site->n_stations, r->site->station[i].station->name);
    int rc = site_open_sights(site, i, 1, &app_report_seconds, err);
    if (rc == SH_OK) {
        coverage_scan_of(site, i, at);
        rc = coverage_look(r->coverage, &at->scan, what, &app_report_seconds, &s->pulses, err);
    }
    if (rc == SH_OK) {
        coverage_waiting(r->coverage, &s->seen_m2, &gain_m2);
        coverage_keep(r->coverage);
    }
    free(at);
    return rc;
}

/* ---- results */

static int sum_up(struct coverage_run *r, struct sh_err *err)
{
    struct coverage_result *result = &r->result;
    const uint32_t n = r->site->n_stations;
    double *alone_m2 = malloc(n * sizeof *alone_m2);
    if (alone_m2 == NULL) return sh_fail(err, SH_ENOMEM, "no memory for %u stations", n);
    coverage_alone(r->coverage, alone_m2);
    for (uint32_t i = 0; i < n; i++)
        result->station[i].alone_m2 = alone_m2[i];
    free(alone_m2);
    if (r->by >= 0) {
        result->label = calloc(r->site->scene->n_surfaces, sizeof *result->label);
        if (result->label == NULL) return sh_fail(err, SH_ENOMEM, "no memory for the figures of labels");
        coverage_by_label(r->coverage, result->label);
    }
    return coverage_sum(r->coverage, &result->sums, err);
}

static void put_all(struct json *json, const void *ctx)
{
    const struct coverage_run *r = ctx;
    json_open_object(json, NULL);
    coverage_put(json, &r->result);
    if (r->o.stations > 0) coverage_next_put(json, &r->next, &r->result);
    json_close_object(json);
}

/* Mesh and figures are those of the present stations, so they are made before further ones are looked for. */
static int show(struct coverage_run *r, struct sh_err *err)
{
    int rc = sum_up(r, err);
    if (rc == SH_OK && r->output != NULL)
        rc = coverage_write_mesh(r->coverage, r->output, r->colour, &app_report_seconds, err);
    r->written = rc == SH_OK && r->output != NULL;
    if (rc == SH_OK && !r->json) coverage_print_text(&r->result);
    if (rc == SH_OK && !r->json) fflush(stdout); /* what follows may take long */
    if (rc == SH_OK && r->o.stations > 0) rc = coverage_next_find(&r->finder, r->coverage, err);
    if (rc == SH_OK && r->o.stations > 0 && !r->json) coverage_next_print(&r->next, &r->result);
    if (rc == SH_OK && r->json) rc = app_write_json("-", put_all, r, err);
    const char *why = app_write_failure(stdout);
    if (rc == SH_OK && why != NULL) rc = sh_fail(err, SH_EIO, "standard output: %s", why);
    return rc;
}

/* Checks before minutes of work whether the file can be written. */
static int check_output(const struct coverage_run *r, struct sh_err *err)
{
    if (r->output == NULL) return SH_OK;
    if (strlen(r->output) >= CONFIG_PATH_LEN)
        return sh_fail(err, SH_EINPUT, "-o %.60s...: longer than %d characters", r->output, CONFIG_PATH_LEN - 1);
    return newfile_check(r->output, err);
}

static int open_all(struct coverage_run *r, struct sh_err *err)
{
    struct sh_err why = {0};
    int rc = check_platform(r->cfg, err);
    if (rc == SH_OK) rc = check_output(r, err);
    if (rc == SH_OK) rc = sites_load(r->cfg, SITE_WRITTEN_OUT, &app_report_stderr, &r->sites, err);
    r->site = r->sites.first;
    if (rc == SH_OK && r->output != NULL)
        rc = mesh_check_box(r->output, r->site->scene->min_m, r->site->scene->max_m, err);
    if (rc != SH_OK) return rc;
    r->result.base = r->cfg->head.settings.station - 1;
    const struct coverage_spec spec = {.bvh = r->site->bvh,
                                       .silent = r->site->silent,
                                       .cell_m = r->cfg->coverage.cell_m,
                                       .memory_mib = r->cfg->coverage.memory_mib,
                                       .threads = config_threads(r->cfg)};
    r->result.site = r->site;
    r->result.cell_m = spec.cell_m;
    r->result.station = calloc(r->site->n_stations, sizeof *r->result.station);
    if (r->result.station == NULL) return sh_fail(err, SH_ENOMEM, "no memory for %u stations", r->site->n_stations);
    rc = coverage_create(&spec, &app_report_seconds, &r->coverage, &why);
    if (rc == SH_EINPUT) return sh_fail(err, rc, "%s: coverage.cell_m: %.400s", r->cfg->file, why.text);
    if (rc != SH_OK) *err = why;
    if (rc == SH_OK && r->o.stations > 0)
        rc = coverage_next_open(&r->o, &r->result, &app_report_seconds, &r->next, &r->finder, err);
    return rc;
}

static int cover(struct config *cfg, void *ctx, struct sh_err *err)
{
    struct coverage_run *r = ctx;
    r->cfg = cfg;
    app_catch_signals();
    int rc = open_all(r, err);
    for (uint32_t i = 0; rc == SH_OK && i < r->site->n_stations; i++)
        rc = look_from(r, i, err);
    if (rc == SH_OK) rc = show(r, err);
    if (rc == SH_ESTOPPED && r->written)
        sh_fail(err, rc, "interrupted; %s is written, but the next stations are not known", r->output);
    else if (rc == SH_ESTOPPED)
        sh_fail(err, rc, "interrupted; no file is written");
    free(r->result.station);
    free(r->result.label);
    coverage_next_free(&r->next, &r->finder);
    coverage_free(r->coverage);
    sites_free(&r->sites);
    return rc;
}

/* ---- options */

static const double HEIGHT_M = 1.6, STEP_DEG = 1.0;
enum { SCANS = 3 };

static int check_next(struct coverage_run *r)
{
    struct coverage_next_options *o = &r->o;
    const int asks = o->grid_m > 0.0 || o->candidates != NULL;
    o->step_given = o->step_deg >= 0.0;
    const char *option = o->step_given ? "--step-deg" : o->scans > 0 ? "--scans" : NULL;
    if (o->height_m >= 0.0 && !(o->grid_m > 0.0)) return app_usage(&app_coverage, "--height: allowed only with --grid");
    if (option != NULL && !asks)
        return app_usage(&app_coverage, "%s: allowed only with --grid or --candidates", option);
    if (o->height_m < 0.0) o->height_m = HEIGHT_M;
    if (!o->step_given) o->step_deg = STEP_DEG;
    if (o->scans < 0) o->scans = SCANS;
    for (int i = 0; i < 3; i++)
        o->area_m[0][i] = o->area_m[1][i] = (double)NAN;
    if (o->stations == 0 && asks) o->stations = 1;
    if (o->stations > 0 && !asks)
        return app_usage(&app_coverage, "--next needs places to compare: --grid STEP_M or --candidates FILE");
    if (o->grid_m > 0.0 && o->candidates != NULL)
        return app_usage(&app_coverage, "--grid and --candidates: allowed is one of them");
    if (r->at != NULL && !(o->grid_m > 0.0)) return app_usage(&app_coverage, "--at: allowed only with --grid");
    if (r->at != NULL && !coverage_next_area(r->at, o->area_m))
        return app_usage(
            &app_coverage,
            "--at %s: allowed is X0,Y0,X1,Y1 or X0,Y0,X1,Y1,Z0,Z1 in metres, the lower number of each pair first",
            r->at);
    return APP_GO_ON;
}

static int check_options(struct coverage_run *r)
{
    if (app_is_given(&r->in, "colour") && r->output == NULL)
        return app_usage(&app_coverage, "--colour: allowed with -o FILE");
    if (r->output != NULL && !mesh_has_format(r->output))
        return app_usage(&app_coverage,
                         "-o %s: the file is a mesh; allowed is a name that ends in .ply, .obj, .gltf, .glb or .fbx",
                         r->output);
    return check_next(r);
}

/* A .gltf has its binary data in a .bin beside it. */
static int add_numbers(struct coverage_run *r)
{
    const struct app_file file = {"output", r->output, APP_WRITES, .n_ending = sizeof ".gltf" - 1, .ending = ".bin"};
    if (r->output == NULL || !app_ends_in(r->output, ".gltf") || app_add_file(&r->in, &file) == APP_OK)
        return APP_GO_ON;
    return APP_USAGE;
}

static int coverage_run_command(int argc, char **argv)
{
    struct coverage_run r = {.by = -1,
                             .o = {.height_m = -1.0, .step_deg = -1.0, .scans = -1}}; /* negative: not given */
    int status = app_parse(&app_coverage, argc, argv, &r.in, &r);
    if (status == APP_GO_ON) status = check_options(&r);
    if (status == APP_GO_ON) status = add_numbers(&r);
    return status == APP_GO_ON ? app_with_config(&r.in, cover, &r) : status;
}

#define AT(member) offsetof(struct coverage_run, member)

/* clang-format off */
static const struct app_option OPTIONS[] = {
    {APP_FLAG, "json", NULL, .at = AT(json),
     .help = "print the figures as JSON: cell_m, cells, pieces, triangles, area_m2, duplicate_m2, silent_m2, none_m2, "
             "one_m2, several_m2 and these three as percent, density_1_m2, incidence_deg and range_m (mean, p05, p50, p95), "
             "stations, labels, next"},
    {APP_CHOICE, "by", "label", .at = AT(by), OPTION_CHOICES(BY), .help = "also print the figures of each label: object and material"},
    {APP_TEXT, "output", "FILE", .letter = 'o', .at = AT(output), .file = APP_WRITES,
     .help = "write the cells as a mesh with colours; .ply has the scalars stations, density, incidence_deg, range_m "
             "and cell"},
    {APP_CHOICE, "colour", "WHAT", .at = AT(colour), OPTION_CHOICES(COLOURS),
     .help = "colours of the mesh: seen (by no station red, by one yellow, by several green; the default), count (of "
             "stations, blue to red), density (blue to red, in decades), incidence (blue head on to red grazing)"},
    {APP_WHOLE, "next", "N", .min = 1, .max = COVERAGE_MOST_NEXT, .at = AT(o.stations),
     .help = "find the N next stations, one after the other: each is the place that adds most to the area seen so far "
             "(default 1 with --grid or --candidates)"},
    {APP_NUMBER, "grid", "STEP_M", .min = 1e-3, .max = 1e6, .at = AT(o.grid_m),
     .help = "compare the places of a grid with this step, on all floors where a tripod can stand"},
    {APP_NUMBER, "height", "M", .min = 0.0, .max = 1000.0, .at = AT(o.height_m),
     .help = "height of the head's origin above the floor (default 1.6)"},
    {APP_TEXT, "at", "X0,Y0,X1,Y1", .at = AT(at),
     .help = "limits of the grid (default: those of the scene); two more numbers, Z0,Z1, limit the heights of floors"},
    {APP_TEXT, "candidates", "FILE.csv", .at = AT(o.candidates), .file = APP_READS,
     .help = "compare the places in a file with the columns x_m,y_m,z_m of the head's origin, and perhaps heading_deg"},
    {APP_NUMBER, "step-deg", "D", .min = 0.2, .max = 30.0, .at = AT(o.step_deg),
     .help = "angle between the rays by which places are compared (default 1). Not for heads that scan a plane or "
             "have several beams: the rays are then the head's own pulses"},
    {APP_WHOLE, "scans", "K", .min = 1, .max = COVERAGE_MOST_SCANS, .at = AT(o.scans),
     .help = "scan the K best places of each round as a whole, and take the best one (default 3)"},
    OPTION_SET,
    {APP_FLAG, "quiet", NULL, .at = AT(quiet), .help = "no progress"},
    OPTION_END
};
/* clang-format on */

static const char NOTES[] =
    "The surface is cut into cells of coverage.cell_m. A cell is seen where the centre of a pulse hits it, from\n"
    "either side, and the head can report it: within its ranges, and with signal.model above its threshold;\n"
    "through glass, but not in mirrors; without noise. Each station scans with the settings at\n"
    "power-up, and with its own scanner. Percentiles are of the area that is seen. density counts the pulses of all\n"
    "stations; incidence and range are the smallest.\n"
    "\n"
    "Each face is a surface. Walls of a building model are closed bodies: their faces between two bodies, and their\n"
    "ends within others, can not be seen and count as seen by none. Faces with the same corners count once, those\n"
    "outside of scene.target not at all. Meshes that move hide other surfaces, but their own surface does not\n"
    "count. With platform.kind: stops each stop is a station.\n"
    "\n"
    "Take cells several times as wide as the points are apart: smaller ones fall between the points.\n"
    "\n"
    "The next station is the place where the head of head.station, level and with the heading of that station,\n"
    "sees most area that no station sees. A place of the grid is a floor of at most 20 degrees, with room for the\n"
    "head and a tripod. Places are compared by rays. The best ones of each round are scanned as a whole, and the\n"
    "gains of these scans decide. Places that see mostly backs of faces lie within bodies. They are left out if the\n"
    "stations see mostly fronts. The line below the table can be copied into `stations`. The scans have the scanner\n"
    "of that station, and its tripod's cone as it opens there, so its sections scanner and tripod are to be copied,\n"
    "too. Mesh, figures and labels are those of the present stations.\n";

const struct app_command app_coverage = {
    .name = "coverage",
    .operand = {"CONFIG"},
    .summary = "how much of the surface the stations see, and where to stand next",
    .options = OPTIONS,
    .notes = NOTES,
    .run = coverage_run_command,
};
