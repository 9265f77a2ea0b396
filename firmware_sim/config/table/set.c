/* SPDX-License-Identifier: MIT */
/* --set KEY=VALUE, read by the rows of the tables: a single value, or YAML for a list or a section. */
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/copies.h"
#include "firmware_sim/config/table/diagnostics.h"
#include "firmware_sim/config/table/document.h"
#include "firmware_sim/config/table/forget.h"
#include "firmware_sim/config/table/given.h"
#include "firmware_sim/config/table/reader.h"
#include "firmware_sim/config/table/row.h"
#include "firmware_sim/config/table/value.h"
#include "firmware_sim/config/table/yaml.h"

#include <stdio.h>
#include <string.h>

/* The longest name: shorter than CFG_PATH_MAX, since errors may write it with more characters: "[1]" for ".1". */
enum { NAME_MAX_LEN = CFG_PATH_MAX - 8 };

struct set {
    char name[CFG_PATH_MAX]; /* as the user wrote it */
    char path[CFG_PATH_MAX]; /* generic: "stations[].name" */
    uint32_t item;
    int has_item;
};

/* Reads an element number, "[2]" or ".2", at p. Returns its end, or NULL where there is none. A number above the
 * limits of all lists becomes CFG_MAX_ITEMS. */
static const char *scan_item(const char *p, uint32_t *item)
{
    int bracket = *p == '[';
    const char *q = p + 1;
    if (*q < '0' || *q > '9') return NULL;
    for (*item = 0; *q >= '0' && *q <= '9'; q++)
        if (*item < CFG_MAX_ITEMS) *item = *item * 10 + (uint32_t)(*q - '0');
    if (*item > CFG_MAX_ITEMS) *item = CFG_MAX_ITEMS;
    if (bracket && *q++ != ']') return NULL;
    return *q == '.' || *q == '\0' ? q : NULL;
}

/* "stations.0.name" and "stations[0].name" -> "stations[].name", 0 */
static void to_generic(struct set *set)
{
    size_t used = 0;
    for (const char *p = set->name; *p != '\0' && used + 3 < sizeof set->path;) {
        uint32_t item;
        const char *end = (*p == '[' || *p == '.') && !set->has_item ? scan_item(p, &item) : NULL;
        if (end == NULL) {
            set->path[used++] = *p++;
            continue;
        }
        memcpy(set->path + used, "[]", 2);
        used += 2;
        set->item = item;
        set->has_item = 1;
        p = end;
    }
    set->path[used] = '\0';
}

/* Cuts the path to its longest beginning that is a known key. Returns that key; NULL: there is none. */
static const struct cfg_key *cut_to_known(const struct cfg_reader *rd, char *path)
{
    const struct cfg_key *key = NULL;
    for (size_t len = strlen(path); key == NULL && len > 0;) {
        while (len > 0 && path[--len] != '.' && path[len] != '[')
            continue;
        path[len] = '\0';
        key = cfg_find(&rd->table, path);
    }
    return key;
}

/* Makes sure that the element exists; the number after the last one appends. */
static int reach_item(struct cfg_reader *rd, const struct set *set, const struct cfg_key *list)
{
    uint32_t *count = cfg_list_count(rd, list);
    if (set->item < *count) return SH_OK;
    uint32_t last = *count < (uint32_t)list->max ? *count : (uint32_t)list->max - 1;
    if (set->item > last)
        return cfg_fail(rd, CFG_FROM_SET, set->name, "%s has %u element%s; allowed indices 0 to %u%s", list->path,
                        *count, *count == 1 ? "" : "s", last, last == *count ? ", the last appends one" : "");
    rd->line[cfg_row(rd, list) + 1][set->item] = CFG_FROM_SET;
    ++*count;
    return SH_OK;
}

static int fail_unknown(struct cfg_reader *rd, const struct set *set)
{
    char parent[CFG_PATH_MAX], name[CFG_PATH_MAX];
    snprintf(parent, sizeof parent, "%s", set->path);
    const struct cfg_key *key = cut_to_known(rd, parent);
    const char *rest = set->path + strlen(parent);
    if (rd->in_scanner && strcmp(parent, "surfaces") == 0)
        return cfg_fail(rd, CFG_FROM_SET, set->name,
                        "surfaces of a scanner are set as one list; allowed "
                        "surfaces=[{...}, ...]");
    if (key == NULL || (key->type == CFG_MAP && rest[0] == '['))
        return cfg_fail_unknown(rd, CFG_FROM_SET, "", 0, rd->in_scanner ? set->path : set->name);
    const uint32_t item = rd->in_scanner ? 0 : set->item;
    const struct cfg_key *list = cfg_list_of(&rd->table, key);
    if (list != NULL && !rd->in_scanner && item >= (uint32_t)list->max) return reach_item(rd, set, list);
    if (key->type == CFG_MAP) return cfg_fail_unknown(rd, CFG_FROM_SET, parent, item, rest + 1);
    cfg_name(parent, item, name);
    if (key->type == CFG_LIST)
        return cfg_fail(rd, CFG_FROM_SET, set->name, "unknown key; %s is a list; allowed an index, as in %s[0]", name,
                        name);
    return cfg_fail(rd, CFG_FROM_SET, set->name, "unknown key; %s has no keys that can be set; allowed %s=VALUE", name,
                    name);
}

