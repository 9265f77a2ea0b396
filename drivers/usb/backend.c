/* SPDX-License-Identifier: MIT */
/* The list of back ends. */
#include "drivers/usb/backend.h"

extern const struct usb_backend_ops usb_backend_usbip, usb_backend_usbredir, usb_backend_functionfs;
#define N_BACKENDS (sizeof backends / sizeof backends[0])

static const struct usb_backend_ops *const backends[] = {[USB_BACKEND_USBIP] = &usb_backend_usbip,
                                                         [USB_BACKEND_USBREDIR] = &usb_backend_usbredir,
                                                         [USB_BACKEND_FUNCTIONFS] = &usb_backend_functionfs};

const struct usb_backend_ops *usb_backend_ops_get(enum usb_backend_type type)
{
    return (unsigned)type < N_BACKENDS ? backends[type] : NULL;
}
