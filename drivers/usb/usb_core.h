/* SPDX-License-Identifier: MIT */
/* The device core's own struct, for the files that make it: usb_core.c, control.c and usb_fault.c. Private. */
#ifndef DRIVERS_USB_USB_CORE_H
#define DRIVERS_USB_USB_CORE_H

#include "drivers/usb/usb.h"

enum usb_state { USB_DETACHED, USB_DEFAULT, USB_ADDRESSED, USB_CONFIGURED };

struct usb_pipe {
    const struct usb_endpoint_row *row; /* NULL: not in the present configuration */
    int halted;
    int zero_due; /* IN: a zero-length packet is still to come */
    uint32_t epoch;
    struct usb_transfer *first, *last;
    uint32_t used;    /* OUT: bytes of the first one already read */
    uint32_t shorten; /* IN: number of transfers that are still to end early */
    int gone_due;     /* the next transfer ends like those that were pending at a reset */
};

struct usb_device {
    struct usb_facts facts;
    struct usb_hooks hooks;
    void *ctx;
    usb_complete complete;
    void *host_ctx;
    enum usb_state state;
    int suspended;
    int u1_enabled, u2_enabled;
    double slow_ms;           /* how long a control request takes */
    uint32_t lengthen;        /* bytes that the configuration claims and doesn't have */
    struct usb_pipe pipe[32]; /* 0..15 OUT, 16..31 IN; the two of endpoint 0 stay empty */
};

/* usb_core.c */
struct usb_pipe *usb_pipe(struct usb_device *device, unsigned address);
/* Goes to a state. Interfaces that are active end, and all of them begin if the state is USB_CONFIGURED. */
void usb_enter(struct usb_device *device, enum usb_state state, enum usb_end why);
/* Ends the interface and begins it again, as SET_INTERFACE does. */
void usb_restart_interface(struct usb_device *device, unsigned interface);
/* Halts an endpoint, whose pending transfers end with USB_STALLED; or clears the halt. */
void usb_set_halt(struct usb_device *device, struct usb_pipe *pipe, int halted);

#endif
