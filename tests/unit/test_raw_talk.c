/* SPDX-License-Identifier: MIT */
/* A connection that `record --raw` passes on: which frames it writes, with which times, what it sends on, and how it
 * ends. Both ends and the clocks are the test's. A frame is a letter and the number of its end: S, A, D, F or R for
 * SYN, ACK, data, FIN and RST; then its time and its bytes of payload. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>
#include <cmocka.h>

#include "drivers/socket/socket.h"
#include "firmware_sim/app/studio/record/raw_talk.h"
#include "tests/unit/clock_rig.h"
#include "tests/unit/trace_rig.h"

#define MS INT64_C(1000000)

enum { CLIENT, DEVICE };

static struct raw r;
static struct talk talk;
static int64_t utc_ns;
static int fails_at, n_written; /* the frame of that number, from 1, can't be written */

/* What an end has to say next, and how much it takes. */
static struct end_is {
    ssize_t n;
    int64_t t_ns;
    ssize_t room[8];
    int writes;
} ends[2];

static void expect(const char *expected)
{
    assert_string_equal(trace, expected);
    trace[0] = '\0';
}

static int number_of(int fd)
{
    return fd == talk.end[DEVICE].fd ? DEVICE : CLIENT;
}

int64_t stamped_now_ns(void)
{
    return utc_ns;
}

ssize_t stamped_read(int fd, void *buf, size_t room, int64_t *t_ns)
{
    const struct end_is *end = &ends[number_of(fd)];
    assert_int_equal(room, TALK_PIECE);
    if (end->n > 0) memset(buf, 'a' + number_of(fd), (size_t)end->n);
    *t_ns = end->t_ns;
    return end->n;
}

ssize_t socket_write(int fd, const void *buf, size_t len)
{
    struct end_is *end = &ends[number_of(fd)];
    const ssize_t room = end->room[end->writes++];
    const ssize_t n = room < (ssize_t)len ? room : (ssize_t)len;
    say("to%d:%zd%c ", number_of(fd), n, *(const char *)buf);
    return n;
}

void socket_break(int fd)
{
    say("break%d ", number_of(fd));
}

struct ethernet_end raw_end_of(const struct sockaddr_storage *at)
{
    return (struct ethernet_end){.is_v6 = at->ss_family == AF_UNIX};
}

static size_t put(char kind, int side, uint8_t *to)
{
    to[0] = (uint8_t)kind;
    to[1] = (uint8_t)side;
    return 2;
}

size_t tcp_put_syn(struct tcp_talk *of, int side, uint8_t *to)
{
    assert_ptr_equal(of, &talk.segments);
    return put('S', side, to);
}

size_t tcp_put_data(struct tcp_talk *of, int side, const void *data, size_t len, uint8_t *to)
{
    assert_true(of == &talk.segments && len >= 1 && len <= ETHERNET_MAX_SEGMENT);
    assert_int_equal(*(const char *)data, talk.end[CLIENT].fd < 0 && side == CLIENT ? 's' : 'a' + side);
    return put('D', side, to);
}

size_t tcp_put_ack(struct tcp_talk *of, int side, uint8_t *to)
{
    assert_ptr_equal(of, &talk.segments);
    return put('A', side, to);
}

size_t tcp_put_fin(struct tcp_talk *of, int side, uint8_t *to)
{
    assert_ptr_equal(of, &talk.segments);
    return put('F', side, to);
}

size_t tcp_put_reset(struct tcp_talk *of, int side, uint8_t *to)
{
    assert_ptr_equal(of, &talk.segments);
    return put('R', side, to);
}

int raw_write(struct raw *of, const struct capture_frame *frame, size_t payload, struct sh_err *err)
{
    assert_true(of == &r && frame->len == 2);
    say("%c%d@%lld", frame->bytes[0], frame->bytes[1], (long long)frame->t_ns);
    say(payload != 0 ? "+%zu " : " ", payload);
    of->last_t_ns = frame->t_ns;
    return ++n_written == fails_at ? sh_fail(err, SH_EIO, "the disk is full") : SH_OK;
}

