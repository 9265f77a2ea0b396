/* SPDX-License-Identifier: MIT */
/* Packets of a capture become flows, and flows the places of devices: which end is the device, what a place's times
 * count from, what is counted, and how many there may be. */
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "tests/unit/talk_rig.h"

static struct made m;
static struct client c;
static uint8_t frame[ETHERNET_MAX_FRAME];

static void say_udp(int64_t t_ms, const struct ethernet_end *from, const struct ethernet_end *to, const char *text)
{
    made_add(&m, t_ms, frame, ethernet_put_udp(frame, from, to, text, strlen(text)));
}

/* Checks the error of a capture that can't be loaded, after its path. */
static void expect_refused(const char *text)
{
    struct replay_capture *capture;
    struct sh_err err = {0};
    const char *path = made_write(&m, m.len);
    assert_true(capture_load(path, NULL, &capture, &err) < 0);
    unlink(path);
    assert_null(capture);
    assert_int_equal(strncmp(err.text, path, strlen(path)), 0);
    assert_string_equal(err.text + strlen(path), text);
}

/* ---- times */

/* Messages of UDP count from the devices' first datagram, whatever a TCP connection or a client has sent before. */
static void datagrams_count_from_the_first_one_of_a_device(void **state)
{
    (void)state;
    const struct ethernet_end other = {.address = {10, 0, 0, 1}, .port = 8308},
                              to = {.address = {10, 0, 0, 2}, .port = 9};
    made_begin(&m);
    made_connect(&m, 0);
    made_say(&m, 2, 1, "early\n");
    say_udp(5, &DRIVER, &DEVICE, "ask");
    say_udp(14, &DEVICE, &DRIVER, "one");
    say_udp(16, &DEVICE, &DRIVER, "two");
    say_udp(17, &other, &to, "three");
    client_open(&c, &m, 2, NULL);
    assert_int_equal(capture_n(c.capture), 3);
    assert_true(capture_duration_s(c.capture) == 0.017);
    assert_int_equal(capture_place(c.capture, 2)->source_port, 8308);
    assert_int_equal(capture_place(c.capture, 2)->port, 9);
    assert_string_equal(capture_place(c.capture, 2)->device, "10.0.0.1");
    assert_int_equal(capture_place(c.capture, 2)->n_messages, 1);
    assert_string_equal(client_ask(&c, "", 9), "3:three|");
    client_close(&c);
    client_open(&c, &m, 0, NULL);
    assert_int_equal(capture_place(c.capture, 0)->is_tcp, 1);
    assert_int_equal(capture_place(c.capture, 0)->port, DEVICE.port);
    assert_string_equal(client_ask(&c, "", 9), "2:early\n|");
    client_close(&c);
}

/* Messages that a device sends unasked are repeated from the first one on, a mean period after the last message. */
static void an_unasked_stream_is_repeated(void **state)
{
    (void)state;
    const struct talk_options again = {.loop = 1};
    made_begin(&m);
    say_udp(100, &DEVICE, &DRIVER, "a");
    say_udp(103, &DEVICE, &DRIVER, "b");
    say_udp(110, &DEVICE, &DRIVER, "c");
    client_open(&c, &m, 0, &again);
    assert_string_equal(client_ask(&c, "", 31), "0:a|3:b|10:c|15:a|18:b|25:c|30:a|");
    client_close(&c);
}

/* ---- flows */

/* A connection that was closed is over, also where nothing was said in it. The next one has the same ports, and its
 * times count from its own begin. */
static void a_closed_connection_is_over(void **state)
{
    (void)state;
    for (int by_reset = 0; by_reset <= 1; by_reset++) {
        made_begin(&m);
        made_connect(&m, 0);
        made_add(&m, 1, frame, by_reset ? tcp_put_reset(&m.talk, 0, frame) : tcp_put_fin(&m.talk, 0, frame));
        made_connect(&m, 1000);
        made_say(&m, 1005, 1, "hello\n");
        client_open(&c, &m, 0, NULL);
        assert_string_equal(client_ask(&c, "", 9), "5:hello\n|");
        client_close(&c);
    }
}

/* A SYN that is sent again begins no other connection. */
static void a_repeated_syn_is_the_same_one(void **state)
{
    (void)state;
    made_begin(&m);
    const struct tcp_talk before = m.talk;
    made_add(&m, 0, frame, tcp_put_syn(&m.talk, 0, frame));
    m.talk = before;
    made_connect(&m, 3);
    made_say(&m, 5, 1, "hello\n");
    client_open(&c, &m, 0, NULL);
    assert_string_equal(client_ask(&c, "", 9), "5:hello\n|");
    client_close(&c);
    assert_int_equal(capture_is("/nowhere/a.pcap"), 0);
}

