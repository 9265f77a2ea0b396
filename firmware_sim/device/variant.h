/* SPDX-License-Identifier: MIT */
/* Sites that are planned for settings of commands. */
#ifndef FIRMWARE_SIM_DEVICE_VARIANT_H
#define FIRMWARE_SIM_DEVICE_VARIANT_H

#include <stddef.h>
#include <stdint.h>

#include "core/err.h"
#include "firmware_sim/command/head.h"
#include "firmware_sim/device/scan_state.h"
#include "firmware_sim/device/versions.h"

/* All variants of a device: sites that are planned again for settings that commands gave (site_vary). */
struct device_variants {
    struct device_version *list;
    const struct device_moves *moves; /* the device's, with the present site */
    const struct device_scan *scan;   /* the device's, which may use one */
};

/* Finds or plans the site for scans from a station, from 0, with these settings; NULL: the device's site will do. */
int device_find_variant(struct device_variants *variants, const struct head_settings *settings, uint32_t station,
                        struct device_version **out, struct sh_err *err);
/* The same as command_device.can_plan; owner: the variants. */
int device_can_plan(void *owner, const struct head_settings *settings, char *why, size_t len);

#endif
