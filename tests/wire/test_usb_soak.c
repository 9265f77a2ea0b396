/* SPDX-License-Identifier: MIT */
/* A head on usbredir whose other end goes away, comes back and resets at random, in the middle of the stream. Nothing
 * may hang or leak, and losses must be announced. This program plays the virtual machine, with the library that QEMU
 * has for it. USB_SOAK_EVENTS: how often (default 20; `make soak-usb`: 1000). */
#include "tests/wire/wire.h"

#ifdef HAVE_USBREDIR

#include <sys/un.h>
#include <usbredirparser.h>

#include "core/rng.h"
#include "drivers/protocol/native.h"

enum { PENDING = 8, BULK = 16384, STREAM_IN = 0x83, STREAM_INTERFACE = 2, SESSION_REQUEST = 0x22, SEED = 20 };

enum { UNPLUG, RESET, REOPEN, CANCEL, UNPLUG_IN_A_PACKET, N_KINDS };

/* The memory may grow by this much, which the allocator keeps for itself. With 1000 events a leak of one transfer of
 * 16 KiB each would be 16 MB. */
enum { RSS_SLACK_KIB = 4096 };

struct soak {
    struct wire *wire;
    struct head head;
    struct usbredirparser *redir;
    struct native_parser parser;
    int fd, ended, connected, configured, answered, pending, refused;
    uint64_t next_id, first_id; /* of bulk packets; of those that were asked for since the last event */
    uint64_t bytes, frames, pulses, next_pulse, announced, head_lost, unannounced;
    int have_pulse;
    int struck[N_KINDS];
};

/* ---- the stream */

static void look(struct soak *s)
{
    struct native_event event;
    struct native_points points;
    s->frames++;
    if (s->parser.header.type == NATIVE_EVENT &&
        native_decode_event(s->parser.payload, s->parser.header.length, &event) == 0 && event.code == NATIVE_EV_OVERRUN)
        s->head_lost += event.b;
    if (s->parser.header.type != NATIVE_POINTS) return;
    assert_int_equal(native_decode_points(s->parser.payload, s->parser.header.length, &points), 0);
    const uint64_t announced = s->parser.stats.seq_gaps + s->head_lost;
    s->unannounced += (uint64_t)(s->have_pulse && points.pulse0 != s->next_pulse && announced == s->announced);
    s->announced = announced;
    s->have_pulse = 1;
    s->pulses += points.n_pulses;
    s->next_pulse = points.pulse0 + points.n_pulses;
}

static void take_items(struct soak *s)
{
    for (enum native_item item; (item = native_parser_next(&s->parser)) != NATIVE_MORE;)
        if (item == NATIVE_FRAME) look(s);
}

static void feed(struct soak *s, const uint8_t *data, size_t len)
{
    s->bytes += len;
    while (len > 0) {
        size_t room;
        uint8_t *to = native_parser_room(&s->parser, &room);
        const size_t n = len < room ? len : room;
        memcpy(to, data, n);
        native_parser_added(&s->parser, n);
        take_items(s);
        data += n;
        len -= n;
    }
}

/* ---- the virtual machine's end */

static int on_read(void *priv, uint8_t *data, int count)
{
    struct soak *s = priv;
    ssize_t n = recv(s->fd, data, (size_t)count, MSG_DONTWAIT);
    if (n > 0) return (int)n;
    if (n < 0 && errno == EAGAIN) return 0;
    s->ended = 1;
    return -1;
}

static int on_write(void *priv, uint8_t *data, int count)
{
    struct soak *s = priv;
    ssize_t n = send(s->fd, data, (size_t)count, MSG_DONTWAIT | MSG_NOSIGNAL);
    if (n >= 0) return (int)n;
    if (errno == EAGAIN) return 0;
    s->ended = 1;
    return -1;
}

static void on_log(void *priv, int level, const char *text)
{
    (void)priv;
    if (level == usbredirparser_error) print_error("%s\n", text);
}

