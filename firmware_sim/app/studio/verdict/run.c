/* SPDX-License-Identifier: MIT */
/* One scenario: the head, the client beside it, and what is known of both in the end. */
#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "core/studio/cloud.h"
#include "firmware_sim/app/app.h"
#include "firmware_sim/app/studio/verdict/checks.h"
#include "firmware_sim/app/studio/verdict/client.h"
#include "firmware_sim/app/studio/verdict/held.h"
#include "firmware_sim/app/studio/verdict/match.h"
#include "firmware_sim/app/studio/verdict/own_stream.h"
#include "firmware_sim/app/studio/verdict/verdict.h"
#include "firmware_sim/app/studio/verdict/watch.h"
#include "firmware_sim/base/clock.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/loop/loop.h"

enum { WAIT_MS = 10 };
static const double UP_WITHIN_S = 60.0, NEVER_S = 1e-9; /* NEVER_S: before the first frame */
/* Points that come over this much device time show that the scan goes on. */
static const int64_t AT_LEAST_NS = 100000000;

struct run {
    struct config *cfg;
    const struct verdict_options *options;
    struct verdict *verdict;
    struct site *site;
    struct device *device;
    struct loop *loop;
    struct loop_stats stats;
    struct watch watch;
    struct own_stream stream;
    struct client client;
    struct link_place place;
    char *line, *points; /* the command; its file of points, NULL: none */
    struct stat before;  /* of that file; st_ino 0: it was not there */
    struct checks checks;
};

/* ---- the head */

void verdict_be_patient(struct config *cfg)
{
    static const double PATIENCE_MS = 3000.0;
    cfg->loop.queue_ms = fmax(cfg->loop.queue_ms, PATIENCE_MS);
    cfg->loop.late_ms = fmax(cfg->loop.late_ms, PATIENCE_MS);
}

static void run_prepare(struct run *r)
{
    struct config *cfg = r->cfg;
    verdict_be_patient(cfg);
    if (r->options->file == NULL) return;
    uint32_t n = 0;
    for (uint32_t i = 0; i < cfg->faults.n; i++) {
        struct fault *fault = &cfg->faults.fault[i];
        if (fault->kind != FAULT_FLIP || !fault->reseal) continue;
        fault->until_s = NEVER_S; /* it stays in the list, whose places are the faults' numbers */
        n++;
    }
    if (n != 0)
        sh_warn(&app_report_stderr,
                "soak: %u faults of kind flip with reseal do not strike: no client can notice them, and the points "
                "that they change would count as unknown",
                n);
}

static int open_head(struct run *r, struct sh_err *err)
{
    struct config *cfg = r->cfg;
    const struct link_spec *link = &cfg->link[r->options->link - 1];
    const struct device_options device = {
        .start = cfg->head.start || link->type == LINK_UDP, .truth = r->options->truth, .report = &app_report_stderr};
    const struct loop_options options = {
        .extra = &r->stream.link, .report = &app_report_stderr, .observer = &r->watch.observer};
    int rc = site_load(cfg, &app_report_stderr, &r->site, err);
    if (rc == SH_OK) rc = site_open_sights(r->site, 0, r->site->n_stations, &app_report_stderr, err);
    cfg->head.settings.frames = 0; /* the scan has no end; the plan was made for the configured number */
    if (rc == SH_OK) rc = device_create(r->site, &device, &r->device, err);
    if (rc == SH_OK) rc = own_stream_open(&r->stream, err);
    if (rc == SH_OK) rc = loop_create(r->site, r->device, &options, &r->loop, err);
    if (rc == SH_OK) fault_board_listen(device_faults(r->device), watch_note, &r->watch);
    if (rc == SH_OK) loop_get_place(r->loop, r->options->link - 1, &r->place);
    return rc;
}

/* ---- the client */

static int start_client(struct run *r, struct sh_err *err)
{
    const struct verdict_options *o = r->options;
    char out[640], printed[640];
    const int prints = o->file != NULL && strcmp(o->file, "-") == 0;
    snprintf(out, sizeof out, "%s/%s.points", o->folder, r->verdict->scenario);
    snprintf(printed, sizeof printed, "%s/%s.stdout", o->folder, r->verdict->scenario);
    snprintf(r->verdict->log, sizeof r->verdict->log, "%.400s/%s.log", o->folder, r->verdict->scenario);
    const struct client_words words = {r->place.endpoint, out};
    r->line = client_fill(o->command, &words);
    if (o->file != NULL) r->points = prints ? strdup(printed) : client_fill(o->file, &words);
    if (r->line == NULL || (o->file != NULL && r->points == NULL)) return sh_fail(err, SH_ENOMEM, "no memory");
    if (r->points != NULL && !prints && stat(r->points, &r->before) != 0) r->before = (struct stat){0};
    return client_start(&r->client, r->line, r->verdict->log, prints ? printed : NULL, err);
}

