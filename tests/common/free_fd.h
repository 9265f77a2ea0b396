/* SPDX-License-Identifier: MIT */
/* For tests: whether a file was left open. */
#ifndef TESTS_COMMON_FREE_FD_H
#define TESTS_COMMON_FREE_FD_H

/* Returns the lowest descriptor that is free. It is the same after a call that leaves no descriptor open, and closes
 * only its own. */
int free_fd(void);

/* Names a file on standard error that was left open since free_fd returned `before`, and returns -1. Returns 0 where
 * there is none. For teardowns of groups. PROJ keeps its database open, which does not count. */
int free_fd_check(int before);

#endif
