/* SPDX-License-Identifier: MIT */
/* A head on the scripted bus of fake_libusb.h: its stream by script, and opening and closing it with nothing left
 * behind. */
#ifndef TESTS_UNIT_BUS_RIG_H
#define TESTS_UNIT_BUS_RIG_H

#include "tests/unit/fake_libusb.h"

#include "drivers/host/scanhead.h"
#include "drivers/protocol/native_encode.h"

enum { TIMEOUT_MS = 120000 };

size_t make_event(uint8_t *to, size_t room, uint32_t seq);

void script_events(uint32_t from, uint32_t to);

void expect_events(struct scanhead *sh, uint32_t from, uint32_t to);

int rig_begin(void **state);

int rig_end(void **state);

struct scanhead *open_head(const char *source);

void close_head(struct scanhead *sh);

void unplug(void);

#endif
