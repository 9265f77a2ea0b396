/* The usbredir back end and the usb link over it, with the library's own guest-side parser at the other end of a Unix
 * socket, and no virtual machine. */
#include "tests/unit/link_test.h"

#include <errno.h>
#include <sys/socket.h>
#include <sys/un.h>

#include "core/rng.h"
#include "drivers/usb/backend.h"

#ifdef HAVE_USBREDIR

#include <usbredirparser.h>

enum { MAX_SEEN = 64 };

/* What came from the device, in order. */
struct seen {
    int type;
    uint64_t id;
    unsigned endpoint, status, length;
    uint8_t data[70000];
};

struct guest {
    struct bench *bench;
    struct usbredirparser *parser;
    int fd, ended;
    struct seen *seen;
    int n_seen;
    struct usb_redir_device_connect_header device;
    struct usb_redir_interface_info_header interfaces;
    struct usb_redir_ep_info_header eps;
    int connects, infos, disconnects, errors;
};

static char *dir, path[100];

static int setup(void **state)
{
    (void)state;
    dir = test_dir();
    snprintf(path, sizeof path, "%s/usb", dir);
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    return rmdir(dir); /* the link has removed its socket */
}

static int on_read(void *priv, uint8_t *data, int count)
{
    struct guest *g = priv;
    ssize_t n = recv(g->fd, data, (size_t)count, MSG_DONTWAIT);
    if (n == 0 || (n < 0 && errno != EAGAIN)) {
        g->ended = 1;
        return -1;
    }
    return n < 0 ? 0 : (int)n;
}

static int on_write(void *priv, uint8_t *data, int count)
{
    struct guest *g = priv;
    ssize_t n = send(g->fd, data, (size_t)count, MSG_DONTWAIT | MSG_NOSIGNAL);
    return n < 0 ? (errno == EAGAIN ? 0 : -1) : (int)n;
}

static void on_log(void *priv, int level, const char *text)
{
    struct guest *g = priv;
    if (level == usbredirparser_error) {
        g->errors++;
        print_error("%s\n", text);
    }
}

static void on_hello(void *priv, struct usb_redir_hello_header *hello)
{
    (void)priv;
    (void)hello;
}

static void on_connect(void *priv, struct usb_redir_device_connect_header *header)
{
    struct guest *g = priv;
    g->device = *header;
    g->connects++;
}

static void on_disconnect(void *priv)
{
    struct guest *g = priv;
    g->disconnects++;
}

static void on_interfaces(void *priv, struct usb_redir_interface_info_header *header)
{
    struct guest *g = priv;
    g->interfaces = *header;
}

static void on_eps(void *priv, struct usb_redir_ep_info_header *header)
{
    struct guest *g = priv;
    g->eps = *header;
    g->infos++;
}

static void note(struct guest *g, int type, uint64_t id, unsigned endpoint, unsigned status, unsigned length,
                 uint8_t *data, int len)
{
    assert_in_range(g->n_seen, 0, MAX_SEEN - 1);
    struct seen *s = &g->seen[g->n_seen++];
    s->type = type;
    s->id = id;
    s->endpoint = endpoint;
    s->status = status;
    s->length = length;
    assert_in_range(len, 0, sizeof s->data);
    if (len > 0) memcpy(s->data, data, (size_t)len);
    usbredirparser_free_packet_data(g->parser, data);
}

static void on_control(void *priv, uint64_t id, struct usb_redir_control_packet_header *h, uint8_t *data, int len)
{
    note(priv, usb_redir_control_packet, id, h->endpoint, h->status, h->length, data, len);
}

static void on_bulk(void *priv, uint64_t id, struct usb_redir_bulk_packet_header *h, uint8_t *data, int len)
{
    note(priv, usb_redir_bulk_packet, id, h->endpoint, h->status, (unsigned)h->length_high << 16 | h->length, data,
         len);
}

