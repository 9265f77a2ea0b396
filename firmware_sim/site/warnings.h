/* SPDX-License-Identifier: MIT */
/* Keeps the warnings that are given while a site is loaded, so that a site beside this one only gives new ones. */
#ifndef FIRMWARE_SIM_SITE_WARNINGS_H
#define FIRMWARE_SIM_SITE_WARNINGS_H

#include "core/err.h"

struct site_warnings;

struct site_listener {
    struct sh_report report; /* pass this one to the steps of loading */
    const struct sh_report *to;
    struct site_warnings *given;
    const struct site_warnings *before;
};
/* Warnings go into `given`, and to `to` unless they are in `before` (NULL: it has none). */
void site_listen(struct site_listener *listener, const struct sh_report *to, struct site_warnings *given,
                 const struct site_warnings *before);
void site_free_warnings(struct site_warnings *given);

#endif
