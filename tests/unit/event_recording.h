/* SPDX-License-Identifier: MIT */
/* The smallest recording that can be replayed: a descriptor, and events 1 ms apart from 0 on. */
#ifndef TESTS_UNIT_EVENT_RECORDING_H
#define TESTS_UNIT_EVENT_RECORDING_H

void event_recording_write(const char *path, int n_events);

#endif
