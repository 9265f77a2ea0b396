/* SPDX-License-Identifier: MIT */
/* libscanhead's notices of a stream and of replies, and their order. */
#include "tests/unit/notices_rig.h"

#define IDN "Maker,Model,SN1,scanhead native 1"
enum { EVENT = NOTICES_EVENT, IDENTITY = sizeof IDN - 1 };

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
    expect_notice(0, SCANHEAD_NOTICE_BAD_BYTES, EVENT, 0, 3);
    expect_notice(1, SCANHEAD_NOTICE_GAP, EVENT + 3, 1, 2);
    assert_int_equal(noticed[1].t_ns, 13);
    assert_int_equal(noticed_stats.seq_lost, 2);
    expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_int_equal(f.seq, 5);
    assert_int_equal(n_noticed, 6);
    expect_notice(2, SCANHEAD_NOTICE_REPEATED, 2 * EVENT + 3, 3, 1);
    expect_notice(3, SCANHEAD_NOTICE_LATE, 3 * EVENT + 3, 1, 1);
    assert_int_equal(noticed[3].t_ns, 11);
    expect_notice(4, SCANHEAD_NOTICE_BAD_PAYLOAD, 4 * EVENT + 3, 4, EVENT);
    assert_int_equal(noticed[4].t_ns, 14);
    expect_notice(5, SCANHEAD_NOTICE_GAP, 5 * EVENT + 3, 4, 1);
    expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_int_equal(n_noticed, 7);
    expect_notice(6, SCANHEAD_NOTICE_RESTARTED, 6 * EVENT + 3, 0x90000000u, 1);
    for (int i = 0; i < 2; i++) {
        assert_int_equal(scanhead_next(sh, &f, -1), SCANHEAD_ECLOSED);
        assert_int_equal(n_noticed, 9);
    }
    expect_notice(7, SCANHEAD_NOTICE_CUT, 7 * EVENT + 3, 4, 99);
    expect_notice(8, SCANHEAD_NOTICE_CLOSED, 7 * EVENT + 102, 0, -SCANHEAD_ECLOSED);
    scanhead_get_stats(sh, &noticed_stats);
    assert_int_equal(noticed_stats.frames, 4);
    assert_true(noticed_stats.repeated == 1 && noticed_stats.late == 1 && noticed_stats.restarts == 1 &&
                noticed_stats.cuts == 1 && noticed_stats.closed == 1);
    assert_true(noticed_stats.seq_lost == 3 && noticed_stats.seq_gaps == 3 && noticed_stats.bad_payload == 1);
    assert_int_equal(noticed_stats.bad_bytes, EVENT + 3 + 99);
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
    expect_notice(0, SCANHEAD_NOTICE_CUT, EVENT, 0, 2);
    assert_int_equal(noticed[0].t_ns, 18);
    scanhead_close(sh);
}

/* ---- replies: a thread plays the head, with a line in and some bytes out */

