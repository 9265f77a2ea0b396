/* SPDX-License-Identifier: MIT */
/* Packets of all link types are read back to their payload. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#include "core/bytes.h"
#include "drivers/protocol/ip_packet.h"

static const struct ethernet_end DRIVER = {.address = {10, 0, 0, 2}, .port = 40000};
static const struct ethernet_end DEVICE = {.address = {10, 0, 0, 1}, .port = 2112};

/* One datagram behind the headers of each link type (tcpdump.org/linktypes.html has their lengths). */
static void test_link_types(void **state)
{
    (void)state;
    static const struct {
        uint16_t link;
        size_t head; /* bytes before the IP packet */
    } types[] = {{1, 14}, {1, 18}, {1, 22}, {101, 0}, {228, 0}, {113, 16}, {276, 20}, {0, 4}, {108, 4}};
    const struct ethernet_end v6 = {.is_v6 = 1, .address = {0xfe, 0x80, [15] = 1}, .port = 5},
                              other = {.is_v6 = 1, .address = {0xfe, 0x80, [14] = 3, 2}, .port = 6};
    uint8_t frame[ETHERNET_MAX_FRAME], packet[200];
    struct ip_packet p;
    const size_t len = ethernet_put_udp(frame, &DEVICE, &DRIVER, "range", 5) - 14;
    for (size_t i = 0; i < sizeof types / sizeof *types; i++) {
        const size_t head = types[i].head;
        memset(packet, 0, sizeof packet);
        memcpy(packet + head, frame + 14, len);
        if (types[i].link == 1) memcpy(packet + head - 2, frame + 12, 2);
        for (size_t tag = 12; types[i].link == 1 && tag + 2 < head; tag += 4)
            be_put16(packet + tag, tag == 12 && head == 22 ? 0x88a8 : 0x8100);
        assert_int_equal(ip_packet_read(types[i].link, packet, head + len, &p), IP_PACKET_FOUND);
        assert_true(!p.is_tcp && p.from.port == DEVICE.port && p.to.port == DRIVER.port && p.missing == 0);
        assert_memory_equal(p.from.address, DEVICE.address, 4);
        assert_int_equal(p.len, 5);
        assert_memory_equal(p.data, "range", 5);
        /* two bytes were cut off; then the UDP header, too */
        assert_int_equal(ip_packet_read(types[i].link, packet, head + len - 2, &p), IP_PACKET_FOUND);
        assert_true(p.len == 3 && p.missing == 2);
        assert_int_equal(ip_packet_read(types[i].link, packet, head + 24, &p), IP_PACKET_DAMAGED);
    }
    assert_int_equal(ip_packet_read(147, packet, len, &p), IP_PACKET_LINK);
    frame[14 + 6] = 0x20; /* more fragments follow */
    assert_int_equal(ip_packet_read(1, frame, len + 14, &p), IP_PACKET_FRAGMENT);
    const size_t len6 = ethernet_put_udp(frame, &v6, &other, "six", 3);
    assert_int_equal(ip_packet_read(1, frame, len6, &p), IP_PACKET_FOUND);
    assert_true(p.from.is_v6 && p.to.is_v6 && p.len == 3 && memcmp(p.data, "six", 3) == 0);
    assert_memory_equal(p.from.address, v6.address, 16);
    assert_memory_equal(p.to.address, other.address, 16);
    assert_true(p.from.port == 5 && p.to.port == 6);
}

/* Changes of one packet make its other forms. A packet ends after `have` bytes; offsets are those of RFC 791, 768, 8200
 * and 9293. */
struct change {
    int at, value;
};
struct lengths {
    struct change change[4]; /* {0, 0}: no more */
    size_t have;
    enum ip_packet_found found;
    uint32_t len, missing;
    int data_at;
};

static void expect_lengths(const uint8_t *packet, const struct lengths *row)
{
    uint8_t bytes[120], *exact = malloc(row->have + 1);
    struct ip_packet p;
    memcpy(bytes, packet, sizeof bytes);
    for (int i = 0; i < 4 && row->change[i].at != 0; i++)
        bytes[row->change[i].at] = (uint8_t)row->change[i].value;
    memcpy(exact, bytes, row->have); /* a sanitizer sees reads beyond it */
    assert_int_equal(ip_packet_read(101, exact, row->have, &p), row->found);
    if (row->found == IP_PACKET_FOUND) {
        assert_int_equal(p.len, row->len);
        assert_int_equal(p.missing, row->missing);
        assert_int_equal(p.data - exact, row->data_at);
    }
    free(exact);
}

