/* SPDX-License-Identifier: MIT */
#include "tests/unit/verdict_run_rig.h"

#include <poll.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "core/studio/cloud.h"
#include "firmware_sim/app/app.h"
#include "firmware_sim/app/studio/verdict/client.h"
#include "firmware_sim/app/studio/verdict/held.h"
#include "firmware_sim/app/studio/verdict/own_stream.h"
#include "firmware_sim/app/studio/verdict/watch.h"
#include "firmware_sim/loop/loop.h"
#include "tests/unit/clock_rig.h"

enum { START_MS = 1000 };

struct config cfg;
struct verdict_options options;
struct verdict verdict;
struct plan_of_run plan;
char warned[512];
const char *protocol, *short_of;
struct checks seen;
uint32_t must_ask;
double match_m;
int is_short;
void (*client_does)(void);
size_t n_matched, first_unknown;

static struct own_stream *stream;
static struct watch *watch;
static struct site site = {.n_stations = 3};
static struct device *const device = (struct device *)&cfg;
static struct loop *const loop = (struct loop *)&plan;
static struct fault_board *const board = (struct fault_board *)&trace;
static double xyz_m[9][3];

static int now(void)
{
    return (int)(clock_rig_ns / MS) - START_MS;
}

static void warn(void *ctx, const char *text)
{
    (void)ctx;
    snprintf(warned + strlen(warned), sizeof warned - strlen(warned), "%s\n", text);
}

const struct sh_report app_report_stderr = {.warn = warn}, app_report_quiet = {0};

int app_interrupted(void)
{
    return now() >= plan.stop;
}

/* Time goes on here. */
int poll(struct pollfd *fds, nfds_t n, int timeout_ms)
{
    if (fds != NULL || n != 0 || timeout_ms <= 0) say("POLL ");
    clock_rig_ns += timeout_ms * MS;
    atomic_store(&stream->is_up, now() >= plan.up);
    const int last = now() < plan.last_points ? now() : plan.last_points;
    if (now() >= plan.first_points) atomic_store(&stream->points_ns, (last - plan.first_points + 1) * MS);
    return 0;
}

/* ---- the head */

int site_load(const struct config *of, const struct sh_report *report, struct site **out, struct sh_err *err)
{
    if (of != &cfg || report != &app_report_stderr || cfg.head.settings.frames != 7) say("LOAD ");
    *out = &site;
    return call(err, "site");
}

int site_open_sights(struct site *of, uint32_t first, uint32_t n, const struct sh_report *report, struct sh_err *err)
{
    if (of != &site || first != 0 || n != 3 || report != &app_report_stderr) say("SIGHTS ");
    if (cfg.head.settings.frames != 7) say("FRAMES ");
    return call(err, "sights");
}

void site_free(struct site *of)
{
    say("free_site%s ", of == &site ? "" : ":none");
}

int device_create(const struct site *of, const struct device_options *o, struct device **out, struct sh_err *err)
{
    if (of != &site || o->report != &app_report_stderr || o->truth != options.truth) say("DEVICE ");
    if (cfg.head.settings.frames != 0) say("FRAMES ");
    say(o->start ? "starting_" : "");
    const int rc = call(err, "device");
    if (rc == SH_OK) *out = device;
    return rc;
}

void device_free(struct device *of)
{
    say("free_device%s ", of == device ? "" : ":none");
}

int64_t device_tick_ns(const void *of)
{
    return of == device ? 5 * MS : 0;
}

int device_close_journal(void *of, struct sh_err *err)
{
    if (of != device) say("JOURNAL ");
    return call(err, "journal");
}

struct fault_board *device_faults(const void *of)
{
    return of == device ? board : NULL;
}

void fault_board_listen(struct fault_board *of, void (*heard)(void *ctx, const struct fault_note *note), void *ctx)
{
    say(of == board && heard == watch_note && ctx == watch ? "listen " : "LISTEN ");
}

