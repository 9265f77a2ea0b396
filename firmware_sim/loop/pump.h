/* SPDX-License-Identifier: MIT */
/* A link with its thread: frames and replies out, command lines in, for each of the link's sessions.
 *
 * In: the stream, through the links that the pump belongs to, and what clients write. Out: bytes on the link. */
#ifndef FIRMWARE_SIM_LOOP_PUMP_H
#define FIRMWARE_SIM_LOOP_PUMP_H

#include "firmware_sim/loop/links.h"

/* links must outlive the pump. index: of the link, from 0; session numbers follow from it. */
int pump_open(struct links *links, uint32_t index, const struct link_spec *spec, struct pump **out, struct sh_err *err);
/* To be called before pump_start: checks that a session can be made with the settings that clients have stored.
 * SH_EINPUT: it can't. */
int pump_check_stored(struct pump *pump, struct sh_err *err);
int pump_start(struct pump *pump, struct sh_err *err);
void pump_join(struct pump *pump);
void pump_close(struct pump *pump);
void pump_get_place(const struct pump *pump, struct link_place *place);
/* To be called after pump_join. */
void pump_get_counts(const struct pump *pump, struct link_counts *counts);

#endif
