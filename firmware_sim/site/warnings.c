/* SPDX-License-Identifier: MIT */
/* Keeps the warnings given while loading, so that a site beside this one only gives new ones. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "firmware_sim/site/warnings.h"
#include "firmware_sim/site/site.h"

static int has(const struct site_warnings *said, const char *text)
{
    for (uint32_t i = 0; said != NULL && i < said->n; i++)
        if (strcmp(said->text[i], text) == 0) return 1;
    return 0;
}

/* A warning for which there is no room or no memory counts as new each time. */
static void warnings_warn(void *ctx, const char *text)
{
    struct site_listener *listener = ctx;
    struct site_warnings *said = listener->said;
    if (said->n < SITE_MAX_SAID && (said->text[said->n] = strdup(text)) != NULL) said->n++;
    if (has(listener->before, text)) return;
    if (said->n_new++ == 0) snprintf(said->first, sizeof said->first, "%s", text);
    sh_warn(listener->to, "%s", text);
}

static void progress(void *ctx, const char *what, double fraction)
{
    const struct site_listener *listener = ctx;
    sh_progress(listener->to, what, fraction);
}

static int loading_stops(void *ctx)
{
    const struct site_listener *listener = ctx;
    return sh_stopped(listener->to);
}

void site_listen(struct site_listener *listener, const struct sh_report *to, struct site_warnings *said,
                 const struct site_warnings *before)
{
    *listener = (struct site_listener){{listener, warnings_warn, progress, loading_stops}, to, said, before};
}

void site_free_warnings(struct site_warnings *said)
{
    for (uint32_t i = 0; i < said->n; i++)
        free(said->text[i]);
}
