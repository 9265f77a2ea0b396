/* SPDX-License-Identifier: MIT */
/* States, endpoints and transfers. */
#include <stdlib.h>
#include <string.h>

#include "drivers/usb/usb_core.h"

struct usb_pipe *usb_pipe(struct usb_device *device, unsigned address)
{
    return &device->pipe[usb_endpoint_index(address)];
}

static const struct usb_pipe *pipe_of(const struct usb_device *device, unsigned address)
{
    return &device->pipe[usb_endpoint_index(address)];
}

/* Takes the first transfer off the pipe and gives it back. The callback may submit again. */
static void usb_core_finish(struct usb_device *device, struct usb_pipe *pipe, enum usb_status status)
{
    struct usb_transfer *transfer = pipe->first;
    pipe->first = transfer->next;
    if (pipe->first == NULL) pipe->last = NULL;
    pipe->used = 0;
    transfer->status = status;
    device->complete(device->host_ctx, transfer);
}

/* A transfer of no bytes ends as soon as it comes to the front of a pipe. */
static void finish_empty(struct usb_device *device, struct usb_pipe *pipe)
{
    while (pipe->first != NULL && pipe->first->length == 0)
        usb_core_finish(device, pipe, USB_OK);
}

/* Finishes only the transfers that are there now: a back end may submit again from within complete(). */
static void flush(struct usb_device *device, struct usb_pipe *pipe, enum usb_status status)
{
    struct usb_pipe old = *pipe;
    pipe->first = pipe->last = NULL;
    pipe->used = 0;
    while (old.first != NULL) {
        old.first->actual = old.used;
        usb_core_finish(device, &old, status);
    }
}

/* ---- configurations */

static void stop_pipe(struct usb_device *device, struct usb_pipe *pipe)
{
    pipe->row = NULL; /* before the flush: a transfer that complete() submits again ends at once */
    pipe->halted = pipe->zero_due = 0;
    pipe->shorten = 0;
    pipe->gone_due = 0;
    pipe->epoch++;
    flush(device, pipe, USB_GONE);
}

static void set_interface(struct usb_device *device, unsigned interface, int active)
{
    const struct usb_interface_row *row = &device->facts.model->interface[interface];
    for (unsigned i = 0; i < row->n_endpoints; i++) {
        struct usb_pipe *pipe = usb_pipe(device, row->endpoint[i].address);
        if (active)
            pipe->row = &row->endpoint[i];
        else
            stop_pipe(device, pipe);
    }
    if (device->hooks.interface != NULL) device->hooks.interface(device->ctx, interface, active);
}

void usb_enter(struct usb_device *device, enum usb_state state, enum usb_end why)
{
    const int n = device->facts.model->n_interfaces;
    enum usb_state before = device->state;
    device->state = state;
    device->facts.configuration = state == USB_CONFIGURED ? USB_CONFIGURATION : 0;
    device->facts.end = why; /* before interfaces end: their hook asks for it */
    for (int i = 0; i < n && before == USB_CONFIGURED; i++)
        set_interface(device, (unsigned)i, 0);
    if (state != USB_CONFIGURED) device->u1_enabled = device->u2_enabled = 0;
    for (int i = 0; i < n && state == USB_CONFIGURED; i++)
        set_interface(device, (unsigned)i, 1);
}

void usb_restart_interface(struct usb_device *device, unsigned interface)
{
    device->facts.end = USB_END_CONFIGURED;
    set_interface(device, interface, 0);
    set_interface(device, interface, 1);
}

void usb_set_halt(struct usb_device *device, struct usb_pipe *pipe, int halted)
{
    pipe->halted = halted;
    if (halted) flush(device, pipe, USB_STALLED);
    if (!halted) pipe->zero_due = 0;
}

/* ---- the bus */

void usb_device_attach(struct usb_device *device, enum usb_rate rate, usb_complete complete, void *ctx)
{
    usb_device_detach(device);
    device->complete = complete;
    device->host_ctx = ctx;
    device->facts.rate = rate;
    device->suspended = 0;
    device->state = USB_DEFAULT;
    device->facts.attaches++;
}

void usb_device_detach(struct usb_device *device)
{
    if (device->state != USB_DETACHED) usb_enter(device, USB_DETACHED, USB_END_UNPLUGGED);
}

