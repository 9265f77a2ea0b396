/* SPDX-License-Identifier: MIT */
#include <stdio.h>

#include "firmware_sim/config/files.h"

#include "firmware_sim/config/config.h"
#include "firmware_sim/config/keys.h"
#include "firmware_sim/config/profile_keys.h"
#include "firmware_sim/config/table/row.h"

static int take_key(const struct cfg_table *table, const void *base, const struct cfg_key *key, const char *of,
                    config_take_file *take, void *ctx)
{
    const struct cfg_key *list = cfg_list_of(table, key);
    const char *at = (const char *)base + key->offset + (list != NULL ? list->offset : 0);
    const uint32_t n = list != NULL ? *(const uint32_t *)(const void *)((const char *)base + list->count_offset) : 1;
    int rc = SH_OK;
    for (uint32_t i = 0; i < n && rc == SH_OK; i++, at += list != NULL ? list->size : 0) {
        char name[CFG_PATH_MAX], full[CFG_PATH_MAX + 16];
        snprintf(full, sizeof full, "%s%s", of, cfg_name(key->path, i, name));
        if (at[0] != '\0') rc = take(ctx, full, at, (key->flags & CFG_WRITTEN) != 0);
    }
    return rc;
}

static int take_table(const struct cfg_table *table, const void *base, const char *of, config_take_file *take,
                      void *ctx)
{
    int rc = SH_OK;
    for (size_t i = 0; i < table->n && rc == SH_OK; i++)
        if (table->keys[i].type == CFG_PATH) rc = take_key(table, base, &table->keys[i], of, take, ctx);
    return rc;
}

int config_each_file(const struct config *cfg, config_take_file *take, void *ctx)
{
    int rc = take_table(&cfg_config_table, cfg, "", take, ctx);
    if (rc == SH_OK) rc = take_table(&cfg_profile_table, &cfg->profile, "head.profile: ", take, ctx);
    if (rc == SH_OK && cfg->profile_file[0] != '\0') rc = take(ctx, "head.profile", cfg->profile_file, 0);
    if (rc == SH_OK && cfg->scenario_file[0] != '\0') rc = take(ctx, "--scenario", cfg->scenario_file, 0);
    return rc;
}