/* A connection at 100: of a client, or of this program with two --send. */
static void begin(int has_client)
{
    static struct raw_send sends[] = {{(uint8_t *)"s1", 2}, {(uint8_t *)"s22", 3}};
    struct sh_err err;
    int a[2], b[2];
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM, 0, a), 0);
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM, 0, b), 0);
    close(a[1]);
    close(b[1]);
    if (!has_client) close(a[0]);
    memset(&talk, 0, sizeof talk);
    memset(&r, 0, sizeof r);
    memset(ends, 0, sizeof ends);
    r.in.operand[0] = "tcp:there";
    if (!has_client) {
        memcpy(r.send, sends, sizeof sends);
        r.n_sends = 2;
    }
    clock_rig_ns = 5000 * MS;
    utc_ns = 110;
    fails_at = n_written = 0;
    trace[0] = '\0';
    assert_int_equal(talk_open(&talk, &r, (const int[2]){has_client ? a[0] : -1, b[0]}, 100, &err), SH_OK);
    expect("S0@100 S1@110 A0@110 ");
    assert_true(talk.is_used && talk.segments.end[0].is_v6 && talk.segments.end[1].is_v6);
    for (int i = 0; i < 8; i++)
        ends[0].room[i] = ends[1].room[i] = 100000;
}

static int ask(int number)
{
    struct sh_err err;
    return talk.end[number].input.take(&talk.end[number].input, &err);
}

static int pass(int number)
{
    struct sh_err err;
    return talk.end[number].input.pass(&talk.end[number].input, &err);
}

/* At this time n bytes come from an end; a code in place of n closes or breaks it. */
static void come(int number, ssize_t n, int64_t t_ns)
{
    ends[number].n = n;
    ends[number].t_ns = t_ns;
    assert_int_equal(ask(number), 1);
    assert_int_equal(pass(number), SH_OK);
    ends[number].n = 0;
}

static void end(void)
{
    talk_close(&talk);
    assert_false(talk.is_used);
    talk_close(&talk); /* it closes nothing twice */
}

/* The other end has all bytes, and acknowledges them. A frame takes up to 1440. */
static void bytes_are_passed_on(void **state)
{
    (void)state;
    begin(1);
    assert_int_equal(ask(CLIENT), 0);
    come(CLIENT, 5, 120);
    expect("D0@120+5 A1@120 to1:5a ");
    come(DEVICE, 1440, 130);
    expect("D1@130+1440 A0@130 to0:1440b ");
    come(DEVICE, 1441, 140);
    expect("D1@140+1440 D1@140+1 A0@140 to0:1441b ");
    assert_true(talk.end[0].received == 5 && talk.end[1].received == 2881 && !talk.is_over);
    end();
}

/* As long as the other end does not take all, nothing more is read. Bytes that came earlier than the last frame get its
 * time, unless the clock itself went back. */
static void a_slow_reader(void **state)
{
    struct pollfd fds[2];
    struct sh_err err;
    int timeout_ms = 200;
    (void)state;
    begin(1);
    utc_ns = 1000;
    assert_int_equal(talk_wait_for(&talk, fds, &timeout_ms), 2);
    assert_true(fds[0].fd == talk.end[0].fd && fds[0].events == POLLIN);
    assert_true(fds[1].fd == talk.end[1].fd && fds[1].events == POLLIN && timeout_ms == 200);
    ends[DEVICE].room[0] = 3;
    ends[DEVICE].room[1] = 0;
    ends[DEVICE].room[2] = 2;
    come(CLIENT, 5, 120);
    expect("D0@120+5 A1@120 to1:3a to1:0a ");
    ends[CLIENT].n = 5;
    assert_int_equal(ask(CLIENT), 0);
    assert_int_equal(talk_wait_for(&talk, fds, &timeout_ms), 1);
    assert_true(fds[0].fd == talk.end[1].fd && fds[0].events == (POLLIN | POLLOUT));
    come(DEVICE, 1, 150);
    expect("D1@150+1 A0@150 to0:1b ");
    assert_int_equal(talk_push(&talk, &err), SH_OK);
    expect("to1:2a ");
    come(CLIENT, 5, 140); /* they waited for the reader */
    expect("D0@150+5 A1@150 to1:5a ");
    utc_ns = 149;
    come(CLIENT, 5, 140); /* the clock was set back */
    expect("D0@140+5 A1@140 to1:5a ");
    end();
}

