/* SPDX-License-Identifier: MIT */
/* The list of diagnostics: each is one line that says where, which key, what is wrong and what is allowed. */
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "core/utf8.h"
#include "firmware_sim/base/nearest.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/load.h"
#include "firmware_sim/config/profile_keys.h"
#include "firmware_sim/config/table/diagnostics.h"
#include "firmware_sim/config/table/forget.h"
#include "firmware_sim/config/table/given.h"
#include "firmware_sim/config/table/reader.h"
#include "firmware_sim/config/table/row.h"
#include "firmware_sim/config/table/value.h"

/* Where the list is full, its last diagnostic is dropped. */
int cfg_add_diagnostic(struct config_diagnostics *diagnostics, uint64_t place, int code, const char *text)
{
    uint32_t at = diagnostics->n < CONFIG_MAX_DIAGNOSTICS ? diagnostics->n : CONFIG_MAX_DIAGNOSTICS;
    diagnostics->n++;
    while (at > 0 && diagnostics->place[at - 1] > place)
        at--;
    if (at == CONFIG_MAX_DIAGNOSTICS) return code;
    const size_t after = CONFIG_MAX_DIAGNOSTICS - 1 - at;
    memmove(&diagnostics->err[at + 1], &diagnostics->err[at], after * sizeof diagnostics->err[0]);
    memmove(&diagnostics->place[at + 1], &diagnostics->place[at], after * sizeof diagnostics->place[0]);
    diagnostics->place[at] = place;
    return sh_fail(&diagnostics->err[at], code, "%s", text);
}

static int diagnostics_add(struct cfg_reader *rd, int code, int line, const char *text)
{
    const uint64_t source = line == CFG_FROM_SET || rd->set != NULL    ? 1
                            : rd->table.keys == cfg_profile_table.keys ? 2
                                                                       : 0;
    return cfg_add_diagnostic(rd->diagnostics, source << 32 | (uint32_t)line, code, text);
}

static int diagnostics_fail(struct cfg_reader *rd, int code, int line, const char *name, const char *fmt, va_list ap)
{
    char what[sizeof rd->diagnostics->err[0].text], text[sizeof what + 2 * CONFIG_PATH_LEN], place[48] = "";
    vsnprintf(what, sizeof what, fmt, ap);
    if (line > 0) snprintf(place, sizeof place, rd->set != NULL ? "character %d of the value: " : ":%d", line);
    if (rd->set != NULL && line != CFG_FROM_SET)
        snprintf(text, sizeof text, "--set %s: %s%s", rd->set, place, what);
    else if (line == CFG_FROM_SET)
        snprintf(text, sizeof text, "--set %s: %s", name, what);
    else
        snprintf(text, sizeof text, "%s%s: %s%s%s", rd->file, place, name, name[0] != '\0' ? ": " : "", what);
    return diagnostics_add(rd, code, line, text);
}

int cfg_fail_file(struct cfg_reader *rd, int code, int line, const char *fmt, ...)
{
    va_list ap;
    va_start(ap, fmt);
    diagnostics_fail(rd, code, line, "", fmt, ap);
    va_end(ap);
    return code;
}

int cfg_fail(struct cfg_reader *rd, int line, const char *name, const char *fmt, ...)
{
    va_list ap;
    va_start(ap, fmt);
    int code = diagnostics_fail(rd, SH_EINPUT, line, name, fmt, ap);
    va_end(ap);
    return code;
}

int cfg_fail_value(struct cfg_reader *rd, const struct cfg_key *key, uint32_t item, int line, const char *fmt, ...)
{
    char name[2 * CFG_PATH_MAX];
    va_list ap;
    rd->bad[cfg_row(rd, key)][item] = 1;
    va_start(ap, fmt);
    int code = diagnostics_fail(rd, SH_EINPUT, line, cfg_full_name(rd, key, item, name), fmt, ap);
    va_end(ap);
    return code;
}

/* Returns whether the key, or a section around it, is bad. */
static int is_bad(const struct cfg_reader *rd, const char *of, uint32_t item)
{
    char path[CFG_PATH_MAX];
    snprintf(path, sizeof path, "%s", of);
    for (; path[0] != '\0'; cfg_cut_to_parent(path)) {
        const struct cfg_key *row = cfg_find(&rd->table, path);
        if (row != NULL && rd->bad[cfg_row(rd, row)][strstr(path, "[]") != NULL ? item : 0]) return 1;
    }
    return 0;
}

/* Returns whether a key below the section is bad. If the section is a whole list, keys of all its items count; else
 * only those of this item. */
static int has_bad(const struct cfg_reader *rd, const char *section, uint32_t item)
{
    const int is_of_item = strstr(section, "[]") != NULL;
    for (size_t i = 0; i < rd->table.n; i++)
        if (cfg_is_in(rd->table.keys[i].path, section) &&
            (is_of_item ? rd->bad[i][item] != 0 : memchr(rd->bad[i], 1, sizeof rd->bad[i]) != NULL))
            return 1;
    return 0;
}

