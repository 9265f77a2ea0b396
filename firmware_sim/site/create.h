/* SPDX-License-Identifier: MIT */
/* Makes a site, for one of several purposes: the common part of site_load and its sisters (site.h). */
#ifndef FIRMWARE_SIM_SITE_CREATE_H
#define FIRMWARE_SIM_SITE_CREATE_H

struct config;
struct sh_err;
struct sh_report;
struct site;

enum site_purpose {
    SITE_FOR_SCANS,
    SITE_FOR_PLAN, /* site_load_plan */
    SITE_MOVED,    /* site_load_moved */
    SITE_WRITTEN_OUT,
};
int site_create(const struct config *cfg, enum site_purpose purpose, const struct site *other,
                const struct sh_report *report, struct site **out, struct sh_err *err);

#endif
