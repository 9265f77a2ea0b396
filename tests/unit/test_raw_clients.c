/* SPDX-License-Identifier: MIT */
/* `record --raw` of TCP: a connection of its own, or those of clients: how each begins and ends, what is refused, and
 * what it says of them. Connections and the device are the test's; the first of them is that of descriptor 100. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>
#include <cmocka.h>

#include "drivers/socket/socket.h"
#include "firmware_sim/app/studio/page_json.h"
#include "firmware_sim/app/studio/record/raw_talk.h"
#include "tests/unit/clock_rig.h"
#include "tests/unit/trace_rig.h"

#define MS INT64_C(1000000)

enum { MOST = 16 };

static struct raw r;
static char warned[512];
static int n_clients, n_connected, appears_ms, stop_ms, open_rc, work_rc;
static struct talk *talks[MOST + 4];
static int n_talks;

static void warn(void *ctx, const char *text)
{
    (void)ctx;
    const size_t n = strlen(warned);
    snprintf(warned + n, sizeof warned - n, "%s\n", text);
}

const struct sh_report app_report_stderr = {.warn = warn};

int app_interrupted(void)
{
    return stop_ms != 0 && clock_rig_ns >= stop_ms * MS;
}

int poll(struct pollfd *fds, nfds_t n, int timeout_ms)
{
    (void)fds;
    say("wait%d:%d ", (int)n, timeout_ms);
    clock_rig_ns += timeout_ms * MS;
    return 0;
}

int64_t stamped_now_ns(void)
{
    return 7000 + clock_rig_ns / MS;
}

int stamped_connect(const char *host, int port, int timeout_ms, int *fd, struct sh_err *err)
{
    say("connect:%s:%d:%d ", host, port, timeout_ms);
    if (clock_rig_ns < appears_ms * MS) return sh_fail(err, SH_EIO, "no device");
    *fd = 200 + n_connected++;
    return SH_OK;
}

void stamped_enable(int fd)
{
    say("stamp%d ", fd);
}

int socket_open(const struct socket_place *place, int *fd, char *name, size_t name_len, struct sh_err *err)
{
    say("listen:%s:%s:%d ", place->what, place->host, place->port);
    *fd = attempt(err, "listen") == SH_OK ? 77 : -1;
    snprintf(name, name_len, "127.0.0.1:9000");
    return *fd >= 0 ? SH_OK : SH_EIO;
}

int accept4(int fd, struct sockaddr *from, socklen_t *len, int flags)
{
    (void)from;
    assert_true(fd == 77 && *len == sizeof(struct sockaddr_storage) && flags == (SOCK_NONBLOCK | SOCK_CLOEXEC));
    return n_clients > 0 ? 100 + --n_clients : -1;
}

void socket_address_text(const struct sockaddr *at, socklen_t len, char *to, size_t room)
{
    (void)at;
    (void)len;
    snprintf(to, room, "C%d", n_clients);
}

void socket_tune(int fd)
{
    say("tune%d ", fd);
}

void socket_break(int fd)
{
    say("break%d ", fd);
}

int close(int fd)
{
    if (fd < 77) return (int)syscall(SYS_close, fd); /* it is none of the test's */
    say("close%d ", fd);
    return 0;
}

int capture_add_interface(struct capture *capture, const char *name, const char *comment, struct sh_err *err)
{
    assert_true(capture == &r.capture && strcmp(name, "tcp:there") == 0);
    assert_string_equal(comment, "TCP connections that scanhead had, as rebuilt frames; times are the kernel's.");
    return attempt(err, "interface");
}

/* ---- connections */

int talk_open(struct talk *talk, struct raw *of, const int fd[2], int64_t began_ns, struct sh_err *err)
{
    assert_ptr_equal(of, &r);
    say("talk:%d-%d@%lld ", fd[0], fd[1], (long long)began_ns);
    talk->is_used = 1;
    talk->is_over = talk->was_reset = talk->next_send = 0;
    talk->end[0].fd = fd[0];
    talk->end[1].fd = fd[1];
    talk->end[0].received = talk->end[1].received = 0;
    talks[n_talks++] = talk;
    return open_rc == SH_OK ? SH_OK : sh_fail(err, open_rc, "it is gone");
}

int talk_wait_for(const struct talk *talk, struct pollfd *fds, int *timeout_ms)
{
    fds[0] = (struct pollfd){.fd = talk->end[0].fd, .events = POLLIN};
    fds[1] = (struct pollfd){.fd = talk->end[1].fd, .events = POLLOUT};
    *timeout_ms -= 1;
    return 2;
}

int talk_push(struct talk *talk, struct sh_err *err)
{
    say("push%d ", talk->end[1].fd);
    return attempt(err, "push");
}

int raw_pass_in_order(struct raw_input *const *input, int n, int most, struct sh_err *err)
{
    say("pass%d:%d ", n, most);
    for (int i = 0; i < n; i++) {
        const struct talk *talk = talks[i / 2];
        assert_true(!talk->is_used || input[i] == &talk->end[i % 2].input);
    }
    return work_rc < 0 ? sh_fail(err, work_rc, "no order") : work_rc;
}

