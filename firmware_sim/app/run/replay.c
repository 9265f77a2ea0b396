/* SPDX-License-Identifier: MIT */
/* scanhead run FILE.shs: serves a recording. */
#include <stdio.h>
#include <string.h>

#include "firmware_sim/app/run/run.h"
#include "firmware_sim/config/config.h"

/* Each --link is a line of YAML, from 1 on, so the line in a message is the number of the option. */
static const char DEFAULT_LINKS[] = "links: [{type: pty}, {type: tcp}]";

int run_take_link(void *values, const char *text)
{
    struct run_options *o = values;
    const size_t used = strlen(o->links);
    const int is_word = strpbrk(text, ":{ ") == NULL;
    if (text[0] == '\0' || strpbrk(text, "\n#") != NULL)
        return app_usage(&app_run, "--link '%.40s': allowed are pty, tcp, ... or keys such as 'type: tcp, port: 5025'",
                         text);
    const int n = snprintf(o->links + used, sizeof o->links - used, is_word ? "{type: %s},\n" : "{%s},\n", text);
    if (n >= (int)(sizeof o->links - used))
        return app_usage(&app_run, "--link: too long; all --link together share %zu characters", sizeof o->links - 1);
    return APP_OK;
}

/* Options that only some kinds of input allow. The first rows name the kinds, in enum run_kind's order. */
enum { HEAD = 1 << RUN_HEAD, RECORDING = 1 << RUN_RECORDING, CAPTURE = 1 << RUN_CAPTURE };
static const struct {
    int kinds;
    const char *names, *options[6];
} only[] = {
    {HEAD, "a configuration", {"journal", "replay-journal", "surfaces", "frames", "threads"}},
    {RECORDING, "a recording of a head", {"speed", "from", "to", "clients", "config"}},
    {CAPTURE, "a capture of packets", {"unknown", "device-port"}},
    {HEAD | RECORDING, "a configuration or a recording", {"view"}},
    {RECORDING | CAPTURE, "a recording or a capture", {"loop", "link"}},
};

static int check_kind(const struct run_options *o, enum run_kind kind)
{
    for (size_t i = 0; i < sizeof only / sizeof only[0]; i++)
        for (const char *const *option = only[i].options; *option != NULL; option++)
            if ((only[i].kinds >> kind & 1) == 0 && app_is_given(&o->in, *option))
                return app_usage(&app_run, "--%s is for %s, but %s is %s", *option, only[i].names, o->in.operand[0],
                                 only[kind].names);
    return APP_GO_ON;
}

int run_check_options(const struct run_options *o, enum run_kind kind)
{
    if (check_kind(o, kind) != APP_GO_ON) return APP_USAGE;
    if (o->config != NULL && o->links[0] != '\0')
        return app_usage(&app_run, "--config and --link: both give the links; allowed is one of them");
    if (o->clients > 0 && !o->device.start)
        return app_usage(&app_run,
                         "--clients: without --start a client's SCAN:STARt begins the replay; allowed with --start");
    if (o->replay.to_s > 0.0 && o->replay.to_s <= o->replay.from_s)
        return app_usage(&app_run, "--to %.10g is not after --from, which is %.10g; allowed is a larger number",
                         o->replay.to_s, o->replay.from_s);
    return APP_GO_ON;
}

static void say_what_runs(const struct run_options *o, struct replay *replay, const struct loop *loop)
{
    struct replay_summary s;
    replay_get_summary(replay, &s);
    app_say("replay of %s: %s", o->in.operand[0], s.idn);
    run_say_links(loop);
    if (!o->device.start) app_say("it is played when a client starts scans (in the native protocol: SCAN:STARt)");
}

