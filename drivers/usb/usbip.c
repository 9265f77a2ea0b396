/* SPDX-License-Identifier: MIT */
/* The usbip back end: a USB/IP server, on TCP port 3240 of the loopback by default, or one connection by
 * socket pair to this machine's vhci_hcd. One host at a time has the device; others may list it.
 *
 * A connection that has not imported the device gives way when a new one needs its place, so that silent ones
 * exclude nobody. A device that is attached here comes back when the host detaches it, as one that is plugged
 * in again. */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "drivers/socket/socket.h"
#include "drivers/usb/backend.h"
#include "drivers/usb/retry.h"
#include "drivers/usb/usbip_private.h"
#include "drivers/usb/vhci.h"

enum { MAX_CONNS = 4, SEND_BUFFER_BYTES = 1 << 20, CLOSE_WAIT_MS = 500 };

struct usbip {
    struct usb_device *device;
    int here;                      /* attached to this machine: nobody else may come */
    int unplugged;                 /* by an injected fault */
    int listener;                  /* -1: none */
    int reserve;                   /* of the listener: socket_reserve() */
    struct socket_address address; /* of the listener */
    struct usb_retry retry;        /* of what is attached here */
    int taken;
    uint64_t n_welcomed;
    struct usbip_conn conn[MAX_CONNS];
    char at[USB_BACKEND_NAME_MAX]; /* of the listener, as text */
    _Atomic unsigned port;         /* of vhci_hcd, as long as it is attached here; other threads ask for the endpoint */
};

static int attach_here(struct usbip *self, struct sh_err *err)
{
    int pair[2];
    unsigned port = 0;
    const int size = SEND_BUFFER_BYTES;
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair) != 0)
        return sh_fail(err, SH_EIO, "usbip: no socket pair: %s", strerror(errno));
    setsockopt(pair[0], SOL_SOCKET, SO_SNDBUF, &size, sizeof size);
    int rc = vhci_attach(NULL, pair[1], usbip_devid(self->device), usb_facts(self->device)->id.highest, &port, err);
    close(pair[1]);
    if (rc == SH_OK && fcntl(pair[0], F_SETFL, O_NONBLOCK) != 0)
        rc = sh_fail(err, SH_EIO, "usbip: socket pair: %s", strerror(errno));
    if (rc != SH_OK) {
        close(pair[0]);
        return rc;
    }
    usbip_conn_start(&self->conn[0], pair[0], self->device, &self->taken);
    usbip_conn_import(&self->conn[0]);
    self->port = port;
    return SH_OK;
}

static int listen_here(struct usbip *self, const struct usb_backend_spec *spec, struct sh_err *err)
{
    int rc = usb_backend_socket(spec, "usbip", &self->listener, self->at, sizeof self->at, err);
    if (rc != SH_OK) return rc;
    socket_note_address(self->listener, &self->address);
    self->reserve = socket_reserve();
    return SH_OK;
}

static int usbip_open(const struct usb_backend_spec *spec, struct usb_device *device, void **backend,
                      struct sh_err *err)
{
    struct usbip *self = calloc(1, sizeof *self);
    if (self == NULL) return sh_fail(err, SH_ENOMEM, "usbip: no memory");
    self->device = device;
    self->listener = self->reserve = -1;
    usb_retry_init(&self->retry, spec->retry_ms);
    for (int i = 0; i < MAX_CONNS; i++)
        self->conn[i].fd = -1;
    self->here = spec->attach;
    int rc = self->here ? attach_here(self, err) : listen_here(self, spec, err);
    if (rc != SH_OK) {
        free(self);
        return rc;
    }
    *backend = self;
    return SH_OK;
}

static void usbip_endpoint(const void *backend, char *buf, size_t len)
{
    const struct usbip *self = backend;
    if (self->here)
        snprintf(buf, len, "usbip:vhci_hcd.0:%u", self->port);
    else
        snprintf(buf, len, "usbip:%s", self->at);
}

enum { AT_LISTENER = MAX_CONNS, N_FDS };

static int usbip_prepare(void *backend, struct pollfd *fds)
{
    struct usbip *self = backend;
    for (int i = 0; i < MAX_CONNS; i++) {
        const struct usbip_conn *conn = &self->conn[i];
        fds[i] = (struct pollfd){.fd = conn->fd};
        if (!usbip_conn_is_full(conn)) fds[i].events |= POLLIN;
        if (conn->out_first != NULL) fds[i].events |= POLLOUT;
    }
    fds[AT_LISTENER] = (struct pollfd){.fd = self->listener, .events = POLLIN};
    return N_FDS;
}

/* Returns a free place, or ends the connection that has been here longest without importing, and returns its place.
 * Such a connection always exists, since at most one host has imported. */
static struct usbip_conn *usbip_make_room(struct usbip *self)
{
    struct usbip_conn *oldest = NULL;
    for (int i = 0; i < MAX_CONNS; i++) {
        struct usbip_conn *conn = &self->conn[i];
        if (conn->fd < 0) return conn;
        if (!conn->imported && (oldest == NULL || conn->number < oldest->number)) oldest = conn;
    }
    usbip_conn_end(oldest);
    return oldest;
}

static void usbip_welcome(struct usbip *self, const struct usb_owner *owner)
{
    const int size = SEND_BUFFER_BYTES;
    for (int i = 0; i < MAX_CONNS; i++) {
        int fd = usb_backend_accept(self->listener, &self->reserve, owner);
        if (fd < 0) return;
        socket_tune(fd);
        /* The peer is a kernel, which always reads. While a dead one seems alive, no other host gets the device. */
        socket_tune_impatient(fd);
        setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &size, sizeof size);
        struct usbip_conn *conn = usbip_make_room(self);
        usbip_conn_start(conn, fd, self->device, &self->taken);
        conn->number = ++self->n_welcomed;
    }
}

