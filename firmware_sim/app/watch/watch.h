/* SPDX-License-Identifier: MIT */
/* What a head that runs tells a page beside its stream: what it is (/head), the scene, coarse (/scene), the plan (/plan),
 * and how good the scan is while it is on (/quality). README.md has the formats.
 *
 * In: configuration and site. Out: a link for the loop (a client like any other, whose other end the observer reads), and
 * a source for web links. The observer is a thread at the lowest priority that looks at some of the points; a loop never
 * waits for it, unless asked to. Then it has the priority of the loop's threads. Where nobody opens a watch, nothing of
 * this costs anything.
 *
 *     watch_open(cfg, site, &options, &watch, err)      before the loop is made
 *     loop_options.extra = watch_link(watch), loop_options.web = watch_source(watch); loop_create(...)
 *     watch_start(watch, err); loop_start(...)
 *     ...
 *     loop_join(...); watch_join(watch)                 the observer has seen what its link brought; figures stay
 *     loop_free(...); watch_close(watch)                before device and site go
 */
#ifndef FIRMWARE_SIM_APP_WATCH_WATCH_H
#define FIRMWARE_SIM_APP_WATCH_WATCH_H

#include "drivers/link/link.h"
#include "drivers/link/web.h"
#include "firmware_sim/device/device.h"
#include "firmware_sim/site/site.h"

struct watch;

struct watch_options {
    double cpu_share;         /* of one processor, that looking at points may take; 0: no limit, and no low priority */
    int waits;                /* 1: the observer holds back the paces fast and step, and so sees everything */
    struct device *device;    /* whose scans they are; is to be closed after the watch */
    uint32_t scene_triangles; /* of /scene, at most, without what moves */
    const struct sh_report *report;
};
enum { WATCH_SCENE_TRIANGLES = 100000 };
#define WATCH_CPU_SHARE 0.05

/* Builds what the observer needs: index of distances, cells of coverage, the coarse scene. report hears of it, and is
 * warned of what there is no room for. cfg and site outlive the watch. On failure *out is NULL. */
int watch_open(const struct config *cfg, const struct site *site, const struct watch_options *options,
               struct watch **out, struct sh_err *err);
/* For the loop, which takes its descriptor over. */
const struct link_spec *watch_link(struct watch *watch);
/* Its get may be called by any thread from watch_open until watch_close. */
const struct web_source *watch_source(const struct watch *watch);
int watch_start(struct watch *watch, struct sh_err *err);
/* Waits until the observer has read what came, which ends with its link. watch may be NULL, here and below. */
void watch_join(struct watch *watch);
void watch_close(struct watch *watch);

#endif
