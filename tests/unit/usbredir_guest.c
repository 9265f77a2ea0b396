/* SPDX-License-Identifier: MIT */
#include "tests/unit/usbredir_guest.h"

char *guest_dir, guest_path[100];

int guest_setup(void **state)
{
    (void)state;
    guest_dir = test_dir();
    snprintf(guest_path, sizeof guest_path, "%s/usb", guest_dir);
    return 0;
}

int guest_teardown(void **state)
{
    (void)state;
    return rmdir(guest_dir); /* the link has removed its socket */
}

static int guest_on_read(void *priv, uint8_t *data, int count)
{
    struct guest *g = priv;
    ssize_t n = recv(g->fd, data, (size_t)count, MSG_DONTWAIT);
    if (n == 0 || (n < 0 && errno != EAGAIN)) {
        g->ended = 1;
        return -1;
    }
    return n < 0 ? 0 : (int)n;
}

static int guest_on_write(void *priv, uint8_t *data, int count)
{
    struct guest *g = priv;
    ssize_t n = send(g->fd, data, (size_t)count, MSG_DONTWAIT | MSG_NOSIGNAL);
    return n < 0 ? (errno == EAGAIN ? 0 : -1) : (int)n;
}

static void guest_on_log(void *priv, int level, const char *text)
{
    struct guest *g = priv;
    if (level == usbredirparser_error) {
        g->errors++;
        print_error("%s\n", text);
    }
}

static void guest_on_hello(void *priv, struct usb_redir_hello_header *hello)
{
    (void)priv;
    (void)hello;
}

static void guest_on_connect(void *priv, struct usb_redir_device_connect_header *header)
{
    struct guest *g = priv;
    g->device = *header;
    g->connects++;
}

static void guest_on_disconnect(void *priv)
{
    struct guest *g = priv;
    g->disconnects++;
}

static void guest_on_interfaces(void *priv, struct usb_redir_interface_info_header *header)
{
    struct guest *g = priv;
    g->interfaces = *header;
}

static void guest_on_eps(void *priv, struct usb_redir_ep_info_header *header)
{
    struct guest *g = priv;
    g->eps = *header;
    g->infos++;
}

