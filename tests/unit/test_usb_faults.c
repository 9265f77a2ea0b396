/* SPDX-License-Identifier: MIT */
/* USB faults on request, in the device core and over USB/IP, as a host sees them. No byte is lost. */
#include <errno.h>
#include <fcntl.h>
#include <netinet/tcp.h>

#include "core/monotonic.h"
#include "tests/unit/usb_host.h"
#include "tests/unit/usb_models.h"
#include "tests/unit/usbip_client.h"

enum { STREAM = 1, STREAM_IN = 0x83, EPIPE_WIRE = -32, ECONNRESET_WIRE = -104, ESHUTDOWN_WIRE = -108 };

static struct reply r;

static int fault(struct bench *bench, enum link_fault what, uint32_t n, double for_ms)
{
    return bench->ops->fault(bench->link, what, STREAM, n, for_ms);
}

/* ---- the core */

/* A transfer that is asked to end early ends in a short packet, and its rest comes in the next one. */
static void test_short_packets(void **state)
{
    (void)state;
    static const struct {
        uint32_t room, written, first;
    } rows[] = {{4096, 3000, 1500}, {4096, 2048, 1023}, {4096, 1024, 511},
                {4096, 3, 1},       {4096, 2, 1},       {1024, 5000, 511}};
    uint8_t data[5000];
    for (size_t i = 0; i < sizeof data; i++)
        data[i] = (uint8_t)(i * 7 + i / 256);
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct host *host = host_new(&pair_model, USB_RATE_HIGH, USB_RATE_HIGH);
        host_configure(host);
        uint8_t got[5000];
        size_t n = 0;
        for (uint64_t id = 1; id <= 8; id++)
            host_submit(host, id, 0x81, NULL, rows[i].room);
        usb_device_shorten(host->device, 0x81, 1);
        assert_int_equal(usb_device_write(host->device, 0x81, data, rows[i].written), rows[i].written);
        assert_int_equal(host->done[0]->actual, rows[i].first);
        assert_true(rows[i].first % 512 != 0 || rows[i].first == 0);
        for (int k = 0; k < host->n_done; k++) {
            memcpy(got + n, host->done[k]->data, host->done[k]->actual);
            n += host->done[k]->actual;
        }
        assert_int_equal(n, rows[i].written);
        assert_memory_equal(got, data, n);
        while (host->n_done > 0)
            host_expect(host, host->done[0]->id, USB_OK, host->done[0]->actual);
        const int before = host->n_done;
        assert_int_equal(usb_device_write(host->device, 0x81, data, 100), 100); /* only so many */
        assert_int_equal(host->n_done, before + 1);
        host_expect(host, host->done[0]->id, USB_OK, 100);
        usb_device_detach(host->device);
        while (host->n_done > 0)
            host_expect(host, host->done[0]->id, USB_GONE, 0);
        host_free(host);
    }
}

static void test_descriptor_length(void **state)
{
    (void)state;
    struct host *host = host_new(&pair_model, USB_RATE_HIGH, USB_RATE_HIGH);
    uint8_t whole[USB_MAX_CONFIG];
    const int len = host_control(host, 0x80, USB_REQ_GET_DESCRIPTOR, USB_DT_CONFIG << 8, 0, sizeof whole, NULL);
    memcpy(whole, host_in, (size_t)len);
    assert_int_equal(le_get16(whole + 2), len);
    usb_device_lengthen(host->device, 7);
    assert_int_equal(host_control(host, 0x80, USB_REQ_GET_DESCRIPTOR, USB_DT_CONFIG << 8, 0, 9, NULL), 9);
    assert_int_equal(le_get16(host_in + 2), len + 7);
    assert_int_equal(host_control(host, 0x80, USB_REQ_GET_DESCRIPTOR, USB_DT_CONFIG << 8, 0, sizeof whole, NULL), len);
    le_put16(whole + 2, (uint16_t)(len + 7));
    assert_memory_equal(host_in, whole, (size_t)len); /* nothing else of it is wrong */
    assert_int_equal(host_control(host, 0x80, USB_REQ_GET_DESCRIPTOR, USB_DT_CONFIG << 8, 0, 3, NULL), 3);
    usb_device_lengthen(host->device, 0);
    host_control(host, 0x80, USB_REQ_GET_DESCRIPTOR, USB_DT_CONFIG << 8, 0, 9, NULL);
    assert_int_equal(le_get16(host_in + 2), len);
    host_free(host);
}

