/* SPDX-License-Identifier: MIT */
/* Captures that answer (talk_rig.h). */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "tests/unit/talk_rig.h"

static struct made m;
static struct client c;

/* A CoLa connection: an answer after 3 ms and another to the same request, a stream of 10 ms, an event that nobody
 * asked for, and an answer within the stream. */
static void make_cola(void)
{
    made_begin(&m);
    made_connect(&m, 1000);
    made_say(&m, 1010, 0, "\x02sRN A\x03");
    made_say(&m, 1013, 1, "\x02sRA A 1\x03");
    made_say(&m, 1015, 1, "\x02sSN Odd 7\x03");
    made_say(&m, 1020, 0, "\x02sRN A\x03");
    made_say(&m, 1021, 1, "\x02sRA A 2\x03");
    made_say(&m, 1030, 0, "\x02sEN S 1\x03");
    made_say(&m, 1032, 1, "\x02sEA S 1\x03");
    made_say(&m, 1040, 1, "\x02sSN S 1\x03");
    made_say(&m, 1050, 1, "\x02sSN S 2\x03");
    made_say(&m, 1052, 0, "\x02sRN B\x03");
    made_say(&m, 1060, 1, "\x02sSN S 3\x03");
    made_say(&m, 1061, 1, "\x02sFA 3\x03");
}

static void test_answers_and_streams(void **state)
{
    (void)state;
    make_cola();
    client_open(&c, &m, 0, NULL);
    c.ops->open(c.protocol, 0); /* opened again for the same client; the connection does not begin anew */
    assert_int_equal(capture_n(c.capture), 1);
    const struct capture_place *place = capture_place(c.capture, 0);
    assert_true(fabs(capture_duration_s(c.capture) - 0.061) < 1e-12); /* from 1000 to 1061 ms */
    assert_int_equal(place->port, 2112);
    assert_string_equal(place->device, "10.0.0.1");
    assert_string_equal(place->talk.kind->name, "CoLa");
    assert_int_equal(place->talk.n_requests, 3);
    /* At 15 ms of the connection comes what nobody asked for. */
    assert_string_equal(client_ask(&c, "", 14), "");
    assert_string_equal(client_ask(&c, "", 2), "15:\x02sSN Odd 7\x03|");
    /* The answers in their order; then the last one again. The request is taken at 16. */
    assert_string_equal(client_ask(&c, "\x02sRN A\x03", 4), "19:\x02sRA A 1\x03|");
    assert_string_equal(client_ask(&c, "\x02sRN A\x03", 4), "21:\x02sRA A 2\x03|");
    assert_string_equal(client_ask(&c, "\x02sRN A\x03", 6), "25:\x02sRA A 2\x03|");
    assert_int_equal(c.now_ms, 30);
    assert_string_equal(client_ask(&c, "\x02sEN S 1\x03", 15), "32:\x02sEA S 1\x03|40:\x02sSN S 1\x03|");
    /* The stream goes on beside an answer, which had taken 9 ms. */
    assert_string_equal(client_ask(&c, "\x02sRN B\x03", 10), "50:\x02sSN S 2\x03|54:\x02sFA 3\x03|");
    /* A stop that the capture does not have still stops; and it has no answer. */
    assert_string_equal(client_ask(&c, "\x02sEN S 0\x03", 20), "");
    assert_int_equal(c.wrong, 1);
    assert_string_equal(c.told, "the capture has no such request: sEN S");
    assert_int_equal(c.ops->next_ns(c.protocol), INT64_MAX);
    client_close(&c);
}

static void test_loop_and_unknown(void **state)
{
    (void)state;
    const struct talk_options again = {.unknown = TALK_ERROR, .loop = 1}, close = {.unknown = TALK_CLOSE};
    make_cola();
    client_open(&c, &m, 0, &again);
    /* The events S have a mean period of 10 ms: after 3 at 30 ms, 1 comes at 40 ms. The one odd event has no period,
     * and is not repeated. */
    assert_string_equal(client_ask(&c, "\x02sEN S 1\x03", 52),
                        "2:\x02sEA S 1\x03|10:\x02sSN S 1\x03|15:\x02sSN Odd 7\x03|20:\x02sSN S 2\x03|30:\x02sSN S "
                        "3\x03|40:\x02sSN S 1\x03|50:\x02sSN S 2\x03|");
    /* Errors as COLA.md has them: 3 no such variable, 2 no such method. */
    assert_string_equal(client_ask(&c, "\x02sRN Z\x03", 2), "52:\x02sFA 3\x03|");
    assert_string_equal(client_ask(&c, "\x02sMN Z\x03", 2), "54:\x02sFA 2\x03|");
    client_close(&c);
    client_open(&c, &m, 0, &close);
    assert_string_equal(client_ask(&c, "\x02sRN Z\x03\x02sRN Y\x03", 20), "");
    assert_int_equal(c.ended, 1);
    assert_int_equal(c.lost, 7); /* the second request: the connection is over */
    client_close(&c);
}

