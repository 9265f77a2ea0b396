/* SPDX-License-Identifier: MIT */
/* scanhead soak runs a head with injected faults and our own clients. At the end the command prints a sheet of what
 * each client noticed. With --client the command runs somebody else's client instead (verdicts.h). */
#include "drivers/link/link.h"
#include "firmware_sim/app/studio/soak/clean.h"
#include "firmware_sim/app/studio/soak/client.h"
#include "firmware_sim/app/studio/soak/datagrams.h"
#include "firmware_sim/app/studio/soak/head.h"
#include "firmware_sim/app/studio/soak/judge.h"
#include "firmware_sim/app/studio/soak/ledger.h"
#include "firmware_sim/app/studio/soak/sheet.h"
#include "firmware_sim/app/studio/soak/usb.h"
#include "firmware_sim/app/studio/soak/verdicts.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/fault/board.h"
#include "firmware_sim/loop/loop.h"

#include <poll.h>
#include <stdlib.h>
#include <string.h>

#include "firmware_sim/app/app.h"
#include "firmware_sim/app/studio/soak/soak.h"
#include "firmware_sim/base/clock.h"

enum { WAIT_MS = 20, READY_MS = 30000, HEAD_SEEN_MS = 2500, DRAIN_MS = 5000, HEALTH_MS = 6000 };

struct soak_options {
    struct app_input in;
    struct device_options device;
    double duration_s;
    long link;
    double match_mm;
    struct verdicts verdicts;
    int quiet;
};

struct soak_head {
    struct site *site;
    struct device *device;
    struct loop *loop;
};

/* ---- waiting */

static int wait_until(struct soak *soak, int (*is_so)(struct soak *soak), int64_t most_ms)
{
    const int64_t end_ns = clock_now_ns() + 1000000 * most_ms;
    while (!is_so(soak)) {
        if (app_interrupted() || clock_now_ns() > end_ns) return 0;
        poll(NULL, 0, WAIT_MS);
    }
    return 1;
}

static int has_answered(struct soak *soak)
{
    return atomic_load(&soak->clean.want_health) == 2 || soak->clean.failed[0] != '\0';
}

static int scans(struct soak *soak)
{
    pthread_mutex_lock(&soak->clean.lock);
    const int is_so = soak->clean.points_frames != 0;
    pthread_mutex_unlock(&soak->clean.lock);
    return is_so;
}

static int all_done(struct soak *soak)
{
    for (uint32_t i = 0; i < soak->n_links; i++)
        if (soak->link[i].usable && !atomic_load(&soak->link[i].done)) return 0;
    return 1;
}

static int is_head_seen(struct soak *soak)
{
    for (uint32_t i = 0; i < soak->n_links; i++)
        if (!soak_is_head_seen(&soak->link[i])) return 0;
    return 1;
}

/* ---- the run */

/* At pace realtime, the time since from_ns by the clock; else device time since the first points. */
static double passed_s(struct soak *soak, int64_t from_ns)
{
    if (soak->realtime) return 1e-9 * (double)(clock_now_ns() - from_ns);
    pthread_mutex_lock(&soak->clean.lock);
    const double s = 1e-9 * (double)(soak->clean.last_t_ns - soak->clean.first_points_ns);
    pthread_mutex_unlock(&soak->clean.lock);
    return s;
}

static void soak_on(const struct soak_options *o, struct soak *soak)
{
    const int64_t from_ns = clock_now_ns();
    int64_t said_ns = from_ns;
    double s;
    while ((s = passed_s(soak, from_ns)) < o->duration_s && !app_interrupted() && soak->clean.failed[0] == '\0' &&
           !all_done(soak)) {
        poll(NULL, 0, WAIT_MS);
        if (o->quiet || clock_now_ns() - said_ns < 1000000000) continue;
        said_ns += 1000000000;
        soak_say_progress(soak, s);
    }
    soak->wall_s = 1e-9 * (double)(clock_now_ns() - from_ns);
}

/* Ends the injection of faults, and gives clients the time to notice those so far. */
static void drain(struct soak *soak)
{
    fault_board_end(soak->board, 0, INT64_MIN); /* all, at once */
    wait_until(soak, is_head_seen, HEAD_SEEN_MS);
    atomic_store(&soak->until, soak_clean_top(soak) + 1);
    atomic_store(&soak->phase, SOAK_DRAINS);
    wait_until(soak, all_done, DRAIN_MS);
    atomic_store(&soak->clean.want_health, 1);
    wait_until(soak, has_answered, HEALTH_MS);
}

