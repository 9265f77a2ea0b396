/* SPDX-License-Identifier: MIT */
/* The usbip back end and the usb link over it, with a client of the test's own and no kernel. */
#include "tests/unit/usbip_client.h"

#include <poll.h>

#include "core/rng.h"

enum { EPIPE_WIRE = -32, ECONNRESET_WIRE = -104, ESHUTDOWN_WIRE = -108 };

static struct reply r;

static uint64_t random_bits(uint64_t seed, uint64_t round, uint64_t i)
{
    return rng_u64(rng_mix(seed << 32 | round), i);
}

static void test_list(void **state)
{
    (void)state;
    struct bench bench = usbip_bench("N");
    struct client c = {.bench = &bench, .fd = dial(bench_port(&bench))};
    const uint8_t request[8] = {0x01, 0x11, 0x80, 0x05}, head[12] = {0x01, 0x11, 0, 5, 0, 0, 0, 0, 0, 0, 0, 1};
    const uint8_t device[16] = {0, 0, 0, 3, 0x12, 0x09, 0x00, 0x01, 0x01, 0x00, 0xef, 2, 1, 0, 1, 3};
    const uint8_t interfaces[12] = {2, 2, 0, 0, 10, 0, 0, 0, 0xff, 0x53, 0x48, 0};
    uint8_t back[12 + 312 + 12];
    for (int i = 0; i < 2; i++) { /* a connection may ask again */
        client_write(&c, request, sizeof request);
        assert_true(client_read(&c, back, sizeof back));
        assert_memory_equal(back, head, sizeof head);
        assert_memory_equal(back + 12 + 296, device, sizeof device);
        assert_memory_equal(back + 12 + 312, interfaces, sizeof interfaces);
    }
    close(c.fd);
    bench_close(&bench);
}

static void test_import(void **state)
{
    (void)state;
    struct bench bench = usbip_bench("SN-77");
    struct client c, other = {.bench = &bench};
    static const uint8_t serial[] = {12, 3, 'S', 0, 'N', 0, '-', 0, '7', 0, '7', 0};
    client_import(&c, &bench);
    assert_int_equal(client_control(&c, &r, 0x80, 6, 0x0100, 0, 18, NULL), 0);
    assert_int_equal(r.actual, 18);
    assert_int_equal(client_control(&c, &r, 0x80, 6, 0x0305, 0x0409, 255, NULL), 0);
    assert_int_equal(r.actual, sizeof serial);
    assert_memory_equal(r.data, serial, sizeof serial);
    /* A second host gets busy, and one that wants another device gets that there is none. */
    uint8_t request[40] = {0x01, 0x11, 0x80, 0x03, 0, 0, 0, 0, '1', '-', '1'}, back[8];
    other.fd = dial(bench_port(&bench));
    client_write(&other, request, sizeof request);
    assert_true(client_read(&other, back, 8));
    assert_int_equal(back[7], 2);
    request[10] = '2';
    client_write(&other, request, sizeof request);
    assert_true(client_read(&other, back, 8));
    assert_int_equal(back[7], 4); /* ST_NODEV in tools/usb/usbip of the kernel */
    /* The other client has the device when the first one is gone: closing is unplugging. */
    close(c.fd);
    request[10] = '1';
    for (const int64_t end_ms = now_ms() + DEADLINE_MS;;) {
        assert_true(now_ms() < end_ms);
        client_write(&other, request, sizeof request);
        assert_true(client_read(&other, back, 8));
        if (back[7] == 0) break;
        assert_int_equal(back[7], 2);
    }
    close(other.fd);
    bench_close(&bench);
}

/* Commands go in and a stream comes out, in URBs of different lengths, each in its order and without loss. */
static void test_stream(void **state)
{
    (void)state;
    static uint8_t sent[1 << 20], got[1 << 20];
    struct bench bench = usbip_bench("N");
    struct client c;
    client_import(&c, &bench);
    client_configure(&c);
    client_open_stream(&c);
    for (size_t i = 0; i < sizeof sent; i++)
        sent[i] = (uint8_t)random_bits(3, i, 0);
    uint32_t next = c.seqnum + 1;
    for (int i = 0; i < 8; i++)
        client_submit(&c, 1, 3, NULL, NULL, 65536);
    size_t out = 0, in = 0;
    for (size_t step = 1; in < sizeof sent; step = step * 5 % 100003) {
        size_t n = step < sizeof sent - out ? step : sizeof sent - out;
        ssize_t moved = bench.ops->write(bench.link, 1, sent + out, n);
        assert_true(moved >= 0);
        out += (size_t)moved;
        struct pollfd slot = {.fd = c.fd, .events = POLLIN};
        if (poll(&slot, 1, 0) == 1) {
            assert_true(client_reply(&c, &r, 1));
            assert_int_equal(r.status, 0);
            assert_int_equal(r.seqnum, next++);
            memcpy(got + in, r.data, r.actual);
            in += r.actual;
            client_submit(&c, 1, 3, NULL, NULL, 65536);
        }
        bench.n_queue = 0;
        bench_poll(&bench, 2, 0);
    }
    assert_memory_equal(sent, got, sizeof sent);
    close(c.fd);
    bench_close(&bench);
}

