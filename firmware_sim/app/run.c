/* scanhead run: serve the head. */
#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "firmware_sim/base/clock.h"
#include "firmware_sim/app/app.h"
#include "firmware_sim/site/plan_rows.h"
#include "firmware_sim/site/rate.h"

static const char HELP[] =
    "scanhead run CONFIG [options]: serve the head on its links until stopped\n\n"
    "  --start                scan at once, no command needed\n"
    "  --pace PACE            realtime, fast (as fast as it computes), step (a peer grants time with TIME:STEP)\n"
    "  --duration S           end after S seconds of device time: of scanning with --start, else since power-up\n"
    "  --frames N             frames per scan; with --start, end after the first scan\n"
    "  --threads N            casters; 0: one per processor\n"
    "  --set KEY=VALUE        any configuration key; may be repeated\n"
    "  --stats FILE           write statistics as JSON at the end; - is standard output\n"
    "  --journal FILE         write every command that had an effect, with its device time\n"
    "  --replay-journal FILE  carry out the commands of a journal at their times\n"
    "  --ready-fd N           write one JSON line with the endpoints to descriptor N once all links are open\n"
    "  --quiet                no messages but errors and warnings\n";

struct run_options {
    struct app_sets sets;
    struct device_options device;
    const char *config, *stats;
    long ready_fd;
    int quiet;
};

enum {
    OPT_START = 256,
    OPT_PACE,
    OPT_DURATION,
    OPT_FRAMES,
    OPT_THREADS,
    OPT_SET,
    OPT_STATS,
    OPT_JOURNAL,
    OPT_REPLAY,
    OPT_READY,
    OPT_QUIET
};

static const struct option OPTIONS[] = {{"start", no_argument, NULL, OPT_START},
                                        {"pace", required_argument, NULL, OPT_PACE},
                                        {"duration", required_argument, NULL, OPT_DURATION},
                                        {"frames", required_argument, NULL, OPT_FRAMES},
                                        {"threads", required_argument, NULL, OPT_THREADS},
                                        {"set", required_argument, NULL, OPT_SET},
                                        {"stats", required_argument, NULL, OPT_STATS},
                                        {"journal", required_argument, NULL, OPT_JOURNAL},
                                        {"replay-journal", required_argument, NULL, OPT_REPLAY},
                                        {"ready-fd", required_argument, NULL, OPT_READY},
                                        {"quiet", no_argument, NULL, OPT_QUIET},
                                        {"help", no_argument, NULL, 'h'},
                                        {NULL, 0, NULL, 0}};

static int parse_option(struct run_options *o, int opt, char **argv)
{
    switch (opt) {
    case OPT_START:
        o->device.start = 1;
        return APP_OK;
    case OPT_PACE:
        return app_add_key(&o->sets, "loop.pace", optarg);
    case OPT_DURATION:
        return app_parse_double("run", "--duration", optarg, 0.001, 1e8, &o->device.duration_s);
    case OPT_FRAMES:
        o->device.one_scan = 1;
        return app_add_key(&o->sets, "head.frames", optarg);
    case OPT_THREADS:
        return app_add_key(&o->sets, "loop.threads", optarg);
    case OPT_SET:
        return app_add_set(&o->sets, optarg);
    case OPT_STATS:
        o->stats = optarg;
        return APP_OK;
    case OPT_JOURNAL:
        o->device.journal = optarg;
        return APP_OK;
    case OPT_REPLAY:
        o->device.replay = optarg;
        return APP_OK;
    case OPT_READY:
        return app_parse_long("run", "--ready-fd", optarg, 1, 65535, &o->ready_fd);
    case OPT_QUIET:
        o->quiet = 1;
        return APP_OK;
    default:
        return app_bad_option("run", opt, argv);
    }
}

/* Returns -1 to go on, else the exit status. */
static int parse(struct run_options *o, int argc, char **argv)
{
    int opt;
    opterr = 0;
    while ((opt = getopt_long(argc, argv, ":h", OPTIONS, NULL)) != -1) {
        if (opt == 'h') {
            fputs(HELP, stdout);
            return APP_OK;
        }
        int status = parse_option(o, opt, argv);
        if (status != APP_OK) return status;
    }
    if (optind != argc - 1) return app_usage("run", "one CONFIG is needed");
    o->config = argv[optind];
    return -1;
}