int talk_finish(struct talk *talk, struct sh_err *err)
{
    say("finish%d ", talk->end[1].fd);
    return attempt(err, "finish");
}

void talk_close(struct talk *talk)
{
    if (talk->is_used) say("end%d ", talk->end[1].fd);
    talk->is_used = 0;
}

static void expect(const char *expected)
{
    assert_string_equal(trace, expected);
    trace[0] = '\0';
}

static int make(void **state)
{
    (void)state;
    memset(&r, 0, sizeof r);
    r.in.operand[0] = "tcp:there";
    strcpy(r.place.host, "there");
    r.place.port[0] = 2111;
    r.quiet = 1;
    trace[0] = warned[0] = '\0';
    fails = NULL;
    n_clients = n_connected = n_talks = appears_ms = stop_ms = open_rc = work_rc = 0;
    clock_rig_ns = 0;
    return 0;
}

static void open_it(const char *relay)
{
    struct sh_err err;
    r.relay = relay;
    assert_int_equal(raw_tcp.open(&r, &err), SH_OK);
    trace[0] = '\0';
}

static void put_all(struct json *json, const void *of)
{
    json_open_object(json, NULL);
    raw_tcp.put(json, of);
    json_close_object(json);
}

static void expect_json(const char *expected)
{
    struct web_body body;
    struct sh_err err;
    assert_int_equal(page_json(put_all, &r, &body, &err), SH_OK);
    assert_string_equal(body.bytes, expected);
    free(body.bytes);
}

static void refuse(int rc, const char *text)
{
    struct sh_err err;
    assert_int_equal(raw_tcp.check(&r, &err), rc);
    if (rc != SH_OK) assert_string_equal(err.text, text);
}

/* The device may come up late, while --wait lasts. */
static void its_own_connection(void **state)
{
    struct sh_err err;
    (void)state;
    assert_int_equal(raw_tcp.open(&r, &err), SH_OK);
    expect("connect:there:2111:5000 talk:-1-200@7000 ");
    assert_string_equal(r.endpoint, "tcp:there");
    raw_tcp.close(&r);
    expect("end200 ");
    make(NULL);
    r.wait_s = 1.0;
    appears_ms = 150;
    assert_int_equal(raw_tcp.open(&r, &err), SH_OK);
    expect("connect:there:2111:5000 wait0:100 connect:there:2111:5000 wait0:100 connect:there:2111:5000 "
           "talk:-1-200@7200 ");
    raw_tcp.close(&r);
    for (int stops = 0; stops < 2; stops++) {
        make(NULL);
        r.wait_s = 0.15;
        appears_ms = 9000;
        stop_ms = stops ? 100 : 0;
        assert_int_equal(raw_tcp.open(&r, &err), SH_EIO);
        assert_string_equal(err.text, "no device");
        expect(stops ? "connect:there:2111:5000 wait0:100 connect:there:2111:5000 "
                     : "connect:there:2111:5000 wait0:100 connect:there:2111:5000 wait0:100 connect:there:2111:5000 ");
        raw_tcp.close(&r);
        expect("");
    }
    make(NULL);
    fails = "interface";
    assert_int_equal(raw_tcp.open(&r, &err), SH_EIO);
    expect("");
    raw_tcp.close(&r);
    r.state = NULL;
    raw_tcp.close(&r); /* nothing was opened */
}

/* The recording is over with its own connection. */
static void its_own_end(void **state)
{
    struct sh_err err;
    (void)state;
    open_it(NULL);
    work_rc = 3;
    assert_int_equal(raw_tcp.work(&r, &err), 3);
    expect("push200 pass2:512 ");
    assert_int_equal(r.over, 0);
    talks[0]->is_over = 1;
    talks[0]->end[0].received = 5;
    talks[0]->end[1].received = 6;
    raw_tcp.work(&r, &err);
    expect("push200 pass2:512 end200 ");
    assert_int_equal(r.over, 1);
    expect_json("{\"connections\":1,\"refused_connections\":0,\"sent_bytes\":5,\"received_bytes\":6}\n");
    refuse(SH_OK, NULL);
    r.n_sends = 3;
    talks[0]->next_send = 1;
    refuse(SH_ECLOSED, "tcp:there: 2 of 3 --send were not sent: the recording ended before");
    talks[0]->was_reset = 1;
    refuse(SH_ELOST, "tcp:there: the device broke the connection");
    assert_string_equal(warned, "");
    assert_int_equal(raw_tcp.dropped(&r), 0);
    raw_tcp.close(&r);
    make(NULL);
    open_it(NULL);
    assert_int_equal(raw_tcp.finish(&r, &err), SH_OK);
    expect("finish200 end200 ");
    refuse(SH_ETIMEOUT, "tcp:there: the device sent nothing; most devices send only after a command: use --send TEXT, "
                        "or --relay PORT for their driver");
    raw_tcp.close(&r);
}