/* Slow requests are answered one after the other, each after the time that one takes, and one may be withdrawn. */
static void test_slow_requests(void **state)
{
    (void)state;
    struct host *host = host_new(&pair_model, USB_RATE_HIGH, USB_RATE_HIGH);
    struct usb_transfer other = {.id = 10}; /* a list that the last one was in before */
    struct usb_transfer request[3] = {{.id = 7}, {.id = 8}, {.id = 9, .next = &other}}, *held = NULL;
    assert_int_equal(usb_has_to_wait(host->device, NULL), 0);
    assert_true(usb_due_ns(NULL) == INT64_MAX);
    usb_device_set_slow(host->device, 3.6e6); /* an hour: none of them is due while this test runs */
    assert_int_equal(usb_has_to_wait(host->device, NULL), 1);
    for (int i = 0; i < 3; i++)
        usb_hold(host->device, &held, &request[i]);
    const int64_t hour_ns = INT64_C(3600000000000);
    assert_true(request[1].due_ns - request[0].due_ns == hour_ns);
    assert_true(request[2].due_ns - request[1].due_ns == hour_ns);
    assert_true(usb_due_ns(held) == request[0].due_ns);
    assert_null(usb_take_due(&held));
    assert_null(usb_let_go(&held, 6));
    assert_ptr_equal(usb_let_go(&held, 8), &request[1]);
    assert_true(request[2].due_ns - request[0].due_ns == hour_ns); /* the time of the one between is not waited for */
    usb_device_set_slow(host->device, 0.0);
    assert_int_equal(usb_has_to_wait(host->device, held), 1); /* a quick one does not overtake those */
    const int64_t before_ns = monotonic_ns();
    assert_ptr_equal(usb_let_go(&held, 7), &request[0]); /* the next one begins now */
    assert_in_range(request[2].due_ns - before_ns, hour_ns, hour_ns + monotonic_ns() - before_ns);
    request[2].due_ns = 0;
    assert_ptr_equal(usb_take_due(&held), &request[2]);
    assert_null(held);
    host_free(host);
}

static unsigned device_status(struct host *host)
{
    assert_int_equal(host_control(host, 0x80, USB_REQ_GET_STATUS, 0, 0, 2, NULL), 2);
    return le_get16(host_in);
}

/* A device that begins anew has been reset: it is awake, its transfers are gone, and U1 is off (USB 3.2, 9.4.9). A
 * device that has no more than an address keeps that. */
static void test_restart(void **state)
{
    (void)state;
    struct host *host = host_new(&pair_model, USB_RATE_SUPER, USB_RATE_SUPER);
    assert_int_equal(host_control(host, 0x00, USB_REQ_SET_ADDRESS, 5, 0, 0, NULL), 0);
    usb_device_restart(host->device);
    assert_int_equal(host->n_changes, 0);
    const unsigned plain = device_status(host);
    host_configure(host);
    assert_int_equal(host_control(host, 0x00, USB_REQ_SET_FEATURE, USB_DEVICE_U1_ENABLE, 0, 0, NULL), 0);
    assert_int_equal(device_status(host), plain | 1u << USB_DEV_STAT_U1_ENABLED);
    host_submit(host, 1, 0x81, NULL, 64);
    usb_device_suspend(host->device, 1);
    usb_device_restart(host->device);
    host_expect(host, 1, USB_GONE, 0);
    assert_int_equal(device_status(host), plain);
    host_submit(host, 2, 0x81, NULL, 64);
    assert_int_equal(usb_device_write(host->device, 0x81, "abc", 3), 3);
    host_expect(host, 2, USB_OK, 3);
    usb_device_detach(host->device);
    usb_device_restart(host->device);
    assert_int_equal(host_control(host, 0x80, USB_REQ_GET_STATUS, 0, 0, 2, NULL), USB_STALL);
    host_free(host);
}

