/* Private to site*.c: a head that moves. */
#ifndef FIRMWARE_SIM_SITE_PLATFORM_H
#define FIRMWARE_SIM_SITE_PLATFORM_H

#include "firmware_sim/site.h"

/* Reads the trajectory, and builds the BVHs that its path needs. */
int site_load_platform(struct site *site, const struct sh_report *report, struct sh_err *err);

#endif
