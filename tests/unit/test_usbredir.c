/* SPDX-License-Identifier: MIT */
/* These are tests of the usbredir back end and of the usb link over it. The library's own guest-side parser is at the
 * other end of a Unix socket, so there is no virtual machine. */
#ifdef HAVE_USBREDIR

#include "tests/unit/usbredir_guest.h"

#include "core/rng.h"

/* The channel has to describe the device as its descriptors do (USB 2.0, 9.6). An endpoint's place in the
 * channel's arrays is its number, or 16 more for IN; both of number 0 are the control endpoint. */
static void expect_as_described(struct guest *g)
{
    const struct seen *s = guest_control(g, 0x80, USB_REQ_GET_DESCRIPTOR, USB_DT_DEVICE << 8, 0, 18, NULL);
    assert_int_equal(g->device.device_class, s->data[4]);
    assert_int_equal(g->device.device_subclass, s->data[5]);
    assert_int_equal(g->device.device_protocol, s->data[6]);
    assert_int_equal(g->device.vendor_id, s->data[8] | s->data[9] << 8);
    assert_int_equal(g->device.product_id, s->data[10] | s->data[11] << 8);
    assert_int_equal(g->device.device_version_bcd, s->data[12] | s->data[13] << 8);
    unsigned n = 0, seen = 1u | 1u << 16, number = 0;
    s = guest_control(g, 0x80, USB_REQ_GET_DESCRIPTOR, USB_DT_CONFIG << 8, 0, 512, NULL);
    for (const uint8_t *d = s->data; d < s->data + s->length; d += d[0]) {
        assert_in_range(d[0], 2, 255);
        if (d[1] == USB_DT_INTERFACE) {
            number = d[2];
            assert_int_equal(g->interfaces.interface[n], number);
            assert_int_equal(g->interfaces.interface_class[n], d[5]);
            assert_int_equal(g->interfaces.interface_subclass[n], d[6]);
            assert_int_equal(g->interfaces.interface_protocol[n], d[7]);
            n++;
        } else if (d[1] == USB_DT_ENDPOINT) {
            const unsigned at = (d[2] & 0x0fu) + (d[2] & USB_DIR_IN ? 16 : 0);
            seen |= 1u << at;
            assert_int_equal(g->eps.type[at], d[3]);
            assert_int_equal(g->eps.interval[at], d[6]);
            assert_int_equal(g->eps.interface[at], number);
            assert_int_equal(g->eps.max_packet_size[at], d[4] | d[5] << 8);
        }
    }
    assert_int_equal(g->interfaces.interface_count, n);
    for (unsigned at = 0; at < 32; at++)
        if (at % 16 == 0 || !(seen >> at & 1))
            assert_int_equal(g->eps.type[at], at % 16 == 0 ? usb_redir_type_control : usb_redir_type_invalid);
}

static void test_connect(void **state)
{
    (void)state;
    for (int speed = 0; speed < 3; speed++) {
        static const unsigned packet[] = {64, 512, 1024}, wire[] = {1, 2, 3};
        struct bench bench = redir_bench(speed);
        char name[300], want[160];
        bench.ops->endpoint(bench.link, name, sizeof name);
        snprintf(want, sizeof want, "usbredir:%s", guest_path);
        assert_string_equal(name, want);
        struct guest *g = guest_new(&bench);
        assert_int_equal(g->device.speed, wire[speed]);
        assert_int_equal(g->device.vendor_id, 0x1209);
        assert_int_equal(g->device.product_id, 1);
        assert_int_equal(g->interfaces.interface_count, 3);
        assert_int_equal(g->eps.max_packet_size[16 + 3], packet[speed]);
        expect_as_described(g);
        memset(&g->interfaces, 0, sizeof g->interfaces);
        memset(&g->eps, 0, sizeof g->eps);
        guest_configure(g); /* it is told them again */
        expect_as_described(g);
        guest_free(g);
        g = guest_new(&bench); /* the next guest, once this one is gone */
        guest_free(g);
        bench_close(&bench);
    }
}

