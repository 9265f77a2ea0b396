/* SPDX-License-Identifier: MIT */
/* The usbredir back end: the device for a virtual machine (QEMU's usb-redir), over a Unix socket or TCP; no
 * root needed. The back end serves one guest at a time; a guest that has not sent its hello yet gives way to the next
 * that comes. libusbredirparser does the wire format, which spice/usbredir's usb-redirection-protocol.md describes;
 * this file is the protocol's "usb-host" end.
 *
 * Where the back end connects instead of listening (attach), it connects again after the guest has hung up. */
#include "drivers/usb/backend.h"

#ifdef HAVE_USBREDIR

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include "drivers/usb/usbredir_private.h"

/* MAX_UNSENT: while so many packets wait for the guest to read them, nothing is read from the guest.
 * MAX_READS: in one call; a guest that sends without end must not occupy the thread. */
enum { CLOSE_WAIT_MS = 500, SEND_BUFFER_BYTES = 1 << 20, MAX_UNSENT = 64, MAX_READS = 256 };

static int is_full(const struct usbredir *self)
{
    return usbredirparser_has_data_to_write(self->parser) >= MAX_UNSENT;
}

static void usbredir_flush(void *backend)
{
    struct usbredir *self = backend;
    if (self->parser != NULL && !self->broken && usbredirparser_has_data_to_write(self->parser) > 0)
        usbredirparser_do_write(self->parser);
}

/* ---- the library's way to the socket */

static int on_read(void *priv, uint8_t *data, int count)
{
    struct usbredir *self = priv;
    if (self->broken || self->n_reads++ >= MAX_READS || !self->owner->go_on(self->owner->ctx)) return 0;
    if (is_full(self)) usbredir_flush(self); /* a guest may send many packets before it reads */
    if (self->broken || is_full(self)) return 0;
    ssize_t n = socket_read(self->fd, data, (size_t)count);
    if (n >= 0) return (int)n;
    self->broken = 1;
    return -1;
}

static int on_write(void *priv, uint8_t *data, int count)
{
    struct usbredir *self = priv;
    ssize_t n = socket_write(self->fd, data, (size_t)count);
    if (n >= 0) return (int)n;
    self->broken = 1;
    return -1;
}

/* The library's remarks are about broken peers, which are cut off anyway. */
static void on_log(void *priv, int level, const char *text)
{
    (void)priv;
    (void)level;
    (void)text;
}

/* ---- connections */

/* fd is connected; SH_ENOMEM: it stays the caller's. */
static int usbredir_start(struct usbredir *self, int fd)
{
    static char version[] = "scanhead";
    const int size = SEND_BUFFER_BYTES;
    uint32_t caps[USB_REDIR_CAPS_SIZE] = {0};
    struct usbredirparser *parser = usbredirparser_create();
    if (parser == NULL) return SH_ENOMEM;
    socket_tune(fd); /* not impatient: QEMU doesn't read while its machine is paused, and must not be cut off then */
    setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &size, sizeof size);
    parser->priv = self;
    parser->log_func = on_log;
    parser->read_func = on_read;
    parser->write_func = on_write;
    usbredir_take_requests(parser);
    usbredir_take_data(parser);
    usbredirparser_caps_set_cap(caps, usb_redir_cap_connect_device_version);
    usbredirparser_caps_set_cap(caps, usb_redir_cap_ep_info_max_packet_size);
    usbredirparser_caps_set_cap(caps, usb_redir_cap_64bits_ids);
    usbredirparser_caps_set_cap(caps, usb_redir_cap_32bits_bulk_length);
    self->fd = fd;
    self->parser = parser;
    self->broken = self->greeted = 0;
    self->why = NULL;
    usbredirparser_init(parser, version, caps, USB_REDIR_CAPS_SIZE, usbredirparser_fl_usb_host);
    return SH_OK;
}

static void usbredir_stop(struct usbredir *self)
{
    if (self->parser != NULL) {
        usb_device_detach(self->device);
        usbredir_forget_slow(self);
        usbredirparser_destroy(self->parser);
    }
    if (self->fd >= 0) close(self->fd);
    self->parser = NULL;
    self->fd = -1;
    self->broken = self->greeted = 0;
}

