/* SPDX-License-Identifier: MIT */
/* At pace fast, the head is held back while a client is far behind the stream. */
#ifndef FIRMWARE_SIM_APP_STUDIO_SOAK_HOLD_H
#define FIRMWARE_SIM_APP_STUDIO_SOAK_HOLD_H

struct soak;

/* Waits for a millisecond and returns 1 where the clean reader must not read on, since a client is far behind it. The
 * head waits for the clean reader, and so does the stream. Links without a connection go on with the clean reader. To be
 * called by the clean reader's thread for each frame. */
int soak_hold(struct soak *soak);

#endif
