/* SPDX-License-Identifier: MIT */
/* scanhead check: validates configuration, scene and links. Nothing runs. */
#include <inttypes.h>
#include <string.h>
#include <sys/resource.h>

#include "core/vec3.h"
#include "firmware_sim/app/app.h"
#include "firmware_sim/app/check_places.h"
#include "firmware_sim/app/check_scene.h"
#include "firmware_sim/app/sites.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/reference.h"
#include "firmware_sim/device/head_clock.h"
#include "firmware_sim/device/settings_file.h"
#include "firmware_sim/loop/loop.h"
#include "firmware_sim/site/waves.h"

/* Makes the head with its links and its stored settings as `run` does, starts nothing, and closes all. So what `run`
 * would refuse shows now: a taken port, two links at one port, a link that can't carry the stream. cfg: that of the
 * site. */
static int check_head(struct config *cfg, const struct site *site, const struct sh_report *report, struct sh_err *err)
{
    struct link_spec kept[CONFIG_MAX_LINKS];
    const uint32_t threads = cfg->loop.threads;
    struct device_options options = {.report = report};
    struct device *device = NULL;
    struct loop *loop = NULL;
    int rc = SH_OK;
    memcpy(kept, cfg->link, sizeof kept);
    cfg->loop.threads = 1; /* each has memory of its own */
    for (uint32_t i = 0; i < cfg->n_links; i++)
        if (cfg->link[i].type == LINK_FILE)
            cfg->link[i] = (struct link_spec){.type = LINK_NULL}; /* opening a file would empty it */
    if (cfg->head.settings_file[0] != '\0')
        rc = settings_file_look(cfg->head.settings_file, cfg->profile.name, &options.settings, err);
    if (rc == SH_OK) rc = device_create(site, &options, &device, err);
    if (rc == SH_OK) rc = loop_create(site, device, &(struct loop_options){.report = report}, &loop, err);
    loop_free(loop);
    device_free(device);
    settings_file_close(options.settings, NULL);
    memcpy(cfg->link, kept, sizeof kept);
    cfg->loop.threads = threads;
    return rc;
}

static void print_stations(const struct config *cfg, FILE *out)
{
    uint32_t n = 0;
    for (uint32_t i = 0; i < cfg->n_stations; i++)
        n += config_serves(cfg, i) != 0;
    fprintf(out, "station%s ", n > 1 ? "s" : "");
    for (uint32_t i = 0, k = 0; i < cfg->n_stations; i++)
        if (config_serves(cfg, i)) fprintf(out, "%s%u", k++ > 0 ? ", " : "", i + 1);
    fputs(": ", out);
}

/* Where there are several scanners, the line begins with the stations that this one scans from. */
static void print_scanner(const struct config *cfg, FILE *out)
{
    const struct head_settings *s = &cfg->head.settings;
    char emitter[160];
    fputs("head      ", out);
    if (!config_is_alone(cfg)) print_stations(cfg, out);
    fprintf(out, "%s %s (%s), %g Hz pulses, %g lines/s, pan %g deg/s\n", cfg->profile.maker, cfg->profile.model,
            cfg->profile.name, (double)s->prr_uhz * 1e-6, (double)s->lines_uhz * 1e-6, (double)s->pan_udeg_s * 1e-6);
    if (config_limits_range(cfg))
        fprintf(out, "range     %g to %g m only (head.range_min_m, range_max_m); the head profile has %g to %g\n",
                cfg->head.range_min_m, cfg->head.range_max_m, cfg->head.profile_min_m, cfg->head.profile_max_m);
    emitter_describe(&cfg->profile.emitter, emitter, sizeof emitter);
    if (emitter[0] != '\0') fprintf(out, "emitter   %s\n", emitter);
}

