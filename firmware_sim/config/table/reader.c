/* SPDX-License-Identifier: MIT */
/* Rows of the table, and where they were given. */
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/table/given.h"
#include "firmware_sim/config/table/reader.h"
#include "firmware_sim/config/table/row.h"

#include <stdio.h>
#include <string.h>

void cfg_reader_init(struct cfg_reader *rd, const char *file, const struct cfg_table *table, void *base,
                     struct config_diagnostics *diagnostics)
{
    memset(rd, 0, sizeof *rd);
    rd->file = file;
    rd->table = *table;
    rd->base = base;
    rd->diagnostics = diagnostics;
    rd->root_line = 1;
    rd->scanner = -1;
}

size_t cfg_row(const struct cfg_reader *rd, const struct cfg_key *key)
{
    return (size_t)(key - rd->table.keys);
}

uint32_t *cfg_list_count(const struct cfg_reader *rd, const struct cfg_key *list)
{
    return (uint32_t *)(void *)((char *)rd->base + list->count_offset);
}

void *cfg_address(const struct cfg_reader *rd, const struct cfg_key *key, uint32_t item)
{
    const struct cfg_key *list = cfg_list_of(&rd->table, key);
    size_t at = key->offset;
    if (list != NULL) at += list->offset + item * list->size;
    return (char *)rd->base + at;
}

const char *cfg_word(const struct cfg_reader *rd, const char *path, int value)
{
    return cfg_find(&rd->table, path)->names[value];
}

const char *cfg_full_name(const struct cfg_reader *rd, const struct cfg_key *key, uint32_t item, char *buf)
{
    char name[CFG_PATH_MAX];
    cfg_name(key->path, item, name);
    if (rd->own[cfg_row(rd, key)])
        snprintf(buf, 2 * CFG_PATH_MAX, "stations[%d].scanner.%s", rd->scanner, name);
    else
        snprintf(buf, 2 * CFG_PATH_MAX, "%s%s%s", rd->of != NULL ? rd->of : "", rd->of != NULL ? "." : "", name);
    return buf;
}

int cfg_is_given(const struct cfg_reader *rd, const char *path)
{
    return cfg_is_item_given(rd, path, 0);
}

int cfg_is_item_given(const struct cfg_reader *rd, const char *path, uint32_t item)
{
    const struct cfg_key *key = cfg_find(&rd->table, path);
    return key != NULL && rd->line[cfg_row(rd, key)][item] != 0; /* key is NULL: the table lacks its section */
}

int cfg_has_profile(const struct cfg_reader *rd)
{
    return rd->profile_read;
}

int cfg_where(const struct cfg_reader *rd, const struct cfg_key *key, uint32_t item)
{
    char path[CFG_PATH_MAX];
    snprintf(path, sizeof path, "%s", key->path);
    while (path[0] != '\0') {
        const struct cfg_key *row = cfg_find(&rd->table, path);
        uint32_t at = strstr(path, "[]") != NULL ? item : 0;
        if (row != NULL && rd->line[cfg_row(rd, row)][at] != 0) return rd->line[cfg_row(rd, row)][at];
        cfg_cut_to_parent(path);
    }
    return rd->root_line;
}
