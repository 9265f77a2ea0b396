/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/ethernet.h"

#include <linux/if_ether.h>
#include <netinet/in.h>
#include <string.h>

#include "core/bytes.h"

enum {
    LINK_LEN = 14,
    IPV4_LEN = 20,
    IPV6_LEN = 40,
    UDP_LEN = 8,
    TCP_LEN = 20,
    SYN_OPTIONS_LEN = 8,
    DONT_FRAGMENT = 0x4000,
    TIME_TO_LIVE = 64,
    WINDOW = 0xffff,
    WINDOW_SHIFT = 7,
};

/* ---- checksums: sums of 16-bit words, big-endian, carries added again (RFC 1071) */

static uint64_t sum_words(const uint8_t *data, size_t len)
{
    uint64_t sum = 0;
    for (size_t i = 0; i + 1 < len; i += 2)
        sum += be_get16(data + i);
    return len % 2 != 0 ? sum + ((uint32_t)data[len - 1] << 8) : sum;
}

static uint16_t complement(uint64_t sum)
{
    while (sum >> 16 != 0)
        sum = (sum & 0xffff) + (sum >> 16);
    return (uint16_t)~sum;
}

/* ---- link and network */

static size_t address_len(const struct ethernet_end *end)
{
    return end->is_v6 ? 16 : 4;
}

static int is_loopback(const struct ethernet_end *end)
{
    static const uint8_t one[16] = {[15] = 1};
    return end->is_v6 ? memcmp(end->address, one, 16) == 0 : end->address[0] == 127;
}

/* Writes the hardware address of an end. RFC 1112, 6.4, and RFC 2464, 7, define it for multicast by IPv4 and IPv6. The
 * address of loopback is all zeros, that of an IPv4 broadcast all ones. Any other end gets a locally administered
 * address, with the last four bytes of its IP address. */
static void put_hardware(uint8_t *to, const struct ethernet_end *end)
{
    static const uint8_t all[4] = {255, 255, 255, 255};
    const uint8_t *a = end->address, *last = a + address_len(end) - 4;
    memset(to, 0, 6);
    if (is_loopback(end)) return;
    if (end->is_v6 && a[0] == 0xff) {
        to[0] = to[1] = 0x33;
    } else if (!end->is_v6 && a[0] >= 224 && a[0] < 240) {
        memcpy(to, (const uint8_t[]){0x01, 0x00, 0x5e, a[1] & 0x7f, a[2], a[3]}, 6);
        return;
    } else if (!end->is_v6 && memcmp(a, all, 4) == 0) {
        memset(to, 0xff, 6);
        return;
    } else {
        to[0] = 0x02; /* locally administered */
    }
    memcpy(to + 2, last, 4);
}

static void put_ipv4(uint8_t *to, const struct ethernet_end *from, const struct ethernet_end *dest, int protocol,
                     size_t len)
{
    memset(to, 0, IPV4_LEN);
    to[0] = 0x45; /* version 4, five words */
    be_put16(to + 2, IPV4_LEN + len);
    be_put16(to + 6, DONT_FRAGMENT); /* so that packets need no number each (RFC 6864) */
    to[8] = TIME_TO_LIVE;
    to[9] = (uint8_t)protocol;
    memcpy(to + 12, from->address, 4);
    memcpy(to + 16, dest->address, 4);
    be_put16(to + 10, complement(sum_words(to, IPV4_LEN)));
}

static void put_ipv6(uint8_t *to, const struct ethernet_end *from, const struct ethernet_end *dest, int protocol,
                     size_t len)
{
    memset(to, 0, 8);
    to[0] = 0x60;
    be_put16(to + 4, len);
    to[6] = (uint8_t)protocol;
    to[7] = TIME_TO_LIVE;
    memcpy(to + 8, from->address, 16);
    memcpy(to + 24, dest->address, 16);
}

/* Writes the headers of link and network. len: bytes after them. Returns where the transport's header begins. */
static uint8_t *put_front(uint8_t *to, const struct ethernet_end *from, const struct ethernet_end *dest, int protocol,
                          size_t len)
{
    put_hardware(to, dest);
    put_hardware(to + 6, from);
    be_put16(to + 12, from->is_v6 ? ETH_P_IPV6 : ETH_P_IP);
    (from->is_v6 ? put_ipv6 : put_ipv4)(to + LINK_LEN, from, dest, protocol, len);
    return to + LINK_LEN + (from->is_v6 ? IPV6_LEN : IPV4_LEN);
}

