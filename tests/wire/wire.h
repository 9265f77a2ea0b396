/* SPDX-License-Identifier: MIT */
/* Shared by the wire tests: a folder of their own, the real program started in it, its endpoints, its end.
 *
 * Nothing here sleeps to let something happen. Every wait is on a descriptor (ready line, frame, reply, pidfd).
 * DEADLINE_MS is only when the test gives up, far beyond the time of a busy machine. Events that the head sends at once
 * are waited for by the head's own time (wire_soon), so that their absence shows at once, too. The program dies with
 * the test (PR_SET_PDEATHSIG), also with a failed one: the teardown ends what is left. */
#ifndef TESTS_WIRE_WIRE_H
#define TESTS_WIRE_WIRE_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <netinet/in.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/inotify.h>
#include <sys/pidfd.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "drivers/host/scanhead.h"

enum { DEADLINE_MS = 240000, SOON_MS = 20000, WIRE_MAX_ARGS = 48, WIRE_MAX_CHILDREN = 16 };

struct wire {
    char dir[64];
    pid_t child[WIRE_MAX_CHILDREN]; /* all that was started and not yet seen to end */
    int n_children;
};

/* This is a running head. */
struct head {
    struct wire *wire;
    pid_t pid;
    char ready[2048]; /* its line of JSON */
};

int64_t wire_now_ms(void);

const char *wire_program(void);

/* ---- the folder */

int wire_setup(void **state);

/* Returns the path of a file in the folder; four of them are good at a time. */
const char *wire_path(const struct wire *wire, const char *name);

/* Removes the files in the folder; the only folders that tests make in it are empty. Returns how many there were. */
int wire_empty(const struct wire *wire);

int wire_teardown(void **state);

const char *wire_write(const struct wire *wire, const char *name, const void *data, size_t len);

const char *wire_write_text(const struct wire *wire, const char *name, const char *text);

/* Returns the whole file, NUL-terminated; free() it. */
char *wire_read(const char *path, size_t *len);

/* The same for a file that a head is still writing, as soon as `has` returns 1 for its text. */
char *wire_read_with(const char *path, int (*has)(const char *text, const void *ctx), const void *ctx);

/* ---- processes */

pid_t wire_fork(struct wire *wire);

/* Starts a program with args (ends with NULL). out, err: files in the folder for the two streams. ready_fd: given to it
 * as descriptor 3, or -1. */
pid_t wire_spawn_program(struct wire *wire, const char *program, const char *const *args, const char *out,
                         const char *err, int ready_fd);

/* Starts the head's program. */
pid_t wire_spawn(struct wire *wire, const char *const *args, const char *out, const char *err, int ready_fd);
/* Runs it, and expects the status of wrong usage and an error that has these words. */
void wire_expect_usage(struct wire *wire, const char *const *args, const char *says);

/* Waits for the end. Returns the exit status, or 256 + the signal. */
int wire_wait(struct wire *wire, pid_t pid);

void wire_show(const struct wire *wire, const char *name);

/* Runs a program to its end, with its streams in the files "out" and "err". A status other than this one shows "err",
 * and the test fails. */
void wire_run_program(struct wire *wire, const char *program, const char *const *args, int status);
/* Does the same with the head's program. */
void wire_run(struct wire *wire, const char *const *args, int status);

/* Starts `scanhead run CONFIG ...` and reads its ready line. more: further arguments, ends with NULL, or NULL. */
struct head head_start(struct wire *wire, const char *config, const char *const *more);

/* Returns the endpoint of the first link of a type ("tcp", "pty", "file"), as the ready line names it. */
const char *head_endpoint(const struct head *head, const char *type);

/* Returns the endpoint of link i of the configuration, from 0; good until the next call. */
const char *head_link(const struct head *head, int i);

/* Returns the port at the end of an endpoint. */
int endpoint_port(const char *endpoint);

/* Ends the head with a signal (0: it ends by itself) and checks that it went in good order. */
void head_end(struct head *head, int signal_number);

/* ---- statistics: values of the JSON that --stats wrote. */

uint64_t stats_uint(const struct wire *wire, const char *key);

/* The same for the first link: received_pulses, left_out_pulses, left_out_frames. */
uint64_t stats_link_uint(const struct wire *wire, const char *key);

void stats_hash(const struct wire *wire, char hex[65]);

/* ---- clients */

struct scanhead *client_open(const char *source);

/* Returns the reply, which is good until the next call. */
const char *client_ask(struct scanhead *sh, const char *command);

void client_tell(struct scanhead *sh, const char *command);

void client_next(struct scanhead *sh, struct scanhead_frame *frame);

/* For loops over frames or replies that go on for as long as the head runs. The call fails once the head's time is
 * SOON_MS beyond the first one given (*since_ns, 0 at first). The head's time stands still where the machine does. */
void wire_soon(int64_t *since_ns, int64_t t_ns, const char *what);
/* Asks for the head's time. */
int64_t client_time_ns(struct scanhead *sh);

int is_event(const struct scanhead_frame *frame, uint32_t code);

/* Takes frames until an event of this code, and writes that one. */
void client_until(struct scanhead *sh, uint32_t code, struct scanhead_frame *frame);
/* Does the same for an event that the head sends at once (wire_soon). */
void client_until_soon(struct scanhead *sh, uint32_t code, struct scanhead_frame *frame);

/* Waits for the state by asking. Each answer comes from the head, so this is no busy loop. Frames are taken. */
void client_wait_state(struct scanhead *sh, const char *state);

/* Only Assimp reads IFC, for tests with another subject: the other readers take 3 s of processor time a start. */
#define IFC_BY_ASSIMP "scene.ifc_reader=assimp"

/* Returns a socket of a type, SOCK_STREAM or SOCK_DGRAM, that has a free port of this machine and does not listen. */
int wire_bind(int type, int *port);
/* Opens a plain socket to the "tcp:127.0.0.1:PORT" of the head. */
int raw_connect(const char *endpoint);
/* The same; -1: nobody listens there now. */
int raw_try_connect(const char *endpoint);
/* The same after the head has rebooted: tries until the question is answered; the answer is left to be read. While
 * power is off nobody listens, or the connection ends with it. */
int raw_connect_again(const char *endpoint, const char *question);

void raw_send(int fd, const void *data, size_t len);

struct scanhead *client_from_fd(int fd);

#endif
