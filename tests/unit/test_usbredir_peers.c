/* SPDX-License-Identifier: MIT */
/* Peers of the usbredir back end that are silent, never read, ask the wrong endpoint, or go away from a device that
 * connected to them. */
#ifdef HAVE_USBREDIR

#include "tests/unit/usbredir_guest.h"

#include <fcntl.h>
#include <netinet/in.h>

#include "core/bytes.h"

static void test_silent(void **state)
{
    (void)state;
    struct bench bench = redir_bench(USB_RATE_HIGH);
    int silent[6];
    for (int i = 0; i < 6; i++) {
        silent[i] = guest_socket();
        bench_poll(&bench, 0, 0);
    }
    struct guest *g = guest_new(&bench);
    int late = guest_socket(); /* the guest that has said hello keeps the device */
    bench_poll(&bench, 0, 0);
    assert_int_equal(guest_control(g, 0x80, 6, 0x0100, 0, 18, NULL)->status, usb_redir_success);
    const int64_t start_ms = now_ms();
    bench_poll(&bench, 0, 50);
    assert_true(now_ms() - start_ms >= 49); /* and the other one, who waits, keeps nobody awake */
    close(late);
    guest_free(g);
    for (int i = 0; i < 6; i++)
        close(silent[i]);
    bench_close(&bench);
}

/* Headers are those of usbredirproto.h: type, length, id (64 bits); endpoint, request, type, status, value, index,
 * length. MANY: the kernel counts 768 bytes or more for each small piece in a Unix socket's buffers, which have 2 MiB
 * at most each way (SO_SNDBUF, doubled). Both ways hold some 5,500 pieces, and the back end's 64. */
enum { CONTROL_HEAD = 16 + 10, MANY = 20000 };

static void put_get_config(uint8_t *at, uint32_t id)
{
    static const uint8_t rest[10] = {0x80, 6, 0x80, 0, 0, 2, 0, 0, 255, 0};
    memset(at, 0, CONTROL_HEAD);
    le_put32(at, usb_redir_control_packet);
    le_put32(at + 4, 10);
    le_put32(at + 8, id);
    memcpy(at + 16, rest, sizeof rest);
}

/* Sends as long as there is room and the link moves. Returns the packets begun. */
static uint32_t send_requests(struct guest *g)
{
    uint8_t head[CONTROL_HEAD];
    uint32_t n = 0;
    for (size_t pos = CONTROL_HEAD, stuck = 0; stuck < 3;) {
        if (pos == CONTROL_HEAD) {
            assert_true(n < MANY);
            put_get_config(head, ++n);
            pos = 0;
        }
        ssize_t sent = send(g->fd, head + pos, CONTROL_HEAD - pos, MSG_DONTWAIT | MSG_NOSIGNAL);
        if (sent > 0) {
            pos += (size_t)sent;
            stuck = 0;
            continue;
        }
        assert_int_equal(errno, EAGAIN);
        const int64_t start_ms = now_ms();
        bench_poll(g->bench, 0, 50); /* a link that can't go on waits, and does not spin */
        if (now_ms() - start_ms >= 49) stuck++;
    }
    return n;
}

static void read_raw(struct guest *g, uint8_t *at, size_t len)
{
    for (const int64_t end_ms = now_ms() + DEADLINE_MS; len > 0;) {
        assert_true(now_ms() < end_ms);
        ssize_t n = recv(g->fd, at, len, MSG_DONTWAIT);
        if (n < 0) bench_poll(g->bench, 0, 1);
        if (n > 0) at += n, len -= (size_t)n;
        assert_int_not_equal(n, 0);
    }
}

/* A guest asks and asks and does not read. It is held back, and then gets every answer in its order. */
static void test_flood(void **state)
{
    (void)state;
    struct bench bench = redir_bench(USB_RATE_HIGH);
    struct guest *g = guest_new(&bench);
    uint8_t reply[16 + 65536];
    const uint32_t n = send_requests(g);
    assert_true(n > 1000);
    for (uint32_t i = 1; i < n; i++) {
        read_raw(g, reply, 16);
        assert_int_equal(le_get32(reply), usb_redir_control_packet);
        assert_int_equal(le_get32(reply + 8), i);
        const uint32_t len = le_get32(reply + 4);
        assert_in_range(len, 10 + 9, sizeof reply - 16);
        read_raw(g, reply + 16, len);
        assert_int_equal(reply[16 + 3], usb_redir_success);
        assert_int_equal(le_get16(reply + 16 + 10 + 2), len - 10); /* wTotalLength */
    }
    guest_free(g);
    bench_close(&bench);
}

