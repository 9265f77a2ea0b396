/* SPDX-License-Identifier: MIT */
/* For tests of captures that answer: a capture is made packet by packet, and a client asks its talk. Frames are
 * ethernet.h's, which test_ethernet checks by their offsets. A host of the rig's own takes what is sent. */
#ifndef TESTS_UNIT_TALK_RIG_H
#define TESTS_UNIT_TALK_RIG_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "drivers/protocol/ethernet.h"
#include "drivers/protocol/protocol.h"
#include "firmware_sim/replay/capture.h"

enum { FILE_ROOM = 1 << 18, MS = 1000000 };

extern const struct ethernet_end DRIVER, DEVICE; /* ports 40000 and 2112 */

struct made {
    uint8_t bytes[FILE_ROOM];
    size_t len;
    struct tcp_talk talk;
};

/* An empty file with one Ethernet interface. */
void made_begin(struct made *m);
void made_add(struct made *m, int64_t t_ms, const uint8_t *frame, size_t len);
/* The three packets that begin a connection. */
void made_connect(struct made *m, int64_t t_ms);
/* Adds a segment. side 0 is the driver, 1 the device. */
void made_say(struct made *m, int64_t t_ms, int side, const char *text);
/* Writes the first len bytes, and returns the path. The caller removes the file. */
const char *made_write(const struct made *m, size_t len);
struct replay_capture *made_load(const struct made *m);

struct client {
    struct replay_capture *capture;
    const struct protocol_ops *ops;
    void *protocol;
    char got[4096]; /* "at 5: text|" for each unit */
    int64_t now_ms;
    int wrong, ended;
    uint64_t lost;    /* bytes of it */
    size_t sent[8];   /* the lengths of the first units */
    int n_sent, last; /* last: the last byte of the last unit */
    char told[120];
};

/* Loads the capture, and connects to its place i. options NULL: none. */
void client_open(struct client *c, const struct made *m, uint32_t i, const struct talk_options *options);
/* Sends the text in pieces of a byte, and then lets time pass, a millisecond a tick. Returns what came meanwhile. */
const char *client_ask(struct client *c, const char *text, int ms);
void client_close(struct client *c);

#endif
