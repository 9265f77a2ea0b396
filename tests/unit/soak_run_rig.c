/* SPDX-License-Identifier: MIT */
#include "tests/unit/soak_run_rig.h"

#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "firmware_sim/app/app.h"
#include "firmware_sim/app/studio/soak/client.h"
#include "firmware_sim/app/studio/soak/datagrams.h"
#include "firmware_sim/app/studio/soak/judge.h"
#include "firmware_sim/app/studio/soak/ledger.h"
#include "firmware_sim/app/studio/soak/sheet.h"
#include "firmware_sim/app/studio/soak/soak.h"
#include "firmware_sim/app/studio/soak/verdicts.h"
#include "firmware_sim/config/config.h"
#include "tests/unit/clock_rig.h"

#define MS INT64_C(1000000)

struct times when;
int is_bad;

static struct soak *soak;
static const struct config *cfg;
static struct site site = {.n_stations = 3};
static struct device *const device = (struct device *)&site;
static struct loop *const loop = (struct loop *)&soak;
static struct fault_board *const board = (struct fault_board *)&trace;

static int now(void)
{
    return (int)(clock_rig_ns / MS);
}

int poll(struct pollfd *fds, nfds_t n, int timeout_ms)
{
    (void)fds;
    if (n != 0 || timeout_ms != 20) say("POLL ");
    clock_rig_ns += 20 * MS;
    struct soak_clean *c = &soak->clean;
    if (now() >= when.scans && c->points_frames++ == 0) c->first_points_ns = 5000 * MS;
    c->last_t_ns = c->first_points_ns + 10 * (now() - when.scans) * MS; /* device time is ten times as fast */
    for (uint32_t i = 0; i < soak->n_links; i++)
        atomic_store(&soak->link[i].done, now() >= when.done);
    if (atomic_load(&c->want_health) == 1 && now() >= when.answers) atomic_store(&c->want_health, 2);
    if (now() >= when.breaks) strcpy(c->failed, "it broke");
    return 0;
}

/* ---- the head */

int site_load(const struct config *of, const struct sh_report *report, struct site **out, struct sh_err *err)
{
    if (report != &app_report_stderr || of->head.settings.frames != 7) say("LOAD ");
    cfg = of;
    *out = &site;
    return call(err, "site");
}

int site_open_sights(struct site *of, uint32_t first, uint32_t n, const struct sh_report *report, struct sh_err *err)
{
    if (of != &site || first != 0 || n != 3 || report != &app_report_stderr) say("SIGHTS ");
    return call(err, "sights");
}

void site_free(struct site *of)
{
    say("free_site%s", of == &site ? "" : ":none");
}

int device_create(const struct site *of, const struct device_options *o, struct device **out, struct sh_err *err)
{
    if (of != &site || o->report != &app_report_stderr || cfg->head.settings.frames != 0) say("DEVICE ");
    say("%s%s", o->start ? "starting_" : "", o->truth != NULL ? "truth_" : "");
    const int rc = call(err, "device");
    if (rc == SH_OK) *out = device;
    return rc;
}

void device_free(struct device *of)
{
    say("free_device%s ", of == device ? "" : ":none");
}

struct fault_board *device_faults(const void *of)
{
    return of == device ? board : NULL;
}

int device_close_journal(void *of, struct sh_err *err)
{
    if (of != device) say("JOURNAL ");
    return call(err, "journal");
}

void fault_board_listen(struct fault_board *of, void (*heard)(void *ctx, const struct fault_note *note), void *ctx)
{
    say(of == board && heard == soak_heard && ctx == soak ? "listen " : "LISTEN ");
}

uint32_t fault_board_end(struct fault_board *of, uint32_t number, int64_t t_ns)
{
    say(of == board && number == 0 && t_ns == INT64_MIN ? "no_faults@%d " : "NO_FAULTS ", now());
    return 0;
}

int loop_create(const struct site *of, struct device *on, const struct loop_options *o, struct loop **out,
                struct sh_err *err)
{
    if (of != &site || on != device || o->extra != &soak->clean.link || !o->hash) say("LOOP ");
    if (o->report != &app_report_stderr) say("REPORT ");
    const int rc = call(err, "loop");
    if (rc == SH_OK) *out = loop;
    return rc;
}

int loop_start(struct loop *of, struct sh_err *err)
{
    if (of != loop) say("START ");
    return call(err, "run");
}

void loop_end(struct loop *of)
{
    say(of == loop && atomic_load(&soak->phase) == SOAK_ENDS ? "end@%d " : "END ", now());
}

