/* SPDX-License-Identifier: MIT */
/* Makes a BVH of what stands still, and one of each body that moves. */
#ifndef FIRMWARE_SIM_SITE_BVHS_H
#define FIRMWARE_SIM_SITE_BVHS_H

struct sh_err;
struct sh_report;
struct site;

/* threads: as bvh_create takes them. */
int site_build_bvhs(struct site *site, unsigned threads, const struct sh_report *report, struct sh_err *err);

#endif