static void where_clients_come(void **state)
{
    struct sh_err err;
    (void)state;
    make(NULL);
    r.relay = "127.0.0.2:1";
    r.clients = (struct raw_place){.host = "127.0.0.2", .port = {1}};
    assert_int_equal(raw_tcp.open(&r, &err), SH_OK);
    expect("listen:--relay:127.0.0.2:1 stamp77 ");
    assert_string_equal(r.endpoint, "tcp:127.0.0.1:9000");
    raw_tcp.close(&r);
    expect("close77 ");
}

/* Each client gets a connection to the device. The recording goes on after each end. */
static void clients(void **state)
{
    struct pollfd fds[RAW_MAX_POLLS];
    struct sh_err err;
    int timeout_ms = 200;
    (void)state;
    open_it("0");
    assert_int_equal(raw_tcp.wait_for(&r, fds, &timeout_ms), 1);
    assert_true(fds[0].fd == 77 && fds[0].events == POLLIN && timeout_ms == 200);
    n_clients = 2;
    assert_int_equal(raw_tcp.work(&r, &err), 0);
    expect(
        "connect:there:2111:5000 tune101 talk:101-200@7000 connect:there:2111:5000 tune100 talk:100-201@7000 push200 "
        "push201 pass4:512 ");
    assert_string_equal(talks[0]->name, "C1");
    assert_string_equal(talks[1]->name, "C0");
    assert_int_equal(raw_tcp.wait_for(&r, fds, &timeout_ms), 5);
    assert_true(fds[0].fd == 101 && fds[2].fd == 100 && fds[4].fd == 77 && timeout_ms == 198);
    talks[0]->is_over = talks[0]->was_reset = 1;
    talks[0]->end[0].received = 10;
    talks[1]->end[1].received = 20;
    raw_tcp.work(&r, &err);
    expect("push200 push201 pass4:512 end200 ");
    assert_string_equal(warned, "client C1: the connection was reset\n");
    assert_int_equal(r.over, 0);
    talks[1]->was_reset = 1;
    assert_int_equal(raw_tcp.finish(&r, &err), SH_OK);
    expect("finish201 end201 ");
    assert_string_equal(warned, "client C1: the connection was reset\n"); /* the end of the recording is no reset */
    expect_json("{\"connections\":2,\"refused_connections\":0,\"sent_bytes\":10,\"received_bytes\":20}\n");
    refuse(SH_OK, NULL);
    raw_tcp.close(&r);
    expect("close77 ");
}

/* Sixteen connections are there at a time; others wait. */
static void many_clients(void **state)
{
    struct pollfd fds[RAW_MAX_POLLS];
    struct sh_err err;
    int timeout_ms = 200;
    (void)state;
    open_it("0");
    n_clients = MOST + 1;
    raw_tcp.work(&r, &err);
    assert_true(n_talks == MOST && n_clients == 1);
    assert_int_equal(raw_tcp.wait_for(&r, fds, &timeout_ms), 2 * MOST); /* it takes no more */
    talks[3]->is_over = 1;
    raw_tcp.work(&r, &err);
    assert_int_equal(raw_tcp.wait_for(&r, fds, &timeout_ms), 2 * MOST - 1);
    trace[0] = '\0';
    fails = "finish";
    assert_int_equal(raw_tcp.finish(&r, &err), SH_EIO);
    expect("finish200 end200 ");
    raw_tcp.close(&r);
}

/* Where the device takes no connection, or is gone at once, that client is refused, and others may come. */
static void refused_clients(void **state)
{
    struct sh_err err;
    (void)state;
    open_it("0");
    n_clients = 1;
    appears_ms = 10;
    assert_int_equal(raw_tcp.work(&r, &err), 0);
    expect("connect:there:2111:5000 break100 close100 pass0:512 ");
    assert_string_equal(warned, "client C0: no device\n");
    appears_ms = 0;
    n_clients = 1;
    open_rc = SH_ELOST;
    assert_int_equal(raw_tcp.work(&r, &err), 0);
    expect("connect:there:2111:5000 tune100 talk:100-200@7000 end200 pass0:512 ");
    assert_string_equal(warned, "client C0: no device\nclient C0: it is gone\n");
    expect_json("{\"connections\":1,\"refused_connections\":2,\"sent_bytes\":0,\"received_bytes\":0}\n");
    n_clients = 2;
    open_rc = SH_EIO; /* the file can't be written */
    assert_int_equal(raw_tcp.work(&r, &err), SH_EIO);
    assert_string_equal(err.text, "it is gone");
    assert_int_equal(n_clients, 1);
    raw_tcp.close(&r);
}

static void work_may_fail(void **state)
{
    struct sh_err err;
    (void)state;
    open_it(NULL);
    fails = "push";
    assert_int_equal(raw_tcp.work(&r, &err), SH_EIO);
    expect("push200 ");
    fails = NULL;
    work_rc = SH_EIO;
    assert_int_equal(raw_tcp.work(&r, &err), SH_EIO);
    raw_tcp.close(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(its_own_connection, make), cmocka_unit_test_setup(its_own_end, make),
        cmocka_unit_test_setup(where_clients_come, make), cmocka_unit_test_setup(clients, make),
        cmocka_unit_test_setup(many_clients, make),       cmocka_unit_test_setup(refused_clients, make),
        cmocka_unit_test_setup(work_may_fail, make),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