/* ---- a head over USB/IP */

static void expect_urb(struct client *c, uint32_t seqnum, int status, uint32_t actual)
{
    assert_true(client_reply(c, &r, 1));
    assert_int_equal(r.seqnum, seqnum);
    assert_int_equal(r.status, status);
    assert_int_equal(r.actual, actual);
}

/* The endpoint is halted until the host clears it. The waiting bytes are sent then. */
static void test_stall(void **state)
{
    (void)state;
    struct bench bench = usbip_bench("N");
    struct client c;
    client_import(&c, &bench);
    client_configure(&c);
    assert_int_equal(fault(&bench, LINK_FAULT_ENDPOINT_STALL, 0, 0.0), SH_ESTATE); /* no session */
    client_open_stream(&c);
    const uint32_t first = client_submit(&c, 1, 3, NULL, NULL, 512), second = client_submit(&c, 1, 3, NULL, NULL, 512);
    bench_expect(&bench, LINK_WRITABLE, 1u << STREAM);
    assert_int_equal(fault(&bench, LINK_FAULT_ENDPOINT_STALL, 0, 0.0), SH_OK);
    expect_urb(&c, first, EPIPE_WIRE, 0);
    expect_urb(&c, second, EPIPE_WIRE, 0);
    expect_urb(&c, client_submit(&c, 1, 3, NULL, NULL, 512), EPIPE_WIRE, 0);
    assert_int_equal(bench.ops->write(bench.link, STREAM, "abc", 3), 0);
    assert_int_equal(client_control(&c, &r, 0x02, 1, 0, STREAM_IN, 0, NULL), 0);
    const uint32_t third = client_submit(&c, 1, 3, NULL, NULL, 512);
    bench.n_queue = 0;
    bench_expect(&bench, LINK_WRITABLE, 1u << STREAM);
    assert_int_equal(bench.ops->write(bench.link, STREAM, "abc", 3), 3);
    expect_urb(&c, third, 0, 3);
    assert_memory_equal(r.data, "abc", 3);
    close(c.fd);
    bench_close(&bench);
}

/* Sessions end, and the device stays configured: another session can begin at once. */
static void test_reset(void **state)
{
    (void)state;
    struct bench bench = usbip_bench("N");
    struct client c;
    assert_int_equal(fault(&bench, LINK_FAULT_BUS_RESET, 0, 0.0), SH_ESTATE); /* no host */
    client_import(&c, &bench);
    client_configure(&c);
    client_open_stream(&c);
    const uint32_t seqnum = client_submit(&c, 1, 3, NULL, NULL, 512);
    bench_expect(&bench, LINK_WRITABLE, 1u << STREAM);
    assert_int_equal(fault(&bench, LINK_FAULT_BUS_RESET, 0, 0.0), SH_OK);
    expect_urb(&c, seqnum, ESHUTDOWN_WIRE, 0);
    assert_int_equal(bench.ops->write(bench.link, STREAM, "abc", 3), SH_ECLOSED);
    assert_int_equal(bench_expect(&bench, LINK_CLOSED, 0).session, STREAM);
    assert_string_equal(bench_expect(&bench, LINK_NOTICE, 0).peer,
                        "the host reset the bus: sessions ended, the device stays plugged in");
    assert_int_equal(client_control(&c, &r, 0x80, 0, 0, 0, 2, NULL),
                     0); /* by which a client tells it from unplugging */
    client_open_stream(&c);
    close(c.fd);
    bench_close(&bench);
}

