/* SPDX-License-Identifier: MIT */
/* A link of a soak whose client is the test: a clean stream, a fault at one frame of it, and what the client sees. */
#ifndef TESTS_UNIT_SOAK_RIG_H
#define TESTS_UNIT_SOAK_RIG_H

#include <stdint.h>

#include "drivers/host/scanhead.h"
#include "firmware_sim/app/studio/soak/link.h"
#include "firmware_sim/app/studio/soak/soak.h"
#include "firmware_sim/config/config.h"

/* The stream has these frames, of PAYLOAD bytes beside their header, a tick apart. The fault is at frame HIT. */
enum { FIRST = 1000, N_FRAMES = 200, TICK_NS = 1000000, PAYLOAD = 20, HIT = FIRST + 100 };

/* A link in a session, without a fault. */
struct soak *soak_rig_make(void);
void soak_rig_end(struct soak *soak);

/* The clean reader gets the whole stream. */
void send_clean(struct soak *soak);
/* The client sees a frame. damage: its payload is changed, with a right checksum. */
void see(struct soak *soak, uint32_t seq, uint8_t damage, double late_ms);
/* The client sees all frames from one to another, which is not among them. */
void see_others(struct soak *soak, uint32_t from, uint32_t to);
void notice(struct soak *soak, enum scanhead_notice_kind kind, uint32_t seq, uint64_t n);

struct fault_note note_of(enum fault_kind kind, uint64_t n, double for_ms, const char *text);
/* The client sees all up to HIT, where the fault is. Returns the fault's row. */
struct soak_row *inject(struct soak *soak, enum fault_kind kind, uint64_t n, double for_ms, const char *text);
/* The client sees the rest. Returns how many reasons for a bad verdict there are. */
uint32_t finish(struct soak *soak);

#endif
