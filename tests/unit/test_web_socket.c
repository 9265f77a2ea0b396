/* SPDX-License-Identifier: MIT */
/* Frames of a client that break RFC 6455, and those that keep it, and the code with which its session ends. */
#include <sys/socket.h>
#include <stdio.h>
#include <string.h>

#include "tests/unit/web_rig.h"

#define MASK "\0\0\0\0"
#define CASE(bytes, code)              \
    {                                  \
        bytes, sizeof(bytes) - 1, code \
    }

static const struct {
    const char *bytes;
    size_t len;
    int code; /* -1: the close frame has none; 0: there is none */
} ends[] = {
    CASE("\xc1\x85" MASK "*IDN?", 1002),                             /* reserved bits */
    CASE("\xa1\x85" MASK "*IDN?", 1002),                             /* */
    CASE("\x91\x85" MASK "*IDN?", 1002),                             /* */
    CASE("\x83\x80" MASK, 1002),                                     /* reserved codes */
    CASE("\x87\x80" MASK, 1002),                                     /* */
    CASE("\x8b\x80" MASK, 1002),                                     /* */
    CASE("\x8f\x80" MASK, 1002),                                     /* */
    CASE("\x09\x80" MASK, 1002),                                     /* a ping in pieces */
    CASE("\x89\xfe\x00\x7e" MASK, 0),                                /* one of 126 bytes */
    CASE("\x80\x81" MASK "x", 1002),                                 /* more of no message */
    CASE("\x01\x81" MASK "x\x81\x81" MASK "y", 1002),                /* a message within another */
    CASE("\x81\xff\xff\xff\xff\xff\xff\xff\xff\xff" MASK, 0),        /* 2^64 - 1 bytes: the highest bit is 0 */
    CASE("\x81\xff\x7f\xff\xff\xff\xff\xff\xff\xff" MASK "x", 1009), /* 2^63 - 1 bytes */
    CASE("\x81\xfe\x10\x01" MASK "x", 1009),                         /* 4,097 bytes */
    CASE("\x01\x81" MASK "x\x80\xfe\x10\x00" MASK "x", 1009),        /* the same in pieces */
    CASE("\x82\x80" MASK, 1003),                                     /* not text */
    CASE("\x81\x82" MASK "\xff\xfe", 1007),                          /* no UTF-8 */
    CASE("\x81\x82" MASK "\xc0\xaf", 1007),                          /* */
    CASE("\x81\x83" MASK "\xed\xa0\x80", 1007),                      /* */
    CASE("\x81\x82" MASK "\xe2\x82", 1007),                          /* cut */
    CASE("\x88\x80" MASK, -1),                                       /* closed without a code */
    CASE("\x88\x82" MASK "\x03\xe8", 1000),                          /* with one */
    CASE("\x88\x85" MASK "\x0f\xa0"
         "bye",
         4000),                              /* and a reason */
    CASE("\x88\x82" MASK "\x03\xe7", 1002),  /* 999 */
    CASE("\x88\x82" MASK "\x03\xed", 1002),  /* 1005 */
    CASE("\x88\x83" MASK "\x03\xe8\xff", 0), /* the reason is no UTF-8 */
};

/* Returns the code of the next close frame: -1: it has none; 0: the connection ends without one. */
static int take_code(struct bench *bench, int fd)
{
    uint8_t payload[200], head[2];
    if (web_listen_to(bench, fd, head, 1) == 0) return 0;
    assert_int_equal(head[0], 0x88);
    web_take(bench, fd, head + 1, 1);
    web_take(bench, fd, payload, head[1]);
    return head[1] == 0 ? -1 : payload[0] << 8 | payload[1];
}

/* Bytes come at once, and byte by byte. The close frame is the last one, even when the owner has more to write. */
static void test_ends(void **state)
{
    (void)state;
    static const char ack[] = "\x88\x82" MASK "\x03\xe8";
    char place[64], byte;
    struct bench bench = web_open(place);
    for (size_t i = 0; i < sizeof ends / sizeof *ends; i++)
        for (int cut = 0; cut < 2; cut++) {
            int fd = web_upgrade(&bench, place, "/ws", "");
            const int session = bench_expect(&bench, LINK_OPENED, 0).session;
            for (size_t at = 0, n; at < ends[i].len; at += n) {
                n = cut ? 1 : ends[i].len;
                if (send(fd, ends[i].bytes + at, n, MSG_NOSIGNAL) < 0) break; /* it has ended */
                if (cut) bench_poll(&bench, 0, 0);
            }
            const int code = take_code(&bench, fd);
            if (code != ends[i].code) fail_msg("case %zu: %d, not %d", i, code, ends[i].code);
            bench.ops->write(bench.link, session, "\xd5\xd5", 2);
            bench_poll(&bench, 0, 0);
            send(fd, ack, sizeof ack - 1, MSG_NOSIGNAL);
            assert_int_equal(web_listen_to(&bench, fd, &byte, 1), 0);
            bench_expect(&bench, LINK_CLOSED, 0);
            close(fd);
        }
    bench_close(&bench);
}

