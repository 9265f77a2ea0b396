/* scanhead record: points of a scan to files. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "firmware_sim/base/clock.h"
#include "firmware_sim/app/app.h"
#include "firmware_sim/app/record_files.h"
#include "firmware_sim/app/record_result.h"
#include "firmware_sim/app/recording.h"

static const char HELP[] =
    "scanhead record SOURCE -o FILE [-o FILE ...] [options]: write the points of a scan to files\n\n"
    "SOURCE is usb, usb:vid:pid, usb:vid:pid:serial (scanhead list shows them), tty:/dev/..., tcp:host:port, FILE.shs\n"
    "(a raw stream), or a CONFIG: then the head runs off line in this process, as fast as it computes. FILE says by "
    "its\n"
    "ending what is written:\n\n"
    "  .ply        points, binary or text, with double coordinates, label and station\n"
    "  .las        LAS 1.4, point format 6: points with CRS, time, returns, label; station as point source ID\n"
    "              (both with amplitude and width of the echoes, where the head sends them: output.attributes)\n"
    "  .ptx        a grid per scan, with the scan's pose; shots without echo are in it\n"
    "  .e57        E57: points of each scan, with its pose\n"
    "  .poses.csv  true position and orientation of each scan, or a moving head's trajectory\n"
    "  .shs        the raw stream\n"
    "  .pcapng     the stream's frames as packets, for capinfos and tshark\n\n"
    "Several scans go into one file, in one coordinate system: that of the stream (geo layout), or the scene's (polar\n"
    "layout).\n\n"
    "  -o FILE          where to write; may be repeated\n"
    "  --station N|all  scan from station N, or from all one after the other into the same files\n"
    "  --frames N       frames per scan\n"
    "  --duration S     stop each scan after S seconds of device time\n"
    "  --split          each scan to files of its own: NAME-1.las, NAME-2.las, ..., in the order of scans\n"
    "  --listen         send no command: record what comes until the stream ends or Ctrl-C\n"
    "  --wait S         wait up to S seconds for SOURCE to be there\n"
    "  --replug S       when the head is unplugged, wait up to S seconds for it and go on in the same files\n"
    "  --ascii          PLY as text\n"
    "  --empty-shots    keep shots without echo: .ply with NaN coordinates, .e57 with its invalid state\n"
    "  --stats FILE     write what was received as JSON; - is standard output\n"
    "  --set KEY=VALUE  any configuration key (CONFIG only); may be repeated\n"
    "  --crs CRS        local, ecef, utm or geodetic (CONFIG only): points in it, that is output.layout=geo, too\n"
    "  --threads N      casters (CONFIG only)\n"
    "  --quiet          no progress\n\n"
    "Exit status 1 when the recording is not complete: the stream ended before the scan did, Ctrl-C came before scans\n"
    "with an end had theirs (not with --listen), frames or pulses were lost on the way, or the head was away within a\n"
    "scan. What came is kept in FILE all the same.\n";

enum { WAIT_MS = 1000 };

enum {
    OPT_STATION = 256,
    OPT_FRAMES,
    OPT_DURATION,
    OPT_LISTEN,
    OPT_WAIT,
    OPT_REPLUG,
    OPT_ASCII,
    OPT_EMPTY,
    OPT_SPLIT,
    OPT_STATS,
    OPT_SET,
    OPT_CRS,
    OPT_THREADS,
    OPT_QUIET
};

static const struct option OPTIONS[] = {{"station", required_argument, NULL, OPT_STATION},
                                        {"frames", required_argument, NULL, OPT_FRAMES},
                                        {"duration", required_argument, NULL, OPT_DURATION},
                                        {"listen", no_argument, NULL, OPT_LISTEN},
                                        {"wait", required_argument, NULL, OPT_WAIT},
                                        {"replug", required_argument, NULL, OPT_REPLUG},
                                        {"ascii", no_argument, NULL, OPT_ASCII},
                                        {"empty-shots", no_argument, NULL, OPT_EMPTY},
                                        {"split", no_argument, NULL, OPT_SPLIT},
                                        {"stats", required_argument, NULL, OPT_STATS},
                                        {"set", required_argument, NULL, OPT_SET},
                                        {"crs", required_argument, NULL, OPT_CRS},
                                        {"threads", required_argument, NULL, OPT_THREADS},
                                        {"quiet", no_argument, NULL, OPT_QUIET},
                                        {"output", required_argument, NULL, 'o'},
                                        {"help", no_argument, NULL, 'h'},
                                        {NULL, 0, NULL, 0}};

struct record {
    const char *source, *stats;
    struct record_files files;
    int all_stations, crs_given;
    long station;
    double wait_s;
    struct app_sets sets;
    struct recording_options recording;
};

static int parse_station(struct record *r, const char *text)
{
    if (strcmp(text, "all") == 0) {
        r->all_stations = 1;
        return APP_OK;
    }
    return app_parse_long("record", "--station", text, 1, CONFIG_MAX_STOPS, &r->station);
}

static int add_file(struct record *r, const char *path)
{
    struct sh_err err = {0};
    return record_files_add(&r->files, path, &err) == SH_OK ? APP_OK : app_fail(&err);
}

static int parse_option(struct record *r, int opt, char **argv)
{
    switch (opt) {
    case 'o':
        return add_file(r, optarg);
    case OPT_STATION:
        return parse_station(r, optarg);
    case OPT_FRAMES:
        return app_parse_long("record", "--frames", optarg, 0, 1000000000, &r->recording.frames);
    case OPT_DURATION:
        return app_parse_double("record", "--duration", optarg, 0.001, 1e8, &r->recording.duration_s);
    case OPT_LISTEN:
        r->recording.listen = 1;
        return APP_OK;
    case OPT_WAIT:
        return app_parse_double("record", "--wait", optarg, 0, 1e8, &r->wait_s);
    case OPT_REPLUG:
        return app_parse_double("record", "--replug", optarg, 0, 1e8, &r->recording.replug_s);
    case OPT_ASCII:
        r->files.recorder.ascii = 1;
        return APP_OK;
    case OPT_EMPTY:
        r->files.recorder.empty_shots = 1;
        return APP_OK;
    case OPT_SPLIT:
        r->files.split = 1;
        return APP_OK;
    case OPT_STATS:
        r->stats = optarg;
        return APP_OK;
    case OPT_SET:
        return app_add_set(&r->sets, optarg);
    case OPT_CRS:
        r->crs_given = 1;
        return app_add_key(&r->sets, "output.crs", optarg);
    case OPT_THREADS:
        return app_add_key(&r->sets, "loop.threads", optarg);
    case OPT_QUIET:
        r->recording.progress = 0;
        return APP_OK;
    default:
        return app_bad_option("record", opt, argv);
    }
}

static int parse(struct record *r, int argc, char **argv)
{
    int opt;
    opterr = 0;
    while ((opt = getopt_long(argc, argv, ":ho:", OPTIONS, NULL)) != -1) {
        if (opt == 'h') {
            fputs(HELP, stdout);
            return APP_OK;
        }
        int status = parse_option(r, opt, argv);
        if (status != APP_OK) return status;
    }
    if (optind != argc - 1) return app_usage("record", "one SOURCE is needed");
    if (r->files.n == 0 && r->stats == NULL) return app_usage("record", "-o FILE is needed");
    r->source = argv[optind];
    return -1;
}

static int write_frame(void *ctx, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *err)
{
    struct record *r = ctx;
    return record_files_frame(&r->files, sh, frame, err);
}

static void say_result(const struct record *r, const struct recording_result *result)
{
    char faint[64] = "";
    if (!r->recording.progress) return;
    if (result->faint != 0)
        snprintf(faint, sizeof faint, ", %llu hits not detected", (unsigned long long)result->faint);
    fprintf(stderr, "scanhead: %llu points, %llu shots without echo%s, %llu scans\n",
            (unsigned long long)result->points, (unsigned long long)result->empty, faint,
            (unsigned long long)result->scans);
}

static void print_note(void *ctx, const char *text)
{
    (void)ctx;
    fprintf(stderr, "scanhead: %s\n", text);
}

static const struct sh_report NOTES = {NULL, print_note, NULL};

static int interrupted(void)
{
    return app_interrupted;
}

static int record(struct record *r, struct scanhead *sh, struct sh_err *err)
{
    struct recording_result result = {0};
    if (r->stats != NULL) scanhead_hash_start(sh);
    int rc = record_files_open(&r->files, err);
    if (rc != SH_OK) {
        record_files_close(&r->files, 0, NULL);
        return rc;
    }
    r->recording.frame = write_frame;
    r->recording.ctx = r;
    r->recording.interrupted = interrupted;
    r->recording.report = &app_report_stderr;
    int64_t start_ns = clock_now_ns();
    rc = recording_run(sh, &r->recording, &result, err);
    double wall_s = 1e-9 * (double)(clock_now_ns() - start_ns);
    struct sh_err why = {0};
    int closed = record_files_close(&r->files, result.points != 0 || (rc == SH_OK && result.missing[0] == '\0'), &why);
    if (rc == SH_OK && closed != SH_OK) rc = sh_fail(err, closed, "%s", why.text);
    int counts = rc == SH_OK || rc == SH_ELOST; /* also of a recording that an unplugged device has cut */
    if (counts && r->stats != NULL && (closed = record_write_stats(r->stats, sh, &result, wall_s, &why)) != SH_OK &&
        rc == SH_OK)
        rc = sh_fail(err, closed, "%s", why.text);
    if (rc == SH_OK || result.points != 0) say_result(r, &result);
    app_warn_left_out(result.crowded, result.unfit);
    return rc == SH_OK ? record_check_complete(sh, &result, err) : rc;
}

