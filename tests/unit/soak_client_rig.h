/* SPDX-License-Identifier: MIT */
/* The clients of a soak, alone: libscanhead, the ledger, the questions and the packets are the test's. They write each
 * call to `trace`, with the time in ms. Words in capitals stand for a call that is not as it should be. */
#ifndef TESTS_UNIT_SOAK_CLIENT_RIG_H
#define TESTS_UNIT_SOAK_CLIENT_RIG_H

#include <stdint.h>

#include "core/err.h"
#include "drivers/host/scanhead.h"
#include "firmware_sim/app/studio/soak/link.h"
#include "firmware_sim/app/studio/soak/soak.h"
#include "firmware_sim/config/config.h"
#include "tests/unit/trace_rig.h"

#define MS INT64_C(1000000)

extern struct config cfg;
extern struct soak soak;
extern struct soak_link *const at; /* the first link */
extern struct scanhead *const handle;

/* A call of scanhead_open, scanhead_reattach, scanhead_next or soak_datagrams_step takes ms, and gives rc. Then `after`
 * happens, unless it is NULL. type: of the frame. rc 1: the soak is over. */
struct turn {
    int rc, ms, type;
    void (*after)(void);
};
extern const struct turn *turns;
/* As the library counts them. It drops twice as many frames as reader_lost. */
extern uint64_t frames_in_stats, reader_lost;
extern uint64_t top; /* of the packets */

/* For cmocka: a soak without links, at 1000 ms. */
int make_soak(void **state);
/* One more link, at its place. */
void add_place(const char *type, const char *endpoint, const char *protocol);
int open_all(uint32_t only, struct sh_err *err);

#endif
