/* SPDX-License-Identifier: MIT */
/* For tests of commands: a device, and lines to it. The device's limits are round, so that expected values can be
 * worked out by hand. */
#ifndef TESTS_UNIT_COMMAND_DEVICE_H
#define TESTS_UNIT_COMMAND_DEVICE_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "firmware_sim/command/command.h"

#define MICRO INT64_C(1000000)
#define NANO  INT64_C(1000000000)

#define N_OF(array) (sizeof(array) / sizeof(array)[0])

struct command_device command_test_device(void);

extern struct command_result result; /* of the last line */

/* Gives the reply to a line. */
const char *say(struct command_device *dev, uint32_t session, const char *line);

/* A line of session 1 has this reply. */
void expect(struct command_device *dev, const char *line, const char *reply);

/* The line gives exactly one ERR reply with this number and part, puts the same text into the queue, and changes
 * nothing else. */
void expect_error(struct command_device *dev, uint32_t session, const char *line, int number, const char *part);

#endif
