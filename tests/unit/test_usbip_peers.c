/* SPDX-License-Identifier: MIT */
/* Clients of the usbip back end that are silent, pipeline, or cut their bytes anywhere. */
#include "tests/unit/usbip_client.h"

#include <poll.h>

/* MANY requests have 48 MB without the replies: more than the sockets' buffers and the back end together. */
enum { EREMOTEIO_WIRE = -121, ECONNRESET_WIRE = -104, GET_STATUS = 0, MANY = 1000000 };

static struct reply r;

static void list_devices(struct client *c)
{
    static const uint8_t request[8] = {0x01, 0x11, 0x80, 0x05};
    uint8_t back[12 + 312 + 12];
    client_write(c, request, sizeof request);
    assert_true(client_read(c, back, sizeof back));
    assert_int_equal(back[3], 5);
}

static int connect_silent(struct bench *bench)
{
    int fd = dial(bench_port(bench));
    bench_poll(bench, 0, 0);
    return fd;
}

/* There are more silent clients than the back end has places for. */
static void test_silent(void **state)
{
    (void)state;
    enum { SILENT = 20 };
    struct bench bench = usbip_bench("N");
    struct client host, other = {.bench = &bench};
    int silent[2 * SILENT];
    for (int i = 0; i < SILENT; i++)
        silent[i] = connect_silent(&bench);
    client_import(&host, &bench);
    for (int i = SILENT; i < 2 * SILENT; i++)
        silent[i] = connect_silent(&bench);
    other.fd = dial(bench_port(&bench));
    list_devices(&other);
    assert_int_equal(client_control(&host, &r, 0x80, GET_STATUS, 0, 0, 2, NULL), 0); /* the owner keeps the device */
    list_devices(&other);
    for (int i = 0; i < 2 * SILENT; i++)
        close(silent[i]);
    close(other.fd);
    close(host.fd);
    bench_close(&bench);
}

/* Returns 1 when the link has hung up. */
static int is_put_out(int fd)
{
    char byte;
    return recv(fd, &byte, 1, MSG_DONTWAIT) == 0;
}

/* A host that hangs up gives the device back, also where more of its requests are unread than one turn takes (256), and
 * where the next host's place comes first. Here each host hangs up before the next one sends its IMPORT, so no answer
 * may be "busy" (status 2). */
static void test_next_host(void **state)
{
    (void)state;
    enum { REQUESTS = 600, ABRUPTLY = 1 };
    static const uint8_t import[40] = {0x01, 0x11, 0x80, 0x03, 0, 0, 0, 0, '1', '-', '1'}, ok[8] = {0x01, 0x11, 0, 3};
    static const struct {
        int requests, abruptly;
    } ways[] = {{0, 0}, {0, ABRUPTLY}, {REQUESTS, 0}};
    for (size_t i = 0; i < sizeof ways / sizeof ways[0]; i++) {
        struct bench bench = usbip_bench("N");
        struct client host, next = {.bench = &bench, .fd = connect_silent(&bench)};
        const struct linger reset = {ways[i].abruptly, 0};
        uint8_t back[sizeof ok];
        client_import(&host, &bench); /* in the second place */
        for (int k = 0; k < ways[i].requests; k++)
            client_unlink(&host, 1);
        assert_int_equal(setsockopt(host.fd, SOL_SOCKET, SO_LINGER, &reset, sizeof reset), 0);
        close(host.fd);
        client_write(&next, import, sizeof import);
        assert_true(client_read(&next, back, sizeof back));
        assert_memory_equal(back, ok, sizeof ok);
        close(next.fd);
        bench_close(&bench);
    }
}