/* Segments of an answer come in the wrong order, one twice and one with bytes that came before. */
static void test_segments_in_order(void **state)
{
    (void)state;
    static uint8_t frame[3][ETHERNET_MAX_FRAME];
    size_t len[3];
    made_begin(&m);
    made_connect(&m, 0);
    made_say(&m, 10, 0, "GD0000000000\n");
    static const char *const parts[3] = {"GD0000000000\n00", "P\n123", "4\n\n"};
    for (int i = 0; i < 3; i++)
        len[i] = tcp_put_data(&m.talk, 1, parts[i], strlen(parts[i]), frame[i]);
    uint8_t over[ETHERNET_MAX_FRAME]; /* the last three bytes of the middle, and the first of the end */
    m.talk.next[1] -= 6;
    const size_t over_len = tcp_put_data(&m.talk, 1, "1234", 4, over);
    made_add(&m, 12, frame[0], len[0]);
    made_add(&m, 13, frame[2], len[2]);
    made_add(&m, 14, frame[0], len[0]);
    made_add(&m, 15, over, over_len);
    made_add(&m, 17, frame[1], len[1]);
    client_open(&c, &m, 0, NULL);
    struct capture_counts counts;
    capture_get_counts(c.capture, &counts);
    assert_int_equal(counts.missing_bytes, 0);
    assert_string_equal(client_ask(&c, "GD0000000000\n", 5), "2:GD0000000000\n00P\n1234\n\n|");
    client_close(&c);
}

/* SCIP: the stream's messages have a status 99 and count down; a scan that is asked for alone is an answer. */
static void test_scip(void **state)
{
    (void)state;
    made_begin(&m);
    made_connect(&m, 0);
    made_say(&m, 0, 0, "BM\n");
    made_say(&m, 1, 1, "BM\n00P\n\n");
    made_say(&m, 5, 0, "MD0000001000002\n");
    made_say(&m, 6, 1, "MD0000001000002\n00P\n\nMD0000001000001\n99b\nx\n\n");
    made_say(&m, 30, 1, "MD0000001000000\n99b\ny\n\n");
    client_open(&c, &m, 0, NULL);
    assert_string_equal(capture_place(c.capture, 0)->talk.kind->name, "SCIP");
    assert_int_equal(capture_place(c.capture, 0)->talk.n_requests, 2);
    assert_string_equal(client_ask(&c, "BM\n", 5), "1:BM\n00P\n\n|");
    assert_string_equal(client_ask(&c, "MD0000001000002\n", 10),
                        "6:MD0000001000002\n00P\n\n|6:MD0000001000001\n99b\nx\n\n|");
    assert_string_equal(client_ask(&c, "QT\n", 30), ""); /* it ends the stream */
    client_close(&c);
}

/* A protocol that is not known: what the device says until the next request belongs to the one before. */
static void test_turns(void **state)
{
    (void)state;
    made_begin(&m);
    made_connect(&m, 0);
    made_say(&m, 2, 1, "\xffhello");
    made_say(&m, 10, 0, "\x01\x02");
    made_say(&m, 12, 1, "one");
    made_say(&m, 19, 1, "more");
    made_say(&m, 20, 0, "\x01\x02\x03");
    made_say(&m, 21, 1, "two");
    client_open(&c, &m, 0, NULL);
    assert_string_equal(capture_place(c.capture, 0)->talk.kind->name, "bytes");
    assert_string_equal(client_ask(&c, "", 10), "2:\xffhello|");
    assert_string_equal(client_ask(&c, "\x01\x02", 4), "12:one|");
    assert_string_equal(client_ask(&c, "\x01\x02\x03", 10), "15:two|"); /* and no "more", whose turn is over */
    client_close(&c);
}

/* Where nothing shows a request's end, the longest one of the capture that the bytes begin with is taken. A beginning
 * of one waits for its rest. Other bytes are one unknown request. A request waits until the answer before it has begun.
 */
