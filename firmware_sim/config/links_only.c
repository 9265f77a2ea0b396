/* SPDX-License-Identifier: MIT */
/* A configuration of links, loop and faults alone, for a recording that is replayed: it has no head and no scene. */
#include <stdio.h>
#include <string.h>

#include "firmware_sim/config/check.h"
#include "firmware_sim/config/check_faults.h"
#include "firmware_sim/config/check_links.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/keys.h"
#include "firmware_sim/config/load.h"
#include "firmware_sim/config/table/document.h"
#include "firmware_sim/config/table/reader.h"
#include "firmware_sim/config/table/row.h"

static int is_taken(const char *path)
{
    return cfg_is_in(path, "links") || cfg_is_in(path, "loop") || cfg_is_in(path, "faults");
}

int config_load_links(const char *text, const char *name, const char *const *sets, int n_sets, struct config *cfg,
                      struct config_diagnostics *diagnostics)
{
    struct cfg_key keys[CFG_MAX_ROWS];
    struct cfg_table table = {keys, 0};
    struct cfg_reader rd;
    struct cfg_document *doc;
    memset(cfg, 0, sizeof *cfg);
    cfg->has_no_head = 1;
    memset(diagnostics, 0, sizeof *diagnostics);
    snprintf(cfg->file, sizeof cfg->file, "%s", name);
    for (size_t i = 0; i < cfg_config_table.n; i++)
        if (is_taken(cfg_config_table.keys[i].path)) keys[table.n++] = cfg_config_table.keys[i];
    cfg_reader_init(&rd, cfg->file, &table, cfg, diagnostics);
    if (cfg_open_text(&rd, (const unsigned char *)text, strlen(text), &doc) != SH_OK) return diagnostics->err[0].code;
    cfg_apply_sets(&rd, doc, sets, n_sets);
    cfg_close_file(doc);
    cfg_fill_defaults(&rd, NULL);
    cfg_check_links(&rd, cfg);
    cfg_check_protocols_alone(&rd, cfg);
    cfg_check_loop(&rd, cfg);
    cfg_check_faults(&rd, &cfg->faults);
    cfg_check_fault_links(&rd, cfg, &cfg->faults);
    return diagnostics->n == 0 ? SH_OK : diagnostics->err[0].code;
}
