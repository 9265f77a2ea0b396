/* SPDX-License-Identifier: MIT */
/* Captures that answer, where bytes, times or a client are not as one expects (talk_rig.h). */
#include <string.h>
#include <unistd.h>

#include "drivers/protocol/pcapng.h"
#include "tests/common/free_fd.h"
#include "tests/unit/talk_rig.h"

static struct made m;
static struct client c;

/* ---- which protocol it is */

static const char *kind_of(const char *first)
{
    return talk_kind_of((const uint8_t *)first, strlen(first))->name;
}

static void test_kinds(void **state)
{
    (void)state;
    static const char *const scip[] = {"BM\n",  "VV;abc\r\n", "MD0044072501000\n", "%MD0044072501000\n",
                                       "TM0\n", "SCIP2.0\n",  "SS019200\n",        "GE00000000\n"},
                             *const simulation[] = {"%ST\n", "%SL\r\n", "DB02\n"};
    static const char *const lines[] = {"MEAS:VOLT?\n", "HEAD:STORe\n", "SSH-2.0-x\r\n", "PPS\n",
                                        "RST\n",        "GET x\n",      "ST\n",          "%VV\n"};
    for (size_t i = 0; i < sizeof scip / sizeof *scip; i++)
        assert_string_equal(kind_of(scip[i]), "SCIP");
    for (size_t i = 0; i < sizeof simulation / sizeof *simulation; i++)
        assert_string_equal(kind_of(simulation[i]), "SCIP");
    for (size_t i = 0; i < sizeof lines / sizeof *lines; i++)
        assert_string_equal(kind_of(lines[i]), "lines");
    assert_string_equal(kind_of("GET / HTTP/1.1\r\nHost: x\r\n\r\n"), "bytes");
    assert_string_equal(kind_of("HEAD /CR0 HTTP/1.0\r\n\r\n"), "bytes");
    assert_string_equal(talk_kind_of((const uint8_t *)"\0\0\0\5\n", 5)->name, "bytes");
    assert_string_equal(talk_kind_of((const uint8_t *)"a\0b\n", 4)->name, "bytes"); /* NUL is no text */
}

/* A client that sends nothing gets nothing. */
static void test_http(void **state)
{
    (void)state;
    made_begin(&m);
    made_connect(&m, 0);
    made_say(&m, 5, 0, "GET / HTTP/1.1\r\n\r\n");
    made_say(&m, 7, 1, "HTTP/1.1 200 OK\r\n\r\n");
    client_open(&c, &m, 0, NULL);
    assert_string_equal(client_ask(&c, "", 20), "");
    assert_string_equal(client_ask(&c, "GET / HTTP/1.1\r\n\r\n", 5), "22:HTTP/1.1 200 OK\r\n\r\n|");
    client_close(&c);
}

/* ---- times */

/* All packets have one time: the order of the file says which answer belongs to which request. */
static void test_equal_times(void **state)
{
    (void)state;
    made_begin(&m);
    made_connect(&m, 9);
    made_say(&m, 9, 0, "a\n");
    made_say(&m, 9, 1, "one\n");
    made_say(&m, 9, 0, "b\n");
    made_say(&m, 9, 1, "two\n");
    client_open(&c, &m, 0, NULL);
    assert_string_equal(client_ask(&c, "a\n", 2), "0:one\n|");
    assert_string_equal(client_ask(&c, "b\n", 2), "2:two\n|");
    client_close(&c);
}

/* The clock is set back by an hour between two requests: delays stay as they were. A packet that comes 1 ms early in
 * the file, as from two processors, is no step. */
static void test_clock_steps(void **state)
{
    (void)state;
    const int64_t hour_ms = 3600000;
    struct capture_counts counts;
    made_begin(&m);
    made_connect(&m, hour_ms);
    made_say(&m, hour_ms + 10, 0, "a\n");
    made_say(&m, hour_ms + 13, 1, "one\n");
    made_say(&m, 20, 0, "b\n");
    made_say(&m, 25, 1, "two\n");
    made_say(&m, 24, 1, "three\n");
    made_say(&m, 28, 1, "four\n");
    client_open(&c, &m, 0, NULL);
    capture_get_counts(c.capture, &counts);
    assert_int_equal(counts.backward, 2);
    assert_int_equal(counts.untimed, 0);
    assert_string_equal(client_ask(&c, "a\n", 5), "3:one\n|");
    assert_string_equal(client_ask(&c, "b\n", 10), "10:two\n|10:three\n|13:four\n|");
    client_close(&c);
}