/* Puts the key that the text names into `set`; or adds a diagnostic. */
static int take_name(struct cfg_reader *rd, const char *text, const char *equals, struct set *set)
{
    char shown[CFG_SHOW_MAX];
    if (equals == NULL || equals == text)
        return cfg_fail(rd, CFG_FROM_SET, cfg_show(text, shown), "no %s; allowed KEY=VALUE, as in head.prr_hz=300000",
                        equals == NULL ? "'='" : "key");
    if (equals - text > NAME_MAX_LEN)
        return cfg_fail(rd, CFG_FROM_SET, cfg_show(text, shown), "unknown key; allowed up to %d characters",
                        NAME_MAX_LEN);
    snprintf(set->name, sizeof set->name, "%.*s", (int)(equals - text), text);
    to_generic(set);
    if (strstr(set->name, "[]") != NULL)
        return cfg_fail(rd, CFG_FROM_SET, set->name, "no index; allowed as in links[0].type");
    return SH_OK;
}

static const char SCANNER[] = "stations[].scanner";

/* Takes a path like "stations[].scanner.head.prr_hz". Returns 1 if this scanner is being read; the path is then the
 * key's own, "head.prr_hz". */
static int enter_scanner(struct cfg_reader *rd, struct set *set)
{
    const size_t len = strlen(SCANNER);
    const struct cfg_key *section = cfg_find(&rd->table, SCANNER), *list = cfg_find(&rd->table, "stations");
    if (section == NULL) return 1; /* a table of links alone has no stations */
    if (!rd->in_scanner) {
        if (reach_item(rd, set, list) != SH_OK) return 0;
        ((struct config_station *)cfg_address(rd, section, set->item))->has_scanner = 1;
        rd->line[cfg_row(rd, section)][set->item] = CFG_FROM_SET;
        return 0;
    }
    if (rd->scanner != (int)set->item) return 0;
    memmove(set->path, set->path + len + 1, strlen(set->path + len + 1) + 1);
    set->item = 0;
    const struct cfg_key *key = cfg_find(&rd->table, set->path);
    if (key == NULL || cfg_is_of_scanner(set->path)) return 1;
    cfg_fail(rd, CFG_FROM_SET, set->name, "the same for all scanners; allowed %s", cfg_sections_of_scanner);
    return 0;
}

/* Replaces a list or a section by a value of YAML. Keys that the value doesn't name get their defaults. */
static void replace(struct cfg_reader *rd, struct cfg_document *doc, const struct set *set, const struct cfg_key *key,
                    const char *text, int n_before)
{
    static const char not_this[] = "is a section of a scanner; set one of its keys, or the scanner as a whole";
    if (rd->in_scanner && key->type == CFG_MAP) {
        cfg_fail(rd, CFG_FROM_SET, set->name, "%s", not_this);
        return;
    }
    if (rd->in_scanner) cfg_take_over(rd, key);
    cfg_forget(rd, key, set->item);
    const int is_list = strcmp(key->path, "stations") == 0;
    if (is_list || strcmp(key->path, "stations[]") == 0 || strcmp(key->path, SCANNER) == 0)
        for (uint32_t i = is_list ? 0 : set->item; i <= (is_list ? CFG_MAX_ITEMS - 1 : set->item); i++) {
            doc->scanner[i] = NULL;
            rd->scanner_since[i] = n_before;
        }
    rd->line[cfg_row(rd, key)][set->item] = CFG_FROM_SET;
    rd->set = set->name;
    cfg_read_set_value(rd, doc, key, set->item, text);
    rd->set = NULL;
}

/* Whether an empty value takes the key back: it is a text or a path that is empty where it isn't given. An element of a
 * list always has a value. */
static int can_be_empty(const struct cfg_key *key)
{
    const size_t len = strlen(key->path);
    return (key->type == CFG_TEXT || key->type == CFG_PATH) && key->def != NULL && key->def[0] == '\0' &&
           strcmp(key->path + len - 2, "[]") != 0;
}

/* n_before: how many --set came before it. */
static void apply_set(struct cfg_reader *rd, struct cfg_document *doc, const char *text, int n_before)
{
    struct set set = {.item = 0};
    const char *equals = strchr(text, '=');
    /* wrong names were reported when the file's own keys were read */
    if (rd->in_scanner && (equals == NULL || equals == text || strncmp(text, "stations", 8) != 0)) return;
    if (take_name(rd, text, equals, &set) != SH_OK) return;
    const int is_scanners = strncmp(set.path, SCANNER, strlen(SCANNER)) == 0 && set.path[strlen(SCANNER)] == '.';
    if (is_scanners ? !enter_scanner(rd, &set) : rd->in_scanner) return;
    const struct cfg_key *key = cfg_find(&rd->table, set.path);
    if (key == NULL) {
        fail_unknown(rd, &set);
        return;
    }
    const struct cfg_key *list = cfg_list_of(&rd->table, key);
    if (list != NULL && reach_item(rd, &set, list) != SH_OK) return;
    cfg_forget_copies(rd, key, set.item);
    const int is_copies = strcmp(key->path, "scene.meshes[].copies") == 0 && equals[1] == '[';
    if (key->type == CFG_MAP || key->type == CFG_LIST || key->type == CFG_POINTS || is_copies) {
        replace(rd, doc, &set, key, equals + 1, n_before);
        return;
    }
    if (is_scanners) cfg_take_over(rd, key);
    if (equals[1] == '\0' && can_be_empty(key)) {
        cfg_forget_value(rd, key, set.item);
        return;
    }
    rd->line[cfg_row(rd, key)][set.item] = CFG_FROM_SET;
    cfg_store(rd, key, set.item, CFG_FROM_SET, equals + 1, "");
}

void cfg_apply_sets(struct cfg_reader *rd, struct cfg_document *doc, const char *const *sets, int n_sets)
{
    for (int i = rd->in_scanner ? rd->scanner_since[rd->scanner] : 0; i < n_sets; i++)
        apply_set(rd, doc, sets[i], i);
}