/* Bytes that a session left are not for the next one. After a write has reported the end, the owner reads no more. */
static void test_left_over(void **state)
{
    (void)state;
    struct bench bench = usbip_bench("N");
    struct client c;
    client_import(&c, &bench);
    client_configure(&c);
    client_open_stream(&c);
    const uint32_t seqnum = client_submit(&c, 0, 3, NULL, "*IDN?\n", 6);
    assert_int_equal(bench_expect(&bench, LINK_READABLE, 0).session, 1);
    assert_int_equal(client_control(&c, &r, 0x41, 0x22, 0, 2, 0, NULL), 0);
    assert_int_equal(bench.ops->write(bench.link, 1, "reply", 5), SH_ECLOSED);
    assert_true(client_reply(&c, &r, 0));
    assert_true(r.seqnum == seqnum && r.status == 0 && r.actual == 6);
    assert_int_equal(bench_expect(&bench, LINK_CLOSED, 0).session, 1);
    close(c.fd);
    bench_close(&bench);
}

static void test_commands(void **state)
{
    (void)state;
    struct bench bench = usbip_bench("N");
    struct client c;
    char text[64] = "";
    client_import(&c, &bench);
    client_configure(&c);
    /* The stream opens with its first bytes. */
    uint32_t seqnum = client_submit(&c, 0, 3, NULL, "*IDN?\n", 6);
    assert_int_equal(bench_expect(&bench, LINK_OPENED, 0).session, 1);
    assert_int_equal(bench_expect(&bench, LINK_READABLE, 0).session, 1);
    assert_int_equal(bench.ops->read(bench.link, 1, text, sizeof text), 6);
    assert_memory_equal(text, "*IDN?\n", 6);
    assert_true(client_reply(&c, &r, 0));
    assert_int_equal(r.seqnum, seqnum);
    assert_int_equal(r.actual, 6);
    /* The console opens with DTR. Earlier bytes wait, as on a port that is not open. */
    seqnum = client_submit(&c, 0, 1, NULL, "*RST\n", 5);
    bench_poll(&bench, 0, 20);
    assert_int_equal(bench.n_queue, 0);
    uint8_t setup[8] = {0x21, 0x22, 3};
    client_submit(&c, 0, 0, setup, NULL, 0);
    assert_int_equal(bench_expect(&bench, LINK_OPENED, 0).session, 0);
    assert_true(client_reply(&c, &r, 0));
    bench_read_all(&bench, 0, text, 5);
    assert_memory_equal(text, "*RST\n", 5);
    assert_true(client_reply(&c, &r, 0));
    assert_int_equal(r.seqnum, seqnum);
    /* The session ends without DTR, after earlier bytes were read. */
    bench.n_queue = 0;
    client_submit(&c, 0, 1, NULL, "BYE\n", 4);
    setup[2] = 2;
    client_submit(&c, 0, 0, setup, NULL, 0);
    client_submit(&c, 0, 1, NULL, "next", 4);
    setup[2] = 1;
    client_submit(&c, 0, 0, setup, NULL, 0);
    assert_int_equal(bench_expect(&bench, LINK_READABLE, 0).session, 0);
    assert_int_equal(bench.ops->read(bench.link, 0, text, sizeof text), 4);
    assert_memory_equal(text, "BYE\n", 4);
    assert_int_equal(bench.ops->read(bench.link, 0, text, sizeof text), 0);
    assert_int_equal(bench_expect(&bench, LINK_CLOSED, 0).session, 0);
    assert_int_equal(bench_expect(&bench, LINK_OPENED, 0).session, 0);
    bench_read_all(&bench, 0, text, 4);
    assert_memory_equal(text, "next", 4);
    for (int i = 0; i < 4; i++)
        assert_true(client_reply(&c, &r, 0));
    /* Unplugging ends both. */
    close(c.fd);
    assert_int_equal(bench_expect(&bench, LINK_CLOSED, 0).session, 0);
    assert_int_equal(bench_expect(&bench, LINK_CLOSED, 0).session, 1);
    assert_int_equal(bench.ops->write(bench.link, 1, "x", 1), SH_ECLOSED);
    bench_close(&bench);
}