static void on_hello(void *priv, struct usb_redir_hello_header *hello)
{
    (void)priv, (void)hello;
}

static void on_connect(void *priv, struct usb_redir_device_connect_header *header)
{
    (void)header;
    ((struct soak *)priv)->connected = 1;
}

static void on_nothing(void *priv)
{
    (void)priv;
}

static void on_interfaces(void *priv, struct usb_redir_interface_info_header *header)
{
    (void)priv, (void)header;
}

static void on_eps(void *priv, struct usb_redir_ep_info_header *header)
{
    (void)priv, (void)header;
}

static void on_configuration(void *priv, uint64_t id, struct usb_redir_configuration_status_header *h)
{
    (void)id;
    ((struct soak *)priv)->configured = h->status == usb_redir_success && h->configuration == 1;
}

static void on_control(void *priv, uint64_t id, struct usb_redir_control_packet_header *h, uint8_t *data, int len)
{
    struct soak *s = priv;
    (void)id, (void)len;
    assert_int_equal(h->status, usb_redir_success);
    s->answered = 1;
    usbredirparser_free_packet_data(s->redir, data);
}

static void on_bulk(void *priv, uint64_t id, struct usb_redir_bulk_packet_header *h, uint8_t *data, int len)
{
    struct soak *s = priv;
    s->pending--;
    /* those from before a reset carry no more of this stream */
    if (id >= s->first_id && h->status == usb_redir_success) feed(s, data, (size_t)len);
    usbredirparser_free_packet_data(s->redir, data);
}

static void on_other_status(void *priv, uint64_t id, struct usb_redir_interrupt_receiving_status_header *h)
{
    (void)priv, (void)id, (void)h;
}

static void make_parser(struct soak *s)
{
    static char version[] = "soak";
    uint32_t caps[USB_REDIR_CAPS_SIZE] = {0};
    struct usbredirparser *p = s->redir = usbredirparser_create();
    assert_non_null(p);
    p->priv = s;
    p->log_func = on_log;
    p->read_func = on_read;
    p->write_func = on_write;
    p->hello_func = on_hello;
    p->device_connect_func = on_connect;
    p->device_disconnect_func = on_nothing;
    p->interface_info_func = on_interfaces;
    p->ep_info_func = on_eps;
    p->configuration_status_func = on_configuration;
    p->control_packet_func = on_control;
    p->bulk_packet_func = on_bulk;
    p->interrupt_receiving_status_func = on_other_status;
    usbredirparser_caps_set_cap(caps, usb_redir_cap_connect_device_version);
    usbredirparser_caps_set_cap(caps, usb_redir_cap_ep_info_max_packet_size);
    usbredirparser_caps_set_cap(caps, usb_redir_cap_64bits_ids);
    usbredirparser_caps_set_cap(caps, usb_redir_cap_32bits_bulk_length);
    usbredirparser_init(p, version, caps, USB_REDIR_CAPS_SIZE, 0);
}

/* Sends the waiting bytes, and takes in those that come within the time. */
static void turn(struct soak *s, int wait_ms)
{
    const int more = usbredirparser_has_data_to_write(s->redir) > 0;
    struct pollfd slot = {.fd = s->fd, .events = (short)(POLLIN | (more ? POLLOUT : 0))};
    if (poll(&slot, 1, wait_ms) < 0) fail_msg("poll: %s", strerror(errno));
    if (more) usbredirparser_do_write(s->redir);
    if ((slot.revents & POLLIN) != 0) usbredirparser_do_read(s->redir);
}

/* Waits until *what is set, or the head has hung up. */
static int await(struct soak *s, const int *what, const char *name)
{
    const int64_t end_ms = wire_now_ms() + DEADLINE_MS;
    while (!*what && !s->ended) {
        if (wire_now_ms() > end_ms) fail_msg("%s: nothing within %d ms", name, DEADLINE_MS);
        turn(s, 100);
    }
    return *what;
}

