/* SPDX-License-Identifier: MIT */
/* Scenarios by name: those that come with the program, in the folder faults. */
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/load.h"
#include "firmware_sim/config/shared.h"

#include <stdio.h>
#include <string.h>

void config_name_scenarios(char *buf, size_t len)
{
    char dir[CONFIG_PATH_LEN];
    buf[0] = '\0';
    if (cfg_find_shared("faults", dir)) cfg_name_yaml(dir, buf, len);
    if (buf[0] == '\0') snprintf(buf, len, "none found");
}

int cfg_find_scenario(const char *name, char *buf)
{
    char file[CONFIG_PATH_LEN];
    if (strchr(name, '/') != NULL || cfg_is_yaml(name)) {
        snprintf(buf, CONFIG_PATH_LEN, "%s", name);
        return strlen(name) < CONFIG_PATH_LEN;
    }
    const int len = snprintf(file, sizeof file, "faults/%s.yaml", name);
    return len < (int)sizeof file && cfg_find_shared(file, buf);
}