uint32_t fault_board_end(struct fault_board *of, uint32_t number, int64_t t_ns)
{
    say(of == board && number == 0 && t_ns == INT64_MIN ? "no_faults@%d " : "NO_FAULTS ", now());
    return 0;
}

int loop_create(const struct site *of, struct device *on, const struct loop_options *o, struct loop **out,
                struct sh_err *err)
{
    if (of != &site || on != device || o->extra != &stream->link || o->observer != &watch->observer) say("LOOP ");
    if (o->report != &app_report_stderr) say("REPORT ");
    const int rc = call(err, "loop");
    if (rc == SH_OK) *out = loop;
    return rc;
}

int loop_get_place(const struct loop *of, uint32_t i, struct link_place *place)
{
    if (of != loop || i != 1) say("PLACE ");
    *place = (struct link_place){.type = "tcp", .endpoint = "tcp:127.0.0.1:7", .protocol = protocol};
    return 1;
}

int loop_get_counts(const struct loop *of, uint32_t i, struct link_counts *counts)
{
    if (of != loop || i != 1) say("COUNTS ");
    *counts = (struct link_counts){.left_out_frames = 21, .left_out_pulses = 22};
    return 1;
}

int loop_start(struct loop *of, struct sh_err *err)
{
    if (of != loop) say("START ");
    return call(err, "run");
}

void loop_end(struct loop *of)
{
    say(of == loop ? "end " : "END ");
}

void loop_join(struct loop *of, struct loop_stats *stats)
{
    if (of != loop) say("JOIN ");
    *stats = (struct loop_stats){.counters = {.lost_pulses = 23}};
    say("join ");
}

void loop_free(struct loop *of)
{
    if (of != NULL) say(of == loop ? "free_loop " : "FREE_LOOP ");
}

/* ---- the head's own stream, and the sessions */

int own_stream_open(struct own_stream *of, struct sh_err *err)
{
    stream = of;
    say(of->keeps ? "keeping_" : "");
    return call(err, "stream");
}

int own_stream_start(struct own_stream *of, struct sh_err *err)
{
    if (of != stream) say("STREAM ");
    return call(err, "read");
}

void own_stream_join(struct own_stream *of)
{
    if (of != stream) say("STREAM ");
    say("join_stream ");
    snprintf(of->short_of, sizeof of->short_of, "%s", short_of);
}

void own_stream_close(struct own_stream *of)
{
    if (stream != NULL && of != stream) say("STREAM ");
    say("close_stream ");
}

void watch_begin(struct watch *of, uint32_t n_links, uint32_t chosen, double limit_s)
{
    watch = of;
    if (n_links != cfg.n_links || chosen != 2 || limit_s != options.limit_s) say("WATCH ");
}

void watch_end(struct watch *of)
{
    if (of != watch) say("WATCH ");
    say("watched@%d ", now());
    of->is_short = is_short;
}

void watch_free(struct watch *of)
{
    if (of != watch) say("WATCH ");
    must_ask = of->must_ask;
    say("free_watch");
}

void watch_note(void *of, const struct fault_note *note)
{
    (void)of;
    (void)note;
}

int watch_is_whole(struct watch *of)
{
    return of == watch && now() >= plan.whole;
}

int64_t watch_over_ns(struct watch *of)
{
    if (of != watch) say("OVER ");
    return plan.over != 0 ? (START_MS + plan.over) * MS : 0;
}

int64_t watch_first_open_ns(struct watch *of)
{
    return of == watch && now() >= plan.connects ? (START_MS + plan.connects) * MS : 0;
}

int held_any(struct watch *of)
{
    if (of != watch) say("HELD ");
    say("held@%d ", now());
    return 1;
}

/* ---- the client */

char *client_fill(const char *text, const struct client_words *words)
{
    if (strcmp(words->endpoint, "tcp:127.0.0.1:7") != 0 || strcmp(words->out, "folder/some.points") != 0) say("FILL ");
    return strdup(text);
}