/* Where the device speaks unasked in two connections, the longer one is played. */
static void the_longest_unasked_stream_is_played(void **state)
{
    (void)state;
    for (int longer = 0; longer < 2; longer++) {
        made_begin(&m);
        for (int i = 0; i < 2; i++) {
            made_connect(&m, 100 * i);
            made_say(&m, 100 * i + 2, 1, i == 0 ? "a1\n" : "b1\n");
            if (i == longer) made_say(&m, 100 * i + 5, 1, i == 0 ? "a2\n" : "b2\n");
            made_add(&m, 100 * i + 9, frame, tcp_put_fin(&m.talk, 1, frame));
        }
        client_open(&c, &m, 0, NULL);
        assert_string_equal(client_ask(&c, "", 9), longer == 0 ? "2:a1\n|5:a2\n|" : "2:b1\n|5:b2\n|");
        client_close(&c);
    }
}

/* Two connections to a port are one place. Its kind follows from the first client that sent something. A request that
 * came in both has an answer of each. */
static void connections_to_a_port_are_one_place(void **state)
{
    (void)state;
    made_begin(&m);
    made_connect(&m, 0); /* its client is silent */
    made_add(&m, 1, frame, tcp_put_fin(&m.talk, 0, frame));
    for (int i = 0; i < 2; i++) {
        made_connect(&m, 10 + 100 * i);
        made_say(&m, 11 + 100 * i, 0, "\x02sRN X\x03");
        made_say(&m, 13 + 100 * i, 1, i == 0 ? "\x02sRA X 1\x03" : "\x02sRA X 2\x03");
        made_add(&m, 14 + 100 * i, frame, tcp_put_fin(&m.talk, 0, frame));
    }
    client_open(&c, &m, 0, NULL);
    assert_int_equal(capture_n(c.capture), 1);
    assert_string_equal(capture_place(c.capture, 0)->talk.kind->name, "CoLa");
    assert_int_equal(capture_place(c.capture, 0)->n_messages, 2);
    assert_int_equal(capture_place(c.capture, 0)->talk.n_requests, 1);
    assert_string_equal(client_ask(&c, "\x02sRN X\x03", 5), "2:\x02sRA X 1\x03|");
    assert_string_equal(client_ask(&c, "\x02sRN X\x03", 5), "7:\x02sRA X 2\x03|");
    client_close(&c);
}

/* The kind shows in the first bytes, which may come in pieces. */
static void a_request_in_pieces_shows_the_kind(void **state)
{
    (void)state;
    made_begin(&m);
    made_connect(&m, 0);
    made_say(&m, 1, 0, "MEAS");
    made_say(&m, 1, 1, "\x01"); /* not the client's */
    made_say(&m, 2, 0, ":VOLT?\n");
    made_say(&m, 4, 1, "1.5\n");
    client_open(&c, &m, 0, NULL);
    assert_string_equal(capture_place(c.capture, 0)->talk.kind->name, "lines");
    assert_string_equal(client_ask(&c, "MEAS:VOLT?\n", 5), "2:1.5\n|");
    client_close(&c);
    made_begin(&m);
    made_connect(&m, 0);
    made_say(&m, 1, 0, "\x02s");
    made_say(&m, 2, 0, "RN X\x03");
    made_say(&m, 4, 1, "\x02sRA X 1\x03");
    client_open(&c, &m, 0, NULL);
    assert_string_equal(capture_place(c.capture, 0)->talk.kind->name, "CoLa");
    assert_string_equal(client_ask(&c, "\x02sRN X\x03", 5), "2:\x02sRA X 1\x03|");
    client_close(&c);
}

/* ---- counts */

static struct capture_counts counts_of(void)
{
    struct capture_counts counts;
    struct replay_capture *capture = made_load(&m);
    capture_get_counts(capture, &counts);
    capture_free(capture);
    return counts;
}