/* A reader without a pending transfer learns of the reset by its next one. A later reader does not learn of it. */
static void test_reset_of_idle(void **state)
{
    (void)state;
    struct bench bench = usbip_bench("N");
    struct client c;
    client_import(&c, &bench);
    client_configure(&c);
    for (int is_new = 0; is_new < 2; is_new++) {
        client_open_stream(&c);
        assert_int_equal(fault(&bench, LINK_FAULT_BUS_RESET, 0, 0.0), SH_OK);
        assert_int_equal(bench_expect(&bench, LINK_CLOSED, 0).session, STREAM);
        bench_expect(&bench, LINK_NOTICE, 0);
        if (!is_new) expect_urb(&c, client_submit(&c, 1, 3, NULL, NULL, 512), ESHUTDOWN_WIRE, 0);
        client_open_stream(&c);
        const uint32_t seqnum = client_submit(&c, 1, 3, NULL, NULL, 512);
        bench_expect(&bench, LINK_WRITABLE, 1u << STREAM);
        assert_int_equal(bench.ops->write(bench.link, STREAM, "abc", 3), 3);
        expect_urb(&c, seqnum, 0, 3);
        assert_int_equal(client_control(&c, &r, 0x41, 0x22, 0, 2, 0, NULL), 0);
        assert_int_equal(bench_expect(&bench, LINK_CLOSED, 0).session, STREAM);
    }
    close(c.fd);
    bench_close(&bench);
}

/* The device goes, and can't be attached; then it is at the same port again. */
static void test_unplug(void **state)
{
    (void)state;
    struct bench bench = usbip_bench("N");
    struct client c;
    char before[300], after[300], byte;
    bench.ops->endpoint(bench.link, before, sizeof before);
    for (int round = 0; round < 2; round++) {
        client_import(&c, &bench);
        client_configure(&c);
        client_open_stream(&c);
        client_submit(&c, 1, 3, NULL, NULL, 512);
        bench_expect(&bench, LINK_WRITABLE, 1u << STREAM);
        assert_int_equal(fault(&bench, LINK_FAULT_UNPLUG, 0, 0.0), SH_OK);
        assert_int_equal(fault(&bench, LINK_FAULT_UNPLUG, 0, 0.0), SH_ESTATE);
        assert_true(recv(c.fd, &byte, 1, 0) <= 0);
        close(c.fd);
        assert_int_equal(bench_expect(&bench, LINK_CLOSED, 0).session, STREAM);
        assert_int_equal(dial(bench_port(&bench)), -1);
        assert_string_equal(bench_expect(&bench, LINK_NOTICE, 0).peer, "unplugged: sessions ended");
        assert_int_equal(fault(&bench, LINK_FAULT_PLUG, 0, 0.0), SH_OK);
        bench.ops->endpoint(bench.link, after, sizeof after);
        assert_string_equal(before, after);
    }
    fault(&bench, LINK_FAULT_UNPLUG, 0, 0.0);
    bench_close(&bench);
}

/* The owner learns of a host before the host gets anything of the device. */
static void expect_plugged(struct bench *bench, int times)
{
    for (const int64_t end_ms = now_ms() + DEADLINE_MS; bench->n_plugged < times; bench_poll(bench, 0, 1))
        assert_true(now_ms() < end_ms);
    assert_int_equal(bench->n_plugged, times);
}