/* A Simple Packet Block has no time: type 3, length, the packet's length, its bytes, length. */
static void made_add_simple(const uint8_t *frame, size_t len)
{
    const uint32_t whole = (uint32_t)(16 + (len + 3) / 4 * 4), head[3] = {3, whole, (uint32_t)len};
    assert_true(m.len + whole < sizeof m.bytes);
    memset(m.bytes + m.len, 0, whole);
    memcpy(m.bytes + m.len, head, sizeof head); /* little-endian, as this machine */
    memcpy(m.bytes + m.len + sizeof head, frame, len);
    memcpy(m.bytes + m.len + whole - 4, &whole, 4);
    m.len += whole;
}

static void test_without_times(void **state)
{
    (void)state;
    uint8_t frame[ETHERNET_MAX_FRAME];
    struct capture_counts counts;
    made_begin(&m);
    made_add_simple(frame, tcp_put_syn(&m.talk, 0, frame));
    made_add_simple(frame, tcp_put_syn(&m.talk, 1, frame));
    made_add_simple(frame, tcp_put_data(&m.talk, 0, "a\n", 2, frame));
    made_add_simple(frame, tcp_put_data(&m.talk, 1, "one\n", 4, frame));
    /* The date of the first time is no delay. */
    made_say(&m, INT64_C(1700000000000), 0, "b\n");
    made_say(&m, INT64_C(1700000000004), 1, "two\n");
    client_open(&c, &m, 0, NULL);
    capture_get_counts(c.capture, &counts);
    assert_int_equal(counts.untimed, 4);
    assert_string_equal(client_ask(&c, "a\n", 2), "0:one\n|");
    assert_string_equal(client_ask(&c, "b\n", 5), "6:two\n|");
    client_close(&c);
}

/* Times of two interfaces are compared with the offset that each interface adds (if_tsoffset, code 14). */
static void test_time_offsets(void **state)
{
    (void)state;
    struct replay_capture *capture;
    struct sh_err err = {0};
    /* length 32, microseconds, 4 s less than its times say; little-endian, as this machine */
    const uint32_t interface[8] = {1, 32, PCAPNG_ETHERNET, 0, 14 | 8 << 16, (uint32_t)-4, UINT32_MAX, 32};
    uint8_t frame[ETHERNET_MAX_FRAME];
    made_begin(&m);
    made_connect(&m, 0);
    made_say(&m, 1000, 0, "a\n");
    memcpy(m.bytes + m.len, interface, sizeof interface);
    m.len += sizeof interface;
    m.len += pcapng_put_packet(m.bytes + m.len, 1, 5004000, frame, tcp_put_data(&m.talk, 1, "one\n", 4, frame), 0);
    const size_t len = m.len;
    client_open(&c, &m, 0, NULL);
    assert_string_equal(client_ask(&c, "a\n", 5), "4:one\n|");
    client_close(&c);
    m.len = len + pcapng_put_packet(m.bytes + len, 1, 3999999, frame, 60, 0);
    const char *path = made_write(&m, m.len);
    assert_int_equal(capture_load(path, NULL, &capture, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "packet 6 has a time before 1970; allowed are"));
    unlink(path);
}

/* ---- files */

/* A capture is known by its bytes, also where its first block is long. Section header: type, length, magic, version
 * 1.0, section length -1, an option 1 (comment) of 60,000 bytes, end of options, length. */
static void test_long_front(void **state)
{
    (void)state;
    enum { COMMENT = 60000, WHOLE = 12 + 16 + 4 + COMMENT + 4 };
    const uint32_t head[7] = {0x0a0d0d0a, WHOLE, 0x1a2b3c4d, 1, 0xffffffff, 0xffffffff, 1 | (uint32_t)COMMENT << 16},
                   whole = WHOLE;
    memset(&m, 0, sizeof m);
    memcpy(m.bytes, head, sizeof head); /* little-endian, as this machine */
    memcpy(m.bytes + WHOLE - 4, &whole, 4);
    m.len = WHOLE + pcapng_put_interface(m.bytes + WHOLE, PCAPNG_ETHERNET, 0, NULL, NULL);
    assert_int_equal(capture_is(made_write(&m, m.len)), 1);
    assert_int_equal(capture_is(made_write(&m, WHOLE)), 0); /* no interface says which packets it has */
    m.len = WHOLE + pcapng_put_interface(m.bytes + WHOLE, PCAPNG_USER0, 0, NULL, NULL);
    const char *path = made_write(&m, m.len);
    assert_int_equal(capture_is(path), 0);
    unlink(path);
}

