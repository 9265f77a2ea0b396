/* SPDX-License-Identifier: MIT */
/* By these functions a page gets more of a running head than the stream. Behind them is a watch: an observer that
 * reads the stream. `run` only opens, starts and closes the watch. The program scanhead has a watch
 * (firmware_sim/app/studio/watch); scanheadd has none, and its page shows the stream alone.
 *
 *     open(cfg, site, &options, &watch, err)            before the loop is made
 *     loop_options.extra = link(watch), loop_options.web = source(watch)
 *     start(watch, err)
 *     loop_create(...); loop_start(...)
 *     ...
 *     loop_free(...); close(watch)                      before device and site are freed */
#ifndef FIRMWARE_SIM_APP_RUN_PAGE_H
#define FIRMWARE_SIM_APP_RUN_PAGE_H

#include "drivers/link/link.h"
#include "drivers/link/web.h"
#include "firmware_sim/device/device.h"
#include "firmware_sim/site/site.h"

struct watch;

struct watch_options {
    double cpu_share;         /* of a processor, for looking at points; 0: no limit, and no low priority */
    int waits;                /* 1: the observer holds back the paces fast and step, and so sees everything */
    struct device *device;    /* the head whose scans are observed; to be closed after the watch */
    uint32_t scene_triangles; /* the most in the page's /scene, without bodies that move */
    const struct sh_report *report;
};
enum { WATCH_SCENE_TRIANGLES = 100000 };
#define WATCH_CPU_SHARE 0.05

struct run_page {
    /* Builds what the observer needs: room for points, cells of coverage, the coarse scene. report gets the
     * progress, and a warning where there is no room for a part. cfg and site outlive the watch. On failure *out is
     * NULL. */
    int (*open)(const struct config *cfg, const struct site *site, const struct watch_options *options,
                struct watch **out, struct sh_err *err);
    /* Gives the link whose other end the watch reads. The link's descriptor is the loop's from then on. */
    const struct link_spec *(*link)(struct watch *watch);
    /* The source's get may be called by any thread from open until close. */
    const struct web_source *(*source)(const struct watch *watch);
    int (*start)(struct watch *watch, struct sh_err *err);
    void (*close)(struct watch *watch);
};

/* Call it before the command runs; page outlives it. */
void run_take_page(const struct run_page *page);

#endif
