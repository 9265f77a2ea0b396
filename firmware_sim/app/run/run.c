/* SPDX-License-Identifier: MIT */
/* scanhead run: serves the head on its links. */
#include <stdio.h>
#include <string.h>

#include "firmware_sim/app/run/page.h"
#include "firmware_sim/app/run/run.h"
#include "firmware_sim/app/surfaces.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/replay/capture.h"
#include "firmware_sim/site/plan_rows.h"

static void say_sights(const struct site *site)
{
    double build_s = 0.0, mib = 0.0;
    unsigned n = 0;
    for (uint32_t i = 0; i < site->n_stations; i++) {
        if (site->station[i].sight == NULL) continue;
        const struct sight_info *info = sight_get_info(site->station[i].sight);
        build_s += info->build_s;
        mib += 0x1p-20 * (double)info->bytes;
        n++;
    }
    if (n == 0) return;
    app_say("visibility maps of %u station%s in %.2f s, %.1f MiB", n, n > 1 ? "s" : "", build_s, mib);
}

/* A user who wonders why the head is not as configured finds the reason here. */
static void say_stored(const struct config *cfg, struct settings_file *settings)
{
    char text[SETTINGS_FILE_TEXT] = "";
    if (settings != NULL) settings_file_get(settings, "head", text);
    if (text[0] == '\0') return;
    text[strlen(text) - 1] = '\0';
    for (char *end; (end = strchr(text, '\n')) != NULL;)
        *end = ';';
    fprintf(stderr, "%s: stored in %s: %s\n", app_program, cfg->head.settings_file, text);
}

static void say_what_runs(const struct config *cfg, const struct site *site, const struct loop *loop)
{
    const struct bvh_info *info = bvh_get_info(site->bvh);
    app_say("%s %s, %s, %u triangles, %u surfaces; BVH in %.2f s, %.0f bytes per triangle, packets of %u",
            cfg->profile.maker, cfg->profile.model, cfg->profile.name, site->scene->n_all, site->scene->n_surfaces,
            info->build_s, (double)info->bytes / (double)scene_n_kept(site->scene), info->packet);
    if (!config_is_alone(cfg))
        app_say("it is the scanner of %u of %u stations; --set head.station=N serves the scanner of another station",
                site_n_served(site), site->n_stations);
    say_sights(site);
    char plan[512];
    site_plan_text(site, plan, sizeof plan);
    app_say("plan: %s", plan);
    run_say_links(loop);
}

/* With --start and --duration: says that the scan was over earlier. */
static void say_short_scan(const struct run_options *o, struct device *device)
{
    const double scan_s = 1e-9 * (double)device_scan_ns(device), tick_s = 1e-9 * (double)device_tick_ns(device);
    if (o->quiet || !o->device.start || app_interrupted() || device_last_scan(device, NULL) != 1) return;
    if (scan_s <= 0.0 || scan_s + 1.5 * tick_s > o->device.duration_s) return;
    app_say("the scan was over after %.3f s, before --duration %.10g: %s", scan_s, o->device.duration_s,
            o->frames_given ? "all its frames were scanned" : "its path ended, or it was stopped");
}

static void warn_of_replay(const struct run_options *o, const struct device *device)
{
    if (o->device.replay == NULL || device_replay_ends(device) || o->device.duration_s > 0.0) return;
    sh_warn(
        &app_report_stderr,
        "%s has no end: its head was killed, or could not write the end; after its last command the head runs until "
        "it is stopped, or for --duration S",
        o->device.replay);
}

static const struct run_page *page; /* NULL: a page gets the stream alone */

void run_take_page(const struct run_page *of_program)
{
    page = of_program;
}

static int has_page(const struct config *cfg)
{
    int is_there = 0;
    for (uint32_t i = 0; i < cfg->n_links; i++)
        is_there |= cfg->link[i].type == LINK_WEB;
    return is_there && page != NULL;
}

