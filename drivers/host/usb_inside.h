/* SPDX-License-Identifier: MIT */
/* The head as a USB device: finding it, and its vendor interface as a source of bytes, over libusb.
 *
 * The vendor interface has class, subclass and protocol FF/53/48 and one bulk pair: the native stream comes
 * in, commands go out. A vendor request to the interface opens and closes the stream session. */
#ifndef DRIVERS_HOST_USB_INSIDE_H
#define DRIVERS_HOST_USB_INSIDE_H

#include <libusb.h>

#include "drivers/host/source.h"

enum {
    USB_CLASS = 0xff,
    USB_SUBCLASS = 0x53,
    USB_PROTOCOL = 0x48,
    USB_REQUEST_SESSION = 0x22, /* bmRequestType 0x41: wValue 1 opens, 0 closes; 0xc1 asks; wIndex: the interface */
    USB_CONTROL_MS = 5000,      /* USB 2.0, 9.2.6.1: no request takes longer */
};

/* The device that a source names: "usb", "usb:vid:pid", "usb:vid:pid:serial", ids in hexadecimal as lsusb prints
 * them. */
struct usb_wanted {
    int vid, pid;     /* -1: any */
    char serial[128]; /* empty: any */
};

struct usb_interface {
    uint8_t number, in, out; /* number of the interface; addresses of its endpoints */
};

int host_usb_parse(const char *source, struct usb_wanted *wanted, struct sh_err *err);

/* A head that is open. */
struct usb_found {
    libusb_device_handle *handle;
    struct usb_interface interface;
    char name[160]; /* usb:vid:pid:serial */
};

/* Finds the vendor interface of a device's active configuration. Returns 1, or 0 where there is none. */
int host_usb_interface(libusb_device *device, struct usb_interface *interface);

/* Opens the one head that is wanted; asked: the source as the caller wrote it, for errors. found is zero before.
 * SH_ELOST: there is none; SH_EINPUT: there are several; SH_EPERM: the text has the rule that gives the permission. */
int host_usb_find(libusb_context *ctx, const char *asked, const struct usb_wanted *wanted, struct usb_found *found,
                  struct sh_err *err);

#endif