static void ask_bulk(struct soak *s)
{
    struct usb_redir_bulk_packet_header h = {.endpoint = STREAM_IN, .length = BULK};
    for (; s->pending < PENDING; s->pending++)
        usbredirparser_send_bulk_packet(s->redir, s->next_id++, &h, NULL, 0);
}

static void session(struct soak *s, int open)
{
    struct usb_redir_control_packet_header h = {
        .requesttype = 0x41, .request = SESSION_REQUEST, .value = (uint16_t)open, .index = STREAM_INTERFACE};
    s->answered = 0;
    usbredirparser_send_control_packet(s->redir, s->next_id++, &h, NULL, 0);
    assert_true(await(s, &s->answered, "session"));
}

static void begin_stream(struct soak *s)
{
    struct usb_redir_set_configuration_header set = {.configuration = 1};
    s->configured = 0;
    usbredirparser_send_set_configuration(s->redir, s->next_id++, &set);
    assert_true(await(s, &s->configured, "configuration"));
    session(s, 1);
    s->first_id = s->next_id;
    ask_bulk(s);
}

/* The head has one guest at a time, and takes the next once it has seen that this one is gone. */
static void plug(struct soak *s)
{
    struct sockaddr_un at = {.sun_family = AF_UNIX};
    snprintf(at.sun_path, sizeof at.sun_path, "%s/usb", s->wire->dir);
    for (const int64_t end_ms = wire_now_ms() + DEADLINE_MS;; s->refused++) {
        s->ended = s->connected = s->pending = 0;
        s->fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
        if (connect(s->fd, (struct sockaddr *)&at, sizeof at) != 0) fail_msg("connect: %s", strerror(errno));
        make_parser(s);
        if (await(s, &s->connected, "device")) return;
        usbredirparser_destroy(s->redir);
        close(s->fd);
        if (wire_now_ms() > end_ms) fail_msg("the head takes no guest any more");
    }
}

static void unplug(struct soak *s)
{
    usbredirparser_destroy(s->redir);
    close(s->fd);
}

/* The old stream is over: the rest of it is garbage, and another session of the same stream begins. */
static void cut(struct soak *s)
{
    s->first_id = UINT64_MAX;
    native_parser_finish(&s->parser);
    take_items(s);
    native_parser_resume(&s->parser);
}

static void stream(struct soak *s, uint64_t bytes)
{
    const int64_t end_ms = wire_now_ms() + DEADLINE_MS;
    for (const uint64_t until = s->bytes + bytes; s->bytes < until; ask_bulk(s)) {
        if (wire_now_ms() > end_ms || s->ended) fail_msg("the stream has dried up");
        turn(s, 100);
    }
}

/* ---- the process's memory and descriptors */

static unsigned long rss_kib(const struct soak *s)
{
    char path[64];
    unsigned long size, resident = 0;
    snprintf(path, sizeof path, "/proc/%d/statm", (int)s->head.pid);
    FILE *f = fopen(path, "r");
    assert_non_null(f);
    assert_int_equal(fscanf(f, "%lu %lu", &size, &resident), 2);
    fclose(f);
    return resident * (unsigned long)sysconf(_SC_PAGESIZE) / 1024;
}

static int count_fds(const struct soak *s)
{
    char path[64];
    int n = 0;
    snprintf(path, sizeof path, "/proc/%d/fd", (int)s->head.pid);
    DIR *dir = opendir(path);
    assert_non_null(dir);
    while (readdir(dir) != NULL)
        n++;
    closedir(dir);
    return n;
}

/* ---- the events */

static void strike(struct soak *s, unsigned kind)
{
    s->struck[kind]++;
    static const uint8_t half[] = {101, 0, 0, 0, 200}; /* a bulk packet's header that breaks off */
    switch (kind) {
    case UNPLUG_IN_A_PACKET:
        send(s->fd, half, sizeof half, MSG_NOSIGNAL | MSG_DONTWAIT); /* fallthrough */
    case UNPLUG:
        cut(s);
        unplug(s);
        plug(s);
        break;
    case RESET:
        cut(s);
        usbredirparser_send_reset(s->redir);
        break;
    case REOPEN:
        session(s, 0);
        cut(s);
        break;
    default: /* a transfer that was taken back may have had its data: the stream begins anew */
        for (uint64_t id = s->next_id - (uint64_t)s->pending; id < s->next_id; id++)
            usbredirparser_send_cancel_data_packet(s->redir, id);
        cut(s);
        session(s, 0);
        break;
    }
    begin_stream(s);
}