static void print_scanners(const struct sites *sites, FILE *out)
{
    print_scanner(sites->first->cfg, out);
    for (uint32_t i = 0; i < sites->n; i++) {
        const struct site *site = sites->other[i].site;
        print_scanner(site->cfg, out);
        if (site->scale_m != sites->first->scale_m)
            fprintf(out, "output    of this head %g m per count\n", site->scale_m);
    }
}

static void print_platform(const struct site *site, FILE *out)
{
    const struct config_platform *p = &site->cfg->platform;
    if (p->kind == PLATFORM_LIVE) fprintf(out, "platform  live, up to %g m from its station\n", p->reach_m);
    if (p->kind != PLATFORM_TRAJECTORY) return;
    double way_m = 0.0;
    for (size_t i = 1; i < site->n_knots; i++)
        way_m += vec3_distance(site->knot[i].pose.position_m, site->knot[i - 1].pose.position_m);
    fprintf(out, "platform  trajectory of %.3f s, %.3f m; %zu poses keep the head within %.3g m of it; %zu stretch%s\n",
            1e-9 * (double)site->knot[site->n_knots - 1].t_ns, way_m, site->n_knots, site->knot_error_m,
            site->n_stretches, site->n_stretches == 1 ? "" : "es");
}

static double bytes_of(const struct scene *scene, const struct bvh *bvh)
{
    const double triangle =
        sizeof *scene->triangle + sizeof *scene->label + (scene->uv != NULL ? sizeof *scene->uv : 0);
    double bytes = (double)bvh_get_info(bvh)->bytes; /* with the meshes' BVHs */
    bytes += scene->n_copies * (double)sizeof(struct scene_copy);
    for (uint32_t i = 0; i <= scene->n_copied; i++) {
        const struct scene *mesh = i == 0 ? scene : scene->copied[i - 1].mesh;
        bytes += mesh->n_triangles * triangle + mesh->n_vertices * (double)sizeof *mesh->vertex_m;
    }
    return bytes;
}

/* Returns the most memory that the program has had so far, also while it was loading, in MB. */
static double peak_mb(void)
{
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    return 1024e-6 * (double)usage.ru_maxrss;
}

/* Copies share the triangles of their mesh, so a triangle of a scene with many copies takes few bytes. */
static void print_memory(const struct site *site, double all_mb, FILE *out)
{
    double bytes = bytes_of(site->scene, site->bvh), triangles = (double)site->scene->n_all;
    for (uint32_t i = 0; i < site->n_movers; i++) {
        bytes += bytes_of(site->mover[i].scene, site->mover[i].bvh);
        triangles += (double)site->mover[i].scene->n_all;
    }
    fprintf(out, "memory    %.4g MB for meshes and BVH, %.0f bytes a triangle; %.4g MB at the peak\n", 1e-6 * bytes,
            bytes / triangles, all_mb);
}

static void print_output(const struct config *cfg, const struct site *site, FILE *out)
{
    int heights = cfg->output.crs == GEOREF_UTM || cfg->output.crs == GEOREF_GEODETIC;
    fprintf(out, "output    %s, %g m per count%s\n", cfg->output.layout == LINE_GEO ? "geo" : "polar", site->scale_m,
            !heights                              ? ""
            : site->geoid != NULL                 ? ", heights above the geoid"
            : cfg->output.heights == HEIGHTS_AUTO ? ", heights above the ellipsoid (no geoid data is installed)"
                                                  : ", heights above the ellipsoid");
}

static void print_waves(const struct site *site, FILE *out)
{
    if (site->cfg->head.settings.waves == 0) return;
    fprintf(out, "waveforms %u samples for a usual pulse, %.4g MB/s\n", site_usual_waves(site, 1).samples,
            1e-6 * site_wave_bytes_s(site));
}

