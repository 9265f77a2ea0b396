/* SPDX-License-Identifier: MIT */
/* Values that are dropped, and the section `scanner` of a station, whose keys replace those of the file. */
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/table/forget.h"
#include "firmware_sim/config/table/reader.h"
#include "firmware_sim/config/table/row.h"

#include <string.h>

const char cfg_sections_of_scanner[] =
    "sections head (without station, start), beam, cast (without sight_mib), plan, noise, signal, surfaces, optics, "
    "instrument";

int cfg_is_of_scanner(const char *path)
{
    static const char *const sections[] = {"head",   "beam",     "cast",   "plan",      "noise",
                                           "signal", "surfaces", "optics", "instrument"};
    static const char *const not_these[] = {"head.station", "head.start", "cast.sight_mib"};
    for (size_t i = 0; i < CFG_LEN(not_these); i++)
        if (strcmp(path, not_these[i]) == 0) return 0;
    for (size_t i = 0; i < CFG_LEN(sections); i++)
        if (cfg_is_in(path, sections[i])) return 1;
    return 0;
}

static void forget_row(struct cfg_reader *rd, const struct cfg_key *key)
{
    const size_t row = cfg_row(rd, key);
    memset(rd->line[row], 0, sizeof rd->line[row]);
    memset(rd->bad[row], 0, sizeof rd->bad[row]);
}

void cfg_forget_list(struct cfg_reader *rd, const char *path)
{
    const struct cfg_key *list = cfg_find(&rd->table, path);
    for (size_t i = 0; i < rd->table.n; i++)
        if (cfg_is_in(rd->table.keys[i].path, path)) forget_row(rd, &rd->table.keys[i]);
    memset(cfg_address(rd, list, 0), 0, list->size * (size_t)list->max);
    *cfg_list_count(rd, list) = 0;
}

void cfg_forget_value(struct cfg_reader *rd, const struct cfg_key *key, uint32_t item)
{
    const size_t row = cfg_row(rd, key);
    rd->line[row][item] = 0;
    rd->bad[row][item] = 0;
    if (key->type != CFG_MAP) memset(cfg_address(rd, key, item), 0, key->size);
}

void cfg_forget(struct cfg_reader *rd, const struct cfg_key *key, uint32_t item)
{
    for (size_t i = 0; i < rd->table.n; i++) {
        const struct cfg_key *row = &rd->table.keys[i];
        if (!cfg_is_in(row->path, key->path)) continue;
        if (row->type == CFG_LIST)
            cfg_forget_list(rd, row->path);
        else if (cfg_list_of(&rd->table, row) == cfg_list_of(&rd->table, key)) /* else dropped with its list */
            cfg_forget_value(rd, row, item);
    }
    if (strncmp(key->path, "stations[]", 10) == 0 && cfg_is_in("stations[].scanner", key->path))
        ((struct config_station *)cfg_address(rd, cfg_find(&rd->table, "stations[].scanner"), item))->has_scanner = 0;
}

void cfg_take_over(struct cfg_reader *rd, const struct cfg_key *key)
{
    const size_t row = cfg_row(rd, key);
    if (rd->own[row]) return; /* the scanner's already, maybe by an earlier element of the list */
    if (key->type == CFG_LIST) {
        cfg_forget_list(rd, key->path);
        for (size_t i = 0; i < rd->table.n; i++)
            if (cfg_is_in(rd->table.keys[i].path, key->path)) rd->own[i] = 1;
    }
    rd->own[row] = 1;
    forget_row(rd, key);
}

/* Where the scanner has a profile of its own, the file's settings of the head and errors of its instrument are dropped:
 * they belong to another head. */
void cfg_end_scanner(struct cfg_reader *rd)
{
    if (!rd->own[cfg_row(rd, cfg_find(&rd->table, "head.profile"))]) return;
    for (size_t i = 0; i < rd->table.n; i++) {
        const struct cfg_key *key = &rd->table.keys[i];
        if (rd->own[i] || key->type == CFG_MAP || !cfg_is_of_scanner(key->path)) continue;
        if (!cfg_is_in(key->path, "head") && !cfg_is_in(key->path, "instrument")) continue;
        forget_row(rd, key);
        memset(cfg_address(rd, key, 0), 0, key->size);
    }
}