/* There are four places. The client that has been here longest without importing makes room, wherever its place is. */
static void test_oldest(void **state)
{
    (void)state;
    enum { PLACES = 4 };
    struct bench bench = usbip_bench("N");
    struct client host, client[7];
    client_import(&host, &bench); /* the oldest of all, and in the first place */
    for (int i = 0; i < PLACES - 1; i++)
        client[i] = (struct client){.bench = &bench, .fd = connect_silent(&bench)};
    close(client[1].fd); /* its place is free, and goes to one that is younger than its neighbours */
    bench_poll(&bench, 0, DEADLINE_MS);
    static const int out[] = {-1, 0, 2, 3}; /* the client that has to go when client 3, 4, 5, 6 comes */
    for (int i = 3; i < 7; i++) {
        client[i] = (struct client){.bench = &bench, .fd = connect_silent(&bench)};
        for (int k = 0; k <= i; k++)
            if (k != 1 && client[k].fd >= 0 && is_put_out(client[k].fd) != (k == out[i - 3]))
                fail_msg("client %d came: client %d is %s", i, k, k == out[i - 3] ? "still there" : "put out");
        if (i == 3) continue;
        close(client[out[i - 3]].fd);
        client[out[i - 3]].fd = -1;
    }
    for (int i = 4; i < 7; i++) {
        list_devices(&client[i]);
        close(client[i].fd);
    }
    assert_int_equal(client_control(&host, &r, 0x80, GET_STATUS, 0, 0, 2, NULL), 0);
    close(host.fd);
    bench_close(&bench);
}

static void put_submit(uint8_t *at, uint32_t seqnum, int in, uint32_t ep, uint32_t len, const uint8_t *setup)
{
    memset(at, 0, HEADER);
    be_put32(at, 1);
    be_put32(at + 4, seqnum);
    be_put32(at + 8, DEVID);
    be_put32(at + 12, (uint32_t)in);
    be_put32(at + 16, ep);
    be_put32(at + 24, len);
    be_put32(at + 32, 0xffffffff);
    if (setup != NULL) memcpy(at + 40, setup, 8);
}

/* Sends as long as there is room and the link moves. Returns the requests begun. */
static uint32_t send_requests(struct client *c)
{
    static const uint8_t get_status[8] = {0x80, GET_STATUS, 0, 0, 0, 0, 2, 0};
    uint8_t head[HEADER];
    uint32_t n = 0;
    for (size_t pos = HEADER, stuck = 0; stuck < 3;) {
        if (pos == HEADER) {
            assert_true(n < MANY); /* no buffer holds so much */
            put_submit(head, ++n, 1, 0, 2, get_status);
            pos = 0;
        }
        ssize_t sent = send(c->fd, head + pos, HEADER - pos, MSG_DONTWAIT | MSG_NOSIGNAL);
        if (sent > 0) {
            pos += (size_t)sent;
            stuck = 0;
            continue;
        }
        assert_int_equal(errno, EAGAIN); /* and not cut off */
        /* A link that can't go on waits. A link whose host can't read yet moves as much as the kernel takes. */
        const int64_t start_ms = now_ms();
        bench_poll(c->bench, 0, 50);
        if (now_ms() - start_ms >= 49) stuck++;
    }
    return n;
}

/* A host sends and sends before it reads. It is held back, not cut off, and gets every reply in its order. */
static void test_pipelining(void **state)
{
    (void)state;
    struct bench bench = usbip_bench("N");
    struct client c;
    client_import(&c, &bench);
    const uint32_t n = send_requests(&c);
    assert_true(n > 5000); /* more than the back end holds of any kind (4096) */
    for (uint32_t i = 1; i < n; i++) {
        assert_true(client_reply(&c, &r, 1));
        assert_int_equal(r.seqnum, i);
        assert_int_equal(r.status, 0);
        assert_int_equal(r.actual, 2);
    }
    close(c.fd);
    bench_close(&bench);
}

/* One turn of the link's thread is over in bounded time, however much the host has sent. */
static void test_turns(void **state)
{
    (void)state;
    enum { REQUESTS = 3000 };
    static const uint8_t get_status[8] = {0x80, GET_STATUS, 0, 0, 0, 0, 2, 0};
    static uint8_t back[REQUESTS * (HEADER + 2)];
    struct bench bench = usbip_bench("N");
    struct client c;
    client_import(&c, &bench);
    for (uint32_t i = 0; i < REQUESTS; i++) {
        uint8_t head[HEADER];
        put_submit(head, i + 1, 1, 0, 2, get_status);
        assert_int_equal(send(c.fd, head, sizeof head, MSG_DONTWAIT), sizeof head); /* all of it fits: 144 KB */
    }
    size_t got = 0;
    int turns = 0;
    for (const int64_t end_ms = now_ms() + DEADLINE_MS; got < sizeof back; turns++) {
        assert_true(now_ms() < end_ms);
        bench_poll(&bench, 0, 1);
        ssize_t n = recv(c.fd, back + got, sizeof back - got, MSG_DONTWAIT);
        if (n > 0) got += (size_t)n;
    }
    assert_true(turns >= REQUESTS / 500); /* all of it is there from the first turn on */
    for (uint32_t i = 0; i < REQUESTS; i++)
        assert_int_equal(be_get32(back + i * (HEADER + 2) + 4), i + 1);
    close(c.fd);
    bench_close(&bench);
}