/* Opens the observer of the stream, from which a page gets more than the stream (page.h). Where clients of the web link
 * may hold the head back, the observer may do so, too, and then sees the whole stream. */
static int open_watch(const struct config *cfg, const struct site *site, struct device *device,
                      struct loop_options *loop, struct watch **watch, struct sh_err *err)
{
    struct watch_options options = {.cpu_share = WATCH_CPU_SHARE,
                                    .device = device,
                                    .scene_triangles = WATCH_SCENE_TRIANGLES,
                                    .report = &app_report_seconds};
    for (uint32_t i = 0; i < cfg->n_links; i++)
        options.waits |= cfg->link[i].type == LINK_WEB && cfg->link[i].waits == LINK_WAITS_YES;
    if (!has_page(cfg)) return SH_OK;
    if (options.waits && cfg->loop.pace != PACE_REALTIME) options.cpu_share = 0.0;
    const int rc = page->open(cfg, site, &options, watch, err);
    if (rc != SH_OK) return rc;
    loop->extra = page->link(*watch);
    loop->web = page->source(*watch);
    return page->start(*watch, err);
}

/* A journal begins with commands for the stored settings. So its replay reads no settings file, which may have changed
 * since. */
static int open_settings(struct run_options *o, const struct config *cfg, struct sh_err *err)
{
    if (o->device.replay != NULL)
        app_warn_settings_file(cfg, "the journal that is replayed has the settings");
    else if (cfg->head.settings_file[0] != '\0')
        return settings_file_open(cfg->head.settings_file, cfg->profile.name, &app_report_stderr, &o->device.settings,
                                  err);
    return SH_OK;
}

static int run_head(struct config *cfg, void *ctx, struct sh_err *err)
{
    struct run_options *o = ctx;
    struct sh_err why;
    struct watch *watch = NULL;
    struct site *site = NULL;
    struct device *device = NULL;
    struct loop *loop = NULL;
    struct loop_options options = {.hash = o->stats != NULL && !o->no_hash, .report = &app_report_stderr};
    o->device.report = &app_report_stderr;
    o->device.start |= cfg->head.start;
    o->device.one_scan = app_is_given(&o->in, "frames") && o->device.start;
    int rc = run_complete_links(o, cfg, err);
    if (rc != SH_OK) return rc;
    /* The page looks at triangles one by one, so copies of meshes are written out as triangles for it. */
    rc = site_load_for(cfg, has_page(cfg) ? SITE_WRITTEN_OUT : SITE_FOR_SCANS, NULL, &app_report_stderr, &site, err);
    if (rc == SH_OK && o->surfaces != NULL) rc = surfaces_write(o->surfaces, site, err);
    if (rc == SH_OK) rc = site_open_sights(site, 0, site->n_stations, &app_report_stderr, err);
    /* The plan above is made for head.frames of the configuration, and only now the scan gets no end. So a journal of
     * this run gives the same plan and the same stream when it is replayed without --start. */
    if (o->device.start && o->device.duration_s > 0.0 && !o->frames_given) cfg->head.settings.frames = 0;
    if (rc == SH_OK) rc = site_warn_rate(site, &app_report_stderr, err);
    if (rc == SH_OK) rc = open_settings(o, cfg, err);
    if (rc == SH_OK) rc = device_create(site, &o->device, &device, err);
    if (rc == SH_OK) rc = open_watch(cfg, site, device, &options, &watch, err);
    if (rc == SH_OK) rc = loop_create(site, device, &options, &loop, err);
    if (rc == SH_OK) {
        if (!o->quiet) say_what_runs(cfg, site, loop);
        if (!o->quiet) say_stored(cfg, o->device.settings);
        warn_of_replay(o, device);
        rc = run_serve(o, loop, err);
        say_short_scan(o, device);
    }
    loop_free(loop);
    if (watch != NULL) page->close(watch);
    device_free(device);
    rc = app_and_also(rc, settings_file_close(o->device.settings, &why), &why, err);
    site_free(site);
    return rc;
}

