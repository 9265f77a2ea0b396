/* SPDX-License-Identifier: MIT */
/* A capture of a device's traffic in place of a head: what the device answered, and what it sent unasked.
 *
 * In: a file of tcpdump's, Wireshark's or `record --raw` (.pcap, .pcapng). Out: a talk (drivers/protocol/talk.h) for
 * each port of a device in it. With TCP, the device is the end that the connection was made to. If the capture begins
 * later than the connection, the device is the end that sent more bytes. With UDP, the device is the end that sent more
 * datagrams, or, if both sent as many, the end that did not send first. TCP streams are put together as receivers do;
 * missing bytes are counted.
 *
 * One thread; constant once it is open. */
#ifndef FIRMWARE_SIM_REPLAY_CAPTURE_H
#define FIRMWARE_SIM_REPLAY_CAPTURE_H

#include "core/err.h"
#include "drivers/protocol/talk.h"

enum { CAPTURE_MAX_TALKS = 64 };

struct capture_place {
    int is_tcp;
    int port;        /* TCP: that the device listened on; UDP: that its datagrams went to */
    int source_port; /* UDP: the device's */
    char device[64]; /* its address */
    struct talk talk;
    uint32_t n_messages;
};

struct capture_counts {
    uint64_t packets, others; /* all; those that are neither TCP nor UDP */
    uint64_t fragments, damaged;
    uint64_t backward, untimed; /* packets with a time before an earlier packet's; packets without a time */
    uint64_t unknown_links;     /* packets of link types that are not read */
    unsigned unknown_link;      /* the last one of these */
    uint64_t missing_bytes;     /* of TCP streams and of packets that were cut off */
};

struct replay_capture;

/* 1: the file is a capture of packets, not a recording of the native stream. 0: it isn't, or it can't be read. */
int capture_is(const char *path);
/* SH_EINPUT, SH_EIO with the path; SH_ESTOPPED where the report, which may be NULL, ends the work. */
int capture_load(const char *path, const struct sh_report *report, struct replay_capture **out, struct sh_err *err);
void capture_free(struct replay_capture *capture);
uint32_t capture_n(const struct replay_capture *capture);
const struct capture_place *capture_place(const struct replay_capture *capture, uint32_t i);
void capture_get_counts(const struct replay_capture *capture, struct capture_counts *counts);
/* Returns the time from the first packet to the last, without steps back of the capture's clock. */
double capture_duration_s(const struct replay_capture *capture);

#endif
