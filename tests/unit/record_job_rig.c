/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "firmware_sim/app/app.h"
#include "firmware_sim/app/studio/record/heads.h"
#include "firmware_sim/app/surfaces.h"
#include "firmware_sim/config/config.h"
#include "tests/unit/clock_rig.h"
#include "tests/unit/output_rig.h"
#include "tests/unit/record_job_rig.h"

#define MS INT64_C(1000000)

struct record_job job;
struct config *cfg;
struct sh_err err;
char warned[512], *said;
const char *stations, *order;
struct recording_result gets;
int asks_fit, recording_rc, is_complete, open_rc, appears_ms, stop_ms, is_stopped, is_recording, gave_up, gave_up_early;
double fits_shots;

static struct scanhead *const handle = (struct scanhead *)&job;
static struct site_station stations_of[3];
static struct site site = {.n_stations = 3, .station = stations_of};

/* ---- the program around it */

static void warn(void *ctx, const char *text)
{
    (void)ctx;
    snprintf(warned + strlen(warned), sizeof warned - strlen(warned), "%s\n", text);
}

const struct sh_report app_report_stderr = {.warn = warn}, app_report_seconds = {.warn = warn};

int app_interrupted(void)
{
    return stop_ms != 0 && clock_rig_ns >= stop_ms * MS;
}

int app_is_recording(const char *path)
{
    assert_ptr_equal(path, job.source);
    return is_recording;
}

int app_and_also(int rc, int more, const struct sh_err *why, struct sh_err *e)
{
    return rc == SH_OK && more != SH_OK ? sh_fail(e, more, "%s", why->text) : rc;
}

void app_warn_empty(uint64_t pulses, uint64_t empty, uint64_t faint)
{
    say("empty:%llu,%llu,%llu ", (unsigned long long)pulses, (unsigned long long)empty, (unsigned long long)faint);
}

void app_warn_left_out(uint64_t crowded, uint64_t unfit, uint64_t lost_samples)
{
    say("left_out:%llu,%llu,%llu ", (unsigned long long)crowded, (unsigned long long)unfit,
        (unsigned long long)lost_samples);
}

int app_write_json(const char *path, void (*put)(struct json *json, const void *ctx), const void *ctx, struct sh_err *e)
{
    if (put != recording_put || ctx != &job.result) say("JSON ");
    return call(e, "%s", path);
}

int surfaces_write(const char *path, const struct site *of, struct sh_err *e)
{
    if (of != &site) say("SURFACES ");
    return call(e, "surfaces:%s", path);
}

/* ---- the files */

static const char *of(const struct record_files *files)
{
    return files == &job.files ? "files" : files == &job.parts ? "parts" : "FILES";
}

int record_files_open(struct record_files *files, struct sh_err *e)
{
    if (files == &job.parts && !(files->split && files->recorder.n_heads == 1)) say("PARTS ");
    if (files->recorder.report != &job.notes || files->takes_over != job.only_whole) say("REPORT ");
    return call(e, "open_%s", of(files));
}

int record_files_frame(struct record_files *files, struct scanhead *sh, const struct scanhead_frame *frame,
                       struct sh_err *e)
{
    if (sh != handle || frame->seq != 5) say("FRAME ");
    gave_up_early = job.notes.stop(job.notes.ctx);
    return call(e, "frame_%s", of(files));
}

int record_files_save(struct record_files *files, struct sh_err *e)
{
    return call(e, "save_%s", of(files));
}

int record_files_close(struct record_files *files, int keep, struct sh_err *e)
{
    gave_up = job.notes.stop(job.notes.ctx);
    return call(e, "%s_%s", keep ? "keep" : "drop", of(files));
}

int record_files_check_degrees(const struct record_files *files, struct sh_err *e)
{
    (void)files;
    (void)e;
    return SH_OK;
}

int record_files_check_floats(const struct record_files *files, struct sh_err *e)
{
    return record_files_check_degrees(files, e);
}

int record_files_refuse_meshes(const struct record_files *files, const char *why, struct sh_err *e)
{
    (void)why;
    return record_files_check_degrees(files, e);
}

