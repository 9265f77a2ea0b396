/* SPDX-License-Identifier: MIT */
/* For tests of the pty link: its clients, in this process and in children. */
#ifndef TESTS_UNIT_PTY_RIG_H
#define TESTS_UNIT_PTY_RIG_H

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/wait.h>

#include "tests/unit/link_test.h"

/* Starts a child that ends with this program, also when the test fails. */
pid_t fork_child(void);

extern const struct link_spec plain;

const char *pty_path(const struct bench *bench);

int client_open(const struct bench *bench);

/* Returns how many descriptors this process has open. */
int count_open(void);

/* Returns 1 when nothing happens for a while: no state keeps poll awake. */
int is_calm(struct bench *bench, uint32_t want_write);

/* Reads until the session ends and returns how many bytes came. */
size_t read_to_end(struct bench *bench);

#endif
