/* SPDX-License-Identifier: MIT */
/* `record --raw` of UDP: its sockets, the frames that it writes, what is dropped, and what it says of its ports. The
 * sockets and the file are the test's; a port's descriptor is 100 and its place in the list. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "drivers/socket/socket.h"
#include "firmware_sim/app/studio/page_json.h"
#include "firmware_sim/app/studio/record/raw.h"
#include "tests/unit/clock_rig.h"
#include "tests/unit/trace_rig.h"

#define MS INT64_C(1000000)

static struct raw r;
static int n_open, appears_ms, stop_ms;
static int64_t utc_ns;

/* Datagrams of each port: their times, ended by 0. The first has 10 bytes, the second 20, and so on. */
static int64_t times[2][4];
static int n_taken[2];
static uint64_t dropped[2];
static uint32_t dropped_before[2]; /* the next datagram */

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
    return utc_ns;
}

int stamped_open(const char *host, int port, struct stamped_socket *out, struct sh_err *err)
{
    assert_string_equal(host, "127.0.0.9");
    out->fd = -1;
    if (clock_rig_ns < appears_ms * MS) return sh_fail(err, SH_EINPUT, "no such address");
    say("open:%d ", port);
    if (port != 0) out->fd = 100 + n_open++;
    out->own_len = (socklen_t)port;
    return port != 0 ? attempt(err, "open") : SH_OK;
}

void stamped_close(struct stamped_socket *socket)
{
    say("close:%d ", socket->fd);
}

uint64_t stamped_dropped(const struct stamped_socket *socket)
{
    return dropped[socket->fd - 100];
}

int stamped_take(const struct stamped_socket *socket, void *buf, size_t room, struct stamped_datagram *out,
                 struct sh_err *err)
{
    const int k = socket->fd - 100;
    assert_int_equal(room, 65536);
    if (times[k][n_taken[k]] == 0) return attempt(err, "take");
    *out = (struct stamped_datagram){
        .t_ns = times[k][n_taken[k]], .len = (size_t)(10 * ++n_taken[k]), .dropped = dropped_before[k]};
    out->from.ss_family = (sa_family_t)(1 + k);
    out->to.ss_family = (sa_family_t)(11 + k);
    memset(buf, 'a' + k, out->len);
    return 1;
}

void socket_address_text(const struct sockaddr *at, socklen_t len, char *to, size_t room)
{
    (void)at;
    snprintf(to, room, "127.0.0.9:%u", len);
}

struct ethernet_end raw_end_of(const struct sockaddr_storage *at)
{
    return (struct ethernet_end){.port = (uint16_t)at->ss_family};
}

size_t ethernet_put_udp(uint8_t *to, const struct ethernet_end *from, const struct ethernet_end *dest, const void *data,
                        size_t len)
{
    to[0] = *(const uint8_t *)data;
    to[1] = (uint8_t)from->port;
    to[2] = (uint8_t)dest->port;
    return 42 + len;
}

int raw_write(struct raw *of, const struct capture_frame *f, size_t payload, struct sh_err *err)
{
    assert_true(of == &r && f->len == 42 + payload);
    say("%u:%c,%d>%d@%lld+%zu", f->interface, f->bytes[0], f->bytes[1], f->bytes[2], (long long)f->t_ns, payload);
    say(f->lost != 0 ? "-%llu " : " ", (unsigned long long)f->lost);
    return attempt(err, "write");
}

int capture_add_interface(struct capture *capture, const char *name, const char *comment, struct sh_err *err)
{
    assert_string_equal(comment, "Datagrams that scanhead received, with rebuilt headers; times are the kernel's.");
    say("%s ", name);
    capture->n_interfaces++;
    return attempt(err, "interface");
}

int capture_add_statistics(struct capture *capture, uint32_t interface, int64_t t_ns, uint64_t received, uint64_t lost,
                           struct sh_err *err)
{
    assert_ptr_equal(capture, &r.capture);
    say("%u@%lld:%llu-%llu ", interface, (long long)t_ns, (unsigned long long)received, (unsigned long long)lost);
    return attempt(err, "statistics");
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
    r.in.operand[0] = "udp:there";
    strcpy(r.place.host, "127.0.0.9");
    r.place.n_ports = 2;
    r.place.port[0] = 2368;
    r.place.port[1] = 8308;
    trace[0] = '\0';
    fails = NULL;
    memset(times, 0, sizeof times);
    memset(n_taken, 0, sizeof n_taken);
    memset(dropped, 0, sizeof dropped);
    memset(dropped_before, 0, sizeof dropped_before);
    n_open = appears_ms = stop_ms = 0;
    clock_rig_ns = 0;
    utc_ns = 5000;
    return 0;
}

static void open_it(void)
{
    struct sh_err err;
    assert_int_equal(raw_udp.open(&r, &err), SH_OK);
    trace[0] = '\0';
}

