/* SPDX-License-Identifier: MIT */
/* The present site and earlier ones: users hold them, and unused ones are freed. Also the stations' present places. */
#include <stdlib.h>

#include "firmware_sim/config/places.h"
#include "firmware_sim/device/versions.h"

struct device_version *device_make_version(const struct site *site, struct site *own)
{
    struct device_version *version = calloc(1, sizeof *version);
    if (version == NULL) return NULL;
    version->site = site;
    version->own = own;
    return version;
}

void device_free_version(struct device_version *version)
{
    if (version == NULL) return;
    if (version->from != NULL)
        site_vary_free(version->own);
    else
        site_free(version->own);
    device_give_back(version->from);
    free(version);
}

void device_free_versions(struct device_version **list)
{
    while (*list != NULL) {
        struct device_version *version = *list;
        *list = version->next;
        device_free_version(version);
    }
}

/* The first site belongs to its owner: only its maps are freed. */
void device_free_unused(struct device_version **at, const struct device_version *kept)
{
    while (*at != NULL) {
        struct device_version *version = *at;
        if (version == kept || atomic_load(&version->users) != 0) {
            at = &version->next;
            continue;
        }
        *at = version->next;
        if (version->own == NULL) site_retire(version->site);
        device_free_version(version);
    }
}

struct device_version *device_use(struct device_version *version)
{
    if (version != NULL) atomic_fetch_add(&version->users, 1);
    return version;
}

void device_done(struct device_work *work)
{
    device_give_back(work->variant);
    device_give_back(work->version);
    work->variant = NULL;
    work->version = NULL;
}

void device_give_back(struct device_version *version)
{
    if (version != NULL) atomic_fetch_sub(&version->users, 1);
}

const struct site *device_site_of(const struct device_version *version)
{
    return version->site;
}

/* ---- places */

static void fill_place(const struct site *site, uint32_t station, struct command_place *out)
{
    struct site_place at;
    site_get_place(site, station, &at);
    *out = (struct command_place){
        {at.position_m[0], at.position_m[1], at.position_m[2], at.heading_deg, at.pitch_deg, at.roll_deg}};
}

void device_set_places(const struct site *site, struct command_place *place)
{
    for (uint32_t i = 0; i < site->n_stations; i++)
        fill_place(site, i, &place[i]);
}

int device_open_moves(struct device_moves *moves, const struct site *site, struct sh_err *err)
{
    moves->first = site;
    moves->current = device_make_version(site, NULL);
    moves->place = calloc(site->n_stations, sizeof *moves->place);
    moves->first_place = calloc(site->n_stations, sizeof *moves->first_place);
    if (moves->current == NULL || moves->place == NULL || moves->first_place == NULL)
        return sh_fail(err, SH_ENOMEM, "no memory for the stations' places");
    device_set_places(site, moves->place);
    device_set_places(site, moves->first_place);
    return SH_OK;
}

void device_close_moves(struct device_moves *moves)
{
    device_free_versions(&moves->variants);
    device_free_versions(&moves->old);
    device_free_versions(&moves->ahead);
    device_free_version(moves->made);
    device_free_version(moves->current);
    free(moves->place);
    free(moves->first_place);
}
