/* SPDX-License-Identifier: MIT */
/* A connection that `record --raw` has between two ends, and its frames.
 *
 * End 0 asked for the connection: a client that is relayed, or this program itself with its --send. End 1 is the
 * device. Bytes that come from one end are written to the capture, and then sent to the other one. Where end 0 is this
 * program, the device's bytes are only written. */
#ifndef FIRMWARE_SIM_APP_STUDIO_RECORD_RAW_TALK_H
#define FIRMWARE_SIM_APP_STUDIO_RECORD_RAW_TALK_H

#include "firmware_sim/app/studio/record/raw.h"
#include "firmware_sim/app/studio/record/raw_order.h"

enum { TALK_PIECE = 65536 };

struct talk_end {
    struct raw_input input; /* the first member: a pointer to it also points to the struct talk_end */
    struct talk *talk;
    int number;
    int fd;      /* end 0 is this program: -1 */
    int is_over; /* its FIN or RST came */
    int is_deaf; /* what is sent to it fails */
    enum { TALK_BYTES, TALK_END, TALK_RESET } news;
    uint64_t received;
    uint8_t bytes[TALK_PIECE]; /* a piece from this end, until the other end has taken all of it */
    size_t len, sent;          /* of the piece; taken by the other end */
};

struct talk {
    struct raw *r;
    struct tcp_talk segments;
    struct talk_end end[2];
    int is_used, is_over, was_reset;
    int next_send;             /* of r->send */
    int64_t sent_ns, heard_ns; /* monotonic: of the last --send, and of the last bytes from the device */
    char name[80];             /* of end 0, for messages */
};

/* Takes over both descriptors; fd[0] is -1 where end 0 is this program. began_ns: UTC, when the connection was asked
 * for. Writes the handshake. */
int talk_open(struct talk *talk, struct raw *r, const int fd[2], int64_t began_ns, struct sh_err *err);
/* Fills in the descriptors to be polled, up to two, with their events; returns how many. */
int talk_wait_for(const struct talk *talk, struct pollfd *fds, int *timeout_ms);
/* Sends what the ends did not take before. */
int talk_push(struct talk *talk, struct sh_err *err);
/* The recording ends before the connection does: writes frames as if end 0 closed it. */
int talk_finish(struct talk *talk, struct sh_err *err);
void talk_close(struct talk *talk);

#endif
