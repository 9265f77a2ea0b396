/* SPDX-License-Identifier: MIT */
/* Captures whose clients ask for more at once than the device was asked, or for longer things (talk_rig.h). */
#include <string.h>

#include "tests/unit/talk_rig.h"

static struct made m;
static struct client c;

/* From a device that speaks in turns, a second request waits for the answer to the first. */
static void test_pipelined_turns(void **state)
{
    (void)state;
    made_begin(&m);
    made_connect(&m, 0);
    made_say(&m, 10, 0, "a\n");
    made_say(&m, 13, 1, "one\n");
    made_say(&m, 20, 0, "b\n");
    made_say(&m, 22, 1, "two\n");
    client_open(&c, &m, 0, NULL);
    /* a is taken at 0 and answered at 3; b is taken with the tick after that, and answered 2 ms later. */
    assert_string_equal(client_ask(&c, "a\nb\n", 10), "3:one\n|6:two\n|");
    client_close(&c);
}

/* A device that greets its client, and answers one request: the connection's messages and the request's are apart. */
static void test_a_greeting_and_an_answer(void **state)
{
    (void)state;
    made_begin(&m);
    made_connect(&m, 0);
    made_say(&m, 4, 1, "hi\n");
    made_say(&m, 10, 0, "a\n");
    made_say(&m, 13, 1, "one\n");
    client_open(&c, &m, 0, NULL);
    assert_string_equal(client_ask(&c, "", 5), "4:hi\n|");
    assert_non_null(strstr(client_ask(&c, "a\n", 5), ":one\n|"));
    client_close(&c);
}

/* Many more requests than can be answered at a time: none is lost, also where the client sends more than fits. */
static void test_pipelined_flood(void **state)
{
    (void)state;
    static const char request[] = "\x02sRN A\x03";
    enum { LEN = sizeof request - 1, N = 20000 };
    made_begin(&m);
    made_connect(&m, 0);
    made_say(&m, 10, 0, request);
    made_say(&m, 15, 1, "\x02sRA A 1\x03");
    client_open(&c, &m, 0, NULL);
    int sent = 0, answers = 0;
    size_t at = 0; /* in the request that is being sent */
    for (int tick = 0; answers < N && tick < 100 * N; tick++) {
        for (; sent < N && c.ops->takes(c.protocol) != 0; at = at + 1 == LEN ? 0 : at + 1) {
            c.ops->input(c.protocol, (const uint8_t *)request + at, 1);
            sent += at + 1 == LEN;
        }
        client_ask(&c, "", 1);
        for (const char *a = c.got; (a = strstr(a, "sRA A 1")) != NULL; a++)
            answers++;
    }
    assert_int_equal(answers, N);
    assert_int_equal(c.lost + (uint64_t)c.wrong, 0);
    client_close(&c);
}

/* Bytes that never become a request are left out, counted and said, and the next request is answered. */
static void test_endless_request(void **state)
{
    (void)state;
    static uint8_t many[TALK_MAX_REQUEST];
    made_begin(&m);
    made_connect(&m, 0);
    made_say(&m, 10, 0, "a\n");
    made_say(&m, 10, 1, "one\n");
    client_open(&c, &m, 0, NULL);
    memset(many, 'x', sizeof many);
    c.ops->input(c.protocol, many, sizeof many);
    assert_int_equal(c.ops->takes(c.protocol), 0);
    assert_string_equal(client_ask(&c, "", 1), "");
    assert_int_equal(c.lost, sizeof many);
    assert_non_null(strstr(c.told, "65536"));
    assert_string_equal(client_ask(&c, "a\n", 1), "1:one\n|");
    c.ops->input(c.protocol, many, 5);
    client_ask(&c, "", 1);
    assert_int_equal(c.ops->owes(c.protocol), 0); /* no more comes for half a request */
    client_close(&c);
}

/* A message that is longer than a unit may be is sent in parts, which are all of its bytes. */
static void test_long_answer(void **state)
{
    (void)state;
    enum { PARTS = 94, PART = 1400, HEAD = 7, WHOLE = HEAD + PARTS * PART + 1 };
    char part[PART + 1] = "";
    made_begin(&m);
    made_connect(&m, 0);
    made_say(&m, 10, 0, "\x02sRN A\x03");
    made_say(&m, 10, 1, "\x02sRA A ");
    memset(part, 'x', PART);
    for (int i = 0; i < PARTS; i++)
        made_say(&m, 10, 1, part);
    made_say(&m, 10, 1, "\x03");
    client_open(&c, &m, 0, NULL);
    assert_int_equal(strncmp(client_ask(&c, "\x02sRN A\x03", 1), "0:\x02sRA A xxx", 12), 0);
    assert_int_equal(c.n_sent, 3);
    assert_true(c.sent[0] == TALK_MAX_MESSAGE && c.sent[1] == TALK_MAX_MESSAGE);
    assert_int_equal(c.sent[2], WHOLE - 2 * TALK_MAX_MESSAGE);
    assert_int_equal(c.last, 3);
    client_close(&c);
}

/* Two datagrams are two requests, whatever their bytes are together. */
static void test_datagrams_stay_apart(void **state)
{
    (void)state;
    uint8_t frame[ETHERNET_MAX_FRAME];
    made_begin(&m);
    made_add(&m, 10, frame, ethernet_put_udp(frame, &DRIVER, &DEVICE, "PING", 4));
    made_add(&m, 10, frame, ethernet_put_udp(frame, &DEVICE, &DRIVER, "pong", 4));
    client_open(&c, &m, 0, NULL);
    c.ops->input(c.protocol, (const uint8_t *)"PI", 2);
    c.ops->input(c.protocol, (const uint8_t *)"NG", 2);
    assert_string_equal(client_ask(&c, "", 3), "");
    assert_int_equal(c.wrong, 2);
    c.ops->input(c.protocol, (const uint8_t *)"PING", 4);
    c.ops->input(c.protocol, (const uint8_t *)"PING", 4);
    assert_string_equal(client_ask(&c, "", 3), "3:pong|4:pong|");
    client_close(&c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_pipelined_turns), cmocka_unit_test(test_a_greeting_and_an_answer),
        cmocka_unit_test(test_pipelined_flood), cmocka_unit_test(test_endless_request),
        cmocka_unit_test(test_long_answer),     cmocka_unit_test(test_datagrams_stay_apart),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
