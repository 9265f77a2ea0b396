/* SPDX-License-Identifier: MIT */
/* Notices of libscanhead are collected here, and a thread plays the head that answers commands. */
#ifndef TESTS_UNIT_NOTICES_RIG_H
#define TESTS_UNIT_NOTICES_RIG_H

#include "tests/unit/host_rig.h"

enum { NOTICES_MAX = 20, NOTICES_EVENT = 156 };

extern struct scanhead_notice noticed[NOTICES_MAX];
extern int n_noticed;
extern struct scanhead_stats noticed_stats; /* as of the last notice */

/* Collects the notices of sh, from none on. */
void listen_to(struct scanhead *sh);
void expect_notice(int i, enum scanhead_notice_kind kind, uint64_t at_byte, uint32_t seq, uint64_t n);
/* Writes an event of NOTICES_EVENT bytes with that number. Returns its length. */
size_t make_event(uint8_t *to, uint32_t seq);
void put_numbered(int fd, uint32_t seq);

/* The head at fd waits for each line, and answers it. */
struct turn {
    const char *line; /* NULL: the last one */
    const void *answer;
    size_t len;
};
struct play {
    int fd, ok;
    struct turn turn[4];
};
#define SAYS(text) (text), sizeof(text) - 1
/* scanhead_command while a thread plays p; reply has room for 64 bytes. */
int command_played(struct scanhead *sh, struct play *p, const char *line, char *reply, int timeout_ms);

#endif
