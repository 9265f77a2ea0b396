/* SPDX-License-Identifier: MIT */
/* Sites that are planned for settings of commands. */
#ifndef FIRMWARE_SIM_DEVICE_VARIANT_H
#define FIRMWARE_SIM_DEVICE_VARIANT_H

#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>

#include "core/err.h"
#include "firmware_sim/command/head.h"
#include "firmware_sim/device/scan_state.h"
#include "firmware_sim/device/versions.h"

/* The site, planned again for settings that commands gave (site_vary). The variant is kept while a scan or a tick's
 * work uses it. */
struct device_variant {
    struct device_variant *next;
    struct device_version *version; /* the variant is made from it, and counts as one of its users */
    struct site *site;
    struct head_settings settings;
    uint32_t station; /* from 0 */
    _Atomic uint32_t users;
};

/* All variants of a device. */
struct device_variants {
    struct device_variant *list;
    const struct device_moves *moves; /* the device's, with the present site */
    const struct device_scan *scan;   /* the device's, which may use one */
};

/* Finds or plans the site for scans from a station, from 0, with these settings; NULL: the device's site will do. */
int device_find_variant(struct device_variants *variants, const struct head_settings *settings, uint32_t station,
                        struct device_variant **out, struct sh_err *err);
/* The same as command_device.can_plan; owner: the variants. */
int device_can_plan(void *owner, const struct head_settings *settings, char *why, size_t len);
/* Frees the variants that no tick's work and no scan uses. */
void device_free_unused_variants(struct device_variants *variants);
void device_free_variants(struct device_variants *variants);

#endif