/* Pings are answered, even between the pieces of a message; unsolicited pongs are not. A frame without a mask is
 * accepted, as libwebsockets does not report that. */
static void test_pings(void **state)
{
    (void)state;
    char place[64], text[8], ping[125];
    uint8_t payload[200];
    size_t len;
    struct bench bench = web_open(place);
    int fd = web_upgrade(&bench, place, "/ws", "");
    bench_expect(&bench, LINK_OPENED, 0);
    memset(ping, 'p', sizeof ping);
    web_send_frame(fd, 0x01, "A", 1);
    web_send_frame(fd, 0x89, ping, sizeof ping);
    assert_int_equal(web_take_frame(&bench, fd, payload, &len), 0x8a);
    assert_int_equal(len, sizeof ping);
    assert_memory_equal(payload, ping, len);
    web_send_frame(fd, 0x8a, "unasked", 7);
    web_send_frame(fd, 0x80, "B", 1);
    assert_int_equal(send(fd, "\x81\x04TIME", 6, MSG_NOSIGNAL), 6);
    bench_read_all(&bench, 0, text, 8);
    assert_memory_equal(text, "AB\nTIME\n", 8);
    close(fd);
    bench_close(&bench);
}

/* A message may have 4096 bytes, in one piece or in several. One byte more is refused (test_ends). */
static void test_longest_message(void **state)
{
    (void)state;
    enum { MOST = 4096 };
    static const size_t first[] = {MOST, 1, MOST - 1, 2000};
    char place[64], sent[MOST], text[MOST + 1];
    struct bench bench = web_open(place);
    int fd = web_upgrade(&bench, place, "/ws", "");
    bench_expect(&bench, LINK_OPENED, 0);
    for (size_t i = 0; i < MOST; i++)
        sent[i] = (char)('a' + i % 26);
    for (size_t i = 0; i < sizeof first / sizeof first[0]; i++) {
        const int is_whole = first[i] == MOST;
        web_send_frame(fd, is_whole ? 0x81 : 0x01, sent, first[i]);
        if (!is_whole) web_send_frame(fd, 0x80, sent + first[i], MOST - first[i]);
        bench_read_all(&bench, 0, text, MOST + 1);
        assert_memory_equal(text, sent, MOST);
        assert_int_equal(text[MOST], '\n');
    }
    close(fd);
    bench_close(&bench);
}

/* A frame comes after the request, in the same piece. */
static void test_early_frames(void **state)
{
    (void)state;
    char place[64], request[400], answer[400], text[6];
    struct bench bench = web_open(place);
    int fd = web_dial(place), n = snprintf(request, sizeof request,
                                           "GET /ws HTTP/1.1\r\nHost: %s\r\nUpgrade: WebSocket\r\n"
                                           "Connection: keep-alive, Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                                           "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n",
                                           place);
    memcpy(request + n, "\x81\x85" MASK "*IDN?", 11);
    assert_int_equal(send(fd, request, (size_t)n + 11, MSG_NOSIGNAL), n + 11);
    bench_expect(&bench, LINK_OPENED, 0);
    bench_read_all(&bench, 0, text, 6);
    assert_memory_equal(text, "*IDN?\n", 6);
    answer[web_listen_to(&bench, fd, answer, sizeof answer - 1)] = '\0';
    assert_non_null(strcasestr(answer, "sec-websocket-accept: s3pPLMBiTxaQ9kYGzzhZRbK+xOo=\r\n")); /* RFC 6455 1.3 */
    close(fd);
    bench_close(&bench);
}

/* A client sends commands and closes at once. The commands are read before the client's end, also where the owner has
 * not heard of the session by then, or has something to write. Half a message may be read, too. */
