/* SPDX-License-Identifier: MIT */
/* This fuzzes configurations. The input is a YAML file, with the settings of --set as its comments `#set KEY=VALUE`,
 * and faults in the form of FAULt:ADD as `#fault {...}`. A refusal must be in lines. Values that are taken must be
 * within the limits that later stages count on. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "firmware_sim/config/config.h"
#include "firmware_sim/config/load.h"
#include "tests/fuzz/rig.h"

enum { MAX_SETS = 8, SET_LEN = 256, MAX_INPUT = 1 << 14 };

static struct {
    char text[MAX_SETS][SET_LEN];
    const char *of[MAX_SETS];
    int n;
} sets;

/* Finds the lines that begin with `#set `. */
static void find_sets(const char *text)
{
    sets.n = 0;
    for (const char *p = text; sets.n < MAX_SETS && (p = strstr(p, "#set ")) != NULL;) {
        p += 5;
        size_t len = strcspn(p, "\n");
        if (len >= SET_LEN) len = SET_LEN - 1;
        memcpy(sets.text[sets.n], p, len);
        sets.text[sets.n][len] = '\0';
        sets.of[sets.n] = sets.text[sets.n];
        sets.n++;
    }
}

/* Reads each line that begins with `#fault `, for a head with this configuration. */
static void add_faults(const struct config *cfg, const char *text)
{
    static struct fault fault;
    for (const char *p = text; (p = strstr(p, "#fault ")) != NULL;) {
        char line[SET_LEN];
        struct sh_err err = {0};
        p += 7;
        const size_t len = strcspn(p, "\n");
        snprintf(line, sizeof line, "%.*s", (int)len, p);
        if (config_read_fault(cfg, line, &fault, &err) != SH_OK) fuzz_must_be_line(&err);
    }
}

static void check_taken(const struct config *cfg)
{
    const struct head_settings *s = &cfg->head.settings;
    fuzz_must(cfg->n_stations >= 1 && cfg->n_stations <= CONFIG_MAX_STATIONS, "stations within their number");
    fuzz_must(cfg->scene.n_meshes <= CONFIG_MAX_MESHES && cfg->n_links <= CONFIG_MAX_LINKS, "lists within their room");
    fuzz_must(s->station >= 1 && s->station <= cfg->n_stations, "head.station is one of the stations");
    fuzz_must(s->prr_uhz > 0 && s->lines_uhz > 0 && s->frames <= HEAD_MAX_FRAMES, "rates above 0");
    fuzz_must(cfg->head.range_min_m < cfg->head.range_max_m, "the nearest range below the farthest");
    fuzz_must(cfg->loop.tick_hz >= 100 && cfg->loop.tick_hz <= 10000, "tick_hz within its limits");
    for (uint32_t i = 0; i < cfg->n_stations; i++)
        for (int c = 0; c < 3; c++)
            fuzz_must(isfinite(cfg->station[i].position_m[c]), "positions are finite");
}

static void check_refused(int code, const struct config_diagnostics *diagnostics)
{
    fuzz_must(diagnostics->n > 0 && diagnostics->err[0].code == code, "the first fault says why");
    for (uint32_t i = 0; i < diagnostics->n && i < CONFIG_MAX_DIAGNOSTICS; i++)
        fuzz_must_be_line(&diagnostics->err[i]);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static struct config *cfg;
    static struct config_diagnostics diagnostics;
    char text[MAX_INPUT + 1];
    if (size > MAX_INPUT) return 0;
    if (cfg == NULL) cfg = malloc(sizeof *cfg);
    setenv("SCANHEAD_HEADS", "config/heads", 0);
    memcpy(text, data, size);
    text[size] = '\0';
    find_sets(text);
    const int code = config_load_all(fuzz_file(".yaml", data, size), sets.of, sets.n, cfg, &diagnostics);
    if (code == SH_OK) {
        check_taken(cfg);
        add_faults(cfg, text);
    } else {
        check_refused(code, &diagnostics);
    }
    const int links = config_load_links(text, "links", sets.of, sets.n, cfg, &diagnostics);
    if (links != SH_OK) check_refused(links, &diagnostics);
    return 0;
}
