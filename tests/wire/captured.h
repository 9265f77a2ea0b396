/* SPDX-License-Identifier: MIT */
/* The recorder of `record --raw`, started and ended. The captures are read back into packets, and tshark checks
 * them. */
#ifndef TESTS_WIRE_CAPTURED_H
#define TESTS_WIRE_CAPTURED_H

#include "tests/wire/wire.h"

struct raw_recorder {
    struct wire *wire;
    pid_t pid;
    char endpoint[128];
};

/* Starts `scanhead record SOURCE --raw -o DIR/cap.pcapng --stats DIR/stats.json ...`; more ends with NULL. The call
 * waits until the recorder listens, or is connected. */
struct raw_recorder raw_recorder_start(struct wire *wire, const char *source, const char *const *more);
/* The same, with the size of its files limited (ulimit -f, blocks of 512 bytes). */
struct raw_recorder raw_recorder_start_limited(struct wire *wire, const char *source, const char *blocks);
/* Ends the recorder with a signal (0: it ends by itself). The recorder's exit status must be `status`, and its messages
 * must have `says` (NULL: any). */
void raw_recorder_end(struct raw_recorder *recorder, int signal_number, int status, const char *says);

/* Stops the recorder until raw_recorder_go_on. The latter returns a time of UTC at which the recorder was still
 * stopped. */
void raw_recorder_stop(const struct raw_recorder *recorder);
int64_t raw_recorder_go_on(const struct raw_recorder *recorder);

struct captured_packet {
    int64_t t_ns;
    int is_udp;
    uint32_t from, to; /* IPv4 */
    uint16_t from_port, to_port;
    uint32_t seq, ack, flags; /* TCP */
    const uint8_t *data;
    size_t len;
};

struct captured {
    char *bytes;
    struct captured_packet *packet;
    uint32_t n;
};

/* Reads DIR/cap.pcapng. Each packet must be in it whole, and be UDP or TCP over IPv4. */
void captured_read(const struct wire *wire, struct captured *captured);
void captured_free(struct captured *captured);
/* Returns the payloads of the packets from a port, one after the other; free() it. */
uint8_t *captured_stream(const struct captured *captured, uint16_t from_port, size_t *len);
/* The times rise in the order of the file. */
void captured_check_order(const struct captured *captured);
/* A TCP connection of two ports begins and ends, and all sequence numbers fit. With `resets` an RST ends it. */
void captured_check_talk(const struct captured *captured, uint16_t client_port, uint16_t server_port, int resets);
/* tshark, where it is installed, finds no wrong checksum or length, and has no remark about TCP. Returns 0 where it is
 * not installed. */
int captured_check_tshark(const struct wire *wire);

#endif
