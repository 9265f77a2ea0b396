/* SPDX-License-Identifier: MIT */
/* Rows of the table, and where they were given. */
#include "firmware_sim/config/table.h"

#include <stdio.h>
#include <string.h>

void cfg_reader_init(struct cfg_reader *rd, const char *file, const struct cfg_table *table, void *base,
                     struct config_faults *faults)
{
    memset(rd, 0, sizeof *rd);
    rd->file = file;
    rd->table = *table;
    rd->base = base;
    rd->faults = faults;
    rd->root_line = 1;
    rd->scanner = -1;
}

const struct cfg_key *cfg_find(const struct cfg_table *table, const char *path)
{
    for (size_t i = 0; i < table->n; i++)
        if (strcmp(table->keys[i].path, path) == 0) return &table->keys[i];
    return NULL;
}

size_t cfg_row(const struct cfg_reader *rd, const struct cfg_key *key)
{
    return (size_t)(key - rd->table.keys);
}

const struct cfg_key *cfg_list_of(const struct cfg_table *table, const struct cfg_key *key)
{
    const char *bracket = strstr(key->path, "[]");
    if (bracket == NULL) return NULL;
    char path[CFG_PATH_MAX];
    snprintf(path, sizeof path, "%.*s", (int)(bracket - key->path), key->path);
    return cfg_find(table, path);
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

const char *cfg_name(const char *path, uint32_t item, char *buf)
{
    const char *bracket = strstr(path, "[]");
    if (bracket == NULL)
        snprintf(buf, CFG_PATH_MAX, "%s", path);
    else
        snprintf(buf, CFG_PATH_MAX, "%.*s[%u]%s", (int)(bracket - path), path, item, bracket + 2);
    return buf;
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

void cfg_cut_to_parent(char *path)
{
    size_t len = strlen(path);
    if (len >= 2 && strcmp(path + len - 2, "[]") == 0) {
        path[len - 2] = '\0';
        return;
    }
    char *dot = strrchr(path, '.');
    if (dot == NULL) dot = path;
    *dot = '\0';
}

int cfg_is_given(const struct cfg_reader *rd, const char *path, uint32_t item)
{
    const struct cfg_key *key = cfg_find(&rd->table, path);
    return key != NULL && rd->line[cfg_row(rd, key)][item] != 0; /* a table of some sections lacks other keys */
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

const char *cfg_word_below(const char *path, const char *parent)
{
    size_t len = strlen(parent);
    if (strncmp(path, parent, len) != 0) return NULL;
    const char *word = path + len;
    if (len > 0 && *word++ != '.') return NULL;
    return *word != '\0' && strpbrk(word, ".[") == NULL ? word : NULL;
}