/* Runs one whole session of a host. The answers are the same however the bytes are cut. */
static size_t session(size_t piece, uint8_t *got, size_t room)
{
    static const uint8_t import[40] = {0x01, 0x11, 0x80, 0x03, 0, 0, 0, 0, '1', '-', '1'};
    static const uint8_t describe[8] = {0x80, 6, 0, 1, 0, 0, 18, 0}, configure[8] = {0, 9, 1},
                         coding[8] = {0x21, 0x20, 0, 0, 0, 0, 7, 0}, rate[7] = {0x80, 0x25, 0, 0, 0, 0, 8};
    uint8_t said[40 + 6 * HEADER + 7 + 5], *at = said;
    memcpy(at, import, sizeof import);
    at += sizeof import;
    put_submit(at, 1, 1, 0, 18, describe);
    put_submit(at += HEADER, 2, 0, 0, 0, configure);
    put_submit(at += HEADER, 3, 0, 0, 7, coding);
    memcpy(at += HEADER, rate, 7);
    put_submit(at += 7, 4, 1, 3, 512, NULL); /* waits */
    put_submit(at += HEADER, 5, 0, 1, 5, NULL);
    memcpy(at += HEADER, "*RST\n", 5); /* waits: there is no session */
    at += 5;
    put_submit(at, 6, 0, 0, 0, NULL);
    be_put32(at, 2); /* unlink */
    be_put32(at + 20, 4);
    at += HEADER;
    assert_int_equal(at - said, sizeof said);

    struct bench bench = usbip_bench("N");
    struct client c = {.bench = &bench, .fd = dial(bench_port(&bench))};
    for (size_t i = 0; i < sizeof said; i += piece) {
        client_write(&c, said + i, piece < sizeof said - i ? piece : sizeof said - i);
        bench_poll(&bench, 0, 0);
    }
    const size_t want = 8 + 312 + HEADER + 18 + 2 * HEADER + HEADER;
    assert_true(want <= room);
    assert_true(client_read(&c, got, want));
    close(c.fd);
    bench_close(&bench);
    return want;
}

static void test_segments(void **state)
{
    (void)state;
    static const size_t pieces[] = {1, 7, 47, 48, 49, 100};
    uint8_t whole[1024], cut[1024];
    const size_t n = session(1 << 20, whole, sizeof whole);
    assert_int_equal(be_get32(whole + n - HEADER), 4); /* the last is the unlink's */
    assert_int_equal((int)be_get32(whole + n - HEADER + 20), -104);
    for (size_t i = 0; i < sizeof pieces / sizeof pieces[0]; i++) {
        assert_int_equal(session(pieces[i], cut, sizeof cut), n);
        assert_memory_equal(cut, whole, n);
    }
}

/* The server judges URB_SHORT_NOT_OK, as a host controller does (include/linux/usb.h). */
static void test_short_not_ok(void **state)
{
    (void)state;
    struct bench bench = usbip_bench("N");
    struct client c;
    client_import(&c, &bench);
    client_configure(&c);
    client_open_stream(&c);
    for (int strict = 0; strict < 2; strict++) {
        static const char data[512] = "abc";
        for (uint32_t len = 3; len <= 512; len += 509) {
            uint8_t head[HEADER];
            put_submit(head, ++c.seqnum, 1, 3, 512, NULL);
            be_put32(head + 20, (uint32_t)strict);
            client_write(&c, head, sizeof head);
            bench_expect(&bench, LINK_WRITABLE, 2);
            bench_write_all(&bench, 1, data, len);
            assert_true(client_reply(&c, &r, 1));
            assert_int_equal(r.actual, len);
            assert_int_equal(r.status, strict && len < 512 ? EREMOTEIO_WIRE : 0);
        }
        client_submit(&c, 1, 3, NULL, NULL, 512); /* for the empty packet behind the whole one */
        assert_true(client_reply(&c, &r, 1));
        assert_int_equal(r.actual, 0);
    }
    close(c.fd);
    bench_close(&bench);
}

