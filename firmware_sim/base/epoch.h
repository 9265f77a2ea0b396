/* The text of time.epoch: what time of day it is at power-up, or where the head gets it from. */
#ifndef FIRMWARE_SIM_BASE_EPOCH_H
#define FIRMWARE_SIM_BASE_EPOCH_H

#include "core/utc.h"

/* NONE: the head doesn't know the time. UTC, TAI: from the system's clock. */
enum epoch_source { EPOCH_NONE, EPOCH_DATE, EPOCH_UTC, EPOCH_TAI };

/* none, utc, tai, or a date as 2026-01-01T00:00:00Z, which is checked; an empty text is none. tai0_ns, which may be
 * NULL, is set for EPOCH_DATE. */
int epoch_parse(const char *epoch, const struct utc_table *table, enum epoch_source *source, int64_t *tai0_ns,
                struct sh_err *err);

#endif
