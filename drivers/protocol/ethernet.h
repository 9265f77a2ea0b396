/* SPDX-License-Identifier: MIT */
/* Makes Ethernet frames around the payload of a datagram or of a piece of a TCP stream. The frames stand for a capture
 * on the wire, where only a socket's bytes are at hand.
 *
 * In: both ends and the payload. Out: bytes of a frame: Ethernet, IPv4 or IPv6, UDP or TCP, with right lengths and
 * checksums. Addresses and ports are true. The rest of the headers is made up:
 *
 *   hardware addresses   zeros where an end is this machine's own (127.0.0.0/8, ::1), as Linux' loopback has them;
 *                        for a multicast group the group's; for 255.255.255.255 ff:ff:ff:ff:ff:ff; else 02:00 and the
 *                        last four bytes of the IP address
 *   time to live         64
 *   fragments            none: a datagram is one frame, whatever its length
 *
 * Pure: no I/O, no clock, no allocation. */
#ifndef DRIVERS_PROTOCOL_ETHERNET_H
#define DRIVERS_PROTOCOL_ETHERNET_H

#include <stddef.h>
#include <stdint.h>

enum {
    ETHERNET_MAX_HEADERS = 14 + 40 + 32, /* IPv6, and TCP with up to 12 bytes of options; here 8 are used */
    ETHERNET_MAX_DATAGRAM = 65535 - 8,   /* the payload of UDP over IPv6; over IPv4 20 less */
    ETHERNET_MAX_FRAME = ETHERNET_MAX_HEADERS + ETHERNET_MAX_DATAGRAM,
    ETHERNET_MAX_SEGMENT = 1440, /* of TCP: fits into frames of 1514 bytes, in IPv6, too */
};

/* One end. */
struct ethernet_end {
    int is_v6;
    uint8_t address[16]; /* IPv4: the first four */
    uint16_t port;
};

/* Both ends are of one family, data_len <= ETHERNET_MAX_DATAGRAM (IPv4: 20 less). Returns the frame's length. */
size_t ethernet_put_udp(uint8_t *to, const struct ethernet_end *from, const struct ethernet_end *dest, const void *data,
                        size_t data_len);

enum { TCP_FIN = 1, TCP_SYN = 2, TCP_RST = 4, TCP_PSH = 8, TCP_ACK = 16 };

/* ---- a connection, as segments with the numbers that each end would send */

struct tcp_talk {               /* The caller sets both ends, and all other members to 0. */
    struct ethernet_end end[2]; /* 0: who connects; 1: who listens */
    uint32_t next[2];           /* sequence number of the next byte of each */
    uint32_t acked[2];          /* sequence number up to which each has acknowledged the other end's bytes */
};

/* Each function writes one frame of the end `side`, and returns its length; 0: none is needed. */

/* The handshake is tcp_put_syn for side 0, then for side 1, then tcp_put_ack for side 0. */
size_t tcp_put_syn(struct tcp_talk *talk, int side, uint8_t *to);
/* 1 <= len <= ETHERNET_MAX_SEGMENT; the frame acknowledges all that came so far. */
size_t tcp_put_data(struct tcp_talk *talk, int side, const void *data, size_t len, uint8_t *to);
/* None where everything is acknowledged. */
size_t tcp_put_ack(struct tcp_talk *talk, int side, uint8_t *to);
size_t tcp_put_fin(struct tcp_talk *talk, int side, uint8_t *to);
size_t tcp_put_reset(struct tcp_talk *talk, int side, uint8_t *to);

#endif
