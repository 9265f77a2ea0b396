/* SPDX-License-Identifier: MIT */
#include "tests/unit/usbip_client.h"

struct bench usbip_bench(const char *serial)
{
    struct link_spec spec = {
        .type = LINK_USB, .backend = USB_BACKEND_USBIP, .speed = USB_RATE_HIGH, .vid = 0x1209, .pid = 1};
    snprintf(spec.serial, sizeof spec.serial, "%s", serial);
    return bench_open(&spec);
}

int client_read(struct client *c, void *data, size_t len)
{
    uint8_t *at = data;
    for (const int64_t end_ms = now_ms() + DEADLINE_MS; len > 0;) {
        assert_true(now_ms() < end_ms);
        ssize_t n = recv(c->fd, at, len, MSG_DONTWAIT);
        if (n == 0 || (n < 0 && errno == ECONNRESET)) return 0;
        if (n > 0) at += n, len -= (size_t)n;
        if (n < 0) bench_poll(c->bench, 0, 1);
    }
    return 1;
}

void client_write(struct client *c, const void *data, size_t len)
{
    const uint8_t *at = data;
    while (len > 0) {
        ssize_t n = send(c->fd, at, len, MSG_DONTWAIT | MSG_NOSIGNAL);
        if (n > 0) at += n, len -= (size_t)n;
        if (n < 0) bench_poll(c->bench, 0, 1);
    }
}

uint32_t client_submit(struct client *c, int in, uint32_t ep, const void *setup, const void *out, uint32_t len)
{
    uint8_t h[HEADER] = {0};
    be_put32(h, 1);
    be_put32(h + 4, ++c->seqnum);
    be_put32(h + 8, DEVID);
    be_put32(h + 12, (uint32_t)in);
    be_put32(h + 16, ep);
    be_put32(h + 24, len);
    be_put32(h + 32, 0xffffffff); /* packets: none, it is not isochronous */
    be_put32(h + 36, 64);         /* interval: for interrupts */
    if (setup != NULL) memcpy(h + 40, setup, 8);
    client_write(c, h, sizeof h);
    if (!in && len > 0) client_write(c, out, len);
    return c->seqnum;
}

uint32_t client_unlink(struct client *c, uint32_t victim)
{
    uint8_t h[HEADER] = {0};
    be_put32(h, 2);
    be_put32(h + 4, ++c->seqnum);
    be_put32(h + 8, DEVID);
    be_put32(h + 20, victim);
    client_write(c, h, sizeof h);
    return c->seqnum;
}

int client_reply(struct client *c, struct reply *r, int in)
{
    uint8_t h[HEADER];
    if (!client_read(c, h, sizeof h)) return 0;
    r->command = be_get32(h);
    r->seqnum = be_get32(h + 4);
    r->status = (int)be_get32(h + 20);
    r->actual = be_get32(h + 24);
    for (int i = 8; i < 20; i++)
        assert_int_equal(h[i], 0);
    if (r->command == 3 && in && r->actual > 0) {
        assert_in_range(r->actual, 1, sizeof r->data);
        return client_read(c, r->data, r->actual);
    }
    return 1;
}

void client_import(struct client *c, struct bench *bench)
{
    uint8_t request[40] = {0x01, 0x11, 0x80, 0x03, 0, 0, 0, 0, '1', '-', '1'}, back[320];
    *c = (struct client){.bench = bench, .fd = dial(bench_port(bench))};
    client_write(c, request, sizeof request);
    assert_true(client_read(c, back, 8));
    const uint8_t ok[8] = {0x01, 0x11, 0, 3, 0, 0, 0, 0};
    assert_memory_equal(back, ok, 8);
    assert_true(client_read(c, back + 8, 312));
    assert_string_equal((char *)back + 8 + 256, "1-1");
}

int client_control(struct client *c, struct reply *r, unsigned type, unsigned request, unsigned value, unsigned index,
                   unsigned length, const void *out)
{
    uint8_t setup[8] = {(uint8_t)type, (uint8_t)request};
    le_put16(setup + 2, (uint16_t)value);
    le_put16(setup + 4, (uint16_t)index);
    le_put16(setup + 6, (uint16_t)length);
    const int in = length > 0 && (type & 0x80) != 0;
    uint32_t seqnum = client_submit(c, in, 0, setup, out, length);
    assert_true(client_reply(c, r, in));
    assert_int_equal(r->command, 3);
    assert_int_equal(r->seqnum, seqnum);
    return r->status;
}

void client_configure(struct client *c)
{
    static struct reply r;
    assert_int_equal(client_control(c, &r, 0x00, 9, 1, 0, 0, NULL), 0);
}

void client_open_stream(struct client *c)
{
    static struct reply r;
    assert_int_equal(client_control(c, &r, 0x41, 0x22, 1, 2, 0, NULL), 0);
    assert_int_equal(bench_expect(c->bench, LINK_OPENED, 0).session, 1);
}
