/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/studio/record/job.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "core/of_file.h"
#include "firmware_sim/app/app.h"
#include "firmware_sim/app/studio/record/heads.h"
#include "firmware_sim/app/surfaces.h"
#include "firmware_sim/base/clock.h"
#include "firmware_sim/config/config.h"

enum { WAIT_MS = 1000 };

static int is_stopped(const struct record_job *r)
{
    return r->stop != NULL && r->stop(r->stop_ctx);
}

/* Whether files are to be given up: a stop was asked for, or a signal came while they are completed. A signal that
 * comes earlier ends the recording, also while a recorder writes the grid of a scan, or the files of a scan are
 * completed: the files then keep what came. */
static int gives_up(void *ctx)
{
    const struct record_job *r = ctx;
    return is_stopped(r) || (r->is_completing && app_interrupted() && !r->interrupted);
}

static int write_frame(void *ctx, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *err)
{
    struct record_job *r = ctx;
    if (is_stopped(r)) return sh_fail(err, SH_ESTOPPED, "the recording was stopped");
    const int rc = record_files_frame(&r->files, sh, frame, err);
    return rc == SH_OK && r->each ? record_files_frame(&r->parts, sh, frame, err) : rc;
}

static int save_files(void *ctx, struct sh_err *err)
{
    struct record_job *r = ctx;
    const int rc = record_files_save(&r->files, err);
    return rc == SH_OK && r->each ? record_files_save(&r->parts, err) : rc;
}

static int open_files(struct record_job *r, struct sh_err *err)
{
    r->files.takes_over = r->only_whole; /* a campaign begins its jobs anew */
    r->parts = r->files;
    r->parts.split = 1;
    r->parts.recorder.n_heads = 1;
    const int rc = record_files_open(&r->files, err);
    return rc == SH_OK && r->each ? record_files_open(&r->parts, err) : rc;
}

static int close_files(struct record_job *r, int keep, struct sh_err *err)
{
    struct sh_err why = {0};
    const int of_each = r->each ? record_files_close(&r->parts, keep, &why) : SH_OK;
    const int rc = record_files_close(&r->files, keep, err);
    return app_and_also(rc, of_each, &why, err);
}

static void say_tripod(const struct record_job *r, uint32_t station)
{
    const struct site *site = heads_site(r->heads);
    const uint32_t i = (station != 0 ? station : site->cfg->head.settings.station) - 1;
    char text[200];
    if (!r->recording.progress || site->station[i].tripod.from == NULL) return;
    site_describe_tripod(&site->station[i], text, sizeof text);
    fprintf(stderr, "scanhead: station %u %s: tripod: %s\n", i + 1, site->station[i].station->name, text);
}

static int prepare(void *ctx, uint32_t station, struct sh_err *err)
{
    struct record_job *r = ctx;
    say_tripod(r, station);
    return heads_prepare(r->heads, station, err);
}

static void say_result(const struct record_job *r)
{
    const struct recording_result *result = &r->result;
    char faint[96] = "";
    if (!r->recording.progress || r->brief) return;
    if (result->faint != 0)
        snprintf(faint, sizeof faint, ", %llu hits not detected%s", (unsigned long long)result->faint,
                 r->has_silent ? ", or on surfaces that are no target" : "");
    fprintf(stderr, "scanhead: %llu points, %llu shots without echo%s, %llu scans\n",
            (unsigned long long)result->points, (unsigned long long)result->empty, faint,
            (unsigned long long)result->counts.scans);
}

static void print_note(void *ctx, const char *text)
{
    (void)ctx;
    fprintf(stderr, "scanhead: %s\n", text);
}

/* Follows the scans. Files are closed and statistics written also after some failures; the first failure is
 * returned. */
static int job_follow(struct record_job *r, struct scanhead *sh, struct sh_err *err)
{
    struct recording_result *result = &r->result;
    struct sh_err why = {0};
    int rc = r->heads != NULL ? heads_record(r->heads, &r->recording, result, err)
                              : recording_run(sh, &r->recording, result, err);
    const int is_cut = rc == SH_ERESET || rc == SH_ECLOSED; /* a bus reset, or an end of the stream, within a scan */
    const int has_figures = rc == SH_OK || rc == SH_ELOST || is_cut;
    const int whole = rc == SH_OK && recording_check_complete(result, NULL) == SH_OK;
    const int has_points = result->points != 0 && r->files.has_points; /* a format may have refused the first ones */
    const int keep = r->only_whole ? whole : has_points || (rc == SH_OK && result->missing[0] == '\0');
    r->interrupted = app_interrupted();
    r->is_completing = 1;
    if (r->may_end && rc == SH_ECLOSED && has_points) rc = SH_OK;
    int after = close_files(r, keep && !is_stopped(r), &why);
    rc = app_and_also(rc, after, &why, err);
    if (!has_figures || r->stats == NULL) return rc;
    after = app_write_json(r->stats, recording_put, result, &why);
    return app_and_also(rc, after, &why, err);
}

