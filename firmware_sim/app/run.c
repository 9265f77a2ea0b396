/* scanhead run: serves the head on its links. */
#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "firmware_sim/app/app.h"
#include "firmware_sim/app/watch/watch.h"
#include "firmware_sim/base/clock.h"
#include "firmware_sim/loop/loop.h"
#include "firmware_sim/site/plan_rows.h"
#include "firmware_sim/site/rate.h"

enum { VIEW_SESSIONS = 4 };

struct run_options {
    struct app_input in;
    struct device_options device;
    const char *stats;
    long ready_fd;
    int quiet, no_hash, frames_given, view;
};

static void say_sights(const struct site *site)
{
    double build_s = 0.0, mib = 0.0;
    unsigned n = 0;
    for (uint32_t i = 0; i < site->n_stations; i++) {
        struct sight_info info;
        if (site->station[i].sight == NULL) continue;
        sight_get_info(site->station[i].sight, &info);
        build_s += info.build_s;
        mib += 0x1p-20 * (double)info.bytes;
        n++;
    }
    if (n == 0) return;
    fprintf(stderr, "scanhead: maps of what is seen from %u station%s in %.2f s, %.1f MiB\n", n, n > 1 ? "s" : "",
            build_s, mib);
}

static void say_what_runs(const struct config *cfg, const struct site *site, const struct loop *loop)
{
    struct bvh_info info;
    bvh_get_info(site->bvh[0], &info);
    fprintf(stderr,
            "scanhead: %s %s, %s, %u triangles, %u surfaces; BVH in %.2f s, %.0f bytes per triangle, packets of %u\n",
            cfg->profile.maker, cfg->profile.model, cfg->profile.name, site->scene->n_triangles,
            site->scene->n_surfaces, info.build_s, (double)info.bytes / site->scene->n_triangles, info.packet);
    if (!config_is_alone(cfg))
        fprintf(stderr,
                "scanhead: it is the scanner of %u of %u stations; --set head.station=N serves that of another\n",
                site_n_served(site), site->n_stations);
    say_sights(site);
    char plan[512];
    struct link_place place;
    site_plan_text(site, plan, sizeof plan);
    fprintf(stderr, "scanhead: plan: %s\n", plan);
    for (uint32_t i = 0; loop_get_place(loop, i, &place); i++)
        if (strcmp(place.type, "fd") != 0) /* within this process */
            fprintf(stderr, "scanhead: link %s%s%s\n", place.endpoint, place.protocol != NULL ? ", " : "",
                    place.protocol != NULL ? place.protocol : "");
}

static void put_endpoints(struct json *json, const void *loop)
{
    loop_put_endpoints(loop, json);
}

static int say_view(const struct loop *loop, struct sh_err *err)
{
    struct link_place place;
    for (uint32_t i = 0; loop_get_place(loop, i, &place); i++)
        if (strcmp(place.type, "web") == 0) printf("%s\n", place.endpoint);
    return fflush(stdout) == 0 ? SH_OK : sh_fail(err, SH_EIO, "standard output: %s", strerror(errno));
}

static void wait_for_end(struct loop *loop)
{
    int ending = 0;
    while (!loop_is_over(loop)) {
        if (app_interrupted() && !ending) {
            ending = 1;
            loop_end(loop);
        }
        poll(NULL, 0, 20); /* ends early on a signal */
    }
}

struct run_stats {
    const struct loop *loop;
    struct loop_stats stats;
};

static void put_pulses(struct json *json, const struct device_counters *c)
{
    json_uint(json, "pulses", c->pulses);
    json_uint(json, "fired_pulses", c->fired);
    json_uint(json, "blind_pulses", c->fired - c->cast);
    json_uint(json, "cast_pulses", c->cast);
    json_uint(json, "lost_pulses", c->lost_pulses);
    json_uint(json, "lost_ticks", c->lost_ticks);
}

static void put_stats(struct json *json, const void *ctx)
{
    const struct run_stats *run = ctx;
    const struct loop_stats *s = &run->stats;
    const struct device_counters *c = &s->counters;
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    json_open_object(json, NULL);
    put_pulses(json, c);
    json_uint(json, "echoes", c->echoes);
    json_uint(json, "lines", c->lines);
    json_uint(json, "scans", s->scans);
    json_double(json, "wall_s", s->wall_s);
    json_double(json, "cpu_s", clock_cpu_s());
    json_double(json, "pulses_per_s", s->wall_s > 0.0 ? (double)c->pulses / s->wall_s : 0.0);
    json_uint(json, "crowded_echoes", c->crowded);
    json_uint(json, "faint_hits", c->faint);
    json_uint(json, "unfit_echoes", c->unfit);
    json_uint(json, "reader_lost_frames", c->reader_lost_frames);
    json_uint(json, "reader_lost_pulses", c->reader_lost_pulses);
    json_uint(json, "late_blocks", c->late_blocks);
    json_uint(json, "late_poses", c->late_poses);
    json_uint(json, "bad_poses", c->bad_poses);
    json_double(json, "late_p50_us", s->late_p50_us);
    json_double(json, "late_p999_us", s->late_p999_us);
    json_double(json, "late_max_us", 1e-3 * (double)c->late_max_ns);
    json_int(json, "rss_peak_kib", usage.ru_maxrss);
    json_string(json, "stream_sha256", s->have_hash ? s->sha256 : NULL);
    loop_put_links(run->loop, json);
    json_close_object(json);
}