int client_start(struct client *client, const char *line, const char *log, const char *out, struct sh_err *err)
{
    if (strcmp(log, "folder/some.log") != 0 || client->in_fd != -1) say("CLIENT ");
    say("%s>%s@%d ", line, out != NULL ? out : "log", now());
    client->started_ns = clock_rig_ns;
    client->pid = 5;
    if (client_does != NULL) client_does();
    return call(err, "client");
}

int client_has_ended(struct client *client)
{
    if (client->pid == 0) say("ENDED "); /* there is none */
    return now() >= plan.ends;
}

void client_end(struct client *client, double grace_s)
{
    if (client->pid != 5) say("CLIENT ");
    say("stop_client:%g@%d ", grace_s, now());
}

/* ---- the checks */

void checks_judge(const struct checks *checks, struct verdict *of)
{
    seen = *checks;
    if (checks->options != &options || checks->watch != watch || of != &verdict || checks->client->pid != 5)
        say("JUDGE ");
    say("judge ");
    for (int i = 0; i < VERDICT_N_CHECKS; i++)
        of->check[i].state = i == VERDICT_LIVES || i == VERDICT_ENDS ? VERDICT_FOUND : VERDICT_PASSED;
}

void checks_no_points(struct verdict *of, enum verdict_state state, const char *why)
{
    say("%s:%s ", of == &verdict && state == VERDICT_FOUND ? "found" : "not_judged", why);
}

void checks_points(struct verdict *of, const struct verdict_points *match, const double unknown[3])
{
    say(of == &verdict && match->n == n_matched && unknown == xyz_m[first_unknown] ? "points " : "POINTS ");
}

int cloud_read_positions(const char *path, const struct sh_report *report, struct cloud *out, struct sh_err *err)
{
    if (report != &app_report_quiet) say("CLOUD ");
    *out = (struct cloud){.n = 9, .xyz_m = xyz_m};
    say("read:%s ", path);
    return call(err, "cloud");
}

void cloud_free(struct cloud *cloud)
{
    say(cloud->xyz_m == xyz_m ? "free_cloud " : "CLOUD ");
}

int match_points(const struct match_input *in, struct verdict_points *match, struct sh_err *err)
{
    if (in->stream != stream || in->watch != watch || in->tick_ns != 5 * MS || in->cloud->n != 9) say("MATCH ");
    if (in->report != &app_report_stderr) say("REPORT ");
    match_m = in->match_m;
    *match = (struct verdict_points){.n = n_matched, .first_unknown = first_unknown};
    return call(err, "match");
}

/* ---- the run */

int make_run(void **state)
{
    (void)state;
    memset(&cfg, 0, sizeof cfg);
    cfg.n_links = 3;
    cfg.link[1].type = LINK_TCP;
    cfg.head.settings.frames = 7;
    options = (struct verdict_options){.command = "client",
                                       .folder = "folder",
                                       .truth = "truth.jsonl",
                                       .duration_s = 0.5,
                                       .limit_s = 0.2,
                                       .grace_s = 5,
                                       .match_m = -1,
                                       .link = 2};
    memset(&verdict, 0, sizeof verdict);
    strcpy(verdict.scenario, "some");
    plan = (struct plan_of_run){
        .up = 30, .connects = 50, .first_points = 70, .last_points = NOT_EVER, .ends = NOT_EVER, .stop = NOT_EVER};
    trace[0] = warned[0] = '\0';
    fails = NULL;
    protocol = "native";
    short_of = "";
    stream = NULL;
    watch = NULL;
    is_short = 0;
    client_does = NULL;
    n_matched = 4;
    first_unknown = 6;
    seen = (struct checks){0};
    clock_rig_ns = START_MS * MS;
    return 0;
}

int run_it(struct sh_err *err)
{
    trace[0] = '\0';
    return verdict_run(&cfg, &options, &verdict, err);
}
