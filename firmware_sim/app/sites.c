/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/sites.h"

#include <stdlib.h>

#include "firmware_sim/base/clock.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/load.h"

static int sites_add(const struct config *cfg, uint32_t station, const struct sh_report *report, struct sites *sites,
                     struct sh_err *err)
{
    struct sites_one *one = &sites->other[sites->n++];
    one->scanner = cfg->station[station].scanner;
    one->cfg = calloc(1, sizeof *one->cfg);
    if (one->cfg == NULL) return sh_fail(err, SH_ENOMEM, "no memory for the scanner of station %u", station + 1);
    int rc = config_load_scanner(cfg, station + 1, one->cfg, err);
    scanner_report_set_up(&one->report, report, station + 1, &sites->warnings);
    return rc == SH_OK ? site_load_for(one->cfg, SITE_FOR_SCANS, sites->first, &one->report.report, &one->site, err)
                       : rc;
}

/* Loads a site for each scanner but that of head.station, whose site is loaded already. */
static int load_others(const struct config *cfg, const struct sh_report *report, struct sites *sites,
                       struct sh_err *err)
{
    int rc = SH_OK;
    int64_t said_ns = clock_now_ns();
    for (uint32_t i = 0; i < cfg->n_stations && rc == SH_OK; i++) {
        if (config_serves(cfg, i) || cfg->station[i].scanner != i + 1) continue;
        rc = sites_add(cfg, i, report, sites, err);
        if (clock_now_ns() - said_ns < 1000000000) continue;
        said_ns = clock_now_ns();
        sh_progress(report, "setting up scanners", (1.0 + i) / cfg->n_stations);
    }
    scanner_warnings_say(&sites->warnings, sites->first, report);
    return rc;
}

int sites_load(const struct config *cfg, enum site_purpose purpose, const struct sh_report *report, struct sites *sites,
               struct sh_err *err)
{
    const int rc = site_load_for(cfg, purpose, NULL, report, &sites->first, err);
    return rc == SH_OK ? load_others(cfg, report, sites, err) : rc;
}

int sites_load_beside(const struct config *cfg, const struct site *first, const struct sh_report *report,
                      struct sites *sites, struct sh_err *err)
{
    sites->first = (struct site *)(uintptr_t)first;
    sites->first_is_lent = 1;
    return load_others(cfg, report, sites, err);
}

struct site *sites_of(const struct sites *sites, uint32_t station)
{
    const struct config *cfg = sites->first->cfg;
    /* All stops of a trajectory have the first scanner, though there may be more stops than stations. */
    if (sites->n == 0 || config_serves(cfg, station)) return sites->first;
    for (uint32_t k = 0; k < sites->n; k++)
        if (sites->other[k].scanner == cfg->station[station % cfg->n_stations].scanner) return sites->other[k].site;
    return sites->first;
}

void sites_free(struct sites *sites)
{
    for (uint32_t k = 0; k < sites->n; k++) {
        site_free(sites->other[k].site);
        free(sites->other[k].cfg);
    }
    scanner_warnings_free(&sites->warnings);
    if (!sites->first_is_lent) site_free(sites->first);
}