static void test_requests(void **state)
{
    (void)state;
    struct bench bench = redir_bench(USB_RATE_HIGH);
    struct guest *g = guest_new(&bench);
    uint8_t coding[7] = {0x80, 0x25, 0, 0, 0, 0, 8};
    struct seen *s = guest_control(g, 0x80, 6, 0x0100, 0, 64, NULL);
    assert_int_equal(s->status, usb_redir_success);
    assert_int_equal(s->length, 18);
    assert_int_equal(s->data[8] | s->data[9] << 8, 0x1209);
    guest_configure(g);
    s = guest_control(g, 0x21, 0x20, 0, 0, 7, coding); /* answered without data, else the library complains */
    assert_int_equal(s->status, usb_redir_success);
    assert_int_equal(s->length, 7);
    s = guest_control(g, 0xa1, 0x21, 0, 0, 7, NULL);
    assert_memory_equal(s->data, coding, 7);
    s = guest_control(g, 0x80, USB_REQ_GET_CONFIGURATION, 0, 0, 1, NULL);
    assert_int_equal(s->status, usb_redir_success);
    assert_int_equal(s->length, 1);
    assert_int_equal(s->data[0], 1);
    s = guest_control(g, 0x80, 6, 0x0100, 0, 0, NULL); /* no byte is asked for */
    assert_int_equal(s->status, usb_redir_success);
    assert_int_equal(s->length, 0);
    assert_int_equal(guest_control(g, 0x80, 6, 0x3300, 0, 64, NULL)->status, usb_redir_stall);
    struct usb_redir_set_alt_setting_header alt = {.interface = 2, .alt = 0};
    g->interfaces.interface_count = 0; /* it is told them again */
    usbredirparser_send_set_alt_setting(g->parser, 5, &alt);
    s = guest_await(g, g->n_seen + 1);
    assert_int_equal(g->interfaces.interface_count, 3);
    assert_int_equal(s->type, usb_redir_alt_setting_status);
    assert_int_equal(s->status, usb_redir_success);
    alt.alt = 1;
    usbredirparser_send_set_alt_setting(g->parser, 6, &alt);
    s = guest_await(g, g->n_seen + 1);
    assert_int_equal(s->status, usb_redir_stall);
    struct usb_redir_get_alt_setting_header get = {.interface = 2};
    usbredirparser_send_get_alt_setting(g->parser, 7, &get);
    s = guest_await(g, g->n_seen + 1);
    assert_int_equal(s->length, 0);
    struct usb_redir_set_configuration_header set = {.configuration = 2};
    usbredirparser_send_set_configuration(g->parser, 8, &set);
    s = guest_await(g, g->n_seen + 1);
    assert_int_equal(s->status, usb_redir_stall);
    usbredirparser_send_get_configuration(g->parser, 9);
    s = guest_await(g, g->n_seen + 1);
    assert_int_equal(s->length, 1);
    guest_free(g);
    bench_close(&bench);
}

static void test_stream(void **state)
{
    (void)state;
    static uint8_t sent[400000], got[400000];
    struct bench bench = redir_bench(USB_RATE_HIGH);
    struct guest *g = guest_new(&bench);
    guest_configure(g);
    guest_open_stream(g);
    for (size_t i = 0; i < sizeof sent; i++)
        sent[i] = (uint8_t)rng_u64(9, i);
    uint64_t id = 1, next = 1;
    for (; id <= 6; id++)
        guest_bulk(g, id, 0x83, 65536 + 512, NULL);
    size_t in = 0, out = 0;
    g->n_seen = 0;
    for (const int64_t end_ms = now_ms() + DEADLINE_MS; in < sizeof sent;) {
        assert_true(now_ms() < end_ms);
        ssize_t n = bench.ops->write(bench.link, 1, sent + out, sizeof sent - out);
        assert_true(n >= 0);
        out += (size_t)n;
        bench.n_queue = 0;
        guest_turn(g, 2);
        for (int i = 0; i < g->n_seen; i++) {
            assert_int_equal(g->seen[i].id, next++);
            assert_int_equal(g->seen[i].status, usb_redir_success);
            memcpy(got + in, g->seen[i].data, g->seen[i].length);
            in += g->seen[i].length;
            guest_bulk(g, id++, 0x83, 65536 + 512, NULL);
        }
        g->n_seen = 0;
    }
    assert_memory_equal(sent, got, sizeof sent);
    /* Commands go the other way. */
    bench.n_queue = 0;
    guest_bulk(g, 5000, 0x03, 6, (uint8_t *)"*IDN?\n");
    while (usbredirparser_has_data_to_write(g->parser) > 0)
        usbredirparser_do_write(g->parser);
    char text[16];
    bench_read_all(&bench, 1, text, 6);
    assert_memory_equal(text, "*IDN?\n", 6);
    struct seen *s = guest_await(g, 1);
    assert_int_equal(s->id, 5000);
    assert_int_equal(s->length, 6);
    guest_free(g);
    bench.n_queue = 0;
    bench_expect(&bench, LINK_CLOSED, 0);
    bench_close(&bench);
}

