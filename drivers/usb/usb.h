/* SPDX-License-Identifier: MIT */
/* The USB device core: descriptors, control requests, endpoints and cancellation, with no transport in it.
 *
 * A device is data: a struct usb_model and what it points to. The core answers all of chapter 9 from the model.
 * Above the core stands the function (a link, or a test), which reads and writes endpoints and answers class
 * and vendor requests by hooks; below it stands a back end (usbip, usbredir, functionfs), which carries what
 * the host does:
 *
 *   usb_device_attach/detach/reset/suspend   the bus
 *   usb_device_control                       a control transfer, answered at once
 *   usb_device_submit, usb_device_cancel     a bulk or interrupt transfer of the host, and its withdrawal
 *
 * A transfer is one request of the host's driver (a URB). An IN transfer waits until the function writes, an
 * OUT transfer until the function has read all of it, as a real bus does by NAK. So a function that does not
 * read holds the host back. A transfer belongs to the core from submit until the back end's complete() is
 * called with it. This call happens exactly once, maybe within submit.
 *
 * IN packets: a transfer ends when it is full, or with a short packet. The data of one usb_device_write() end with a
 * short packet, or with a zero-length packet where they are a whole number of packets. Where they filled the transfer
 * exactly, the zero-length packet ends the next transfer that is submitted while no other waits, unless more is
 * written first. A transfer that waits already stays: an end that carries nothing costs a reader of a stream a turn. On
 * an endpoint that has `units` (model.h: the data of one write are a unit) that packet always comes before further
 * data: at once if another transfer waits, else with the next one that is submitted. A transfer whose rest is smaller
 * than the next packet fails with USB_OVERFLOW, as on a real bus. The packet that did not fit stays with the function:
 * nothing is lost.
 *
 * Wire formats: Universal Serial Bus 2.0, chapter 9; USB 3.2, chapter 9 (super speed, BOS); CDC 1.2 and PSTN
 * 1.2; Microsoft OS 2.0 Descriptors Specification. Numbers in structs are in host order unless said.
 * Thread: a device belongs to one thread. Nothing blocks. */
#ifndef DRIVERS_USB_USB_H
#define DRIVERS_USB_USB_H

#include "core/err.h"
#include "drivers/usb/model.h"

enum { USB_STALL = -1000 }; /* of a control request; apart from the SH_E codes */

/* ---- transfers */

enum usb_status {
    USB_OK,
    USB_CANCELLED, /* by usb_device_cancel */
    USB_STALLED,   /* the endpoint is halted */
    USB_GONE,      /* no such endpoint now: reset, unplugged, or not configured */
    USB_OVERFLOW,  /* IN: the rest of the transfer is smaller than the packet that comes */
};

struct usb_transfer {
    uint64_t id;      /* the back end's; no two pending ones are equal */
    uint8_t endpoint; /* with USB_DIR_IN */
    uint32_t length;  /* bytes asked for, or sent */
    uint8_t *data;    /* of `length` bytes */
    /* set by the core */
    uint32_t actual;
    enum usb_status status;
    int zero_packet; /* IN: actual is a whole number of packets and below length: a zero-length packet ends it */
    uint32_t epoch;  /* OUT: usb_device_epoch of its interface when it came */
    int64_t due_ns;  /* of a control request that is held (usb_hold): when it is to be answered */
    struct usb_transfer *next;
};

/* Why interfaces ended. Some hosts' drivers don't pass a reset on; they configure the device anew. */
enum usb_end { USB_END_CONFIGURED, USB_END_RESET, USB_END_UNPLUGGED };

/* Calls to the function, within the calls of the back end. All may be NULL. */
struct usb_hooks {
    /* A class or vendor request. OUT: data holds wLength bytes; return 0. IN: fill at most wLength bytes,
     * return how many. USB_STALL refuses it. OUT with wLength above 0 and data NULL: the data have not come
     * yet; answer as if they had, and do nothing. The interface or endpoint it names exists in the present
     * configuration. */
    int (*request)(void *ctx, const struct usb_ctrlrequest *setup, uint8_t *data);
    /* An interface came to life or ended: configuration, SET_INTERFACE, reset, unplugging. */
    void (*interface)(void *ctx, unsigned interface, int active);
};

struct usb_device;

/* Makes a device, which is not plugged in yet. The model and ctx outlive it; identity and hooks are copied. SH_EINPUT
 * when the model contradicts itself. */
int usb_device_create(const struct usb_model *model, const struct usb_identity *id, const struct usb_hooks *hooks,
                      void *ctx, struct usb_device **out, struct sh_err *err);
/* Detaches first. */
void usb_device_free(struct usb_device *device);

/* ---- for back ends */

typedef void (*usb_complete)(void *ctx, struct usb_transfer *transfer);

