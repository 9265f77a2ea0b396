/* SPDX-License-Identifier: MIT */
/* Recordings that are written frame by frame, and the smallest one that can be replayed. */
#ifndef TESTS_UNIT_EVENT_RECORDING_H
#define TESTS_UNIT_EVENT_RECORDING_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "drivers/protocol/native.h"

/* Begins a recording, whose frames count from 0. */
FILE *recording_begin(const char *path);
void recording_end(FILE *f);
/* Adds a frame with the next number. It is complete then. */
void recording_put(FILE *f, uint8_t *frame, size_t len);
/* Adds a descriptor at time 0. Its head has a pulse each microsecond. */
void recording_put_head(FILE *f, const char *idn, int flags);
void recording_put_event(FILE *f, enum native_event_code code, int64_t t_ns);

/* Writes a descriptor, and events 1 ms apart from 0 on. */
void event_recording_write(const char *path, int n_events);

#endif
