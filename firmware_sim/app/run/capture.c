/* SPDX-License-Identifier: MIT */
/* scanhead run FILE.pcap: serves a capture of a device's traffic. */
#include <stdio.h>
#include <string.h>

#include "firmware_sim/app/run/run.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/replay/capture.h"

struct capture_run {
    struct run_options *o;
    struct replay_capture *capture;
    const struct talk *talk[CONFIG_MAX_LINKS];
    uint64_t taken; /* bit per place that a link serves */
};

/* ---- links */

static int is_wanted(const struct run_options *o, const struct capture_place *place)
{
    return o->device_port == 0 || o->device_port == place->port;
}

/* A link for each port of the capture, or for that of --device-port alone, in YAML: up to CONFIG_MAX_LINKS. The system
 * chooses TCP ports, as the device's own port may need a privilege. */
static void default_links(const struct capture_run *run, char *text, size_t cap)
{
    size_t n = 0;
    int n_links = 0;
    for (uint32_t i = 0; i < capture_n(run->capture) && n_links < CONFIG_MAX_LINKS && n < cap; i++) {
        const struct capture_place *place = capture_place(run->capture, i);
        if (!is_wanted(run->o, place)) continue;
        n += (size_t)snprintf(text + n, cap - n, "{type: %s, port: %d, protocol: capture},\n",
                              place->is_tcp ? "tcp" : "udp", place->is_tcp ? 0 : place->port);
        n_links++;
    }
}

/* Links of --link speak `capture`, unless they say otherwise. */
static void given_links(const char *given, char *text, size_t cap)
{
    size_t n = 0;
    while (*given != '\0' && n < cap) {
        const size_t len = strcspn(given, "\n");
        const int says = memmem(given, len, "protocol:", 9) != NULL;
        const char *end = says ? "}," : ", protocol: capture},";
        n += (size_t)snprintf(text + n, cap - n, "%.*s%s\n", (int)len - 2, given, end);
        given += len + (given[len] == '\n');
    }
}

/* "tcp 2112 of 10.0.0.1, udp 2368 of 10.0.0.1" */
static void name_places(const struct capture_run *run, char *text, size_t cap)
{
    size_t n = 0;
    text[0] = '\0';
    for (uint32_t i = 0; i < capture_n(run->capture) && n < cap; i++) {
        const struct capture_place *p = capture_place(run->capture, i);
        n += (size_t)snprintf(text + n, cap - n, "%s%s %d of %s", i > 0 ? ", " : "", p->is_tcp ? "tcp" : "udp", p->port,
                              p->device);
    }
}

/* Returns the place (a port of a device in the capture) that a link serves: one with the link's port, else the first
 * one that no link has. */
static const struct capture_place *place_for(const struct capture_run *run, const struct link_spec *spec)
{
    const struct capture_place *found = NULL;
    for (uint32_t i = 0; i < capture_n(run->capture); i++) {
        const struct capture_place *place = capture_place(run->capture, i);
        const int fits = place->is_tcp == (spec->type != LINK_UDP) && is_wanted(run->o, place);
        if (!fits || (run->taken & UINT64_C(1) << i) != 0) continue;
        if (place->port == spec->port) return place;
        if (found == NULL) found = place;
    }
    return found;
}

static int join_links(struct capture_run *run, struct config *cfg, struct sh_err *err)
{
    char places[400];
    name_places(run, places, sizeof places);
    if (cfg->n_links == 0 && run->o->device_port != 0)
        return sh_fail(err, SH_EINPUT, "--device-port %ld: %s has no such port; it has %s", run->o->device_port,
                       run->o->in.operand[0], places);
    if (cfg->n_links == 0) return sh_fail(err, SH_EINPUT, "%s: links: none; allowed are 1 or more", cfg->file);
    for (uint32_t i = 0; i < cfg->n_links; i++) {
        struct link_spec *spec = &cfg->link[i];
        const struct capture_place *place = place_for(run, spec);
        if (spec->protocol != PROTOCOL_CAPTURE)
            return sh_fail(err, SH_EINPUT, "%s: links[%u].protocol: %s is a capture; allowed is only capture",
                           cfg->file, i, run->o->in.operand[0]);
        if (spec->type == LINK_UDP && run->o->replay.talk_options.unknown == TALK_CLOSE)
            return sh_fail(err, SH_EINPUT,
                           "--unknown close: links[%u] is udp, which has no connection to end; allowed are silence, "
                           "error, and with tcp close",
                           i);
        if (place == NULL)
            return sh_fail(err, SH_EINPUT, "%s: links[%u]: no port of %s is left for it%s; it has %s", cfg->file, i,
                           run->o->in.operand[0], run->o->device_port != 0 ? " with --device-port" : "", places);
        run->taken |= UINT64_C(1) << (place - capture_place(run->capture, 0));
        run->talk[i] = &place->talk;
        if (spec->type != LINK_UDP || spec->source_port != 0) continue;
        spec->source_port = place->source_port;
        spec->usual_port = 1;
    }
    return SH_OK;
}