/* The host has the device: the device is in the state default, at that rate. */
void usb_device_attach(struct usb_device *device, enum usb_rate rate, usb_complete complete, void *ctx);
/* The device is unplugged: transfers that are pending complete with USB_GONE. */
void usb_device_detach(struct usb_device *device);
/* The bus is reset: the device goes back to the state default. */
void usb_device_reset(struct usb_device *device);
void usb_device_suspend(struct usb_device *device, int suspended);
/* For back ends whose host gives no addresses: state default -> addressed. */
void usb_device_assume_address(struct usb_device *device);
/* Carries out a control transfer. data: OUT, the len bytes that came with it; IN, room for wLength bytes. Returns the
 * number of bytes (IN), 0 (OUT) or USB_STALL. */
int usb_device_control(struct usb_device *device, const struct usb_ctrlrequest *setup, uint8_t *data, uint32_t len);
void usb_device_submit(struct usb_device *device, struct usb_transfer *transfer);
/* Cancels a transfer. Returns 1: it was pending, and completed with USB_CANCELLED within the call; 0: it is not
 * pending. */
int usb_device_cancel(struct usb_device *device, uint64_t id);

/* ---- for both */

struct usb_facts {
    const struct usb_model *model;
    struct usb_identity id;
    enum usb_rate rate;
    enum usb_end end;  /* why interfaces ended last, or are ending */
    int configuration; /* USB_CONFIGURATION, or 0 if the device is not configured */
    uint32_t attaches; /* how often the device was attached */
};
/* Valid, and kept up to date, as long as the device lives. */
const struct usb_facts *usb_facts(const struct usb_device *device);

/* ---- injected faults */

/* Acts as if the host had reset the bus and configured the device again. */
void usb_device_restart(struct usb_device *device);
/* After a restart, for an endpoint without a pending transfer. due 1: the host's next transfer ends as pending ones
 * did, so that the host learns of the reset. due 0: a new reader begins, and its transfers don't end so. */
void usb_device_set_gone_due(struct usb_device *device, uint8_t endpoint, int due);
/* Halts the endpoint, until the host clears the halt. 0: there is no such endpoint now. */
int usb_device_halt(struct usb_device *device, uint8_t endpoint);
/* IN: each of the next n transfers that carry more than a byte ends in a short packet, about half way; the rest goes
 * into the transfer after it. The shortening holds until the interface ends. */
void usb_device_shorten(struct usb_device *device, uint8_t endpoint, uint32_t n);
/* Sets how long each control request takes. 0: it is answered at once. */
void usb_device_set_slow(struct usb_device *device, double ms);
/* This and the next four functions are for back ends, which keep the list `held` of requests that wait. Returns whether
 * another request has to wait. */
int usb_has_to_wait(const struct usb_device *device, const struct usb_transfer *held);
/* Appends a request, with its id set. Requests are answered one after the other; each takes the time asked for. */
void usb_hold(const struct usb_device *device, struct usb_transfer **held, struct usb_transfer *request);
/* Takes out the request of that id; NULL: there is none. Later ones are due earlier by the time that it had left. */
struct usb_transfer *usb_let_go(struct usb_transfer **held, uint64_t id);
/* Takes out the first request if its time has come; NULL: it has not, or there is none. */
struct usb_transfer *usb_take_due(struct usb_transfer **held);
/* Returns when the first request is due; INT64_MAX: there is none. */
int64_t usb_due_ns(const struct usb_transfer *held);
/* Makes the configuration descriptor claim n bytes more than it has, with back ends that ask the core for it. */
void usb_device_lengthen(struct usb_device *device, uint32_t n);

/* ---- for functions. An endpoint that is not there, or is halted, has no room and nothing to read. A suspended device
 * has no room. */

/* Writes to the waiting IN transfers. Returns how many bytes they took, maybe 0. */
size_t usb_device_write(struct usb_device *device, uint8_t endpoint, const void *data, size_t len);
int usb_device_can_write(const struct usb_device *device, uint8_t endpoint);
/* Reads bytes of one epoch at a time. */
size_t usb_device_read(struct usb_device *device, uint8_t endpoint, void *data, size_t len);
/* Returns the number of unread bytes of the oldest transfer; *epoch (may be NULL) gets its epoch. */
size_t usb_device_can_read(const struct usb_device *device, uint8_t endpoint, uint32_t *epoch);
/* Drops what waits on an OUT endpoint from epochs before the present one. */
void usb_device_drop(struct usb_device *device, uint8_t endpoint);
/* A count that the function may raise between two sessions; the core raises it when the interface ends. OUT transfers
 * are stamped with it. When it has changed, a back end withdraws IN data that are still on their way. */
uint32_t usb_device_epoch(const struct usb_device *device, uint8_t endpoint);
void usb_device_next_epoch(struct usb_device *device, uint8_t endpoint);

#endif
