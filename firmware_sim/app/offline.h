/* A head that runs in this process, for commands that work off line. In: a configuration. Out: a client's
 * handle, as of a head on a wire. Head and client are joined by a socket pair, and the pace is `fast`. */
#ifndef FIRMWARE_SIM_APP_OFFLINE_H
#define FIRMWARE_SIM_APP_OFFLINE_H

#include "core/err.h"
#include "drivers/host/scanhead.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/site/site.h"

struct offline {
    struct scanhead *sh; /* the client's handle */
    struct site *site;
    /* inner state */
    struct device *device;
    struct loop *loop;
};

/* Loads the scene and starts the head. Its own links stay closed. scan_s > 0: it ends each scan after this device
 * time, to the pulse. cfg is changed (pace, links) and must live
 * on. `offline` begins as zeros and is to be closed, also after an error. */
int offline_open(struct config *cfg, double scan_s, const struct sh_report *report, struct offline *offline,
                 struct sh_err *err);
/* Makes ready for a scan from a station, from 1; 0: where the head stands at power-up. While none is on. */
int offline_prepare(struct offline *offline, uint32_t station, const struct sh_report *report, struct sh_err *err);
void offline_close(struct offline *offline);

#endif
