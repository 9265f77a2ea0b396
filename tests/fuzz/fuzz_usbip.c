/* SPDX-License-Identifier: MIT */
/* This fuzzes USB/IP: the bytes that a host sends over its connection. The input is a byte (look, whether the device is
 * imported already), then the bytes, which come in pieces. A wrong byte ends the connection, and nothing of it may be
 * left. */
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "drivers/usb/head_device.h"
#include "drivers/usb/usbip_private.h"
#include "tests/fuzz/rig.h"

enum { PIECE = 4096 };

static int go_on(void *ctx)
{
    (void)ctx;
    return 1;
}

static const struct usb_owner owner = {.go_on = go_on};

static void serve(struct scanhead_usb *head)
{
    uint8_t bytes[600];
    for (int i = 0; i < head->personality->n_sessions; i++) {
        const struct usb_session_row *row = &head->personality->session[i];
        const size_t n = usb_device_read(head->device, row->out, bytes, sizeof bytes);
        usb_device_write(head->device, row->in, bytes, n > 0 ? n : 512);
    }
    scanhead_usb_update(head);
}

/* Reads the answers away, so that the socket does not fill up. */
static void drain(int fd)
{
    static uint8_t bytes[1 << 16];
    while (recv(fd, bytes, sizeof bytes, MSG_DONTWAIT) > 0)
        continue;
}

static void talk(struct usbip_conn *conn, int peer, struct scanhead_usb *head, struct fuzz_bytes *in)
{
    while (in->n > 0 && !conn->broken) {
        size_t n;
        const uint8_t *bytes = fuzz_take(in, PIECE, &n);
        if (send(peer, bytes, n, MSG_DONTWAIT | MSG_NOSIGNAL) != (ssize_t)n) return;
        for (int turn = 0; turn < 4 && !conn->broken; turn++) {
            usbip_conn_read(conn, &owner);
            serve(head);
            usbip_conn_answer_slow(conn, &owner);
            if (!conn->broken) usbip_conn_write(conn);
            drain(peer);
        }
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct fuzz_bytes in = {data, size};
    const unsigned how = fuzz_u8(&in);
    struct usb_identity id = {
        .vid = 0x1209, .pid = 1, .serial = "S1", .highest = (enum usb_rate)((how >> 2) % USB_N_RATES)};
    struct scanhead_usb head = {0};
    struct usbip_conn conn;
    struct sh_err err = {0};
    int pair[2], taken = 0;
    if (scanhead_usb_create(usb_personality_get((enum usb_personality_id)((how & 3) % USB_N_PERSONALITIES)), &id, &head,
                            &err) != SH_OK)
        return 0;
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0, pair) != 0) abort();
    usbip_conn_start(&conn, pair[0], head.device, &taken);
    if ((how & 16) != 0) usbip_conn_import(&conn);
    if ((how & 32) != 0) usb_device_set_slow(head.device, 0.001);
    talk(&conn, pair[1], &head, &in);
    usbip_conn_end(&conn);
    fuzz_must(taken == 0, "the device is free again");
    close(pair[1]);
    usb_device_free(head.device);
    return 0;
}
