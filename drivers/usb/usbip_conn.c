/* SPDX-License-Identifier: MIT */
/* A connection of a USB/IP client: DEVLIST and IMPORT, then SUBMIT and UNLINK.
 *
 * The peer is not trusted: what breaks the protocol, or asks for more memory than a host needs, ends the
 * connection. */
#include <poll.h>
#include <unistd.h>

#include "core/bytes.h"
#include "drivers/socket/socket.h"
#include "drivers/usb/backend.h"
#include "drivers/usb/usbip_private.h"

enum {
    MAX_URB_BYTES = 16 << 20, /* of one URB: as much as usbfs by default allows for all URBs together */
    MAX_READS = 256,          /* in one call: a peer that sends without end must not occupy the thread */
};

/* If the host's driver forbids short packets, they are an error, as in a host controller. */
static void return_urb(struct usbip_conn *conn, struct usbip_urb *urb, int status, uint32_t actual)
{
    enum { WIRE_EREMOTEIO = 121 };
    if (status == 0 && urb->in && urb->short_is_error && actual < urb->room) status = -WIRE_EREMOTEIO;
    memset(urb->wire, 0, URB_HEADER);
    be_put32(urb->wire, RET_SUBMIT);
    be_put32(urb->wire + 4, (uint32_t)urb->transfer.id);
    be_put32(urb->wire + 20, (uint32_t)status);
    be_put32(urb->wire + 24, actual);
    usbip_queue(conn, urb, URB_HEADER + (urb->in ? actual : 0));
}

/* The protocol uses Linux's errno numbers, whatever this system's are. */
static int errno_of(enum usb_status status)
{
    enum { WIRE_ECONNRESET = 104, WIRE_EPIPE = 32, WIRE_ESHUTDOWN = 108, WIRE_EOVERFLOW = 75 };
    static const int numbers[] = {[USB_OK] = 0,
                                  [USB_CANCELLED] = -WIRE_ECONNRESET,
                                  [USB_STALLED] = -WIRE_EPIPE,
                                  [USB_GONE] = -WIRE_ESHUTDOWN,
                                  [USB_OVERFLOW] = -WIRE_EOVERFLOW};
    return numbers[status];
}

/* An unlinked URB has no reply of its own: RET_UNLINK is the reply. */
static void on_complete(void *ctx, struct usb_transfer *transfer)
{
    struct usbip_conn *conn = ctx;
    struct usbip_urb *urb = (struct usbip_urb *)transfer;
    if (transfer->status == USB_CANCELLED)
        usbip_urb_free(conn, urb);
    else
        return_urb(conn, urb, errno_of(transfer->status), transfer->actual);
}

void usbip_conn_import(struct usbip_conn *conn)
{
    conn->imported = *conn->taken = 1;
    usb_device_attach(conn->device, usb_facts(conn->device)->id.highest, on_complete, conn);
    usb_device_assume_address(conn->device); /* the client's kernel does not send SET_ADDRESS on */
}

/* ---- URBs */

static void run_control(struct usbip_conn *conn, struct usbip_urb *urb)
{
    struct usb_ctrlrequest setup;
    memcpy(&setup, urb->setup, sizeof setup);
    const uint32_t length = le_get16(&setup.wLength);
    const int in = length != 0 && (setup.bRequestType & USB_DIR_IN) != 0;
    int n = USB_STALL;
    /* Where the URB contradicts its setup, a host controller could not carry it. */
    if (urb->room == length && (length == 0 || in == urb->in))
        n = usb_device_control(conn->device, &setup, urb->wire + URB_HEADER, length);
    if (n < 0)
        return_urb(conn, urb, errno_of(USB_STALLED), 0);
    else
        return_urb(conn, urb, 0, urb->in ? (uint32_t)n : urb->room);
}

void usbip_conn_answer_slow(struct usbip_conn *conn, const struct usb_owner *owner)
{
    struct usb_transfer *request;
    while (!conn->broken && conn->held != NULL && owner->go_on(owner->ctx) &&
           (request = usb_take_due(&conn->held)) != NULL)
        run_control(conn, (struct usbip_urb *)request);
}

/* Frees a control request that is held, and returns 1. 0: no such request is held. */
static int forget_control(struct usbip_conn *conn, uint32_t seqnum)
{
    struct usb_transfer *request = usb_let_go(&conn->held, seqnum);
    if (request != NULL) usbip_urb_free(conn, (struct usbip_urb *)request);
    return request != NULL;
}

/* Carries out a SUBMIT, once all its bytes are here. */
static void run_submit(struct usbip_conn *conn, struct usbip_urb *urb)
{
    const unsigned number = be_get32(conn->head + 16);
    if (number == 0) {
        memcpy(urb->setup, conn->head + 40, sizeof urb->setup);
        if (usb_has_to_wait(conn->device, conn->held))
            usb_hold(conn->device, &conn->held, &urb->transfer);
        else
            run_control(conn, urb);
        return;
    }
    urb->transfer.endpoint = (uint8_t)(number | (urb->in ? USB_DIR_IN : 0));
    urb->transfer.length = urb->room;
    urb->transfer.data = urb->wire + URB_HEADER;
    usb_device_submit(conn->device, &urb->transfer);
}