static void test_echo(void **state)
{
    (void)state;
    int head;
    char reply[64];
    struct scanhead *sh = open_pair(&head);
    listen_to(sh);
    struct play p = {.fd = head, .turn = {{"TIME?", SAYS("TIME?\r\n12\r\n")}}};
    assert_int_equal(command_played(sh, &p, "TIME?", reply, WAIT_MS), 0);
    assert_string_equal(reply, "12");
    assert_int_equal(n_noticed, 1);
    expect_notice(0, SCANHEAD_NOTICE_ECHO, 0, 0, 5);
    assert_int_equal(noticed_stats.echoes, 1);
    /* with a frame between, which is kept; and the reply twice */
    uint8_t bytes[7 + EVENT + 10] = "TIME?\r\n";
    make_event(bytes + 7, 3);
    memcpy(bytes + 7 + EVENT, "13\r\n13\r\n", 8);
    p.turn[0] = (struct turn){"TIME?", bytes, 7 + EVENT + 8};
    assert_int_equal(command_played(sh, &p, "TIME?", reply, WAIT_MS), 0);
    assert_string_equal(reply, "13");
    struct scanhead_frame f;
    expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_int_equal(n_noticed, 2);
    expect_notice(1, SCANHEAD_NOTICE_ECHO, 11, 0, 5);
    put_numbered(head, 4);
    expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_int_equal(n_noticed, 3);
    expect_notice(2, SCANHEAD_NOTICE_UNASKED, 11 + 7 + EVENT + 4, 0, 2);
    assert_int_equal(noticed[2].t_ns, 13);
    assert_int_equal(noticed_stats.unasked, 1);
    /* Nobody has asked for an identity either. */
    put_all(head, IDN "\r\n", IDENTITY + 2);
    put_numbered(head, 5);
    expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_int_equal(n_noticed, 4);
    expect_notice(3, SCANHEAD_NOTICE_UNASKED, 11 + 7 + 2 * EVENT + 8, 0, IDENTITY);
    assert_int_equal(noticed_stats.unasked, 2);
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
    assert_int_equal(command_played(sh, &p, "TIME?", reply, 1), SCANHEAD_ETIMEOUT);
    put_all(head, "77\r\n", 4);
    put_numbered(head, 1);
    expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_int_equal(n_noticed, 1);
    expect_notice(0, SCANHEAD_NOTICE_LATE_REPLY, 0, 0, 2);
    struct play q = {.fd = head, .turn = {{"", NULL, 0}, {"*IDN?", SAYS(IDN "\r\n")}, {"PRR?", NULL, 0}}};
    assert_int_equal(command_played(sh, &q, "PRR?", reply, 1000), SCANHEAD_ETIMEOUT);
    assert_int_equal(n_noticed, 1); /* the answer to the question between was asked for */
    struct play r = {.fd = head, .turn = {{"", NULL, 0}, {"*IDN?", SAYS("88\r\n" IDN "\r\n")}, {"X?", SAYS("9\r\n")}}};
    assert_int_equal(command_played(sh, &r, "X?", reply, WAIT_MS), 0);
    assert_string_equal(reply, "9");
    assert_int_equal(n_noticed, 2);
    expect_notice(1, SCANHEAD_NOTICE_LATE_REPLY, 4 + EVENT + IDENTITY + 2, 0, 2);
    assert_int_equal(noticed_stats.late_replies, 2);
    /* Both replies have come, so this line was not asked for. */
    put_all(head, "5\r\n", 3);
    assert_int_equal(scanhead_next(sh, &f, 0), SCANHEAD_ETIMEOUT);
    assert_int_equal(n_noticed, 3);
    expect_notice(2, SCANHEAD_NOTICE_UNASKED, 4 + EVENT + IDENTITY + 2 + 4 + IDENTITY + 2 + 3, 0, 1);
    close(head);
    scanhead_close(sh);
}

/* Lines that nobody asked for stand before the reply. They are no reply, and each is reported. */
static void test_before_a_command(void **state)
{
    (void)state;
    int head;
    char reply[64];
    struct scanhead *sh = open_pair(&head);
    listen_to(sh);
    put_all(head, "77\r\n5\r\n", 7);
    struct play p = {.fd = head, .turn = {{"TIME?", SAYS("9\r\n")}}};
    assert_int_equal(command_played(sh, &p, "TIME?", reply, WAIT_MS), 0);
    assert_string_equal(reply, "9");
    assert_int_equal(n_noticed, 2);
    expect_notice(0, SCANHEAD_NOTICE_UNASKED, 0, 0, 2);
    expect_notice(1, SCANHEAD_NOTICE_UNASKED, 4, 0, 1);
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
    assert_int_equal(command_played(sh, &p, "*IDN?", reply, 1), SCANHEAD_ETIMEOUT);
    struct play q = {.fd = head,
                     .turn = {{"", NULL, 0}, {"*IDN?", SAYS(IDN "\r\n" IDN "\r\n")}, {"*IDN?", SAYS(IDN "\r\n")}}};
    assert_int_equal(command_played(sh, &q, "*IDN?", reply, WAIT_MS), 0);
    assert_string_equal(reply, IDN);
    assert_int_equal(n_noticed, 1);
    expect_notice(0, SCANHEAD_NOTICE_LATE_REPLY, 0, 0, IDENTITY);
    close(head);
    scanhead_close(sh);
}

/* The head is silent, so the second command is never sent. Of the lines that come later, one answers the first command.
 */
static void test_never_sent(void **state)
{
    (void)state;
    int head;
    char reply[64];
    struct scanhead_frame f;
    struct scanhead *sh = open_pair(&head);
    listen_to(sh);
    struct play p = {.fd = head, .turn = {{"TIME?", NULL, 0}}};
    assert_int_equal(command_played(sh, &p, "TIME?", reply, 1), SCANHEAD_ETIMEOUT);
    struct play q = {.fd = head, .turn = {{"", NULL, 0}, {"*IDN?", NULL, 0}}};
    assert_int_equal(command_played(sh, &q, "PRR?", reply, 1), SCANHEAD_ETIMEOUT);
    put_all(head, "77\r\n5\r\n", 7);
    assert_int_equal(scanhead_next(sh, &f, 0), SCANHEAD_ETIMEOUT);
    assert_int_equal(n_noticed, 2);
    expect_notice(0, SCANHEAD_NOTICE_LATE_REPLY, 0, 0, 2);
    expect_notice(1, SCANHEAD_NOTICE_UNASKED, 4, 0, 1);
    close(head);
    scanhead_close(sh);
}

