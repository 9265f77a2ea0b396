/* SPDX-License-Identifier: MIT */
/* A variant is the site, planned again after commands have changed ranges, noise or the step of a sphere. The command
 * makes the variant, and is refused where no plan is possible. The next scan uses the variant. When another one is
 * made, or a station moves, each variant is freed that no scan, work or observer needs. */
#include <stdio.h>

#include "firmware_sim/device/device_state.h"

/* Whether the variant is planned for these settings and the stations' present places. */
static int fits(const struct device *device, const struct device_version *v, const struct head_settings *settings,
                uint32_t station)
{
    return v->from == device->moves.current && v->station == station && !site_varies(&v->settings, settings);
}

int device_find_variant(struct device *device, const struct head_settings *settings, uint32_t station,
                        struct device_version **out, struct sh_err *err)
{
    struct device_moves *moves = &device->moves;
    const struct site *site = moves->current->site;
    *out = NULL;
    if (!site_varies(settings, site_settings(site))) return SH_OK;
    for (struct device_version *v = moves->variants; v != NULL; v = v->next)
        if (fits(device, v, settings, station)) {
            *out = v;
            return SH_OK;
        }
    device_free_unused(&moves->variants, device->scan.variant);
    struct site *own;
    int rc = site_vary(site, settings, station, &own, err);
    if (rc != SH_OK) return rc;
    struct device_version *v = device_make_version(own, own);
    if (v == NULL) {
        site_vary_free(own);
        return sh_fail(err, SH_ENOMEM, "no memory");
    }
    v->from = device_use(moves->current);
    v->settings = *settings;
    v->station = station;
    v->next = moves->variants;
    *out = moves->variants = v;
    return SH_OK;
}

int device_can_plan(void *owner, const struct head_settings *settings, char *why, size_t len)
{
    struct device_version *variant;
    struct sh_err err;
    int rc = device_find_variant(owner, settings, settings->station - 1, &variant, &err);
    if (rc != SH_OK) snprintf(why, len, "%s", err.text);
    return rc == SH_OK ? 0 : -1;
}
