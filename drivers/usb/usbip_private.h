/* SPDX-License-Identifier: MIT */
/* The parts of a usbip connection: URBs and their memory, replies and their order, operations. Private. */
#ifndef DRIVERS_USB_USBIP_PRIVATE_H
#define DRIVERS_USB_USBIP_PRIVATE_H

#include "core/bytes.h"
#include "drivers/usb/usbip_conn.h"

/* Limits of what the host has asked for and the device has not answered. A host that asks for more is cut
 * off. */
enum { MAX_PENDING = 4096, MAX_PENDING_BYTES = 64 << 20 };
/* Limits of answers that are not sent yet. Above these nothing more is read until the host has taken some. */
enum { MAX_UNSENT = 256, MAX_UNSENT_BYTES = 1 << 20 };

/* The header of the reply stands before the bytes, so that both leave in one piece. */
struct usbip_urb {
    struct usb_transfer transfer;
    struct usbip_urb *next;
    uint32_t seqnum;
    uint8_t setup[8]; /* of a control request */
    int64_t due_ns;   /* when a held request is to be answered */
    int in;
    int short_is_error;
    uint32_t send_len; /* of wire, once it is a reply */
    uint32_t room;
    uint8_t wire[]; /* URB_HEADER, then room bytes */
};

/* ---- usbip_queue.c */

/* A new URB. NULL: too much is pending, or no memory. It counts as pending until it is queued or freed. */
struct usbip_urb *usbip_urb_new(struct usbip_conn *conn, uint32_t room);
/* Frees an URB that was not queued. */
void usbip_urb_free(struct usbip_conn *conn, struct usbip_urb *urb);
/* Queues the URB as a reply of len bytes of wire. It is freed once it is sent. */
void usbip_queue(struct usbip_conn *conn, struct usbip_urb *urb, uint32_t len);
/* Queues a reply of len bytes without an URB, and returns these, all 0, to be filled in. NULL: the connection is
 * broken. */
uint8_t *usbip_queue_plain(struct usbip_conn *conn, uint32_t len);
void usbip_queue_clear(struct usbip_conn *conn);

/* ---- usbip_ops.c */

/* Number of bytes that the operation needs, as far as those in conn->head say it. */
uint32_t usbip_op_need(const struct usbip_conn *conn);
/* Carries out the operation, whose bytes are all in conn->head. */
void usbip_op_take(struct usbip_conn *conn);

#endif
