/* Rows of the table, where they were given, and the errors that say so. */
#include "firmware_sim/config/table.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

void cfg_reader_init(struct cfg_reader *rd, const char *file, const struct cfg_table *table, void *base,
                     struct sh_err *err)
{
    memset(rd, 0, sizeof *rd);
    rd->file = file;
    rd->table = *table;
    rd->base = base;
    rd->err = err;
    rd->root_line = 1;
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

/* The section around a path: "links[].type" -> "links[]" -> "links" -> "". */
static void cut_to_parent(char *path)
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
    return rd->line[cfg_row(rd, cfg_find(&rd->table, path))][item] != 0;
}

int cfg_where(const struct cfg_reader *rd, const struct cfg_key *key, uint32_t item)
{
    char path[CFG_PATH_MAX];
    snprintf(path, sizeof path, "%s", key->path);
    while (path[0] != '\0') {
        const struct cfg_key *row = cfg_find(&rd->table, path);
        uint32_t at = strstr(path, "[]") != NULL ? item : 0;
        if (row != NULL && rd->line[cfg_row(rd, row)][at] != 0) return rd->line[cfg_row(rd, row)][at];
        cut_to_parent(path);
    }
    return rd->root_line;
}

static int fail(const struct cfg_reader *rd, int line, const char *name, const char *fmt, va_list ap)
{
    char text[sizeof rd->err->text];
    vsnprintf(text, sizeof text, fmt, ap);
    if (line == CFG_FROM_SET) return sh_fail(rd->err, SH_EINPUT, "--set %s: %s", name, text);
    return sh_fail(rd->err, SH_EINPUT, "%s:%d: %s: %s", rd->file, line, name, text);
}

int cfg_fail(const struct cfg_reader *rd, int line, const char *name, const char *fmt, ...)
{
    va_list ap;
    va_start(ap, fmt);
    int code = fail(rd, line, name, fmt, ap);
    va_end(ap);
    return code;
}

int cfg_fail_key(const struct cfg_reader *rd, const char *path, uint32_t item, const char *fmt, ...)
{
    const struct cfg_key *key = cfg_find(&rd->table, path);
    char name[CFG_PATH_MAX];
    va_list ap;
    va_start(ap, fmt);
    int code = fail(rd, cfg_where(rd, key, item), cfg_name(path, item, name), fmt, ap);
    va_end(ap);
    return code;
}

const char *cfg_show(const char *text, char *buf)
{
    size_t n = 0;
    for (; text[n] != '\0' && n < CFG_SHOW_MAX - 4; n++) {
        unsigned char c = (unsigned char)text[n];
        buf[n] = c < 0x20 || c == 0x7f ? '?' : (char)c;
    }
    if (text[n] != '\0') {
        while (n > 0 && ((unsigned char)text[n] & 0xc0) == 0x80)
            n--; /* not within a UTF-8 character */
        memcpy(buf + n, "...", 3);
        n += 3;
    }
    buf[n] = '\0';
    return buf;
}

/* Levenshtein distance; both words shorter than CFG_PATH_MAX. */
static size_t edit_distance(const char *a, const char *b)
{
    size_t row[CFG_PATH_MAX + 1], lb = strlen(b);
    for (size_t j = 0; j <= lb; j++)
        row[j] = j;
    for (size_t i = 1; a[i - 1] != '\0'; i++) {
        size_t diagonal = row[0];
        row[0] = i;
        for (size_t j = 1; j <= lb; j++) {
            size_t best = diagonal + (a[i - 1] != b[j - 1]);
            if (row[j] + 1 < best) best = row[j] + 1;
            if (row[j - 1] + 1 < best) best = row[j - 1] + 1;
            diagonal = row[j];
            row[j] = best;
        }
    }
    return row[lb];
}

/* The last word of path, when path is a key directly below parent; NULL otherwise. */
static const char *word_below(const char *path, const char *parent)
{
    size_t len = strlen(parent);
    if (strncmp(path, parent, len) != 0) return NULL;
    const char *word = path + len;
    if (len > 0 && *word++ != '.') return NULL;
    return *word != '\0' && strpbrk(word, ".[") == NULL ? word : NULL;
}

/* A known key that the writer may have meant: one letter or two away here, cut short here, or the same word
 * elsewhere. */
static const char *suggest(const struct cfg_table *table, const char *parent, const char *word)
{
    const char *best = NULL;
    size_t best_distance = 3, len = strlen(word);
    if (len >= CFG_PATH_MAX) return NULL;
    for (size_t i = 0; i < table->n; i++) {
        const char *path = table->keys[i].path, *here = word_below(path, parent), *dot = strrchr(path, '.');
        size_t distance = best_distance;
        if (here != NULL) {
            distance = edit_distance(word, here);
            if (len >= 3 && (strncmp(here, word, len) == 0 || strncmp(here, word, strlen(here)) == 0)) distance = 1;
        } else if (strcmp(dot != NULL ? dot + 1 : path, word) == 0) {
            distance = 2;
        }
        if (distance >= best_distance || distance >= len) continue;
        best = path;
        best_distance = distance;
    }
    return best;
}

int cfg_fail_unknown(const struct cfg_reader *rd, int line, const char *parent, uint32_t item, const char *word)
{
    char known[256] = "", section[CFG_PATH_MAX], hint[CFG_PATH_MAX], shown[CFG_SHOW_MAX], name[2 * CFG_PATH_MAX];
    for (size_t i = 0; i < rd->table.n; i++) {
        const char *here = word_below(rd->table.keys[i].path, parent);
        size_t used = strlen(known);
        if (here != NULL) snprintf(known + used, sizeof known - used, "%s%s", used > 0 ? ", " : "", here);
    }
    cfg_name(parent, item, section);
    snprintf(name, sizeof name, "%s%s%s", section, section[0] != '\0' ? "." : "", cfg_show(word, shown));
    const char *near = suggest(&rd->table, parent, word);
    if (near == NULL) return cfg_fail(rd, line, name, "unknown key; allowed %s", known);
    return cfg_fail(rd, line, name, "unknown key, did you mean %s? allowed %s", cfg_name(near, item, hint), known);
}