void loop_join(struct loop *of, struct loop_stats *stats)
{
    say(of == loop && stats == &soak->stats ? "join " : "JOIN ");
}

void loop_free(struct loop *of)
{
    if (of != NULL) say(of == loop ? "free_loop " : "FREE_LOOP ");
}

/* ---- the clean reader and the clients */

int soak_clean_open(struct soak *of, struct sh_err *err)
{
    soak = of;
    pthread_mutex_init(&soak->clean.lock, NULL);
    if (cfg->n_links != of->n_links) say("beside:%u ", cfg->n_links - of->n_links);
    return call(err, "clean");
}

int soak_clean_start(struct soak *of, struct sh_err *err)
{
    if (of != soak) say("CLEAN ");
    return call(err, "read");
}

void soak_clean_join(struct soak *of)
{
    if (of == soak) say("join_clean ");
}

void soak_clean_close(struct soak *of)
{
    (void)of;
    say("close_clean ");
}

soak_seq soak_clean_top(struct soak *of)
{
    return of == soak ? 70 : 0;
}

int soak_clients_open(struct soak *of, const struct loop *on, uint32_t only, struct sh_err *err)
{
    for (uint32_t i = 0; i < of->n_links; i++)
        of->link[i].usable = i == 0;
    if (on != loop) say("CLIENTS ");
    if (only != 0) say("only%u_", only);
    if (of->faults.n != 0) say("faults%u_", of->faults.n);
    return call(err, "clients");
}

int soak_clients_start(struct soak *of, struct sh_err *err)
{
    if (of != soak) say("CLIENTS ");
    return call(err, "connect");
}

void soak_clients_join(struct soak *of)
{
    if (of == soak) say("join_clients ");
}

void soak_clients_close(struct soak *of)
{
    (void)of;
    say("close_clients ");
}

int soak_is_head_seen(struct soak_link *link)
{
    if (atomic_load(&soak->phase) != SOAK_RUNS || link->soak != NULL) say("SEEN ");
    return now() >= when.seen;
}

struct soak_datagrams *soak_datagrams_open(const struct link_spec *spec, struct link_spec *clean_link)
{
    *clean_link = *spec;
    clean_link->clean = 1;
    return spec->port == 2368 ? (struct soak_datagrams *)&when : NULL;
}

/* ---- the results */

void soak_heard(void *of, const struct fault_note *note)
{
    (void)of;
    (void)note;
}

void soak_judge(struct soak_link *link, int all)
{
    if (!all) say("JUDGE ");
    say("judge%d ", (int)(link - soak->link));
}

void soak_judge_head(struct soak_link *link)
{
    say("head%d ", (int)(link - soak->link));
}

void soak_conclude(struct soak *of)
{
    if (of == soak) say("conclude:%llu ", (unsigned long long)atomic_load(&soak->until));
    soak->failures[0] = "it is bad";
    soak->n_failures = (uint32_t)is_bad;
}

void soak_warn_hidden(const struct soak *of, const struct sh_report *report)
{
    say(of == soak && report == &app_report_stderr ? "hidden " : "HIDDEN ");
}

void soak_print(const struct soak *of, FILE *out)
{
    fprintf(out, "sheet of %.2f s\n", of->wall_s);
}

void soak_put(struct json *json, const void *of)
{
    json_open_object(json, NULL);
    json_double(json, "wall_s", ((const struct soak *)of)->wall_s);
    json_close_object(json);
}

void soak_say_progress(struct soak *of, double s)
{
    if (of == soak) say("%g@%d ", s, now());
}

FILE *verdicts_out(const struct verdicts *v)
{
    return v->json != NULL && strcmp(v->json, "-") == 0 ? stderr : stdout;
}

int soak_check_link(const struct config *of, uint32_t number, struct sh_err *err)
{
    return number <= of->n_links ? SH_OK : sh_fail(err, SH_EINPUT, "no link %u", number);
}

int verdicts_run(struct verdicts *v, struct app_input *in)
{
    (void)v;
    (void)in;
    return 0;
}

void verdict_be_patient(struct config *of)
{
    (void)of;
    say("patience ");
}

int make_soak_run(void **state)
{
    (void)state;
    trace[0] = '\0';
    fails = NULL;
    soak = NULL;
    is_bad = 0;
    when = (struct times){.scans = 40, .done = NOT_EVER, .seen = 0, .answers = 0, .breaks = NOT_EVER};
    clock_rig_ns = 0;
    return 0;
}