static void warn_of_order(const struct recording_result *result)
{
    char order[256];
    if (recording_describe_order(result, order, sizeof order))
        sh_warn(&app_report_stderr, "the stream was not in order: %s", order);
    app_warn_left_out(result->crowded, result->unfit, result->lost_samples);
}

static void warn_of_little(const struct record_job *r)
{
    const struct recording_result *result = &r->result;
    app_warn_empty(result->counts.pulses, result->empty, result->faint);
    if (r->files.recorder.colour.scale.mode == COLOUR_REFLECTANCE && result->points != 0 &&
        result->with_reflectance == 0)
        sh_warn(
            &app_report_stderr,
            "--colour reflectance: none of %llu points has a reflectance, so all have the colour for a missing one; "
            "it needs the head's signal.model: on",
            (unsigned long long)result->points);
}

static int record(struct record_job *r, struct scanhead *sh, struct sh_err *err)
{
    struct recording_result *result = &r->result;
    r->recording.hash = (r->hash || r->stats != NULL) && !r->no_hash;
    r->notes = (struct sh_report){r, r->silent ? NULL : print_note,
                                  r->recording.progress ? app_report_seconds.progress : NULL, gives_up, NULL};
    r->files.recorder.report = &r->notes;
    int rc = open_files(r, err);
    if (rc != SH_OK) {
        struct sh_err why;
        close_files(r, 0, &why);
        return rc;
    }
    r->recording.frame = write_frame;
    r->recording.second = save_files;
    r->recording.ctx = r;
    r->recording.interrupted = app_interrupted;
    r->recording.report = r->silent ? NULL : &app_report_stderr;
    rc = job_follow(r, sh, err);
    if (rc == SH_OK || result->points != 0) say_result(r);
    if (!r->silent) warn_of_order(result);
    if (rc == SH_OK && !r->silent) warn_of_little(r);
    return rc == SH_OK && !r->may_end ? recording_check_complete(result, err) : rc;
}

/* --crs also sets the layout geo, since polar points are in no CRS. */
static int set_layout(const struct record_job *r, struct config *cfg, struct sh_err *err)
{
    if (!r->crs_given || cfg->output.layout == LINE_GEO) return SH_OK;
    if (cfg->output.layout_given)
        return sh_fail(
            err, SH_EINPUT,
            "%s: output.layout is polar, and polar recordings are in the scene frame; --crs needs geo: --set "
            "output.layout=geo",
            cfg->file);
    cfg->output.layout = LINE_GEO;
    return SH_OK;
}

/* Off line a scan must end by itself, and nobody sends poses. */
static int check_can_end(const struct record_job *r, const struct config *cfg, struct sh_err *err)
{
    const long frames = r->recording.frames >= 0 ? r->recording.frames : (long)cfg->head.settings.frames;
    const int arrives = cfg->platform.kind == PLATFORM_TRAJECTORY && cfg->platform.at_end == PLATFORM_STOP;
    if (cfg->platform.kind == PLATFORM_LIVE)
        return sh_fail(
            err, SH_EINPUT,
            "%s: platform.kind: a live platform can't be recorded off line; use scanhead run, and record its link",
            cfg->file);
    if (frames == 0 && !arrives && !(r->recording.duration_s > 0.0))
        return sh_fail(err, SH_EINPUT, "%s: head.frames is 0, a scan without end; give --frames or --duration",
                       cfg->file);
    return SH_OK;
}

/* Whether a recording has the value that its colours show (colour_check). Else its colours are those that the head
 * sends. */
static int is_known_here(const struct config *cfg, enum colour_mode mode)
{
    if (!config_head_moves(&cfg->platform) || cfg->output.layout != LINE_GEO) return 1;
    return mode != COLOUR_RANGE && (mode != COLOUR_HEIGHT || cfg->output.crs != GEOREF_ECEF);
}

/* Colours of textures come from the head. Where the configuration's colours have no limits, the recording finds
 * them. */
static void set_colours(struct record_job *r, struct config *cfg)
{
    struct colour_choice *c = &r->files.recorder.colour;
    if (r->texture) cfg->output.colour = COLOUR_TEXTURE;
    if (c->given || r->texture || !colour_has_limits(cfg->output.colour) || cfg->output.colour_limited) return;
    if (!is_known_here(cfg, cfg->output.colour)) return;
    *c = (struct colour_choice){.given = 1, .scale.mode = cfg->output.colour};
    r->files.own_limits = 1;
}

