/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/ip_packet.h"

#include <linux/if_ether.h>
#include <netinet/in.h>
#include <string.h>

#include "core/bytes.h"

/* Link types, from https://www.tcpdump.org/linktypes.html, and the bytes before the IP packet. */
static const struct {
    uint16_t link;
    uint8_t skip;
} links[] = {
    {0, 4},    {108, 4},                      /* loopback of BSD, and of OpenBSD */
    {12, 0},   {101, 0},  {228, 0}, {229, 0}, /* raw IP: of BSD, any, IPv4, IPv6 */
    {113, 16}, {276, 20},                     /* Linux' SLL, SLL2 */
};
enum { LINK_ETHERNET = 1 };
enum { IPV4_LEN = 20, IPV6_LEN = 40, UDP_LEN = 8, TCP_LEN = 20 };

struct rest {
    const uint8_t *p;
    size_t len;     /* bytes that the capture has */
    size_t claimed; /* bytes that the packet has, by its headers */
};

/* Bytes before the IP packet; -1: no IP. */
static int skip_ethernet(const uint8_t *data, size_t len)
{
    size_t at = 12;
    while (len >= at + 4 && (be_get16(data + at) == ETH_P_8021Q || be_get16(data + at) == ETH_P_8021AD))
        at += 4;
    if (len < at + 2) return -1;
    const uint16_t type = be_get16(data + at);
    return type == ETH_P_IP || type == ETH_P_IPV6 ? (int)at + 2 : -1;
}

/* Bytes before the IP packet; -1: it has none; -2: another link type. */
static int skip_link(uint16_t link, const uint8_t *data, size_t len)
{
    if (link == LINK_ETHERNET) return skip_ethernet(data, len);
    for (size_t i = 0; i < sizeof links / sizeof links[0]; i++)
        if (links[i].link == link) return links[i].skip;
    return -2;
}

static enum ip_packet_found read_ipv4(struct rest *r, struct ip_packet *out, unsigned *protocol)
{
    if (r->len < IPV4_LEN) return IP_PACKET_DAMAGED;
    const size_t head = 4 * (size_t)(r->p[0] & 15);
    size_t total = be_get16(r->p + 2);
    /* The length is 0 in a packet that was captured before the network card cut it into segments. */
    if (total == 0) total = r->len;
    if (head < IPV4_LEN || total < head || r->len < head) return IP_PACKET_DAMAGED;
    if ((be_get16(r->p + 6) & 0x3fff) != 0) return IP_PACKET_FRAGMENT;
    *protocol = r->p[9];
    memcpy(out->from.address, r->p + 12, 4);
    memcpy(out->to.address, r->p + 16, 4);
    r->p += head;
    r->len -= head;
    r->claimed = total - head;
    return IP_PACKET_FOUND;
}

static enum ip_packet_found read_ipv6(struct rest *r, struct ip_packet *out, unsigned *protocol)
{
    if (r->len < IPV6_LEN) return IP_PACKET_DAMAGED;
    r->claimed = be_get16(r->p + 4);
    if (r->claimed == 0) r->claimed = r->len - IPV6_LEN;
    *protocol = r->p[6];
    out->from.is_v6 = out->to.is_v6 = 1;
    memcpy(out->from.address, r->p + 8, 16);
    memcpy(out->to.address, r->p + 24, 16);
    r->p += IPV6_LEN;
    r->len -= IPV6_LEN;
    while (*protocol == IPPROTO_HOPOPTS || *protocol == IPPROTO_DSTOPTS) {
        const size_t head = r->len >= 8 ? 8 * ((size_t)r->p[1] + 1) : SIZE_MAX;
        if (head > r->len || head > r->claimed) return IP_PACKET_DAMAGED;
        *protocol = r->p[0];
        r->p += head;
        r->len -= head;
        r->claimed -= head;
    }
    return *protocol == IPPROTO_FRAGMENT ? IP_PACKET_FRAGMENT : IP_PACKET_FOUND;
}

static enum ip_packet_found read_transport(const struct rest *r, struct ip_packet *out)
{
    size_t head = UDP_LEN, claimed = r->claimed;
    if (r->len < (out->is_tcp ? (size_t)TCP_LEN : (size_t)UDP_LEN)) return IP_PACKET_DAMAGED;
    out->from.port = be_get16(r->p);
    out->to.port = be_get16(r->p + 2);
    if (out->is_tcp) {
        head = 4 * (size_t)(r->p[12] >> 4);
        out->seq = be_get32(r->p + 4);
        out->flags = r->p[13];
        if (head < TCP_LEN) return IP_PACKET_DAMAGED;
    } else {
        const size_t said = be_get16(r->p + 4);
        if (said != 0 && said < claimed) claimed = said; /* a jumbogram says 0 */
    }
    if (head > claimed || head > r->len) return IP_PACKET_DAMAGED;
    const size_t have = (r->len < claimed ? r->len : claimed) - head;
    out->data = r->p + head;
    out->len = (uint32_t)have;
    out->missing = (uint32_t)(claimed - head - have);
    return IP_PACKET_FOUND;
}

enum ip_packet_found ip_packet_read(uint16_t link, const uint8_t *data, size_t len, struct ip_packet *out)
{
    unsigned protocol = 0;
    memset(out, 0, sizeof *out);
    const int skip = skip_link(link, data, len);
    if (skip == -2) return IP_PACKET_LINK;
    if (skip < 0) return IP_PACKET_OTHER;
    if (len <= (size_t)skip) return IP_PACKET_DAMAGED;
    struct rest r = {data + skip, len - (size_t)skip, 0};
    const int version = r.p[0] >> 4;
    if (version != 4 && version != 6) return IP_PACKET_OTHER;
    const enum ip_packet_found found = (version == 4 ? read_ipv4 : read_ipv6)(&r, out, &protocol);
    if (found != IP_PACKET_FOUND) return found;
    if (protocol != IPPROTO_TCP && protocol != IPPROTO_UDP) return IP_PACKET_OTHER;
    out->is_tcp = protocol == IPPROTO_TCP;
    return read_transport(&r, out);
}
