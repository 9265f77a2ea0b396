/* SPDX-License-Identifier: MIT */
/* The functionfs back end: the device on a real device controller of this machine (a board with a UDC), as a
 * gadget of the Linux kernel. The kernel answers the standard requests from the descriptors it was given.
 * Requests to our own interfaces come as events on ep0. The core hears of a configuration as if it had
 * answered the requests itself.
 *
 * A device that is only a port has no ep0 of ours: the kernel's f_acm is the whole device. For such a device the state
 * of the controller, and the hang-up of the port, show what the host does. */
#include <errno.h>
#include <fcntl.h>
#include <linux/usb/functionfs.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/bytes.h"
#include "drivers/usb/backend.h"
#include "drivers/usb/functionfs_private.h"

/* MAX_TAKEN: completions before ep0 is looked at again, and MAX_EVENTS: events of ep0 within one call.
 * The limits let endpoints, ep0 and the owner all get their turn, however much the kernel delivers. */
enum { CLOSE_WAIT_MS = 500, MAX_TAKEN = 2 * FFS_SLOTS * FFS_MAX_PIPES, MAX_EVENTS = 64 };

static void on_complete(void *ctx, struct usb_transfer *transfer)
{
    struct functionfs *self = ctx;
    if (!ffs_console_complete(&self->console, transfer)) ffs_pipes_complete(&self->pipes, transfer);
}

static int open_ep0(struct functionfs *self, struct sh_err *err)
{
    char path[96];
    snprintf(path, sizeof path, "%s/ep0", self->gadget.mount);
    self->ep0 = open(path, O_RDWR | O_NONBLOCK | O_CLOEXEC);
    if (self->ep0 < 0) return sh_fail(err, SH_EIO, "functionfs: %s: %s", path, strerror(errno));
    return gadget_describe(&self->gadget, self->ep0, &usb_facts(self->device)->id, err);
}

static void take_apart(struct functionfs *self)
{
    gadget_unbind(&self->gadget);
    usb_device_detach(self->device);
    ffs_pipes_close(&self->pipes);
    ffs_console_stop(&self->console);
    if (self->ep0 >= 0) close(self->ep0);
    gadget_remove(&self->gadget);
    free(self);
}

static int functionfs_open(const struct usb_backend_spec *spec, struct usb_device *device, void **backend,
                           struct sh_err *err)
{
    struct functionfs *self = calloc(1, sizeof *self);
    if (self == NULL) return sh_fail(err, SH_ENOMEM, "functionfs: no memory");
    self->device = device;
    self->ep0 = self->pipes.event_fd = self->console.fd = -1;
    int rc = gadget_create(&self->gadget, usb_facts(device)->model, &usb_facts(device)->id, err);
    if (rc == SH_OK && gadget_has_functionfs(&self->gadget)) rc = open_ep0(self, err);
    if (rc == SH_OK) rc = ffs_pipes_open(&self->pipes, device, &self->gadget, err);
    if (rc == SH_OK) rc = ffs_console_open(&self->console, device, self->gadget.tty_number, err);
    if (rc == SH_OK) rc = gadget_bind(&self->gadget, spec->udc, err);
    if (rc == SH_OK) rc = gadget_check_rate(&self->gadget, usb_facts(device)->id.highest, err);
    if (rc == SH_OK && self->ep0 < 0) rc = gadget_watch_state(&self->gadget, err);
    if (rc != SH_OK) {
        take_apart(self);
        return rc;
    }
    snprintf(self->udc, sizeof self->udc, "%s", self->gadget.udc);
    *backend = self;
    return SH_OK;
}

static void functionfs_endpoint(const void *backend, char *buf, size_t len)
{
    const struct functionfs *self = backend;
    snprintf(buf, len, "functionfs:%s", self->udc);
}

enum { AT_EP0, AT_AIO, AT_TTY, N_FDS };

static int functionfs_prepare(void *backend, struct pollfd *fds)
{
    struct functionfs *self = backend;
    const short tty = ffs_console_events(&self->console);
    fds[AT_EP0] = self->ep0 >= 0 ? (struct pollfd){.fd = self->ep0, .events = POLLIN}
                                 : (struct pollfd){.fd = self->gadget.state_fd, .events = POLLPRI};
    fds[AT_AIO] = (struct pollfd){.fd = self->pipes.event_fd, .events = POLLIN};
    fds[AT_TTY] = (struct pollfd){.fd = tty != 0 ? self->console.fd : -1, .events = tty};
    return N_FDS;
}

