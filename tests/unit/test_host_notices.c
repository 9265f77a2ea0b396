/* SPDX-License-Identifier: MIT */
/* libscanhead's notices of a stream, of replies and of connections, and their order. */
#include <arpa/inet.h>
#include <pthread.h>

#include "tests/unit/host_rig.h"

enum { NOTICES_MAX = 20, EVENT = 156, IDENTITY = 19 };

static struct scanhead_notice noticed[NOTICES_MAX];
static int n_noticed;
static struct scanhead_stats stats;

static void on_notice(void *ctx, const struct scanhead_notice *notice)
{
    assert_true(n_noticed < NOTICES_MAX);
    noticed[n_noticed++] = *notice;
    scanhead_get_stats(ctx, &stats);
}

static void listen_to(struct scanhead *sh)
{
    n_noticed = 0;
    scanhead_on_notice(sh, on_notice, sh);
}

static void expect(int i, enum scanhead_notice_kind kind, uint64_t at_byte, uint32_t seq, uint64_t n)
{
    assert_true(i < n_noticed);
    assert_string_equal(scanhead_notice_name(noticed[i].kind), scanhead_notice_name(kind));
    assert_int_equal(noticed[i].at_byte, at_byte);
    assert_int_equal(noticed[i].seq, seq);
    assert_int_equal(noticed[i].n, n);
}

static size_t make_event(uint8_t *to, uint32_t seq)
{
    struct native_event e = {.code = NATIVE_EV_ERROR, .a = seq};
    assert_int_equal(native_encode_event(to, EVENT, &e, 10 + (int64_t)seq, 0), EVENT);
    native_finish_frame(to, seq);
    return EVENT;
}

static void put_numbered(int fd, uint32_t seq)
{
    uint8_t raw[EVENT];
    put_all(fd, raw, make_event(raw, seq));
}

/* Each notice comes before the frame that follows it, and the counters include it already. */
static void test_stream(void **state)
{
    (void)state;
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    uint8_t raw[EVENT];
    listen_to(sh);
    put_numbered(head, 0);
    put_all(head, "\x01\x02\x03", 3);
    put_numbered(head, 3);
    put_numbered(head, 3);
    put_numbered(head, 1);
    make_event(raw, 4);
    raw[100] ^= 1;
    put_all(head, raw, EVENT);
    put_numbered(head, 5);
    put_numbered(head, 0x90000000u);
    put_all(head, raw, 99);
    close(head);
    expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_int_equal(n_noticed, 0);
    expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_int_equal(f.seq, 3);
    assert_int_equal(n_noticed, 2);
    expect(0, SCANHEAD_NOTICE_BAD_BYTES, EVENT, 0, 3);
    expect(1, SCANHEAD_NOTICE_GAP, EVENT + 3, 1, 2);
    assert_int_equal(noticed[1].t_ns, 13);
    assert_int_equal(stats.seq_lost, 2);
    expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_int_equal(f.seq, 5);
    assert_int_equal(n_noticed, 6);
    expect(2, SCANHEAD_NOTICE_REPEATED, 2 * EVENT + 3, 3, 1);
    expect(3, SCANHEAD_NOTICE_LATE, 3 * EVENT + 3, 1, 1);
    assert_int_equal(noticed[3].t_ns, 11);
    expect(4, SCANHEAD_NOTICE_BAD_PAYLOAD, 4 * EVENT + 3, 4, EVENT);
    assert_int_equal(noticed[4].t_ns, 14);
    expect(5, SCANHEAD_NOTICE_GAP, 5 * EVENT + 3, 4, 1);
    expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_int_equal(n_noticed, 7);
    expect(6, SCANHEAD_NOTICE_RESTARTED, 6 * EVENT + 3, 0x90000000u, 1);
    for (int i = 0; i < 2; i++) {
        assert_int_equal(scanhead_next(sh, &f, -1), SCANHEAD_ECLOSED);
        assert_int_equal(n_noticed, 9);
    }
    expect(7, SCANHEAD_NOTICE_CUT, 7 * EVENT + 3, 4, 99);
    expect(8, SCANHEAD_NOTICE_CLOSED, 7 * EVENT + 102, 0, -SCANHEAD_ECLOSED);
    scanhead_get_stats(sh, &stats);
    assert_int_equal(stats.frames, 4);
    assert_true(stats.repeated == 1 && stats.late == 1 && stats.restarts == 1 && stats.cuts == 1 && stats.closed == 1);
    assert_true(stats.seq_lost == 3 && stats.seq_gaps == 3 && stats.bad_payload == 1);
    assert_int_equal(stats.bad_bytes, EVENT + 3 + 99);
    scanhead_close(sh);
}

