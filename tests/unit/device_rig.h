/* SPDX-License-Identifier: MIT */
/* A device without threads: a small scene, a configuration made for the test, and ticks that are claimed and filled one
 * by one. */
#ifndef TESTS_UNIT_DEVICE_RIG_H
#define TESTS_UNIT_DEVICE_RIG_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "drivers/protocol/native.h"
#include "firmware_sim/device/device.h"
#include "firmware_sim/loop/ring.h"
#include "firmware_sim/loop/work.h"

extern char folder[64];
extern char journal_path[96];

/* Writes N boxes without a lid, the first around the station, as objects of their own. */
int write_scene(uint32_t n_objects);

int write_profile(void);

int make_folder(void **state);

int remove_folder(void **state);

struct rig {
    struct config *cfg;
    struct site *site;
    struct device *device;
    struct worker *worker;
    struct ring_slot slot;   /* of the last tick made */
    uint64_t next;           /* tick to be claimed */
    struct device_work work; /* the last one claimed */
    int over;
};

void need(int rc, const struct sh_err *err);

struct rig *rig_open(const struct device_options *options, const char *const *sets, int n_sets);

/* The configuration is another file in the folder. */
struct rig *rig_open_file(const char *name, const struct device_options *options, const char *const *sets, int n_sets);

void rig_close(struct rig *rig);

/* Claims the next tick. Returns 0 where there is none. */
int rig_claim(struct rig *rig);

/* Claims until `tick` is the next. */
void rig_go_to(struct rig *rig, uint64_t tick);

/* Makes the last claimed tick; it is good until the next call. */
const struct ring_tick *rig_fill(struct rig *rig);

/* Gives a command that must be accepted, as of `released`. The reply is good until the next call. */
const char *rig_tell(struct rig *rig, const char *line, uint64_t released);

const char *rig_state(struct rig *rig, uint64_t released);

/* Returns the event with this code in the last tick, or NULL. */
const struct native_event *rig_event(const struct rig *rig, enum native_event_code code);

/* Claims until the last tick holds the event; at most `most` ticks. */
const struct native_event *rig_wait(struct rig *rig, enum native_event_code code, uint64_t most);

#endif
