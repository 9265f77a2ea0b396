/* SPDX-License-Identifier: MIT */
/* A device that plugs itself in (`attach: on`) comes back after its host has let go of it. This is the timer
 * for its attempts, and the news about them. Private to the back ends. */
#ifndef DRIVERS_USB_RETRY_H
#define DRIVERS_USB_RETRY_H

#include "drivers/usb/backend.h"

enum { USB_RETRY_MS = 1000 };

struct usb_retry {
    int timer; /* timerfd; -1: never tries */
    int pace_ms;
    int reported; /* its failure */
};

/* pace_ms 0: USB_RETRY_MS. what: "usbip", for errors. */
int usb_retry_open(struct usb_retry *retry, const char *what, int pace_ms, struct sh_err *err);
void usb_retry_close(struct usb_retry *retry);
/* The host is gone: an attempt is due every pace_ms from now. SH_EIO: the timer can't be set. This function and the
 * last two also send the owner a message. */
int usb_retry_start(struct usb_retry *retry, const struct usb_owner *owner);
/* After poll(2) on the timer: 1 when an attempt is due. */
int usb_retry_is_due(struct usb_retry *retry, short revents);
/* These two report how an attempt went. After a first failure, more of them are not reported. */
void usb_retry_failed(struct usb_retry *retry, const char *why, const struct usb_owner *owner);
int usb_retry_done(struct usb_retry *retry, const struct usb_owner *owner);

#endif