/* Each end may close its direction; the connection is over with the second one. */
static void both_ends_close(void **state)
{
    (void)state;
    for (int first = 0; first < 2; first++) {
        char expected[64];
        begin(1);
        come(first, SH_ECLOSED, 120);
        snprintf(expected, sizeof expected, "F%d@120 A%d@120 ", first, !first);
        expect(expected);
        assert_true(talk.end[first].is_over && !talk.is_over);
        ends[first].n = 4;
        assert_int_equal(ask(first), 0); /* it is over */
        come(!first, 4, 130);
        come(!first, SH_ECLOSED, 140);
        snprintf(expected, sizeof expected, "D%d@130+4 A%d@130 to%d:4%c F%d@140 A%d@140 ", !first, first, first,
                 'a' + !first, !first, first);
        expect(expected);
        assert_true(talk.is_over && !talk.was_reset);
        struct sh_err err;
        assert_int_equal(talk_finish(&talk, &err), SH_OK);
        expect("");
        end();
    }
}

static void an_end_breaks(void **state)
{
    (void)state;
    for (int number = 0; number < 2; number++) {
        char expected[64];
        begin(1);
        come(number, SH_ERESET, 120);
        snprintf(expected, sizeof expected, "break%d R%d@120 ", !number, number);
        expect(expected);
        assert_true(talk.is_over && talk.was_reset);
        come(!number, 3, 130); /* too late */
        expect("");
        end();
    }
}

/* An end that takes nothing more may still have sent bytes. Once all are read, it counts as the one that broke the
 * connection. */
static void an_end_is_deaf(void **state)
{
    struct sh_err err;
    (void)state;
    begin(1);
    ends[DEVICE].room[0] = SH_ECLOSED;
    come(CLIENT, 5, 120);
    assert_true(talk.end[DEVICE].is_deaf && !talk.is_over);
    come(CLIENT, 6, 125); /* that is lost, too, as on the wire */
    come(DEVICE, 2, 130);
    come(DEVICE, SH_ECLOSED, 140);
    expect("D0@120+5 A1@120 to1:-6a D0@125+6 A1@125 D1@130+2 A0@130 to0:2b break0 R1@140 ");
    assert_true(talk.is_over && talk.was_reset);
    end();
    begin(1); /* it had closed its direction before */
    come(DEVICE, SH_ECLOSED, 120);
    ends[DEVICE].room[0] = SH_ECLOSED;
    utc_ns = 135;
    come(CLIENT, 5, 130);
    expect("F1@120 A0@120 D0@130+5 A1@130 to1:-6a break0 R1@135 ");
    assert_true(talk.is_over && talk.was_reset);
    assert_int_equal(talk_push(&talk, &err), SH_OK);
    expect("");
    end();
}