static void test_file(void **state)
{
    (void)state;
    char path[] = "/tmp/test_notices_XXXXXX", err[256];
    int fd = mkstemp(path);
    struct scanhead *sh;
    struct scanhead_frame f;
    put_numbered(fd, 8);
    put_all(fd, "\xd5\x01", 2);
    close(fd);
    assert_int_equal(scanhead_open(path, &sh, err, sizeof err), 0);
    unlink(path);
    listen_to(sh);
    expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_int_equal(scanhead_next(sh, &f, -1), SCANHEAD_ECLOSED);
    assert_int_equal(n_noticed, 1); /* the end of a recording is no notice */
    expect(0, SCANHEAD_NOTICE_CUT, EVENT, 0, 2);
    assert_int_equal(noticed[0].t_ns, 18);
    scanhead_close(sh);
}

/* ---- replies: a thread plays the head, with a line in and some bytes out */

struct turn {
    const char *line;
    const void *answer;
    size_t len;
};
struct play {
    int fd, ok;
    struct turn turn[4];
};

static void *play(void *arg)
{
    struct play *p = arg;
    p->ok = 1;
    for (const struct turn *t = p->turn; t->line != NULL; t++) {
        char line[64];
        size_t n = 0;
        while (n < sizeof line - 1 && read(p->fd, line + n, 1) == 1 && line[n] != '\n')
            n++;
        line[n] = 0;
        p->ok &= strcmp(line, t->line) == 0;
        if (t->len > 0) p->ok &= write(p->fd, t->answer, t->len) == (ssize_t)t->len;
    }
    return NULL;
}

static int command(struct scanhead *sh, struct play *p, const char *line, char *reply, int timeout_ms)
{
    pthread_t thread;
    assert_int_equal(pthread_create(&thread, NULL, play, p), 0);
    const int rc = scanhead_command(sh, line, reply, 64, timeout_ms);
    pthread_join(thread, NULL);
    assert_true(p->ok);
    return rc;
}

#define SAYS(text) (text), sizeof(text) - 1

static void test_echo(void **state)
{
    (void)state;
    int head;
    char reply[64];
    struct scanhead *sh = open_pair(&head);
    listen_to(sh);
    struct play p = {.fd = head, .turn = {{"TIME?", SAYS("TIME?\r\n12\r\n")}}};
    assert_int_equal(command(sh, &p, "TIME?", reply, WAIT_MS), 0);
    assert_string_equal(reply, "12");
    assert_int_equal(n_noticed, 1);
    expect(0, SCANHEAD_NOTICE_ECHO, 0, 0, 5);
    assert_int_equal(stats.echoes, 1);
    /* with a frame between, which is kept; and the reply twice */
    uint8_t bytes[7 + EVENT + 10] = "TIME?\r\n";
    make_event(bytes + 7, 3);
    memcpy(bytes + 7 + EVENT, "13\r\n13\r\n", 8);
    p.turn[0] = (struct turn){"TIME?", bytes, 7 + EVENT + 8};
    assert_int_equal(command(sh, &p, "TIME?", reply, WAIT_MS), 0);
    assert_string_equal(reply, "13");
    struct scanhead_frame f;
    expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_int_equal(n_noticed, 2);
    expect(1, SCANHEAD_NOTICE_ECHO, 11, 0, 5);
    put_numbered(head, 4);
    expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_int_equal(n_noticed, 3);
    expect(2, SCANHEAD_NOTICE_UNASKED, 11 + 7 + EVENT + 4, 0, 2);
    assert_int_equal(noticed[2].t_ns, 13);
    assert_int_equal(stats.unasked, 1);
    close(head);
    scanhead_close(sh);
}

