/* SPDX-License-Identifier: MIT */
/* Private to capture*.c: the packets of a capture on their way to talks. */
#ifndef FIRMWARE_SIM_REPLAY_CAPTURE_INSIDE_H
#define FIRMWARE_SIM_REPLAY_CAPTURE_INSIDE_H

#include "drivers/protocol/ip_packet.h"
#include "firmware_sim/replay/capture.h"

/* The payload of a packet, or a mark of a connection without one. */
struct capture_segment {
    int64_t t_ns;
    const uint8_t *data; /* in the file's bytes */
    uint32_t len, seq;
    uint32_t missing;    /* TCP: bytes that were cut off its end */
    uint8_t flags, side; /* side: of the flow, 0 or 1 */
};

/* All packets between two ends: a TCP connection, or the datagrams of two UDP ports. */
struct capture_flow {
    int is_tcp;
    struct ethernet_end end[2]; /* 0: the end that sent the first packet */
    int device, has_begin;      /* side of the device, known from a SYN */
    uint64_t n_sent[2], bytes_sent[2];
    struct capture_segment *segment; /* in the order of the file */
    size_t n, room;
    int is_closed; /* TCP: a new SYN begins another connection */
    int64_t t0_ns;
};

/* A message of a device or of its client. */
struct capture_said {
    size_t at; /* in bytes of the builder */
    uint32_t len, side;
    int64_t begin_ns, end_ns; /* of its first and its last byte */
    size_t number; /* of the segment in the flow that has the message's last byte: then the receiver had all of it */
};

struct replay_capture {
    const struct sh_report *report; /* while it is read */
    uint8_t *file;
    size_t file_len;
    struct capture_flow *flow;
    size_t n_flows, flow_room;
    struct capture_counts counts;
    int64_t now_ns;   /* of the last packet that was read, since the first one */
    int64_t clock_ns; /* the time in the file that now_ns stands for */
    int has_clock;
    uint32_t n_places; /* a place: a port of a device, with the talk that was captured there */
    struct capture_place place[CAPTURE_MAX_TALKS];
    struct capture_store { /* what the talk of a place points to */
        uint8_t *bytes;
        struct talk_message *message;
        struct talk_run *run;
        struct talk_request *request;
        size_t n_bytes, byte_room, n_messages, message_room, n_runs, run_room, n_requests, request_room;
    } store[CAPTURE_MAX_TALKS];
};

/* capture_read.c: the packets of the file, as flows. */
int capture_read_flows(struct replay_capture *capture, const char *path, struct sh_err *err);

/* capture_stream.c: adds the messages of one side of a flow to the list, and their bytes to the store. The kind says
 * where a message ends. SH_OK or SH_ENOMEM. */
struct capture_list {
    struct capture_said *said;
    size_t n, room;
};
int capture_add_messages(struct replay_capture *capture, const struct capture_flow *flow, uint32_t side,
                         const struct talk_kind *kind, struct capture_store *store, struct capture_list *list);
/* Copies the first bytes that a side sent, at most room. Returns how many. */
size_t capture_first_bytes(const struct capture_flow *flow, uint32_t side, uint8_t *to, size_t room);

/* capture.c: frees what a place has. */
void capture_forget(struct replay_capture *capture, uint32_t place);

/* capture_talk.c: makes the talks of all places. */
int capture_build(struct replay_capture *capture, struct sh_err *err);

#endif
