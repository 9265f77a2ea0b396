/* A connection of a USB/IP client: DEVLIST and IMPORT, then SUBMIT and UNLINK.
 *
 * The peer is not trusted: what breaks the protocol, or asks for more memory than a host needs, ends the connection. */
#include <arpa/inet.h>
#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <unistd.h>

#include "drivers/protocol/bytes.h"
#include "drivers/usb/backend.h"
#include "drivers/usb/usbip.h"
#include "drivers/usb/usbip_conn.h"

enum {
    MAX_URB_BYTES = 16 << 20,     /* of one; usbfs's own limit by default is 16 MiB in all */
    MAX_PENDING_BYTES = 64 << 20, /* of all */
    MAX_PENDING = 4096,
    MAX_REPLY_PARTS = 64,
};

/* The header of the reply stands before the bytes, so that both leave in one piece. */
struct usbip_urb {
    struct usb_transfer transfer;
    struct usbip_conn *conn;
    struct usbip_urb *next;
    uint32_t seqnum;
    int in;
    uint32_t send_len; /* of wire, once it is a reply */
    uint32_t room;
    uint8_t wire[]; /* URB_HEADER, then room bytes */
};

static void put_be16(uint8_t *at, unsigned v)
{
    const uint16_t be = htons((uint16_t)v);
    memcpy(at, &be, sizeof be);
}

static void put_be32(uint8_t *at, uint32_t v)
{
    const uint32_t be = htonl(v);
    memcpy(at, &be, sizeof be);
}

static uint32_t get_be32(const uint8_t *at)
{
    uint32_t be;
    memcpy(&be, at, sizeof be);
    return ntohl(be);
}

static unsigned get_be16(const uint8_t *at)
{
    return (unsigned)at[0] << 8 | at[1];
}

/* ---- replies */

static struct usbip_urb *new_urb(struct usbip_conn *conn, uint32_t room)
{
    if (conn->n_urbs >= MAX_PENDING || conn->n_bytes + room > MAX_PENDING_BYTES) return NULL;
    struct usbip_urb *urb = malloc(sizeof *urb + URB_HEADER + room);
    if (urb == NULL) return NULL;
    memset(urb, 0, sizeof *urb + URB_HEADER); /* the bytes are written before they are sent */
    urb->conn = conn;
    urb->room = room;
    conn->n_urbs++;
    conn->n_bytes += room;
    return urb;
}

static void free_urb(struct usbip_conn *conn, struct usbip_urb *urb)
{
    conn->n_urbs--;
    conn->n_bytes -= urb->room;
    free(urb);
}

static void queue(struct usbip_conn *conn, struct usbip_urb *urb, uint32_t len)
{
    urb->send_len = len;
    urb->next = NULL;
    if (conn->out_last != NULL)
        conn->out_last->next = urb;
    else
        conn->out_first = urb;
    conn->out_last = urb;
}

static void return_urb(struct usbip_conn *conn, struct usbip_urb *urb, int status, uint32_t actual)
{
    memset(urb->wire, 0, URB_HEADER);
    put_be32(urb->wire, RET_SUBMIT);
    put_be32(urb->wire + 4, urb->seqnum);
    put_be32(urb->wire + 20, (uint32_t)status);
    put_be32(urb->wire + 24, actual);
    queue(conn, urb, URB_HEADER + (urb->in ? actual : 0));
}

/* A reply that is nothing but its own bytes. */
static uint8_t *plain_reply(struct usbip_conn *conn, uint32_t len)
{
    struct usbip_urb *reply = new_urb(conn, len > URB_HEADER ? len - URB_HEADER : 0);
    if (reply == NULL) {
        conn->broken = 1;
        return NULL;
    }
    queue(conn, reply, len);
    return reply->wire;
}

/* Linux's numbers, whatever this system's are: they are the protocol's. */
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

/* An unlinked URB has no reply of its own: RET_UNLINK says it all. */
static void on_complete(void *ctx, struct usb_transfer *transfer)
{
    struct usbip_conn *conn = ctx;
    struct usbip_urb *urb = (struct usbip_urb *)transfer;
    if (transfer->status == USB_CANCELLED)
        free_urb(conn, urb);
    else
        return_urb(conn, urb, errno_of(transfer->status), transfer->actual);
}

/* ---- operations */