static void guest_note(struct guest *g, int type, uint64_t id, unsigned endpoint, unsigned status, unsigned length,
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

static void guest_on_control(void *priv, uint64_t id, struct usb_redir_control_packet_header *h, uint8_t *data, int len)
{
    guest_note(priv, usb_redir_control_packet, id, h->endpoint, h->status, h->length, data, len);
}

static void guest_on_bulk(void *priv, uint64_t id, struct usb_redir_bulk_packet_header *h, uint8_t *data, int len)
{
    guest_note(priv, usb_redir_bulk_packet, id, h->endpoint, h->status, (unsigned)h->length_high << 16 | h->length,
               data, len);
}

static void guest_on_interrupt(void *priv, uint64_t id, struct usb_redir_interrupt_packet_header *h, uint8_t *data,
                               int len)
{
    guest_note(priv, usb_redir_interrupt_packet, id, h->endpoint, h->status, h->length, data, len);
}

static void guest_on_configuration(void *priv, uint64_t id, struct usb_redir_configuration_status_header *h)
{
    guest_note(priv, usb_redir_configuration_status, id, 0, h->status, h->configuration, NULL, 0);
}

static void guest_on_alt(void *priv, uint64_t id, struct usb_redir_alt_setting_status_header *h)
{
    guest_note(priv, usb_redir_alt_setting_status, id, h->interface, h->status, h->alt, NULL, 0);
}

static void guest_on_receiving(void *priv, uint64_t id, struct usb_redir_interrupt_receiving_status_header *h)
{
    guest_note(priv, usb_redir_interrupt_receiving_status, id, h->endpoint, h->status, 0, NULL, 0);
}

struct bench redir_bench(int speed)
{
    struct link_spec spec = {
        .type = LINK_USB, .backend = USB_BACKEND_USBREDIR, .speed = speed, .vid = 0x1209, .pid = 1, .serial = "R"};
    snprintf(spec.path, sizeof spec.path, "%s", guest_path);
    return bench_open(&spec);
}

int guest_socket(void)
{
    struct sockaddr_un at = {.sun_family = AF_UNIX};
    snprintf(at.sun_path, sizeof at.sun_path, "%s", guest_path);
    int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    assert_int_equal(connect(fd, (struct sockaddr *)&at, sizeof at), 0);
    return fd;
}

void guest_turn(struct guest *g, uint32_t want_write)
{
    while (usbredirparser_has_data_to_write(g->parser) > 0 && usbredirparser_do_write(g->parser) == 0)
        bench_poll(g->bench, want_write, 0);
    bench_poll(g->bench, want_write, 0);
    usbredirparser_do_read(g->parser);
}

struct seen *guest_await(struct guest *g, int n)
{
    for (const int64_t end_ms = now_ms() + DEADLINE_MS; g->n_seen < n && !g->ended;) {
        assert_true(now_ms() < end_ms);
        guest_turn(g, 0);
    }
    assert_true(g->n_seen >= n);
    return &g->seen[n - 1];
}

struct guest *guest_begin(struct bench *bench, int fd)
{
    static char version[] = "test";
    struct guest *g = calloc(1, sizeof *g);
    uint32_t caps[USB_REDIR_CAPS_SIZE] = {0};
    assert_non_null(g);
    g->seen = calloc(MAX_SEEN, sizeof *g->seen);
    g->bench = bench;
    g->fd = fd;
    g->parser = usbredirparser_create();
    struct usbredirparser *p = g->parser;
    p->priv = g;
    p->log_func = guest_on_log;
    p->read_func = guest_on_read;
    p->write_func = guest_on_write;
    p->hello_func = guest_on_hello;
    p->device_connect_func = guest_on_connect;
    p->device_disconnect_func = guest_on_disconnect;
    p->interface_info_func = guest_on_interfaces;
    p->ep_info_func = guest_on_eps;
    p->configuration_status_func = guest_on_configuration;
    p->alt_setting_status_func = guest_on_alt;
    p->interrupt_receiving_status_func = guest_on_receiving;
    p->control_packet_func = guest_on_control;
    p->bulk_packet_func = guest_on_bulk;
    p->interrupt_packet_func = guest_on_interrupt;
    usbredirparser_caps_set_cap(caps, usb_redir_cap_connect_device_version);
    usbredirparser_caps_set_cap(caps, usb_redir_cap_ep_info_max_packet_size);
    usbredirparser_caps_set_cap(caps, usb_redir_cap_64bits_ids);
    usbredirparser_caps_set_cap(caps, usb_redir_cap_32bits_bulk_length);
    usbredirparser_init(p, version, caps, USB_REDIR_CAPS_SIZE, 0);
    return g;
}

struct guest *guest_on(struct bench *bench, int fd)
{
    struct guest *g = guest_begin(bench, fd);
    for (const int64_t end_ms = now_ms() + DEADLINE_MS; g->connects == 0;) {
        assert_true(now_ms() < end_ms);
        guest_turn(g, 0);
    }
    return g;
}

struct guest *guest_new(struct bench *bench)
{
    return guest_on(bench, guest_socket());
}

void guest_free(struct guest *g)
{
    assert_int_equal(g->errors, 0);
    usbredirparser_destroy(g->parser);
    close(g->fd);
    free(g->seen);
    free(g);
}

void guest_configure(struct guest *g)
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

struct seen *guest_control(struct guest *g, unsigned type, unsigned request, unsigned value, unsigned index,
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

void guest_bulk(struct guest *g, uint64_t id, uint8_t endpoint, uint32_t length, uint8_t *out)
{
    struct usb_redir_bulk_packet_header h = {
        .endpoint = endpoint, .length = (uint16_t)length, .length_high = (uint16_t)(length >> 16)};
    usbredirparser_send_bulk_packet(g->parser, id, &h, out, out != NULL ? (int)length : 0);
}

void guest_open_stream(struct guest *g)
{
    assert_int_equal(guest_control(g, 0x41, 0x22, 1, 2, 0, NULL)->status, usb_redir_success);
    assert_int_equal(bench_expect(g->bench, LINK_OPENED, 0).session, 1);
}
