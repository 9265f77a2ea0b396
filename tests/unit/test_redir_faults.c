/* SPDX-License-Identifier: MIT */
/* USB faults on request over usbredir, as a virtual machine's end sees them. */
#ifdef HAVE_USBREDIR

#include "core/bytes.h"
#include "tests/unit/usbredir_guest.h"

enum { STREAM = 1, STREAM_IN = 0x83 };

static int fault(struct bench *bench, enum link_fault what, uint32_t n, double for_ms)
{
    return bench->ops->fault(bench->link, what, STREAM, n, for_ms);
}

static void turn_until(struct guest *g, const int *count, int value)
{
    for (const int64_t end_ms = now_ms() + DEADLINE_MS; *count < value; guest_turn(g, 0))
        assert_true(now_ms() < end_ms);
    assert_int_equal(*count, value);
}

/* The device goes from the channel, which stays. Then the device is there again. A reset is the same without a
 * pause. */
static void test_unplug(void **state)
{
    (void)state;
    struct bench bench = redir_bench(1);
    assert_int_equal(fault(&bench, LINK_FAULT_BUS_RESET, 0, 0.0), SH_ESTATE); /* no guest has it */
    struct guest *g = guest_new(&bench);
    for (int round = 0; round < 3; round++) {
        guest_configure(g);
        guest_open_stream(g);
        guest_bulk(g, 10, STREAM_IN, 512, NULL);
        guest_turn(g, 0);
        bench_expect(&bench, LINK_WRITABLE, 1u << STREAM);
        const int n_seen = g->n_seen;
        if (round == 2) {
            assert_int_equal(fault(&bench, LINK_FAULT_BUS_RESET, 0, 0.0), SH_OK);
        } else {
            assert_int_equal(fault(&bench, LINK_FAULT_UNPLUG, 0, 0.0), SH_OK);
            assert_int_equal(fault(&bench, LINK_FAULT_UNPLUG, 0, 0.0), SH_ESTATE);
        }
        assert_int_equal(guest_await(g, n_seen + 1)->status, usb_redir_ioerror);
        turn_until(g, &g->disconnects, round + 1);
        assert_int_equal(bench_expect(&bench, LINK_CLOSED, 0).session, STREAM);
        bench_expect(&bench, LINK_NOTICE, 0);
        assert_int_equal(bench.ops->write(bench.link, STREAM, "x", 1), SH_ECLOSED);
        if (round != 2) {
            assert_int_equal(g->connects, round + 1);
            assert_int_equal(fault(&bench, LINK_FAULT_PLUG, 0, 0.0), SH_OK);
        }
        turn_until(g, &g->connects, round + 2);
        assert_int_equal(bench.n_plugged, round + 2);
        assert_false(g->ended);
    }
    guest_free(g);
    bench_close(&bench);
}

/* A virtual machine that comes while the device is unplugged gets it later. */
static void test_late_guest(void **state)
{
    (void)state;
    struct bench bench = redir_bench(1);
    assert_int_equal(fault(&bench, LINK_FAULT_UNPLUG, 0, 0.0), SH_OK);
    int fd = guest_socket();
    for (int i = 0; i < 3; i++)
        bench_poll(&bench, 0, 10);
    assert_int_equal(bench.n_plugged, 0);
    assert_int_equal(fault(&bench, LINK_FAULT_PLUG, 0, 0.0), SH_OK);
    struct guest *g = guest_on(&bench, fd);
    guest_configure(g);
    guest_free(g);
    bench_poll(&bench, 0, DEADLINE_MS); /* it has gone */
    assert_int_equal(fault(&bench, LINK_FAULT_UNPLUG, 0, 0.0), SH_OK);
    g = guest_begin(&bench, guest_socket()); /* one that has said hello meanwhile */
    for (int i = 0; i < 5; i++)
        guest_turn(g, 0);
    assert_int_equal(g->connects, 0);
    assert_int_equal(fault(&bench, LINK_FAULT_PLUG, 0, 0.0), SH_OK);
    turn_until(g, &g->connects, 1);
    guest_configure(g);
    guest_free(g);
    bench_close(&bench);
}