int record_files_check_emitter(const struct record_files *files, enum emitter_kind kind, struct sh_err *e)
{
    (void)files;
    (void)kind;
    return call(e, "check_emitter");
}

int record_files_check_heads(const struct record_files *files, struct sh_err *e)
{
    (void)files;
    return call(e, "check_heads");
}

int record_files_check_scan(const struct record_files *files, const struct recorder_scan *first,
                            const struct recorder_scan *scan, struct sh_err *e)
{
    (void)first;
    fits_shots = scan->n_shots;
    return call(e, "fits_%s", of(files));
}

/* ---- the source, and its recording */

int scanhead_open_within(const char *source, int timeout_ms, struct scanhead **out, char *why, size_t len)
{
    assert_ptr_equal(source, job.source);
    say("open:%d ", timeout_ms);
    clock_rig_ns += timeout_ms * MS;
    if (clock_rig_ns >= appears_ms * MS) {
        *out = handle;
        return SCANHEAD_OK;
    }
    snprintf(why, len, "it is not there");
    return open_rc;
}

int scanhead_command(struct scanhead *sh, const char *command, char *reply, size_t reply_len, int timeout_ms)
{
    if (sh != handle || timeout_ms != 5000) say("COMMAND ");
    say("%s ", command);
    snprintf(reply, reply_len, "%s", stations != NULL ? stations : "");
    return stations != NULL ? SCANHEAD_OK : SCANHEAD_EIO;
}

const char *scanhead_error(const struct scanhead *sh)
{
    return sh == handle ? "it broke" : "?";
}

void scanhead_close(struct scanhead *sh)
{
    say(sh == handle ? "close" : "CLOSE");
}

/* It passes on one frame, and a second goes by. */
static int record_it(const struct recording_options *o, struct recording_result *result, struct sh_err *e)
{
    const struct scanhead_frame frame = {.seq = 5};
    *result = gets;
    if (o->ctx != &job || o->interrupted != app_interrupted || o->report != &app_report_stderr) say("OPTIONS ");
    say("run:%u-%u%s%s%s ", o->first_station, o->last_station, o->listen ? ",listen" : "", o->hash ? ",hash" : "",
        o->head_ends ? ",ends" : "");
    int rc = o->frame(o->ctx, handle, &frame, e);
    if (rc == SH_OK) rc = o->second(o->ctx, e);
    if (rc != SH_OK) return rc;
    return recording_rc == SH_OK ? SH_OK : sh_fail(e, recording_rc, "it ended");
}

int recording_run(struct scanhead *sh, const struct recording_options *o, struct recording_result *result,
                  struct sh_err *e)
{
    if (sh != handle) say("RUN ");
    return record_it(o, result, e);
}

int recording_check_complete(const struct recording_result *result, struct sh_err *e)
{
    if (result != &job.result) say("COMPLETE ");
    return is_complete ? SH_OK : e == NULL ? SH_ELOST : sh_fail(e, SH_ELOST, "some is missing");
}

int recording_describe_order(const struct recording_result *result, char *text, size_t len)
{
    if (result != &job.result) say("ORDER ");
    snprintf(text, len, "%s", order != NULL ? order : "");
    return order != NULL;
}

void recording_put(struct json *json, const void *ctx)
{
    (void)json;
    (void)ctx;
}

/* ---- the heads */

int heads_load(struct config *of_cfg, struct heads *heads, struct sh_err *e)
{
    if (of_cfg != cfg) say("LOAD ");
    heads->n = 1;
    heads->one[0].cfg = cfg;
    return call(e, "load");
}

struct config *heads_config(const struct heads *heads, uint32_t i, uint32_t first, uint32_t last)
{
    (void)heads;
    say("config%u:%u-%u ", i, first, last);
    return i == 0 ? cfg : NULL;
}

uint32_t heads_turns(const struct heads *heads, uint32_t first, uint32_t last)
{
    (void)heads;
    return 10 * first + last;
}

