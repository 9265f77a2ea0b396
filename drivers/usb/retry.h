/* SPDX-License-Identifier: MIT */
/* A device that plugs itself in (`attach: on`) comes back after its host has let go of the device. This header has the
 * timer for the device's attempts, and the news about the attempts. Private to the back ends. */
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
/* The host is gone: an attempt is due every pace_ms from now. SH_EIO: the timer can't be set. usb_retry_start,
 * usb_retry_failed and usb_retry_done also send the owner a message. */
int usb_retry_start(struct usb_retry *retry, const struct usb_owner *owner);
/* After poll(2) on the timer: 1 when an attempt is due. */
int usb_retry_is_due(struct usb_retry *retry, short revents);
/* usb_retry_failed and usb_retry_done report how an attempt went. After a first failure, further failures are not
 * reported. */
void usb_retry_failed(struct usb_retry *retry, const char *why, const struct usb_owner *owner);
int usb_retry_done(struct usb_retry *retry, const struct usb_owner *owner);

#endif