static void on_interrupt(void *priv, uint64_t id, struct usb_redir_interrupt_packet_header *h, uint8_t *data, int len)
{
    note(priv, usb_redir_interrupt_packet, id, h->endpoint, h->status, h->length, data, len);
}

static void on_configuration(void *priv, uint64_t id, struct usb_redir_configuration_status_header *h)
{
    note(priv, usb_redir_configuration_status, id, 0, h->status, h->configuration, NULL, 0);
}

static void on_alt(void *priv, uint64_t id, struct usb_redir_alt_setting_status_header *h)
{
    note(priv, usb_redir_alt_setting_status, id, h->interface, h->status, h->alt, NULL, 0);
}

static void on_receiving(void *priv, uint64_t id, struct usb_redir_interrupt_receiving_status_header *h)
{
    note(priv, usb_redir_interrupt_receiving_status, id, h->endpoint, h->status, 0, NULL, 0);
}

static struct bench redir_bench(int speed)
{
    struct link_spec spec = {
        .type = LINK_USB, .backend = USB_BACKEND_USBREDIR, .speed = speed, .vid = 0x1209, .pid = 1, .serial = "R"};
    snprintf(spec.path, sizeof spec.path, "%s", path);
    return bench_open(&spec);
}

static int guest_socket(void)
{
    struct sockaddr_un at = {.sun_family = AF_UNIX};
    snprintf(at.sun_path, sizeof at.sun_path, "%s", path);
    int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    assert_int_equal(connect(fd, (struct sockaddr *)&at, sizeof at), 0);
    return fd;
}

static void guest_turn(struct guest *g, uint32_t want_write)
{
    while (usbredirparser_has_data_to_write(g->parser) > 0 && usbredirparser_do_write(g->parser) == 0)
        bench_poll(g->bench, want_write, 0);
    bench_poll(g->bench, want_write, 0);
    usbredirparser_do_read(g->parser);
}

/* Until n packets have been seen. */
static struct seen *guest_await(struct guest *g, int n)
{
    for (const int64_t end_ms = now_ms() + DEADLINE_MS; g->n_seen < n && !g->ended;) {
        assert_true(now_ms() < end_ms);
        guest_turn(g, 0);
    }
    assert_true(g->n_seen >= n);
    return &g->seen[n - 1];
}

static struct guest *guest_new(struct bench *bench)
{
    static char version[] = "test";
    struct guest *g = calloc(1, sizeof *g);
    uint32_t caps[USB_REDIR_CAPS_SIZE] = {0};
    assert_non_null(g);
    g->seen = calloc(MAX_SEEN, sizeof *g->seen);
    g->bench = bench;
    g->fd = guest_socket();
    g->parser = usbredirparser_create();
    struct usbredirparser *p = g->parser;
    p->priv = g;
    p->log_func = on_log;
    p->read_func = on_read;
    p->write_func = on_write;
    p->hello_func = on_hello;
    p->device_connect_func = on_connect;
    p->device_disconnect_func = on_disconnect;
    p->interface_info_func = on_interfaces;
    p->ep_info_func = on_eps;
    p->configuration_status_func = on_configuration;
    p->alt_setting_status_func = on_alt;
    p->interrupt_receiving_status_func = on_receiving;
    p->control_packet_func = on_control;
    p->bulk_packet_func = on_bulk;
    p->interrupt_packet_func = on_interrupt;
    usbredirparser_caps_set_cap(caps, usb_redir_cap_connect_device_version);
    usbredirparser_caps_set_cap(caps, usb_redir_cap_ep_info_max_packet_size);
    usbredirparser_caps_set_cap(caps, usb_redir_cap_64bits_ids);
    usbredirparser_caps_set_cap(caps, usb_redir_cap_32bits_bulk_length);
    usbredirparser_init(p, version, caps, USB_REDIR_CAPS_SIZE, 0);
    for (const int64_t end_ms = now_ms() + DEADLINE_MS; g->connects == 0;) {
        assert_true(now_ms() < end_ms);
        guest_turn(g, 0);
    }
    return g;
}