/* A reply comes when its command was given up: before the next command, or on its way. */
static void test_late_reply(void **state)
{
    (void)state;
    int head;
    char reply[64];
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    listen_to(sh);
    struct play p = {.fd = head, .turn = {{"TIME?", NULL, 0}}};
    assert_int_equal(command(sh, &p, "TIME?", reply, 1), SCANHEAD_ETIMEOUT);
    put_all(head, "77\r\n", 4);
    put_numbered(head, 1);
    expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_int_equal(n_noticed, 1);
    expect(0, SCANHEAD_NOTICE_LATE_REPLY, 0, 0, 2);
    struct play q = {.fd = head,
                     .turn = {{"", NULL, 0}, {"*IDN?", SAYS("Maker,Model,SN1,1.0\r\n")}, {"PRR?", NULL, 0}}};
    assert_int_equal(command(sh, &q, "PRR?", reply, 1000), SCANHEAD_ETIMEOUT);
    assert_int_equal(n_noticed, 1); /* the answer to the question between was asked for */
    struct play r = {.fd = head,
                     .turn = {{"", NULL, 0}, {"*IDN?", SAYS("88\r\nMaker,Model,SN1,1.0\r\n")}, {"X?", SAYS("9\r\n")}}};
    assert_int_equal(command(sh, &r, "X?", reply, WAIT_MS), 0);
    assert_string_equal(reply, "9");
    assert_int_equal(n_noticed, 2);
    expect(1, SCANHEAD_NOTICE_LATE_REPLY, 4 + EVENT + IDENTITY + 2, 0, 2);
    assert_int_equal(stats.late_replies, 2);
    /* Both have come, so this one was not asked for. */
    put_all(head, "5\r\n", 3);
    assert_int_equal(scanhead_next(sh, &f, 0), SCANHEAD_ETIMEOUT);
    assert_int_equal(n_noticed, 3);
    expect(2, SCANHEAD_NOTICE_UNASKED, 4 + EVENT + IDENTITY + 2 + 4 + IDENTITY + 2 + 3, 0, 1);
    close(head);
    scanhead_close(sh);
}

/* The command that was given up asked for the identity. One of two equal answers is late. */
static void test_late_identity(void **state)
{
    (void)state;
    int head;
    char reply[64];
    struct scanhead *sh = open_pair(&head);
    listen_to(sh);
    struct play p = {.fd = head, .turn = {{"*IDN?", NULL, 0}}};
    assert_int_equal(command(sh, &p, "*IDN?", reply, 1), SCANHEAD_ETIMEOUT);
    struct play q = {.fd = head,
                     .turn = {{"", NULL, 0},
                              {"*IDN?", SAYS("Maker,Model,SN1,1.0\r\nMaker,Model,SN1,1.0\r\n")},
                              {"*IDN?", SAYS("Maker,Model,SN1,1.0\r\n")}}};
    assert_int_equal(command(sh, &q, "*IDN?", reply, WAIT_MS), 0);
    assert_string_equal(reply, "Maker,Model,SN1,1.0");
    assert_int_equal(n_noticed, 1);
    expect(0, SCANHEAD_NOTICE_LATE_REPLY, 0, 0, IDENTITY);
    close(head);
    scanhead_close(sh);
}

/* The head is silent, so the second command is never sent. Of the lines that come later, one answers the first command. */
static void test_never_sent(void **state)
{
    (void)state;
    int head;
    char reply[64];
    struct scanhead_frame f;
    struct scanhead *sh = open_pair(&head);
    listen_to(sh);
    struct play p = {.fd = head, .turn = {{"TIME?", NULL, 0}}};
    assert_int_equal(command(sh, &p, "TIME?", reply, 1), SCANHEAD_ETIMEOUT);
    struct play q = {.fd = head, .turn = {{"", NULL, 0}, {"*IDN?", NULL, 0}}};
    assert_int_equal(command(sh, &q, "PRR?", reply, 1), SCANHEAD_ETIMEOUT);
    put_all(head, "77\r\n5\r\n", 7);
    assert_int_equal(scanhead_next(sh, &f, 0), SCANHEAD_ETIMEOUT);
    assert_int_equal(n_noticed, 2);
    expect(0, SCANHEAD_NOTICE_LATE_REPLY, 0, 0, 2);
    expect(1, SCANHEAD_NOTICE_UNASKED, 4, 0, 1);
    close(head);
    scanhead_close(sh);
}

