/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "firmware_sim/app/app.h"
#include "firmware_sim/app/studio/soak/verdicts.h"
#include "firmware_sim/config/config.h"

enum { VERDICTS_PATH = 512, VERDICTS_MAX_FOLDER = 400, N_ENDINGS = 3 };

struct verdicts_work {
    struct verdicts *verdicts;
    struct verdict *made; /* of the scenarios so far */
    uint32_t n;
};

static uint32_t n_scenarios(const struct verdicts *v)
{
    return v->n != 0 ? v->n : 1;
}

/* A scenario has its file's name without folder and ending; several scenarios have their number in front. */
static void name_scenario(const struct verdicts *v, uint32_t i, char *to, size_t cap)
{
    const char *name = basename(v->n != 0 ? v->scenario[i] : "configuration"), *dot = strrchr(name, '.');
    const int len = dot != NULL && dot != name ? (int)(dot - name) : (int)strlen(name);
    if (v->n > 1)
        snprintf(to, cap, "%u-%.*s", i + 1, len, name);
    else
        snprintf(to, cap, "%.*s", len, name);
}

FILE *verdicts_out(const struct verdicts *verdicts)
{
    const char *const file[] = {verdicts->json, verdicts->options.truth};
    for (int i = 0; i < 2; i++)
        if (file[i] != NULL && strcmp(file[i], "-") == 0) return stderr;
    return stdout;
}

int soak_check_link(const struct config *cfg, uint32_t number, struct sh_err *err)
{
    if (number <= cfg->n_links) return SH_OK;
    if (cfg->n_links > 0)
        return sh_fail(err, SH_EINPUT, "--link %u: there is no such link; allowed 1 to %u", number, cfg->n_links);
    return sh_fail(err, SH_EINPUT, "%s: links: there are none; needed is one, as in --set 'links=[{type: tcp}]'",
                   cfg->file);
}

static int check_one(struct config *cfg, void *ctx, struct sh_err *err)
{
    const struct verdicts_work *work = ctx;
    const uint32_t number = work->verdicts->options.link;
    if (cfg->loop.pace != PACE_REALTIME)
        return sh_fail(err, SH_EINPUT,
                       "--client: loop.pace is not realtime, and the client has no other time; allowed is "
                       "realtime");
    const int rc = soak_check_link(cfg, number, err);
    if (rc != SH_OK) return rc;
    const enum link_type type = cfg->link[number - 1].type;
    if (type == LINK_FILE || type == LINK_NULL || type == LINK_WEB)
        return sh_fail(err, SH_EINPUT,
                       "--link %u: a client can't be judged on a link of type %s; allowed are tcp, pty, udp and usb",
                       number, link_ops_get(type)->name);
    return SH_OK;
}

static int fail_stopped(const struct verdicts_work *work, struct sh_err *err)
{
    return sh_fail(err, SH_ESTOPPED, "soak: stopped; of %u scenarios %u were judged", n_scenarios(work->verdicts),
                   work->n);
}