static void guest_free(struct guest *g)
{
    assert_int_equal(g->errors, 0);
    usbredirparser_destroy(g->parser);
    close(g->fd);
    free(g->seen);
    free(g);
}

static void guest_configure(struct guest *g)
{
    struct usb_redir_set_configuration_header set = {.configuration = 1};
    const int infos = g->infos;
    usbredirparser_send_set_configuration(g->parser, 1, &set);
    struct seen *s = guest_await(g, g->n_seen + 1);
    assert_int_equal(s->type, usb_redir_configuration_status);
    assert_int_equal(s->status, usb_redir_success);
    assert_int_equal(s->length, 1);
    assert_int_equal(g->infos, infos + 1);
}

static struct seen *guest_control(struct guest *g, unsigned type, unsigned request, unsigned value, unsigned index,
                                  unsigned length, uint8_t *out)
{
    static uint64_t id = 1000;
    struct usb_redir_control_packet_header h = {.endpoint = (uint8_t)(type & 0x80),
                                                .request = (uint8_t)request,
                                                .requesttype = (uint8_t)type,
                                                .value = (uint16_t)value,
                                                .index = (uint16_t)index,
                                                .length = (uint16_t)length};
    usbredirparser_send_control_packet(g->parser, ++id, &h, out, out != NULL ? (int)length : 0);
    struct seen *s = guest_await(g, g->n_seen + 1);
    assert_int_equal(s->type, usb_redir_control_packet);
    assert_int_equal(s->id, id);
    return s;
}

static void guest_bulk(struct guest *g, uint64_t id, uint8_t endpoint, uint32_t length, uint8_t *out)
{
    struct usb_redir_bulk_packet_header h = {
        .endpoint = endpoint, .length = (uint16_t)length, .length_high = (uint16_t)(length >> 16)};
    usbredirparser_send_bulk_packet(g->parser, id, &h, out, out != NULL ? (int)length : 0);
}

