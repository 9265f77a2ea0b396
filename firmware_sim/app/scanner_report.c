/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/scanner_report.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void scanner_report_warn(void *ctx, const char *text)
{
    const struct scanner_report *r = ctx;
    struct scanner_warnings *w = r->warnings;
    uint32_t i = 0;
    while (i < w->n && strcmp(w->one[i].text, text) != 0)
        i++;
    if (i < w->n && w->are_printed) return;
    if (i == w->n && (w->are_printed || w->n == SITE_MAX_WARNINGS || (w->one[i].text = strdup(text)) == NULL)) {
        sh_warn(r->report.rest, "scanner of station %u: %s", r->station, text);
        return;
    }
    w->n += i == w->n;
    w->one[i].is_of[r->station - 1] = 1;
}

void scanner_report_set_up(struct scanner_report *report, const struct sh_report *to, uint32_t station,
                           struct scanner_warnings *warnings)
{
    *report = (struct scanner_report){{.ctx = report, .warn = scanner_report_warn, .rest = to}, warnings, station};
    warnings->n_scanners += !warnings->are_printed;
}

static int was_printed(const struct site *first, const char *text)
{
    for (uint32_t i = 0; first != NULL && i < first->warnings.n; i++)
        if (strcmp(first->warnings.text[i], text) == 0) return 1;
    return 0;
}

/* Where all scanners give the warning, that of the first one, which was printed, stands for all. */
static void scanner_report_say(const struct scanner_warnings *w, uint32_t i, int is_printed, const struct sh_report *to)
{
    char stations[4 * CONFIG_MAX_STATIONS + 1] = "";
    uint32_t n = 0;
    size_t used = 0;
    for (uint32_t s = 0; s < CONFIG_MAX_STATIONS; s++)
        if (w->one[i].is_of[s])
            used += (size_t)snprintf(stations + used, sizeof stations - used, "%s%u", n++ > 0 ? ", " : "", s + 1);
    if (is_printed && n == w->n_scanners) return;
    sh_warn(to, "scanner%s of station%s %s%s: %s", n > 1 ? "s" : "", n > 1 ? "s" : "", stations,
            is_printed ? ", too" : "", w->one[i].text);
}

void scanner_warnings_say(struct scanner_warnings *warnings, const struct site *first, const struct sh_report *to)
{
    for (uint32_t i = 0; i < warnings->n && !warnings->are_printed; i++)
        scanner_report_say(warnings, i, was_printed(first, warnings->one[i].text), to);
    warnings->are_printed = 1;
}

void scanner_warnings_free(struct scanner_warnings *warnings)
{
    for (uint32_t i = 0; i < warnings->n; i++)
        free(warnings->one[i].text);
    warnings->n = 0;
}
