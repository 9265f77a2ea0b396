/* Private to this folder: a head that moves while it scans. In: the configured trajectory.
 * Out: its poses (scene frame, metres), and the BVHs that its path needs. */
#ifndef FIRMWARE_SIM_SITE_PLATFORM_H
#define FIRMWARE_SIM_SITE_PLATFORM_H

#include "firmware_sim/site/site.h"

/* The part of the trajectory that the configuration names, in its own times. */
struct site_part {
    struct trajectory *trajectory; /* to be freed by who opened it */
    double start_s, end_s;
};
int site_open_trajectory(const struct site *site, struct site_part *part, struct sh_err *err);

/* The head on the platform. */
void site_get_mount(const struct config_platform *platform, struct pose *mount);

/* Reads the trajectory, and builds the BVHs that its path needs. */
int site_load_platform(struct site *site, const struct sh_report *report, struct sh_err *err);

#endif
