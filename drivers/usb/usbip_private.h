/* SPDX-License-Identifier: MIT */
/* The usbip back end's own parts, for its files: the protocol's numbers, connections, URBs and replies, operations.
 * Private.
 *
 * A connection has operations first, then URBs once the device is imported. The protocol is USB/IP, version 1.1.1, as
 * Linux describes it (Documentation/usb/usbip_protocol.rst). Everything is big-endian. */
#ifndef DRIVERS_USB_USBIP_PRIVATE_H
#define DRIVERS_USB_USBIP_PRIVATE_H

#include "core/bytes.h"
#include "drivers/usb/backend.h"

/* Sizes, offsets and numbers of the protocol. */
enum {
    USBIP_VERSION = 0x0111,
    /* operations: u16 version, u16 code, u32 status */
    OP_HEADER = 8,
    OP_REQ_DEVLIST = 0x8005,
    OP_REP_DEVLIST = 0x0005,
    OP_REQ_IMPORT = 0x8003,
    OP_REP_IMPORT = 0x0003,
    OP_OK = 0,
    OP_BUSY = 2,
    OP_NO_DEVICE = 4, /* as ST_NODEV of Linux's usbip */
    BUSID_LEN = 32,
    /* a device: char[256] path, char[32] bus id, u32 bus, device, speed, u16 vid, pid, bcd, u8 class,
     * subclass, protocol, configuration, configurations, interfaces */
    OP_DEVICE = 312,
    OP_INTERFACE = 4,
    OP_IMPORT = OP_HEADER + BUSID_LEN,
    /* URBs: u32 command, seqnum, devid, direction, ep, then 28 bytes by command */
    URB_HEADER = 48,
    CMD_SUBMIT = 1,       /* u32 flags, length, start frame, packets, interval, u8[8] setup */
    CMD_UNLINK = 2,       /* u32 seqnum */
    RET_SUBMIT = 3,       /* i32 status, u32 actual length, start frame, packets, errors */
    RET_UNLINK = 4,       /* i32 status */
    URB_SHORT_NOT_OK = 1, /* of the flags */
    DIR_OUT = 0,
    DIR_IN = 1,
};

/* Place of head number N on the server's side: bus 1, device N + 1 (the root hub is device 1), port N, bus id "1-N". A
 * head without a number has the place of number 1. */
enum { USBIP_BUS = 1 };

/* ---- usbip_conn.c */

/* The number of bus and device, by which URBs and the virtual host controller name the device. */
uint32_t usbip_devid(const struct usb_device *device);

struct usbip_urb; /* a transfer with its header and bytes */

struct usbip_conn {
    int fd;          /* -1: free */
    uint64_t number; /* of arrival */
    int imported;
    int broken;      /* to be closed: the peer is gone, or broke the protocol */
    const char *why; /* broken: what the peer did wrong; NULL: it is gone */
    struct usb_device *device;
    int *taken; /* shared: the device is imported by some connection */
    uint8_t head[URB_HEADER];
    uint32_t head_len;
    struct usbip_urb *incoming; /* an OUT whose bytes are coming in */
    uint32_t incoming_len;
    struct usbip_urb *out_first, *out_last; /* replies to send */
    uint32_t out_pos;
    struct usb_transfer *held;    /* control requests that take their time, each of an URB */
    uint32_t n_pending, n_unsent; /* URBs that the device has not answered; answers not sent yet */
    uint64_t pending_bytes, unsent_bytes;
};

/* fd is connected and not blocking; the connection owns it from now on. */
void usbip_conn_start(struct usbip_conn *conn, int fd, struct usb_device *device, int *taken);
/* Imports the device without a request, for a host that begins with URBs. */
void usbip_conn_import(struct usbip_conn *conn);
/* Reads and acts until nothing is left, go_on returns 0 or the connection is full, but at most 256 times. */
void usbip_conn_read(struct usbip_conn *conn, const struct usb_owner *owner);
/* Whether so many replies wait for the host that nothing more is read until it takes some. */
int usbip_conn_is_full(const struct usbip_conn *conn);
void usbip_conn_write(struct usbip_conn *conn);
/* Answers control requests whose time has come, until the owner's go_on (backend.h) returns 0. */
void usbip_conn_answer_slow(struct usbip_conn *conn, const struct usb_owner *owner);
/* Sends the queue and waits until the peer has taken it and hung up, timeout_ms at most for each step
 * (usb_backend_hang_up). */
void usbip_conn_drain(struct usbip_conn *conn, int timeout_ms);
/* Detaches the device if it was imported here, frees everything, and closes fd. */
void usbip_conn_end(struct usbip_conn *conn);

/* Limits of what the host has asked for and the device has not answered. A host that asks for more is cut off. Requests
 * on endpoint 0 may go beyond these limits by the second two, so that a host with many transfers still has control. */
enum { MAX_PENDING = 4096, MAX_PENDING_BYTES = 64 << 20, MORE_CONTROL = 256, MORE_CONTROL_BYTES = 1 << 20 };
/* Limits of answers that are not sent yet. Above these nothing more is read until the host has taken some. */
enum { MAX_UNSENT = 256, MAX_UNSENT_BYTES = 1 << 20 };

/* The header of the reply stands before the bytes, so that both leave in one piece. */
struct usbip_urb {
    struct usb_transfer transfer;
    struct usbip_urb *next;
    uint8_t setup[8]; /* of a control request */
    int in;
    int short_is_error;
    uint32_t send_len; /* of wire, once it is a reply */
    uint32_t room;
    uint8_t wire[]; /* URB_HEADER, then room bytes */
};

/* ---- usbip_queue.c */

/* A new URB of an endpoint. NULL: too much is pending, or no memory; the connection is broken. The URB counts as
 * pending until it is queued or freed. */
struct usbip_urb *usbip_urb_new(struct usbip_conn *conn, unsigned endpoint, uint32_t room);
/* Frees an URB that was not queued. */
void usbip_urb_free(struct usbip_conn *conn, struct usbip_urb *urb);
/* Queues the URB as a reply of len bytes of wire. The URB is freed once it is sent. */
void usbip_queue(struct usbip_conn *conn, struct usbip_urb *urb, uint32_t len);
/* Queues a reply of len bytes without an URB, whatever is pending, and returns these bytes, all 0, to be filled in.
 * NULL: no memory, and the connection is broken. */
uint8_t *usbip_queue_plain(struct usbip_conn *conn, uint32_t len);
void usbip_queue_clear(struct usbip_conn *conn);
/* Breaks the connection for a reason that the owner is to know. */
void usbip_conn_break(struct usbip_conn *conn, const char *why);

/* ---- usbip_ops.c */

/* Returns how many bytes conn->head needs: the operation's header, and once that is there, the whole operation. */
uint32_t usbip_op_need(const struct usbip_conn *conn);
/* Carries out the operation, whose bytes are all in conn->head. */
void usbip_op_take(struct usbip_conn *conn);

#endif
