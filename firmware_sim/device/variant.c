/* SPDX-License-Identifier: MIT */
/* Sites that are planned for settings of commands: ranges, noise, step of a sphere. The command makes one, and is
 * refused where there is no such plan. The scan takes it. It is freed once no work of a scan needs it. */
#include <stdio.h>
#include <stdlib.h>

#include "firmware_sim/config/config.h"
#include "firmware_sim/device/device_state.h"

/* Whether the variant is planned for these settings and the stations' present places. */
static int fits(const struct device *device, const struct device_variant *v, const struct head_settings *settings,
                uint32_t station)
{
    return v->version == device->moves.current && v->station == station && !site_varies(&v->settings, settings);
}

static void free_variant(struct device_variant *v)
{
    site_vary_free(v->site);
    device_give_back(v->version);
    free(v);
}

void device_free_unused_variants(struct device *device)
{
    for (struct device_variant **at = &device->variants; *at != NULL;) {
        struct device_variant *v = *at;
        if (v == device->scan.variant || atomic_load(&v->users) != 0) {
            at = &v->next;
            continue;
        }
        *at = v->next;
        free_variant(v);
    }
}

int device_find_variant(struct device *device, const struct head_settings *settings, uint32_t station,
                        struct device_variant **out, struct sh_err *err)
{
    *out = NULL;
    if (!site_varies(settings, &device->site->cfg->head.settings)) return SH_OK;
    for (struct device_variant *v = device->variants; v != NULL; v = v->next)
        if (fits(device, v, settings, station)) {
            *out = v;
            return SH_OK;
        }
    device_free_unused_variants(device);
    struct device_variant *v = calloc(1, sizeof *v);
    if (v == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    int rc = site_vary(device->site, settings, station, &v->site, err);
    if (rc != SH_OK) {
        free(v);
        return rc;
    }
    v->version = device->moves.current;
    atomic_fetch_add(&v->version->users, 1);
    v->settings = *settings;
    v->station = station;
    v->next = device->variants;
    *out = device->variants = v;
    return SH_OK;
}

int device_can_plan(void *owner, const struct head_settings *settings, char *why, size_t len)
{
    struct device *device = owner;
    struct device_variant *variant;
    struct sh_err err;
    int rc = device_find_variant(device, settings, settings->station - 1, &variant, &err);
    if (rc != SH_OK) snprintf(why, len, "%s", err.text);
    return rc == SH_OK ? 0 : -1;
}

void device_free_variants(struct device *device)
{
    while (device->variants != NULL) {
        struct device_variant *v = device->variants;
        device->variants = v->next;
        free_variant(v);
    }
}

const struct site *device_hold_scan(struct device *device, uint32_t number, struct device_held *held)
{
    const struct site *site = NULL;
    *held = (struct device_held){NULL, NULL};
    pthread_mutex_lock(&device->lock);
    struct device_version *now = device->moves.current;
    if (device->scan.number == number) {
        held->variant = device->scan.variant;
        if (held->variant == NULL && device->scan.site == now->site) held->version = now;
    }
    if (held->variant != NULL) {
        atomic_fetch_add(&held->variant->users, 1);
        site = held->variant->site;
    }
    if (held->version != NULL) {
        atomic_fetch_add(&held->version->users, 1);
        site = held->version->site;
    }
    pthread_mutex_unlock(&device->lock);
    return site;
}

void device_let_go(struct device_held *held)
{
    if (held->variant != NULL) atomic_fetch_sub(&held->variant->users, 1);
    device_give_back(held->version);
    *held = (struct device_held){NULL, NULL};
}
