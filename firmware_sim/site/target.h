/* SPDX-License-Identifier: MIT */
/* The objects that are scanned (scene.target): the others are left out, or give no echo. */
#ifndef FIRMWARE_SIM_SITE_TARGET_H
#define FIRMWARE_SIM_SITE_TARGET_H

struct sh_err;
struct site;

/* The meshes are loaded, each with labels of its own: leaves out what is no target, or notes it. SH_EINPUT where a pattern fits nothing, or nothing is
 * left. */
int site_select_target(struct site *site, struct sh_err *err);
/* Notes which labels give no echo. After the labels of ghosts are known. */
int site_set_up_silent(struct site *site, struct sh_err *err);

#endif
