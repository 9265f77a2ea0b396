/* SPDX-License-Identifier: MIT */
/* Packets of all link types are read back to their payload. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_link_types),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
