/* SPDX-License-Identifier: MIT */
/* Frames are made anew. Their headers are read back by their offsets, their checksums are summed in another way, and
 * the numbers of a connection fit. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <string.h>

#include "core/rng.h"
#include "drivers/protocol/ethernet.h"

static const struct ethernet_end HERE = {.address = {127, 0, 0, 1}, .port = 40123};
static const struct ethernet_end SENSOR = {.address = {192, 168, 1, 201}, .port = 2368};
static const struct ethernet_end BROADCAST = {.address = {255, 255, 255, 255}, .port = 2368};
static const struct ethernet_end GROUP = {.address = {239, 200, 3, 4}, .port = 7};
static const struct ethernet_end SIX = {.is_v6 = 1, .address = {0x20, 1, 0xd, 0xb8, [14] = 0x12, 0x34}, .port = 9};
static const struct ethernet_end SIX_HERE = {.is_v6 = 1, .address = {[15] = 1}, .port = 10};
static const struct ethernet_end SIX_GROUP = {.is_v6 = 1, .address = {0xff, 2, [15] = 5}, .port = 11};

static uint8_t frame[ETHERNET_MAX_FRAME];

static uint32_t be16(const uint8_t *at)
{
    return (uint32_t)at[0] << 8 | at[1];
}

static uint32_t be32(const uint8_t *at)
{
    return be16(at) << 16 | be16(at + 2);
}

/* One's complement addition, byte by byte. The sum is 0xffff for a block with its right checksum in it. */
static uint32_t add_bytes(uint32_t sum, const uint8_t *at, size_t len)
{
    for (size_t i = 0; i < len; i++) {
        sum += i % 2 == 0 ? (uint32_t)at[i] << 8 : at[i];
        if (sum > 0xffff) sum -= 0xffff;
    }
    return sum;
}

/* Checks all fields but the transport's own, and returns where the transport header is. */
static const uint8_t *check_front(size_t len, const struct ethernet_end *from, const struct ethernet_end *to,
                                  uint8_t protocol)
{
    const uint8_t *ip = frame + 14, *transport = ip + (from->is_v6 ? 40 : 20);
    const size_t n_address = from->is_v6 ? 16 : 4, transport_len = len - (size_t)(transport - frame);
    const uint8_t *addresses = ip + (from->is_v6 ? 8 : 12);
    assert_int_equal(be16(frame + 12), from->is_v6 ? 0x86dd : 0x0800);
    assert_int_equal(ip[0] >> 4, from->is_v6 ? 6 : 4);
    if (from->is_v6) {
        assert_memory_equal(ip, "\x60\0\0\0", 4); /* no class, no label */
        assert_int_equal(ip[7], 64);
        assert_int_equal(be16(ip + 4), transport_len);
        assert_int_equal(ip[6], protocol);
    } else {
        assert_int_equal(be16(ip + 2), len - 14);
        assert_memory_equal(ip + 4, "\0\0\x40\0\x40", 5); /* no number, "don't fragment", 64 hops */
        assert_int_equal(ip[9], protocol);
        assert_int_equal(add_bytes(0, ip, 20), 0xffff);
    }
    assert_memory_equal(addresses, from->address, n_address);
    assert_memory_equal(addresses + n_address, to->address, n_address);
    assert_int_equal(be16(transport), from->port);
    assert_int_equal(be16(transport + 2), to->port);
    uint32_t sum = add_bytes(0, addresses, 2 * n_address);
    const uint8_t pseudo[4] = {0, protocol, (uint8_t)(transport_len >> 8), (uint8_t)transport_len};
    sum = add_bytes(sum, pseudo, 4);
    assert_int_equal(add_bytes(sum, transport, transport_len), 0xffff);
    return transport;
}

static void check_udp(const struct ethernet_end *from, const struct ethernet_end *to, const uint8_t *data, size_t n)
{
    memset(frame, 0xa5, sizeof frame);
    const size_t len = ethernet_put_udp(frame, from, to, data, n);
    assert_int_equal(len, 14u + (from->is_v6 ? 40u : 20u) + 8u + n);
    const uint8_t *udp = check_front(len, from, to, 17);
    assert_int_equal(be16(udp + 4), 8 + n);
    assert_int_not_equal(be16(udp + 6), 0);
    assert_memory_equal(udp + 8, data, n);
    for (size_t i = len; i < len + 8 && i < sizeof frame; i++)
        assert_int_equal(frame[i], 0xa5);
}

static void test_datagrams(void **state)
{
    (void)state;
    static uint8_t data[ETHERNET_MAX_DATAGRAM];
    for (size_t i = 0; i < sizeof data; i++)
        data[i] = (uint8_t)rng_u64(5, i);
    for (size_t n = 0; n < 200; n++) {
        check_udp(&SENSOR, &HERE, data + n, n);
        check_udp(&SIX, &SIX_HERE, data + n, n);
    }
    check_udp(&SENSOR, &BROADCAST, data, 1206);
    check_udp(&HERE, &SENSOR, data, 65507);
    check_udp(&SIX, &SIX_GROUP, data, sizeof data);
}

/* The sum 0 is sent as 0xffff, as 0 means that there is none. Just one of all payloads of two bytes has this sum. */
static void test_sum_of_zero(void **state)
{
    (void)state;
    int n = 0;
    for (uint32_t v = 0; v < 0x10000; v++) {
        const uint8_t data[2] = {(uint8_t)(v >> 8), (uint8_t)v};
        const size_t len = ethernet_put_udp(frame, &SENSOR, &HERE, data, 2);
        const uint32_t sum = be16(frame + len - 4);
        assert_int_not_equal(sum, 0);
        n += sum == 0xffff;
    }
    assert_int_equal(n, 1);
}