/* ---- waiting */

static int wait_until(struct run *r, int (*is_so)(struct run *r), int64_t until_ns)
{
    while (!is_so(r)) {
        const int gone = r->client.pid != 0 && client_has_ended(&r->client);
        if (gone || app_interrupted() || clock_now_ns() > until_ns) return 0;
        poll(NULL, 0, WAIT_MS);
    }
    return 1;
}

static int64_t in_s(double s)
{
    return clock_now_ns() + (int64_t)(1e9 * s);
}

static int is_up(struct run *r)
{
    return atomic_load(&r->stream.is_up);
}

static int is_connected(struct run *r)
{
    return watch_first_open_ns(&r->watch) != 0;
}

static int has_points(struct run *r)
{
    return atomic_load(&r->stream.points_ns) != 0;
}

/* Waits of a fixed time use this. The client's end and a signal end these waits, too. */
static int never(struct run *r)
{
    (void)r;
    return 0;
}

/* Waits until all clients that were sent away are back, and points come. */
static void run_settle(struct run *r)
{
    struct checks *c = &r->checks;
    int64_t from_ns = atomic_load(&r->stream.points_ns), until_ns = in_s(r->options->limit_s);
    while (!app_interrupted() && !client_has_ended(&r->client)) {
        const int64_t over_ns = watch_over_ns(&r->watch) + (int64_t)(1e9 * r->options->limit_s);
        c->is_open = watch_is_whole(&r->watch);
        c->scans = atomic_load(&r->stream.points_ns) > from_ns + AT_LEAST_NS;
        if ((c->is_open || !c->has_sessions) && c->scans) return;
        if (clock_now_ns() > until_ns && clock_now_ns() > over_ns) return;
        poll(NULL, 0, WAIT_MS);
    }
}

static void run_client(struct run *r)
{
    const struct verdict_options *o = r->options;
    struct checks *c = &r->checks;
    const int there = (!c->has_sessions || wait_until(r, is_connected, in_s(o->limit_s))) &&
                      wait_until(r, has_points, in_s(o->limit_s));
    if (there) wait_until(r, never, in_s(o->duration_s));
    fault_board_end(device_faults(r->device), 0, INT64_MIN); /* all, at once */
    if (c->has_sessions ? is_connected(r) : there) run_settle(r);
    c->was_there = !client_has_ended(&r->client);
    c->holds = c->was_there && held_any(&r->watch);
    c->ended_ns = clock_now_ns();
    watch_end(&r->watch);
    client_end(&r->client, o->grace_s);
}

static int run_serve(struct run *r, struct sh_err *err)
{
    struct link_counts counts = {0};
    const int64_t from_ns = clock_now_ns();
    int rc = loop_start(r->loop, err);
    if (rc == SH_OK) rc = own_stream_start(&r->stream, err);
    if (rc == SH_OK && !wait_until(r, is_up, in_s(UP_WITHIN_S)) && !app_interrupted())
        rc = sh_fail(err, SH_ESTATE, "soak: the head did not boot within %g s", UP_WITHIN_S);
    if (rc == SH_OK) rc = start_client(r, err);
    r->checks.start_ns = r->client.started_ns;
    if (rc == SH_OK) run_client(r);
    loop_end(r->loop);
    loop_join(r->loop, &r->stats);
    loop_get_counts(r->loop, r->options->link - 1, &counts);
    loop_free(r->loop);
    r->loop = NULL;
    own_stream_join(&r->stream);
    if (rc == SH_OK) rc = device_close_journal(r->device, err);
    r->verdict->figures.left_out = counts.left_out_frames;
    r->verdict->figures.lost_pulses = r->stats.counters.lost_pulses;
    r->verdict->figures.wall_s = 1e-9 * (double)(clock_now_ns() - from_ns);
    return rc;
}

/* ---- points */

/* Returns 0 if the file is as it was before the client was started. A missing file counts as new: reading it fails,
 * with the reason. */