static void print_links(const struct config *cfg, FILE *out)
{
    for (uint32_t i = 0; i < cfg->n_links; i++) {
        const struct link_spec *link = &cfg->link[i];
        const int has_port = link->type == LINK_TCP || link->type == LINK_UDP || link->type == LINK_WEB;
        fprintf(out, "link      %s", link_ops_get(link->type)->name);
        if (has_port && link->port != 0)
            fprintf(out, ":%s:%d", link->address[0] != '\0' ? link->address : "127.0.0.1", link->port);
        else if (link->path[0] != '\0')
            fprintf(out, ":%s", link->path);
        fprintf(out, ", %s\n", protocol_ops_get((enum protocol_id)link->protocol)->name);
    }
}

static void print_target(const struct site *site, FILE *out)
{
    const struct config_target *target = &site->cfg->scene.target;
    const struct site_target *t = &site->world->target;
    if (target->n_objects == 0) return;
    fprintf(out, "target    %u of %u triangles, %u of %u surfaces; the others %s\n", t->triangles, t->all_triangles,
            t->surfaces, t->all_surfaces,
            target->others == OTHERS_HIDE ? "hide surfaces behind them and give no points" : "are left out");
}

/* Triangles of copies are counted with the others. */
static const char *copies_text(const struct scene *scene, char *text, size_t len)
{
    text[0] = '\0';
    if (scene->n_copies > 0)
        snprintf(text, len, "%u %s (%" PRIu64 " triangles are kept), ", scene->n_copies,
                 scene->n_copies == 1 ? "copy" : "copies", scene_n_kept(scene));
    return text;
}

static void print_summary(const struct config *cfg, const struct sites *sites, double all_mb, FILE *out)
{
    const struct site *site = sites->first;
    const struct scene *scene = site->scene;
    char copies[96];
    fprintf(out, "%s: ok\n", cfg->file);
    print_scanners(sites, out);
    fprintf(out, "scene     %u triangles, %u surfaces, %sx %.3f..%.3f  y %.3f..%.3f  z %.3f..%.3f m\n", scene->n_all,
            scene->n_surfaces, copies_text(scene, copies, sizeof copies), scene->min_m[0], scene->max_m[0],
            scene->min_m[1], scene->max_m[1], scene->min_m[2], scene->max_m[2]);
    print_memory(site, all_mb, out);
    print_target(site, out);
    check_print_anchor(site, out);
    if (site->stop != NULL) check_print_stops(site, out);
    for (uint32_t i = 0; i < site->n_stations && site->stop == NULL; i++)
        check_print_station(sites_of(sites, i), i, out);
    print_platform(site, out);
    print_output(cfg, site, out);
    print_waves(site, out);
    print_links(cfg, out);
}

static int print_time(const struct config *cfg, FILE *out, struct sh_err *err)
{
    struct head_clock clock;
    struct utc_time utc;
    char now[UTC_TEXT_LEN], end[UTC_TEXT_LEN];
    int rc = head_clock_create(&cfg->time, &clock, err);
    if (rc != SH_OK || clock.source == EPOCH_NONE) return rc;
    utc_from_tai(&clock.table, clock.tai0_ns, &utc);
    utc_format(&utc, 0, now);
    utc_from_tai(&clock.table, utc_tai_from_posix(&clock.table, clock.table.expires_s * UTC_SECOND_NS), &utc);
    utc_format(&utc, 0, end);
    fprintf(out, "time      %s at power-up; leap seconds are known up to %.10s\n", now, end);
    if (clock.warning[0] != '\0') app_report_stderr.warn(app_report_stderr.ctx, clock.warning);
    return SH_OK;
}

struct check_run {
    struct app_input in;
    int scene;       /* --scene */
    const char *csv; /* --scene-csv */
    unsigned n_warnings;
};

/* Hands warnings on, and counts them. */
static void check_warn(void *ctx, const char *text)
{
    struct check_run *run = ctx;
    run->n_warnings++;
    sh_warn(&app_report_stderr, "%s", text);
}

