/* SPDX-License-Identifier: MIT */
/* scanhead run FILE.shs: serves a recording. */
#include <stdio.h>
#include <string.h>

#include "firmware_sim/app/run/run.h"
#include "firmware_sim/config/config.h"

static const char DEFAULT_LINKS[] = "links:\n- {type: pty}\n- {type: tcp}\n";

int run_take_link(void *values, const char *text)
{
    struct run_options *o = values;
    const size_t used = strlen(o->links);
    const int is_word = strpbrk(text, ":{ ") == NULL;
    if (text[0] == '\0' || strpbrk(text, "\n#") != NULL)
        return app_usage(&app_run, "--link '%.40s': allowed are pty, tcp, ... or keys such as 'type: tcp, port: 5025'",
                         text);
    const int n = snprintf(o->links + used, sizeof o->links - used, is_word ? "- {type: %s}\n" : "- {%s}\n", text);
    if (n >= (int)(sizeof o->links - used))
        return app_usage(&app_run, "--link: too long; all --link together share %zu characters", sizeof o->links - 1);
    return APP_OK;
}

static int check_head(const struct run_options *o)
{
    const char *option = o->replay.speed > 0.0    ? "--speed"
                         : o->replay.from_s > 0.0 ? "--from"
                         : o->replay.to_s > 0.0   ? "--to"
                         : o->replay.loop         ? "--loop"
                         : o->clients > 0         ? "--clients"
                         : o->links[0] != '\0'    ? "--link"
                         : o->config != NULL      ? "--config"
                         : o->unknown != NULL     ? "--unknown"
                         : o->device_port != 0    ? "--device-port"
                                                  : NULL;
    if (option == NULL) return APP_GO_ON;
    return app_usage(&app_run, "%s is for a recording, but %s is a configuration; allowed with FILE.shs, FILE.pcapng",
                     option, o->in.operand[0]);
}

int run_check_options(const struct run_options *o, int is_recording)
{
    if (!is_recording) return check_head(o);
    const char *option = o->device.journal != NULL  ? "--journal"
                         : o->device.replay != NULL ? "--replay-journal"
                         : o->surfaces != NULL      ? "--surfaces"
                         : o->frames_given          ? "--frames"
                                                    : NULL;
    if (option != NULL)
        return app_usage(&app_run, "%s needs a head that computes, but %s is a recording; allowed with a CONFIG",
                         option, o->in.operand[0]);
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
    fprintf(stderr, "%s: replay of %s: %s\n", app_program, o->in.operand[0], s.idn);
    run_say_links(loop);
    if (!o->device.start)
        fprintf(stderr, "%s: it is played when a client starts scans, natively with SCAN:START\n", app_program);
}

static void say_what_ran(const struct run_options *o, struct replay *replay)
{
    struct replay_summary s;
    replay_get_summary(replay, &s);
    if (s.repeated + s.late != 0)
        sh_warn(&app_report_stderr, "%s: %llu frames left out, which came twice or too late", o->in.operand[0],
                (unsigned long long)(s.repeated + s.late));
    if (s.bad_bytes != 0)
        sh_warn(&app_report_stderr, "%s: %llu bytes left out, which belong to no complete frame%s", o->in.operand[0],
                (unsigned long long)s.bad_bytes, s.cut ? "; its end is cut off" : "");
    if (!o->quiet)
        fprintf(stderr, "%s: %llu frames replayed, begun %u time%s\n", app_program, (unsigned long long)s.frames,
                s.times, s.times == 1 ? "" : "s");
}

static int serve(const struct run_options *o, struct replay *replay, struct loop *loop, struct sh_err *err)
{
    struct loop_stats stats;
    if (!o->quiet) say_what_runs(o, replay, loop);
    int rc = run_serve(o, loop, &stats, err);
    say_what_ran(o, replay);
    run_warn_losses(&stats.counters);
    if (rc == SH_OK) rc = replay_check(replay, err);
    return rc == SH_OK ? loop_check_links(loop, err) : rc;
}

static int replay(struct config *cfg, void *ctx, struct sh_err *err)
{
    struct run_options *o = ctx;
    struct replay *replay = NULL;
    struct loop *loop = NULL;
    const struct loop_options options = {.hash = o->stats != NULL && !o->no_hash, .report = &app_report_stderr};
    int rc = o->view ? run_add_view(cfg, err) : SH_OK;
    if (rc == SH_OK && cfg->n_links == 0)
        rc = sh_fail(err, SH_EINPUT,
                     "%s: links: none; a replay needs at least one of pty, tcp, udp, usb, web, file, null", cfg->file);
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
    const char *option = o->unknown != NULL ? "--unknown" : o->device_port != 0 ? "--device-port" : NULL;
    if (option != NULL)
        return app_usage(&app_run, "%s is for a capture of packets, but %s is a recording of a head; not allowed here",
                         option, o->in.operand[0]);
    if (o->config != NULL) {
        struct app_input in = o->in;
        in.operand[0] = o->config;
        return app_with_config(&in, replay, o);
    }
    snprintf(text, sizeof text, "links:\n%s", o->links);
    return app_with_links(&o->in, o->links[0] != '\0' ? text : DEFAULT_LINKS, replay, o);
}
