/* SPDX-License-Identifier: MIT */
/* A preview is what a station would see from another place, or with other settings. A page on which stations are tried
 * asks for it. The head neither moves nor changes, so nobody needs control of it.
 *
 * In: requests of a page, as path and query (README.md has them and their answers). Out: bodies. A request that is
 * not answered yet gets an empty body at once, and the page asks again. One thread of a low priority (`nice`) does the
 * work, within the limits that README.md has. */
#ifndef FIRMWARE_SIM_APP_STUDIO_PREVIEW_PREVIEW_H
#define FIRMWARE_SIM_APP_STUDIO_PREVIEW_PREVIEW_H

#include "core/studio/coverage.h"
#include "drivers/link/web.h"
#include "firmware_sim/site/site.h"

struct preview;

struct preview_options {
    const struct config *cfg;
    const struct site *site; /* of the head that runs, loaded SITE_WRITTEN_OUT; it and cfg outlive the preview */
    /* This is the site's coverage. Only the preview adds scans and stations to the coverage. Other code may only ask in
     * which cell a place lies (coverage_cell_at). NULL: there is no coverage, and previews have points alone. */
    struct coverage *coverage;
    double cell_m;
    int nice;                       /* of the thread that works, as setpriority() has it */
    const struct sh_report *report; /* hears why a scanner of the scene can't be previewed */
};

/* Sets up the scene's other scanners, if there are any. SH_ENOMEM, SH_ESTOPPED. */
int preview_create(const struct preview_options *options, struct preview **out, struct sh_err *err);
/* /preview, /next, /reach and /cells; as web_source's get. Any thread. */
int preview_get(struct preview *preview, const char *path, const char *query, struct web_body *out, struct sh_err *err);
/* Gives a body back once it has been sent, since readers share it. */
void preview_release(struct preview *preview, char *bytes);
void preview_free(struct preview *preview);

#endif
