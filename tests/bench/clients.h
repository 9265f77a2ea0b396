/* SPDX-License-Identifier: MIT */
/* Clients of a head that is measured: processes that read its pty and tcp links, and do nothing with the bytes. The
 * clients' processor time is not the head's. */
#ifndef TESTS_BENCH_CLIENTS_H
#define TESTS_BENCH_CLIENTS_H

#include <sys/types.h>

enum { BENCH_MAX_CLIENTS = 8 };

struct bench_clients {
    pid_t pid[BENCH_MAX_CLIENTS];
    int n;
};

/* Waits until the head says on ready_fd (--ready-fd) that its links are open, and closes ready_fd. reads: 1: begins a
 * client for each pty and tcp link; 0: none. */
void bench_clients_begin(struct bench_clients *clients, int ready_fd, int reads);
/* Waits for the clients, which end with their links. */
void bench_clients_end(const struct bench_clients *clients);

#endif