void usb_device_reset(struct usb_device *device)
{
    if (device->state == USB_DETACHED) return;
    usb_enter(device, USB_DEFAULT, USB_END_RESET);
    device->suspended = 0;
}

void usb_device_suspend(struct usb_device *device, int suspended)
{
    device->suspended = suspended;
}

void usb_device_assume_address(struct usb_device *device)
{
    if (device->state == USB_DEFAULT) device->state = USB_ADDRESSED;
}

/* ---- transfers */

static void append(struct usb_pipe *pipe, struct usb_transfer *transfer)
{
    transfer->next = NULL;
    if (pipe->last != NULL)
        pipe->last->next = transfer;
    else
        pipe->first = transfer;
    pipe->last = transfer;
}

void usb_device_submit(struct usb_device *device, struct usb_transfer *transfer)
{
    struct usb_pipe *pipe = usb_pipe(device, transfer->endpoint);
    transfer->actual = 0;
    transfer->zero_packet = 0;
    transfer->epoch = pipe->epoch;
    if (pipe->row == NULL || pipe->halted || pipe->gone_due) {
        transfer->status = pipe->row == NULL || pipe->gone_due ? USB_GONE : USB_STALLED;
        pipe->gone_due = 0;
        device->complete(device->host_ctx, transfer);
        return;
    }
    append(pipe, transfer);
    if (pipe->first != transfer) return;
    /* A transfer of no bytes ends at once, and so does one that carries the zero-length packet of the write before. */
    if (transfer->length != 0 && !pipe->zero_due) return;
    pipe->zero_due = 0;
    usb_core_finish(device, pipe, USB_OK);
}

int usb_device_cancel(struct usb_device *device, uint64_t id)
{
    for (unsigned i = 0; i < 32; i++) {
        struct usb_pipe *pipe = &device->pipe[i];
        struct usb_transfer *before = NULL;
        for (struct usb_transfer *at = pipe->first; at != NULL; before = at, at = at->next) {
            if (at->id != id) continue;
            *(before != NULL ? &before->next : &pipe->first) = at->next;
            if (pipe->last == at) pipe->last = before;
            at->actual = before == NULL ? pipe->used : 0;
            if (before == NULL) pipe->used = 0;
            at->status = USB_CANCELLED;
            device->complete(device->host_ctx, at);
            finish_empty(device, pipe);
            return 1;
        }
    }
    return 0;
}

/* Returns about half of n, so that the last packet is a short one. */
static uint32_t half_of(uint32_t n, uint32_t packet)
{
    return n / 2 % packet != 0 ? n / 2 : n / 2 - 1;
}

/* Takes as many whole packets as fit; a packet that does not fit is left. */
static uint32_t fill_transfer(struct usb_pipe *pipe, uint32_t packet, const uint8_t *data, size_t len,
                              enum usb_status *status)
{
    struct usb_transfer *transfer = pipe->first;
    uint32_t n = len < transfer->length ? (uint32_t)len : transfer->length;
    *status = USB_OK;
    if (pipe->shorten != 0 && n > 1) {
        pipe->shorten--;
        n = half_of(n, packet);
    } else if (len > transfer->length && n % packet != 0) {
        *status = USB_OVERFLOW;
        n -= n % packet;
    }
    if (n > 0) memcpy(transfer->data, data, n); /* an empty transfer has no room at all */
    transfer->actual = n;
    transfer->zero_packet = *status == USB_OK && n % packet == 0 && n < transfer->length;
    return n;
}

size_t usb_device_write(struct usb_device *device, uint8_t endpoint, const void *data, size_t len)
{
    struct usb_pipe *pipe = usb_pipe(device, endpoint);
    const uint8_t *at = data;
    size_t left = len;
    while (left > 0 && usb_device_can_write(device, endpoint)) {
        const uint32_t packet = pipe->row->packet[device->facts.rate];
        enum usb_status status;
        uint32_t n = fill_transfer(pipe, packet, at, left, &status);
        at += n;
        left -= n;
        pipe->zero_due = left == 0 && status == USB_OK && n == pipe->first->length && n % packet == 0;
        usb_core_finish(device, pipe, status);
    }
    if (pipe->zero_due && pipe->row->units && usb_device_can_write(device, endpoint)) {
        pipe->zero_due = 0;
        usb_core_finish(device, pipe, USB_OK);
    }
    return len - left;
}