/* 20 bytes of IPv4, 8 of UDP, 10 of payload. */
static void test_ipv4_lengths(void **state)
{
    (void)state;
    static const struct lengths rows[] = {
        {{{0, 0}}, 38, IP_PACKET_FOUND, 10, 0, 28},
        {{{0, 0}}, 40, IP_PACKET_FOUND, 10, 0, 28}, /* Ethernet fills short frames up */
        {{{0, 0}}, 30, IP_PACKET_FOUND, 2, 8, 28},
        {{{0, 0}}, 28, IP_PACKET_FOUND, 0, 10, 28},
        {{{0, 0}}, 27, IP_PACKET_DAMAGED, 0, 0, 0},
        {{{0, 0}}, 19, IP_PACKET_DAMAGED, 0, 0, 0},
        {{{25, 15}}, 38, IP_PACKET_FOUND, 7, 0, 28}, /* UDP's length is less than the packet's */
        {{{25, 8}}, 38, IP_PACKET_FOUND, 0, 0, 28},
        {{{25, 7}}, 38, IP_PACKET_DAMAGED, 0, 0, 0},
        {{{25, 19}}, 38, IP_PACKET_FOUND, 10, 0, 28}, /* more than the packet's length, which then counts */
        {{{25, 0}}, 38, IP_PACKET_FOUND, 10, 0, 28},
        {{{3, 0}}, 38, IP_PACKET_FOUND, 10, 0, 28}, /* a total of 0 is left to the network card */
        {{{3, 27}}, 38, IP_PACKET_DAMAGED, 0, 0, 0},
        {{{3, 28}}, 38, IP_PACKET_FOUND, 0, 0, 28},
        {{{3, 19}}, 38, IP_PACKET_DAMAGED, 0, 0, 0},
        {{{-1, 0x44}}, 38, IP_PACKET_DAMAGED, 0, 0, 0},          /* a header of 16 bytes */
        {{{-1, 0x46}, {29, 14}}, 38, IP_PACKET_FOUND, 6, 0, 32}, /* one of 24 */
        {{{-1, 0x4f}}, 38, IP_PACKET_DAMAGED, 0, 0, 0},          /* one of 60 */
        {{{6, 0x40}}, 38, IP_PACKET_FOUND, 10, 0, 28},           /* "don't fragment" */
        {{{6, 0x20}}, 38, IP_PACKET_FRAGMENT, 0, 0, 0},
        {{{7, 1}}, 38, IP_PACKET_FRAGMENT, 0, 0, 0},
        {{{9, 1}}, 38, IP_PACKET_OTHER, 0, 0, 0},
        {{{9, 6}}, 38, IP_PACKET_DAMAGED, 0, 0, 0}, /* 18 bytes are no TCP header */
        {{{-1, 0x55}}, 38, IP_PACKET_OTHER, 0, 0, 0},
    };
    static const uint8_t packet[120] = {0x45, [3] = 38, [9] = 17, [20] = 1, [25] = 18};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct lengths row = rows[i];
        uint8_t first[120];
        memcpy(first, packet, sizeof first);
        if (row.change[0].at == -1) { /* stands for the byte 0 */
            first[0] = (uint8_t)row.change[0].value;
            row.change[0] = row.change[1];
            row.change[1].at = 0;
        }
        expect_lengths(first, &row);
    }
}

/* 20 bytes of IPv4, 20 of TCP, 10 of payload. */
static void test_tcp_lengths(void **state)
{
    (void)state;
    static const struct lengths rows[] = {
        {{{0, 0}}, 50, IP_PACKET_FOUND, 10, 0, 40},
        {{{0, 0}}, 40, IP_PACKET_FOUND, 0, 10, 40},
        {{{0, 0}}, 39, IP_PACKET_DAMAGED, 0, 0, 0},
        {{{32, 0x60}}, 50, IP_PACKET_FOUND, 6, 0, 44}, /* with options */
        {{{32, 0x40}}, 50, IP_PACKET_DAMAGED, 0, 0, 0},
        {{{32, 0x70}, {3, 48}}, 48, IP_PACKET_FOUND, 0, 0, 48},
        {{{32, 0x70}, {3, 47}}, 48, IP_PACKET_DAMAGED, 0, 0, 0},
        {{{32, 0x70}}, 47, IP_PACKET_DAMAGED, 0, 0, 0},
    };
    static const uint8_t packet[120] = {0x45, [3] = 50, [9] = 6, [20] = 0x12, 0x34,        0x56, 0x78,
                                        1,    2,        3,       4,           [32] = 0x50, 0x18};
    struct ip_packet p;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
        expect_lengths(packet, &rows[i]);
    assert_int_equal(ip_packet_read(101, packet, 50, &p), IP_PACKET_FOUND);
    assert_true(p.is_tcp && p.from.port == 0x1234 && p.to.port == 0x5678 && p.seq == 0x01020304 && p.flags == 0x18);
}