/* ---- messages */

static void say_what_runs(const struct capture_run *run, const struct loop *loop)
{
    app_say("answers from %s", run->o->in.operand[0]);
    for (uint32_t i = 0; i < capture_n(run->capture); i++) {
        const struct capture_place *p = capture_place(run->capture, i);
        app_say("%s port %d of %s: %s, %u different requests, %u messages", p->is_tcp ? "tcp" : "udp", p->port,
                p->device, p->is_tcp ? p->talk.kind->name : "datagrams", p->talk.n_requests, p->n_messages);
    }
    run_say_links(loop);
}

static void warn_of_capture(const struct capture_run *run)
{
    const char *file = run->o->in.operand[0];
    struct capture_counts c;
    for (uint32_t i = 0; i < capture_n(run->capture); i++) {
        const struct capture_place *p = capture_place(run->capture, i);
        if (is_wanted(run->o, p) && (run->taken & UINT64_C(1) << i) == 0)
            sh_warn(&app_report_stderr, "%s: %s port %d of %s is not served: no link is left for it", file,
                    p->is_tcp ? "tcp" : "udp", p->port, p->device);
    }
    capture_get_counts(run->capture, &c);
    if (c.missing_bytes != 0)
        sh_warn(&app_report_stderr, "%s: %llu bytes are missing in it; what follows them may be wrong", file,
                (unsigned long long)c.missing_bytes);
    if (c.backward + c.untimed != 0)
        sh_warn(&app_report_stderr,
                "%s: the times of %llu packets go back, and %llu packets have none; their delays may be wrong", file,
                (unsigned long long)c.backward, (unsigned long long)c.untimed);
    if (c.unknown_links != 0)
        sh_warn(&app_report_stderr, "%s: left out %llu packets of other link types, such as %u", file,
                (unsigned long long)c.unknown_links, c.unknown_link);
    if (c.fragments + c.damaged != 0)
        sh_warn(&app_report_stderr, "%s: left out %llu fragments of datagrams, and %llu packets with damaged headers",
                file, (unsigned long long)c.fragments, (unsigned long long)c.damaged);
}

/* ---- the run */

static int serve(struct config *cfg, void *ctx, struct sh_err *err)
{
    struct capture_run *run = ctx;
    struct run_options *o = run->o;
    struct replay *replay = NULL;
    struct loop *loop = NULL;
    const struct loop_options options = {.report = &app_report_stderr};
    int rc = join_links(run, cfg, err);
    if (rc == SH_OK && cfg->loop.pace != PACE_REALTIME)
        rc = sh_fail(err, SH_EINPUT, "loop.pace: a capture has only times of its own; allowed is realtime");
    const struct replay_options replayed = {
        .path = o->in.operand[0],
        .speed = 1.0,
        .talk = run->talk,
        .talk_options = run->o->replay.talk_options,
        /* one second more, so that the last of it gets out */
        .duration_s = o->device.duration_s > 0.0           ? o->device.duration_s
                      : o->device.start && !o->replay.loop ? capture_duration_s(run->capture) + 1.0
                                                           : 0.0,
        .truth = o->device.truth,
        .report = &app_report_stderr,
    };
    if (rc == SH_OK) rc = replay_open(cfg, &replayed, &replay, err);
    const struct loop_source source = {&replay_source, replay};
    if (rc == SH_OK) rc = loop_create_of(cfg, &source, &options, &loop, err);
    if (rc == SH_OK) {
        if (!o->quiet) say_what_runs(run, loop);
        warn_of_capture(run);
        rc = run_serve(o, loop, err);
    }
    loop_free(loop);
    replay_free(replay);
    return rc;
}

/* Serves with the links of --link, or with one for each port. */
static int with_links(struct capture_run *run)
{
    struct run_options *o = run->o;
    char links[sizeof o->links + 1024], text[sizeof links + 16];
    links[0] = '\0';
    if (o->links[0] != '\0')
        given_links(o->links, links, sizeof links);
    else
        default_links(run, links, sizeof links);
    snprintf(text, sizeof text, "links: [%s]", links);
    o->in.links = text;
    return app_with_config(&o->in, serve, run);
}

int run_capture(struct run_options *o)
{
    struct capture_run run = {.o = o};
    struct sh_err err = {0};
    o->replay.talk_options.loop = o->replay.loop;
    if (capture_load(o->in.operand[0], &app_report_stderr, &run.capture, &err) != SH_OK) return app_fail(&err);
    const int status = with_links(&run);
    capture_free(run.capture);
    return status;
}
