/* SPDX-License-Identifier: MIT */
/* A head that runs in this process, for commands that work off line. In: a configuration. Out: a client's handle, as of
 * a head on a wire. The pace is `fast`. Head and client are joined in memory (drivers/link/memory.h): the head's link
 * works while the client waits for frames, in the client's thread. So one thread uses the handle, and makes all calls
 * below. */
#ifndef FIRMWARE_SIM_APP_STUDIO_RECORD_OFFLINE_H
#define FIRMWARE_SIM_APP_STUDIO_RECORD_OFFLINE_H

#include "core/err.h"
#include "drivers/host/scanhead.h"
#include "firmware_sim/site/site.h"

struct link_memory;
struct link_spec;
struct config;

struct offline {
    const char *truth;   /* the caller's: file for the faults that are injected; NULL: none */
    struct scanhead *sh; /* the client's handle */
    struct site *site;   /* the caller's, loaded by offline_load, which stays; NULL: offline_open loads one */
    /* inner state */
    struct link_memory *memory; /* between head and client */
    struct device *device;
    struct loop *loop;
    int shares_site; /* it is the caller's */
};

/* Loads the scene and starts the head. The head's own links stay closed. scan_s > 0: the head ends each scan after this
 * device time, to the pulse. `offline` begins as zeros but for truth and site, and is to be closed, also after an
 * error. cfg, beside: for offline_load, where there is no site. */
int offline_open(struct config *cfg, const struct site *beside, double scan_s, const struct sh_report *report,
                 struct offline *offline, struct sh_err *err);
/* Loads a site for heads that are powered up one after the other. cfg is changed (pace, links) and must live on.
 * beside: a site to share a scene with, as for site_load_for, where cfg is another scanner of its configuration; NULL:
 * none. */
int offline_load(struct config *cfg, const struct site *beside, const struct sh_report *report, struct site **site,
                 struct sh_err *err);
/* Ends the head, and frees its threads and its site. The caller's site stays. The client's handle
 * keeps what it knows. */
void offline_stop(struct offline *offline);
/* Ends the head, and completes the file `truth`. Returns the first error in writing it. Site and handle stay. */
int offline_finish(struct offline *offline, struct sh_err *err);
void offline_close(struct offline *offline);

/* Joins a client that has a thread of its own to a head in this process. link becomes the head's end of a socket pair,
 * and has to be one of the head's links. Returns the client's descriptor, which belongs to the handle; or an error, and
 * link->fd is -1. who: for errors, and the link's endpoint. */
int offline_connect(const char *who, struct link_spec *link, struct scanhead **sh, struct sh_err *err);

#endif