static void say_what_runs(const struct config *cfg, const struct site *site, const struct loop *loop)
{
    struct bvh_info info;
    bvh_get_info(site->station[0].bvh, &info);
    fprintf(stderr,
            "scanhead: %s %s, %s, %u triangles, %u surfaces; BVH in %.2f s, %.0f bytes per triangle, packets of %u\n",
            cfg->profile.maker, cfg->profile.model, cfg->profile.name, site->scene->n_triangles,
            site->scene->n_surfaces, info.build_s, (double)info.bytes / site->scene->n_triangles, info.packet);
    char endpoint[512];
    site_plan_text(site, endpoint, sizeof endpoint);
    fprintf(stderr, "scanhead: plan: %s\n", endpoint);
    for (uint32_t i = 0; loop_endpoint(loop, i, endpoint, sizeof endpoint); i++)
        fprintf(stderr, "scanhead: link %s\n", endpoint);
}

static int say_ready(const struct loop *loop, long fd, struct sh_err *err)
{
    if (fd == 0) return SH_OK;
    FILE *out = fdopen(dup((int)fd), "w");
    if (out == NULL) return sh_fail(err, SH_EINPUT, "--ready-fd %ld: %s", fd, strerror(errno));
    loop_print_endpoints(loop, out);
    int failed = fclose(out);
    close((int)fd);
    return failed ? sh_fail(err, SH_EIO, "--ready-fd %ld: %s", fd, strerror(errno)) : SH_OK;
}

static void wait_for_end(struct loop *loop)
{
    int ending = 0;
    while (!loop_is_over(loop)) {
        if (app_interrupted && !ending) {
            ending = 1;
            loop_end(loop);
        }
        poll(NULL, 0, 20); /* ends early on a signal */
    }
}

static int serve(const struct run_options *o, struct loop *loop, struct device *device, struct sh_err *err)
{
    struct app_stats stats;
    int rc = loop_start(loop, err);
    if (rc == SH_OK) rc = say_ready(loop, o->ready_fd, err);
    if (rc == SH_OK)
        wait_for_end(loop);
    else
        loop_end(loop);
    loop_join(loop, &stats.loop);
    stats.cpu_s = clock_cpu_s();
    if (rc == SH_OK && o->stats != NULL) rc = app_write_stats(o->stats, &stats, err);
    if (rc == SH_OK) rc = device_close_journal(device, err);
    if (rc == SH_OK) rc = loop_check_links(loop, err);
    if (stats.loop.lost_pulses != 0)
        fprintf(stderr, "scanhead: warning: %llu pulses could not be computed in time\n",
                (unsigned long long)stats.loop.lost_pulses);
    app_warn_left_out(stats.loop.crowded, stats.loop.unfit);
    if (stats.loop.reader_lost_frames != 0)
        fprintf(stderr, "scanhead: warning: readers lost %llu frames\n",
                (unsigned long long)stats.loop.reader_lost_frames);
    return rc;
}

static int run_with(const struct run_options *o, const struct config *cfg, struct sh_err *err)
{
    struct site *site = NULL;
    struct device *device = NULL;
    struct loop *loop = NULL;
    struct loop_options options = {.hash = o->stats != NULL, .report = &app_report_stderr};
    int rc = site_load(cfg, &app_report_stderr, &site, err);
    if (rc == SH_OK) rc = site_warn_rate(site, &app_report_stderr, err);
    if (rc == SH_OK) rc = device_create(site, &o->device, &device, err);
    if (rc == SH_OK) rc = loop_create(site, device, &options, &loop, err);
    if (rc == SH_OK) {
        if (!o->quiet) say_what_runs(cfg, site, loop);
        rc = serve(o, loop, device, err);
    }
    loop_free(loop);
    device_free(device);
    site_free(site);
    return rc;
}

int app_run(int argc, char **argv)
{
    struct run_options o;
    memset(&o, 0, sizeof o);
    int status = parse(&o, argc, argv);
    if (status >= 0) return status;
    o.device.one_scan = o.device.one_scan && o.device.start;
    struct config *cfg = app_load_config(o.config, &o.sets, &status);
    if (cfg == NULL) return status;
    app_catch_signals();
    struct sh_err err = {0};
    int rc = cfg->n_links == 0
                 ? sh_fail(&err, SH_EINPUT, "%s: links: none; run needs at least one of pty, tcp, usb, file, null",
                           cfg->file)
                 : run_with(&o, cfg, &err);
    free(cfg);
    return rc == SH_OK ? APP_OK : app_fail(&err);
}
