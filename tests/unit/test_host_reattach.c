/* SPDX-License-Identifier: MIT */
/* libscanhead's notices of connections that end and begin anew. */
#include <arpa/inet.h>
#include <errno.h>

#include "drivers/host/source.h"
#include "tests/unit/notices_rig.h"

enum { EVENT = NOTICES_EVENT };

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
    expect_notice(0, SCANHEAD_NOTICE_UNASKED, noticed[0].at_byte, 0, 1);
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
    assert_int_equal(command_played(sh, &p, "TIME?", reply, 1), SCANHEAD_ETIMEOUT);
    struct play q = {
        .fd = head,
        .turn = {{"", NULL, 0}, {"*IDN?", SAYS("Maker,Model,SN1,scanhead native 1\r\n")}, {"X?", SAYS("9\r\n")}}};
    assert_int_equal(command_played(sh, &q, "X?", reply, WAIT_MS), 0);
    assert_string_equal(reply, "9");
    assert_int_equal(n_noticed, 0);
    close(head);
    close(door);
    scanhead_close(sh);
}

/* Each session of the head counts from 0 the frames that it left out for this reader. */
static void test_reader_lost(void **state)
{
    (void)state;
    int door;
    struct scanhead_frame f;
    struct scanhead_stats stats;
    struct scanhead *sh = open_tcp(&door);
    for (uint64_t session = 1; session <= 3; session++) {
        const int head = accept(door, NULL, NULL);
        put_event(head, NATIVE_EV_READER_LOST, 1, 1, 1, NATIVE_LOCAL);
        put_event(head, NATIVE_EV_READER_LOST, session, session, 1 + session, NATIVE_LOCAL);
        close(head);
        expect_frame(sh, SCANHEAD_EVENT, &f);
        expect_frame(sh, SCANHEAD_EVENT, &f);
        assert_int_equal(scanhead_next(sh, &f, WAIT_MS), SCANHEAD_ECLOSED);
        assert_int_equal(scanhead_reattach(sh, WAIT_MS), 0);
    }
    scanhead_get_stats(sh, &stats);
    assert_int_equal(stats.reader_lost, 2 + 3 + 4);
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
    expect_notice(0, SCANHEAD_NOTICE_CUT, EVENT, 101, EVENT / 2);
    expect_notice(1, SCANHEAD_NOTICE_CLOSED, EVENT + EVENT / 2, 0, -SCANHEAD_ECLOSED);
    assert_int_equal(scanhead_reattach(sh, WAIT_MS), 0);
    head = accept(door, NULL, NULL);
    assert_int_equal(n_noticed, 3);
    expect_notice(2, SCANHEAD_NOTICE_REATTACHED, EVENT + EVENT / 2, 0, 1);
    /* the same head goes on; */
    put_numbered(head, 103);
    expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_int_equal(n_noticed, 4);
    expect_notice(3, SCANHEAD_NOTICE_GAP, EVENT + EVENT / 2, 101, 2);
    /* The connection is left while frames are on their way. The frames come first, and the restarted head's after
     * them. */
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
    expect_notice(4, SCANHEAD_NOTICE_BAD_PAYLOAD, at_106, 106, EVENT / 2);
    expect_notice(5, SCANHEAD_NOTICE_GAP, at_107, 106, 1);
    expect_notice(6, SCANHEAD_NOTICE_CLOSED, at_107 + NATIVE_HEADER_LEN, 0, -SCANHEAD_ECLOSED);
    expect_notice(7, SCANHEAD_NOTICE_REATTACHED, at_107 + NATIVE_HEADER_LEN, 0, 1);
    expect_notice(8, SCANHEAD_NOTICE_RESTARTED, at_107 + NATIVE_HEADER_LEN, 100, 1);
    assert_int_equal(scanhead_next(sh, &f, WAIT_MS), SCANHEAD_ECLOSED);
    scanhead_get_stats(sh, &noticed_stats);
    assert_true(noticed_stats.closed == 3 && noticed_stats.reattached == 2 && noticed_stats.restarts == 1 &&
                noticed_stats.repeated == 0);
    close(door);
    scanhead_close(sh);
}

static int read_error;

static ssize_t failing_read(struct host_source *source, void *to, size_t len)
{
    (void)source, (void)to, (void)len;
    errno = read_error;
    return -1;
}

static void close_nothing(struct host_source *source)
{
    (void)source;
}

/* Each of these is how TCP gives a connection up (tcp(7), ip(7)): after it, reattaching is right. */
static void test_ways_to_end(void **state)
{
    (void)state;
    static const struct host_source_ops ops = {.read = failing_read, .close = close_nothing};
    static const int errors[] = {ECONNRESET, ETIMEDOUT, EHOSTUNREACH, ENETUNREACH, ENETDOWN};
    for (size_t i = 0; i < sizeof errors / sizeof errors[0]; i++) {
        struct scanhead *sh = host_open(&(struct host_source){.ops = &ops, .fd = -1, .name = "tcp:test:1"});
        struct scanhead_frame f;
        assert_non_null(sh);
        read_error = errors[i];
        assert_int_equal(scanhead_next(sh, &f, WAIT_MS), SCANHEAD_ECLOSED);
        scanhead_close(sh);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_given_up_before), cmocka_unit_test(test_identity_before),
        cmocka_unit_test(test_reader_lost),     cmocka_unit_test(test_reattach),
        cmocka_unit_test(test_ways_to_end),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
