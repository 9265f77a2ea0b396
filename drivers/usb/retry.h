/* SPDX-License-Identifier: MIT */
/* A device that plugs itself in (`attach: on`) comes back after its host has let go of the device. This header has the
 * times of the device's attempts, and the news about the attempts. Private to the back ends. */
#ifndef DRIVERS_USB_RETRY_H
#define DRIVERS_USB_RETRY_H

#include "drivers/usb/backend.h"

enum { USB_RETRY_MS = 1000 };

struct usb_retry {
    int pace_ms;
    int64_t due_ns; /* monotonic time of the next attempt; INT64_MAX: none */
    int reported;   /* its failure */
};

/* No attempt is due. pace_ms 0: USB_RETRY_MS. */
void usb_retry_init(struct usb_retry *retry, int pace_ms);
/* The host is gone: an attempt is due every pace_ms from now. usb_retry_start, usb_retry_failed and usb_retry_done also
 * send the owner a message. */
void usb_retry_start(struct usb_retry *retry, const struct usb_owner *owner);
/* 1: an attempt is due now, and the next one a pace later. */
int usb_retry_is_due(struct usb_retry *retry);
/* usb_retry_failed and usb_retry_done report how an attempt went. After a first failure, further failures are not
 * reported. */
void usb_retry_failed(struct usb_retry *retry, const char *why, const struct usb_owner *owner);
void usb_retry_done(struct usb_retry *retry, const struct usb_owner *owner);

#endif