static void describe_device(const struct usbip_conn *conn, uint8_t *out)
{
    static const uint8_t speed[] = {
        [USB_RATE_FULL] = USB_SPEED_FULL, [USB_RATE_HIGH] = USB_SPEED_HIGH, [USB_RATE_SUPER] = USB_SPEED_SUPER};
    const struct usb_model *model = usb_device_model(conn->device);
    const struct usb_identity *id = usb_device_identity(conn->device);
    memset(out, 0, OP_DEVICE);
    strcpy((char *)out, "/sys/devices/scanhead/" USBIP_BUSID);
    strcpy((char *)out + 256, USBIP_BUSID);
    put_be32(out + 288, USBIP_BUS);
    put_be32(out + 292, USBIP_DEVICE);
    put_be32(out + 296, speed[id->highest]);
    put_be16(out + 300, id->vid);
    put_be16(out + 302, id->pid);
    put_be16(out + 304, model->bcd_device);
    out[306] = model->class;
    out[307] = model->subclass;
    out[308] = model->protocol;
    out[309] = (uint8_t)usb_device_configuration(conn->device);
    out[310] = 1;
    out[311] = model->n_interfaces;
}

static void put_op(uint8_t *out, unsigned code, uint32_t status)
{
    put_be16(out, USBIP_VERSION);
    put_be16(out + 2, code);
    put_be32(out + 4, status);
}

static void list_devices(struct usbip_conn *conn)
{
    const struct usb_model *model = usb_device_model(conn->device);
    uint8_t *out = plain_reply(conn, OP_HEADER + 4 + OP_DEVICE + (uint32_t)model->n_interfaces * OP_INTERFACE);
    if (out == NULL) return;
    put_op(out, OP_REP_DEVLIST, OP_OK);
    put_be32(out + 8, 1);
    describe_device(conn, out + 12);
    for (unsigned i = 0; i < model->n_interfaces; i++) {
        const struct usb_interface_row *row = usb_find_row(model, i, 0);
        uint8_t *at = out + 12 + OP_DEVICE + i * OP_INTERFACE;
        at[0] = row->class;
        at[1] = row->subclass;
        at[2] = row->protocol;
        at[3] = 0;
    }
}

void usbip_conn_import(struct usbip_conn *conn)
{
    conn->imported = *conn->taken = 1;
    usb_device_attach(conn->device, usb_device_identity(conn->device)->highest, on_complete, conn);
    usb_device_assume_address(conn->device); /* the client's kernel gives out addresses, and keeps them */
}

static void import_device(struct usbip_conn *conn, const uint8_t *busid)
{
    const int known = strncmp((const char *)busid, USBIP_BUSID, BUSID_LEN) == 0;
    const uint32_t status = !known ? OP_FAILED : *conn->taken ? OP_BUSY : OP_OK;
    uint8_t *out = plain_reply(conn, OP_HEADER + (status == OP_OK ? OP_DEVICE : 0));
    if (out == NULL) return;
    put_op(out, OP_REP_IMPORT, status);
    if (status != OP_OK) return;
    describe_device(conn, out + OP_HEADER);
    usbip_conn_import(conn);
}

/* How many bytes the head needs, as far as it has come. */
static uint32_t head_need(const struct usbip_conn *conn)
{
    if (conn->imported) return URB_HEADER;
    if (conn->head_len < OP_HEADER) return OP_HEADER;
    return get_be16(conn->head + 2) == OP_REQ_IMPORT ? OP_IMPORT : OP_HEADER;
}

static void take_op(struct usbip_conn *conn)
{
    const unsigned code = get_be16(conn->head + 2);
    conn->head_len = 0;
    if (get_be16(conn->head) != USBIP_VERSION || (code != OP_REQ_DEVLIST && code != OP_REQ_IMPORT))
        conn->broken = 1;
    else if (code == OP_REQ_DEVLIST)
        list_devices(conn);
    else
        import_device(conn, conn->head + OP_HEADER);
}

/* ---- URBs */