/* The kernel reports a reset, a configuration that was taken away and an unplugging alike. */
static void functionfs_disable(struct functionfs *self, int unplugged)
{
    ffs_pipes_stop(&self->pipes);
    if (unplugged)
        usb_device_detach(self->device);
    else
        usb_device_reset(self->device);
    ffs_console_stop(&self->console);
}

/* The controller chooses the endpoints' addresses, and some controllers lack those that the model asks for. */
static void look_at_addresses(struct functionfs *self)
{
    char text[200];
    uint8_t given = 0;
    if (!usb_facts(self->device)->model->fixed_addresses || self->has_said_moved) return;
    const uint8_t wanted = ffs_pipes_moved(&self->pipes, &given);
    if (wanted == 0) return;
    snprintf(
        text, sizeof text,
        "the controller %.40s gives endpoint %02x in place of %02x; clients that look for the device's own endpoints "
        "don't find it: use backend usbip or usbredir",
        self->gadget.udc, given, wanted);
    self->owner->say(self->owner->ctx, text);
    self->has_said_moved = 1;
}

/* The host has configured the device. */
static void functionfs_enable(struct functionfs *self)
{
    struct usb_ctrlrequest setup = {.bRequest = USB_REQ_SET_CONFIGURATION};
    le_put16(&setup.wValue, USB_CONFIGURATION);
    functionfs_disable(self, 0); /* the kernel drops a DISABLE that was not read before ENABLE came */
    usb_device_attach(self->device, gadget_rate(&self->gadget), on_complete, self);
    usb_device_assume_address(self->device);
    usb_device_control(self->device, &setup, NULL, 0);
    ffs_pipes_start(&self->pipes);
    ffs_console_start(&self->console);
    look_at_addresses(self);
}

/* A transfer in the wrong direction is FunctionFS's way to stall. */
static void functionfs_stall(struct functionfs *self, int in)
{
    ssize_t n = in ? read(self->ep0, self->data, 0) : write(self->ep0, self->data, 0);
    (void)n; /* it fails, which is what stalls */
}

/* The kernel has put its own numbers in wIndex: interfaces count from 0, endpoints from 1 in the order of our
 * descriptors. translate_index puts the model's numbers there. An unknown endpoint becomes endpoint 0, for which no
 * function answers. */
static void translate_index(const struct functionfs *self, struct usb_ctrlrequest *setup)
{
    const unsigned index = le_get16(&setup->wIndex), recipient = setup->bRequestType & USB_RECIP_MASK;
    if (recipient == USB_RECIP_INTERFACE && (index & 0xff) < self->gadget.part.n_interfaces)
        le_put16(&setup->wIndex, (uint16_t)((index & 0xff00u) | self->gadget.interface[index & 0xff]));
    if (recipient == USB_RECIP_ENDPOINT) le_put16(&setup->wIndex, ffs_pipes_address(&self->pipes, index));
}

static void functionfs_answer(struct functionfs *self, struct usb_ctrlrequest setup)
{
    const int in = (setup.bRequestType & USB_DIR_IN) != 0;
    const unsigned length = le_get16(&setup.wLength);
    translate_index(self, &setup);
    int n = USB_STALL;
    if (in) {
        if (length <= sizeof self->data) n = usb_device_control(self->device, &setup, self->data, length);
        if (n >= 0 && write(self->ep0, self->data, (size_t)n) == n) return;
    } else if (length == 0) {
        n = usb_device_control(self->device, &setup, self->data, 0);
        if (n >= 0 && read(self->ep0, self->data, 0) == 0) return;
    } else if (length <= sizeof self->data && usb_device_control(self->device, &setup, NULL, length) == 0 &&
               read(self->ep0, self->data, length) == (ssize_t)length) { /* reading accepts the request */
        usb_device_control(self->device, &setup, self->data, length);    /* the data are taken: too late to stall */
        return;
    }
    if (n == USB_STALL) functionfs_stall(self, in);
}

/* Follows the controller's state, for a gadget without ep0. A port that was hung up shows that the device was not
 * configured for a while, even if the state is "configured" again. */
static void take_state(struct functionfs *self, int hung_up)
{
    char text[32];
    /* Reading lets poll(2) wait for the next change. The reading comes first, so that no change between both reads is
     * missed. */
    if (pread(self->gadget.state_fd, text, sizeof text, 0) < 0) return;
    const int was = usb_facts(self->device)->configuration != 0;
    const int is = gadget_is_configured(&self->gadget, was);
    if (was && (hung_up || !is)) functionfs_disable(self, !gadget_is_on_bus(&self->gadget));
    if (is && (hung_up || !was)) functionfs_enable(self);
}