static int run_clients(const struct soak_options *o, struct soak *soak, struct sh_err *err)
{
    int rc = soak_clean_start(soak, err);
    if (rc == SH_OK) rc = soak_clients_start(soak, err);
    if (rc != SH_OK) return rc;
    if (!wait_until(soak, scans, READY_MS) && !app_interrupted())
        return sh_fail(err, SH_ESTATE, "soak: no scan began within %d s", READY_MS / 1000);
    soak_on(o, soak);
    drain(soak);
    return SH_OK;
}

/* Clients read on until the links are closed, which is when the loop is freed. */
static int soak_serve(const struct soak_options *o, struct soak *soak, struct soak_head *head, struct sh_err *err)
{
    int rc = loop_start(head->loop, err);
    if (rc == SH_OK) rc = run_clients(o, soak, err);
    atomic_store(&soak->phase, SOAK_ENDS);
    loop_end(head->loop);
    loop_join(head->loop, &soak->stats);
    loop_free(head->loop);
    head->loop = NULL;
    soak_clients_join(soak);
    soak_clean_join(soak);
    if (rc == SH_OK) rc = device_close_journal(head->device, err);
    for (uint32_t i = 0; i < soak->n_links; i++) {
        soak_judge(&soak->link[i], 1);
        soak_judge_head(&soak->link[i]);
    }
    return rc;
}

/* ---- the command */

static int say_result(const struct soak_options *o, struct soak *soak, struct sh_err *err)
{
    soak_conclude(soak);
    soak_warn_hidden(soak, &app_report_stderr);
    soak_print(soak, verdicts_out(&o->verdicts));
    const int rc = o->verdicts.json != NULL ? app_write_json(o->verdicts.json, soak_put, soak, err) : SH_OK;
    if (rc != SH_OK || soak->n_failures == 0) return rc;
    return sh_fail(err, SH_ESTATE, "soak: %s", soak->failures[0]);
}

/* Adds a second link, without faults, beside each udp link. A udp link without such a second one gets no client. A USB
 * device that is attached to this machine gets a serial number where none is configured. Where no client could start a
 * scan, the head does so itself. */
static void open_clean_links(struct config *cfg, struct soak *soak, struct soak_options *o)
{
    int starts = 0;
    soak->n_links = cfg->n_links;
    for (uint32_t i = 0; i < soak->n_links; i++) {
        soak_usb_name(&cfg->link[i], i + 1);
        starts |= cfg->link[i].protocol == 0 && (cfg->link[i].type == LINK_TCP || cfg->link[i].type == LINK_PTY);
        starts |= soak_usb_is_here(&cfg->link[i]);
        if (cfg->link[i].type != LINK_UDP || cfg->n_links == CONFIG_MAX_LINKS) continue;
        soak->datagrams[i] = soak_datagrams_open(&cfg->link[i], &cfg->link[cfg->n_links]);
        cfg->n_links += soak->datagrams[i] != NULL;
    }
    o->device.start = !starts || cfg->head.start;
}

static int open_head(struct soak_options *o, struct config *cfg, struct soak *soak, struct soak_head *head,
                     struct sh_err *err)
{
    const struct loop_options options = {.hash = 1, .extra = &soak->clean.link, .report = &app_report_stderr};
    o->device.report = &app_report_stderr;
    int rc = site_load(cfg, &app_report_stderr, &head->site, err);
    if (rc == SH_OK) rc = site_open_sights(head->site, 0, head->site->n_stations, &app_report_stderr, err);
    /* From here on the scan has no end. The plan above is made for head.frames of the configuration, as with
     * `run --start --duration`. */
    cfg->head.settings.frames = 0;
    if (rc == SH_OK) rc = device_create(head->site, &o->device, &head->device, err);
    if (rc == SH_OK) rc = soak_clean_open(soak, err);
    if (rc == SH_OK) rc = loop_create(head->site, head->device, &options, &head->loop, err);
    if (rc != SH_OK) return rc;
    soak->board = device_faults(head->device);
    rc = soak_clients_open(soak, head->loop, (uint32_t)o->link, err);
    if (rc == SH_OK) fault_board_listen(soak->board, soak_heard, soak);
    return rc;
}

