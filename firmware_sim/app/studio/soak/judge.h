/* SPDX-License-Identifier: MIT */
/* Compares injected faults with what the client saw, frame by frame. */
#ifndef FIRMWARE_SIM_APP_STUDIO_SOAK_JUDGE_H
#define FIRMWARE_SIM_APP_STUDIO_SOAK_JUDGE_H

struct soak_link;

/* Judges the frames about which no more news will come. With `all` those up to the end, too. The caller has the link's
 * lock. */
void soak_judge(struct soak_link *link, int all);

#endif
