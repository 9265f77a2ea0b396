/* SPDX-License-Identifier: MIT */
/* scanhead view: a recording in the browser, without a head. */
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "drivers/link/link.h"
#include "firmware_sim/app/app.h"
#include "firmware_sim/app/studio/view/serve.h"

struct view_options {
    struct app_input in;
    const char *address;
    long port, ready_fd;
    int quiet;
};

/* Sessions get no data. Their input is read, and has no effect. */
static void view_take_event(const struct link_ops *ops, void *link, const struct link_event *event)
{
    char said[4096];
    if (event->kind == LINK_READABLE)
        while (ops->read(link, event->session, said, sizeof said) > 0)
            continue;
    if (event->kind == LINK_NOTICE) sh_warn(&app_report_stderr, "%s", event->peer);
}

static int serve_page(const struct link_ops *ops, void *link, struct sh_err *err)
{
    enum { POLL_MS = 200 }; /* longest time from a signal to the end of the loop */
    struct link_event event[LINK_MAX_EVENTS];
    while (!app_interrupted()) {
        const int n = ops->poll(link, -1, 0, POLL_MS, event, LINK_MAX_EVENTS);
        if (n < 0) return sh_fail(err, n, "the link of the page failed");
        for (int i = 0; i < n; i++)
            view_take_event(ops, link, &event[i]);
    }
    return SH_OK;
}

static void put_endpoint(struct json *json, const void *endpoint)
{
    json_open_object(json, NULL);
    json_open_array(json, "endpoints");
    json_open_object(json, NULL);
    json_string(json, "type", "web");
    json_string(json, "endpoint", endpoint);
    json_close_object(json);
    json_close_array(json);
    json_close_object(json);
}

static void say_what_is_shown(const struct viewed *v)
{
    uint64_t faces = 0;
    for (size_t i = 0; i < v->n_meshes; i++)
        faces += v->mesh[i].n_faces;
    fprintf(stderr, "scanhead: %s: %zu points, %llu shots without echo, %llu triangles in %zu mesh%s\n", v->path,
            v->points.n, (unsigned long long)v->n_empty, (unsigned long long)faces, v->n_meshes,
            v->n_meshes == 1 ? "" : "es");
}

/* The port is taken first, so that an error about it comes before a long file is read. */
static int show(const struct view_options *o, struct viewed *v, struct sh_err *err)
{
    struct view_serve serving = {.viewed = v, .report = &app_report_seconds};
    const struct web_source source = {.ctx = &serving, .get = view_serve_get};
    struct link_spec spec = {.type = LINK_WEB, .port = (int)o->port, .max_sessions = LINK_MAX_SESSIONS, .web = &source};
    const struct link_ops *ops = link_ops_get(LINK_WEB);
    char endpoint[256];
    void *link;
    if (o->address != NULL) snprintf(spec.address, sizeof spec.address, "%s", o->address);
    int rc = viewed_check_ending(o->in.operand[0], err);
    if (rc == SH_OK) rc = ops->open(&spec, &link, err);
    if (rc != SH_OK) return rc;
    rc = viewed_load(v, o->in.operand[0], &app_report_seconds, err);
    if (rc == SH_OK) {
        if (!o->quiet) say_what_is_shown(v);
        ops->endpoint(link, endpoint, sizeof endpoint);
        printf("%s\n", endpoint);
        if (fflush(stdout) != 0) rc = sh_fail(err, SH_EIO, "standard output: %s", strerror(errno));
    }
    if (rc == SH_OK) rc = app_say_ready(o->ready_fd, put_endpoint, endpoint, err);
    if (rc == SH_OK) rc = serve_page(ops, link, err);
    ops->close(link);
    view_serve_free(&serving);
    return rc;
}

static int view_run(int argc, char **argv)
{
    struct view_options o = {0};
    struct viewed viewed = {0};
    struct sh_err err = {0};
    int status = app_parse(&app_view, argc, argv, &o.in, &o);
    if (status != APP_GO_ON) return status;
    if (o.address != NULL && strlen(o.address) >= sizeof((struct link_spec *)0)->address)
        return app_usage(&app_view, "--address %s: allowed are names and numbers of up to %zu characters", o.address,
                         sizeof((struct link_spec *)0)->address - 1);
    app_catch_signals();
    int rc = show(&o, &viewed, &err);
    viewed_free(&viewed);
    if (rc == SH_ESTOPPED && app_interrupted()) return APP_OK; /* ended before all was read */
    return rc == SH_OK ? APP_OK : app_fail(&err);
}

#define AT(member) offsetof(struct view_options, member)

/* clang-format off */
static const struct app_option OPTIONS[] = {
    {APP_WHOLE, "port", "P", .min = 0, .max = 65535, .at = AT(port),
     .help = "port of the page; 0: the system chooses (default)"},
    {APP_TEXT, "address", "A", .at = AT(address),
     .help = "address to listen on, a number or a name (default 127.0.0.1: only this machine)"},
    {APP_OUTPUT, "ready-fd", "N", .min = 1, .max = 65535, .at = AT(ready_fd),
     .help = "write one JSON line with the page's address to descriptor N once it can be opened"},
    {APP_FLAG, "quiet", NULL, .at = AT(quiet), .help = "print only errors and warnings"},
    OPTION_END
};
/* clang-format on */

static const char NOTES[] =
    "FILE is a recording: .shs or .pcapng (points, and the mesh of each scan's grid), .ply or .las (points). The\n"
    "address of its page is printed to standard output once the file is read. Open it in a browser.\n"
    "\n"
    "Ctrl-C, SIGTERM, or SIGHUP from a terminal that closes, ends it with exit status 0.\n";

const struct app_command app_view = {
    .name = "view",
    .operand = {"FILE"},
    .summary = "show a recording in the browser",
    .options = OPTIONS,
    .notes = NOTES,
    .run = view_run,
};
