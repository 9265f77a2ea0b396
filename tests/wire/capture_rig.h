/* SPDX-License-Identifier: MIT */
/* Captures of the native protocol made by hand, all in one pcapng: TCP on Ethernet, USB bulk as usbmon has it, and
 * frames in packets of their own (link type 147). */
#ifndef TESTS_WIRE_CAPTURE_RIG_H
#define TESTS_WIRE_CAPTURE_RIG_H

#include <stddef.h>
#include <stdint.h>

enum capture_link { CAPTURE_ETHERNET = 1, CAPTURE_USER0 = 147, CAPTURE_USBMON = 220 };

/* A capture begins as zeros; free() its bytes. */
struct capture {
    uint8_t *bytes;
    size_t len, room;
    uint32_t n_interfaces, n_packets;
};

/* Both directions of one connection to a head. */
struct capture_tcp {
    uint16_t head_port, client_port;
    uint32_t seq[2]; /* to the head, from it */
};

void capture_begin(struct capture *capture);
/* Adds an interface and returns its number. */
uint32_t capture_interface(struct capture *capture, enum capture_link link);
/* Adds one packet with any bytes. */
void capture_packet(struct capture *capture, uint32_t interface, const void *data, size_t len);
/* Adds one segment of at most 1460 bytes. */
void capture_segment(struct capture *capture, uint32_t interface, struct capture_tcp *tcp, int from_head,
                     const void *data, size_t len);
/* Adds one bulk transfer of at most 64 KiB. For an IN endpoint that is its completion, for an OUT endpoint its
 * submission. */
void capture_transfer(struct capture *capture, uint32_t interface, uint8_t device, uint8_t endpoint, const void *data,
                      size_t len);

/* Draws lengths and places at random; *state is any number. */
uint32_t capture_random(uint64_t *state, uint32_t below);

#endif
