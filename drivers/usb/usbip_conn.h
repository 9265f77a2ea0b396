/* SPDX-License-Identifier: MIT */
/* One connection of the usbip back end: operations first, then URBs once the device is imported. Private. */
#ifndef DRIVERS_USB_USBIP_CONN_H
#define DRIVERS_USB_USBIP_CONN_H

#include "drivers/usb/usb.h"
#include "drivers/usb/usbip.h"

/* The number of bus and device, by which URBs and the virtual host controller name the device. */
uint32_t usbip_devid(const struct usb_device *device);

struct usbip_urb; /* a transfer with its header and bytes */

struct usbip_conn {
    int fd;          /* -1: free */
    uint64_t number; /* of arrival */
    int imported;
    int broken; /* to be closed: the peer is gone, or broke the protocol */
    struct usb_device *device;
    int *taken; /* shared: the device is imported by some connection */
    uint8_t head[URB_HEADER];
    uint32_t head_len;
    struct usbip_urb *incoming; /* an OUT whose bytes are coming in */
    uint32_t incoming_len;
    struct usbip_urb *out_first, *out_last; /* replies to send */
    uint32_t out_pos;
    struct usbip_urb *slow_first, *slow_last; /* control requests that take their time */
    uint32_t n_pending, n_unsent;             /* URBs that the device has not answered; answers not sent yet */
    uint64_t pending_bytes, unsent_bytes;
};

/* fd is connected and not blocking; the connection owns it from now on. */
void usbip_conn_start(struct usbip_conn *conn, int fd, struct usb_device *device, int *taken);
/* Imports the device without a request, for a host that begins with URBs. */
void usbip_conn_import(struct usbip_conn *conn);
/* Reads and acts until nothing is left, go_on returns 0 or the connection is full; some hundred times at most. */
void usbip_conn_read(struct usbip_conn *conn, int (*go_on)(void *ctx), void *ctx);
/* Whether so many replies wait for the host that nothing more is read until it takes some. */
int usbip_conn_is_full(const struct usbip_conn *conn);
void usbip_conn_write(struct usbip_conn *conn);
/* Answers control requests whose time has come, until go_on says 0. */
void usbip_conn_answer_slow(struct usbip_conn *conn, int (*go_on)(void *ctx), void *ctx);
/* When the next of these is due; INT64_MAX: there is none. */
int64_t usbip_conn_due_ns(const struct usbip_conn *conn);
/* Sends the queue and waits until the peer has taken it and hung up, timeout_ms at most for each step. Closing
 * with unread requests of the peer would throw away replies on their way. */
void usbip_conn_drain(struct usbip_conn *conn, int timeout_ms);
/* Detaches the device if it was imported here, and frees everything. */
void usbip_conn_end(struct usbip_conn *conn);

#endif
