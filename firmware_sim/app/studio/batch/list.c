/* SPDX-License-Identifier: MIT */
/* The jobs of a campaign, printed (batch.h). */
#include <stdio.h>

#include "firmware_sim/app/studio/batch/batch.h"

void batch_put_job(struct json *json, const struct batch *b, uint32_t i)
{
    const char *set[BATCH_MAX_SWEEPS];
    char name[BATCH_NAME_LEN];
    batch_job_name(b, i, name);
    batch_sweeps_at(&b->sweeps, b->job[i].combination, set);
    json_uint(json, "job", i + 1);
    json_string(json, "name", name);
    json_uint(json, "station", b->job[i].station);
    json_open_array(json, "set");
    for (uint32_t k = 0; k < b->sweeps.n; k++)
        json_string(json, NULL, set[k]);
    json_close_array(json);
}

static void put_jobs(struct json *json, const void *ctx)
{
    const struct batch *b = ctx;
    json_open_array(json, NULL);
    for (uint32_t i = 0; i < b->n_jobs; i++) {
        if (!batch_is_mine(b, i)) continue;
        json_open_object(json, NULL);
        batch_put_job(json, b, i);
        if (b->dir != NULL) json_bool(json, "done", b->job[i].is_done);
        json_close_object(json);
    }
    json_close_array(json);
}

static void print_jobs(const struct batch *b)
{
    for (uint32_t i = 0; i < b->n_jobs; i++) {
        const char *set[BATCH_MAX_SWEEPS];
        char name[BATCH_NAME_LEN];
        if (!batch_is_mine(b, i)) continue;
        batch_job_name(b, i, name);
        batch_sweeps_at(&b->sweeps, b->job[i].combination, set);
        if (b->dir != NULL) fputs(b->job[i].is_done ? "done " : "-    ", stdout);
        printf("%s station %u", name, b->job[i].station);
        for (uint32_t k = 0; k < b->sweeps.n; k++)
            printf(" %s", set[k]);
        putchar('\n');
    }
}

/* Contents aren't read for a list: that would take as long as the check of the whole campaign. */
static void drop_cut_files(struct batch *b)
{
    for (uint32_t i = 0; i < b->n_jobs; i++) {
        struct sh_err why;
        if (!batch_is_mine(b, i) || !b->job[i].is_done || batch_check_sizes(b, i, &why) == SH_OK) continue;
        sh_warn(&app_report_stderr, "%s; job %u is to be done again", why.text, i + 1);
        b->job[i].is_done = 0;
    }
}

int batch_list(struct batch *b)
{
    struct sh_err err = {0};
    if (b->dir != NULL && batch_find_done(b, 1, &err) != SH_OK) return app_fail(&err);
    drop_cut_files(b);
    if (!b->json) {
        print_jobs(b);
        return APP_OK;
    }
    return app_write_json("-", put_jobs, b, &err) == SH_OK ? APP_OK : app_fail(&err);
}