int usb_device_can_write(const struct usb_device *device, uint8_t endpoint)
{
    const struct usb_pipe *pipe = pipe_of(device, endpoint);
    return pipe->row != NULL && !pipe->halted && !device->suspended && pipe->first != NULL &&
           (endpoint & USB_DIR_IN) != 0;
}

size_t usb_device_read(struct usb_device *device, uint8_t endpoint, void *data, size_t len)
{
    struct usb_pipe *pipe = usb_pipe(device, endpoint);
    uint8_t *at = data;
    size_t left = len;
    if ((endpoint & USB_DIR_IN) != 0) return 0;
    const uint32_t epoch = pipe->first != NULL ? pipe->first->epoch : 0;
    while (pipe->first != NULL && pipe->first->epoch == epoch && left > 0) {
        struct usb_transfer *transfer = pipe->first;
        uint32_t rest = transfer->length - pipe->used, n = left < rest ? (uint32_t)left : rest;
        if (n > 0) memcpy(at, transfer->data + pipe->used, n); /* an empty transfer has no data */
        at += n;
        left -= n;
        pipe->used += n;
        if (pipe->used < transfer->length) break;
        transfer->actual = transfer->length;
        usb_core_finish(device, pipe, USB_OK);
    }
    finish_empty(device, pipe);
    return len - left;
}

size_t usb_device_can_read(const struct usb_device *device, uint8_t endpoint, uint32_t *epoch)
{
    const struct usb_pipe *pipe = pipe_of(device, endpoint);
    if (pipe->first == NULL || (endpoint & USB_DIR_IN) != 0) return 0;
    if (epoch != NULL) *epoch = pipe->first->epoch;
    return pipe->first->length - pipe->used;
}

void usb_device_drop(struct usb_device *device, uint8_t endpoint)
{
    struct usb_pipe *pipe = usb_pipe(device, endpoint);
    while (pipe->first != NULL && pipe->first->epoch != pipe->epoch) {
        pipe->first->actual = pipe->first->length;
        usb_core_finish(device, pipe, USB_OK);
    }
    finish_empty(device, pipe);
}

uint32_t usb_device_epoch(const struct usb_device *device, uint8_t endpoint)
{
    return pipe_of(device, endpoint)->epoch;
}

void usb_device_next_epoch(struct usb_device *device, uint8_t endpoint)
{
    usb_pipe(device, endpoint)->epoch++;
}

/* ---- the rest */

/* An endpoint belongs to one interface. */
static int check_model(const struct usb_model *model, struct sh_err *err)
{
    uint32_t taken = 0;
    if (model->n_interfaces == 0 || model->n_interfaces > USB_MAX_INTERFACES)
        return sh_fail(err, SH_EINPUT, "usb: %u interfaces; allowed 1 to %d", model->n_interfaces, USB_MAX_INTERFACES);
    for (unsigned i = 0; i < model->n_interfaces; i++) {
        const struct usb_interface_row *row = &model->interface[i];
        if (row->number != i) return sh_fail(err, SH_EINPUT, "usb: interface row %u is out of order", i);
        for (unsigned k = 0; k < row->n_endpoints; k++) {
            const uint8_t address = row->endpoint[k].address;
            const uint32_t bit = UINT32_C(1) << usb_endpoint_index(address);
            if ((address & USB_ENDPOINT_NUMBER_MASK) == 0 || (taken & bit) != 0)
                return sh_fail(err, SH_EINPUT, "usb: endpoint %02x is number 0, or taken twice", address);
            taken |= bit;
        }
    }
    return SH_OK;
}

int usb_device_create(const struct usb_model *model, const struct usb_identity *id, const struct usb_hooks *hooks,
                      void *ctx, struct usb_device **out, struct sh_err *err)
{
    int rc = check_model(model, err);
    if (rc != SH_OK) return rc;
    struct usb_device *device = calloc(1, sizeof *device);
    if (device == NULL) return sh_fail(err, SH_ENOMEM, "usb: no memory");
    device->facts.model = model;
    device->facts.id = *id;
    device->hooks = *hooks;
    device->ctx = ctx;
    *out = device;
    return SH_OK;
}

void usb_device_free(struct usb_device *device)
{
    if (device == NULL) return;
    usb_device_detach(device);
    free(device);
}

const struct usb_facts *usb_facts(const struct usb_device *device)
{
    return &device->facts;
}
