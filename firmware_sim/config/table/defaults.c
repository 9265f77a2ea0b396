/* SPDX-License-Identifier: MIT */
/* Defaults, for keys that are not given or are bad. */
#include "firmware_sim/config/profile.h"
#include "firmware_sim/config/profile_keys.h"
#include "firmware_sim/config/table/given.h"
#include "firmware_sim/config/table/reader.h"
#include "firmware_sim/config/table/row.h"
#include "firmware_sim/config/table/value.h"

#include <string.h>

void cfg_fail_missing(struct cfg_reader *rd, const char *path, uint32_t item)
{
    const struct cfg_key *key = cfg_find(&rd->table, path);
    char allowed[CFG_ALLOWED_MAX];
    cfg_fail_item(rd, path, item, "missing, and it has no default; %s", cfg_allowed(key, rd->profile, allowed));
}

/* The default replaces a bad value, so that checks that use it can't fail. */
static void fill_one(struct cfg_reader *rd, const struct cfg_key *key, uint32_t item,
                     const struct config_profile *profile)
{
    unsigned char *bad = &rd->bad[cfg_row(rd, key)][item];
    if (rd->line[cfg_row(rd, key)][item] != 0 && !*bad) return;
    if (key->def == NULL && !*bad) cfg_fail_missing(rd, key->path, item);
    if (key->def == NULL || key->def[0] == '\0') return; /* an empty text; the struct starts as zeros */
    if (key->def[0] != '@') {
        cfg_store(rd, key, item, rd->root_line, key->def, "");
    } else if (rd->profile_read) {
        const struct cfg_key *figure = cfg_find(&cfg_profile_table, key->def + 1);
        memcpy(cfg_address(rd, key, item), (const char *)profile + figure->offset, key->size);
    } else {
        *bad = 1;
    }
}

void cfg_fill_defaults(struct cfg_reader *rd, const struct config_profile *profile)
{
    for (size_t i = 0; i < rd->table.n; i++) {
        const struct cfg_key *key = &rd->table.keys[i], *list = cfg_list_of(&rd->table, key);
        if (key->type == CFG_MAP) continue;
        if (key->type == CFG_LIST) {
            if (*cfg_list_count(rd, key) < key->min) cfg_fail_missing(rd, key->path, 0);
            continue;
        }
        uint32_t n = list != NULL ? *cfg_list_count(rd, list) : 1;
        for (uint32_t item = 0; item < n; item++)
            fill_one(rd, key, item, profile);
    }
}