/* Requested bytes that were not received may be 64 MiB (drivers/usb/usbip_private.h). One byte more cuts the client
 * off. */
static void test_bytes_pending(void **state)
{
    (void)state;
    enum { MIB = 1 << 20 };
    static const uint32_t lens[] = {16 * MIB, 16 * MIB, 16 * MIB, 16 * MIB - 3};
    struct bench bench = usbip_bench("N");
    struct client c;
    uint8_t byte;
    client_import(&c, &bench);
    client_configure(&c);
    client_open_stream(&c);
    for (int i = 0; i < 5; i++) { /* an unlinked request gives its bytes back */
        client_unlink(&c, client_submit(&c, 1, 3, NULL, NULL, 16 * MIB));
        assert_true(client_reply(&c, &r, 0));
        assert_int_equal(r.status, ECONNRESET_WIRE);
    }
    for (size_t i = 0; i < sizeof lens / sizeof lens[0]; i++)
        client_submit(&c, 1, 3, NULL, NULL, lens[i]);
    assert_int_equal(client_control(&c, &r, 0x80, GET_STATUS, 0, 0, 2, NULL), 0); /* these are given back */
    client_submit(&c, 1, 3, NULL, NULL, 3);
    assert_int_equal(client_control(&c, &r, 0x02, 1, 0, 0x83, 0, NULL), 0); /* no byte: it is still served */
    client_submit(&c, 1, 3, NULL, NULL, 1);
    assert_false(client_read(&c, &byte, 1));
    close(c.fd);
    bench_close(&bench);
}

/* Up to 4096 requests may wait for the device (USB.md). A request on endpoint 0 and an UNLINK don't count among them:
 * the protocol's documentation has an answer to each UNLINK. One more read cuts the client off. */
static void test_requests_pending(void **state)
{
    (void)state;
    enum { MOST = 4096 };
    struct bench bench = usbip_bench("N");
    struct client c;
    uint8_t byte;
    client_import(&c, &bench);
    client_configure(&c);
    client_open_stream(&c);
    for (int i = 0; i < MOST; i++)
        client_submit(&c, 1, 3, NULL, NULL, 512);
    assert_int_equal(client_control(&c, &r, 0x80, GET_STATUS, 0, 0, 2, NULL), 0);
    for (int waits = 0; waits < 2; waits++) { /* an answered one, and one that waits: the first read is number 3 */
        const uint32_t unlink = client_unlink(&c, waits ? 3 : 1);
        assert_true(client_reply(&c, &r, 0));
        assert_int_equal(r.command, 4);
        assert_int_equal(r.seqnum, unlink);
        assert_int_equal(r.status, waits ? ECONNRESET_WIRE : 0);
    }
    client_submit(&c, 1, 3, NULL, NULL, 512);
    assert_int_equal(client_control(&c, &r, 0x80, GET_STATUS, 0, 0, 2, NULL), 0);
    client_submit(&c, 1, 3, NULL, NULL, 512);
    assert_false(client_read(&c, &byte, 1));
    bench_expect(&bench, LINK_CLOSED, 0);
    bench_expect_notice(&bench, "the USB/IP host is cut off: more than 4096 requests");
    close(c.fd);
    bench_close(&bench);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_silent),        cmocka_unit_test(test_oldest),    cmocka_unit_test(test_pipelining),
        cmocka_unit_test(test_turns),         cmocka_unit_test(test_segments),  cmocka_unit_test(test_short_not_ok),
        cmocka_unit_test(test_bytes_pending), cmocka_unit_test(test_next_host), cmocka_unit_test(test_requests_pending),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