/* Takes one event of ep0; 0: there is none. */
static int functionfs_take_event(struct functionfs *self)
{
    struct usb_functionfs_event event;
    if (self->ep0 < 0) return 0;
    if (read(self->ep0, &event, sizeof event) != sizeof event) return 0;
    switch (event.type) {
    case FUNCTIONFS_ENABLE:
        functionfs_enable(self);
        break;
    case FUNCTIONFS_DISABLE:
        functionfs_disable(self, !gadget_is_on_bus(&self->gadget));
        break;
    case FUNCTIONFS_UNBIND:
        functionfs_disable(self, 1);
        break;
    case FUNCTIONFS_SETUP:
        functionfs_answer(self, event.u.setup);
        break;
    case FUNCTIONFS_SUSPEND:
    case FUNCTIONFS_RESUME:
        usb_device_suspend(self->device, event.type == FUNCTIONFS_SUSPEND);
        break;
    default: /* BIND: nothing to do */
        break;
    }
    return 1;
}

static void functionfs_flush(void *backend)
{
    struct functionfs *self = backend;
    ffs_pipes_withdraw(&self->pipes);
}

static int functionfs_handle(void *backend, const struct pollfd *fds, int n, const struct usb_owner *owner)
{
    struct functionfs *self = backend;
    if (n != N_FDS) return SH_OK;
    self->owner = owner;
    int going = owner->go_on(owner->ctx), any = 1;
    const int hung_up = fds[AT_TTY].fd == self->console.fd && (fds[AT_TTY].revents & POLLHUP) != 0;
    if (going && self->ep0 < 0 && (fds[AT_EP0].revents != 0 || hung_up)) take_state(self, hung_up);
    /* Data on the endpoints came before the event on ep0. So the data are taken first: a session is not closed before
     * its last data are in. */
    for (int events = 0; going && any && events < MAX_EVENTS; events++) {
        int taken = 0;
        for (; going && taken < MAX_TAKEN && ffs_pipes_take(&self->pipes); taken++)
            going = owner->go_on(owner->ctx);
        any = going && (functionfs_take_event(self) || taken == MAX_TAKEN);
        going = going && owner->go_on(owner->ctx);
    }
    if (going) ffs_console_handle(&self->console, fds[AT_TTY].fd == self->console.fd ? fds[AT_TTY].revents : 0);
    self->backlog = !going || any;
    functionfs_flush(self);
    return SH_OK;
}

static int functionfs_more(const void *backend)
{
    const struct functionfs *self = backend;
    return self->backlog;
}

static int64_t functionfs_due_ns(const void *backend)
{
    const struct functionfs *self = backend;
    return self->console.look_ns;
}

/* ---- injected faults */

static int functionfs_unplug(struct functionfs *self)
{
    if (self->unplugged) return SH_ESTATE;
    self->unplugged = 1;
    gadget_unbind(&self->gadget);
    functionfs_disable(self, 1);
    return SH_OK;
}

static int functionfs_plug(struct functionfs *self)
{
    struct sh_err err;
    if (!self->unplugged) return SH_OK;
    if (gadget_bind(&self->gadget, self->udc, &err) != SH_OK) return SH_ESTATE;
    self->unplugged = 0;
    return SH_OK;
}

/* A gadget can't report a reset. So it leaves its controller, and is back at once. */
static int functionfs_fault(void *backend, enum usb_fault what)
{
    struct functionfs *self = backend;
    if (what == USB_FAULT_PLUG) return functionfs_plug(self);
    const int rc = functionfs_unplug(self);
    return what == USB_FAULT_UNPLUG || rc != SH_OK ? rc : functionfs_plug(self);
}

static void functionfs_close(void *backend)
{
    struct functionfs *self = backend;
    ffs_pipes_drain(&self->pipes, CLOSE_WAIT_MS);
    take_apart(self);
}

const struct usb_backend_ops usb_backend_functionfs = {
    .open = functionfs_open,
    .endpoint = functionfs_endpoint,
    .prepare = functionfs_prepare,
    .handle = functionfs_handle,
    .more = functionfs_more,
    .flush = functionfs_flush,
    .due_ns = functionfs_due_ns,
    .faults = USB_CAN_SHORTEN,
    .fault = functionfs_fault,
    .close = functionfs_close,
};
