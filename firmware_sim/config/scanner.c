/* SPDX-License-Identifier: MIT */
/* Several scanners in one file: the keys in a station's section `scanner` replace the file's own. In: the
 * file, once for each scanner. Out: the scanner of each station, and diagnostics of all scanners. */
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/load.h"
#include "firmware_sim/config/scanners.h"
#include "firmware_sim/config/table/diagnostics.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

uint32_t cfg_station_at(const struct config *cfg, uint32_t number)
{
    const uint32_t n = cfg->n_stations;
    if (n == 1) return 0; /* this station has all stops of a trajectory */
    /* Without a trajectory stops go through all stations in order, again and again. */
    return cfg->platform.kind == PLATFORM_STOPS && n > 0 ? (number - 1) % n : number - 1;
}

int config_serves(const struct config *cfg, uint32_t i)
{
    const uint32_t n = cfg->n_stations, here = cfg_station_at(cfg, cfg->head.settings.station);
    if (n < 2 || cfg->head.settings.station == 0 || here >= n) return 1;
    return cfg->station[i % n].scanner == cfg->station[here].scanner;
}

int config_is_alone(const struct config *cfg)
{
    for (uint32_t i = 0; i < cfg->n_stations; i++)
        if (!config_serves(cfg, i)) return 0;
    return 1;
}

#define IS_SAME(a, b, member) (memcmp(&(a)->member, &(b)->member, sizeof(a)->member) == 0)

/* Compares all that a section `scanner` may change. The values of the profile follow from its file and from these
 * settings. They are not compared: the bytes between them are arbitrary. */
static int is_same_scanner(const struct config *a, const struct config *b)
{
    struct config_head head[2] = {a->head, b->head};
    head[0].settings.station = head[1].settings.station = 0;
    return memcmp(&head[0], &head[1], sizeof head[0]) == 0 && IS_SAME(a, b, profile_file) && IS_SAME(a, b, beam) &&
           IS_SAME(a, b, cast) && IS_SAME(a, b, plan) && IS_SAME(a, b, noise) && IS_SAME(a, b, signal) &&
           IS_SAME(a, b, surface) && a->n_surfaces == b->n_surfaces && IS_SAME(a, b, optics) &&
           IS_SAME(a, b, instrument);
}

/* Copies a diagnostic without ", for stations[N].scanner", so that those of several scanners can be compared. */
static void copy_text_of(char *text, size_t len, const char *diagnostic)
{
    static const char mark[] = ", for stations[";
    const char *at = strstr(diagnostic, mark), *end = at != NULL ? strchr(at + 1, ':') : NULL;
    if (end == NULL)
        snprintf(text, len, "%s", diagnostic);
    else
        snprintf(text, len, "%.*s%s", (int)(at - diagnostic), diagnostic, end);
}

/* Returns whether a diagnostic was reported before. The file is read once for each scanner, so diagnostics of the
 * sections that scanners share come again. */
static int was_reported(const struct config_diagnostics *diagnostics, const char *diagnostic)
{
    char text[sizeof diagnostics->err[0].text], reported[sizeof text];
    copy_text_of(text, sizeof text, diagnostic);
    for (uint32_t i = 0; i < diagnostics->n && i < CONFIG_MAX_DIAGNOSTICS; i++) {
        copy_text_of(reported, sizeof reported, diagnostics->err[i].text);
        if (strcmp(reported, text) == 0) return 1;
    }
    return 0;
}

static void add_diagnostics(struct config_diagnostics *diagnostics, const struct config_diagnostics *more)
{
    for (uint32_t i = 0; i < more->n && i < CONFIG_MAX_DIAGNOSTICS; i++)
        if (!was_reported(diagnostics, more->err[i].text))
            cfg_add_diagnostic(diagnostics, more->place[i], more->err[i].code, more->err[i].text);
}

/* Returns the station whose configuration station i uses. A station with a section `scanner` has one of its own. The
 * others share one, which is loaded for the first of them. */
static uint32_t loaded_as(const struct config *cfg, uint32_t i)
{
    uint32_t k = 0;
    if (cfg->station[i].has_scanner) return i;
    while (cfg->station[k].has_scanner)
        k++;
    return k;
}

static void find_same(struct config *cfg, const struct config *const *loaded, uint32_t i)
{
    uint32_t k = 0;
    while (k < i && !is_same_scanner(loaded[k], loaded[i]))
        k++;
    cfg->station[i].scanner = k + 1;
}

static void check_all(struct config *cfg, struct config **own, struct config_diagnostics *diagnostics)
{
    const uint32_t here = cfg_station_at(cfg, cfg->head.settings.station);
    const struct config *loaded[CONFIG_MAX_STATIONS];
    for (uint32_t i = 0; i < cfg->n_stations; i++) {
        const uint32_t as = loaded_as(cfg, i);
        struct config_diagnostics more = {0};
        loaded[i] = as == loaded_as(cfg, here) ? cfg : as < i ? loaded[as] : own[as];
        if (as != i || loaded[i] == cfg) continue;
        own[as] = calloc(1, sizeof *own[as]);
        if (own[as] == NULL) {
            cfg_add_diagnostic(diagnostics, 0, SH_ENOMEM, "no memory for the scanners of stations");
            return;
        }
        cfg_load_for(cfg->file, cfg->sets, cfg->n_sets, i + 1, own[as], &more);
        add_diagnostics(diagnostics, &more);
        loaded[i] = own[as];
    }
    if (diagnostics->n != 0) return;
    for (uint32_t i = 0; i < cfg->n_stations; i++)
        find_same(cfg, loaded, i);
    if (config_is_alone(cfg)) return;
    for (uint32_t i = 0; i < cfg->n_stations; i++)
        cfg->scene.shared_textures |= loaded[i]->signal.on;
}

void cfg_check_scanners(struct config *cfg, struct config_diagnostics *diagnostics)
{
    struct config *own[CONFIG_MAX_STATIONS] = {NULL};
    const uint32_t station = cfg->head.settings.station;
    int any = 0;
    for (uint32_t i = 0; i < cfg->n_stations; i++)
        any |= cfg->station[i].has_scanner;
    if (!any || cfg->n_stations < 2 || station == 0 || cfg_station_at(cfg, station) >= cfg->n_stations) return;
    check_all(cfg, own, diagnostics);
    for (uint32_t i = 0; i < cfg->n_stations; i++)
        free(own[i]);
}

int config_load_scanner(const struct config *cfg, uint32_t station, struct config *out, struct sh_err *err)
{
    struct config_diagnostics diagnostics = {0};
    int rc = cfg_load_for(cfg->file, cfg->sets, cfg->n_sets, station, out, &diagnostics);
    if (rc == SH_OK && cfg->scenario_file[0] != '\0') rc = config_add_scenario(out, cfg->scenario_file, &diagnostics);
    if (rc != SH_OK) return sh_fail(err, rc, "%s", diagnostics.err[0].text);
    for (uint32_t i = 0; i < cfg->n_stations && i < out->n_stations; i++)
        out->station[i].scanner = cfg->station[i].scanner;
    out->scene.shared_textures = cfg->scene.shared_textures;
    const double tolerance_m = out->output.tolerance_m; /* it depends on this scanner's plan */
    out->output = cfg->output;
    out->output.tolerance_m = tolerance_m;
    out->loop = cfg->loop;
    return SH_OK;
}
