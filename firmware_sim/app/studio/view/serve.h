/* SPDX-License-Identifier: MIT */
/* The resources of a recording by their paths: /head, /cloud, /mesh, /sparse. In: path and query of a request. Out: a
 * body. One thread. */
#ifndef FIRMWARE_SIM_APP_STUDIO_VIEW_SERVE_H
#define FIRMWARE_SIM_APP_STUDIO_VIEW_SERVE_H

#include "drivers/link/web.h"
#include "firmware_sim/app/studio/view/spread.h"
#include "firmware_sim/app/studio/view/viewed.h"

struct view_serve {
    const struct viewed *viewed;
    const struct sh_report *report; /* its stop ends long computations; may be NULL */
    /* the last sparse points that were made, and by which request */
    struct cloud sparse;
    int made;
    struct view_spread wish;
};

/* As web_source's get; ctx is a struct view_serve, zeroed but for viewed and report. */
int view_serve_get(void *ctx, const char *path, const char *query, struct web_body *out, struct sh_err *err);
void view_serve_free(struct view_serve *serve);

#endif
