/* SPDX-License-Identifier: MIT */
/* The objects that are scanned (scene.target): the others are left out, or give no echo. */
#ifndef FIRMWARE_SIM_SITE_TARGET_H
#define FIRMWARE_SIM_SITE_TARGET_H

struct sh_err;
struct site;

/* After the meshes are loaded, each with labels of its own. Leaves out objects that are no target, or notes which
 * objects are targets. SH_EINPUT where a pattern fits nothing, or nothing is left. */
int site_select_target(struct site *site, struct sh_err *err);
/* Notes which labels give no echo. After the labels of ghosts are known. */
int site_set_up_silent(struct site *site, struct sh_err *err);

#endif