static int judge_one(struct config *cfg, void *ctx, struct sh_err *err)
{
    struct verdicts_work *work = ctx;
    struct verdict *made = &work->made[work->n];
    if (work->n == 0) app_warn_settings_file(cfg, "a soak has the settings of the configuration");
    name_scenario(work->verdicts, work->n, made->scenario, sizeof made->scenario);
    const int rc = verdict_run(cfg, &work->verdicts->options, made, err);
    if (rc == SH_ESTOPPED) return fail_stopped(work, err);
    if (rc != SH_OK) return rc;
    work->n++;
    verdict_print(made, verdicts_out(work->verdicts));
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

static void put_junit(FILE *out, const void *ctx)
{
    const struct verdicts_work *work = ctx;
    verdict_put_junit(work->made, work->n, out);
}

static int write_files(const struct verdicts_work *work, struct sh_err *err)
{
    const struct verdicts *v = work->verdicts;
    int rc = v->json != NULL ? app_write_json(v->json, put_all, work, err) : SH_OK;
    if (rc == SH_OK && v->junit != NULL) rc = app_write_file(v->junit, put_junit, work, err);
    return rc;
}

/* The folder that the user names, or a new one. */
static int make_folder(struct verdicts *v, char *own, size_t cap, struct sh_err *err)
{
    if (v->options.folder != NULL && strlen(v->options.folder) > VERDICTS_MAX_FOLDER)
        return sh_fail(err, SH_EINPUT, "--client-folder: has %zu characters; allowed are %d", strlen(v->options.folder),
                       VERDICTS_MAX_FOLDER);
    if (v->options.folder != NULL) {
        if (mkdir(v->options.folder, 0777) == 0 || errno == EEXIST) return SH_OK;
        return sh_fail(err, SH_EINPUT, "--client-folder %s: %s", v->options.folder, strerror(errno));
    }
    v->options.folder = own;
    return app_make_folder("soak", own, cap, err);
}

static int say_findings(const struct verdicts_work *work, struct sh_err *err)
{
    uint32_t found = 0, judged = 0;
    for (uint32_t i = 0; i < work->n; i++) {
        found += verdict_count(&work->made[i], VERDICT_FOUND);
        judged += VERDICT_N_CHECKS - verdict_count(&work->made[i], VERDICT_NOT_JUDGED);
    }
    fprintf(verdicts_out(work->verdicts), "findings: %u, of %u checks in %u scenario%s\n", found, judged, work->n,
            work->n == 1 ? "" : "s");
    return found == 0 ? SH_OK : sh_fail(err, SH_ESTATE, "soak: the client has findings: %u", found);
}

static int has_out(const char *text)
{
    return text != NULL && strstr(text, "{out}") != NULL;
}

/* Whether a run writes a file of that ending: its log, what the client prints, and {out}. */
static int is_written(const struct verdict_options *o, const char *ending)
{
    if (strcmp(ending, "stdout") == 0) return o->file != NULL && strcmp(o->file, "-") == 0;
    return strcmp(ending, "points") != 0 || has_out(o->command) || has_out(o->file);
}

/* Adds the files that the runs will write. These files join the list of the command line's files, in which no file may
 * stand twice. `paths` keeps their names. */
static int add_outputs(const struct verdicts *v, struct app_input *in, char (*paths)[N_ENDINGS][VERDICTS_PATH])
{
    static const char *const endings[N_ENDINGS] = {"log", "stdout", "points"};
    char name[64];
    for (uint32_t i = 0; i < n_scenarios(v); i++)
        for (int k = 0; k < N_ENDINGS; k++) {
            char *path = paths[i][k];
            name_scenario(v, i, name, sizeof name);
            snprintf(path, VERDICTS_PATH, "%.*s/%s.%s", VERDICTS_MAX_FOLDER, v->options.folder, name, endings[k]);
            const struct app_file file = {.option = "client-folder", .path = path, .use = APP_WRITES};
            const int is_named = v->options.file != NULL && strcmp(v->options.file, path) == 0; /* it is in the list */
            if (!is_written(&v->options, endings[k]) || is_named) continue;
            if (app_add_file(in, &file) != APP_OK) return APP_USAGE;
        }
    return APP_OK;
}

/* Checks all scenarios before the first run, so that one that can't be loaded is found before any time is spent. */
static int run_all(struct verdicts_work *work, struct app_input *in)
{
    const struct verdicts *v = work->verdicts;
    int status = APP_OK;
    for (int judges = 0; judges < 2; judges++)
        for (uint32_t i = 0; i < n_scenarios(v) && status == APP_OK && !app_interrupted(); i++) {
            in->scenario = v->n != 0 ? v->scenario[i] : NULL;
            status = app_with_config(in, judges ? judge_one : check_one, work);
        }
    return status;
}

int verdicts_run(struct verdicts *v, struct app_input *in)
{
    struct sh_err err = {0};
    char own[352], paths[VERDICTS_MAX_SCENARIOS][N_ENDINGS][VERDICTS_PATH];
    struct verdicts_work work = {.verdicts = v, .made = calloc(n_scenarios(v), sizeof *work.made)};
    int rc = work.made != NULL ? make_folder(v, own, sizeof own, &err) : sh_fail(&err, SH_ENOMEM, "no memory");
    int status = rc == SH_OK ? add_outputs(v, in, paths) : APP_OK;
    if (rc == SH_OK && status == APP_OK) status = run_all(&work, in);
    if (rc == SH_OK && work.n > 0) rc = write_files(&work, &err);
    if (rc == SH_OK && status == APP_OK)
        rc = work.n == n_scenarios(v) ? say_findings(&work, &err) : fail_stopped(&work, &err);
    free(work.made);
    return rc == SH_OK ? status : app_fail(&err);
}