static int is_new(const struct run *r)
{
    struct stat now;
    return stat(r->points, &now) != 0 || now.st_ino != r->before.st_ino || now.st_size != r->before.st_size ||
           now.st_mtim.tv_sec != r->before.st_mtim.tv_sec || now.st_mtim.tv_nsec != r->before.st_mtim.tv_nsec;
}

/* Returns how far coordinates may differ, m: the option's figure if it is given. Else the figure has room for the
 * rounding of the link's protocol. SCIP and CoLa: half a millimetre of range, and angles. VLP-16: half of 2 mm, and
 * half of 0.01 degrees at 100 m. The native protocol rounds nothing that the head's stream does not. */
static double match_of(const struct run *r)
{
    if (r->options->match_m >= 0.0) return r->options->match_m;
    if (strcmp(r->place.protocol, "native") == 0) return 1e-5;
    return strncmp(r->place.protocol, "velodyne", 8) == 0 ? 2e-2 : 2e-3;
}

static int run_compare(struct run *r, struct sh_err *err)
{
    struct cloud cloud;
    struct verdict_points match;
    struct sh_err why;
    if (!is_new(r)) {
        snprintf(why.text, sizeof why.text, "%s: the client did not write it", r->points);
        checks_no_points(r->verdict, VERDICT_FOUND, why.text);
        return SH_OK;
    }
    if (cloud_read_positions(r->points, &app_report_quiet, &cloud, &why) != SH_OK) {
        checks_no_points(r->verdict, VERDICT_FOUND, why.text);
        return SH_OK;
    }
    const struct match_input in = {.stream = &r->stream,
                                   .watch = &r->watch,
                                   .tick_ns = device_tick_ns(r->device),
                                   .cloud = &cloud,
                                   .match_m = match_of(r),
                                   .report = &app_report_stderr};
    const int rc = match_points(&in, &match, err);
    if (rc == SH_OK && match.n == 0)
        checks_no_points(r->verdict, VERDICT_FOUND, "it has no point");
    else if (rc == SH_OK)
        checks_points(r->verdict, &match, cloud.xyz_m[match.first_unknown]);
    cloud_free(&cloud);
    return rc;
}

static int run_judge(struct run *r, struct sh_err *err)
{
    checks_judge(&r->checks, r->verdict);
    if (r->points == NULL)
        checks_no_points(r->verdict, VERDICT_NOT_JUDGED, "no --client-file");
    else if (r->stream.short_of[0] == '\0')
        return run_compare(r, err);
    else {
        checks_no_points(r->verdict, VERDICT_NOT_JUDGED, r->stream.short_of);
        sh_warn(&app_report_stderr, "soak: %s: --client-file: the points are not judged: %s", r->verdict->scenario,
                r->stream.short_of);
    }
    return SH_OK;
}

int verdict_run(struct config *cfg, const struct verdict_options *options, struct verdict *verdict, struct sh_err *err)
{
    struct run *r = calloc(1, sizeof *r);
    if (r == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    r->client.in_fd = -1;
    r->cfg = cfg;
    r->options = options;
    r->verdict = verdict;
    r->stream.keeps = options->file != NULL;
    watch_begin(&r->watch, cfg->n_links, options->link, options->limit_s);
    for (uint32_t i = 0; i < cfg->n_links; i++)
        if (cfg->link[i].protocol == PROTOCOL_SCIP || cfg->link[i].protocol == PROTOCOL_COLA)
            r->watch.must_ask |= 1U << i;
    r->checks = (struct checks){.options = options,
                                .watch = &r->watch,
                                .client = &r->client,
                                .has_sessions = cfg->link[options->link - 1].type != LINK_UDP};
    run_prepare(r);
    int rc = open_head(r, err);
    if (rc == SH_OK) rc = run_serve(r, err);
    if (rc == SH_OK && r->watch.is_short) rc = sh_fail(err, SH_ENOMEM, "no memory for what the client does");
    if (rc == SH_OK && app_interrupted()) rc = sh_fail_stopped(err); /* an interrupted run gives no verdict */
    if (rc == SH_OK) rc = run_judge(r, err);
    for (int check = 0; check < VERDICT_N_CHECKS; check++)
        if (verdict->check[check].state == VERDICT_FOUND && (options->allowed >> check & 1) != 0)
            verdict->check[check].state = VERDICT_ALLOWED;
    loop_free(r->loop);
    own_stream_close(&r->stream);
    device_free(r->device);
    site_free(r->site);
    watch_free(&r->watch);
    free(r->line);
    free(r->points);
    free(r);
    return rc;
}