static void test_console_requests(void **state)
{
    (void)state;
    struct bench bench = usbip_bench("N");
    struct client c;
    static const uint8_t coding[7] = {0x80, 0x25, 0, 0, 2, 1, 7}, bad[7] = {0x80, 0x25, 0, 0, 3, 1, 7};
    client_import(&c, &bench);
    client_configure(&c);
    assert_int_equal(client_control(&c, &r, 0xa1, 0x21, 0, 0, 7, NULL), 0);
    assert_int_equal(le_get32(r.data), 115200);
    assert_int_equal(r.data[6], 8);
    assert_int_equal(client_control(&c, &r, 0x21, 0x20, 0, 0, 7, coding), 0);
    assert_int_equal(client_control(&c, &r, 0x21, 0x20, 0, 0, 7, bad), EPIPE_WIRE);
    assert_int_equal(client_control(&c, &r, 0x21, 0x20, 0, 0, 6, coding), EPIPE_WIRE);
    assert_int_equal(client_control(&c, &r, 0x21, 0x20, 0, 1, 7, coding), EPIPE_WIRE);
    assert_int_equal(client_control(&c, &r, 0xa1, 0x21, 0, 0, 7, NULL), 0);
    assert_memory_equal(r.data, coding, 7);
    assert_int_equal(client_control(&c, &r, 0x21, 0x23, 100, 0, 0, NULL), 0); /* break */
    assert_int_equal(client_control(&c, &r, 0x21, 0x22, 0, 0, 1, coding), EPIPE_WIRE);
    assert_int_equal(client_control(&c, &r, 0x21, 0x24, 0, 0, 0, NULL), EPIPE_WIRE);
    assert_int_equal(client_control(&c, &r, 0x41, 0x22, 2, 2, 0, NULL), EPIPE_WIRE);
    assert_int_equal(client_control(&c, &r, 0x41, 0x22, 1, 0, 0, NULL), EPIPE_WIRE);
    close(c.fd);
    bench_close(&bench);
}

static void expect_ready(struct client *c)
{
    static const uint8_t ready[10] = {0xa1, 0x20, 0, 0, 0, 0, 2, 0, 3, 0};
    uint32_t seqnum = client_submit(c, 1, 2, NULL, NULL, 16);
    assert_true(client_reply(c, &r, 1));
    assert_int_equal(r.seqnum, seqnum);
    assert_int_equal(r.actual, sizeof ready);
    assert_memory_equal(r.data, ready, sizeof ready);
}

/* The request waits: its answer would come before that of the unlink. */
static void expect_no_notice(struct client *c)
{
    client_unlink(c, client_submit(c, 1, 2, NULL, NULL, 16));
    assert_true(client_reply(c, &r, 0));
    assert_int_equal(r.command, 4);
    assert_int_equal(r.status, ECONNRESET_WIRE);
}

/* The interrupt endpoint reports that the line is ready: when the interface comes to life, and to each program that
 * opens the port, where DTR rises. The endpoint does not report while DTR stays up, nor when it falls. DTR is bit 0;
 * bits 2 to 15 are reserved (PSTN 1.2, table 18), and Linux's f_acm takes any. */
static void test_serial_state(void **state)
{
    (void)state;
    struct bench bench = usbip_bench("N");
    struct client c;
    client_import(&c, &bench);
    client_configure(&c);
    expect_ready(&c);
    expect_no_notice(&c);
    static const struct {
        unsigned lines;
        int told;
    } steps[] = {{3, 1}, {1, 0}, {3, 0}, {2, 0}, {1, 1}, {0, 0}, {1, 1}, {0xfffd, 0}, {0x0300, 0}, {0xff01, 1}};
    for (size_t i = 0; i < sizeof steps / sizeof steps[0]; i++) {
        assert_int_equal(client_control(&c, &r, 0x21, 0x22, steps[i].lines, 0, 0, NULL), 0);
        if (steps[i].told) expect_ready(&c);
        expect_no_notice(&c);
    }
    close(c.fd);
    bench_close(&bench);
}