/* The checksum covers addresses, protocol and length, too (RFC 768, RFC 8200 8.1). The checksum's own place is still
 * zero. */
static uint16_t checksum(const uint8_t *packet, size_t len, const struct ethernet_end *from,
                         const struct ethernet_end *dest, int protocol)
{
    return complement(sum_words(from->address, address_len(from)) + sum_words(dest->address, address_len(dest)) +
                      (uint64_t)protocol + len + sum_words(packet, len));
}

/* ---- transport */

size_t ethernet_put_udp(uint8_t *to, const struct ethernet_end *from, const struct ethernet_end *dest, const void *data,
                        size_t data_len)
{
    const size_t len = UDP_LEN + data_len;
    uint8_t *udp = put_front(to, from, dest, IPPROTO_UDP, len);
    be_put16(udp, from->port);
    be_put16(udp + 2, dest->port);
    be_put16(udp + 4, len);
    be_put16(udp + 6, 0);
    memcpy(udp + UDP_LEN, data, data_len);
    const uint16_t sum = checksum(udp, len, from, dest, IPPROTO_UDP);
    be_put16(udp + 6, sum != 0 ? sum : 0xffff); /* 0 means that there is none */
    return (size_t)(udp - to) + len;
}

/* The options are the largest segment, a no-operation that fills the word, and the shift of windows. */
static void put_syn_options(uint8_t *to)
{
    static const uint8_t options[SYN_OPTIONS_LEN] = {2, 4, 0, 0, 1, 3, 3, WINDOW_SHIFT};
    memcpy(to, options, sizeof options);
    be_put16(to + 2, ETHERNET_MAX_SEGMENT);
}

/* ---- a connection */

/* A segment with TCP_SYN offers segments of ETHERNET_MAX_SEGMENT and windows of 8 MiB. len <= ETHERNET_MAX_SEGMENT. */
static size_t put_segment(struct tcp_talk *talk, int side, unsigned flags, const void *data, size_t len, uint8_t *to)
{
    const struct ethernet_end *from = &talk->end[side], *dest = &talk->end[!side];
    const uint32_t ack = (flags & TCP_ACK) != 0 ? talk->next[!side] : 0;
    const size_t head = TCP_LEN + ((flags & TCP_SYN) != 0 ? SYN_OPTIONS_LEN : 0);
    uint8_t *tcp = put_front(to, from, dest, IPPROTO_TCP, head + len);
    be_put16(tcp, from->port);
    be_put16(tcp + 2, dest->port);
    be_put32(tcp + 4, talk->next[side]);
    be_put32(tcp + 8, ack);
    tcp[12] = (uint8_t)(head / 4 << 4);
    tcp[13] = (uint8_t)flags;
    be_put16(tcp + 14, WINDOW);
    be_put32(tcp + 16, 0);
    if ((flags & TCP_SYN) != 0) put_syn_options(tcp + TCP_LEN);
    if (len > 0) memcpy(tcp + head, data, len);
    be_put16(tcp + 16, checksum(tcp, head + len, from, dest, IPPROTO_TCP));
    talk->next[side] += (uint32_t)len + ((flags & (TCP_SYN | TCP_FIN)) != 0);
    if ((flags & TCP_ACK) != 0) talk->acked[side] = ack;
    return (size_t)(tcp - to) + head + len;
}

size_t tcp_put_syn(struct tcp_talk *talk, int side, uint8_t *to)
{
    return put_segment(talk, side, side == 0 ? TCP_SYN : TCP_SYN | TCP_ACK, NULL, 0, to);
}

size_t tcp_put_data(struct tcp_talk *talk, int side, const void *data, size_t len, uint8_t *to)
{
    return put_segment(talk, side, TCP_PSH | TCP_ACK, data, len, to);
}

size_t tcp_put_ack(struct tcp_talk *talk, int side, uint8_t *to)
{
    return talk->acked[side] == talk->next[!side] ? 0 : put_segment(talk, side, TCP_ACK, NULL, 0, to);
}

size_t tcp_put_fin(struct tcp_talk *talk, int side, uint8_t *to)
{
    return put_segment(talk, side, TCP_FIN | TCP_ACK, NULL, 0, to);
}

/* An end that was never open acknowledges the segment that it refuses (RFC 9293, 3.10.7.1). */
size_t tcp_put_reset(struct tcp_talk *talk, int side, uint8_t *to)
{
    return put_segment(talk, side, TCP_RST | TCP_ACK, NULL, 0, to);
}