static void test_requests_without_ends(void **state)
{
    (void)state;
    made_begin(&m);
    made_connect(&m, 0);
    made_say(&m, 10, 0, "\x01\x02");
    made_say(&m, 11, 1, "one");
    made_say(&m, 20, 0, "\x01\x02\x03");
    made_say(&m, 21, 1, "two");
    made_say(&m, 30, 0, "\x07\x08\x09");
    made_say(&m, 31, 1, "three");
    client_open(&c, &m, 0, NULL);
    assert_string_equal(client_ask(&c, "\x07\x08", 3), "");
    assert_int_equal(c.ops->next_ns(c.protocol), INT64_MAX); /* it waits for bytes, not for time */
    assert_string_equal(client_ask(&c, "\x09", 3), "4:three|");
    assert_string_equal(client_ask(&c, "\x01\x02\x07\x08\x09", 5), "7:one|9:three|");
    assert_string_equal(client_ask(&c, "\x01\x02\x03\x01\x02", 5), "12:two|14:one|");
    assert_int_equal(c.wrong, 0);
    assert_string_equal(client_ask(&c, "\x01\x09\x01\x02", 5), "");
    assert_int_equal(c.wrong, 1);
    assert_string_equal(c.told, "the capture has no such request: 01 09 01 02 ");
    client_close(&c);
}

/* Datagrams of two ports keep their times to each other. */
static void test_datagrams(void **state)
{
    (void)state;
    uint8_t frame[ETHERNET_MAX_FRAME];
    struct ethernet_end from = {.address = {192, 168, 1, 201}, .port = 2368}, to = {.address = {255, 255, 255, 255}};
    made_begin(&m);
    to.port = 2368;
    made_add(&m, 100, frame, ethernet_put_udp(frame, &from, &to, "data1", 5));
    made_add(&m, 103, frame, ethernet_put_udp(frame, &from, &to, "data2", 5));
    from.port = to.port = 8308;
    made_add(&m, 107, frame, ethernet_put_udp(frame, &from, &to, "place", 5));
    client_open(&c, &m, 0, NULL);
    assert_int_equal(capture_n(c.capture), 2);
    assert_int_equal(capture_place(c.capture, 0)->port, 2368);
    assert_int_equal(capture_place(c.capture, 1)->source_port, 8308);
    assert_string_equal(client_ask(&c, "", 9), "0:data1|3:data2|");
    client_close(&c);
    client_open(&c, &m, 1, NULL);
    assert_string_equal(client_ask(&c, "", 9), "7:place|");
    client_close(&c);
}

/* A device that is asked in datagrams, and answers each. */
static void test_asked_datagrams(void **state)
{
    (void)state;
    uint8_t frame[ETHERNET_MAX_FRAME];
    made_begin(&m);
    made_add(&m, 10, frame, ethernet_put_udp(frame, &DRIVER, &DEVICE, "ask", 3));
    made_add(&m, 14, frame, ethernet_put_udp(frame, &DEVICE, &DRIVER, "one", 3));
    made_add(&m, 20, frame, ethernet_put_udp(frame, &DRIVER, &DEVICE, "ask", 3));
    made_add(&m, 21, frame, ethernet_put_udp(frame, &DEVICE, &DRIVER, "two", 3));
    client_open(&c, &m, 0, NULL);
    assert_int_equal(capture_n(c.capture), 1);
    assert_int_equal(capture_place(c.capture, 0)->port, DRIVER.port);
    c.ops->input(c.protocol, (const uint8_t *)"ask", 3);
    assert_string_equal(client_ask(&c, "", 6), "4:one|");
    c.ops->input(c.protocol, (const uint8_t *)"ask", 3);
    assert_string_equal(client_ask(&c, "", 6), "7:two|");
    client_close(&c);
}

/* Every third beginning of a file, and files with a byte changed: they load, or are refused in one line. */
static void test_hostile(void **state)
{
    (void)state;
    static struct made changed;
    make_cola();
    int refused = 0, loaded = 0;
    for (size_t i = 0; i < m.len; i += 3) {
        for (int how = 0; how < 2; how++) {
            struct replay_capture *capture = NULL;
            struct sh_err err = {0};
            changed = m;
            if (how == 1) changed.bytes[i] ^= 0x55;
            const int rc = capture_load(made_write(&changed, how == 0 ? i : m.len), NULL, &capture, &err);
            refused += rc != SH_OK;
            loaded += rc == SH_OK;
            assert_true((rc == SH_OK) == (capture != NULL));
            if (rc != SH_OK) assert_true(err.text[0] != '\0' && strchr(err.text, '\n') == NULL);
            capture_free(capture);
        }
    }
    unlink(made_write(&m, m.len));
    assert_true(refused > 100 && loaded > 100);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_answers_and_streams),
        cmocka_unit_test(test_loop_and_unknown),
        cmocka_unit_test(test_segments_in_order),
        cmocka_unit_test(test_scip),
        cmocka_unit_test(test_turns),
        cmocka_unit_test(test_requests_without_ends),
        cmocka_unit_test(test_datagrams),
        cmocka_unit_test(test_asked_datagrams),
        cmocka_unit_test(test_hostile),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