/* The attempt to connect self->fd has ended. error: 0, or the errno of its failure. */
static void end_connect(struct usbredir *self, int error)
{
    if (error == 0 && usbredir_start(self, self->fd) == SH_OK) {
        usb_retry_done(&self->retry, self->owner);
        return;
    }
    usb_retry_failed(&self->retry, error != 0 ? strerror(error) : "no memory", self->owner);
    usbredir_stop(self);
}

static void connect_again(struct usbredir *self)
{
    if (self->fd >= 0) return; /* the attempt before is still under way */
    int error = usb_backend_connect(&self->peer, &self->fd);
    if (error == 0) error = usb_backend_connect_error(self->fd);
    if (error != EINPROGRESS) end_connect(self, error);
}

static void usbredir_welcome(struct usbredir *self)
{
    int fd = usb_backend_accept(self->listener, &self->reserve, self->owner);
    if (fd < 0) return;
    usbredir_stop(self); /* a guest that has not sent its hello */
    if (usbredir_start(self, fd) != SH_OK) close(fd);
}

/* ---- the back end */

static void note_path(struct usbredir *self, const char *path)
{
    struct stat st;
    if (path[0] == '\0' || lstat(path, &st) != 0) return;
    snprintf(self->path, sizeof self->path, "%s", path);
    self->path_device = st.st_dev;
    self->path_inode = st.st_ino;
}

/* Removes the path, unless another program listens there by now. To be called before the listener is closed:
 * until then nobody takes the path for an abandoned one, and no other file gets the inode's number. */
static void remove_path(const struct usbredir *self)
{
    struct stat st;
    if (self->path[0] == '\0' || lstat(self->path, &st) != 0) return;
    if (st.st_dev == self->path_device && st.st_ino == self->path_inode) unlink(self->path);
}

static int open_socket(struct usbredir *self, const struct usb_backend_spec *spec, struct sh_err *err)
{
    int fd;
    char at[USB_BACKEND_NAME_MAX - 16] = "";
    int rc = usb_backend_socket(spec, "usbredir", &fd, at, sizeof at, err);
    if (rc != SH_OK) return rc;
    snprintf(self->name, sizeof self->name, "usbredir:%s", at);
    if (!spec->attach) {
        self->listener = fd;
        self->reserve = socket_reserve();
        note_path(self, spec->path);
        return SH_OK;
    }
    usb_backend_peer(spec, fd, &self->peer);
    if (usbredir_start(self, fd) == SH_OK) return SH_OK;
    close(fd);
    return sh_fail(err, SH_ENOMEM, "usbredir: no memory");
}

static int usbredir_open(const struct usb_backend_spec *spec, struct usb_device *device, void **backend,
                         struct sh_err *err)
{
    struct usbredir *self = calloc(1, sizeof *self);
    if (self == NULL) return sh_fail(err, SH_ENOMEM, "usbredir: no memory");
    self->device = device;
    self->listener = self->fd = self->reserve = -1;
    usb_retry_init(&self->retry, spec->retry_ms);
    int rc = open_socket(self, spec, err);
    if (rc != SH_OK) {
        free(self);
        return rc;
    }
    *backend = self;
    return SH_OK;
}

static void usbredir_endpoint(const void *backend, char *buf, size_t len)
{
    const struct usbredir *self = backend;
    snprintf(buf, len, "%s", self->name);
}

enum { AT_GUEST, AT_LISTENER, N_FDS };

static int usbredir_prepare(void *backend, struct pollfd *fds)
{
    struct usbredir *self = backend;
    fds[AT_GUEST] = (struct pollfd){.fd = self->fd};
    if (self->parser == NULL || usbredirparser_has_data_to_write(self->parser) > 0) fds[AT_GUEST].events |= POLLOUT;
    if (self->parser != NULL && !is_full(self)) fds[AT_GUEST].events |= POLLIN;
    fds[AT_LISTENER] = (struct pollfd){.fd = self->greeted ? -1 : self->listener, .events = POLLIN};
    return N_FDS;
}

static void read_packets(struct usbredir *self)
{
    const int rc = usbredirparser_do_read(self->parser);
    if (rc == usbredirparser_read_parse_error)
        usbredir_break(self, "a packet that breaks the protocol");
    else if (rc != 0)
        self->broken = 1;
}

/* Says why a guest loses the device. A client that is no guest yet is not worth a word. */
static void say_why(const struct usbredir *self)
{
    char text[160];
    if (!self->greeted || self->why == NULL) return;
    snprintf(text, sizeof text, "the usbredir guest is cut off: %s", self->why);
    self->owner->say(self->owner->ctx, text);
}