/* No file stays open, whether it is a capture, is none, or is damaged. */
static void test_files_are_closed(void **state)
{
    (void)state;
    static const uint8_t junk[64] = {0x0a, 0x0d, 0x0d, 0x0a};
    const int before = free_fd();
    for (int kind = 0; kind < 3; kind++) {
        struct replay_capture *capture = NULL;
        struct sh_err err = {0};
        made_begin(&m);
        made_connect(&m, 3);
        made_say(&m, 5, 1, "hello\n");
        if (kind == 1) memcpy(m.bytes, junk, sizeof junk);
        const char *path = made_write(&m, kind == 2 ? 0 : m.len);
        assert_int_equal(capture_is(path), kind == 0);
        assert_int_equal(free_fd(), before);
        assert_int_equal(capture_load(path, NULL, &capture, &err) == SH_OK, kind == 0);
        assert_int_equal(free_fd(), before);
        capture_free(capture);
        unlink(path);
    }
}

/* Packets of a link type that is not read are left out; where nothing else is there, the file is refused. */
static void test_unknown_link(void **state)
{
    (void)state;
    struct capture_counts counts;
    struct replay_capture *capture;
    struct sh_err err = {0};
    const uint8_t junk[20] = {0};
    made_begin(&m);
    m.len += pcapng_put_interface(m.bytes + m.len, (enum pcapng_link)220, 0, NULL, NULL);
    m.len += pcapng_put_packet(m.bytes + m.len, 1, 0, junk, sizeof junk, 0);
    const char *path = made_write(&m, m.len);
    assert_int_equal(capture_load(path, NULL, &capture, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "link type 220; allowed are Ethernet (1)"));
    made_connect(&m, 0);
    made_say(&m, 1, 1, "hello");
    capture = made_load(&m);
    capture_get_counts(capture, &counts);
    assert_int_equal(counts.unknown_links, 1);
    assert_int_equal(capture_n(capture), 1);
    capture_free(capture);
}

static int ask_to_stop(void *ctx)
{
    return --*(int *)ctx < 0;
}

/* The load of a capture ends where the caller asks for it, at whichever step that is. */
static void test_stopped(void **state)
{
    (void)state;
    made_begin(&m);
    made_connect(&m, 0);
    made_say(&m, 1, 0, "a\n");
    made_say(&m, 2, 1, "one\n");
    const char *path = made_write(&m, m.len);
    int stopped = 0;
    for (int rc = SH_ESTOPPED; rc == SH_ESTOPPED; stopped++) {
        int left = stopped;
        const struct sh_report report = {.ctx = &left, .stop = ask_to_stop};
        struct replay_capture *capture;
        struct sh_err err = {0};
        rc = capture_load(path, &report, &capture, &err);
        assert_true(rc == SH_OK || (rc == SH_ESTOPPED && err.text[0] != '\0' && capture == NULL));
        capture_free(capture);
    }
    unlink(path);
    assert_true(stopped > 5 + 2); /* 5 packets and 2 messages, at least */
}

/* ---- streams */

/* The capture begins within a connection, and the first two segments of the answer are in the wrong order. */
static void test_swapped_beginning(void **state)
{
    (void)state;
    uint8_t first[ETHERNET_MAX_FRAME], second[ETHERNET_MAX_FRAME];
    struct capture_counts counts;
    made_begin(&m);
    made_say(&m, 0, 0, "GD0000000000\n");
    const size_t first_len = tcp_put_data(&m.talk, 1, "GD0000000000\n00P\n", 17, first);
    const size_t second_len = tcp_put_data(&m.talk, 1, "1234\n\n", 6, second);
    made_add(&m, 1, second, second_len);
    made_add(&m, 2, first, first_len);
    client_open(&c, &m, 0, NULL);
    capture_get_counts(c.capture, &counts);
    assert_int_equal(counts.missing_bytes, 0);
    assert_string_equal(client_ask(&c, "GD0000000000\n", 5), "2:GD0000000000\n00P\n1234\n\n|");
    client_close(&c);
}

/* The capture has cut off the first and the last packet of the answer, and one down to its headers. Before that one a
 * packet was lost. Another cut packet came again as a whole. Each byte that is missing counts once. */
