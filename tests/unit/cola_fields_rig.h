/* SPDX-License-Identifier: MIT */
/* For tests of monitored fields: turns of a TiM with an object before a wall, and results as they are read. */
#ifndef TESTS_UNIT_COLA_FIELDS_RIG_H
#define TESTS_UNIT_COLA_FIELDS_RIG_H

#include "drivers/protocol/cola_field.h"
#include "tests/unit/cola_rig.h"

enum { FIELDS_BEAMS = 811 };

extern struct protocol_rig_shot fields_shot[FIELDS_BEAMS];
extern double fields_loss_db; /* of the window */

/* All beams see a wall; at 0 they see nothing. */
void fields_wall(double range_m);
/* An object of n beams from `from` on, before a wall at 10 m. */
void fields_object(int from, int n, double range_m);
/* Feeds a turn with these shots. */
void fields_turn(void);
/* Opens the session anew, with fields and inputs of a configuration; NULL: none. */
void fields_open(const struct cola_fields *fields);
/* The result of field k (from 0) in a payload of LFErec: three records of 43 bytes, as a TiM781S has. */
int fields_result(const uint8_t *payload, int k);
/* Reads LFErec, as "012" for the results invalid, free and infringed. */
void fields_expect(const char *results);

#endif