int heads_open(struct heads *heads, struct site *at, double scan_s, const struct sh_report *report, struct sh_err *e)
{
    if (at != NULL || report != &app_report_stderr || heads->ctx != &job || heads->fits == NULL) say("HEADS ");
    heads->first = &heads->one[0].offline;
    heads->first->site = &site;
    heads->first->sh = handle;
    say("%s", heads->first->truth != NULL ? "truth_" : "");
    return call(e, "heads:%g", scan_s);
}

int heads_record(struct heads *heads, const struct recording_options *o, struct recording_result *result,
                 struct sh_err *e)
{
    if (heads != job.heads || o->prepare == NULL || !job.files.recorder.may_wait) say("RECORD ");
    *result = (struct recording_result){0};
    /* heads.c asks about every scan; this asks only with a duration, or where the test wants it. */
    if ((asks_fit || o->duration_s > 0.0) && heads->fits(heads->ctx, &site, 2, e) != SH_OK) return SH_EIO;
    return record_it(o, result, e);
}

int heads_prepare(struct heads *heads, uint32_t station, struct sh_err *e)
{
    (void)heads;
    (void)station;
    (void)e;
    return SH_OK;
}

const struct site *heads_site(const struct heads *heads)
{
    return heads->first->site;
}

void heads_close(struct heads *heads)
{
    (void)heads;
    say("close_heads");
}

int offline_finish(struct offline *offline, struct sh_err *e)
{
    if (offline->site != &site) say("FINISH ");
    return call(e, "finish");
}

/* ---- sites, of which nothing is asked */

void site_describe_tripod(const struct site_station *station, char *text, size_t len)
{
    (void)station;
    snprintf(text, len, "tripod");
}

/* Ten lines a second, of 100 pulses 3.6 degrees apart. From 1 to 91 degrees there are 25 of them. A sweep of the pan
 * takes ten seconds. */
void site_fill_spec(const struct site *of_site, const struct head_settings *settings, struct schedule_spec *spec)
{
    (void)of_site;
    *spec = (struct schedule_spec){.prr_uhz = 1000000000,
                                   .lines_uhz = 10000000,
                                   .pan_udeg_s = 10000000,
                                   .sweep_udeg = 360000000,
                                   .line_start_udeg = 1000000,
                                   .line_stop_udeg = 91000000,
                                   .pan_stop_udeg = 100000000,
                                   .frames = settings->frames};
}

const struct georef *site_georef(const struct site *of_site, uint32_t station, size_t stretch, const double **centre_m,
                                 const double **scale)
{
    (void)of_site;
    (void)station;
    (void)stretch;
    *centre_m = *scale = NULL;
    return NULL;
}

/* ---- the job */

static int stop(void *ctx)
{
    if (ctx != &is_stopped) say("STOP ");
    return is_stopped;
}

int make_job(void **state)
{
    (void)state;
    cfg = calloc(1, sizeof *cfg);
    if (cfg == NULL) return -1;
    memset(&job, 0, sizeof job);
    job.source = "tcp:there";
    job.recording.frames = -1;
    job.files.has_points = 1;
    job.stop = stop;
    job.stop_ctx = &is_stopped;
    site.cfg = cfg;
    cfg->n_stations = 5;
    cfg->head.settings.frames = 1;
    strcpy(cfg->file, "head.yaml");
    gets = (struct recording_result){.points = 7, .empty = 2, .counts = {.scans = 3, .pulses = 9}};
    trace[0] = warned[0] = '\0';
    fails = order = NULL;
    stations = "4";
    is_complete = 1;
    asks_fit = recording_rc = open_rc = appears_ms = stop_ms = is_stopped = is_recording = gave_up = gave_up_early = 0;
    clock_rig_ns = 0;
    return 0;
}

int end_job(void **state)
{
    (void)state;
    free(said);
    said = NULL;
    free(cfg);
    return 0;
}

void run_job(int (*run)(void), int rc)
{
    struct output output;
    free(said);
    trace[0] = '\0';
    output_take(&output, stderr);
    const int is = run();
    said = output_give(&output);
    assert_int_equal(is, rc);
}