/* Each request takes its time. A request that the host gives up meanwhile is gone. */
static void test_enumeration(void **state)
{
    (void)state;
    enum { SLOW_MS = 30 };
    struct bench bench = usbip_bench("N");
    struct client c;
    static const uint8_t status[8] = {0x80, 0, 0, 0, 0, 0, 2, 0};
    const int one_by_one = 1; /* no request waits for the answer to the one before */
    client_import(&c, &bench);
    setsockopt(c.fd, IPPROTO_TCP, TCP_NODELAY, &one_by_one, sizeof one_by_one);
    expect_plugged(&bench, 1);
    assert_int_equal(fault(&bench, LINK_FAULT_SLOW_ENUMERATION, 0, SLOW_MS), SH_OK);
    assert_int_equal(fault(&bench, LINK_FAULT_DESCRIPTOR_LENGTH, 3, 0.0), SH_OK);
    int64_t from_ms = now_ms();
    assert_int_equal(client_control(&c, &r, 0x80, 6, 0x0200, 0, 512, NULL), 0);
    assert_int_equal(le_get16(r.data + 2), r.actual + 3);
    client_configure(&c);
    assert_true(now_ms() - from_ms >= 2 * SLOW_MS - 1); /* two requests, and a clock that is rounded down */
    from_ms = now_ms();
    const uint32_t one = client_submit(&c, 1, 0, status, NULL, 2), two = client_submit(&c, 1, 0, status, NULL, 2),
                   three = client_submit(&c, 1, 0, status, NULL, 2), unlink = client_unlink(&c, two);
    assert_true(client_reply(&c, &r, 0));
    assert_int_equal(r.command, 4);
    assert_int_equal(r.seqnum, unlink);
    assert_int_equal(r.status, ECONNRESET_WIRE);
    expect_urb(&c, one, 0, 2);
    expect_urb(&c, three, 0, 2);
    assert_true(now_ms() - from_ms >= 2 * SLOW_MS - 1); /* a new SETUP ends the one before (USB 2.0, 8.5.3) */
    client_open_stream(&c);                             /* bulk transfers take no time of their own */
    client_submit(&c, 1, 0, status, NULL, 2);
    bench_poll(&bench, 0, 0);
    close(c.fd); /* with a request that waits */
    bench_expect(&bench, LINK_CLOSED, 0);
    bench_expect(&bench, LINK_NOTICE, 0);
    client_import(&c, &bench); /* another host: the owner is asked anew */
    expect_plugged(&bench, 2);
    fault(&bench, LINK_FAULT_SLOW_ENUMERATION, 0, 0.0);
    fault(&bench, LINK_FAULT_DESCRIPTOR_LENGTH, 0, 0.0);
    assert_int_equal(client_control(&c, &r, 0x80, 6, 0x0200, 0, 512, NULL), 0);
    assert_int_equal(le_get16(r.data + 2), r.actual);
    close(c.fd);
    bench_close(&bench);
}

/* Returns how many descriptors are open. */
static int n_open(void)
{
    int n = 0;
    for (int fd = 0; fd < 256; fd++)
        n += fcntl(fd, F_GETFD) >= 0;
    return n;
}

/* The end of the link is the end of each of its connections, with the device or without it. */
static void test_close(void **state)
{
    (void)state;
    const int before = n_open();
    struct bench bench = usbip_bench("N");
    struct client c;
    char byte;
    client_import(&c, &bench);
    const int idle = dial(bench_port(&bench));
    assert_true(idle >= 0);
    bench_poll(&bench, 0, 0);
    assert_int_equal(shutdown(c.fd, SHUT_WR), 0); /* so that the end waits for neither of them */
    assert_int_equal(shutdown(idle, SHUT_WR), 0);
    bench_close(&bench);
    errno = 0;
    assert_true(recv(c.fd, &byte, 1, MSG_DONTWAIT) <= 0 && errno != EAGAIN);
    assert_true(recv(idle, &byte, 1, MSG_DONTWAIT) <= 0 && errno != EAGAIN);
    close(c.fd);
    close(idle);
    assert_int_equal(n_open(), before);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_short_packets), cmocka_unit_test(test_descriptor_length),
        cmocka_unit_test(test_stall),         cmocka_unit_test(test_reset),
        cmocka_unit_test(test_unplug),        cmocka_unit_test(test_enumeration),
        cmocka_unit_test(test_reset_of_idle), cmocka_unit_test(test_slow_requests),
        cmocka_unit_test(test_restart),       cmocka_unit_test(test_close),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