static void test_stall(void **state)
{
    (void)state;
    struct bench bench = redir_bench(1);
    struct guest *g = guest_new(&bench);
    guest_configure(g);
    guest_open_stream(g);
    guest_bulk(g, 10, STREAM_IN, 512, NULL);
    guest_turn(g, 0);
    bench_expect(&bench, LINK_WRITABLE, 1u << STREAM);
    const int n_seen = g->n_seen;
    assert_int_equal(fault(&bench, LINK_FAULT_ENDPOINT_STALL, 0, 0.0), SH_OK);
    assert_int_equal(guest_await(g, n_seen + 1)->status, usb_redir_stall);
    assert_int_equal(guest_control(g, 0x02, 1, 0, STREAM_IN, 0, NULL)->status, usb_redir_success);
    guest_bulk(g, 11, STREAM_IN, 512, NULL);
    guest_turn(g, 0);
    bench_expect(&bench, LINK_WRITABLE, 1u << STREAM);
    assert_int_equal(fault(&bench, LINK_FAULT_SHORT_PACKETS, 1, 0.0), SH_OK);
    assert_int_equal(bench.ops->write(bench.link, STREAM, "abcdef", 6), 3); /* the rest waits for the next transfer */
    struct seen *s = guest_await(g, g->n_seen + 1);
    assert_int_equal(s->status, usb_redir_success);
    assert_int_equal(s->length, 3);
    guest_free(g);
    bench_close(&bench);
}

/* Every request takes its time, including those that have packets of their own. */
static void test_slow(void **state)
{
    (void)state;
    enum { SLOW_MS = 30 };
    struct bench bench = redir_bench(1);
    struct guest *g = guest_new(&bench);
    assert_int_equal(bench.n_plugged, 1);
    fault(&bench, LINK_FAULT_SLOW_ENUMERATION, 0, SLOW_MS);
    fault(&bench, LINK_FAULT_DESCRIPTOR_LENGTH, 5, 0.0);
    int64_t from_ms = now_ms();
    guest_configure(g);
    struct seen *s = guest_control(g, 0x80, 6, 0x0200, 0, 512, NULL);
    assert_int_equal(le_get16(s->data + 2), s->length + 5);
    const struct usb_redir_set_alt_setting_header alt = {.interface = 2};
    const int n_seen = g->n_seen;
    usbredirparser_send_set_alt_setting(g->parser, 7, (struct usb_redir_set_alt_setting_header *)(uintptr_t)&alt);
    assert_int_equal(guest_await(g, n_seen + 1)->type, usb_redir_alt_setting_status);
    assert_true(now_ms() - from_ms >= 3 * SLOW_MS - 1); /* a clock that is rounded down */
    /* One request is given up, and its answer says so; another is left behind at the end. */
    struct usb_redir_control_packet_header h = {.endpoint = 0x80, .requesttype = 0x80, .length = 2};
    usbredirparser_send_control_packet(g->parser, 21, &h, NULL, 0);
    usbredirparser_send_control_packet(g->parser, 22, &h, NULL, 0);
    usbredirparser_send_cancel_data_packet(g->parser, 22);
    s = guest_await(g, n_seen + 2);
    assert_int_equal(s->id, 22);
    assert_int_equal(s->status, usb_redir_cancelled);
    s = guest_await(g, n_seen + 3);
    assert_int_equal(s->id, 21);
    assert_int_equal(s->status, usb_redir_success);
    usbredirparser_send_control_packet(g->parser, 23, &h, NULL, 0);
    guest_turn(g, 0);
    guest_free(g);
    bench_close(&bench);
}

static void send_control(struct guest *g, uint64_t id)
{
    struct usb_redir_control_packet_header h = {.endpoint = 0x80, .requesttype = 0x80, .length = 2};
    usbredirparser_send_control_packet(g->parser, id, &h, NULL, 0);
}

/* As many as 256 requests wait. One request more ends the connection, since no virtual machine sends so many at
 * once. */
static void test_most_slow(void **state)
{
    enum { MOST = 256 };
    (void)state;
    struct bench bench = redir_bench(1);
    struct guest *g = guest_new(&bench);
    guest_configure(g);
    fault(&bench, LINK_FAULT_SLOW_ENUMERATION, 0, 1e6);
    for (uint64_t id = 1; id <= MOST; id++)
        send_control(g, id);
    for (uint64_t id = MOST; id <= MOST + 1; id++) {
        const int n_seen = g->n_seen;
        usbredirparser_send_cancel_data_packet(g->parser, id);
        const struct seen *s = guest_await(g, n_seen + 1);
        assert_int_equal(s->id, id);
        assert_int_equal(s->status, usb_redir_cancelled);
        send_control(g, id + 1); /* it takes the place */
    }
    send_control(g, MOST + 3);
    for (const int64_t end_ms = now_ms() + DEADLINE_MS; !g->ended; guest_turn(g, 0))
        assert_true(now_ms() < end_ms);
    bench_expect_notice(&bench, "the usbredir guest is cut off: more than 256 control packets");
    guest_free(g);
    bench_close(&bench);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_unplug), cmocka_unit_test(test_late_guest),
                                       cmocka_unit_test(test_stall), cmocka_unit_test(test_slow),
                                       cmocka_unit_test(test_most_slow)};
    return cmocka_run_group_tests(tests, guest_setup, guest_teardown);
}

#else

#include "tests/unit/usbredir_missing.h"

#endif
