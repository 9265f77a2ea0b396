/* SPDX-License-Identifier: MIT */
#include "tests/wire/usbip_host.h"

#include "core/bytes.h"

enum { HEADER = 48, TO_DEVICE = 0, FROM_DEVICE = 1 };

static void read_all(int fd, void *data, size_t len)
{
    for (uint8_t *at = data; len > 0;) {
        struct pollfd slot = {.fd = fd, .events = POLLIN};
        assert_int_equal(poll(&slot, 1, DEADLINE_MS), 1);
        const ssize_t n = read(fd, at, len);
        assert_true(n > 0);
        at += n;
        len -= (size_t)n;
    }
}

struct usbip_host usbip_host_open_within(const struct head *head, int timeout_ms)
{
    for (const int64_t end_ms = wire_now_ms() + timeout_ms; wire_now_ms() < end_ms;) {
        const int fd = raw_try_connect(head_endpoint(head, "usb"));
        if (fd < 0) continue;
        close(fd);
        return usbip_host_open(head);
    }
    fail_msg("nobody listens");
    return (struct usbip_host){.fd = -1};
}

struct usbip_host usbip_host_open(const struct head *head)
{
    static const uint8_t list[8] = {0x01, 0x11, 0x80, 0x05};
    uint8_t import[8 + USBIP_BUS_ID_LEN] = {0x01, 0x11, 0x80, 0x03}, reply[12];
    struct usbip_host host = {.seqnum = 0};
    char at[128]; /* "usbip:127.0.0.1:PORT" as a socket's address */
    snprintf(at, sizeof at, "tcp%s", strchr(head_endpoint(head, "usb"), ':'));
    host.fd = raw_connect(at);
    raw_send(host.fd, list, sizeof list);
    read_all(host.fd, reply, 12);
    assert_int_equal(reply[11], 1);
    read_all(host.fd, host.device, USBIP_DEVICE_LEN);
    assert_in_range(host.device[311], 1, USBIP_MAX_INTERFACES);
    read_all(host.fd, host.interface, 4u * host.device[311]);
    memcpy(import + 8, host.device + USBIP_BUS_ID, USBIP_BUS_ID_LEN);
    raw_send(host.fd, import, sizeof import);
    read_all(host.fd, reply, 8);
    assert_int_equal(reply[7], 0);
    read_all(host.fd, host.device, USBIP_DEVICE_LEN);
    return host;
}

void usbip_host_close(struct usbip_host *host)
{
    close(host->fd);
}

static void start_transfer(struct usbip_host *host, unsigned endpoint, int in, const uint8_t *setup, uint32_t len)
{
    uint8_t submit[HEADER] = {[3] = 1};
    be_put32(submit + 4, ++host->seqnum);
    memcpy(submit + 8, (const uint8_t[]){host->device[290], host->device[291], host->device[294], host->device[295]},
           4); /* bus and device */
    be_put32(submit + 12, in ? FROM_DEVICE : TO_DEVICE);
    be_put32(submit + 16, endpoint);
    be_put32(submit + 24, len);
    if (setup != NULL) memcpy(submit + 40, setup, 8);
    raw_send(host->fd, submit, sizeof submit);
}

void usbip_host_ask(struct usbip_host *host, unsigned endpoint, uint32_t len)
{
    start_transfer(host, endpoint, 1, NULL, len);
}

/* Submits and waits for the reply. Returns the number of bytes that came, or the negative status. */
static int transfer(struct usbip_host *host, unsigned endpoint, int in, const uint8_t *setup, void *data, uint32_t len)
{
    uint8_t reply[HEADER];
    start_transfer(host, endpoint, in, setup, len);
    if (!in && len > 0) raw_send(host->fd, data, len);
    read_all(host->fd, reply, sizeof reply);
    assert_int_equal(be_get32(reply), 3);
    assert_int_equal(be_get32(reply + 4), host->seqnum);
    const int status = (int)be_get32(reply + 20), n = (int)be_get32(reply + 24);
    if (in) {
        assert_in_range(n, 0, len);
        read_all(host->fd, data, (size_t)n);
    }
    return status != 0 ? status : n;
}

int usbip_host_control(struct usbip_host *host, unsigned type, unsigned request, unsigned value, unsigned index,
                       void *data, unsigned len)
{
    const uint8_t setup[8] = {(uint8_t)type,  (uint8_t)request,      (uint8_t)value, (uint8_t)(value >> 8),
                              (uint8_t)index, (uint8_t)(index >> 8), (uint8_t)len,   (uint8_t)(len >> 8)};
    return transfer(host, 0, len != 0 && (type & 0x80) != 0, setup, data, len);
}

void usbip_host_string(struct usbip_host *host, unsigned index, char *text, size_t len)
{
    uint8_t string[256];
    size_t used = 0;
    const int n = index != 0 ? usbip_host_control(host, 0x80, 6, 0x0300 | index, 0x0409, string, 255) : 0;
    for (int i = 2; i + 1 < n && used + 1 < len; i += 2)
        text[used++] = (char)string[i];
    text[used] = '\0';
}

void usbip_host_send(struct usbip_host *host, unsigned endpoint, const void *data, uint32_t len)
{
    assert_int_equal(transfer(host, endpoint, 0, NULL, (void *)(uintptr_t)data, len), len);
}

uint32_t usbip_host_receive(struct usbip_host *host, unsigned endpoint, void *data, uint32_t len)
{
    const int n = transfer(host, endpoint, 1, NULL, data, len);
    assert_true(n >= 0);
    return (uint32_t)n;
}