static void warn_of_losses(const struct device_counters *c)
{
    if (c->lost_pulses != 0)
        sh_warn(&app_report_stderr, "%llu pulses could not be computed in time", (unsigned long long)c->lost_pulses);
    app_warn_left_out(c->crowded, c->unfit);
    app_warn_empty(c->pulses, c->echoes, c->faint);
    if (c->reader_lost_frames != 0)
        sh_warn(&app_report_stderr, "readers lost %llu frames with %llu pulses",
                (unsigned long long)c->reader_lost_frames, (unsigned long long)c->reader_lost_pulses);
}

/* --start --duration, and a scan that was over before. */
static void say_short_scan(const struct run_options *o, struct device *device)
{
    const double scan_s = 1e-9 * (double)device_scan_ns(device), tick_s = 1e-9 * (double)device_tick_ns(device);
    if (o->quiet || !o->device.start || app_interrupted() || device_scans(device) != 1) return;
    if (scan_s <= 0.0 || scan_s + 1.5 * tick_s > o->device.duration_s) return;
    fprintf(stderr, "scanhead: the scan was over after %.3f s, before --duration %.10g: %s\n", scan_s,
            o->device.duration_s,
            o->frames_given ? "all its frames were scanned" : "its path ended, or it was stopped");
}

static int serve(const struct run_options *o, struct loop *loop, struct device *device, struct sh_err *err)
{
    struct run_stats run = {.loop = loop};
    struct loop_stats *stats = &run.stats;
    int rc = loop_start(loop, err);
    if (rc == SH_OK) rc = app_say_ready(o->ready_fd, put_endpoints, loop, err);
    if (rc == SH_OK && o->view) rc = say_view(loop, err);
    if (rc == SH_OK)
        wait_for_end(loop);
    else
        loop_end(loop);
    loop_join(loop, stats);
    if (rc == SH_OK && o->stats != NULL) rc = app_write_json(o->stats, put_stats, &run, err);
    if (rc == SH_OK) rc = device_close_journal(device, err);
    if (rc == SH_OK) rc = loop_check_links(loop, err);
    say_short_scan(o, device);
    warn_of_losses(&stats->counters);
    return rc;
}

static void warn_of_replay(const struct run_options *o, const struct device *device)
{
    if (o->device.replay == NULL || device_replay_ends(device) || o->device.duration_s > 0.0) return;
    sh_warn(&app_report_stderr,
            "%s has no end, as its head was killed; after its last command the head runs until it is stopped, or for "
            "--duration S",
            o->device.replay);
}

/* --view: a web link, where the configuration has none. */
static int add_view(struct config *cfg, struct sh_err *err)
{
    for (uint32_t i = 0; i < cfg->n_links; i++)
        if (cfg->link[i].type == LINK_WEB) return SH_OK;
    if (cfg->n_links == CONFIG_MAX_LINKS)
        return sh_fail(err, SH_EINPUT, "%s: links: --view would be one more than the %d that are allowed", cfg->file,
                       (int)CONFIG_MAX_LINKS);
    cfg->link[cfg->n_links++] = (struct link_spec){.type = LINK_WEB, .max_sessions = VIEW_SESSIONS};
    return SH_OK;
}

/* What a page is told beside the stream; where there is no web link there is nothing to tell. Where its readers hold
 * back the head, the observer does, too, and sees all of it. */
static int open_watch(const struct config *cfg, const struct site *site, struct device *device,
                      struct loop_options *loop, struct watch **watch, struct sh_err *err)
{
    struct watch_options options = {.cpu_share = WATCH_CPU_SHARE,
                                    .device = device,
                                    .scene_triangles = WATCH_SCENE_TRIANGLES,
                                    .report = &app_report_seconds};
    int is_there = 0;
    for (uint32_t i = 0; i < cfg->n_links; i++) {
        is_there |= cfg->link[i].type == LINK_WEB;
        options.waits |= cfg->link[i].type == LINK_WEB && cfg->link[i].waits == LINK_WAITS_YES;
    }
    if (!is_there) return SH_OK;
    if (options.waits && cfg->loop.pace != PACE_REALTIME) options.cpu_share = 0.0;
    const int rc = watch_open(cfg, site, &options, watch, err);
    if (rc != SH_OK) return rc;
    loop->extra = watch_link(*watch);
    loop->web = watch_source(*watch);
    return watch_start(*watch, err);
}