int cfg_are_sound(const struct cfg_reader *rd, uint32_t item, const char *const *paths, size_t n)
{
    for (size_t i = 0; i < n; i++)
        if (is_bad(rd, paths[i], item) || has_bad(rd, paths[i], item)) return 0;
    return 1;
}

static int fail_at(struct cfg_reader *rd, const char *path, uint32_t item, const char *fmt, va_list ap)
{
    const struct cfg_key *key = cfg_find(&rd->table, path);
    char name[2 * CFG_PATH_MAX], of[2 * CFG_PATH_MAX + 48];
    if (is_bad(rd, path, item)) return SH_EINPUT;
    rd->bad[cfg_row(rd, key)][item] = 1;
    cfg_full_name(rd, key, item, name);
    if (rd->scanner >= 0 && !rd->own[cfg_row(rd, key)]) { /* the file's key contradicts one of the scanner */
        snprintf(of, sizeof of, "%s, for stations[%d].scanner", name, rd->scanner);
        snprintf(name, sizeof name, "%.190s", of);
    }
    return diagnostics_fail(rd, SH_EINPUT, cfg_where(rd, key, item), name, fmt, ap);
}

int cfg_fail_item(struct cfg_reader *rd, const char *path, uint32_t item, const char *fmt, ...)
{
    va_list ap;
    va_start(ap, fmt);
    const int code = fail_at(rd, path, item, fmt, ap);
    va_end(ap);
    return code;
}

int cfg_fail_key(struct cfg_reader *rd, const char *path, const char *fmt, ...)
{
    va_list ap;
    va_start(ap, fmt);
    const int code = fail_at(rd, path, 0, fmt, ap);
    va_end(ap);
    return code;
}

const char *cfg_show(const char *text, char *buf)
{
    size_t n = strnlen(text, CFG_SHOW_MAX - 4);
    memcpy(buf, text, n);
    if (text[n] != '\0') {
        n = utf8_cut(text, n);
        memcpy(buf + n, "...", 3);
        n += 3;
    }
    buf[n] = '\0';
    return buf;
}

/* Finds the known key that the writer may have meant. In this section it differs in a letter or two, or one of the two
 * words is the beginning of the other. In another section it is the same word. NULL: there is none. */
static const struct cfg_key *suggest(const struct cfg_table *table, const char *parent, const char *word)
{
    const struct cfg_key *best = NULL;
    size_t best_distance = 3, len = strlen(word);
    for (size_t i = 0; i < table->n; i++) {
        const char *path = table->keys[i].path, *here = cfg_word_below(path, parent), *dot = strrchr(path, '.');
        size_t distance = best_distance;
        if (here != NULL) {
            distance = nearest_distance(word, here);
            if (len >= 3 && (strncmp(here, word, len) == 0 || strncmp(here, word, strlen(here)) == 0)) distance = 1;
        } else if (strcmp(dot != NULL ? dot + 1 : path, word) == 0) {
            distance = 2;
        }
        if (distance >= best_distance || distance >= len) continue;
        best = &table->keys[i];
        best_distance = distance;
    }
    return best;
}

int cfg_fail_unknown(struct cfg_reader *rd, int line, const char *parent, uint32_t item, const char *word)
{
    /* A hostile file may have far more diagnostics than are shown: don't search the table for each. */
    if (rd->diagnostics->n >= 10 * CONFIG_MAX_DIAGNOSTICS) return cfg_fail(rd, line, "configuration", "unknown key");
    char section[CFG_PATH_MAX], hint[CFG_PATH_MAX], shown[CFG_SHOW_MAX], name[3 * CFG_PATH_MAX];
    char known[CFG_ALLOWED_MAX] = "", before[CFG_PATH_MAX] = "";
    if (rd->of != NULL) snprintf(before, sizeof before, "%s.", rd->of);
    if (rd->in_scanner) snprintf(before, sizeof before, "stations[%d].scanner.", rd->scanner);
    for (size_t i = 0; i < rd->table.n; i++) {
        const char *path = rd->table.keys[i].path, *here = cfg_word_below(path, parent);
        if (here != NULL && (!rd->in_scanner || cfg_is_of_scanner(path))) cfg_list_add(known, sizeof known, here);
    }
    cfg_name(parent, item, section);
    snprintf(name, sizeof name, "%s%s%s%s", before, section, section[0] != '\0' ? "." : "", cfg_show(word, shown));
    const struct cfg_key *near = suggest(&rd->table, parent, word);
    if (near == NULL) return cfg_fail(rd, line, name, "unknown key; allowed %s", known);
    rd->bad[cfg_row(rd, near)][strstr(near->path, "[]") != NULL ? item : 0] = 1;
    if (!rd->in_scanner || !cfg_is_of_scanner(near->path)) before[0] = '\0'; /* the key is the file's */
    const int is_alone = before[0] == '\0' && strchr(near->path, '.') == NULL, in_file = line != CFG_FROM_SET;
    return cfg_fail(rd, line, name, "unknown key, did you mean %s%s%s? allowed %s", before,
                    cfg_name(near->path, item, hint),
                    section[0] != '\0' && is_alone && in_file ? " at the top of the file" : "", known);
}