/* A late reply that is a list of five is no answer to *IDN?, which has four fields. */
static void test_late_list(void **state)
{
    (void)state;
    int head;
    char reply[64];
    struct scanhead *sh = open_pair(&head);
    listen_to(sh);
    struct play p = {.fd = head, .turn = {{"LIST?", NULL, 0}}};
    assert_int_equal(command(sh, &p, "LIST?", reply, 1), SCANHEAD_ETIMEOUT);
    struct play q = {
        .fd = head,
        .turn = {{"", NULL, 0}, {"*IDN?", SAYS("1,2,3,4,5\r\nMaker,Model,SN1,1.0\r\n")}, {"PRR?", SAYS("7\r\n")}}};
    assert_int_equal(command(sh, &q, "PRR?", reply, WAIT_MS), 0);
    assert_string_equal(reply, "7");
    assert_int_equal(n_noticed, 1);
    expect(0, SCANHEAD_NOTICE_LATE_REPLY, 0, 0, 9);
    close(head);
    scanhead_close(sh);
}

/* ---- connections */

/* Opens a TCP port of this machine, and a handle that is connected to it. */
static struct scanhead *open_tcp(int *door)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof at;
    char source[64], err[256];
    struct scanhead *sh;
    *door = socket(AF_INET, SOCK_STREAM, 0);
    assert_int_equal(bind(*door, (struct sockaddr *)&at, sizeof at), 0);
    assert_int_equal(listen(*door, 4), 0);
    assert_int_equal(getsockname(*door, (struct sockaddr *)&at, &size), 0);
    snprintf(source, sizeof source, "tcp:127.0.0.1:%d", ntohs(at.sin_port));
    assert_int_equal(scanhead_open(source, &sh, err, sizeof err), 0);
    return sh;
}

/* A command is given up; then the handle connects anew. Returns the head's end. */
static int connect_anew(struct scanhead *sh, int door, const char *line)
{
    char reply[64];
    int head = accept(door, NULL, NULL);
    assert_int_equal(scanhead_command(sh, line, reply, sizeof reply, 1), SCANHEAD_ETIMEOUT);
    close(head);
    assert_int_equal(scanhead_reattach(sh, WAIT_MS), 0);
    head = accept(door, NULL, NULL);
    listen_to(sh);
    return head;
}

/* A reply that was given up on one connection does not come by another. A line there was not asked for. */
static void test_given_up_before(void **state)
{
    (void)state;
    int door;
    struct scanhead_frame f;
    struct scanhead *sh = open_tcp(&door);
    const int head = connect_anew(sh, door, "TIME?");
    put_all(head, "5\r\n", 3);
    put_numbered(head, 1);
    expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_int_equal(n_noticed, 1);
    expect(0, SCANHEAD_NOTICE_UNASKED, noticed[0].at_byte, 0, 1);
    close(head);
    close(door);
    scanhead_close(sh);
}

/* Neither does the answer to a *IDN? that was given up. The answer to the library's own question gives no notice. */
static void test_identity_before(void **state)
{
    (void)state;
    char reply[64];
    int door;
    struct scanhead *sh = open_tcp(&door);
    const int head = connect_anew(sh, door, "*IDN?");
    struct play p = {.fd = head, .turn = {{"TIME?", NULL, 0}}};
    assert_int_equal(command(sh, &p, "TIME?", reply, 1), SCANHEAD_ETIMEOUT);
    struct play q = {.fd = head,
                     .turn = {{"", NULL, 0}, {"*IDN?", SAYS("Maker,Model,SN1,1.0\r\n")}, {"X?", SAYS("9\r\n")}}};
    assert_int_equal(command(sh, &q, "X?", reply, WAIT_MS), 0);
    assert_string_equal(reply, "9");
    assert_int_equal(n_noticed, 0);
    close(head);
    close(door);
    scanhead_close(sh);
}