/* Whether the command line gives head.frames, by --frames or by --set. */
static int gives_frames(const struct app_sets *sets)
{
    static const char key[] = "head.frames=";
    for (int i = 0; i < sets->n; i++)
        if (strncmp(sets->set[i], key, sizeof key - 1) == 0) return 1;
    return 0;
}

static int run_run(int argc, char **argv)
{
    struct run_options o = {0};
    int status = app_parse(&app_run, argc, argv, &o.in, &o);
    if (status != APP_GO_ON) return status;
    o.frames_given = gives_frames(&o.in.sets);
    const char *path = o.in.operand[0];
    const enum run_kind kind = app_ends_in(path, ".pcap") || capture_is(path) ? RUN_CAPTURE
                               : app_is_recording(path)                       ? RUN_RECORDING
                                                                              : RUN_HEAD;
    status = run_check_options(&o, kind);
    if (status != APP_GO_ON) return status;
    app_catch_signals();
    if (kind == RUN_CAPTURE) return run_capture(&o);
    return kind == RUN_RECORDING ? run_replay(&o) : app_with_config(&o.in, run_head, &o);
}

static const char *const UNKNOWN[] = {[TALK_SILENCE] = "silence", [TALK_ERROR] = "error", [TALK_CLOSE] = "close"};

#define AT(member) offsetof(struct run_options, member)

/* clang-format off */
static const struct app_option OPTIONS[] = {
    {APP_FLAG, "start", NULL, .at = AT(device.start), .help = "scan at once, without a command"},
    {APP_FLAG, "view", NULL, .at = AT(view),
     .help = "serve a page for a browser, which shows the scan and sets the head; its address is printed. It uses a "
             "web link of the configuration if there is one. A page that is opened later shows the points so far: the "
             "head keeps the last 10 million points, in up to 320 MiB"},
    {APP_KEY, "pace", "PACE", .key = "loop.pace",
     .help = "realtime, fast (as fast as it computes), step (a peer grants time with TIME:STEP)"},
    {APP_NUMBER, "duration", "S", .min = 0.001, .max = 1e8, .at = AT(device.duration_s),
     .help = "end after S seconds of device time, counted from power-up. With --start they count from the first "
             "scan's start, or from a self-test that fails before it. The scan continues until then, frame after "
             "frame, and head.frames of the file is not used. Without --duration and --frames the head runs until it "
             "is stopped"},
    {APP_KEY, "frames", "N", .key = "head.frames",
     .help = "frames per scan; with --start, end after the first scan, even before --duration"},
    {APP_KEY, "threads", "N", .key = "loop.threads", .help = "threads that cast; 0: one per processor"},
    OPTION_SET,
    {APP_TEXT, "stats", "FILE", .at = AT(stats), .file = APP_FILLS,
     .help = "write statistics as JSON at the end, lateness with percentiles and a histogram; - is standard output"},
    OPTION_NO_HASH(AT(no_hash)),
    {APP_TEXT, "journal", "FILE", .at = AT(device.journal), .file = APP_FILLS,
     .help = "write every command that had an effect, and a live platform's poses, with their device times, and "
             "the end"},
    {APP_TEXT, "scenario", "FILE", .at = AT(in.scenario), .file = APP_READS,
     .help = "add the faults of this file to those of the configuration; a bare name is one of config/faults"},
    {APP_TEXT, "truth", "FILE", .at = AT(device.truth), .file = APP_FILLS,
     .help = "write each fault that is injected as a line of JSON; - is standard output"},
    {APP_TEXT, "surfaces", "FILE", .at = AT(surfaces), .file = APP_FILLS,
     .help = "write the surfaces as CSV: label, object, material, IFC type and GlobalId, colour; - is standard output"},
    {APP_TEXT, "replay-journal", "FILE", .at = AT(device.replay), .file = APP_READS,
     .help = "carry out the commands of a journal at their times, and end when its run ended"},
    {APP_OUTPUT, "ready-fd", "N", .min = 1, .max = 65535, .at = AT(ready_fd),
     .help = "write one JSON line with the endpoints to descriptor N once all links are open"},
    {APP_NUMBER, "speed", "F", .min = 0.001, .max = 1000, .at = AT(replay.speed),
     .help = "replay a recording F times as fast, in the pace realtime (default 1)"},
    {APP_NUMBER, "from", "S", .min = 0.0, .max = 1e9, .at = AT(replay.from_s),
     .help = "begin a recording S seconds of device time after its first frame"},
    {APP_NUMBER, "to", "S", .min = 0.001, .max = 1e9, .at = AT(replay.to_s),
     .help = "end a recording S seconds after its first frame"},
    {APP_WHOLE, "clients", "N", .min = 1, .max = 64, .at = AT(clients),
     .help = "with --start, begin a recording once N clients are connected"},
    {APP_FLAG, "loop", NULL, .at = AT(replay.loop), .help = "repeat a recording from its beginning at its end"},
    {APP_CALL, "link", "LINK", .apply = run_take_link,
     .help = "serve a recording on this link: pty, tcp, usb, web, file or null; or keys as in a configuration, such "
             "as 'type: tcp, port: 5025'; may be repeated (default: pty and tcp). A capture has links of tcp, pty and "
             "udp, such as 'type: udp, port: 2368' (default: one for each port of its devices)"},
    {APP_CHOICE, "unknown", "WORD", .at = AT(replay.talk_options.unknown), OPTION_CHOICES(UNKNOWN),
     .help = "what a capture does with a request that is not in it: silence (default), error (the protocol's own, of CoLa "
             "and SCIP), close"},
    {APP_WHOLE, "device-port", "N", .min = 1, .max = 65535, .at = AT(device_port),
     .help = "serve only this port of the device in a capture; with UDP, the port that it sent to"},
    {APP_TEXT, "config", "CONFIG", .at = AT(config), .file = APP_READS,
     .help = "for a recording, use links, loop and faults of this configuration; its scene is not loaded"},
    {APP_FLAG, "quiet", NULL, .at = AT(quiet), .help = "print only errors and warnings"},
    OPTION_END
};
/* clang-format on */