static void check_hardware(const struct ethernet_end *to, const char *bytes)
{
    const struct ethernet_end *from = to->is_v6 ? &SIX : &SENSOR;
    ethernet_put_udp(frame, from, to, "", 0);
    assert_memory_equal(frame, bytes, 6);
    assert_memory_equal(frame + 6, to->is_v6 ? "\x02\x00\x00\x00\x12\x34" : "\x02\x00\xc0\xa8\x01\xc9", 6);
}

static void test_hardware_addresses(void **state)
{
    (void)state;
    check_hardware(&HERE, "\0\0\0\0\0\0");
    check_hardware(&SIX_HERE, "\0\0\0\0\0\0");
    check_hardware(&BROADCAST, "\xff\xff\xff\xff\xff\xff");
    check_hardware(&GROUP, "\x01\x00\x5e\x48\x03\x04"); /* the last 23 bits of the group */
    check_hardware(&SIX_GROUP, "\x33\x33\x00\x00\x00\x05");
    check_hardware(&SENSOR, "\x02\x00\xc0\xa8\x01\xc9");
}

/* The state of the two ends of a connection: the bytes that each has sent, and how many of them the other has
 * acknowledged. */
struct heard {
    uint32_t seq[2];
    uint8_t bytes[2][8192];
    size_t n[2];
};

static void hear(struct heard *h, const struct tcp_talk *talk, int side, size_t len, unsigned flags)
{
    const uint8_t *tcp = check_front(len, &talk->end[side], &talk->end[!side], 6);
    const size_t head = (size_t)(tcp[12] >> 4) * 4, n = len - (size_t)(tcp - frame) - head;
    assert_int_equal(tcp[13], flags);
    assert_int_equal(be32(tcp + 4), h->seq[side]);
    assert_int_equal(be32(tcp + 8), flags == TCP_SYN ? 0 : h->seq[!side]);
    assert_true(n <= ETHERNET_MAX_SEGMENT && len <= 1514);
    /* Options by RFC 9293 (3.2) and RFC 7323 (2.2): the largest segment, and windows of 65535 << 7, 8 MiB. */
    static const uint8_t options[] = {2, 4, ETHERNET_MAX_SEGMENT >> 8, ETHERNET_MAX_SEGMENT & 0xff, 1, 3, 3, 7};
    assert_int_equal(head, (flags & TCP_SYN) != 0 ? 20 + sizeof options : 20);
    assert_memory_equal(tcp + 20, options, head - 20);
    assert_int_equal(be16(tcp + 14), 65535);
    assert_int_equal(be16(tcp + 18), 0); /* nothing is urgent */
    memcpy(h->bytes[side] + h->n[side], tcp + head, n);
    h->n[side] += n;
    h->seq[side] += (uint32_t)n + ((flags & (TCP_SYN | TCP_FIN)) != 0);
    assert_int_equal(talk->next[side], h->seq[side]);
}

static void hold_talk(struct tcp_talk *talk)
{
    static struct heard h;
    static uint8_t data[2 * ETHERNET_MAX_SEGMENT];
    h = (struct heard){.seq = {talk->next[0], talk->next[1]}};
    for (size_t i = 0; i < sizeof data; i++)
        data[i] = (uint8_t)rng_u64(6, i);
    hear(&h, talk, 0, tcp_put_syn(talk, 0, frame), TCP_SYN);
    hear(&h, talk, 1, tcp_put_syn(talk, 1, frame), TCP_SYN | TCP_ACK);
    hear(&h, talk, 0, tcp_put_ack(talk, 0, frame), TCP_ACK);
    assert_int_equal(tcp_put_ack(talk, 0, frame), 0);
    assert_int_equal(tcp_put_ack(talk, 1, frame), 0);
    hear(&h, talk, 0, tcp_put_data(talk, 0, data, 5, frame), TCP_PSH | TCP_ACK);
    hear(&h, talk, 1, tcp_put_ack(talk, 1, frame), TCP_ACK);
    hear(&h, talk, 1, tcp_put_data(talk, 1, data, ETHERNET_MAX_SEGMENT, frame), TCP_PSH | TCP_ACK);
    hear(&h, talk, 1, tcp_put_data(talk, 1, data + ETHERNET_MAX_SEGMENT, ETHERNET_MAX_SEGMENT, frame),
         TCP_PSH | TCP_ACK);
    hear(&h, talk, 0, tcp_put_data(talk, 0, data + 5, 1, frame), TCP_PSH | TCP_ACK);
    assert_int_equal(tcp_put_ack(talk, 0, frame), 0); /* the data has acknowledged all */
    hear(&h, talk, 1, tcp_put_ack(talk, 1, frame), TCP_ACK);
    hear(&h, talk, 0, tcp_put_fin(talk, 0, frame), TCP_FIN | TCP_ACK);
    hear(&h, talk, 1, tcp_put_ack(talk, 1, frame), TCP_ACK);
    hear(&h, talk, 1, tcp_put_reset(talk, 1, frame), TCP_RST | TCP_ACK);
    assert_true(h.n[0] == 6 && h.n[1] == sizeof data);
    assert_memory_equal(h.bytes[0], data, 6);
    assert_memory_equal(h.bytes[1], data, sizeof data);
}

/* The sequence numbers wrap within these talks. */
static void test_talk(void **state)
{
    (void)state;
    struct tcp_talk four = {.end = {HERE, SENSOR}, .next = {0, UINT32_MAX - 2000}};
    struct tcp_talk six = {.end = {SIX_HERE, SIX}, .next = {UINT32_MAX, 77}};
    hold_talk(&four);
    hold_talk(&six);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_datagrams), cmocka_unit_test(test_sum_of_zero),
                                       cmocka_unit_test(test_hardware_addresses), cmocka_unit_test(test_talk)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