static void run_control(struct usbip_conn *conn, struct usbip_urb *urb, const uint8_t *setup_bytes)
{
    struct usb_ctrlrequest setup;
    memcpy(&setup, setup_bytes, sizeof setup);
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

/* All bytes of it are here. */
static void run_submit(struct usbip_conn *conn, struct usbip_urb *urb)
{
    const unsigned number = get_be32(conn->head + 16);
    if (number == 0) {
        run_control(conn, urb, conn->head + 40);
        return;
    }
    urb->transfer.id = urb->seqnum;
    urb->transfer.endpoint = (uint8_t)(number | (urb->in ? USB_DIR_IN : 0));
    urb->transfer.length = urb->room;
    urb->transfer.data = urb->wire + URB_HEADER;
    usb_device_submit(conn->device, &urb->transfer);
}

static void take_submit(struct usbip_conn *conn)
{
    const uint32_t direction = get_be32(conn->head + 12), length = get_be32(conn->head + 24),
                   packets = get_be32(conn->head + 32);
    struct usbip_urb *urb = NULL;
    if (direction <= DIR_IN && length <= MAX_URB_BYTES && (packets == 0 || packets == UINT32_MAX) &&
        get_be32(conn->head + 16) <= 15)
        urb = new_urb(conn, length);
    if (urb == NULL) {
        conn->broken = 1;
        return;
    }
    urb->seqnum = get_be32(conn->head + 4);
    urb->in = direction == DIR_IN;
    if (urb->in || length == 0) {
        run_submit(conn, urb);
        return;
    }
    conn->incoming = urb;
    conn->incoming_len = 0;
}

static void take_unlink(struct usbip_conn *conn)
{
    const uint32_t seqnum = get_be32(conn->head + 4);
    const int was_pending = usb_device_cancel(conn->device, get_be32(conn->head + 20));
    uint8_t *out = plain_reply(conn, URB_HEADER);
    if (out == NULL) return;
    put_be32(out, RET_UNLINK);
    put_be32(out + 4, seqnum);
    put_be32(out + 20, (uint32_t)errno_of(was_pending ? USB_CANCELLED : USB_OK));
}

static void take_urb(struct usbip_conn *conn)
{
    const uint32_t command = get_be32(conn->head);
    conn->head_len = 0;
    if (get_be32(conn->head + 8) != USBIP_DEVID)
        conn->broken = 1;
    else if (command == CMD_SUBMIT)
        take_submit(conn);
    else if (command == CMD_UNLINK)
        take_unlink(conn);
    else
        conn->broken = 1;
}

/* ---- bytes */

/* Up to n bytes to `at`; 0: none there now, or the connection is broken. */
static uint32_t receive(struct usbip_conn *conn, uint8_t *at, uint32_t n)
{
    ssize_t got = recv(conn->fd, at, n, MSG_DONTWAIT);
    if (got > 0) return (uint32_t)got;
    if (got == 0 || (errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR)) conn->broken = 1;
    return 0;
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

static uint32_t read_head(struct usbip_conn *conn)
{
    uint32_t n = receive(conn, conn->head + conn->head_len, head_need(conn) - conn->head_len);
    conn->head_len += n;
    if (n == 0 || conn->head_len < head_need(conn)) return n;
    if (conn->imported)
        take_urb(conn);
    else
        take_op(conn);
    return n;
}

void usbip_conn_read(struct usbip_conn *conn, int (*go_on)(void *ctx), void *ctx)
{
    while (!conn->broken && go_on(ctx))
        if ((conn->incoming != NULL ? read_incoming(conn) : read_head(conn)) == 0) break;
}

static void drop_sent(struct usbip_conn *conn, uint32_t n)
{
    while (conn->out_first != NULL) {
        struct usbip_urb *first = conn->out_first;
        if (n < first->send_len - conn->out_pos) {
            conn->out_pos += n;
            return;
        }
        n -= first->send_len - conn->out_pos;
        conn->out_pos = 0;
        conn->out_first = first->next;
        if (conn->out_first == NULL) conn->out_last = NULL;
        free_urb(conn, first);
    }
}

void usbip_conn_write(struct usbip_conn *conn)
{
    while (conn->out_first != NULL && !conn->broken) {
        struct iovec part[MAX_REPLY_PARTS];
        size_t n = 0;
        for (struct usbip_urb *urb = conn->out_first; urb != NULL && n < MAX_REPLY_PARTS; urb = urb->next) {
            const uint32_t skip = n == 0 ? conn->out_pos : 0;
            part[n++] = (struct iovec){urb->wire + skip, urb->send_len - skip};
        }
        const struct msghdr message = {.msg_iov = part, .msg_iovlen = n};
        ssize_t sent = sendmsg(conn->fd, &message, MSG_DONTWAIT | MSG_NOSIGNAL);
        if (sent < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR || errno == ENOBUFS)) return;
        if (sent < 0)
            conn->broken = 1;
        else
            drop_sent(conn, (uint32_t)sent);
    }
}

void usbip_conn_start(struct usbip_conn *conn, int fd, struct usb_device *device, int *taken)
{
    *conn = (struct usbip_conn){.fd = fd, .device = device, .taken = taken};
}

void usbip_conn_drain(struct usbip_conn *conn, int timeout_ms)
{
    struct pollfd slot = {.fd = conn->fd, .events = POLLOUT};
    usbip_conn_write(conn);
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
    if (conn->incoming != NULL) free_urb(conn, conn->incoming);
    while (conn->out_first != NULL) {
        struct usbip_urb *first = conn->out_first;
        conn->out_first = first->next;
        free_urb(conn, first);
    }
    close(conn->fd);
    *conn = (struct usbip_conn){.fd = -1};
}