static int check_colours(const struct record_job *r, const struct config *cfg, struct sh_err *err)
{
    const struct colour_choice *c = &r->files.recorder.colour;
    const int has_frames = cfg->platform.kind == PLATFORM_TRAJECTORY || cfg->platform.kind == PLATFORM_STOPS;
    if (!c->given) return SH_OK;
    if (c->scale.mode == COLOUR_FRAME && !has_frames)
        return sh_fail(
            err, SH_EINPUT,
            "%s: --colour frame, but points have no frame scalar; it needs platform.kind trajectory or stops",
            cfg->file);
    if (is_known_here(cfg, c->scale.mode)) return SH_OK;
    return sh_fail(
        err, SH_EINPUT,
        "%s: --colour %s, but points of a moving head do not have it in output.layout geo%s; allowed output.colour "
        "with limits, or output.layout: polar",
        cfg->file, c->scale.mode == COLOUR_RANGE ? "range" : "height",
        c->scale.mode == COLOUR_RANGE ? "" : " and ECEF");
}

/* Refuses grids and meshes that the head, or its coordinates, can't give. */
static int check_meshes(const struct record_job *r, const struct config *cfg, struct sh_err *err)
{
    const enum emitter_kind kind = cfg->profile.emitter.kind;
    const int on_earth = cfg->output.layout == LINE_GEO && cfg->output.crs != GEOREF_LOCAL;
    const int moves = config_head_moves(&cfg->platform);
    const struct head_settings *s = &cfg->head.settings;
    const int pans = s->pan_udeg_s > 0 && s->pan_stop_udeg > s->pan_start_udeg; /* else a scan is one line */
    const int one_line = kind == EMITTER_PLANAR || (kind == EMITTER_LINE && !pans) ||
                         (kind == EMITTER_SPHERE && cfg->profile.emitter.rings <= 1);
    int rc = on_earth ? record_files_check_floats(&r->files, err) : SH_OK;
    if (rc == SH_OK && on_earth && moves)
        rc = record_files_refuse_meshes(&r->files,
                                        "faces the head, but the places of a moving head are known only in the "
                                        "scene's frame; allowed output.crs: local, or output.layout: polar",
                                        err);
    if (rc == SH_OK && one_line && !moves)
        rc = record_files_refuse_meshes(&r->files,
                                        "needs a surface, but this head scans a single line: it neither pans nor "
                                        "moves, and has one ring; allowed are .ply (without --mesh and --sparse) .las "
                                        ".ptx .e57 .poses.csv .waves.csv .shs .pcapng",
                                        err);
    return rc == SH_OK ? record_files_check_emitter(&r->files, kind, err) : rc;
}

int record_job_check(struct record_job *r, struct config *cfg, struct sh_err *err)
{
    int rc = check_can_end(r, cfg, err);
    if (rc == SH_OK) rc = set_layout(r, cfg, err);
    if (rc == SH_OK) set_colours(r, cfg);
    if (rc == SH_OK) rc = check_colours(r, cfg, err);
    if (rc == SH_OK && cfg->output.layout == LINE_GEO && cfg->output.crs == GEOREF_GEODETIC)
        rc = record_files_check_degrees(&r->files, err);
    return rc == SH_OK ? check_meshes(r, cfg, err) : rc;
}

/* Checks before scenes are loaded whether the files can hold the scans of all heads that will scan. */
static int check_heads(struct record_job *r, const struct heads *heads, uint32_t last, struct sh_err *err)
{
    const struct config *cfg;
    int rc = SH_OK;
    uint32_t n = 0;
    for (; rc == SH_OK && (cfg = heads_config(heads, n, r->recording.first_station, last)) != NULL; n++) {
        rc = check_can_end(r, cfg, err);
        if (rc == SH_OK) rc = check_meshes(r, cfg, err);
    }
    r->files.recorder.n_heads = r->files.split ? 1 : heads_turns(heads, r->recording.first_station, last);
    return rc == SH_OK && n > 1 ? record_files_check_heads(&r->files, err) : rc;
}

/* Assumes that every line has as many shots as the middle one. Lines differ by one pulse at most, but a sphere's rings
 * at the poles have a single pulse. */
