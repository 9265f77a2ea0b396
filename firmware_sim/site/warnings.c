/* SPDX-License-Identifier: MIT */
/* Keeps the warnings that loading a site gave. A site that is loaded later beside it, for another scanner or for a
 * station that was moved, then gives only those that are new. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "firmware_sim/site/steps.h"

static int has(const struct site_warnings *given, const char *text)
{
    for (uint32_t i = 0; given != NULL && i < given->n; i++)
        if (strcmp(given->text[i], text) == 0) return 1;
    return 0;
}

/* A warning for which there is no room or no memory counts as new each time. */
static void warnings_warn(void *ctx, const char *text)
{
    struct site_listener *listener = ctx;
    struct site_warnings *given = listener->given;
    if (given->n < SITE_MAX_WARNINGS && (given->text[given->n] = strdup(text)) != NULL) given->n++;
    if (has(listener->before, text)) return;
    if (given->n_new++ == 0) snprintf(given->first, sizeof given->first, "%s", text);
    sh_warn(listener->report.rest, "%s", text);
}

void site_listen(struct site_listener *listener, const struct sh_report *to, struct site_warnings *given,
                 const struct site_warnings *before)
{
    *listener = (struct site_listener){{.ctx = listener, .warn = warnings_warn, .rest = to}, given, before};
}

void site_free_warnings(struct site_warnings *given)
{
    for (uint32_t i = 0; i < given->n; i++)
        free(given->text[i]);
}
