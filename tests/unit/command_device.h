/* SPDX-License-Identifier: MIT */
/* The device of the command tests. Its limits are round, so that expected values can be worked out by hand. */
#ifndef TESTS_UNIT_COMMAND_DEVICE_H
#define TESTS_UNIT_COMMAND_DEVICE_H

#include "firmware_sim/command/command.h"

#define MICRO INT64_C(1000000)
#define NANO  INT64_C(1000000000)

struct command_device command_test_device(void);

#endif