static int run_head(struct config *cfg, void *ctx, struct sh_err *err)
{
    struct run_options *o = ctx;
    struct watch *watch = NULL;
    struct site *site = NULL;
    struct device *device = NULL;
    struct loop *loop = NULL;
    struct loop_options options = {.hash = o->stats != NULL && !o->no_hash, .report = &app_report_stderr};
    o->device.report = &app_report_stderr;
    o->device.start |= cfg->head.start;
    o->device.one_scan = o->device.one_scan && o->device.start;
    const struct app_output out[] = {{"stats", o->stats}, {"journal", o->device.journal}, {"truth", o->device.truth}};
    int rc = app_check_outputs(&o->in, out, (int)(sizeof out / sizeof *out), err);
    if (rc == SH_OK && o->view) rc = add_view(cfg, err);
    if (rc != SH_OK) return rc;
    if (cfg->n_links == 0)
        return sh_fail(err, SH_EINPUT,
                       "%s: links: none; run needs at least one of pty, tcp, udp, usb, web, file, null, or --view",
                       cfg->file);
    rc = site_load(cfg, &app_report_stderr, &site, err);
    if (rc == SH_OK) rc = site_open_sights(site, 0, site->n_stations, &app_report_stderr, err);
    /* After the plan, which is made for the configuration: a replayed journal gives the same stream without
     * --start. */
    if (o->device.start && o->device.duration_s > 0.0 && !o->frames_given) cfg->head.settings.frames = 0;
    if (rc == SH_OK) rc = site_warn_rate(site, &app_report_stderr, err);
    if (rc == SH_OK) rc = device_create(site, &o->device, &device, err);
    if (rc == SH_OK) rc = open_watch(cfg, site, device, &options, &watch, err);
    if (rc == SH_OK) rc = loop_create(site, device, &options, &loop, err);
    if (rc == SH_OK) {
        if (!o->quiet) say_what_runs(cfg, site, loop);
        warn_of_replay(o, device);
        rc = serve(o, loop, device, err);
    }
    loop_free(loop);
    watch_close(watch);
    device_free(device);
    site_free(site);
    return rc;
}

/* By --frames, or by --set. */
static int gives_frames(const struct app_sets *sets)
{
    static const char key[] = "head.frames=";
    for (int i = 0; i < sets->n; i++)
        if (strncmp(sets->set[i], key, sizeof key - 1) == 0) return 1;
    return 0;
}

static int run(int argc, char **argv)
{
    struct run_options o = {0};
    int status = app_parse(&app_run, argc, argv, &o.in, &o);
    if (status != APP_GO_ON) return status;
    o.frames_given = gives_frames(&o.in.sets);
    app_catch_signals();
    return app_with_config(&o.in, run_head, &o);
}

#define AT(member) offsetof(struct run_options, member)

/* clang-format off */
static const struct app_option OPTIONS[] = {
    {APP_FLAG, "start", NULL, .at = AT(device.start), .help = "scan at once, no command needed"},
    {APP_FLAG, "view", NULL, .at = AT(view),
     .help = "with a page for a browser, which shows the scan and sets the head; its address is printed. A web link of "
             "the configuration is used where there is one"},
    {APP_KEY, "pace", "PACE", .key = "loop.pace",
     .help = "realtime, fast (as fast as it computes), step (a peer grants time with TIME:STEP)"},
    {APP_NUMBER, "duration", "S", .min = 0.001, .max = 1e8, .at = AT(device.duration_s),
     .help = "end after S seconds of device time; they count from power-up, with --start from the scan's start. With "
             "--start the scan goes on until then, frame after frame, whatever the file has as head.frames"},
    {APP_KEY_GIVEN, "frames", "N", .key = "head.frames", .at = AT(device.one_scan),
     .help = "frames per scan; with --start, end after the first scan, even before --duration"},
    {APP_KEY, "threads", "N", .key = "loop.threads", .help = "threads that cast; 0: one per processor"},
    OPTION_SET,
    {APP_TEXT, "stats", "FILE", .at = AT(stats), .help = "write statistics as JSON at the end; - is standard output"},
    OPTION_NO_HASH(AT(no_hash)),
    {APP_TEXT, "journal", "FILE", .at = AT(device.journal),
     .help = "write every command that had an effect, with its device time, and the end"},
    {APP_TEXT, "scenario", "FILE", .at = AT(in.scenario),
     .help = "with the faults of this file beside those of the configuration; a bare name is one of config/faults"},
    {APP_TEXT, "truth", "FILE", .at = AT(device.truth),
     .help = "write each fault that is injected as a line of JSON; - is standard output"},
    {APP_TEXT, "replay-journal", "FILE", .at = AT(device.replay),
     .help = "carry out the commands of a journal at their times, and end where its run ended"},
    {APP_WHOLE, "ready-fd", "N", .min = 1, .max = 65535, .at = AT(ready_fd),
     .help = "write one JSON line with the endpoints to descriptor N once all links are open"},
    {APP_FLAG, "quiet", NULL, .at = AT(quiet), .help = "no messages but errors and warnings"},
    OPTION_END
};
/* clang-format on */

static const char NOTES[] =
    "Ctrl-C, or SIGTERM, ends the head in good order. A second signal within a second counts as the same one; a\n"
    "third, or one that comes later, ends it at once.\n";

const struct app_command app_run = {
    .name = "run",
    .operand = {"CONFIG"},
    .summary = "serve the head on its links until stopped",
    .options = OPTIONS,
    .notes = NOTES,
    .run = run,
};