static int usbredir_handle(void *backend, const struct pollfd *fds, int n, const struct usb_owner *owner)
{
    struct usbredir *self = backend;
    if (n != N_FDS) return SH_OK;
    self->owner = owner;
    self->n_reads = 0;
    if (self->fd >= 0 && self->parser == NULL && fds[AT_GUEST].revents != 0)
        end_connect(self, usb_backend_connect_error(self->fd));
    else if (self->parser != NULL && (fds[AT_GUEST].revents & ~POLLOUT) != 0)
        read_packets(self);
    if (!self->greeted && fds[AT_LISTENER].fd >= 0 && fds[AT_LISTENER].revents != 0) usbredir_welcome(self);
    if (usb_retry_is_due(&self->retry)) connect_again(self);
    usbredir_answer_slow(self);
    usbredir_flush(self);
    if (!self->broken) return SH_OK;
    if (self->listener < 0) usb_retry_start(&self->retry, self->owner);
    say_why(self);
    usbredir_stop(self);
    return SH_OK;
}

static int64_t usbredir_due_ns(const void *backend)
{
    const struct usbredir *self = backend;
    const int64_t held_ns = usb_due_ns(self->held);
    return held_ns < self->retry.due_ns ? held_ns : self->retry.due_ns;
}

/* ---- injected faults. The channel to the virtual machine stays: the device alone is unplugged from it. */

static int usbredir_unplug(struct usbredir *self)
{
    if (self->unplugged) return SH_ESTATE;
    self->unplugged = 1;
    if (!self->greeted || self->broken) return SH_OK;
    usb_device_detach(self->device);
    usbredir_forget_slow(self);
    usbredirparser_send_device_disconnect(self->parser);
    usbredir_flush(self);
    return SH_OK;
}

static int usbredir_replug(struct usbredir *self)
{
    if (!self->unplugged) return SH_OK;
    self->unplugged = 0;
    if (!self->greeted || self->broken) return SH_OK;
    usbredir_plug(self);
    usbredir_flush(self);
    return SH_OK;
}

/* The protocol has no packet for a reset from this end. So the device is unplugged, and plugged in at once. */
static int usbredir_fault(void *backend, enum usb_fault what)
{
    struct usbredir *self = backend;
    if (what == USB_FAULT_UNPLUG) return usbredir_unplug(self);
    if (what == USB_FAULT_PLUG) return usbredir_replug(self);
    if (!self->greeted || self->unplugged) return SH_ESTATE;
    usbredir_unplug(self);
    return usbredir_replug(self);
}

static void usbredir_close(void *backend)
{
    struct usbredir *self = backend;
    if (self->parser != NULL && !self->broken) {
        struct pollfd slot = {.fd = self->fd, .events = POLLOUT};
        usb_device_detach(self->device);
        if (!self->unplugged) usbredirparser_send_device_disconnect(self->parser);
        while (!self->broken && usbredirparser_has_data_to_write(self->parser) > 0 && poll(&slot, 1, CLOSE_WAIT_MS) > 0)
            usbredir_flush(self);
        if (!self->broken) usb_backend_hang_up(self->fd, CLOSE_WAIT_MS);
    }
    usbredir_stop(self);
    remove_path(self);
    if (self->listener >= 0) close(self->listener);
    if (self->reserve >= 0) close(self->reserve);
    free(self);
}

const struct usb_backend_ops usb_backend_usbredir = {
    .open = usbredir_open,
    .endpoint = usbredir_endpoint,
    .prepare = usbredir_prepare,
    .handle = usbredir_handle,
    .flush = usbredir_flush,
    .due_ns = usbredir_due_ns,
    .faults = USB_CAN_STALL | USB_CAN_SHORTEN | USB_CAN_ENUMERATE_WRONG,
    .fault = usbredir_fault,
    .close = usbredir_close,
};

#else

static int usbredir_open(const struct usb_backend_spec *spec, struct usb_device *device, void **backend,
                         struct sh_err *err)
{
    (void)spec;
    (void)device;
    (void)backend;
    return sh_fail(err, SH_EINPUT, "usbredir: built without it; install libusbredirparser-dev and build again");
}

const struct usb_backend_ops usb_backend_usbredir = {.open = usbredir_open};

#endif
