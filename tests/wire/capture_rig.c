/* SPDX-License-Identifier: MIT */
#include "tests/wire/capture_rig.h"

#include <stdlib.h>
#include <string.h>

#include "core/bytes.h"
#include "drivers/protocol/pcapng.h"

enum { SNAP_LEN = 1 << 18, ETHERNET_LEN = 14, IP_LEN = 20, TCP_LEN = 20, USBMON_LEN = 64, PACKET_NS = 1000 };

static void room_for(struct capture *c, size_t more)
{
    if (c->len + more <= c->room) return;
    c->room = 2 * (c->len + more);
    c->bytes = realloc(c->bytes, c->room);
    if (c->bytes == NULL) abort();
}

void capture_begin(struct capture *c)
{
    room_for(c, PCAPNG_FRONT_ROOM);
    c->len += pcapng_put_section(c->bytes + c->len, "capture_rig");
}

uint32_t capture_interface(struct capture *c, enum capture_link link)
{
    room_for(c, PCAPNG_FRONT_ROOM);
    c->len += pcapng_put_interface(c->bytes + c->len, (enum pcapng_link)link, SNAP_LEN, NULL, NULL);
    return c->n_interfaces++;
}

void capture_packet(struct capture *c, uint32_t interface, const void *data, size_t len)
{
    room_for(c, pcapng_packet_len(len));
    c->len += pcapng_put_packet(c->bytes + c->len, interface, (int64_t)c->n_packets++ * PACKET_NS, data, len, 0);
}

static void put_be16(uint8_t *to, uint32_t v)
{
    to[0] = (uint8_t)(v >> 8);
    to[1] = (uint8_t)v;
}

static void put_be32(uint8_t *to, uint32_t v)
{
    put_be16(to, v >> 16);
    put_be16(to + 2, v);
}

/* The layouts are those of RFC 791 and 9293. Checksums are 0: tshark does not look at them unless asked to. */
void capture_segment(struct capture *c, uint32_t interface, struct capture_tcp *tcp, int from_head, const void *data,
                     size_t len)
{
    uint8_t packet[ETHERNET_LEN + IP_LEN + TCP_LEN + 1460] = {2, 0, 0, 0, 0, 1, 2, 0, 0, 0, 0, 2, 8, 0};
    uint8_t *ip = packet + ETHERNET_LEN, *segment = ip + IP_LEN;
    ip[0] = 0x45;
    put_be16(ip + 2, (uint32_t)(IP_LEN + TCP_LEN + len));
    ip[8] = 64;
    ip[9] = 6;
    put_be32(ip + 12, from_head ? 0x0a000001 : 0x0a000002);
    put_be32(ip + 16, from_head ? 0x0a000002 : 0x0a000001);
    put_be16(segment, from_head ? tcp->head_port : tcp->client_port);
    put_be16(segment + 2, from_head ? tcp->client_port : tcp->head_port);
    put_be32(segment + 4, 1 + tcp->seq[from_head]);
    put_be32(segment + 8, 1 + tcp->seq[!from_head]);
    segment[12] = TCP_LEN / 4 << 4;
    segment[13] = 0x18; /* PSH, ACK */
    put_be16(segment + 14, 65535);
    memcpy(segment + TCP_LEN, data, len);
    tcp->seq[from_head] += (uint32_t)len;
    capture_packet(c, interface, packet, ETHERNET_LEN + IP_LEN + TCP_LEN + len);
}

/* The layout is struct mon_bin_hdr of Linux, Documentation/usb/usbmon.rst. */
void capture_transfer(struct capture *c, uint32_t interface, uint8_t device, uint8_t endpoint, const void *data,
                      size_t len)
{
    uint8_t packet[USBMON_LEN + 65536] = {0};
    le_put64(packet, 0xffff000000000000u + c->n_packets);
    packet[8] = endpoint & 0x80 ? 'C' : 'S';
    packet[9] = 3; /* bulk */
    packet[10] = endpoint;
    packet[11] = device;
    le_put16(packet + 12, 1);
    packet[14] = '-';                                            /* no set-up packet; the data is there */
    le_put32(packet + 28, endpoint & 0x80 ? 0 : (uint32_t)-115); /* EINPROGRESS */
    le_put32(packet + 32, (uint32_t)len);
    le_put32(packet + 36, (uint32_t)len);
    memcpy(packet + USBMON_LEN, data, len);
    capture_packet(c, interface, packet, USBMON_LEN + len);
}

/* Knuth's linear congruential generator, of which the upper bits are used. */
uint32_t capture_random(uint64_t *state, uint32_t below)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)((*state >> 33) % below);
}