static void say_what_ran(const struct run_options *o, struct replay *replay)
{
    struct replay_summary s;
    replay_get_summary(replay, &s);
    if (s.repeated + s.late != 0)
        sh_warn(&app_report_stderr, "%s: %llu frames left out, which came twice or too late", o->in.operand[0],
                (unsigned long long)(s.repeated + s.late));
    if (s.refused != 0)
        sh_warn(&app_report_stderr, "%s: %llu frames left out, which have wrong contents or another version",
                o->in.operand[0], (unsigned long long)s.refused);
    if (s.bad_bytes != 0)
        sh_warn(&app_report_stderr, "%s: %llu bytes left out, which belong to no complete frame%s", o->in.operand[0],
                (unsigned long long)s.bad_bytes, s.cut ? "; its end is cut off" : "");
    if (!o->quiet)
        app_say("%llu frames replayed, begun %u time%s", (unsigned long long)s.frames, s.times,
                s.times == 1 ? "" : "s");
}

static int serve(const struct run_options *o, struct replay *replay, struct loop *loop, struct sh_err *err)
{
    struct sh_err why;
    if (!o->quiet) say_what_runs(o, replay, loop);
    const int rc = run_serve(o, loop, err);
    say_what_ran(o, replay);
    return app_and_also(rc, replay_check(replay, &why), &why, err);
}

/* Without --start a client begins the recording. */
static int check_start(const struct run_options *o, const struct config *cfg, struct sh_err *err)
{
    for (uint32_t i = 0; i < cfg->n_links; i++)
        if (replay_has_clients(&cfg->link[i])) return SH_OK;
    if (o->device.start) return SH_OK;
    return sh_fail(err, SH_EINPUT,
                   "%s: without --start a client begins the replay, and null, file and udp links have none; "
                   "allowed are --start, or another link",
                   o->in.operand[0]);
}

/* If the links had room for fewer clients than --clients says, the recording would never begin. A USB link has a
 * console, too. */
static int check_clients(const struct run_options *o, const struct config *cfg, struct sh_err *err)
{
    int places = 0;
    for (uint32_t i = 0; i < cfg->n_links; i++) {
        const struct link_spec *link = &cfg->link[i];
        if (link->type == LINK_TCP || link->type == LINK_WEB) places += link->max_sessions;
        if (link->type == LINK_PTY) places++;
        if (link->type == LINK_USB) places += 2;
    }
    if (o->clients <= places) return SH_OK;
    return sh_fail(err, SH_EINPUT, "--clients %ld: the links have room for %d; allowed is that many, or more links",
                   o->clients, places);
}

static int replay(struct config *cfg, void *ctx, struct sh_err *err)
{
    struct run_options *o = ctx;
    struct replay *replay = NULL;
    struct loop *loop = NULL;
    const struct loop_options options = {.hash = o->stats != NULL && !o->no_hash, .report = &app_report_stderr};
    int rc = run_complete_links(o, cfg, err);
    if (rc == SH_OK) rc = check_start(o, cfg, err);
    if (rc == SH_OK) rc = check_clients(o, cfg, err);
    if (rc == SH_OK && o->replay.speed > 0.0 && cfg->loop.pace != PACE_REALTIME)
        rc = sh_fail(err, SH_EINPUT, "--speed: allowed only with the pace realtime");
    app_warn_settings_file(cfg, "the recording has the settings");
    o->replay.path = o->in.operand[0];
    if (!(o->replay.speed > 0.0)) o->replay.speed = 1.0;
    o->replay.start = o->device.start;
    o->replay.clients = (uint32_t)o->clients;
    o->replay.duration_s = o->device.duration_s;
    o->replay.truth = o->device.truth;
    o->replay.report = &app_report_stderr;
    if (rc == SH_OK) rc = replay_open(cfg, &o->replay, &replay, err);
    const struct loop_source source = {&replay_source, replay};
    if (rc == SH_OK) rc = loop_create_of(cfg, &source, &options, &loop, err);
    if (rc == SH_OK) rc = serve(o, replay, loop, err);
    loop_free(loop);
    replay_free(replay);
    return rc;
}

int run_replay(struct run_options *o)
{
    char text[sizeof o->links + 16];
    struct app_input in = o->in;
    snprintf(text, sizeof text, "links: [%s]", o->links);
    if (o->config != NULL)
        in.operand[0] = o->config;
    else
        in.links = o->links[0] != '\0' ? text : DEFAULT_LINKS;
    return app_with_config(&in, replay, o);
}