/* One turn of the link's thread is over in bounded time, however much the guest has sent and reads. */
static void test_turns(void **state)
{
    (void)state;
    enum { REQUESTS = 250 }; /* their pieces fit into a Unix socket's buffer of 208 KiB by default */
    struct bench bench = redir_bench(USB_RATE_HIGH);
    struct guest *g = guest_new(&bench);
    static uint8_t reply[REQUESTS * 1024];
    for (uint32_t i = 1; i <= REQUESTS; i++) {
        uint8_t head[CONTROL_HEAD];
        put_get_config(head, i);
        assert_int_equal(send(g->fd, head, sizeof head, MSG_DONTWAIT), sizeof head);
    }
    bench_poll(&bench, 0, 0);
    size_t first = 0;
    for (ssize_t n; (n = recv(g->fd, reply + first, sizeof reply - first, MSG_DONTWAIT)) > 0;)
        first += (size_t)n;
    const size_t each = 16 + le_get32(reply + 4);
    assert_in_range(first, each, REQUESTS * each - 1); /* some, and not all */
    read_raw(g, reply + first, REQUESTS * each - first);
    for (uint32_t i = 1; i <= REQUESTS; i++)
        assert_int_equal(le_get32(reply + (i - 1) * each + 8), i);
    guest_free(g);
    bench_close(&bench);
}

static struct seen *control_on(struct guest *g, uint64_t id, uint8_t endpoint, unsigned request, unsigned value)
{
    struct usb_redir_control_packet_header h = {
        .endpoint = endpoint, .request = (uint8_t)request, .value = (uint16_t)value};
    usbredirparser_send_control_packet(g->parser, id, &h, NULL, 0);
    struct seen *s = guest_await(g, g->n_seen + 1);
    assert_int_equal(s->id, id);
    return s;
}

/* A packet for an endpoint of another kind is invalid, as in usbredirhost, and nothing happens. */
static void test_wrong_endpoint(void **state)
{
    (void)state;
    struct bench bench = redir_bench(USB_RATE_HIGH);
    struct guest *g = guest_new(&bench);
    assert_int_equal(control_on(g, 70, 0x03, 9, 1)->status, usb_redir_inval);
    usbredirparser_send_get_configuration(g->parser, 71);
    struct seen *s = guest_await(g, g->n_seen + 1);
    assert_int_equal(s->length, 0); /* not configured by that */
    assert_int_equal(control_on(g, 72, 0x00, 9, 1)->status, usb_redir_success);
    guest_bulk(g, 73, 0x82, 64, NULL); /* an interrupt endpoint */
    s = guest_await(g, g->n_seen + 1);
    assert_int_equal(s->id, 73);
    assert_int_equal(s->status, usb_redir_inval);
    guest_bulk(g, 74, 0x8a, 64, NULL); /* none */
    s = guest_await(g, g->n_seen + 1);
    assert_int_equal(s->id, 74);
    assert_int_not_equal(s->status, usb_redir_success);
    guest_free(g);
    bench_close(&bench);
}

/* ---- a device that connects */

