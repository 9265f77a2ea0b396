/* SPDX-License-Identifier: MIT */
/* One tick's work: casting its pulses and writing its frames.
 *
 * In: what the device says a tick consists of (device_work). Out: the tick in its slot (ring_tick): its frames as
 * bytes, the line ends that are completed at release, and its counts. */
#ifndef FIRMWARE_SIM_LOOP_WORK_H
#define FIRMWARE_SIM_LOOP_WORK_H

#include "firmware_sim/device/device.h"
#include "firmware_sim/loop/ring.h"

struct worker;

/* Working memory of one caster thread. */
int worker_create(const struct site *site, struct worker **out, struct sh_err *err);
void worker_free(struct worker *worker);

/* Bytes of the busiest tick that the profile allows, where each pulse has as many echoes as it can. */
uint32_t worker_tick_bytes(const struct site *site);
/* Bytes of a usual tick at the settings of power-up: the pulses of a tick with one echo each. */
uint32_t worker_usual_bytes(const struct site *site);

/* ---- lines ahead (core/cast.h): for a caster that claims several ticks before it makes the first one */
int worker_add_ahead(struct worker *worker, struct sh_err *err);
/* Returns the pulse up to which to claim ticks, after the first one, `work`. 0: no more ticks. */
uint64_t worker_end_ahead(struct worker *worker, const struct device_work *work);
/* Finds the hits of n consecutive ticks. worker_end_ahead of the first one was not 0. worker_fill then takes these
 * hits, until worker_forget, or until another scan begins. */
void worker_look_ahead(struct worker *worker, const struct device_work *work, uint32_t n);
void worker_forget(struct worker *worker);

/* Makes the tick in a slot, from ring_begin to ring_end. Allocates nothing but room for a tick longer than usual.
 * SH_ENOMEM: there was none; the tick is broken. */
int worker_fill(struct worker *worker, const struct device_work *work, struct ring_slot *slot);

#endif