/* 40 bytes of IPv6, headers of options, 8 of UDP, 10 of payload. */
static void test_ipv6_lengths(void **state)
{
    (void)state;
    static const struct lengths rows[] = {
        {{{0, 0}}, 58, IP_PACKET_FOUND, 10, 0, 48},
        {{{0, 0}}, 60, IP_PACKET_FOUND, 10, 0, 48},
        {{{0, 0}}, 50, IP_PACKET_FOUND, 2, 8, 48},
        {{{0, 0}}, 47, IP_PACKET_DAMAGED, 0, 0, 0},
        {{{0, 0}}, 39, IP_PACKET_DAMAGED, 0, 0, 0},
        {{{5, 0}}, 58, IP_PACKET_FOUND, 10, 0, 48},
        {{{6, 44}}, 58, IP_PACKET_FRAGMENT, 0, 0, 0},
        {{{6, 58}}, 58, IP_PACKET_OTHER, 0, 0, 0},
        /* Options before UDP begin with the next header and their length in units of 8 bytes, less one. */
        {{{5, 26}, {6, 60}, {40, 17}, {53, 18}}, 66, IP_PACKET_FOUND, 10, 0, 56},
        {{{5, 26}, {6, 60}, {40, 44}}, 66, IP_PACKET_FRAGMENT, 0, 0, 0},
        {{{5, 26}, {6, 60}, {41, 2}, {40, 58}}, 66, IP_PACKET_OTHER, 0, 0, 0}, /* 24 bytes of 26 */
        {{{5, 26}, {6, 60}, {41, 3}, {40, 58}}, 66, IP_PACKET_DAMAGED, 0, 0, 0},
        {{{5, 7}, {6, 60}, {40, 58}}, 66, IP_PACKET_DAMAGED, 0, 0, 0},
        {{{5, 8}, {6, 60}, {40, 58}}, 66, IP_PACKET_OTHER, 0, 0, 0},
        {{{5, 26}, {6, 60}, {40, 58}}, 47, IP_PACKET_DAMAGED, 0, 0, 0},
        {{{5, 26}, {6, 60}, {40, 58}}, 48, IP_PACKET_OTHER, 0, 0, 0},
    };
    static const uint8_t packet[120] = {0x60, [5] = 18, [6] = 17, [45] = 18};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
        expect_lengths(packet, &rows[i]);
    static const uint8_t two[120] = {0x60, [5] = 34, [6] = 0, [40] = 60, [48] = 17, [61] = 18}; /* hop by hop, others */
    expect_lengths(two, &(struct lengths){{{0, 0}}, 74, IP_PACKET_FOUND, 10, 0, 64});
}

/* Frames whose header is cut are no IP. A link header without a packet after it is damaged. */
static void test_short_frames(void **state)
{
    (void)state;
    static const uint8_t frame[40] = {[12] = 0x81, 0, 0, 0, 0x08, 0, 0x45}, plain[40] = {[12] = 0x08, 0, 0x45},
                         null[40] = {2, [4] = 0x45};
    struct ip_packet p;
    for (size_t len = 0; len <= 17; len++)
        assert_int_equal(ip_packet_read(1, frame, len, &p), IP_PACKET_OTHER);
    for (size_t len = 18; len <= 37; len++)
        assert_int_equal(ip_packet_read(1, frame, len, &p), IP_PACKET_DAMAGED);
    assert_int_equal(ip_packet_read(1, plain, 13, &p), IP_PACKET_OTHER);
    assert_int_equal(ip_packet_read(1, plain, 14, &p), IP_PACKET_DAMAGED);
    assert_int_equal(ip_packet_read(0, null, 4, &p), IP_PACKET_DAMAGED);
    assert_int_equal(ip_packet_read(0, null, 5, &p), IP_PACKET_DAMAGED);
    assert_int_equal(ip_packet_read(12, plain + 14, 1, &p), IP_PACKET_DAMAGED);
    assert_int_equal(ip_packet_read(229, plain + 14, 1, &p), IP_PACKET_DAMAGED);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_link_types),   cmocka_unit_test(test_ipv4_lengths), cmocka_unit_test(test_tcp_lengths),
        cmocka_unit_test(test_ipv6_lengths), cmocka_unit_test(test_short_frames),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