static int listen_on(const struct sockaddr *at, socklen_t len)
{
    const int one = 1;
    int fd = socket(at->sa_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
    assert_int_equal(bind(fd, at, len), 0);
    assert_int_equal(listen(fd, 4), 0);
    return fd;
}

static struct guest *accept_device(struct bench *bench, int listener)
{
    for (const int64_t end_ms = now_ms() + DEADLINE_MS;;) {
        assert_true(now_ms() < end_ms);
        int fd = accept4(listener, NULL, NULL, SOCK_CLOEXEC);
        if (fd >= 0) return guest_on(bench, fd);
        bench_poll(bench, 0, 1);
    }
}

static void check_reconnects(const struct link_spec *spec, int listener, const struct sockaddr *at, socklen_t len)
{
    struct bench bench = bench_open(spec);
    struct guest *g = accept_device(&bench, listener);
    guest_configure(g);
    guest_free(g);
    bench_expect_notice(&bench, "detached");
    g = accept_device(&bench, listener); /* it comes by itself */
    guest_configure(g);
    bench_expect_notice(&bench, "plugged in again");
    close(listener); /* nobody answers: it says so once, and tries again */
    if (at->sa_family == AF_UNIX) unlink(((const struct sockaddr_un *)at)->sun_path);
    guest_free(g);
    bench_expect_notice(&bench, "detached");
    bench_expect_notice(&bench, "will try again");
    for (int i = 0; i < 3; i++)
        bench_poll(&bench, 0, 2);
    assert_int_equal(bench.n_queue, 0);
    listener = listen_on(at, len);
    g = accept_device(&bench, listener);
    bench_expect_notice(&bench, "plugged in again");
    guest_configure(g);
    guest_free(g);
    bench_close(&bench);
    close(listener);
    if (at->sa_family == AF_UNIX) unlink(((const struct sockaddr_un *)at)->sun_path);
}

static void test_reconnect(void **state)
{
    (void)state;
    struct link_spec spec = {.type = LINK_USB,
                             .backend = USB_BACKEND_USBREDIR,
                             .speed = USB_RATE_HIGH,
                             .vid = 1,
                             .attach = 1,
                             .retry_ms = 1};
    struct sockaddr_un named = {.sun_family = AF_UNIX};
    struct sockaddr_in tcp = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t len = sizeof tcp;
    int listener = listen_on((struct sockaddr *)&tcp, sizeof tcp);
    assert_int_equal(getsockname(listener, (struct sockaddr *)&tcp, &len), 0);
    spec.port = ntohs(tcp.sin_port);
    check_reconnects(&spec, listener, (struct sockaddr *)&tcp, sizeof tcp);
    snprintf(named.sun_path, sizeof named.sun_path, "%s", guest_path);
    snprintf(spec.path, sizeof spec.path, "%s", guest_path);
    listener = listen_on((struct sockaddr *)&named, sizeof named);
    check_reconnects(&spec, listener, (struct sockaddr *)&named, sizeof named);
}

/* The owner of the path lives and is busy, with its queue full. The path is refused at once, and left alone. */
static void test_busy_path(void **state)
{
    (void)state;
    struct sockaddr_un at = {.sun_family = AF_UNIX};
    struct link_spec spec = {.type = LINK_USB, .backend = USB_BACKEND_USBREDIR, .vid = 1};
    struct sh_err err = {0, ""};
    void *link;
    int waiting[16], n = 0;
    snprintf(at.sun_path, sizeof at.sun_path, "%s", guest_path);
    snprintf(spec.path, sizeof spec.path, "%s", guest_path);
    int listener = listen_on((struct sockaddr *)&at, sizeof at);
    for (int full = 0; !full; n++) {
        assert_in_range(n, 0, 15);
        waiting[n] = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
        full = connect(waiting[n], (struct sockaddr *)&at, sizeof at) != 0;
    }
    assert_int_equal(errno, EAGAIN);
    assert_int_equal(link_ops_get(LINK_USB)->open(&spec, &link, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, guest_path));
    assert_int_equal(access(guest_path, F_OK), 0);
    while (n > 0)
        close(waiting[--n]);
    close(listener);
    unlink(guest_path);
}

/* A path was removed, and another head listens on it by now. The path stays that head's. */
static void test_path_of_another(void **state)
{
    (void)state;
    struct bench first = redir_bench(USB_RATE_HIGH);
    assert_int_equal(unlink(guest_path), 0);
    struct bench second = redir_bench(USB_RATE_HIGH);
    bench_close(&first);
    struct guest *g = guest_new(&second);
    guest_configure(g);
    guest_free(g);
    bench_close(&second);
    assert_int_equal(access(guest_path, F_OK), -1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_path_of_another), cmocka_unit_test(test_silent),         cmocka_unit_test(test_flood),
        cmocka_unit_test(test_turns),           cmocka_unit_test(test_wrong_endpoint), cmocka_unit_test(test_reconnect),
        cmocka_unit_test(test_busy_path),
    };
    return cmocka_run_group_tests(tests, guest_setup, guest_teardown);
}

#else

#include "tests/unit/usbredir_missing.h"

#endif