static const char NOTES[] =
    "Ctrl-C or SIGTERM ends the head with all files complete, and so does SIGHUP from a terminal that closes. A\n"
    "second Ctrl-C or SIGTERM within a second counts as the same one. A third ends the head at once, and so does a\n"
    "second one after more than a second. Under nohup, SIGHUP stays ignored.\n"
    "\n"
    "As a service (systemd, Type=notify) it sends READY=1 to $NOTIFY_SOCKET once all links are open, and STOPPING=1\n"
    "when its end begins.\n"
    "\n"
    "A recording, FILE.shs or FILE.pcapng, may take the place of CONFIG. Its frames are served with their recorded\n"
    "timing: unchanged, or translated where the link has another protocol. They begin each time that a client\n"
    "commands SCAN:STARt, or starts scans in that protocol. With --start they are served at once, and the run ends\n"
    "with them. Queries are answered from the recording's descriptor; settings can't change. Faults on the wire and\n"
    "of links apply.\n"
    "\n"
    "A capture of any device's traffic may also take the place of CONFIG: FILE.pcap or FILE.pcapng of tcpdump,\n"
    "Wireshark or record --raw. Each port of the device then has a link: a TCP port of this machine, or datagrams\n"
    "to the port that it sent to. A client's requests are answered by what the device answered to the same bytes.\n";

const struct app_command app_run = {
    .name = "run",
    .operand = {"CONFIG|FILE.shs|FILE.pcap"},
    .summary = "serve the head, or a recording of one, on links until stopped",
    .options = OPTIONS,
    .opens_links = 1,
    .notes = NOTES,
    .run = run_run,
};
