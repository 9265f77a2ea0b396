/* SPDX-License-Identifier: MIT */
/* Keeps the URBs of a connection within their limits, and sends its replies in the order in which they were queued. */
#include <errno.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/uio.h>

#include "drivers/usb/usbip_private.h"

enum { MAX_REPLY_PARTS = 64 };

static const char NO_MEMORY[] = "there is no memory for its request";

void usbip_conn_break(struct usbip_conn *conn, const char *why)
{
    conn->broken = 1;
    conn->why = why;
}

static struct usbip_urb *make_urb(struct usbip_conn *conn, uint32_t room)
{
    struct usbip_urb *urb = malloc(sizeof *urb + URB_HEADER + room);
    if (urb == NULL) return NULL;
    memset(urb, 0, sizeof *urb + URB_HEADER); /* the bytes are written before they are sent */
    urb->room = room;
    conn->n_pending++;
    conn->pending_bytes += room;
    return urb;
}

struct usbip_urb *usbip_urb_new(struct usbip_conn *conn, unsigned endpoint, uint32_t room)
{
    const uint32_t most = MAX_PENDING + (endpoint == 0 ? MORE_CONTROL : 0);
    const uint64_t most_bytes = MAX_PENDING_BYTES + (endpoint == 0 ? MORE_CONTROL_BYTES : 0);
    if (conn->n_pending >= most || conn->pending_bytes + room > most_bytes) {
        usbip_conn_break(conn, "more than 4096 requests, or more than 64 MiB of them, wait for the device");
        return NULL;
    }
    struct usbip_urb *urb = make_urb(conn, room);
    if (urb == NULL) usbip_conn_break(conn, NO_MEMORY);
    return urb;
}

void usbip_urb_free(struct usbip_conn *conn, struct usbip_urb *urb)
{
    conn->n_pending--;
    conn->pending_bytes -= urb->room;
    free(urb);
}

void usbip_queue(struct usbip_conn *conn, struct usbip_urb *urb, uint32_t len)
{
    urb->send_len = len;
    urb->next = NULL;
    if (conn->out_last != NULL)
        conn->out_last->next = urb;
    else
        conn->out_first = urb;
    conn->out_last = urb;
    conn->n_pending--;
    conn->pending_bytes -= urb->room;
    conn->n_unsent++;
    conn->unsent_bytes += urb->room;
}

/* Takes the first reply away. */
static void drop_first(struct usbip_conn *conn)
{
    struct usbip_urb *first = conn->out_first;
    conn->out_pos = 0;
    conn->out_first = first->next;
    if (conn->out_first == NULL) conn->out_last = NULL;
    conn->n_unsent--;
    conn->unsent_bytes -= first->room;
    free(first);
}

uint8_t *usbip_queue_plain(struct usbip_conn *conn, uint32_t len)
{
    struct usbip_urb *reply = make_urb(conn, len > URB_HEADER ? len - URB_HEADER : 0);
    if (reply == NULL) {
        usbip_conn_break(conn, NO_MEMORY);
        return NULL;
    }
    memset(reply->wire, 0, URB_HEADER + reply->room);
    usbip_queue(conn, reply, len);
    return reply->wire;
}

void usbip_queue_clear(struct usbip_conn *conn)
{
    while (conn->out_first != NULL)
        drop_first(conn);
}

static void drop_sent(struct usbip_conn *conn, size_t n)
{
    while (conn->out_first != NULL) {
        const size_t left = conn->out_first->send_len - conn->out_pos;
        if (n < left) {
            conn->out_pos += (uint32_t)n;
            return;
        }
        n -= left;
        drop_first(conn);
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
            drop_sent(conn, (size_t)sent);
    }
}

int usbip_conn_is_full(const struct usbip_conn *conn)
{
    return conn->n_unsent >= MAX_UNSENT || conn->unsent_bytes >= MAX_UNSENT_BYTES;
}