/* Says why a host loses the device. A client without the device, such as a scanner of ports, is not worth a word. */
static void say_why(const struct usbip_conn *conn, const struct usb_owner *owner)
{
    char text[160];
    if (!conn->imported || conn->why == NULL) return;
    snprintf(text, sizeof text, "the USB/IP host is cut off: %s", conn->why);
    owner->say(owner->ctx, text);
}

static void sweep(struct usbip *self, const struct usb_owner *owner)
{
    for (int i = 0; i < MAX_CONNS; i++) {
        if (self->conn[i].fd < 0 || !self->conn[i].broken) continue;
        if (self->here && !self->unplugged) usb_retry_start(&self->retry, owner);
        say_why(&self->conn[i], owner);
        usbip_conn_end(&self->conn[i]);
    }
}

static void attach_again(struct usbip *self, const struct usb_owner *owner)
{
    struct sh_err err = {0, ""};
    const int is_attached = self->conn[0].fd >= 0; /* the end of an injected fault has plugged it in meanwhile */
    if (is_attached || attach_here(self, &err) == SH_OK)
        usb_retry_done(&self->retry, owner);
    else
        usb_retry_failed(&self->retry, err.text, owner);
}

static void usbip_flush(void *backend)
{
    struct usbip *self = backend;
    for (int i = 0; i < MAX_CONNS; i++)
        if (self->conn[i].fd >= 0) usbip_conn_write(&self->conn[i]);
}

/* Whether the host that has the device has hung up. What it sent before is read within the next turns, and the device
 * is free then. A full connection is not read until its host takes replies, so it counts only where it is broken. */
static int is_host_leaving(const struct usbip *self)
{
    for (int i = 0; i < MAX_CONNS; i++) {
        const struct usbip_conn *conn = &self->conn[i];
        struct pollfd slot = {.fd = conn->fd, .events = POLLRDHUP};
        if (conn->fd < 0 || !conn->imported) continue;
        return conn->broken ||
               (poll(&slot, 1, 0) > 0 && (!usbip_conn_is_full(conn) || (slot.revents & (POLLHUP | POLLERR)) != 0));
    }
    return 0;
}

static int usbip_handle(void *backend, const struct pollfd *fds, int n, const struct usb_owner *owner)
{
    struct usbip *self = backend;
    if (n != N_FDS) return SH_OK;
    for (int i = 0; i < MAX_CONNS; i++) {
        if (self->conn[i].fd < 0 || (fds[i].revents & ~POLLOUT) == 0) continue;
        /* An IMPORT that came after the host had hung up must not be answered as busy: it waits for the next turn. */
        if (self->conn[i].imported || !is_host_leaving(self)) usbip_conn_read(&self->conn[i], owner);
    }
    for (int i = 0; i < MAX_CONNS; i++)
        if (self->conn[i].fd >= 0) usbip_conn_answer_slow(&self->conn[i], owner);
    if (fds[AT_LISTENER].fd >= 0 && fds[AT_LISTENER].revents != 0) usbip_welcome(self, owner);
    if (usb_retry_is_due(&self->retry) && !self->unplugged) attach_again(self, owner);
    usbip_flush(self);
    sweep(self, owner);
    return SH_OK;
}

static int64_t usbip_due_ns(const void *backend)
{
    const struct usbip *self = backend;
    int64_t due_ns = self->retry.due_ns;
    for (int i = 0; i < MAX_CONNS; i++)
        if (usb_due_ns(self->conn[i].held) < due_ns) due_ns = usb_due_ns(self->conn[i].held);
    return due_ns;
}

/* ---- injected faults */

static int usbip_unplug(struct usbip *self)
{
    if (self->unplugged) return SH_ESTATE;
    self->unplugged = 1;
    if (self->listener >= 0) close(self->listener); /* first, so that a host that is cut off can't come back at once */
    self->listener = -1;
    for (int i = 0; i < MAX_CONNS; i++)
        usbip_conn_end(&self->conn[i]);
    return SH_OK;
}

static int usbip_plug(struct usbip *self)
{
    struct sh_err err;
    if (!self->unplugged) return SH_OK;
    if (self->here)
        self->unplugged = attach_here(self, &err) != SH_OK;
    else
        self->unplugged = (self->listener = socket_listen_again(&self->address)) < 0;
    return self->unplugged ? SH_ESTATE : SH_OK;
}

static int usbip_fault(void *backend, enum usb_fault what)
{
    struct usbip *self = backend;
    if (what == USB_FAULT_UNPLUG) return usbip_unplug(self);
    if (what == USB_FAULT_PLUG) return usbip_plug(self);
    if (!self->taken) return SH_ESTATE;
    usb_device_restart(self->device);
    usbip_flush(self);
    return SH_OK;
}

static void usbip_close(void *backend)
{
    struct usbip *self = backend;
    for (int i = 0; i < MAX_CONNS; i++) {
        if (self->conn[i].fd >= 0) usbip_conn_drain(&self->conn[i], CLOSE_WAIT_MS);
        usbip_conn_end(&self->conn[i]);
    }
    if (self->listener >= 0) close(self->listener);
    if (self->reserve >= 0) close(self->reserve);
    free(self);
}

const struct usb_backend_ops usb_backend_usbip = {
    .open = usbip_open,
    .endpoint = usbip_endpoint,
    .prepare = usbip_prepare,
    .handle = usbip_handle,
    .flush = usbip_flush,
    .due_ns = usbip_due_ns,
    .faults = USB_CAN_STALL | USB_CAN_SHORTEN | USB_CAN_ENUMERATE_WRONG,
    .fault = usbip_fault,
    .close = usbip_close,
};
