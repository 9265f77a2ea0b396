/* One tick's work: casting its pulses and writing its frames into a slot. */
#ifndef FIRMWARE_SIM_LOOP_WORK_H
#define FIRMWARE_SIM_LOOP_WORK_H

#include "firmware_sim/device/device.h"
#include "firmware_sim/loop/ring.h"

struct worker;

/* Working memory of one caster thread. */
int worker_create(const struct site *site, struct worker **out, struct sh_err *err);
void worker_free(struct worker *worker);

/* Bytes that a slot needs for the busiest tick that the profile allows. */
uint32_t worker_slot_bytes(const struct site *site);

/* Fills the slot. Allocates nothing. */
void worker_fill(struct worker *worker, const struct device_work *work, struct ring_slot *slot, uint32_t slot_bytes);

/* Pulses of the tick that would have been cast, and the first of them (UINT64_MAX: none). */
uint64_t worker_count_cast(const struct device_work *work, uint64_t *first);

#endif
