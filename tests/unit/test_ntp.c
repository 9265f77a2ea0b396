/* SPDX-License-Identifier: MIT */
/* Packets of a time server. Expected bytes follow from RFC 4330: the layout of section 4, the times of section 3, the
 * checks of section 5, and the kisses of section 8. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "drivers/protocol/ntp.h"

#define SECOND_NS INT64_C(1000000000)

/* RFC 4330 has 1 January 1970 as 2208988800 s: 83AA7E80. Half a second is 80000000. */
static void a_request_has_its_time(void **state)
{
    (void)state;
    static const uint8_t since_1970[48] = {[0] = 0x23, [40] = 0x83, [41] = 0xaa, [42] = 0x7e, [43] = 0x80, [44] = 0x80};
    static const uint8_t in_2036[8] = {0, 0, 0, 1, 0x40, 0, 0, 0}; /* 1.25 s after 2036-02-07T06:28:16Z */
    uint8_t packet[NTP_LEN];
    memset(packet, 0xff, sizeof packet);
    ntp_write_request(packet, SECOND_NS / 2);
    assert_memory_equal(packet, since_1970, sizeof packet);
    ntp_write_request(packet, INT64_C(2085978497) * SECOND_NS + SECOND_NS / 4);
    assert_memory_equal(packet + 40, in_2036, 8);
    ntp_write_request(packet, -SECOND_NS / 4); /* before 1970: the fraction still counts forward */
    assert_memory_equal(packet + 40, "\x83\xaa\x7e\x7f\xc0\0\0\0", 8);
}

/* Writes an answer. T2 and T3 are a quarter of a second after t2_s and t3_s, which count from 1970. */
static void answer(uint8_t packet[NTP_LEN], int64_t t1_ns, uint32_t t2_s, uint32_t t3_s)
{
    uint8_t request[NTP_LEN];
    ntp_write_request(request, t1_ns);
    memset(packet, 0, NTP_LEN);
    packet[0] = 0x24;
    packet[1] = 2;
    memcpy(packet + 24, request + 40, 8);
    for (int i = 0; i < 4; i++) {
        packet[32 + i] = (uint8_t)((t2_s + 2208988800U) >> (24 - 8 * i));
        packet[40 + i] = (uint8_t)((t3_s + 2208988800U) >> (24 - 8 * i));
    }
    packet[36] = packet[44] = 0x40;
}

/* T1 = 10 s, T2 = 100.25 s, T3 = 103.25 s, T4 = 14 s: the way takes 1 s, and the offset is (90.25 + 89.25) / 2. */
static void offset_and_delay(void **state)
{
    (void)state;
    uint8_t packet[NTP_LEN];
    struct ntp_answer a;
    answer(packet, 10 * SECOND_NS, 100, 103);
    assert_int_equal(ntp_read_answer(packet, NTP_LEN, 10 * SECOND_NS, 14 * SECOND_NS, &a), NTP_GOOD);
    assert_int_equal(a.delay_ns, SECOND_NS);
    assert_int_equal(a.offset_ns, 89 * SECOND_NS + 3 * SECOND_NS / 4);
    /* a scanner of 1970 and a server after 2036, in the next era */
    answer(packet, 10 * SECOND_NS, 2085978500U, 2085978500U);
    assert_int_equal(ntp_read_answer(packet, NTP_LEN, 10 * SECOND_NS, 10 * SECOND_NS, &a), NTP_GOOD);
    assert_int_equal(a.offset_ns, INT64_C(2085978490) * SECOND_NS + SECOND_NS / 4);
    packet[0] = 0x1c; /* version 3, and what follows the packet is for others */
    assert_int_equal(ntp_read_answer(packet, NTP_LEN + 20, 10 * SECOND_NS, 10 * SECOND_NS, &a), NTP_GOOD);
}

static enum ntp_kind with(int byte, int value, int64_t t4_s)
{
    uint8_t packet[NTP_LEN];
    struct ntp_answer a;
    answer(packet, 10 * SECOND_NS, 100, 103);
    if (byte >= 0) packet[byte] = (uint8_t)value;
    return ntp_read_answer(packet, NTP_LEN, 10 * SECOND_NS, t4_s * SECOND_NS, &a);
}

