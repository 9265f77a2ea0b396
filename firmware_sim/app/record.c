/* scanhead record: the points of scans to files. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "firmware_sim/app/app.h"
#include "firmware_sim/app/offline.h"
#include "firmware_sim/app/record_files.h"
#include "firmware_sim/app/recording.h"
#include "firmware_sim/base/clock.h"

enum { WAIT_MS = 1000 };

struct record {
    struct app_input in;
    const char *source, *stats;
    struct record_files files;
    int crs_given, quiet, no_hash;
    long station; /* 0: as the head is set; APP_WORD: all */
    double wait_s;
    struct sh_report notes;  /* of the recorders */
    int64_t reported_ns;     /* when their progress was printed last */
    struct offline *offline; /* of a configuration */
    int interrupted;         /* before the files were completed, which an interrupted recording does, too */
    struct recording_options recording;
};

/* A signal while files are completed. */
static int gives_up(void *ctx)
{
    const struct record *r = ctx;
    return app_interrupted() && !r->interrupted;
}

static int write_frame(void *ctx, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *err)
{
    struct record *r = ctx;
    return record_files_frame(&r->files, sh, frame, err);
}

static int prepare(void *ctx, uint32_t station, struct sh_err *err)
{
    struct record *r = ctx;
    return offline_prepare(r->offline, station, &app_report_stderr, err);
}

static void say_result(const struct record *r, const struct recording_result *result)
{
    char faint[64] = "";
    if (!r->recording.progress) return;
    if (result->faint != 0)
        snprintf(faint, sizeof faint, ", %llu hits not detected", (unsigned long long)result->faint);
    fprintf(stderr, "scanhead: %llu points, %llu shots without echo%s, %llu scans\n",
            (unsigned long long)result->points, (unsigned long long)result->empty, faint,
            (unsigned long long)result->counts.scans);
}

static void print_note(void *ctx, const char *text)
{
    (void)ctx;
    fprintf(stderr, "scanhead: %s\n", text);
}

/* Of completing a file: a line a second, and none for short work. */
static void print_completing(void *ctx, const char *what, double fraction)
{
    struct record *r = ctx;
    const int64_t now_ns = clock_now_ns();
    if (!r->recording.progress || now_ns - r->reported_ns < 1000000000) return;
    r->reported_ns = now_ns;
    sh_progress(&app_report_stderr, what, fraction);
}

/* Follows the scans. Files are closed and statistics written also after some failures; the first failure is
 * returned. */
static int follow(struct record *r, struct scanhead *sh, struct recording_result *result, struct sh_err *err)
{
    struct sh_err why = {0};
    int rc = recording_run(sh, &r->recording, result, err);
    const int has_figures = rc == SH_OK || rc == SH_ELOST || rc == SH_ERESET; /* the bus has cut the recording */
    const int keep = result->points != 0 || (rc == SH_OK && result->missing[0] == '\0');
    r->interrupted = app_interrupted();
    r->reported_ns = clock_now_ns();
    int after = record_files_close(&r->files, keep, &why);
    if (rc != SH_OK && after != SH_OK) sh_warn(&app_report_stderr, "%s", why.text);
    if (rc == SH_OK && after != SH_OK) rc = sh_fail(err, after, "%s", why.text);
    if (!has_figures || r->stats == NULL) return rc;
    after = app_write_json(r->stats, recording_put, result, &why);
    return rc == SH_OK && after != SH_OK ? sh_fail(err, after, "%s", why.text) : rc;
}

static void warn_of_little(const struct record *r, const struct recording_result *result)
{
    const uint64_t pulses = result->counts.pulses;
    if (result->empty <= pulses) app_warn_empty(pulses, pulses - result->empty, result->faint);
    if (r->files.recorder.colour == COLOUR_REFLECTANCE && result->points != 0 && result->with_reflectance == 0)
        sh_warn(&app_report_stderr,
                "--colour reflectance: none of %llu points has one, all have the colour for that; it needs the head's "
                "signal.model: on",
                (unsigned long long)result->points);
}