static void its_sockets(void **state)
{
    struct sh_err err;
    struct pollfd fds[2];
    int timeout_ms = 200;
    (void)state;
    assert_int_equal(raw_udp.open(&r, &err), SH_OK);
    expect("open:0 close:-1 open:2368 udp:127.0.0.9:2368 open:8308 udp:127.0.0.9:8308 ");
    assert_string_equal(r.endpoint, "udp:127.0.0.9:2368,8308");
    assert_int_equal(raw_udp.wait_for(&r, fds, &timeout_ms), 2);
    assert_true(fds[0].fd == 100 && fds[1].fd == 101 && timeout_ms == 200);
    assert_true(fds[0].events == POLLIN && fds[1].events == POLLIN);
    raw_udp.close(&r);
    expect("close:100 close:101 ");
}

/* The address may appear later, while --wait lasts. Where it does not, opening a port says why. */
static void a_late_address(void **state)
{
    struct sh_err err;
    (void)state;
    r.wait_s = 1.0;
    appears_ms = 250;
    assert_int_equal(raw_udp.open(&r, &err), SH_OK);
    expect("wait0:100 wait0:100 wait0:100 open:0 close:-1 open:2368 udp:127.0.0.9:2368 open:8308 udp:127.0.0.9:8308 ");
    raw_udp.close(&r);
    for (int stops = 0; stops < 2; stops++) {
        make(NULL);
        r.wait_s = 0.25;
        appears_ms = 9000;
        stop_ms = stops ? 100 : 0;
        assert_int_equal(raw_udp.open(&r, &err), SH_EINPUT);
        assert_string_equal(err.text, "no such address");
        expect(stops ? "wait0:100 close:-1 " : "wait0:100 wait0:100 wait0:100 close:-1 ");
        raw_udp.close(&r);
        expect("close:-1 ");
    }
}

static void opening_may_fail(void **state)
{
    struct sh_err err;
    (void)state;
    fails = "open";
    assert_int_equal(raw_udp.open(&r, &err), SH_EIO);
    expect("open:0 close:-1 open:2368 ");
    raw_udp.close(&r);
    expect("close:100 "); /* the second one was not tried */
    make(NULL);
    fails = "interface";
    assert_int_equal(raw_udp.open(&r, &err), SH_EIO);
    raw_udp.close(&r);
    make(NULL);
    raw_udp.close(&r); /* nothing was opened */
    assert_int_equal(raw_udp.dropped(&r), 0);
}

/* Datagrams of all ports are written in the order of their times, with what was dropped before each. */
static void datagrams(void **state)
{
    struct sh_err err;
    (void)state;
    memcpy(times, (const int64_t[2][4]){{10, 40}, {20, 30}}, sizeof times);
    open_it();
    dropped_before[1] = 3;
    assert_int_equal(raw_udp.work(&r, &err), 4);
    expect("0:a,1>11@10+10 1:b,2>12@20+10-3 1:b,2>12@30+20 0:a,1>11@40+20 ");
    times[1][2] = 50;
    dropped_before[1] = 5;
    assert_int_equal(raw_udp.work(&r, &err), 1);
    expect("1:b,2>12@50+30-2 ");
    assert_int_equal(raw_udp.work(&r, &err), 0);
    fails = "take";
    assert_int_equal(raw_udp.work(&r, &err), SH_EIO);
    fails = "write";
    times[0][2] = 60;
    assert_int_equal(raw_udp.work(&r, &err), SH_EIO);
    raw_udp.close(&r);
}

static void put_all(struct json *json, const void *of)
{
    json_open_object(json, NULL);
    raw_udp.put(json, of);
    json_close_object(json);
}

/* At the end the statistics of each port are written, not with an earlier time than the last packet. A recording with
 * dropped packets is incomplete. */
static void the_end(void **state)
{
    struct sh_err err;
    struct web_body body;
    (void)state;
    memcpy(times, (const int64_t[2][4]){{10, 40}, {20}}, sizeof times);
    open_it();
    assert_int_equal(raw_udp.work(&r, &err), 3);
    trace[0] = '\0';
    assert_int_equal(raw_udp.check(&r, &err), SH_OK);
    dropped[0] = 7;
    dropped[1] = 1;
    r.last_t_ns = 4999;
    assert_int_equal(raw_udp.finish(&r, &err), SH_OK);
    expect("0@5000:9-7 1@5000:2-1 ");
    r.last_t_ns = 5001;
    fails = "statistics";
    assert_int_equal(raw_udp.finish(&r, &err), SH_EIO);
    expect("0@5001:9-7 ");
    assert_int_equal(raw_udp.dropped(&r), 8);
    assert_int_equal(raw_udp.check(&r, &err), SH_ELOST);
    assert_string_equal(err.text, "udp:there: the recording is not complete: the system dropped 8 packets; a larger "
                                  "net.core.rmem_max gives it more room");
    assert_int_equal(page_json(put_all, &r, &body, &err), SH_OK);
    assert_string_equal(body.bytes, "{\"sources\":[{\"endpoint\":\"udp:127.0.0.9:2368\",\"packets\":2,\"bytes\":30,"
                                    "\"dropped\":7},{\"endpoint\":\"udp:127.0.0.9:8308\",\"packets\":1,\"bytes\":10,"
                                    "\"dropped\":1}]}\n");
    free(body.bytes);
    raw_udp.close(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(its_sockets, make),      cmocka_unit_test_setup(a_late_address, make),
        cmocka_unit_test_setup(opening_may_fail, make), cmocka_unit_test_setup(datagrams, make),
        cmocka_unit_test_setup(the_end, make),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
