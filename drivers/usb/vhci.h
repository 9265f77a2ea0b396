/* SPDX-License-Identifier: MIT */
/* Plugs one end of a socket into this machine's virtual host controller (vhci_hcd) without any tool.
 * Private. */
#ifndef DRIVERS_USB_VHCI_H
#define DRIVERS_USB_VHCI_H

#include "core/err.h"
#include "drivers/usb/model.h"

/* dir: where the controller is in sysfs; NULL: /sys/devices/platform/vhci_hcd.0. fd is a connected stream
 * socket and stays the caller's; the kernel keeps its own reference. */
int vhci_attach(const char *dir, int fd, uint32_t devid, enum usb_rate rate, unsigned *port, struct sh_err *err);

#endif