static int ends_in(const char *text, const char *ending)
{
    size_t n = strlen(text), m = strlen(ending);
    return n > m && strcmp(text + n - m, ending) == 0;
}

static int is_config(const char *source)
{
    return ends_in(source, ".yaml") || ends_in(source, ".yml");
}

static int is_stream(const char *source)
{
    return strcmp(source, "usb") == 0 || strncmp(source, "usb:", 4) == 0 || strncmp(source, "tty:", 4) == 0 ||
           strncmp(source, "tcp:", 4) == 0 || strncmp(source, "fd:", 3) == 0 || ends_in(source, ".shs");
}

/* Polar points are in no CRS. */
static int set_layout(const struct record *r, struct config *cfg, struct sh_err *err)
{
    if (!r->crs_given || cfg->output.layout == LINE_GEO) return SH_OK;
    if (cfg->output.layout_given)
        return sh_fail(
            err, SH_EINPUT,
            "%s: output.layout is polar, whose recordings are in the scene frame; with --crs allowed geo, as "
            "by --set output.layout=geo",
            cfg->file);
    cfg->output.layout = LINE_GEO;
    return SH_OK;
}

static int record_config(struct record *r, struct sh_err *err)
{
    int status = APP_OK;
    struct config *cfg = app_load_config(r->source, &r->sets, &status);
    if (cfg == NULL) return status;
    struct offline *offline = NULL;
    uint32_t frames = r->recording.frames >= 0 ? (uint32_t)r->recording.frames : cfg->head.settings.frames;
    int rc = SH_OK;
    int arrives = cfg->platform.kind == PLATFORM_TRAJECTORY && cfg->platform.at_end == PLATFORM_STOP;
    if (cfg->platform.kind == PLATFORM_LIVE)
        rc = sh_fail(err, SH_EINPUT,
                     "%s: platform.kind: a live platform can't be recorded off line; run it, and record its link",
                     cfg->file);
    if (rc == SH_OK && frames == 0 && !arrives && !(r->recording.duration_s > 0.0))
        rc =
            sh_fail(err, SH_EINPUT, "%s: head.frames is 0, a scan without end; give --frames or --duration", cfg->file);
    if (rc == SH_OK) rc = set_layout(r, cfg, err);
    if (rc == SH_OK && cfg->output.layout == LINE_GEO && cfg->output.crs == GEOREF_GEODETIC)
        rc = record_files_check_degrees(&r->files, err);
    if (rc == SH_OK) rc = offline_open(cfg, &app_report_stderr, &offline, err);
    if (rc == SH_OK && r->all_stations) {
        r->recording.first_station = 1;
        r->recording.last_station = offline_site(offline)->n_stations;
    }
    if (rc == SH_OK) rc = record(r, offline_scanhead(offline), err);
    offline_close(offline);
    free(cfg);
    return rc == SH_OK ? APP_OK : app_fail(err);
}

