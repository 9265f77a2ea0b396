/* SPDX-License-Identifier: MIT */
/* Injected faults of a device. usb_core.c shortens transfers, and control.c adds to the length that
 * the configuration states. */
#include "core/monotonic.h"
#include "drivers/usb/usb_core.h"

void usb_device_restart(struct usb_device *device)
{
    const int configured = device->state == USB_CONFIGURED;
    usb_device_reset(device);
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

int usb_has_to_wait(const struct usb_device *device, const struct usb_transfer *held)
{
    return device->slow_ms > 0.0 || held != NULL; /* a request waits for those that are held before it */
}

void usb_hold(const struct usb_device *device, struct usb_transfer **held, struct usb_transfer *request)
{
    int64_t from_ns = monotonic_ns();
    for (; *held != NULL; held = &(*held)->next)
        if ((*held)->due_ns > from_ns) from_ns = (*held)->due_ns;
    request->due_ns = from_ns + (int64_t)(device->slow_ms * 1e6);
    request->next = NULL;
    *held = request;
}

struct usb_transfer *usb_let_go(struct usb_transfer **held, uint64_t id)
{
    int64_t from_ns = monotonic_ns();
    for (; *held != NULL && (*held)->id != id; held = &(*held)->next)
        if ((*held)->due_ns > from_ns) from_ns = (*held)->due_ns;
    struct usb_transfer *request = *held;
    if (request == NULL) return NULL;
    *held = request->next;
    const int64_t left_ns = request->due_ns - from_ns; /* of its time; later requests don't wait for that */
    for (struct usb_transfer *at = request->next; at != NULL && left_ns > 0; at = at->next)
        at->due_ns -= left_ns;
    return request;
}

struct usb_transfer *usb_take_due(struct usb_transfer **held)
{
    return usb_due_ns(*held) <= monotonic_ns() ? usb_let_go(held, (*held)->id) : NULL;
}

int64_t usb_due_ns(const struct usb_transfer *held)
{
    return held != NULL ? held->due_ns : INT64_MAX;
}

void usb_device_lengthen(struct usb_device *device, uint32_t n)
{
    device->lengthen = n;
}
