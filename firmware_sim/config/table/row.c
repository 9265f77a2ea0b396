/* SPDX-License-Identifier: MIT */
/* Rows of a table, by their paths. */
#include "firmware_sim/config/table/row.h"

#include <stdio.h>
#include <string.h>

const struct cfg_key *cfg_find(const struct cfg_table *table, const char *path)
{
    for (size_t i = 0; i < table->n; i++)
        if (strcmp(table->keys[i].path, path) == 0) return &table->keys[i];
    return NULL;
}

const struct cfg_key *cfg_list_of(const struct cfg_table *table, const struct cfg_key *key)
{
    const char *bracket = strstr(key->path, "[]");
    if (bracket == NULL) return NULL;
    char path[CFG_PATH_MAX];
    snprintf(path, sizeof path, "%.*s", (int)(bracket - key->path), key->path);
    return cfg_find(table, path);
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

int cfg_is_in(const char *path, const char *section)
{
    const size_t len = strlen(section);
    return strncmp(path, section, len) == 0 && (path[len] == '\0' || path[len] == '.' || path[len] == '[');
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

void cfg_list_add(char *buf, size_t len, const char *word)
{
    const size_t used = strlen(buf);
    snprintf(buf + used, len - used, "%s%s", used > 0 ? ", " : "", word);
}

const char *cfg_list_kinds(unsigned kinds, const char *const *names, char *buf, size_t len)
{
    buf[0] = '\0';
    for (int kind = 0; names[kind] != NULL; kind++)
        if (kinds & CFG_KIND(kind)) cfg_list_add(buf, len, names[kind]);
    return buf;
}

int cfg_list_has(const char *list, const char *word)
{
    const size_t len = strlen(word);
    for (const char *at = list; at != NULL && (at = strstr(at, word)) != NULL; at += len)
        if ((at == list || at[-1] == ' ') && (at[len] == '\0' || at[len] == ',')) return 1;
    return 0;
}

const char *cfg_word_below(const char *path, const char *parent)
{
    size_t len = strlen(parent);
    if (strncmp(path, parent, len) != 0) return NULL;
    const char *word = path + len;
    if (len > 0 && *word++ != '.') return NULL;
    return *word != '\0' && strpbrk(word, ".[") == NULL ? word : NULL;
}
