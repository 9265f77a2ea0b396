/* SPDX-License-Identifier: MIT */
/* Injected faults of a device. usb_core.c shortens transfers, control.c lengthens the configuration. */
#include "drivers/usb/usb_core.h"

void usb_device_restart(struct usb_device *device)
{
    const int configured = device->state == USB_CONFIGURED;
    if (device->state == USB_DETACHED) return;
    usb_device_reset(device, device->rate);
    usb_device_assume_address(device);
    if (configured) usb_enter(device, USB_CONFIGURED, USB_END_RESET);
}

void usb_device_set_gone_due(struct usb_device *device, uint8_t endpoint, int due)
{
    struct usb_pipe *pipe = usb_pipe(device, endpoint);
    pipe->gone_due = due && pipe->row != NULL;
}

int usb_device_halt(struct usb_device *device, uint8_t endpoint)
{
    struct usb_pipe *pipe = usb_pipe(device, endpoint);
    if (pipe->row == NULL) return 0;
    usb_set_halt(device, pipe, 1);
    return 1;
}

void usb_device_shorten(struct usb_device *device, uint8_t endpoint, uint32_t n)
{
    struct usb_pipe *pipe = usb_pipe(device, endpoint);
    if (pipe->row != NULL) pipe->shorten += n;
}

void usb_device_set_slow(struct usb_device *device, double ms)
{
    device->slow_ms = ms;
}

double usb_device_slow_ms(const struct usb_device *device)
{
    return device->slow_ms;
}

void usb_device_lengthen(struct usb_device *device, uint32_t n)
{
    device->lengthen = n;
}