static void test_cut_packets(void **state)
{
    (void)state;
    uint8_t frame[ETHERNET_MAX_FRAME], whole[ETHERNET_MAX_FRAME];
    struct capture_counts counts;
    made_begin(&m);
    made_connect(&m, 0);
    made_say(&m, 0, 0, "a\n");
    made_add(&m, 1, frame, tcp_put_data(&m.talk, 1, "one, two\n", 9, frame) - 4); /* "two\n" is missing */
    made_say(&m, 2, 1, "three\n");
    const size_t len = tcp_put_data(&m.talk, 1, "four\n", 5, whole);
    made_add(&m, 3, whole, len - 3);
    made_add(&m, 3, whole, len);
    tcp_put_data(&m.talk, 1, "lost...", 7, frame);
    made_add(&m, 4, frame, tcp_put_data(&m.talk, 1, "five\n", 5, frame) - 5);
    made_say(&m, 5, 1, "six\n");
    made_add(&m, 6, frame, tcp_put_data(&m.talk, 1, "seven\n", 6, frame) - 1);
    client_open(&c, &m, 0, NULL);
    capture_get_counts(c.capture, &counts);
    assert_int_equal(counts.missing_bytes, 4 + 7 + 5 + 1);
    client_close(&c);
}

/* Datagrams have no numbers: what was cut off them counts. */
static void test_cut_datagrams(void **state)
{
    (void)state;
    uint8_t frame[ETHERNET_MAX_FRAME];
    struct capture_counts counts;
    made_begin(&m);
    made_add(&m, 0, frame, ethernet_put_udp(frame, &DEVICE, &DRIVER, "one", 3) - 2);
    made_add(&m, 1, frame, ethernet_put_udp(frame, &DEVICE, &DRIVER, "two", 3));
    made_add(&m, 2, frame, ethernet_put_udp(frame, &DEVICE, &DRIVER, "three", 5) - 5);
    client_open(&c, &m, 0, NULL);
    capture_get_counts(c.capture, &counts);
    assert_int_equal(counts.missing_bytes, 2 + 5);
    client_close(&c);
}

/* LMCstopmeas ends scans, and no other event; LMCstartmeas begins them again. mSCreboot ends all. */
static void test_scans_stop(void **state)
{
    (void)state;
    const struct talk_options again = {.loop = 1};
    made_begin(&m);
    made_connect(&m, 0);
    made_say(&m, 0, 0, "\x02sEN Odd 1\x03");
    made_say(&m, 4, 1, "\x02sSN Odd 1\x03");
    made_say(&m, 8, 1, "\x02sSN Odd 2\x03");
    made_say(&m, 10, 0, "\x02sEN LMDscandata 1\x03");
    made_say(&m, 11, 1, "\x02sSN LMDscandata 1\x03");
    made_say(&m, 13, 1, "\x02sSN LMDscandata 2\x03");
    made_say(&m, 14, 0, "\x02sMN LMCstopmeas\x03");
    made_say(&m, 15, 0, "\x02sMN LMCstartmeas\x03");
    made_say(&m, 20, 1, "\x02sSN LMDscandata 3\x03");
    client_open(&c, &m, 0, &again);
    client_ask(&c, "\x02sEN Odd 1\x03\x02sEN LMDscandata 1\x03", 4);
    assert_non_null(strstr(c.got, "1:\x02sSN LMDscandata 1\x03|3:\x02sSN LMDscandata 2\x03|"));
    client_ask(&c, "\x02sMN LMCstopmeas\x03", 20);
    assert_null(strstr(c.got, "LMDscandata"));
    assert_non_null(strstr(c.got, "Odd 2"));
    client_ask(&c, "\x02sMN LMCstartmeas\x03", 6);
    assert_non_null(strstr(c.got, "29:\x02sSN LMDscandata 3\x03|"));
    assert_string_equal(client_ask(&c, "\x02sMN mSCreboot\x03", 20), "");
    client_close(&c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_kinds),
        cmocka_unit_test(test_http),
        cmocka_unit_test(test_equal_times),
        cmocka_unit_test(test_clock_steps),
        cmocka_unit_test(test_without_times),
        cmocka_unit_test(test_time_offsets),
        cmocka_unit_test(test_cut_packets),
        cmocka_unit_test(test_cut_datagrams),
        cmocka_unit_test(test_swapped_beginning),
        cmocka_unit_test(test_scans_stop),
        cmocka_unit_test(test_long_front),
        cmocka_unit_test(test_files_are_closed),
        cmocka_unit_test(test_unknown_link),
        cmocka_unit_test(test_stopped),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
