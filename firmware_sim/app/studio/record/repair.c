/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/studio/record/repair.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "core/of_file.h"
#include "drivers/record/repair.h"
#include "firmware_sim/app/app.h"

struct result {
    const char *path; /* as it was given */
    int status;
    struct sh_err err;
    struct repaired file;
};

struct results {
    struct result *of;
    int n;
};

static void repair_say(const struct repaired *f)
{
    char scans[48] = "";
    if (f->n_scans > 0) snprintf(scans, sizeof scans, " of %" PRIu64 " scan%s", f->n_scans, f->n_scans == 1 ? "" : "s");
    if (f->was_whole && !f->was_left)
        fprintf(stderr, "scanhead: %s: whole: %" PRIu64 " %s%s, nothing to repair\n", f->path, f->n_kept, f->unit,
                scans);
    else
        fprintf(stderr, "scanhead: %s: kept %" PRIu64 " %s%s; %" PRIu64 " byte%s at the end cut%s\n",
                f->is_part ? f->part : f->path, f->n_kept, f->unit, scans, f->cut_bytes, f->cut_bytes == 1 ? "" : "s",
                f->was_whole ? "; nothing else was changed" : "; data after that may be missing");
    if (f->is_part) fprintf(stderr, "scanhead: %s keeps its name: %s exists, and is not replaced\n", f->part, f->path);
}

static void repair_put(struct json *json, const void *ctx)
{
    const struct results *all = ctx;
    json_open_array(json, NULL);
    for (int i = 0; i < all->n; i++) {
        const struct result *r = &all->of[i];
        json_open_object(json, NULL);
        json_string(json, "file", r->status != APP_OK ? r->path : r->file.is_part ? r->file.part : r->file.path);
        if (r->status != APP_OK) {
            json_string(json, "error", r->err.text);
        } else {
            json_string(json, "unit", r->file.unit);
            json_uint(json, "kept", r->file.n_kept);
            json_uint(json, "scans", r->file.n_scans);
            json_uint(json, "cut_bytes", r->file.cut_bytes);
            json_bool(json, "was_whole", r->file.was_whole);
            json_bool(json, "was_left", r->file.was_left);
        }
        json_close_object(json);
    }
    json_close_array(json);
}

int record_repair(const char *const *paths, int n, const char *stats, int quiet)
{
    struct sh_err err = {0};
    struct results all = {.of = calloc((size_t)n, sizeof *all.of), .n = n};
    int status = APP_OK;
    if (all.of == NULL) return app_fail(&(struct sh_err){SH_ENOMEM, "no memory"});
    for (int i = 0; i < n; i++) {
        struct result *r = &all.of[i];
        r->path = paths[i];
        const int rc = sh_of_file(repair_file(paths[i], &app_report_seconds, &r->file, &r->err), &r->err);
        r->status = rc == SH_OK ? APP_OK : app_fail(&r->err);
        if (rc == SH_OK && !quiet) repair_say(&r->file);
        if (r->status > status) status = r->status;
    }
    if (stats != NULL && app_write_json(stats, repair_put, &all, &err) != SH_OK && status == APP_OK)
        status = app_fail(&err);
    for (int i = 0; i < n; i++)
        repair_free(&all.of[i].file);
    free(all.of);
    return status;
}