static double most_shots(const struct record_job *r, const struct site *site)
{
    struct head_settings settings = site->cfg->head.settings;
    struct schedule_spec spec;
    struct schedule_segment segment;
    struct schedule_line line;
    if (r->recording.frames >= 0) settings.frames = (uint32_t)r->recording.frames;
    if (settings.frames == 0 || r->recording.duration_s > 0) return (double)INFINITY;
    site_fill_spec(site, &settings, &spec);
    schedule_start(&segment, &spec);
    const uint64_t middle = schedule_line_of(&segment, segment.end_pulse / 2);
    schedule_get_line(&segment, middle, &line);
    const double fired = (double)(line.pulse_end - line.pulse0), cast = (double)line.cast_end - (double)line.cast0;
    return fired > 0 && cast > 0 ? (double)segment.end_pulse / fired * cast : 0;
}

static int fits(void *ctx, const struct site *site, uint32_t station, struct sh_err *err)
{
    struct record_job *r = ctx;
    const struct config_output *output = &site->cfg->output;
    const double *centre_m, *scale; /* the scene's point and scale of the georeference; unused here */
    const struct site_station *s = &site->station[station - 1];
    struct recorder_scan scan = {.station = station,
                                 .moves = site->moving,
                                 .is_geo = output->layout == LINE_GEO,
                                 .range_max_m = site->cfg->head.range_max_m,
                                 .scale_m = site->scale_m,
                                 .n_shots = most_shots(r, site)};
    scan.in_degrees = scan.is_geo && output->crs == GEOREF_GEODETIC;
    if (scan.is_geo)
        georef_anchor(site_georef(site, station - 1, 0, &centre_m, &scale), scan.place_m);
    else
        memcpy(scan.place_m, s->at.position_m, sizeof scan.place_m);
    if (r->first.station == 0) r->first = scan;
    const int rc = record_files_check_scan(&r->files, &r->first, &scan, err);
    return rc == SH_OK && r->each ? record_files_check_scan(&r->parts, &scan, &scan, err) : rc;
}

static int record_heads(struct record_job *r, struct config *cfg, struct heads *heads, struct sh_err *err)
{
    const int all = r->station == APP_WORD;
    r->has_silent = cfg->scene.target.n_objects > 0 && cfg->scene.target.others == OTHERS_HIDE;
    if (all) r->recording.first_station = 1;
    int rc = heads_load(cfg, heads, err);
    if (rc == SH_OK) rc = check_heads(r, heads, all ? cfg->n_stations : r->recording.last_station, err);
    if (rc == SH_OK && r->truth != NULL && heads->n > 1)
        rc = sh_fail(err, SH_EINPUT, "%s: --truth: the stations have %u scanners; allowed with one scanner", cfg->file,
                     heads->n);
    heads->one[0].offline.truth = r->truth;
    r->first = (struct recorder_scan){0};
    heads->fits = fits;
    heads->ctx = r;
    if (rc == SH_OK) rc = heads_open(heads, r->site, r->recording.duration_s, &app_report_stderr, err);
    if (rc == SH_OK && r->surfaces != NULL) rc = surfaces_write(r->surfaces, heads->first->site, err);
    r->recording.head_ends = 1;
    r->files.recorder.may_wait = 1; /* pace fast */
    r->recording.prepare = prepare;
    r->heads = heads;
    if (rc == SH_OK && all) r->recording.last_station = heads->first->site->n_stations;
    if (rc == SH_OK) rc = record(r, heads->first->sh, err);
    r->heads = NULL;
    if (r->truth == NULL || heads->first == NULL) return rc;
    struct sh_err why;
    return app_and_also(rc, offline_finish(heads->first, &why), &why, err);
}

int record_job_off_line(struct record_job *r, struct config *cfg, struct sh_err *err)
{
    struct heads *heads = calloc(1, sizeof *heads);
    if (heads == NULL) return sh_fail(err, SH_ENOMEM, "no memory for heads");
    int rc = record_job_check(r, cfg, err);
    if (rc == SH_OK) rc = record_heads(r, cfg, heads, err);
    heads_close(heads);
    free(heads);
    return rc;
}

/* Waits for the source in parts of WAIT_MS, and checks for a signal after each part. A signal that comes just before a
 * part does not end that part. */
static int open_stream(const struct record_job *r, struct scanhead **sh, char *why, size_t len)
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

int record_job_stream(struct record_job *r, struct sh_err *err)
{
    struct scanhead *sh = NULL;
    char why[512];
    int rc = open_stream(r, &sh, why, sizeof why);
    if (app_is_recording(r->source)) r->recording.file = r->source;
    if (rc != SCANHEAD_OK) rc = sh_fail(err, rc, "%s", why);
    if (rc != SH_OK) return r->recording.file != NULL ? sh_of_file(rc, err) : rc;
    struct stat st;
    if (r->recording.file != NULL) r->recording.listen = r->files.recorder.may_wait = 1;
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