static void test_cancel_and_halt(void **state)
{
    (void)state;
    struct bench bench = redir_bench(USB_RATE_HIGH);
    struct guest *g = guest_new(&bench);
    guest_configure(g);
    guest_open_stream(g);
    guest_bulk(g, 1, 0x83, 512, NULL);
    guest_bulk(g, 2, 0x83, 512, NULL);
    usbredirparser_send_cancel_data_packet(g->parser, 1);
    g->n_seen = 0;
    struct seen *s = guest_await(g, 1);
    assert_int_equal(s->id, 1);
    assert_int_equal(s->status, usb_redir_cancelled);
    usbredirparser_send_cancel_data_packet(g->parser, 1); /* twice: nothing more */
    usbredirparser_send_cancel_data_packet(g->parser, 77);
    guest_turn(g, 0);
    bench_write_all(&bench, 1, "abc", 3);
    s = guest_await(g, 2);
    assert_int_equal(s->id, 2);
    assert_memory_equal(s->data, "abc", 3);
    guest_bulk(g, 3, 0x83, 512, NULL);
    struct usb_redir_control_packet_header halt = {.request = 3, .requesttype = 2, .index = 0x83};
    usbredirparser_send_control_packet(g->parser, 500, &halt, NULL, 0);
    s = guest_await(g, 4);
    assert_int_equal(s->id, 500);
    assert_int_equal(s->status, usb_redir_success);
    assert_int_equal(g->seen[2].id, 3); /* halting ends what waits */
    assert_int_equal(g->seen[2].status, usb_redir_stall);
    guest_control(g, 0x02, 1, 0, 0x83, 0, NULL); /* clear halt is a control packet here */
    guest_bulk(g, 4, 0x83, 512, NULL);
    guest_turn(g, 0);
    bench_write_all(&bench, 1, "def", 3);
    s = guest_await(g, 6);
    assert_int_equal(s->id, 4);
    assert_memory_equal(s->data, "def", 3);
    /* After a reset waiting bytes are gone, and so is the session. */
    guest_bulk(g, 5, 0x83, 512, NULL);
    usbredirparser_send_reset(g->parser);
    s = guest_await(g, 7);
    assert_int_equal(s->id, 5);
    assert_int_equal(s->status, usb_redir_ioerror);
    bench.n_queue = 0;
    bench_poll(&bench, 0, 0);
    assert_int_equal(bench.ops->write(bench.link, 1, "x", 1), SH_ECLOSED);
    guest_configure(g);
    guest_free(g);
    bench_close(&bench);
}

/* The head's owner reads why a session was cut off. A guest that enumerates also resets the bus, which is not
 * reported. */
static void test_reset_is_no_unplugging(void **state)
{
    (void)state;
    struct bench bench = redir_bench(USB_RATE_HIGH);
    struct guest *g = guest_new(&bench);
    usbredirparser_send_reset(g->parser);
    guest_configure(g);
    guest_open_stream(g);
    usbredirparser_send_reset(g->parser);
    guest_turn(g, 0);
    bench_expect(&bench, LINK_CLOSED, 0);
    bench_expect_notice(&bench, "the host reset the bus");
    guest_configure(g);
    guest_open_stream(g);
    guest_configure(g); /* a host with a reset of its own does this here */
    bench_expect(&bench, LINK_CLOSED, 0);
    bench_expect_notice(&bench, "configured the device again");
    guest_open_stream(g);
    guest_free(g);
    bench_expect(&bench, LINK_CLOSED, 0);
    bench_expect_notice(&bench, "unplugged");
    bench_close(&bench);
}

