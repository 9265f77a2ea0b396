/* SPDX-License-Identifier: MIT */
/* config_load: file, --set, the section `scanner` of the station, profile, defaults, checks, in this order. */
#include "firmware_sim/config/check.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/keys.h"
#include "firmware_sim/config/load.h"
#include "firmware_sim/config/profiles.h"
#include "firmware_sim/config/scanners.h"
#include "firmware_sim/config/table/document.h"
#include "firmware_sim/config/table/forget.h"
#include "firmware_sim/config/table/reader.h"
#include "firmware_sim/config/table/row.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

/* Chooses the station whose section `scanner` is used. */
static void find_scanner(struct cfg_reader *rd, struct config *cfg, uint32_t station)
{
    const size_t row = cfg_row(rd, cfg_find(&rd->table, "head.station"));
    const uint32_t given = rd->line[row][0] != 0 && !rd->bad[row][0] ? cfg->head.settings.station : 1;
    const uint32_t i = cfg_station_at(cfg, station != 0 ? station : given);
    rd->scanner = i < cfg->n_stations && cfg->station[i].has_scanner ? (int)i : -1;
    if (station == 0) return;
    cfg->head.settings.station = station;
    rd->line[row][0] = rd->root_line;
    rd->bad[row][0] = 0;
    cfg_forget_list(rd, "links");
    cfg->links_are_not_here = 1;
}

static void read_scanner(struct cfg_reader *rd, struct cfg_document *doc, const char *const *sets, int n_sets)
{
    if (rd->scanner < 0) return;
    rd->in_scanner = 1;
    cfg_read_scanner(rd, doc);
    cfg_apply_sets(rd, doc, sets, n_sets);
    rd->in_scanner = 0;
    cfg_end_scanner(rd);
}

/* known: the profile, if it was read before; else NULL. Returns whether cfg->profile is read. */
static int load_once(const char *const *sets, int n_sets, uint32_t station, struct config *cfg,
                     const struct config_profile *known, struct config_diagnostics *diagnostics)
{
    struct cfg_reader rd;
    struct cfg_document *doc;
    memset(diagnostics, 0, sizeof *diagnostics);
    cfg_reader_init(&rd, cfg->file, &cfg_config_table, cfg, diagnostics);
    rd.profile = known;
    if (cfg_open_file(&rd, &doc) != SH_OK) return 0;
    cfg_apply_sets(&rd, doc, sets, n_sets);
    find_scanner(&rd, cfg, station);
    read_scanner(&rd, doc, sets, n_sets);
    cfg_close_file(doc);
    /* The profile comes after --set and the scanner, which may name it, and before defaults, which are its figures. */
    cfg_load_profile(&rd, cfg);
    cfg_fill_defaults(&rd, &cfg->profile);
    cfg_check(&rd, cfg);
    return rd.profile_read;
}

static void config_begin(const char *path, const char *const *sets, int n_sets, struct config *cfg)
{
    memset(cfg, 0, sizeof *cfg);
    snprintf(cfg->file, sizeof cfg->file, "%s", path);
    cfg->sets = sets;
    cfg->n_sets = n_sets;
}

int cfg_load_for(const char *path, const char *const *sets, int n_sets, uint32_t station, struct config *cfg,
                 struct config_diagnostics *diagnostics)
{
    config_begin(path, sets, n_sets, cfg);
    const int has_profile = load_once(sets, n_sets, station, cfg, NULL, diagnostics);
    if (diagnostics->n == 0) return SH_OK;
    /* Values are read before the profile, but their errors need its limits. So read them once more. */
    const struct config_profile profile = cfg->profile;
    config_begin(path, sets, n_sets, cfg);
    if (has_profile) load_once(sets, n_sets, station, cfg, &profile, diagnostics);
    return diagnostics->err[0].code;
}

int config_load_all(const char *path, const char *const *sets, int n_sets, struct config *cfg,
                    struct config_diagnostics *diagnostics)
{
    memset(diagnostics, 0, sizeof *diagnostics);
    if (strlen(path) >= sizeof cfg->file) {
        memset(cfg, 0, sizeof *cfg);
        diagnostics->n = 1;
        return sh_fail(&diagnostics->err[0], SH_EINPUT, "%.100s...: path too long; allowed up to %zu bytes", path,
                       sizeof cfg->file - 1);
    }
    cfg_load_for(path, sets, n_sets, 0, cfg, diagnostics);
    cfg_check_scanners(cfg, diagnostics);
    return diagnostics->n == 0 ? SH_OK : diagnostics->err[0].code;
}

int config_load(const char *path, const char *const *sets, int n_sets, struct config *cfg, struct sh_err *err)
{
    struct config_diagnostics diagnostics;
    int code = config_load_all(path, sets, n_sets, cfg, &diagnostics);
    return code == SH_OK ? SH_OK : sh_fail(err, code, "%s", diagnostics.err[0].text);
}

double config_cast_hz(const struct config *cfg)
{
    const struct head_settings *h = &cfg->head.settings;
    const double sweep_udeg = 360e6 * cfg->profile.optical_gain / cfg->profile.facets;
    double used = (double)(h->line_stop_udeg - h->line_start_udeg) / sweep_udeg;
    if (used < 0.0) used += 1.0; /* across azimuth 0 */
    return (double)h->prr_uhz * 1e-6 * (used < 1.0 ? used : 1.0);
}

uint32_t config_threads(const struct config *cfg)
{
    long n = cfg->loop.threads != 0 ? (long)cfg->loop.threads : sysconf(_SC_NPROCESSORS_ONLN);
    return n < 1 ? 1 : n > CONFIG_MAX_THREADS ? CONFIG_MAX_THREADS : (uint32_t)n;
}
