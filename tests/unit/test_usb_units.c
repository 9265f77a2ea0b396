/* SPDX-License-Identifier: MIT */
/* Telegrams on USB: each one is a transfer, over the device core, USB/IP and usbredir.
 *
 * A unit ends with a packet shorter than wMaxPacketSize (USB 2.0, 5.8.3). A unit whose length is a multiple of
 * wMaxPacketSize needs a packet of no bytes after it. A host's transfer that has room left ends there by itself. If the
 * unit fills the transfer to its last byte, that packet is the next transfer. */
#include "tests/unit/usbip_client.h"
#ifdef HAVE_USBREDIR
#include "tests/unit/usbredir_guest.h"
#endif

#include "drivers/usb/personalities.h"

enum { MOST = 65535, ECONNRESET_WIRE = -104 };

static struct reply r;
static uint8_t telegram[4096];

static int unit_setup(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof telegram; i++)
        telegram[i] = (uint8_t)(i * 11 + i / 256);
    return 0;
}

static struct link_spec sick_spec(int backend, int speed)
{
    return (struct link_spec){.type = LINK_USB,
                              .backend = backend,
                              .speed = speed,
                              .personality = USB_PERSONALITY_SICK,
                              .vid = 0x19a2,
                              .pid = 0x5001,
                              .serial = "T"};
}

/* Lengths around whole packets at both speeds. */
static const struct {
    int speed;
    uint32_t packet, len[6];
} sizes[] = {
    {USB_RATE_FULL, 64, {1, 63, 64, 65, 128, 512}},
    {USB_RATE_HIGH, 512, {1, 511, 512, 513, 1024, 2552}},
};

/* The host's client asks, which begins the session. */
static void begin(struct client *c, struct bench *bench)
{
    char text[8];
    client_configure(c);
    client_submit(c, 0, 2, NULL, "\002sRI0\003", 6);
    assert_int_equal(bench_expect(bench, LINK_OPENED, 0).session, 0);
    bench_read_all(bench, 0, text, 6);
    assert_memory_equal(text, "\002sRI0\003", 6);
    assert_true(client_reply(c, &r, 0));
    assert_int_equal(r.status, 0);
}

static void expect_in(struct client *c, uint32_t seqnum, const uint8_t *bytes, uint32_t n)
{
    assert_true(client_reply(c, &r, 1));
    assert_int_equal(r.seqnum, seqnum);
    assert_int_equal(r.status, 0);
    assert_int_equal(r.actual, n);
    assert_memory_equal(r.data, bytes, n);
}

/* Reads are as long as those of libusb's clients: one telegram each, two of them in a row. */
static void test_usbip_long_reads(void **state)
{
    (void)state;
    for (size_t s = 0; s < sizeof sizes / sizeof sizes[0]; s++) {
        struct link_spec spec = sick_spec(USB_BACKEND_USBIP, sizes[s].speed);
        struct bench bench = bench_open(&spec);
        struct client c;
        client_import(&c, &bench);
        begin(&c, &bench);
        for (size_t i = 0; i < 6; i++) {
            const uint32_t n = sizes[s].len[i], one = client_submit(&c, 1, 1, NULL, NULL, MOST),
                           two = client_submit(&c, 1, 1, NULL, NULL, MOST);
            bench_expect(&bench, LINK_WRITABLE, 1);
            assert_int_equal(bench.ops->write(bench.link, 0, telegram, n), n);
            bench_poll(&bench, 0, 0);
            assert_int_equal(bench.ops->write(bench.link, 0, telegram + 7, n), n);
            expect_in(&c, one, telegram, n);
            expect_in(&c, two, telegram + 7, n);
        }
        close(c.fd);
        bench_close(&bench);
    }
}

/* The telegram fills these reads exactly: the next read is its end, and may wait already or come later. A
 * telegram longer than the read goes on in the next one. */
static void test_usbip_exact_reads(void **state)
{
    (void)state;
    for (int waiting = 0; waiting < 2; waiting++) {
        struct link_spec spec = sick_spec(USB_BACKEND_USBIP, USB_RATE_HIGH);
        struct bench bench = bench_open(&spec);
        struct client c;
        uint32_t end = 0;
        client_import(&c, &bench);
        begin(&c, &bench);
        const uint32_t one = client_submit(&c, 1, 1, NULL, NULL, 512);
        if (waiting) end = client_submit(&c, 1, 1, NULL, NULL, 512);
        assert_int_equal(client_control(&c, &r, 0x80, 0, 0, 0, 2, NULL),
                         0); /* answered: what was sent before has come */
        assert_int_equal(bench.ops->write(bench.link, 0, telegram, 512), 512);
        expect_in(&c, one, telegram, 512);
        if (!waiting) end = client_submit(&c, 1, 1, NULL, NULL, 512);
        expect_in(&c, end, NULL, 0);
        const uint32_t first = client_submit(&c, 1, 1, NULL, NULL, 1024);
        bench_expect(&bench, LINK_WRITABLE, 1);
        assert_int_equal(bench.ops->write(bench.link, 0, telegram, 1536), 1024);
        expect_in(&c, first, telegram, 1024);
        const uint32_t rest = client_submit(&c, 1, 1, NULL, NULL, 1024);
        bench_expect(&bench, LINK_WRITABLE, 1);
        assert_int_equal(bench.ops->write(bench.link, 0, telegram + 1024, 512), 512);
        expect_in(&c, rest, telegram + 1024, 512);
        close(c.fd);
        bench_close(&bench);
    }
}