static void test_connect(void **state)
{
    (void)state;
    for (int speed = 0; speed < 3; speed++) {
        static const unsigned packet[] = {64, 512, 1024}, wire[] = {1, 2, 3};
        struct bench bench = redir_bench(speed);
        char name[300], want[160];
        bench.ops->endpoint(bench.link, name, sizeof name);
        snprintf(want, sizeof want, "usbredir:%s", path);
        assert_string_equal(name, want);
        struct guest *g = guest_new(&bench);
        assert_int_equal(g->device.speed, wire[speed]);
        assert_int_equal(g->device.vendor_id, 0x1209);
        assert_int_equal(g->device.product_id, 1);
        assert_int_equal(g->interfaces.interface_count, 3);
        assert_int_equal(g->interfaces.interface_class[2], 0xff);
        assert_int_equal(g->eps.type[16 + 3], usb_redir_type_bulk);
        assert_int_equal(g->eps.max_packet_size[16 + 3], packet[speed]);
        assert_int_equal(g->eps.interface[3], 2);
        assert_int_equal(g->eps.type[16 + 2], usb_redir_type_interrupt);
        assert_int_equal(g->eps.type[4], usb_redir_type_invalid);
        guest_configure(g);
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
    assert_int_equal(guest_control(g, 0x80, 6, 0x3300, 0, 64, NULL)->status, usb_redir_stall);
    struct usb_redir_set_alt_setting_header alt = {.interface = 2, .alt = 0};
    usbredirparser_send_set_alt_setting(g->parser, 5, &alt);
    s = guest_await(g, g->n_seen + 1);
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
    guest_control(g, 0x41, 0x22, 1, 2, 0, NULL);
    assert_int_equal(bench_expect(&bench, LINK_OPENED, 0).session, 1);
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
    /* commands the other way */
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
    guest_control(g, 0x41, 0x22, 1, 2, 0, NULL);
    bench_expect(&bench, LINK_OPENED, 0);
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
    /* reset: what waits is gone, and so is the session */
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

static void test_close(void **state)
{
    (void)state;
    struct bench bench = redir_bench(USB_RATE_HIGH);
    struct guest *g = guest_new(&bench);
    guest_configure(g);
    guest_bulk(g, 9, 0x83, 512, NULL);
    guest_turn(g, 0);
    shutdown(g->fd, SHUT_WR); /* so that the link need not wait for us */
    bench_close(&bench);
    usbredirparser_do_read(g->parser);
    assert_int_equal(g->disconnects, 1);
    assert_true(g->ended);
    guest_free(g);
}

/* The socket of a head that was killed is taken over; that of one that lives is not. */
static void test_path(void **state)
{
    (void)state;
    struct sockaddr_un at = {.sun_family = AF_UNIX};
    struct link_spec spec = {.type = LINK_USB, .backend = USB_BACKEND_USBREDIR, .vid = 1};
    struct sh_err err = {0, ""};
    void *link;
    snprintf(at.sun_path, sizeof at.sun_path, "%s", path);
    snprintf(spec.path, sizeof spec.path, "%s", path);
    int fd = socket(AF_UNIX, SOCK_STREAM, 0);
    assert_int_equal(bind(fd, (struct sockaddr *)&at, sizeof at), 0);
    assert_int_equal(listen(fd, 1), 0);
    assert_int_equal(link_ops_get(LINK_USB)->open(&spec, &link, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, path));
    close(fd); /* the path stays, nobody listens */
    struct bench bench = bench_open(&spec);
    bench_close(&bench);
    assert_int_equal(access(path, F_OK), -1);
    spec.attach = 1; /* connect: nobody there */
    assert_int_equal(link_ops_get(LINK_USB)->open(&spec, &link, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "connect"));
}

static void test_garbage(void **state)
{
    (void)state;
    struct bench bench = redir_bench(USB_RATE_HIGH);
    for (uint64_t round = 0; round < 300; round++) {
        uint8_t bytes[1024];
        const size_t n = 1 + rng_u64(11, round) % sizeof bytes;
        int fd = guest_socket();
        struct guest *g = NULL;
        for (size_t i = 0; i < n; i++)
            bytes[i] = (uint8_t)rng_u64(rng_mix(round), i);
        if (round % 2 == 0) { /* a sound hello, then packets of known types and small lengths */
            close(fd);
            g = guest_new(&bench);
            guest_configure(g);
            fd = g->fd;
            for (size_t i = 0; i + 40 <= n; i += 40) {
                memset(bytes + i, 0, 16);
                bytes[i] = (uint8_t)(rng_u64(rng_mix(round), 2000 + i) % 2 ? 100 + bytes[i] % 6 : bytes[i] % 30);
                bytes[i + 4] = (uint8_t)(rng_u64(rng_mix(round), 3000 + i) % 24);
            }
        }
        assert_true(send(fd, bytes, n, MSG_NOSIGNAL) >= 0);
        for (int i = 0; i < 4; i++) {
            bench.n_queue = 0;
            bench_poll(&bench, 3, 0);
            for (int s = 0; s < 2; s++) {
                char waste[64];
                bench.ops->read(bench.link, s, waste, sizeof waste);
                bench.ops->write(bench.link, s, bytes, 64);
            }
        }
        if (g != NULL)
            guest_free(g);
        else
            close(fd);
        for (int i = 0; i < 4; i++) {
            bench.n_queue = 0;
            bench_poll(&bench, 0, 0);
        }
    }
    struct guest *g = guest_new(&bench);
    guest_configure(g);
    guest_free(g);
    bench_close(&bench);
}

/* Packets before the hello, and of streams, which no endpoint has: the peer is cut off or told, and the next one
 * served. Headers as in usbredirproto.h: type, length and id, of 32 bits before the hello and 64 after it. */
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
        cmocka_unit_test(test_close),
        cmocka_unit_test(test_path),
        cmocka_unit_test(test_garbage),
        cmocka_unit_test(test_early_and_streams),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}

#else

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