static void test_reattach(void **state)
{
    (void)state;
    char reply[64];
    int door;
    struct scanhead_frame f;
    struct scanhead *sh = open_tcp(&door);
    listen_to(sh);
    int head = accept(door, NULL, NULL);
    uint8_t raw[EVENT];
    put_numbered(head, 100);
    put_all(head, raw, make_event(raw, 101) / 2);
    shutdown(head, SHUT_WR);
    /* A command finds the end. Earlier frames are still there. */
    assert_int_equal(scanhead_command(sh, "TIME?", reply, sizeof reply, WAIT_MS), SCANHEAD_ECLOSED);
    expect_frame(sh, SCANHEAD_EVENT, &f);
    close(head);
    assert_int_equal(scanhead_next(sh, &f, WAIT_MS), SCANHEAD_ECLOSED);
    assert_int_equal(n_noticed, 2);
    expect(0, SCANHEAD_NOTICE_CUT, EVENT, 101, EVENT / 2);
    expect(1, SCANHEAD_NOTICE_CLOSED, EVENT + EVENT / 2, 0, -SCANHEAD_ECLOSED);
    assert_int_equal(scanhead_reattach(sh, WAIT_MS), 0);
    head = accept(door, NULL, NULL);
    assert_int_equal(n_noticed, 3);
    expect(2, SCANHEAD_NOTICE_REATTACHED, EVENT + EVENT / 2, 0, 1);
    /* the same head goes on; */
    put_numbered(head, 103);
    expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_int_equal(n_noticed, 4);
    expect(3, SCANHEAD_NOTICE_GAP, EVENT + EVENT / 2, 101, 2);
    /* It is left while frames are on their way. They come first, and the head that has started again after them. */
    put_numbered(head, 104);
    assert_int_equal(scanhead_next(sh, &f, WAIT_MS), 0);
    uint8_t rest[3 * EVENT];
    size_t len = make_event(rest, 105);
    len += make_event(rest + len, 106) / 2; /* it is cut, and its length hides the next one */
    memset(rest + len, 0, NATIVE_HEADER_LEN);
    memcpy(rest + len, (uint8_t[]){NATIVE_SYNC, 200, NATIVE_VERSION}, 3);
    len += native_finish_frame(rest + len, 107);
    put_all(head, rest, len);
    assert_int_equal(scanhead_next(sh, &f, WAIT_MS), 0);
    assert_int_equal(scanhead_reattach(sh, WAIT_MS), 0);
    close(head);
    head = accept(door, NULL, NULL);
    put_numbered(head, 100);
    close(head);
    assert_int_equal(f.seq, 105);
    assert_int_equal(scanhead_next(sh, &f, WAIT_MS), 0);
    assert_int_equal(f.seq, 107);
    assert_int_equal(scanhead_next(sh, &f, WAIT_MS), 0);
    assert_int_equal(f.seq, 100);
    const uint64_t at_106 = EVENT + EVENT / 2 + 3 * EVENT, at_107 = at_106 + EVENT / 2;
    assert_int_equal(n_noticed, 9);
    expect(4, SCANHEAD_NOTICE_BAD_PAYLOAD, at_106, 106, EVENT / 2);
    expect(5, SCANHEAD_NOTICE_GAP, at_107, 106, 1);
    expect(6, SCANHEAD_NOTICE_CLOSED, at_107 + NATIVE_HEADER_LEN, 0, -SCANHEAD_ECLOSED);
    expect(7, SCANHEAD_NOTICE_REATTACHED, at_107 + NATIVE_HEADER_LEN, 0, 1);
    expect(8, SCANHEAD_NOTICE_RESTARTED, at_107 + NATIVE_HEADER_LEN, 100, 1);
    assert_int_equal(scanhead_next(sh, &f, WAIT_MS), SCANHEAD_ECLOSED);
    scanhead_get_stats(sh, &stats);
    assert_true(stats.closed == 3 && stats.reattached == 2 && stats.restarts == 1 && stats.repeated == 0);
    close(door);
    scanhead_close(sh);
}

static void test_names(void **state)
{
    (void)state;
    assert_string_equal(scanhead_notice_name(SCANHEAD_NOTICE_BAD_PAYLOAD), "bad payload");
    assert_string_equal(scanhead_notice_name(0), "?");
    assert_string_equal(scanhead_notice_name(-1), "?");
    assert_string_equal(scanhead_notice_name(SCANHEAD_NOTICE_REATTACHED + 1), "?");
    for (int kind = SCANHEAD_NOTICE_GAP; kind <= SCANHEAD_NOTICE_REATTACHED; kind++)
        assert_true(strlen(scanhead_notice_name(kind)) > 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_stream),          cmocka_unit_test(test_file),          cmocka_unit_test(test_echo),
        cmocka_unit_test(test_late_reply),      cmocka_unit_test(test_late_identity), cmocka_unit_test(test_late_list),
        cmocka_unit_test(test_given_up_before), cmocka_unit_test(test_reattach),      cmocka_unit_test(test_names),
        cmocka_unit_test(test_identity_before), cmocka_unit_test(test_never_sent),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
