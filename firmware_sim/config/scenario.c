/* SPDX-License-Identifier: MIT */
/* Scenarios by name: those that come with the program, in the folder faults. */
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/load.h"
#include "firmware_sim/config/shared.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char ENDING[] = ".yaml";
enum { ENDING_LEN = sizeof ENDING - 1 };

static int has_ending(const char *name)
{
    const size_t len = strlen(name);
    return len > ENDING_LEN && strcmp(name + len - ENDING_LEN, ENDING) == 0;
}

static int is_scenario(const struct dirent *entry)
{
    return has_ending(entry->d_name) && entry->d_name[0] != '.';
}

void config_name_scenarios(char *buf, size_t len)
{
    char dir[CONFIG_PATH_LEN];
    struct dirent **entries = NULL;
    const int n = cfg_find_shared("faults", dir) ? scandir(dir, &entries, is_scenario, alphasort) : 0;
    size_t used = 0;
    snprintf(buf, len, "none found");
    for (int i = 0; i < n; i++) {
        if (used < len)
            used += (size_t)snprintf(buf + used, len - used, "%s%.*s", i > 0 ? ", " : "",
                                     (int)strlen(entries[i]->d_name) - ENDING_LEN, entries[i]->d_name);
        free(entries[i]);
    }
    free(entries);
}

int cfg_find_scenario(const char *name, char *buf)
{
    char file[CONFIG_PATH_LEN];
    if (strchr(name, '/') != NULL || has_ending(name)) {
        snprintf(buf, CONFIG_PATH_LEN, "%s", name);
        return strlen(name) < CONFIG_PATH_LEN;
    }
    const int len = snprintf(file, sizeof file, "faults/%s%s", name, ENDING);
    return len < (int)sizeof file && cfg_find_shared(file, buf);
}
