/* SPDX-License-Identifier: MIT */
/* The present site, earlier ones that are in use, and the stations that are moved. */
#ifndef FIRMWARE_SIM_DEVICE_VERSIONS_H
#define FIRMWARE_SIM_DEVICE_VERSIONS_H

#include <stdatomic.h>
#include <stdint.h>

#include "core/err.h"
#include "firmware_sim/command/command.h"
#include "firmware_sim/device/device.h"
#include "firmware_sim/site/site.h"

/* A site that is kept while it is in use: by the device, and by ticks that were claimed while it was the device's. Or a
 * variant (variant.c), kept while a scan or a tick's work uses it. */
struct device_version {
    const struct site *site;
    struct site *own;       /* the site, which is freed with the version; NULL: device_create's caller frees it */
    _Atomic uint32_t users; /* not counting the device */
    struct device_version *next;
    struct device_version *from;   /* the version that a variant is made from, and uses; else NULL */
    struct head_settings settings; /* of a variant */
    uint32_t station;              /* of a variant, from 0 */
};

/* Stations that are moved, one at a time (moves.c). plan, made, ahead and err belong to the thread that plans, without
 * the lock. */
struct device_moves {
    const struct site *first;        /* the site of power-up */
    struct device_version *current;  /* of device->site */
    struct device_version *variants; /* with the device's lock held */
    struct device_version *old;      /* earlier ones that are not freed yet. The thread that plans frees unused ones */
    struct command_place *place, *first_place;
    _Atomic int stops; /* the run ends, and planning with it */
    struct device_move {
        uint32_t station, session;
        int to_first, took_control;
        int stays; /* it stands there already: nothing to plan or report */
        struct site_place to;
        int64_t t_ns; /* of a replayed journal: the time of the move; else -1 */
        char line[COMMAND_MAX_LINE + 1];
    } plan;
    struct device_version *made;  /* NULL: err says why */
    struct device_version *ahead; /* versions that are planned before they are due, in order (device_plan_ahead) */
    struct sh_err err;
};

/* own: is freed with the version; NULL: site is its caller's. Returns NULL without memory. */
struct device_version *device_make_version(const struct site *site, struct site *own);
void device_free_version(struct device_version *version);
void device_free_versions(struct device_version **list);
/* Frees the versions of a list that nobody uses, except one. */
void device_free_unused(struct device_version **at, const struct device_version *kept);
/* Counts one more user, until device_give_back. Returns the version, which may be NULL. */
struct device_version *device_use(struct device_version *version);
void device_set_places(const struct site *site, struct command_place *place);
int device_open_moves(struct device_moves *moves, const struct site *site, struct sh_err *err);
void device_close_moves(struct device_moves *moves);

#endif