static void packets_of_no_use_are_counted(void **state)
{
    (void)state;
    made_begin(&m);
    say_udp(0, &DEVICE, &DRIVER, "one");
    for (int i = 0; i < 9; i++) {
        const size_t len = ethernet_put_udp(frame, &DEVICE, &DRIVER, "two", 3);
        if (i < 2) frame[14 + 6] |= 0x20;      /* more fragments follow */
        if (i >= 2 && i < 5) frame[14] = 0x41; /* an IP header of 4 bytes */
        if (i >= 5) frame[14 + 9] = 1;         /* ICMP */
        made_add(&m, 1, frame, len);
    }
    const struct capture_counts counts = counts_of();
    assert_true(counts.packets == 10 && counts.fragments == 2 && counts.damaged == 3 && counts.others == 4);
    assert_true(counts.backward == 0 && counts.untimed == 0 && counts.unknown_links == 0 && counts.missing_bytes == 0);
}

/* With its begin, a stream's first byte is known; without it, the first byte that is there counts as the first. */
static void missing_bytes_are_counted_from_the_begin(void **state)
{
    (void)state;
    for (int has_begin = 0; has_begin <= 1; has_begin++) {
        made_begin(&m);
        if (has_begin) made_connect(&m, 0);
        m.talk.next[1] += 3;
        made_say(&m, 1, 1, "one\n");
        m.talk.next[1] += 5;
        made_say(&m, 2, 1, "two\n");
        assert_int_equal(counts_of().missing_bytes, has_begin ? 8 : 5);
    }
}

/* ---- limits */

static void there_are_1000_connections_at_most(void **state)
{
    (void)state;
    struct ethernet_end from = DRIVER;
    made_begin(&m);
    say_udp(0, &DEVICE, &DRIVER, "one");
    for (int i = 1; i < 1000; i++) {
        from.port = (uint16_t)(1000 + i);
        say_udp(0, &from, &DEVICE, "x");
    }
    from.port = DRIVER.port;
    say_udp(0, &DRIVER, &DEVICE, "x"); /* belongs to the first one */
    say_udp(0, &DEVICE, &DRIVER, "x");
    struct replay_capture *capture = made_load(&m);
    assert_int_equal(capture_n(capture), 2); /* the others went from many ports to one port */
    capture_free(capture);
    from.port = 50000;
    say_udp(0, &from, &DEVICE, "x");
    expect_refused(": too many connections; allowed are up to 1000; a filter of tcpdump or Wireshark makes a smaller "
                   "file");
}

static void there_are_64_places_at_most(void **state)
{
    (void)state;
    struct ethernet_end to = DRIVER;
    made_begin(&m);
    for (int i = 0; i < 65; i++) {
        if (i == 64) {
            struct replay_capture *capture = made_load(&m);
            assert_int_equal(capture_n(capture), 64);
            assert_int_equal(capture_place(capture, 63)->port, 1063);
            capture_free(capture);
        }
        to.port = (uint16_t)(1000 + i);
        say_udp(i, &DEVICE, &to, "x");
    }
    expect_refused(": too many ports of devices; allowed are up to 64");
}

static void times_have_limits(void **state)
{
    (void)state;
    made_begin(&m);
    say_udp(0, &DEVICE, &DRIVER, "one");
    say_udp(INT64_C(10000000000), &DEVICE, &DRIVER, "two"); /* 10^16 ns */
    assert_true(counts_of().packets == 2);
    say_udp(INT64_C(10000000001), &DEVICE, &DRIVER, "three");
    expect_refused(": packet 3 comes 1e+07 s after the first; allowed are up to 1e+07 s");
    made_begin(&m);
    made_connect(&m, 0);
    expect_refused(": no device sends anything in its 3 packets; required is TCP or UDP with data, or a recording of a "
                   "head");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(datagrams_count_from_the_first_one_of_a_device),
        cmocka_unit_test(an_unasked_stream_is_repeated),
        cmocka_unit_test(a_closed_connection_is_over),
        cmocka_unit_test(a_repeated_syn_is_the_same_one),
        cmocka_unit_test(the_longest_unasked_stream_is_played),
        cmocka_unit_test(connections_to_a_port_are_one_place),
        cmocka_unit_test(a_request_in_pieces_shows_the_kind),
        cmocka_unit_test(packets_of_no_use_are_counted),
        cmocka_unit_test(missing_bytes_are_counted_from_the_begin),
        cmocka_unit_test(there_are_1000_connections_at_most),
        cmocka_unit_test(there_are_64_places_at_most),
        cmocka_unit_test(times_have_limits),
    };
    return cmocka_run_group_tests_name("capture, flows", tests, NULL, NULL);
}
