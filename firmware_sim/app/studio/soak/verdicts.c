/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "firmware_sim/app/app.h"
#include "firmware_sim/app/studio/soak/verdicts.h"
#include "firmware_sim/config/config.h"

enum { VERDICTS_PATH = 512 };

struct verdicts_work {
    struct verdicts *verdicts;
    struct verdict *made; /* of the scenarios so far */
    uint32_t n;
};

/* brown-out of "config/faults/brown-out.yaml"; where several have one name, their places make them different. */
static void name_scenario(const struct verdicts *v, uint32_t i, char *to, size_t cap)
{
    const char *path = v->n != 0 ? v->scenario[i] : "configuration", *slash = strrchr(path, '/');
    const char *name = slash != NULL ? slash + 1 : path, *dot = strrchr(name, '.');
    const int len = dot != NULL && dot != name ? (int)(dot - name) : (int)strlen(name);
    if (v->n > 1)
        snprintf(to, cap, "%u-%.*s", i + 1, len, name);
    else
        snprintf(to, cap, "%.*s", len, name);
}

static int judge_one(struct config *cfg, void *ctx, struct sh_err *err)
{
    struct verdicts_work *work = ctx;
    struct verdict *made = &work->made[work->n];
    const struct verdict_options *o = &work->verdicts->options;
    if (cfg->loop.pace != PACE_REALTIME)
        return sh_fail(err, SH_EINPUT,
                       "--client: loop.pace is not realtime, and the client has no other time; allowed is "
                       "realtime");
    if (o->link > cfg->n_links)
        return sh_fail(err, SH_EINPUT, "--link %u: there is no such link; allowed 1 to %u", o->link, cfg->n_links);
    const struct link_spec *link = &cfg->link[o->link - 1];
    if (link->type == LINK_FILE || link->type == LINK_NULL)
        return sh_fail(err, SH_EINPUT,
                       "--link %u: no client can have a link of type %s; allowed are tcp, pty, udp, usb and web",
                       o->link, link_ops_get(link->type)->name);
    name_scenario(work->verdicts, work->n, made->scenario, sizeof made->scenario);
    const int rc = verdict_run(cfg, o, made, err);
    if (rc != SH_OK) return rc;
    work->n++;
    verdict_print(made, stdout);
    fflush(stdout);
    return SH_OK;
}

static void put_all(struct json *json, const void *ctx)
{
    const struct verdicts_work *work = ctx;
    uint64_t found = 0;
    json_open_object(json, NULL);
    json_string(json, "client", work->verdicts->options.command);
    json_double(json, "reconnect_limit_s", work->verdicts->options.limit_s);
    json_open_array(json, "scenarios");
    for (uint32_t i = 0; i < work->n; i++) {
        verdict_put(&work->made[i], json);
        found += verdict_count(&work->made[i], VERDICT_FOUND);
    }
    json_close_array(json);
    json_uint(json, "findings", found);
    json_close_object(json);
}

static int write_files(const struct verdicts_work *work, struct sh_err *err)
{
    const struct verdicts *v = work->verdicts;
    int rc = v->json != NULL ? app_write_json(v->json, put_all, work, err) : SH_OK;
    if (rc == SH_OK && v->junit != NULL) rc = verdict_write_junit(v->junit, work->made, work->n, err);
    return rc;
}

/* The folder that the user names, or a new one. */
static int make_folder(struct verdicts *v, char *own, size_t cap, struct sh_err *err)
{
    const char *temporary = getenv("TMPDIR");
    if (v->options.folder != NULL) {
        if (mkdir(v->options.folder, 0777) == 0 || errno == EEXIST) return SH_OK;
        return sh_fail(err, SH_EINPUT, "--client-folder %s: %s", v->options.folder, strerror(errno));
    }
    snprintf(own, cap, "%.300s/scanhead-soak-XXXXXX", temporary != NULL && temporary[0] != '\0' ? temporary : "/tmp");
    v->options.folder = mkdtemp(own);
    return v->options.folder != NULL ? SH_OK : sh_fail(err, SH_EIO, "%s: %s", own, strerror(errno));
}

static int say_findings(const struct verdicts_work *work, struct sh_err *err)
{
    uint32_t found = 0, judged = 0;
    for (uint32_t i = 0; i < work->n; i++) {
        found += verdict_count(&work->made[i], VERDICT_FOUND);
        judged += VERDICT_N_CHECKS - verdict_count(&work->made[i], VERDICT_NOT_JUDGED);
    }
    printf("findings: %u, of %u checks in %u scenario%s\n", found, judged, work->n, work->n == 1 ? "" : "s");
    return found == 0 ? SH_OK : sh_fail(err, SH_ESTATE, "soak: the client has findings: %u", found);
}

/* The logs, so that none of them is a file that is read. `paths` keeps their names. */
static int add_logs(const struct verdicts *v, struct app_input *in, char (*paths)[VERDICTS_PATH], uint32_t n)
{
    char name[64];
    for (uint32_t i = 0; i < n; i++) {
        name_scenario(v, i, name, sizeof name);
        snprintf(paths[i], VERDICTS_PATH, "%.400s/%s.log", v->options.folder, name);
        const struct app_file file = {.option = "client-folder", .path = paths[i], .use = APP_WRITES};
        if (app_add_file(in, &file) != APP_OK) return APP_USAGE;
    }
    return APP_OK;
}

int verdicts_run(struct verdicts *v, struct app_input *in)
{
    const uint32_t n = v->n != 0 ? v->n : 1;
    struct sh_err err = {0};
    char own[352], logs[VERDICTS_MAX_SCENARIOS][VERDICTS_PATH];
    struct verdicts_work work = {.verdicts = v, .made = calloc(n, sizeof *work.made)};
    int rc = work.made != NULL ? make_folder(v, own, sizeof own, &err) : sh_fail(&err, SH_ENOMEM, "no memory");
    int status = rc == SH_OK ? add_logs(v, in, logs, n) : APP_OK;
    for (uint32_t i = 0; rc == SH_OK && i < n && status == APP_OK && !app_interrupted(); i++) {
        in->scenario = v->n != 0 ? v->scenario[i] : NULL;
        status = app_with_config(in, judge_one, &work);
    }
    if (rc == SH_OK && status == APP_OK) rc = write_files(&work, &err);
    if (rc == SH_OK && status == APP_OK) rc = say_findings(&work, &err);
    free(work.made);
    return rc == SH_OK ? status : app_fail(&err);
}