static int check(struct config *cfg, void *ctx, struct sh_err *err)
{
    struct check_run *run = ctx;
    const struct sh_report report = {.ctx = run, .warn = check_warn, .rest = &app_report_stderr};
    struct sites sites = {0};
    FILE *out = run->csv != NULL && strcmp(run->csv, "-") == 0 ? stderr : stdout; /* CSV alone is on standard output */
    int rc = sites_load(cfg, SITE_FOR_SCANS, &report, &sites, err);
    const double all_mb = peak_mb(); /* of the scene, without the head's queues */
    if (rc == SH_OK) rc = check_head(cfg, sites.first, &report, err);
    if (rc == SH_OK) print_summary(cfg, &sites, all_mb, out);
    if (rc == SH_OK && (run->scene || run->csv != NULL))
        rc = check_print_scene(sites.first, run->n_warnings, run->csv, run->scene ? out : NULL, err);
    if (rc == SH_OK) rc = print_time(cfg, out, err);
    sites_free(&sites);
    return rc;
}

static int app_check_run(int argc, char **argv)
{
    struct check_run r = {0};
    const int status = app_parse(&app_check, argc, argv, &r.in, &r);
    return status == APP_GO_ON ? app_with_config(&r.in, check, &r) : status;
}

static int print_example(void *values, const char *text)
{
    (void)values;
    (void)text;
    struct sh_err err = {0};
    return config_print_example(stdout, &err) == SH_OK ? APP_OK : app_fail(&err);
}

static int print_section(const char *section)
{
    struct sh_err err = {0};
    return config_print_section(section, stdout, &err) == SH_OK ? APP_OK : app_fail(&err);
}

/* clang-format off */
static const struct app_option OPTIONS[] = {
    OPTION_SET,
    {APP_FLAG, "scene", NULL, .at = offsetof(struct check_run, scene),
     .help = "print the 50 largest objects of the scene, with triangles, open edges, area, volume and colour; the sum "
             "of all objects; the names of open objects"},
    {APP_TEXT, "scene-csv", "FILE", .at = offsetof(struct check_run, csv), .file = APP_FILLS,
     .help = "write all objects, with IFC type and GlobalId, as CSV; - is standard output, and all other output goes "
             "to standard error then"},
    {APP_TEXT, "scenario", "FILE", .at = offsetof(struct check_run, in.scenario), .file = APP_READS,
     .help = "also check the faults of this file; a bare name is one of config/faults"},
    {APP_PRINT, "example", NULL, .apply = print_example,
     .help = "print a configuration with all keys, each with its help and its default, that passes this check"},
    OPTION_END
};
/* clang-format on */

const struct app_command app_check = {
    .name = "check",
    .operand = {"CONFIG"},
    .summary = "validate configuration, scene and links without running the head",
    .options = OPTIONS,
    .opens_links = 1,
    .notes =
        "Prints the scanners, the memory that the scene takes, and the places of the scene and of each station in\n"
        "every known coordinate frame. Opens and closes the links except files, all at once, so a taken port, a wrong\n"
        "path or a link that can't carry the stream shows. It makes no file, but checks whether files of links and\n"
        "head.settings_file can be written, and reads the stored settings.\n"
        "If the configuration is wrong, it shows all errors, up to 20, each with its line.\n"
        "\n"
        "--scene: an edge is open where an odd number of triangles of the object has it: one, or three where a face\n"
        "is there twice. Their corners are at the same place, bit for bit. A closed body has a volume, below 0 where\n"
        "its faces point inward. It also counts as closed where corners of one side lie in the middle of edges of\n"
        "the other. A body is called turned where it has no open edge, but neighbouring faces point to opposite\n"
        "sides.\n"
        "\n"
        "--help SECTION prints the keys of one section: --help head, --help scene.anchor. --help profile prints\n"
        "those of head profiles.\n"
        "\n"
        "Configuration keys:\n"
        "\n",
    .print_more = config_print_reference,
    .part = "[SECTION]",
    .print_part = print_section,
    .run = app_check_run,
};
