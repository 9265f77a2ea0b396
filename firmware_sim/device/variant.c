/* SPDX-License-Identifier: MIT */
/* A variant is the site, planned again after commands have changed ranges, noise or the step of a sphere. The command
 * makes the variant, and is refused where no plan is possible. The next scan uses the variant. When another one is
 * made, or a station moves, each variant is freed that no scan, work or observer needs. */
#include <stdio.h>
#include <stdlib.h>

#include "firmware_sim/device/variant.h"

/* Whether the variant is planned for these settings and the stations' present places. */
static int fits(const struct device_variants *all, const struct device_variant *v, const struct head_settings *settings,
                uint32_t station)
{
    return v->version == all->moves->current && v->station == station && !site_varies(&v->settings, settings);
}

static void free_variant(struct device_variant *v)
{
    site_vary_free(v->site);
    device_give_back(v->version);
    free(v);
}

void device_free_unused_variants(struct device_variants *variants)
{
    for (struct device_variant **at = &variants->list; *at != NULL;) {
        struct device_variant *v = *at;
        if (v == variants->scan->variant || atomic_load(&v->users) != 0) {
            at = &v->next;
            continue;
        }
        *at = v->next;
        free_variant(v);
    }
}

int device_find_variant(struct device_variants *variants, const struct head_settings *settings, uint32_t station,
                        struct device_variant **out, struct sh_err *err)
{
    const struct site *site = variants->moves->current->site;
    *out = NULL;
    if (!site_varies(settings, site_settings(site))) return SH_OK;
    for (struct device_variant *v = variants->list; v != NULL; v = v->next)
        if (fits(variants, v, settings, station)) {
            *out = v;
            return SH_OK;
        }
    device_free_unused_variants(variants);
    struct device_variant *v = calloc(1, sizeof *v);
    if (v == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    int rc = site_vary(site, settings, station, &v->site, err);
    if (rc != SH_OK) {
        free(v);
        return rc;
    }
    v->version = variants->moves->current;
    atomic_fetch_add(&v->version->users, 1);
    v->settings = *settings;
    v->station = station;
    v->next = variants->list;
    *out = variants->list = v;
    return SH_OK;
}

int device_can_plan(void *owner, const struct head_settings *settings, char *why, size_t len)
{
    struct device_variant *variant;
    struct sh_err err;
    int rc = device_find_variant(owner, settings, settings->station - 1, &variant, &err);
    if (rc != SH_OK) snprintf(why, len, "%s", err.text);
    return rc == SH_OK ? 0 : -1;
}

void device_free_variants(struct device_variants *variants)
{
    while (variants->list != NULL) {
        struct device_variant *v = variants->list;
        variants->list = v->next;
        free_variant(v);
    }
}

void device_let_go(struct device_held *held)
{
    if (held->variant != NULL) atomic_fetch_sub(&held->variant->users, 1);
    device_give_back(held->version);
    *held = (struct device_held){NULL, NULL};
}