static unsigned draw(uint64_t event, unsigned purpose, unsigned n)
{
    return (unsigned)(rng_u64(rng_key(SEED, RNG_SCENE), 3 * event + purpose) % n);
}

static void test_soak(void **state)
{
    struct soak *s = calloc(1, sizeof *s);
    const char *asked = getenv("USB_SOAK_EVENTS");
    const int events = asked != NULL ? atoi(asked) : 20;
    const char *const more[] = {"--start", NULL};
    assert_non_null(s);
    s->wire = *state;
    wire_write_text(s->wire, "room.obj", "v -9 -9 -1.7\nv 9 -9 -1.7\nv 9 9 -1.7\nv -9 9 -1.7\no floor\nf 1 2 3 4\n");
    const char *config = wire_write_text(
        s->wire, "config.yaml",
        "head: {profile: full-sweep, prr_hz: 100000, lines_hz: 100, pan_deg_s: 90, pan_stop_deg: 360, frames: 0}\n"
        "scene:\n  meshes:\n    - {file: room.obj, up: z, scale: 1}\nstations:\n  - {position_m: [0, 0, 0]}\n"
        "loop: {late_ms: 10000}\nlinks: [{type: usb, backend: usbredir, path: usb}]\n");
    s->head = head_start(s->wire, config, more);
    native_parser_init(&s->parser);
    plug(s);
    begin_stream(s);
    stream(s, 1 << 20); /* buffers have their size now */
    const int fds = count_fds(s);
    const unsigned long rss = rss_kib(s);
    uint64_t bytes = s->bytes;
    for (int i = 0; i < events; i++) {
        stream(s, draw((uint64_t)i, 0, 30000));
        poll(NULL, 0, (int)draw((uint64_t)i, 2, 15)); /* bytes that come meanwhile are on their way at the event */
        strike(s, draw((uint64_t)i, 1, N_KINDS));
    }
    stream(s, 200000); /* still alive */
    print_message("%d events: %d unplugged, %d of them within a packet; %d resets, %d sessions begun anew, %d with "
                  "transfers taken back\n",
                  events, s->struck[UNPLUG] + s->struck[UNPLUG_IN_A_PACKET], s->struck[UNPLUG_IN_A_PACKET],
                  s->struck[RESET], s->struck[REOPEN] + s->struck[CANCEL], s->struck[CANCEL]);
    print_message("%llu frames in %llu bytes; %llu lost in %llu gaps, which the sequence tells; %llu unaccounted for\n",
                  (unsigned long long)s->frames, (unsigned long long)(s->bytes - bytes),
                  (unsigned long long)s->parser.stats.seq_lost, (unsigned long long)s->parser.stats.seq_gaps,
                  (unsigned long long)s->unannounced);
    print_message("resident %lu KiB, was %lu; descriptors %d, were %d; %d times plugged in too early\n", rss_kib(s),
                  rss, count_fds(s), fds, s->refused);
    assert_int_equal(s->unannounced, 0);
    assert_int_equal(s->parser.stats.bad_payload, 0);
    assert_int_equal(count_fds(s), fds);
    assert_true(rss_kib(s) < rss + RSS_SLACK_KIB);
    unplug(s);
    head_end(&s->head, SIGTERM);
    free(s);
}

#else

static void test_soak(void **state)
{
    (void)state;
    print_message("built without libusbredirparser\n");
    skip();
}

#endif

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test_setup_teardown(test_soak, wire_setup, wire_teardown)};
    return cmocka_run_group_tests_name("usb_soak", tests, NULL, NULL);
}
