/* SPDX-License-Identifier: MIT */
/* This fuzzes usbredir: the bytes that a virtual machine sends over its channel. The input is a byte (look, how ids are
 * written), then the bytes. All channels begin with a hello, which is put before the bytes unless the first byte says
 * no. */
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "core/bytes.h"
#include "drivers/usb/backend.h"
#include "drivers/usb/head_device.h"
#include "tests/fuzz/rig.h"

enum { HELLO = 0, HELLO_LEN = 64 + 4, PIECE = 4096 };

static int go_on(void *ctx)
{
    (void)ctx;
    return 1;
}

static void ignore(void *ctx, const char *text)
{
    (void)ctx, (void)text;
}

static const struct usb_owner owner = {go_on, ignore, ignore, NULL};

static int connect_to(const char *path)
{
    struct sockaddr_un at = {.sun_family = AF_UNIX};
    snprintf(at.sun_path, sizeof at.sun_path, "%s", path);
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (fd < 0 || connect(fd, (struct sockaddr *)&at, sizeof at) != 0) abort();
    return fd;
}

static void turn(const struct usb_backend_ops *ops, void *backend, struct scanhead_usb *head)
{
    struct pollfd fds[USB_BACKEND_MAX_FDS];
    uint8_t bytes[600];
    const int n = ops->prepare(backend, fds);
    poll(fds, (nfds_t)n, 0);
    ops->handle(backend, fds, n, &owner);
    for (int i = 0; i < head->personality->n_sessions; i++) {
        const struct usb_session_row *row = &head->personality->session[i];
        const size_t got = usb_device_read(head->device, row->out, bytes, sizeof bytes);
        usb_device_write(head->device, row->in, bytes, got > 0 ? got : 512);
    }
    scanhead_usb_update(head);
    ops->flush(backend);
}

/* A packet is u32 type, u32 length, u32 id, then the version as text of 64 bytes, and the capabilities. */
static void send_hello(int fd, unsigned how)
{
    uint8_t hello[12 + HELLO_LEN] = {0};
    le_put32(hello, HELLO);
    le_put32(hello + 4, HELLO_LEN);
    snprintf((char *)hello + 12, 64, "fuzz 1.0");
    /* connect_device_version, ep_info_max_packet_size, 64bits_ids, 32bits_bulk_length */
    le_put32(hello + 76, 1u << 1 | 1u << 4 | ((how >> 5) & 1u) << 5 | 1u << 6);
    if (send(fd, hello, sizeof hello, MSG_NOSIGNAL) != sizeof hello) abort();
}

static void drain(int fd)
{
    static uint8_t bytes[1 << 16];
    while (recv(fd, bytes, sizeof bytes, MSG_DONTWAIT) > 0)
        continue;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct fuzz_bytes in = {data, size};
    const unsigned how = fuzz_u8(&in);
    struct usb_identity id = {
        .vid = 0x1209, .pid = 1, .serial = "S1", .highest = (enum usb_rate)((how >> 2) % USB_N_RATES)};
    const struct usb_backend_ops *ops = usb_backend_ops_get(USB_BACKEND_USBREDIR);
    struct usb_backend_spec spec = {.type = USB_BACKEND_USBREDIR};
    struct scanhead_usb head = {0};
    struct sh_err err = {0};
    void *backend;
    if (scanhead_usb_create(usb_personality_get((enum usb_personality_id)((how & 3) % USB_N_PERSONALITIES)), &id, &head,
                            &err) != SH_OK)
        return 0;
    snprintf(spec.path, sizeof spec.path, "%s/usb", fuzz_folder());
    fuzz_must(ops->open(&spec, head.device, &backend, &err) == SH_OK, "the socket opens");
    const int fd = connect_to(spec.path);
    turn(ops, backend, &head);
    if ((how & 16) == 0) send_hello(fd, how);
    for (size_t n; in.n > 0;) {
        const uint8_t *bytes = fuzz_take(&in, PIECE, &n);
        if (send(fd, bytes, n, MSG_DONTWAIT | MSG_NOSIGNAL) != (ssize_t)n) break;
        for (int i = 0; i < 3; i++) {
            turn(ops, backend, &head);
            drain(fd);
        }
    }
    close(fd);
    ops->close(backend);
    usb_device_free(head.device);
    return 0;
}
