/* A head that runs in this process, for commands that work off line. In: a configuration. Out: a client's
 * handle, as of a head on a wire. Head and client are joined by a socket pair, and the pace is `fast`. */
#ifndef FIRMWARE_SIM_APP_OFFLINE_H
#define FIRMWARE_SIM_APP_OFFLINE_H

#include "core/err.h"
#include "drivers/host/scanhead.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/site/site.h"

struct offline;

/* Loads the scene and starts the head. Its own links stay closed. cfg is changed (pace, links) and must live
 * on. */
int offline_open(struct config *cfg, const struct sh_report *report, struct offline **out, struct sh_err *err);
/* Both belong to `offline`. */
struct scanhead *offline_scanhead(struct offline *offline);
const struct site *offline_site(const struct offline *offline);
/* Takes NULL, too. */
void offline_close(struct offline *offline);

#endif