static int soak_head(struct config *cfg, void *ctx, struct sh_err *err)
{
    struct soak_options *o = ctx;
    struct soak_head head = {0};
    if (cfg->loop.pace == PACE_STEP)
        return sh_fail(err, SH_EINPUT, "loop.pace: step, but no client grants time; allowed realtime and fast");
    if (soak_check_link(cfg, (uint32_t)o->link, err) != SH_OK) return SH_EINPUT;
    app_warn_settings_file(cfg, "a soak has the settings of the configuration");
    struct soak *soak = calloc(1, sizeof *soak);
    if (soak == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    soak->cfg = cfg;
    soak->realtime = cfg->loop.pace == PACE_REALTIME;
    if (soak->realtime) verdict_be_patient(cfg); /* at pace fast the head waits for readers, and queues stay short */
    soak->faults = cfg->faults;
    open_clean_links(cfg, soak, o);
    int rc = open_head(o, cfg, soak, &head, err);
    if (rc == SH_OK) rc = soak_serve(o, soak, &head, err);
    if (rc == SH_OK) rc = say_result(o, soak, err);
    loop_free(head.loop);
    soak_clients_close(soak);
    soak_clean_close(soak);
    device_free(head.device);
    site_free(head.site);
    free(soak);
    return rc;
}

static int take_scenario(void *values, const char *text)
{
    struct soak_options *o = values;
    if (o->verdicts.n == VERDICTS_MAX_SCENARIOS)
        return app_usage(&app_soak, "--scenario %s: at most %d are allowed", text, VERDICTS_MAX_SCENARIOS);
    o->verdicts.scenario[o->verdicts.n++] = o->in.scenario = text;
    return APP_OK;
}

static int take_allowed(void *values, const char *text)
{
    struct soak_options *o = values;
    struct sh_err err;
    const int check = app_find_word("allow", text, verdict_names, VERDICT_N_CHECKS, &err);
    if (check < 0) return app_usage(&app_soak, "%s", err.text);
    o->verdicts.options.allowed |= 1U << check;
    return APP_OK;
}

/* Some options go only with a client, and --truth goes only with one scenario. */
static int check_options(const struct soak_options *o)
{
    const struct verdicts *v = &o->verdicts;
    const int is_theirs = v->options.command != NULL;
    const int has_texts = v->options.file != NULL || v->options.folder != NULL || v->junit != NULL;
    const int has_numbers = v->options.limit_s > 0.0 || v->options.grace_s > 0.0 || o->match_mm >= 0.0;
    if (!is_theirs && (has_texts || has_numbers || v->options.allowed != 0))
        return app_usage(&app_soak, "--client-file, --client-folder, --client-grace, --reconnect-limit, --match-mm, "
                                    "--allow and --junit need --client");
    if (!is_theirs && v->n > 1) return app_usage(&app_soak, "several --scenario need --client");
    if (v->n > 1 && o->device.truth != NULL)
        return app_usage(&app_soak, "--truth is one file, and %u scenarios are given; allowed is one", v->n);
    return APP_GO_ON;
}

static int run_theirs(struct soak_options *o)
{
    struct verdict_options *v = &o->verdicts.options;
    v->duration_s = o->duration_s;
    v->match_m = 1e-3 * o->match_mm;
    if (v->limit_s <= 0.0) v->limit_s = 10.0;
    if (v->grace_s <= 0.0) v->grace_s = 5.0;
    v->link = o->link != 0 ? (uint32_t)o->link : 1;
    return verdicts_run(&o->verdicts, &o->in);
}

static int soak_run_command(int argc, char **argv)
{
    struct soak_options o = {.duration_s = 30.0, .match_mm = -1.0};
    int status = app_parse(&app_soak, argc, argv, &o.in, &o);
    if (status == APP_GO_ON) status = check_options(&o);
    if (status != APP_GO_ON) return status;
    o.verdicts.options.truth = o.device.truth;
    app_catch_signals();
    if (o.verdicts.options.command != NULL) return run_theirs(&o);
    return app_with_config(&o.in, soak_head, &o);
}

#define AT(member) offsetof(struct soak_options, member)

/* clang-format off */
static const struct app_option OPTIONS[] = {
    {APP_CALL, "scenario", "FILE", .apply = take_scenario, .file = APP_READS,
     .help = "add the faults of this file to those of the configuration; a bare name is one of config/faults. With "
             "--client it may be repeated: each is run in turn"},
    {APP_NUMBER, "duration", "S", .min = 0.1, .max = 1e8, .at = AT(duration_s),
     .help = "inject faults for S seconds from the first points on (default 30); with --pace fast S is device time"},
    {APP_WHOLE, "link", "N", .min = 1, .max = CONFIG_MAX_LINKS, .at = AT(link),
     .help = "connect a client only to this link of the configuration; with --client: the link that it gets (default 1)"},
    {APP_TEXT, "client", "COMMAND", .at = AT(verdicts.options.command),
     .help = "run this by sh -c in place of our own clients, and judge it; {endpoint}, {host}, {port}, {path} and {out} "
             "are filled in"},
    {APP_TEXT, "client-file", "FILE", .at = AT(verdicts.options.file), .file = APP_READS,
     .help = "compare the points that the client leaves in this file (PLY, LAS, PCD, or text) with those of the head; - "
             "is its standard output"},
    {APP_TEXT, "client-folder", "DIR", .at = AT(verdicts.options.folder),
     .help = "put logs and {out} there (default: a new folder in TMPDIR)"},
    {APP_NUMBER, "reconnect-limit", "S", .min = 0.01, .max = 3600.0, .at = AT(verdicts.options.limit_s),
     .help = "the client has to connect within S seconds, and after a disturbance again (default 10)"},
    {APP_NUMBER, "client-grace", "S", .min = 0.01, .max = 3600.0, .at = AT(verdicts.options.grace_s),
     .help = "the client has to end within S seconds of SIGTERM (default 5)"},
    {APP_NUMBER, "match-mm", "MM", .min = 0.0, .max = 1e6, .at = AT(match_mm),
     .help = "allow a difference of MM plus the file's rounding between coordinates of points (default 0.01; scip and "
             "cola 2, velodyne 20)"},
    {APP_CALL, "allow", "CHECK", .apply = take_allowed, .choices = verdict_names, .n_choices = VERDICT_N_CHECKS,
     .help = "a finding of this check does not count; may be repeated"},
    {APP_TEXT, "junit", "FILE", .at = AT(verdicts.junit), .file = APP_FILLS,
     .help = "write the verdict on the client as JUnit XML, too"},
    {APP_TEXT, "json", "FILE", .at = AT(verdicts.json), .file = APP_FILLS,
     .help = "write the results as JSON, too; - is standard output, and the table then goes to standard error"},
    {APP_TEXT, "truth", "FILE", .at = AT(device.truth), .file = APP_FILLS,
     .help = "write each fault that is injected as a line of JSON; - as with --json"},
    {APP_KEY, "pace", "PACE", .key = "loop.pace", .help = "realtime or fast"},
    OPTION_SET,
    {APP_FLAG, "quiet", NULL, .at = AT(quiet), .help = "no progress"},
    OPTION_END
};
/* clang-format on */

#define CHECK_LINE(id, name, asks) "  " name ": " asks "\n"
static const char NOTES[] =
    "The results have a row for each link and kind of fault: how often it was injected, how often the client\n"
    "noticed it at its place, frames that the client lost by it, and frames that it accepted although they differ\n"
    "from the clean ones. A fault that no client can notice has a - and the reason.\n"
    "\n"
    "Exit status 0: each fault that can be noticed was noticed; frames were lost only by faults; all frames that\n"
    "were wrongly accepted have flipped bits with a corrected checksum; the head is healthy. 1: one of these is\n"
    "not so.\n"
    "\n"
    "With --client the results are checks of that client, by what the head sees of it. Exit status 0: there are no\n"
    "findings; 1: there are. The checks, with what each asks for:\n" VERDICT_CHECKS(CHECK_LINE);

const struct app_command app_soak = {
    .name = "soak",
    .operand = {"CONFIG"},
    .summary = "inject faults into a head with clients, and report what the clients notice",
    .options = OPTIONS,
    .opens_links = 1,
    .notes = NOTES,
    .run = soak_run_command,
};