/* Waits for the source in parts: a signal just before one of them is seen after it. */
static int open_stream(const struct record *r, struct scanhead **sh, char *why, size_t len)
{
    const int64_t end_ns = clock_now_ns() + (int64_t)(1e9 * r->wait_s);
    for (;;) {
        const int64_t left_ms = (end_ns - clock_now_ns()) / 1000000;
        int rc = scanhead_open_within(r->source,
                                      left_ms < 0         ? 0
                                      : left_ms < WAIT_MS ? (int)left_ms
                                                          : WAIT_MS,
                                      sh, why, len);
        int may_come =
            rc != SCANHEAD_OK && rc != SCANHEAD_ENOMEM && (rc != SCANHEAD_EINPUT || strncmp(r->source, "tty:", 4) == 0);
        if (!may_come || clock_now_ns() >= end_ns || app_interrupted) return rc;
    }
}

static int record_stream(struct record *r, struct sh_err *err)
{
    struct scanhead *sh = NULL;
    char why[512];
    if (r->sets.n != 0) return app_usage("record", "--set, --crs and --threads need a CONFIG as SOURCE");
    int rc = open_stream(r, &sh, why, sizeof why);
    if (rc != SCANHEAD_OK) {
        sh_fail(err, rc, "%s", why);
        return app_fail(err);
    }
    if (ends_in(r->source, ".shs")) r->recording.listen = 1;
    if (r->all_stations && !r->recording.listen) {
        char reply[512];
        rc = scanhead_command(sh, "HEAD:STATION? MAX", reply, sizeof reply, 5000);
        r->recording.first_station = 1;
        if (rc != SCANHEAD_OK || sscanf(reply, "%u", &r->recording.last_station) != 1)
            rc = sh_fail(err, SH_EIO, "%s: no number of stations: %s", r->source,
                         rc == SCANHEAD_OK ? reply : scanhead_error(sh));
    }
    if (rc == SH_OK) rc = record(r, sh, err);
    scanhead_close(sh);
    return rc == SH_OK ? APP_OK : app_fail(err);
}

int app_record(int argc, char **argv)
{
    struct record r;
    memset(&r, 0, sizeof r);
    r.recording.frames = -1;
    r.recording.progress = 1;
    r.files.recorder.report = &NOTES;
    int status = parse(&r, argc, argv);
    if (status >= 0) return status;
    r.recording.first_station = r.recording.last_station = (uint32_t)r.station;
    app_catch_signals();
    struct sh_err err = {0};
    if (!is_config(r.source) && !is_stream(r.source))
        return app_usage("record",
                         "SOURCE %s: allowed usb, usb:VID:PID:SERIAL, tty:PATH, tcp:HOST:PORT, FILE.shs, CONFIG.yaml",
                         r.source);
    return is_config(r.source) ? record_config(&r, &err) : record_stream(&r, &err);
}