static void test_interrupt(void **state)
{
    (void)state;
    struct bench bench = redir_bench(USB_RATE_HIGH);
    struct guest *g = guest_new(&bench);
    static const uint8_t ready[10] = {0xa1, 0x20, 0, 0, 0, 0, 2, 0, 3, 0};
    struct usb_redir_start_interrupt_receiving_header start = {.endpoint = 0x82};
    struct usb_redir_stop_interrupt_receiving_header stop = {.endpoint = 0x82};
    usbredirparser_send_start_interrupt_receiving(g->parser, 1, &start);
    assert_int_equal(guest_await(g, 1)->status, usb_redir_inval); /* not configured */
    guest_configure(g);
    g->n_seen = 0;
    for (int i = 0; i < 2; i++) {
        usbredirparser_send_start_interrupt_receiving(g->parser, 2, &start);
        struct seen *s = guest_await(g, 1);
        assert_int_equal(s->type, usb_redir_interrupt_receiving_status);
        assert_int_equal(s->status, usb_redir_success);
        if (i == 0) {
            s = guest_await(g, 2);
            assert_int_equal(s->type, usb_redir_interrupt_packet);
            assert_int_equal(s->length, sizeof ready);
            assert_memory_equal(s->data, ready, sizeof ready);
        }
        g->n_seen = 0;
        usbredirparser_send_stop_interrupt_receiving(g->parser, 3, &stop);
        s = guest_await(g, 1);
        assert_int_equal(s->type, usb_redir_interrupt_receiving_status);
        g->n_seen = 0;
    }
    start.endpoint = 0x83; /* bulk */
    usbredirparser_send_start_interrupt_receiving(g->parser, 4, &start);
    assert_int_equal(guest_await(g, 1)->status, usb_redir_inval);
    guest_free(g);
    bench_close(&bench);
}

/* The link is closed while a guest has the device. What was written goes out, then word that the device is gone. */
static void test_close(void **state)
{
    (void)state;
    static uint8_t sent[60000];
    struct bench bench = redir_bench(USB_RATE_HIGH);
    struct guest *g = guest_new(&bench);
    guest_configure(g);
    guest_open_stream(g);
    for (size_t i = 0; i < sizeof sent; i++)
        sent[i] = (uint8_t)rng_u64(10, i);
    guest_bulk(g, 1, 0x83, 65536, NULL);
    guest_bulk(g, 2, 0x83, 65536, NULL); /* never filled */
    while (usbredirparser_has_data_to_write(g->parser) > 0)
        guest_turn(g, 0);
    bench_expect(&bench, LINK_WRITABLE, 2);
    bench_write_all(&bench, 1, sent, sizeof sent);
    const int before = g->n_seen;
    shutdown(g->fd, SHUT_WR); /* so that the link need not wait for us */
    bench_close(&bench);
    while (!g->ended && g->errors == 0)
        usbredirparser_do_read(g->parser);
    assert_int_equal(g->disconnects, 1);
    assert_int_equal(g->n_seen, before + 2);
    const struct seen *s = &g->seen[before];
    assert_int_equal(s[0].id, 1);
    assert_int_equal(s[0].status, usb_redir_success);
    assert_int_equal(s[0].length, sizeof sent);
    assert_memory_equal(s[0].data, sent, sizeof sent);
    assert_int_equal(s[1].id, 2);
    assert_int_equal(s[1].status, usb_redir_ioerror);
    assert_int_equal(s[1].length, 0);
    guest_free(g);
}