static int record(struct record *r, struct scanhead *sh, struct sh_err *err)
{
    struct recording_result result = {0};
    r->recording.hash = r->stats != NULL && !r->no_hash;
    r->notes = (struct sh_report){r, print_note, print_completing, gives_up};
    r->files.recorder.report = &r->notes;
    int rc = record_files_open(&r->files, err);
    if (rc != SH_OK) {
        record_files_close(&r->files, 0, NULL);
        return rc;
    }
    r->recording.frame = write_frame;
    r->recording.ctx = r;
    r->recording.interrupted = app_interrupted;
    r->recording.report = &app_report_stderr;
    rc = follow(r, sh, &result, err);
    if (rc == SH_OK || result.points != 0) say_result(r, &result);
    app_warn_left_out(result.crowded, result.unfit);
    if (rc == SH_OK) warn_of_little(r, &result);
    return rc == SH_OK ? recording_check_complete(&result, err) : rc;
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

/* --crs takes the layout geo along: polar points are in no CRS. */
static int set_layout(const struct record *r, struct config *cfg, struct sh_err *err)
{
    if (!r->crs_given || cfg->output.layout == LINE_GEO) return SH_OK;
    if (cfg->output.layout_given)
        return sh_fail(
            err, SH_EINPUT,
            "%s: output.layout is polar, and polar recordings are in the scene frame; with --crs only geo is "
            "allowed: --set output.layout=geo",
            cfg->file);
    cfg->output.layout = LINE_GEO;
    return SH_OK;
}

/* Off line a scan must end by itself, and nobody sends poses. */
static int check_can_end(const struct record *r, const struct config *cfg, struct sh_err *err)
{
    const long frames = r->recording.frames >= 0 ? r->recording.frames : (long)cfg->head.settings.frames;
    const int arrives = cfg->platform.kind == PLATFORM_TRAJECTORY && cfg->platform.at_end == PLATFORM_STOP;
    if (cfg->platform.kind == PLATFORM_LIVE)
        return sh_fail(err, SH_EINPUT,
                       "%s: platform.kind: a live platform can't be recorded off line; run it, and record its link",
                       cfg->file);
    if (frames == 0 && !arrives && !(r->recording.duration_s > 0.0))
        return sh_fail(err, SH_EINPUT, "%s: head.frames is 0, a scan without end; give --frames or --duration",
                       cfg->file);
    return SH_OK;
}

static int record_config(struct config *cfg, void *ctx, struct sh_err *err)
{
    struct record *r = ctx;
    struct offline offline = {0};
    int rc = check_can_end(r, cfg, err);
    if (rc == SH_OK) rc = set_layout(r, cfg, err);
    if (rc == SH_OK && cfg->output.layout == LINE_GEO && cfg->output.crs == GEOREF_GEODETIC)
        rc = record_files_check_degrees(&r->files, err);
    if (rc == SH_OK) rc = record_files_check_emitter(&r->files, cfg->profile.emitter.kind, err);
    if (rc == SH_OK) rc = offline_open(cfg, r->recording.duration_s, &app_report_stderr, &offline, err);
    r->recording.head_ends = 1;
    r->recording.prepare = prepare;
    r->offline = &offline;
    if (rc == SH_OK && r->station == APP_WORD) {
        r->recording.first_station = 1;
        r->recording.last_station = offline.site->n_stations;
    }
    if (rc == SH_OK) rc = record(r, offline.sh, err);
    offline_close(&offline);
    return rc;
}

/* Waits for the source in parts of WAIT_MS: a signal that comes just before a part is seen after it. */
static int open_stream(const struct record *r, struct scanhead **sh, char *why, size_t len)
{
    const int64_t end_ns = clock_now_ns() + (int64_t)(1e9 * r->wait_s);
    for (;;) {
        int64_t left_ms = (end_ns - clock_now_ns()) / 1000000;
        if (left_ms < 0) left_ms = 0;
        if (left_ms > WAIT_MS) left_ms = WAIT_MS;
        int rc = scanhead_open_within(r->source, (int)left_ms, sh, why, len);
        int may_come =
            rc != SCANHEAD_OK && rc != SCANHEAD_ENOMEM && (rc != SCANHEAD_EINPUT || strncmp(r->source, "tty:", 4) == 0);
        if (!may_come || clock_now_ns() >= end_ns || app_interrupted()) return rc;
    }
}

static int record_stream(struct record *r, struct sh_err *err)
{
    struct scanhead *sh = NULL;
    char why[512];
    int rc = open_stream(r, &sh, why, sizeof why);
    if (rc != SCANHEAD_OK) return sh_fail(err, rc, "%s", why);
    struct stat st;
    if (ends_in(r->source, ".shs")) r->recording.listen = 1;
    if (r->recording.listen && stat(r->source, &st) == 0 && S_ISREG(st.st_mode))
        r->recording.source_bytes = (uint64_t)st.st_size;
    if (r->station == APP_WORD && !r->recording.listen) {
        char reply[512];
        rc = scanhead_command(sh, "HEAD:STATION? MAX", reply, sizeof reply, 5000);
        r->recording.first_station = 1;
        if (rc != SCANHEAD_OK || sscanf(reply, "%u", &r->recording.last_station) != 1)
            rc = sh_fail(err, SH_EIO, "%s: no number of stations: %s", r->source,
                         rc == SCANHEAD_OK ? reply : scanhead_error(sh));
    }
    if (rc == SH_OK) rc = record(r, sh, err);
    scanhead_close(sh);
    return rc;
}

static int take_file(void *values, const char *text)
{
    struct record *r = values;
    struct sh_err err = {0};
    return record_files_add(&r->files, text, &err) == SH_OK ? APP_OK : app_fail(&err);
}

/* The index of a word; APP_USAGE with the reason printed. */
static int take_word(const char *option, const char *const *words, int n, const char *text, int *index)
{
    char allowed[64] = "";
    for (*index = 0; *index < n; ++*index) {
        if (strcmp(text, words[*index]) == 0) return APP_OK;
        snprintf(allowed + strlen(allowed), sizeof allowed - strlen(allowed), "%s%s", *index > 0 ? ", " : "",
                 words[*index]);
    }
    return app_usage(&app_record, "--%s %s: allowed are %s", option, text, allowed);
}

static int take_colour(void *values, const char *text)
{
    static const char *const words[] = {
        [COLOUR_NONE] = "none", [COLOUR_REFLECTANCE] = "reflectance", [COLOUR_LABEL] = "label"};
    struct record *r = values;
    int i, status = take_word("colour", words, 3, text, &i);
    if (status == APP_OK) r->files.recorder.colour = (enum colour_kind)i;
    return status;
}

static int take_ply_names(void *values, const char *text)
{
    static const char *const words[] = {"scanhead", "cloudcompare"};
    return take_word("ply-names", words, 2, text, &((struct record *)values)->files.recorder.scalar_names);
}

static int take_las_version(void *values, const char *text)
{
    static const char *const words[] = {"1.2", "1.4"};
    int i, status = take_word("las-version", words, 2, text, &i);
    if (status == APP_OK) ((struct record *)values)->files.recorder.las_minor = 2 + 2 * i;
    return status;
}

/* An option that is for none of the files is a mistake. */
static int check_options(const struct record *r)
{
    const struct recorder_options *o = &r->files.recorder;
    const int ply = record_files_have(&r->files, ".ply"), las = record_files_have(&r->files, ".las");
    const char *option = o->scalar_names && !ply                    ? "--ply-names: no .ply"
                         : o->las_minor != 0 && !las                ? "--las-version: no .las"
                         : o->colour != COLOUR_NONE && !ply && !las ? "--colour: no .ply or .las"
                                                                    : NULL;
    return option == NULL ? APP_OK : app_usage(&app_record, "%s is among the files", option);
}

static int run(int argc, char **argv)
{
    struct sh_err err = {0};
    struct record r = {.recording = {.frames = -1}};
    int status = app_parse(&app_record, argc, argv, &r.in, &r);
    if (status != APP_GO_ON) return status;
    if (r.files.n == 0 && r.stats == NULL) return app_usage(&app_record, "-o FILE is needed");
    if (check_options(&r) != APP_OK) return APP_USAGE;
    r.source = r.in.operand[0];
    r.recording.progress = !r.quiet;
    if (r.station > 0) r.recording.first_station = r.recording.last_station = (uint32_t)r.station;
    app_catch_signals();
    if (is_config(r.source)) return app_with_config(&r.in, record_config, &r);
    if (!is_stream(r.source))
        return app_usage(&app_record,
                         "SOURCE %s: allowed usb, usb:VID:PID:SERIAL, tty:PATH, tcp:HOST:PORT, FILE.shs, CONFIG.yaml",
                         r.source);
    if (r.in.sets.n != 0) return app_usage(&app_record, "--set, --crs and --threads need a CONFIG as SOURCE");
    return record_stream(&r, &err) == SH_OK ? APP_OK : app_fail(&err);
}

#define AT(member) offsetof(struct record, member)

/* clang-format off */
static const struct app_option OPTIONS[] = {
    {APP_CALL, "output", "FILE", .letter = 'o', .apply = take_file, .help = "where to write; may be repeated"},
    {APP_WHOLE, "station", "N|all", .min = 1, .max = CONFIG_MAX_STOPS, .word = "all", .at = AT(station),
     .help = "scan from station N, or from all one after the other into the same files"},
    {APP_WHOLE, "frames", "N", .min = 0, .max = HEAD_MAX_FRAMES, .at = AT(recording.frames),
     .help = "frames per scan; 0: without end"},
    {APP_NUMBER, "duration", "S", .min = 0.001, .max = 1e8, .at = AT(recording.duration_s),
     .help = "end each scan after S seconds of device time: of a CONFIG to the pulse, of a head on a wire as "
             "soon as it takes the command"},
    {APP_FLAG, "split", NULL, .at = AT(files.split),
     .help = "each scan to files of its own: NAME-1.las, NAME-2.las, ..., in the order of scans"},
    {APP_FLAG, "listen", NULL, .at = AT(recording.listen),
     .help = "send no command: record what comes until the stream ends or Ctrl-C"},
    {APP_NUMBER, "wait", "S", .min = 0.0, .max = 1e8, .at = AT(wait_s),
     .help = "wait up to S seconds for SOURCE to be there"},
    {APP_NUMBER, "replug", "S", .min = 0.0, .max = 1e8, .at = AT(recording.replug_s),
     .help = "when the head is unplugged, wait up to S seconds for it and go on in the same files"},
    {APP_FLAG, "ascii", NULL, .at = AT(files.recorder.ascii), .help = "PLY as text"},
    {APP_CALL, "ply-names", "WHOSE", .apply = take_ply_names,
     .help = "scanhead: range, time, ... (the default), or cloudcompare: scalar_range, scalar_time, ..., which it shows"},
    {APP_CALL, "colour", "BY", .apply = take_colour,
     .help = "reflectance (grey, -30 to 0 dB) or label (a hue per surface): .ply and .las with red, green, blue"},
    {APP_CALL, "las-version", "1.2|1.4", .apply = take_las_version,
     .help = "of .las; 1.2 is for older readers and holds no labels, five returns of a pulse (default 1.4)"},
    {APP_FLAG, "empty-shots", NULL, .at = AT(files.recorder.empty_shots),
     .help = "keep shots without echo: .ply with NaN coordinates, .e57 with its invalid state"},
    {APP_TEXT, "stats", "FILE", .at = AT(stats), .help = "write what was received as JSON; - is standard output"},
    OPTION_NO_HASH(AT(no_hash)),
    OPTION_SET,
    {APP_KEY_GIVEN, "crs", "CRS", .key = "output.crs", .at = AT(crs_given),
     .help = "local, ecef, utm or geodetic: write points in it, as output.layout=geo does, too"},
    {APP_KEY, "threads", "N", .key = "loop.threads", .help = "threads that cast; 0: one per processor"},
    {APP_FLAG, "quiet", NULL, .at = AT(quiet), .help = "no progress"},
    OPTION_END
};
/* clang-format on */

static const char HELP_NOTES[] =
    "SOURCE is one of\n"
    "\n"
    "  CONFIG               a configuration: the head runs off line in this process, as fast as it computes.\n"
    "                       Only with it: --set, --crs, --threads\n"
    "  usb                  a head on USB, as scanhead list shows it; more exactly usb:vid:pid or\n"
    "                       usb:vid:pid:serial\n"
    "  tty:/dev/...         a serial port\n"
    "  tcp:host:port        a socket\n"
    "  FILE.shs             a raw stream\n"
    "\n"
    "The ending of FILE says what is written:\n"
    "\n"
    "  .ply                 points, binary or text, with double coordinates, label and station\n"
    "  .las                 LAS 1.4, point format 6 (7 with --colour): points with CRS, time, returns, label;\n"
    "                       station as point source ID\n"
    "  .ptx                 a grid per scan, with the scan's pose; shots without echo are in it\n"
    "  .e57                 points of each scan, with its pose\n"
    "  .poses.csv           true position and orientation of each scan, or a moving head's trajectory\n"
    "  .shs                 the raw stream\n"
    "  .pcapng              the stream's frames as packets, for capinfos and tshark\n"
    "\n"
    ".ply and .las hold amplitude and width of the echoes where the head sends them (output.attributes). Several\n"
    "scans go into one file, in one coordinate system: that of the stream (geo layout), or the scene's (polar\n"
    "layout).\n"
    "\n"
    "Exit status 1: the recording is not complete. One of these happened:\n"
    "\n"
    "  The stream ended before the scan did.\n"
    "  Ctrl-C came before a scan with an end had its end (not with --listen).\n"
    "  Frames or pulses were lost on the way.\n"
    "  The head was away within a scan.\n"
    "\n"
    "FILE keeps what came.\n"
    "\n"
    "Ctrl-C, or SIGTERM, ends a recording in good order. A second signal within a second counts as the same one;\n"
    "a third, or one that comes later, ends it at once.\n";

const struct app_command app_record = {
    .name = "record",
    .operand = {"SOURCE"},
    .needs = "-o FILE",
    .summary = "write the points of a scan to files",
    .options = OPTIONS,
    .notes = HELP_NOTES,
    .run = run,
};
