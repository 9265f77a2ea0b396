/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/studio/batch/load.h"

#include <stdlib.h>
#include <string.h>

#include "firmware_sim/app/studio/record/offline.h"
#include "firmware_sim/config/config.h"

struct loading {
    struct batch *b;
    struct batch_loaded *before, *now;
};

/* Returns the site of the previous combination, if now->cfg can share its scene. Else frees that site, so that there
 * are never two scenes at a time, and returns NULL. */
static const struct site *shared_site(struct loading *l)
{
    struct batch_loaded *before = l->before;
    if (before->site == NULL) return NULL;
    if (config_wants_textures(before->cfg) != config_wants_textures(l->now->cfg) ||
        memcmp(before->cfg->scene.mesh, l->now->cfg->scene.mesh, sizeof l->now->cfg->scene.mesh) != 0)
        batch_unload(before);
    return before->site;
}

/* Whether the inputs that were loaded are those of the plan. */
static int check_made(struct loading *l, struct sh_err *err)
{
    const struct batch_provenance *planned = &l->b->made[l->now->combination];
    struct batch_provenance made = *planned;
    int rc = batch_provenance_of(l->now->cfg, &l->b->cache, &made, &app_report_stderr, err);
    const char *differs = rc == SH_OK ? batch_provenance_differs(planned, &made) : NULL;
    if (differs == NULL) return rc;
    return sh_fail(err, SH_ESTATE, "%s: %s than when the campaign began; begin again", l->now->cfg->file, differs);
}

static int load_site(struct config *cfg, void *ctx, struct sh_err *err)
{
    struct loading *l = ctx;
    struct batch_loaded *now = l->now;
    now->cfg = malloc(sizeof *now->cfg);
    if (now->cfg == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    *now->cfg = *cfg; /* the site needs it longer than this call lasts */
    /* record_job_check also sets layout and colours in now->cfg. */
    int rc = record_job_check(&now->line->line.job, now->cfg, err);
    if (rc == SH_OK) rc = offline_load(now->cfg, shared_site(l), &app_report_stderr, &now->site, err);
    if (rc != SH_OK) return rc;
    now->n_reads += l->before->site == NULL || now->site->world != l->before->site->world;
    return check_made(l, err);
}

int batch_load(struct batch *b, uint32_t combination, struct batch_loaded *loaded)
{
    struct batch_loaded before = *loaded;
    struct loading loading = {b, &before, loaded};
    if (loaded->status != 0 && loaded->combination == combination) return loaded->status;
    *loaded = (struct batch_loaded){.n_reads = before.n_reads, .combination = combination};
    /* Only the configuration of this line is used. The line's outputs are named "x", which is no job's name, so the
     * outputs are left out. */
    loaded->status = batch_line_make(b, combination, 1, "x", &loaded->line);
    if (loaded->status == APP_GO_ON) loaded->line->line.in.n_files = 0;
    if (loaded->status == APP_GO_ON) loaded->status = app_with_config(&loaded->line->line.in, load_site, &loading);
    if (loaded->status == APP_OK) loaded->status = APP_GO_ON;
    batch_unload(&before);
    return loaded->status;
}

void batch_unload(struct batch_loaded *loaded)
{
    const uint32_t n_reads = loaded->n_reads;
    site_free(loaded->site);
    free(loaded->cfg);
    batch_line_free(loaded->line);
    *loaded = (struct batch_loaded){.n_reads = n_reads};
}