static void test_last_words(void **state)
{
    (void)state;
    static const char words[] = "\x81\x84" MASK "STOP\x01\x84" MASK "HALF", end[] = "\x88\x82" MASK "\x03\xe8";
    for (int early = 0; early < 2; early++)
        for (int closes = 0; closes < 2; closes++) {
            char place[64], bytes[500], text[16];
            struct bench bench = web_open(place);
            int fd = early ? web_dial(place) : web_upgrade(&bench, place, "/ws", "");
            if (!early) bench_expect(&bench, LINK_OPENED, 0);
            size_t n = early ? (size_t)snprintf(bytes, sizeof bytes,
                                                "GET /ws HTTP/1.1\r\nHost: %s\r\nUpgrade: websocket\r\n"
                                                "Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                                                "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n",
                                                place)
                             : 0;
            memcpy(bytes + n, words, sizeof words - 1);
            n += sizeof words - 1;
            memcpy(bytes + n, end, sizeof end - 1);
            if (closes) n += sizeof end - 1;
            assert_int_equal(send(fd, bytes, n, MSG_NOSIGNAL), n);
            assert_int_equal(shutdown(fd, SHUT_WR), 0);
            if (early) bench_expect(&bench, LINK_OPENED, 0);
            bench_expect(&bench, LINK_READABLE, 1); /* a writable session is reported first, and then read */
            assert_true(bench.ops->write(bench.link, 0, "\xd5", 1) >= 0);
            ssize_t got = bench.ops->read(bench.link, 0, text, sizeof text);
            assert_in_range(got, 5, 9);
            assert_memory_equal(text, "STOP\nHALF", (size_t)got);
            bench_expect(&bench, LINK_CLOSED, 0);
            assert_int_equal(bench.ops->write(bench.link, 0, "\xd5", 1), SH_ECLOSED);
            close(fd);
            bench_close(&bench);
        }
}

/* The events of clients that are turned away leave room for those of sessions. */
static void test_crowd(void **state)
{
    (void)state;
    enum { CROWD = 100, LAST = WEB_SESSIONS - 1 };
    int fd[WEB_SESSIONS + CROWD], n_refused = 0;
    char place[64];
    struct bench bench = web_open(place);
    for (int i = 0; i < WEB_SESSIONS; i++) {
        fd[i] = web_upgrade(&bench, place, "/ws", "");
        bench_expect(&bench, LINK_OPENED, 0);
        web_send_frame(fd[i], 0x81, "STOP", 4);
    }
    while (bench_expect(&bench, LINK_READABLE, 0).session != LAST)
        continue;
    for (int i = 0; i < CROWD; i++)
        fd[WEB_SESSIONS + i] = web_dial(place);
    for (int turn = 0; n_refused < CROWD / 2; turn++) {
        struct link_event event[LINK_MAX_EVENTS];
        int is_heard = 0;
        assert_in_range(turn, 0, CROWD);
        const int n = bench.ops->poll(bench.link, -1, UINT32_MAX, 0, event, LINK_MAX_EVENTS);
        for (int i = 0; i < n; i++) {
            n_refused += event[i].kind == LINK_REFUSED;
            is_heard |= event[i].kind == LINK_READABLE && event[i].session == LAST;
        }
        assert_true(is_heard);
    }
    for (int i = 0; i < WEB_SESSIONS + CROWD; i++)
        close(fd[i]);
    bench_close(&bench);
}

/* The link is closed while its cable is pulled: its client hears of the end all the same. */
static void test_goodbye_without_cable(void **state)
{
    (void)state;
    static const char why[] = "\x88\x14\x03\xe9the head has ended"; /* 1001 */
    char place[64], got[64];
    struct bench bench = web_open(place);
    const int fd = web_upgrade(&bench, place, "/ws", "");
    bench_expect(&bench, LINK_OPENED, 0);
    assert_int_equal(bench.ops->fault(bench.link, LINK_FAULT_CABLE, 0, 0, 0), SH_OK);
    web_send_frame(fd, 0x88, "\x03\xe8", 2); /* unheard until then, so that the link need not wait for an answer */
    bench_close(&bench);
    assert_int_equal(fd_read(fd, got, sizeof got), sizeof why - 1);
    assert_memory_equal(got, why, sizeof why - 1);
    close(fd);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_ends),
        cmocka_unit_test(test_pings),
        cmocka_unit_test(test_longest_message),
        cmocka_unit_test(test_early_frames),
        cmocka_unit_test(test_last_words),
        cmocka_unit_test(test_crowd),
        cmocka_unit_test(test_goodbye_without_cable),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
