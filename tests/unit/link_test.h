/* SPDX-License-Identifier: MIT */
/* Shared by the link tests: a link under test, and waits for its events. A wait ends with the event, or fails the test
 * after WAIT_MS, far beyond any sound run. Nothing sleeps. Once one wait has failed so, those of later tests end after
 * a second. A poll that does not return in WAIT_MS ends the program (SIGALRM). */
#ifndef TESTS_UNIT_LINK_TEST_H
#define TESTS_UNIT_LINK_TEST_H

#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "drivers/link/link.h"

enum { DEADLINE_MS = 120000, WAIT_MS = 60000 };

struct bench {
    const struct link_ops *ops;
    void *link;
    int wake;
    struct link_event queue[64];
    int n_queue;
    int n_plugged; /* LINK_PLUGGED so far, which are not in the queue */
};

int64_t now_ms(void);

/* Returns when a wait that begins now is given up, by now_ms. The other function gives it up. */
int64_t give_up_ms(void);
void give_up(const char *what);

struct bench bench_open(const struct link_spec *spec);

void bench_close(struct bench *bench);

int bench_poll(struct bench *bench, uint32_t want_write, int timeout_ms);

/* Takes the first event of the queue. Only levels (READABLE, WRITABLE) before it are passed over. */
struct link_event bench_expect(struct bench *bench, enum link_event_kind kind, uint32_t want_write);

void bench_write_all(struct bench *bench, int session, const void *data, size_t len);

void bench_read_all(struct bench *bench, int session, void *data, size_t len);

/* Reads from the link's other end within the deadline, as read(). */
ssize_t fd_read(int fd, void *data, size_t len);

void fd_read_all(int fd, void *data, size_t len);

/* Writes until the link takes no more and is calm: with a reader that does not read, poll must wait. Between two
 * refusals the kernel may still move bytes to the reader's side, so that there is room again a few times. Returns the
 * bytes written. */
size_t bench_fill(struct bench *bench, int session);

void fd_drain(int fd, size_t len);

char *test_dir(void);

/* Returns the port that the link's endpoint names. */
int bench_port(const struct bench *bench);

/* Opens a client of a port of this machine; -1: it was refused. */
int dial(int port);

/* The next event must be a notice with this text in it. */
void bench_expect_notice(struct bench *bench, const char *part);

/* Opening the link must fail with this code, and with an error of one line that contains `part`. */
void expect_refused(const struct link_spec *spec, int code, const char *part);

/* Sends 2 KiB from the link to its other end, and 2 KiB back. */
void exchange(struct bench *bench, int session, int fd);

#endif
