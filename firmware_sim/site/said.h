/* SPDX-License-Identifier: MIT */
/* Keeps the warnings that are given while a site is loaded, so that a site beside this one only gives new ones. */
#ifndef FIRMWARE_SIM_SITE_SAID_H
#define FIRMWARE_SIM_SITE_SAID_H

#include "core/err.h"

struct site_said;

struct site_listener {
    struct sh_report report; /* pass this one to the steps of loading */
    const struct sh_report *to;
    struct site_said *said;
    const struct site_said *before;
};
/* Warnings go into `said`, and to `to` unless they are in `before` (NULL: it has none). */
void site_listen(struct site_listener *listener, const struct sh_report *to, struct site_said *said,
                 const struct site_said *before);
void site_free_said(struct site_said *said);

#endif