static void wrong_answers(void **state)
{
    (void)state;
    static const struct {
        int byte, value;
        int64_t t4_s;
        enum ntp_kind kind;
    } cases[] = {
        {-1, 0, 13, NTP_GOOD},             /* no way at all */
        {-1, 0, 12, NTP_UNSYNCHRONISED},   /* less than the server says that it took */
        {0, 0xe4, 14, NTP_UNSYNCHRONISED}, /* LI 3 */
        {0, 0xa4, 14, NTP_GOOD},           /* LI 2: a leap second is announced */
        {0, 0x23, 14, NTP_FOREIGN},        /* a client's */
        {0, 0x25, 14, NTP_FOREIGN},        /* a broadcast */
        {0, 0x2c, 14, NTP_FOREIGN},        /* version 5 */
        {0, 0x04, 14, NTP_FOREIGN},        /* version 0 */
        {1, 15, 14, NTP_GOOD},             /* the last stratum */
        {1, 16, 14, NTP_UNSYNCHRONISED},
        {1, 0, 14, NTP_KISS},
        {31, 1, 14, NTP_FOREIGN},          /* of another request */
        {5, 1, 14, NTP_UNSYNCHRONISED},    /* its own delay is a second */
        {9, 1, 14, NTP_UNSYNCHRONISED},    /* its dispersion */
        {6, 0xff, 14, NTP_GOOD},           /* 0.996 s */
        {33, 0xff, 14, NTP_UNSYNCHRONISED} /* T2 is after T3 */
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++)
        if (with(cases[i].byte, cases[i].value, cases[i].t4_s) != cases[i].kind) fail_msg("case %zu", i);
    uint8_t packet[NTP_LEN];
    struct ntp_answer a;
    answer(packet, 10 * SECOND_NS, 100, 103);
    for (size_t len = 0; len < NTP_LEN; len++)
        assert_int_equal(ntp_read_answer(packet, len, 10 * SECOND_NS, 14 * SECOND_NS, &a), NTP_FOREIGN);
    memset(packet + 40, 0, 8); /* it has never had a time */
    assert_int_equal(ntp_read_answer(packet, NTP_LEN, 10 * SECOND_NS, 14 * SECOND_NS, &a), NTP_UNSYNCHRONISED);
    memset(packet + 32, 0, 8); /* both times would be in 2036 */
    assert_int_equal(ntp_read_answer(packet, NTP_LEN, 10 * SECOND_NS, 14 * SECOND_NS, &a), NTP_UNSYNCHRONISED);
    answer(packet, 10 * SECOND_NS, 100, 100);
    assert_int_equal(ntp_read_answer(packet, NTP_LEN, 10 * SECOND_NS, 14 * SECOND_NS, &a), NTP_GOOD);
    packet[39] = 5; /* T2 is 1.2 ns after T3 */
    assert_int_equal(ntp_read_answer(packet, NTP_LEN, 10 * SECOND_NS, 14 * SECOND_NS, &a), NTP_UNSYNCHRONISED);
}

static void kisses_are_read(void **state)
{
    (void)state;
    uint8_t packet[NTP_LEN];
    struct ntp_answer a;
    answer(packet, 10 * SECOND_NS, 100, 103);
    packet[1] = 0;
    memcpy(packet + 12, "RATE", 4);
    assert_int_equal(ntp_read_answer(packet, NTP_LEN, 10 * SECOND_NS, 14 * SECOND_NS, &a), NTP_KISS);
    assert_string_equal(a.kiss, "RATE");
    memcpy(packet + 12, "A\n\"\xff", 4);
    ntp_read_answer(packet, NTP_LEN, 10 * SECOND_NS, 14 * SECOND_NS, &a);
    assert_string_equal(a.kiss, "A?\"?");
}

/* Clocks at the ends of what the header allows, and any bytes: the sanitizers look for overflows. */
static void any_bytes_do_no_harm(void **state)
{
    (void)state;
    static const int64_t clocks_ns[] = {INT64_C(-4600000000000000000), -1, 0, INT64_C(6300000000000000000)};
    uint32_t random = 1;
    for (int i = 0; i < 20000; i++) {
        const int64_t t1_ns = clocks_ns[i % 4];
        uint8_t packet[NTP_LEN];
        struct ntp_answer a;
        answer(packet, t1_ns, 0, 0);
        for (int k = 0; k < NTP_LEN; k++) {
            random = random * 1664525 + 1013904223;
            if (k < 24 ? k > 1 && random >> 31 : k > 31) packet[k] = (uint8_t)(random >> 24);
        }
        const enum ntp_kind kind = ntp_read_answer(packet, NTP_LEN, t1_ns, t1_ns + SECOND_NS, &a);
        assert_true(kind == NTP_GOOD || kind == NTP_UNSYNCHRONISED);
        ntp_change_answer(packet, NTP_STEP, i % 2 ? INT64_C(1000000000000000) : INT64_C(-1000000000000000));
        if (kind == NTP_GOOD) assert_true(a.delay_ns >= 0 && a.delay_ns <= SECOND_NS);
    }
}

/* Injected faults: what a reader makes of the changed answer. */
static void answers_are_changed(void **state)
{
    (void)state;
    uint8_t packet[NTP_LEN];
    struct ntp_answer a;
    answer(packet, 10 * SECOND_NS, 100, 103);
    ntp_change_answer(packet, NTP_STEP, -2 * SECOND_NS - SECOND_NS / 2);
    assert_int_equal(ntp_read_answer(packet, NTP_LEN, 10 * SECOND_NS, 14 * SECOND_NS, &a), NTP_GOOD);
    assert_int_equal(a.offset_ns, 87 * SECOND_NS + SECOND_NS / 4);
    assert_int_equal(a.delay_ns, SECOND_NS);
    ntp_change_answer(packet, NTP_UNSYNCHRONISE, 0);
    assert_int_equal(ntp_read_answer(packet, NTP_LEN, 10 * SECOND_NS, 14 * SECOND_NS, &a), NTP_UNSYNCHRONISED);
    ntp_change_answer(packet, NTP_DENY, 0);
    assert_int_equal(ntp_read_answer(packet, NTP_LEN, 10 * SECOND_NS, 14 * SECOND_NS, &a), NTP_KISS);
    assert_string_equal(a.kiss, "DENY");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_request_has_its_time), cmocka_unit_test(offset_and_delay),
        cmocka_unit_test(wrong_answers),          cmocka_unit_test(kisses_are_read),
        cmocka_unit_test(answers_are_changed),    cmocka_unit_test(any_bytes_do_no_harm),
    };
    return cmocka_run_group_tests_name("ntp", tests, NULL, NULL);
}
