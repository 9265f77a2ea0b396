/* SPDX-License-Identifier: MIT */
/* Finds the TCP or UDP payload in a captured packet. ethernet.h does the reverse: it makes such packets.
 *
 * In: a packet and its link type. Out: both ends, and where the payload lies in it. Ethernet with VLAN tags, raw IP,
 * the loopback of BSD, and Linux's "cooked" captures (SLL, SLL2); IPv4 and IPv6. Checksums are not looked at: captures
 * on the sending machine often have none. Pure. */
#ifndef DRIVERS_PROTOCOL_IP_PACKET_H
#define DRIVERS_PROTOCOL_IP_PACKET_H

#include "drivers/protocol/ethernet.h"

struct ip_packet {
    int is_tcp; /* else UDP */
    struct ethernet_end from, to;
    const uint8_t *data; /* the payload */
    uint32_t len;
    uint32_t missing; /* bytes of the payload that the capture has cut off */
    /* TCP */
    uint32_t seq;
    unsigned flags; /* TCP_FIN ... */
};

enum ip_packet_found {
    IP_PACKET_FOUND,
    IP_PACKET_OTHER,    /* not TCP or UDP */
    IP_PACKET_FRAGMENT, /* part of a datagram, which is not put together here */
    IP_PACKET_DAMAGED,  /* headers that are cut off, or impossible lengths */
    IP_PACKET_LINK,     /* a link type that is not known here */
};

enum ip_packet_found ip_packet_read(uint16_t link, const uint8_t *data, size_t len, struct ip_packet *out);

#endif
