/* SPDX-License-Identifier: MIT */
/* A call: a line whose row is found, with its value and its reply. A call is all that the functions of rows are
 * given. */
#ifndef FIRMWARE_SIM_COMMAND_CALL_H
#define FIRMWARE_SIM_COMMAND_CALL_H

#include <stdint.h>

#include "firmware_sim/command/command.h"
#include "firmware_sim/command/decimal.h"

struct command_row;
struct command_unit;

enum command_value_kind {
    COMMAND_VALUE_NUMBER,
    COMMAND_VALUE_WORD,
    COMMAND_VALUE_MIN,
    COMMAND_VALUE_MAX,
    COMMAND_VALUE_DEF
};

struct command_value {
    enum command_value_kind kind;
    struct command_decimal decimal;
    int shift; /* of the suffix */
    uint32_t word;
};

struct command_call {
    struct command_device *dev;
    uint32_t session;
    const struct command_row *row;
    char *param;      /* as written; of TIME:STEP, the part before the pose */
    const char *pose; /* the part of TIME:STEP after the time; NULL: none */
    struct command_value value;
    struct command_result *out;
};

/* Queues the error and makes it the reply. Returns -1. */
int command_fail(struct command_call *call, int number, const char *fmt, ...) __attribute__((format(printf, 3, 4)));

/* Returns 0. */
int command_reply(struct command_call *call, const char *fmt, ...) __attribute__((format(printf, 2, 3)));

/* Sets the effect, and replies OK. Returns 0. */
int command_accept(struct command_call *call, enum command_effect effect);

/* MIN, MAX or DEF; 0 when the parameter is none of them. */
int command_parse_special(const char *param, enum command_value_kind *kind);

#endif
