/* SPDX-License-Identifier: MIT */
/* The tripods under stations' heads. In: the placed stations and their BVHs. Out: each tripod's opening, the directions
 * that it hides, and its legs where they are in view. */
#ifndef FIRMWARE_SIM_SITE_TRIPOD_H
#define FIRMWARE_SIM_SITE_TRIPOD_H

#include <stdint.h>

struct sh_err;
struct sh_report;
struct site;
struct site_tripod;

/* Makes labels for legs, if there are any. After the scene and its movers are loaded. */
int site_name_legs(struct site *site, struct sh_err *err);
/* Warns of tripods that hover, and of those without a ground. */
int site_set_up_tripods(struct site *site, const struct sh_report *report, struct sh_err *err);
/* The tripod of a station (0..) as it would be at another place, without warnings. The site stays as it is. Any thread.
 * SH_EINPUT: the head would be too near the ground. site_free_tripod is due in any case. */
int site_tripod_at(const struct site *site, uint32_t station, const double position_m[3], struct site_tripod *out,
                   struct sh_err *err);
void site_free_tripod(struct site_tripod *tripod);

#endif