static void take_submit(struct usbip_conn *conn)
{
    const uint32_t direction = be_get32(conn->head + 12), endpoint = be_get32(conn->head + 16),
                   length = be_get32(conn->head + 24), packets = be_get32(conn->head + 32);
    if (direction > DIR_IN || (packets != 0 && packets != UINT32_MAX) || endpoint > 15) {
        usbip_conn_break(conn, "a request without a valid direction or endpoint, or with isochronous packets");
        return;
    }
    if (length > MAX_URB_BYTES) {
        usbip_conn_break(conn, "a request of more than 16 MiB");
        return;
    }
    struct usbip_urb *urb = usbip_urb_new(conn, endpoint, length);
    if (urb == NULL) return;
    urb->transfer.id = be_get32(conn->head + 4); /* its sequence number */
    urb->in = direction == DIR_IN;
    urb->short_is_error = (be_get32(conn->head + 20) & URB_SHORT_NOT_OK) != 0;
    if (urb->in || length == 0) {
        run_submit(conn, urb);
        return;
    }
    conn->incoming = urb;
    conn->incoming_len = 0;
}

static void take_unlink(struct usbip_conn *conn)
{
    const uint32_t seqnum = be_get32(conn->head + 4), victim = be_get32(conn->head + 20);
    const int was_pending = forget_control(conn, victim) || usb_device_cancel(conn->device, victim);
    uint8_t *out = usbip_queue_plain(conn, URB_HEADER);
    if (out == NULL) return;
    be_put32(out, RET_UNLINK);
    be_put32(out + 4, seqnum);
    be_put32(out + 20, (uint32_t)errno_of(was_pending ? USB_CANCELLED : USB_OK));
}

static void take_urb(struct usbip_conn *conn)
{
    const uint32_t command = be_get32(conn->head);
    conn->head_len = 0;
    if (be_get32(conn->head + 8) != usbip_devid(conn->device))
        usbip_conn_break(conn, "a request to another device");
    else if (command == CMD_SUBMIT)
        take_submit(conn);
    else if (command == CMD_UNLINK)
        take_unlink(conn);
    else
        usbip_conn_break(conn, "a command other than SUBMIT and UNLINK");
}

/* ---- bytes */

/* Reads up to n bytes to `at`, and returns how many. 0: there are none now, or the connection is broken. */
static uint32_t receive(struct usbip_conn *conn, uint8_t *at, uint32_t n)
{
    ssize_t got = socket_read(conn->fd, at, n);
    if (got < 0) conn->broken = 1;
    return got > 0 ? (uint32_t)got : 0;
}

static uint32_t read_incoming(struct usbip_conn *conn)
{
    struct usbip_urb *urb = conn->incoming;
    uint32_t n = receive(conn, urb->wire + URB_HEADER + conn->incoming_len, urb->room - conn->incoming_len);
    conn->incoming_len += n;
    if (conn->incoming_len < urb->room) return n;
    conn->incoming = NULL;
    run_submit(conn, urb);
    return n;
}

static uint32_t head_need(const struct usbip_conn *conn)
{
    return conn->imported ? URB_HEADER : usbip_op_need(conn);
}

static uint32_t read_head(struct usbip_conn *conn)
{
    const uint32_t n = receive(conn, conn->head + conn->head_len, head_need(conn) - conn->head_len);
    conn->head_len += n;
    if (n == 0 || conn->head_len < head_need(conn)) return n;
    if (conn->imported)
        take_urb(conn);
    else
        usbip_op_take(conn);
    return n;
}

void usbip_conn_read(struct usbip_conn *conn, const struct usb_owner *owner)
{
    for (int reads = 0; reads < MAX_READS && !conn->broken && owner->go_on(owner->ctx); reads++) {
        if (usbip_conn_is_full(conn)) usbip_conn_write(conn); /* a host may send many requests before it reads */
        if (usbip_conn_is_full(conn)) return;
        if ((conn->incoming != NULL ? read_incoming(conn) : read_head(conn)) == 0) return;
    }
}

void usbip_conn_start(struct usbip_conn *conn, int fd, struct usb_device *device, int *taken)
{
    *conn = (struct usbip_conn){.fd = fd, .device = device, .taken = taken};
}

void usbip_conn_drain(struct usbip_conn *conn, int timeout_ms)
{
    struct pollfd slot = {.fd = conn->fd, .events = POLLOUT};
    while (!conn->broken && conn->out_first != NULL && poll(&slot, 1, timeout_ms) > 0)
        usbip_conn_write(conn);
    if (!conn->broken) usb_backend_hang_up(conn->fd, timeout_ms);
}

void usbip_conn_end(struct usbip_conn *conn)
{
    if (conn->fd < 0) return;
    if (conn->imported) {
        usb_device_detach(conn->device); /* what is pending comes back as replies, to be freed below */
        *conn->taken = 0;
    }
    if (conn->incoming != NULL) usbip_urb_free(conn, conn->incoming);
    while (conn->held != NULL)
        forget_control(conn, (uint32_t)conn->held->id);
    usbip_queue_clear(conn);
    close(conn->fd);
    *conn = (struct usbip_conn){.fd = -1};
}