static void test_unlink(void **state)
{
    (void)state;
    struct bench bench = usbip_bench("N");
    struct client c;
    client_import(&c, &bench);
    client_configure(&c);
    client_open_stream(&c);
    uint32_t first = client_submit(&c, 1, 3, NULL, NULL, 512), second = client_submit(&c, 1, 3, NULL, NULL, 512);
    uint32_t unlink = client_unlink(&c, first);
    assert_true(client_reply(&c, &r, 0));
    assert_int_equal(r.command, 4);
    assert_int_equal(r.seqnum, unlink);
    assert_int_equal(r.status, ECONNRESET_WIRE);
    bench_write_all(&bench, 1, "abc", 3); /* into the other one: nothing is lost with the first */
    assert_true(client_reply(&c, &r, 1));
    assert_int_equal(r.seqnum, second);
    assert_int_equal(r.actual, 3);
    /* The numbers are too late, unknown, and the unlink's own: all are "not pending". */
    const uint32_t victims[] = {second, 0x7fffffff, c.seqnum + 3};
    for (int i = 0; i < 3; i++) {
        client_unlink(&c, victims[i]);
        assert_true(client_reply(&c, &r, 0));
        assert_int_equal(r.command, 4);
        assert_int_equal(r.status, 0);
    }
    /* One endpoint is halted, and two are missing, the last of all among them. */
    assert_int_equal(client_control(&c, &r, 0x02, 3, 0, 0x83, 0, NULL), 0);
    client_submit(&c, 1, 3, NULL, NULL, 512);
    assert_true(client_reply(&c, &r, 1));
    assert_int_equal(r.status, EPIPE_WIRE);
    static const uint32_t missing[] = {9, 15};
    for (int i = 0; i < 2; i++) {
        client_submit(&c, 1, missing[i], NULL, NULL, 512);
        assert_true(client_reply(&c, &r, 1));
        assert_int_equal(r.status, ESHUTDOWN_WIRE);
    }
    /* This control URB contradicts its setup. */
    uint8_t setup[8] = {0x80, 6, 0, 1, 0, 0, 18, 0};
    client_submit(&c, 1, 0, setup, NULL, 8);
    assert_true(client_reply(&c, &r, 1));
    assert_int_equal(r.status, EPIPE_WIRE);
    close(c.fd);
    bench_close(&bench);
}

/* The link hangs up on a client that breaks the protocol, and serves the next one. */
static void expect_hang_up(const void *bytes, size_t len, int imported)
{
    struct bench bench = usbip_bench("N");
    struct client c;
    if (imported)
        client_import(&c, &bench);
    else
        c = (struct client){.bench = &bench, .fd = dial(bench_port(&bench))};
    client_write(&c, bytes, len);
    uint8_t byte;
    assert_false(client_read(&c, &byte, 1));
    close(c.fd);
    client_import(&c, &bench);
    client_configure(&c);
    close(c.fd);
    bench_close(&bench);
}

static void test_broken(void **state)
{
    (void)state;
    static const uint8_t version[8] = {0x01, 0x10, 0x80, 0x05}, code[8] = {0x01, 0x11, 0x80, 0x04};
    uint8_t urb[HEADER] = {0};
    expect_hang_up(version, sizeof version, 0);
    expect_hang_up(code, sizeof code, 0);
    static const struct {
        int at;
        uint32_t value;
    } edits[] = {{0, 0}, {0, 3}, {8, 0x10003}, {12, 2}, {16, 16}, {24, 0x7fffffff}, {32, 1}};
    for (size_t i = 0; i < sizeof edits / sizeof edits[0]; i++) {
        memset(urb, 0, sizeof urb);
        be_put32(urb, 1);
        be_put32(urb + 4, 1);
        be_put32(urb + 8, DEVID);
        be_put32(urb + 12, 1);
        be_put32(urb + 16, 3);
        be_put32(urb + 24, 512);
        be_put32(urb + edits[i].at, edits[i].value);
        expect_hang_up(urb, sizeof urb, 1);
    }
}

/* At the end of a run the written bytes are there, whatever requests are still on their way. */
static void test_close(void **state)
{
    (void)state;
    struct bench bench = usbip_bench("N");
    struct client c;
    static uint8_t data[60000];
    client_import(&c, &bench);
    client_configure(&c);
    client_open_stream(&c);
    client_submit(&c, 1, 3, NULL, NULL, 65536);
    client_submit(&c, 1, 3, NULL, NULL, 65536);
    bench_expect(&bench, LINK_WRITABLE, 2);
    bench_write_all(&bench, 1, data, sizeof data);
    client_submit(&c, 1, 3, NULL, NULL, 65536); /* never read */
    shutdown(c.fd, SHUT_WR);                    /* so that the link need not wait for us */
    bench_close(&bench);
    c.bench = NULL;
    assert_true(client_reply(&c, &r, 1));
    assert_int_equal(r.actual, sizeof data);
    assert_int_equal(r.status, 0);
    close(c.fd);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_list),         cmocka_unit_test(test_import),   cmocka_unit_test(test_stream),
        cmocka_unit_test(test_left_over),    cmocka_unit_test(test_commands), cmocka_unit_test(test_console_requests),
        cmocka_unit_test(test_serial_state), cmocka_unit_test(test_unlink),   cmocka_unit_test(test_broken),
        cmocka_unit_test(test_close),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