/* Nothing comes by itself. A read that its client gives up (its timeout) takes no bytes with it. */
static void test_usbip_cancel(void **state)
{
    (void)state;
    struct link_spec spec = sick_spec(USB_BACKEND_USBIP, USB_RATE_HIGH);
    struct bench bench = bench_open(&spec);
    struct client c;
    client_import(&c, &bench);
    begin(&c, &bench);
    for (int round = 0; round < 3; round++) {
        const uint32_t given_up = client_submit(&c, 1, 1, NULL, NULL, MOST), unlink = client_unlink(&c, given_up);
        assert_true(client_reply(&c, &r, 0));
        assert_int_equal(r.command, 4);
        assert_int_equal(r.seqnum, unlink);
        assert_int_equal(r.status, ECONNRESET_WIRE);
        assert_int_equal(bench.ops->write(bench.link, 0, telegram, 1024), 0); /* no host reads, so it stays here */
        const uint32_t next = client_submit(&c, 1, 1, NULL, NULL, MOST);
        bench_expect(&bench, LINK_WRITABLE, 1);
        assert_int_equal(bench.ops->write(bench.link, 0, telegram, 1024), 1024);
        expect_in(&c, next, telegram, 1024);
    }
    close(c.fd);
    bench_close(&bench);
}

/* A telegram goes to the device in pieces of any size, and is read in others. */
static void test_usbip_out_pieces(void **state)
{
    (void)state;
    static const uint32_t pieces[] = {1, 63, 64, 512, 0, 1000, 7};
    struct link_spec spec = sick_spec(USB_BACKEND_USBIP, USB_RATE_HIGH);
    struct bench bench = bench_open(&spec);
    struct client c;
    uint8_t back[2048];
    size_t sent = 0;
    client_import(&c, &bench);
    begin(&c, &bench);
    for (size_t i = 0; i < sizeof pieces / sizeof pieces[0]; i++) {
        client_submit(&c, 0, 2, NULL, telegram + sent, pieces[i]);
        sent += pieces[i];
    }
    bench_read_all(&bench, 0, back, sent);
    assert_memory_equal(back, telegram, sent);
    for (size_t i = 0; i < sizeof pieces / sizeof pieces[0]; i++) {
        assert_true(client_reply(&c, &r, 0));
        assert_int_equal(r.actual, pieces[i]);
    }
    close(c.fd);
    bench_close(&bench);
}

static void test_usbredir(void **state)
{
#ifdef HAVE_USBREDIR
    for (size_t s = 0; s < sizeof sizes / sizeof sizes[0]; s++) {
        guest_setup(state);
        struct link_spec spec = sick_spec(USB_BACKEND_USBREDIR, sizes[s].speed);
        snprintf(spec.path, sizeof spec.path, "%s", guest_path);
        struct bench bench = bench_open(&spec);
        struct guest *g = guest_new(&bench);
        assert_int_equal(g->device.vendor_id, 0x19a2);
        assert_int_equal(g->device.product_id, 0x5001);
        assert_int_equal(g->interfaces.interface_count, 1);
        guest_configure(g);
        guest_bulk(g, 1, 0x02, 6, (uint8_t *)"\002sRI0\003");
        while (bench.n_queue == 0)
            guest_turn(g, 0);
        bench_expect(&bench, LINK_OPENED, 0);
        bench_read_all(&bench, 0, (char[8]){0}, 6);
        int seen = g->n_seen + 1;
        guest_await(g, seen);
        for (uint64_t i = 0; i < 6; i++) {
            const uint32_t n = sizes[s].len[i], room = i % 2 == 0 ? MOST : n;
            guest_bulk(g, 10 + i, 0x81, room, NULL);
            for (ssize_t moved = 0; moved == 0;) {
                guest_turn(g, 1);
                moved = bench.ops->write(bench.link, 0, telegram, n);
                assert_true(moved == 0 || moved == n);
            }
            struct seen *in = guest_await(g, ++seen);
            assert_int_equal(in->id, 10 + i);
            assert_int_equal(in->status, usb_redir_success);
            assert_int_equal(in->length, n);
            assert_memory_equal(in->data, telegram, n);
            if (room != n || n % sizes[s].packet != 0) continue;
            guest_bulk(g, 50 + i, 0x81, MOST, NULL); /* the packet of no bytes */
            in = guest_await(g, ++seen);
            assert_int_equal(in->id, 50 + i);
            assert_int_equal(in->length, 0);
        }
        guest_free(g);
        bench_close(&bench);
        guest_teardown(state);
    }
#else
    (void)state;
    print_message("# needs libusbredirparser-dev\n");
    skip();
#endif
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_usbip_long_reads), cmocka_unit_test(test_usbip_exact_reads),
        cmocka_unit_test(test_usbip_cancel),     cmocka_unit_test(test_usbip_out_pieces),
        cmocka_unit_test(test_usbredir),
    };
    return cmocka_run_group_tests(tests, unit_setup, NULL);
}