/* A late reply that is a list of four is no answer to *IDN?, though that has four fields, too. */
static void test_late_list(void **state)
{
    (void)state;
    int head;
    char reply[64];
    struct scanhead *sh = open_pair(&head);
    listen_to(sh);
    struct play p = {.fd = head, .turn = {{"LIST?", NULL, 0}}};
    assert_int_equal(command_played(sh, &p, "LIST?", reply, 1), SCANHEAD_ETIMEOUT);
    struct play q = {
        .fd = head,
        .turn = {{"", NULL, 0}, {"*IDN?", SAYS("1 a, 2 b, 3 c, 4 d\r\n" IDN "\r\n")}, {"PRR?", SAYS("7\r\n")}}};
    assert_int_equal(command_played(sh, &q, "PRR?", reply, WAIT_MS), 0);
    assert_string_equal(reply, "7");
    assert_int_equal(n_noticed, 1);
    expect_notice(0, SCANHEAD_NOTICE_LATE_REPLY, 0, 0, 18);
    close(head);
    scanhead_close(sh);
}

/* Writes an event that is whole, and whose text has no end, or whose version is of later times. */
static size_t make_wrong_event(uint8_t *to, uint32_t seq, int has_version)
{
    const size_t n = make_event(to, seq);
    if (has_version)
        to[2] = NATIVE_VERSION + 1;
    else
        memset(to + NATIVE_HEADER_LEN + 32, 'x', 96);
    native_reseal(to, n);
    return n;
}

/* A whole frame that is wrong gives one notice, in its turn, and the next frame is handed out. The frame counts in the
 * sequence: no number is missing. */
static void test_refused(void **state)
{
    (void)state;
    int head;
    char reply[64];
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    uint8_t raw[3 * EVENT + 4];
    listen_to(sh);
    put_numbered(head, 0);
    for (uint32_t seq = 1; seq <= 2; seq++)
        put_all(head, raw, make_wrong_event(raw, seq, seq == 1));
    put_numbered(head, 3);
    expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_int_equal(n_noticed, 0);
    expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_int_equal(f.seq, 3);
    assert_int_equal(n_noticed, 2);
    expect_notice(0, SCANHEAD_NOTICE_REFUSED, EVENT, 1, 1);
    expect_notice(1, SCANHEAD_NOTICE_REFUSED, 2 * EVENT, 2, 1);
    assert_string_equal(scanhead_error(sh), ""); /* a reason is no error of the call */
    assert_int_equal(noticed[1].t_ns, 12);
    assert_true(noticed_stats.frames == 3 && noticed_stats.refused == 2 && noticed_stats.seq_lost == 0);
    make_event(raw, 4); /* these come before a reply, and wait for their turn */
    make_wrong_event(raw + EVENT, 5, 0);
    make_event(raw + 2 * EVENT, 6);
    memcpy(raw + 3 * EVENT, "7\r\n", 3);
    struct play p = {.fd = head, .turn = {{"PRR?", raw, 3 * EVENT + 3}}};
    assert_int_equal(command_played(sh, &p, "PRR?", reply, WAIT_MS), 0);
    assert_string_equal(scanhead_error(sh), "");
    assert_int_equal(n_noticed, 2);
    for (uint32_t seq = 4; seq <= 6; seq += 2) {
        expect_frame(sh, SCANHEAD_EVENT, &f);
        assert_int_equal(f.seq, seq);
        assert_int_equal(n_noticed, seq == 4 ? 2 : 3);
    }
    expect_notice(2, SCANHEAD_NOTICE_REFUSED, 5 * EVENT, 5, 1);
    put_all(head, raw, make_wrong_event(raw, 7, 1)); /* it is the last: the connection ends as any other */
    close(head);
    assert_int_equal(scanhead_next(sh, &f, WAIT_MS), SCANHEAD_ECLOSED);
    expect_notice(3, SCANHEAD_NOTICE_REFUSED, 7 * EVENT + 3, 7, 1);
    scanhead_close(sh);
}

static void test_names(void **state)
{
    (void)state;
    assert_string_equal(scanhead_notice_name(SCANHEAD_NOTICE_BAD_PAYLOAD), "bad payload");
    assert_string_equal(scanhead_notice_name(0), "?");
    assert_string_equal(scanhead_notice_name(-1), "?");
    assert_string_equal(scanhead_notice_name(SCANHEAD_NOTICE_REFUSED + 1), "?");
    for (int kind = SCANHEAD_NOTICE_GAP; kind <= SCANHEAD_NOTICE_REFUSED; kind++)
        assert_true(strlen(scanhead_notice_name(kind)) > 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_stream),        cmocka_unit_test(test_file),
        cmocka_unit_test(test_echo),          cmocka_unit_test(test_late_reply),
        cmocka_unit_test(test_late_identity), cmocka_unit_test(test_before_a_command),
        cmocka_unit_test(test_late_list),     cmocka_unit_test(test_names),
        cmocka_unit_test(test_never_sent),    cmocka_unit_test(test_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
