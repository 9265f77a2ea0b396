/* SPDX-License-Identifier: MIT */
/* A talk: what a device answered to each request, and what it sent unasked, as a capture has it. The protocol `capture`
 * (talk.c) says the same again to a client.
 *
 * A run is what followed one request: the answer, and the stream that the request began. All that belongs to no
 * request is the run of the connection. Times of messages count from their request, or from the connection's beginning.
 *
 * A talk is constant once firmware_sim/replay/capture_talk.c has built it. Pure. */
#ifndef DRIVERS_PROTOCOL_TALK_H
#define DRIVERS_PROTOCOL_TALK_H

#include <stddef.h>
#include <stdint.h>

enum {
    TALK_MAX_MESSAGE = 65000, /* longer ones are sent in parts */
    TALK_MAX_REQUEST = 65536,
    TALK_NO_RUN = -1,
};
#define TALK_NO_LOOP UINT32_MAX

struct talk_message {
    size_t at; /* in talk.bytes */
    uint32_t len;
    int64_t after_ns;
};

struct talk_run {
    uint32_t first, n;  /* messages */
    uint32_t loop_from; /* index of the message from which on the run may be repeated; TALK_NO_LOOP: it may not */
};

struct talk_request {
    size_t at;
    uint32_t len;
    uint32_t first_run, n_runs; /* one for each time that it came */
};

struct talk {
    const struct talk_kind *kind;
    int is_datagrams; /* each input of a client is one request, whatever its bytes */
    const uint8_t *bytes;
    const struct talk_message *message;
    const struct talk_run *run;
    const struct talk_request *request; /* no two have the same bytes */
    uint32_t n_requests;
    int connection_run; /* TALK_NO_RUN: there is none */
};

/* The device does this with a request that the capture does not have. */
enum talk_unknown { TALK_SILENCE, TALK_ERROR, TALK_CLOSE };

struct talk_options {
    enum talk_unknown unknown;
    int loop; /* streams of recognised protocols, and the run of the connection, begin again at their end */
};

/* How messages of a protocol are told apart. Bytes are those of one direction, len >= 1. */
struct talk_kind {
    const char *name;
    /* Length of the first message of a client; 0: it is not whole yet. NULL: the bytes of each packet in the
     * capture are a message. */
    size_t (*request_len)(const uint8_t *bytes, size_t len);
    size_t (*answer_len)(const uint8_t *bytes, size_t len);
    /* Whether a message answers a request, or belongs to the stream that a request began. NULL: the device speaks in
     * turns, and all that it says after a request belongs to that one. */
    int (*answers)(const uint8_t *request, size_t request_len, const uint8_t *message, size_t len);
    int (*streams)(const uint8_t *request, size_t request_len, const uint8_t *message, size_t len);
    /* Whether a request ends the stream that another one began. NULL: each one does. */
    int (*stops)(const uint8_t *request, size_t len, const uint8_t *began, size_t began_len);
    /* Writes the device's error into 64 bytes, and returns its length. NULL: the protocol has none. */
    size_t (*error)(const uint8_t *request, size_t len, uint8_t *to);
    int n_words; /* how many words at a request's beginning name its kind; 0: it has no words */
};

/* A protocol that is not known, so that its messages can't be told apart. */
extern const struct talk_kind talk_bytes;

/* The kind of a connection, by the first bytes that a client sent in it. */
const struct talk_kind *talk_kind_of(const uint8_t *bytes, size_t len);
/* Writes the kind of a request as text: "sRN LMPscancfg", "MD". */
enum { TALK_NAME_LEN = 40 };
void talk_name(const struct talk_kind *kind, const uint8_t *request, size_t len, char name[TALK_NAME_LEN]);

#endif