/* The next --send goes once the device has answered and was silent for 50 ms, or after a second. */
static void what_this_program_sends(void **state)
{
    struct pollfd fds[2];
    struct sh_err err;
    int timeout_ms = 200;
    (void)state;
    begin(0);
    assert_int_equal(talk_wait_for(&talk, fds, &timeout_ms), 1);
    assert_true(fds[0].fd == talk.end[1].fd && timeout_ms == 10);
    timeout_ms = 5;
    talk_wait_for(&talk, fds, &timeout_ms);
    assert_int_equal(timeout_ms, 5);
    utc_ns = 120;
    assert_int_equal(ask(CLIENT), 1);
    assert_int_equal(pass(CLIENT), SH_OK);
    expect("D0@120+2 A1@120 to1:2s ");
    clock_rig_ns += 999 * MS;
    assert_int_equal(ask(CLIENT), 0);
    come(DEVICE, 7, 130);
    expect("D1@130+7 A0@130 "); /* it goes to nobody */
    clock_rig_ns = 5500 * MS;
    talk.heard_ns = 5451 * MS;
    assert_int_equal(ask(CLIENT), 0);
    talk.heard_ns = 5450 * MS;
    utc_ns = 140;
    assert_int_equal(ask(CLIENT), 1);
    assert_int_equal(pass(CLIENT), SH_OK);
    expect("D0@140+3 A1@140 to1:3s ");
    assert_true(talk.end[CLIENT].received == 5 && talk.end[DEVICE].received == 7 && talk.next_send == 2);
    clock_rig_ns += 5000 * MS;
    assert_int_equal(ask(CLIENT), 0); /* there is no other */
    timeout_ms = 200;
    talk_wait_for(&talk, fds, &timeout_ms);
    assert_int_equal(timeout_ms, 200);
    utc_ns = 150;
    assert_int_equal(talk_finish(&talk, &err), SH_OK);
    expect("F0@150 A1@150 ");
    end();
    begin(0); /* without an answer, after a second */
    assert_int_equal(ask(CLIENT), 1);
    pass(CLIENT);
    clock_rig_ns += 1000 * MS;
    assert_int_equal(ask(CLIENT), 1);
    end();
    begin(0); /* where the device closes, so does this program */
    come(DEVICE, SH_ECLOSED, 120);
    expect("F1@120 A0@120 F0@120 A1@120 ");
    assert_true(talk.is_over && !talk.was_reset);
    end();
}

static void the_recording_ends(void **state)
{
    struct sh_err err;
    (void)state;
    begin(1);
    utc_ns = 160;
    assert_int_equal(talk_finish(&talk, &err), SH_OK);
    expect("F0@160 A1@160 ");
    end();
    begin(1);
    come(CLIENT, SH_ECLOSED, 120); /* it has its end already */
    trace[0] = '\0';
    assert_int_equal(talk_finish(&talk, &err), SH_OK);
    expect("");
    end();
}

static void a_full_disk(void **state)
{
    struct sh_err err;
    (void)state;
    for (fails_at = 4; fails_at <= 6; fails_at++) {
        const int at = fails_at;
        begin(1);
        fails_at = at;
        ends[DEVICE].n = 1441;
        ends[DEVICE].t_ns = 120;
        assert_int_equal(ask(DEVICE), 1);
        assert_int_equal(talk.end[DEVICE].input.pass(&talk.end[DEVICE].input, &err), SH_EIO);
        assert_string_equal(err.text, "the disk is full");
        assert_int_equal(n_written, at);
        assert_null(strstr(trace, "to0"));
        end();
    }
}

static void a_device_that_is_gone(void **state)
{
    struct sh_err err;
    const int fd = socket(AF_UNIX, SOCK_STREAM, 0); /* it has no peer */
    (void)state;
    memset(&talk, 0, sizeof talk);
    r.in.operand[0] = "tcp:there";
    assert_int_equal(talk_open(&talk, &r, (const int[2]){-1, fd}, 100, &err), SH_ELOST);
    assert_string_equal(err.text, "tcp:there: the connection was closed at once");
    assert_int_equal(talk.is_used, 1); /* so that it is closed */
    end();
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bytes_are_passed_on),   cmocka_unit_test(a_slow_reader),
        cmocka_unit_test(both_ends_close),       cmocka_unit_test(an_end_breaks),
        cmocka_unit_test(an_end_is_deaf),        cmocka_unit_test(what_this_program_sends),
        cmocka_unit_test(the_recording_ends),    cmocka_unit_test(a_full_disk),
        cmocka_unit_test(a_device_that_is_gone),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