/* The socket of a killed head is taken over; that of a living one is not. */
static void test_path(void **state)
{
    (void)state;
    struct sockaddr_un at = {.sun_family = AF_UNIX};
    struct link_spec spec = {.type = LINK_USB, .backend = USB_BACKEND_USBREDIR, .vid = 1};
    struct sh_err err = {0, ""};
    void *link;
    snprintf(at.sun_path, sizeof at.sun_path, "%s", guest_path);
    snprintf(spec.path, sizeof spec.path, "%s", guest_path);
    int fd = socket(AF_UNIX, SOCK_STREAM, 0);
    assert_int_equal(bind(fd, (struct sockaddr *)&at, sizeof at), 0);
    assert_int_equal(listen(fd, 1), 0);
    assert_int_equal(link_ops_get(LINK_USB)->open(&spec, &link, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, guest_path));
    close(fd); /* the path stays, nobody listens */
    struct bench bench = bench_open(&spec);
    bench_close(&bench);
    assert_int_equal(access(guest_path, F_OK), -1);
    spec.attach = 1; /* connect: nobody there */
    assert_int_equal(link_ops_get(LINK_USB)->open(&spec, &link, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "connect"));
}

/* Packets come before the hello, or for streams, which no endpoint has. The peer is cut off or gets an error, and the
 * next one is served. Headers are those of usbredirproto.h: type, length and id, of 32 bits before the hello and 64
 * after it. */
static void test_early_and_streams(void **state)
{
    (void)state;
    static const uint8_t early[][24] = {
        {101, 0, 0, 0, 8, 0, 0, 0, 1, 0, 0, 0, 0x83, 0, 0, 2},                     /* bulk IN of 512 */
        {100, 0, 0, 0, 10, 0, 0, 0, 1, 0, 0, 0, 0x80, 6, 0x80, 0, 0, 1, 0, 0, 18}, /* GET_DESCRIPTOR */
        {15, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0x81},                               /* receive interrupts */
        {18, 0, 0, 0, 8, 0, 0, 0, 1, 0, 0, 0, 8, 0, 0, 0, 1},                      /* streams */
        {19, 0, 0, 0, 4, 0, 0, 0, 1, 0, 0, 0, 8},
    };
    static const uint8_t late[][24] = {{18, 0, 0, 0, 8, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 8, 0, 0, 0, 1},
                                       {19, 0, 0, 0, 4, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 8}};
    struct bench bench = redir_bench(USB_RATE_HIGH);
    for (size_t i = 0; i < sizeof early / sizeof early[0]; i++) {
        int fd = guest_socket();
        assert_int_equal(send(fd, early[i], 12u + early[i][4], MSG_NOSIGNAL), 12 + early[i][4]);
        for (int k = 0; k < 4; k++) {
            bench.n_queue = 0;
            bench_poll(&bench, 0, 0);
        }
        close(fd);
        bench.n_queue = 0;
        bench_poll(&bench, 0, 0);
    }
    struct guest *g = guest_new(&bench);
    guest_configure(g);
    for (size_t i = 0; i < sizeof late / sizeof late[0]; i++) {
        assert_int_equal(send(g->fd, late[i], 16u + late[i][4], MSG_NOSIGNAL), 16 + late[i][4]);
        bench.n_queue = 0;
        bench_poll(&bench, 0, 0);
    }
    guest_free(g);
    bench.n_queue = 0;
    bench_poll(&bench, 0, 0);
    g = guest_new(&bench);
    guest_configure(g);
    guest_free(g);
    bench_close(&bench);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_connect),
        cmocka_unit_test(test_requests),
        cmocka_unit_test(test_stream),
        cmocka_unit_test(test_cancel_and_halt),
        cmocka_unit_test(test_interrupt),
        cmocka_unit_test(test_reset_is_no_unplugging),
        cmocka_unit_test(test_close),
        cmocka_unit_test(test_path),
        cmocka_unit_test(test_early_and_streams),
    };
    return cmocka_run_group_tests(tests, guest_setup, guest_teardown);
}

#else

#include "drivers/usb/backend.h"
#include "tests/unit/link_test.h"

static void test_missing(void **state)
{
    (void)state;
    struct link_spec spec = {.type = LINK_USB, .backend = USB_BACKEND_USBREDIR, .vid = 1, .path = "/tmp/none"};
    struct sh_err err = {0, ""};
    void *link;
    assert_int_equal(link_ops_get(LINK_USB)->open(&spec, &link, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "libusbredirparser-dev"));
    print_message("# the rest needs libusbredirparser-dev\n");
    skip();
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_missing)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

#endif
