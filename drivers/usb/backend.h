/* SPDX-License-Identifier: MIT */
/* Back ends: the ways between a host and the device core (usb.h). Acts of a host go in, the core's answers
 * come out.
 *
 * Each back end has one ops struct and one file; backend.c has the list. A back end is driven by its owner's poll(2):
 * it has no threads, and nothing blocks. */
#ifndef DRIVERS_USB_BACKEND_H
#define DRIVERS_USB_BACKEND_H

#include <poll.h>

#include "drivers/usb/usb.h"

enum usb_backend_type { USB_BACKEND_USBIP, USB_BACKEND_USBREDIR, USB_BACKEND_FUNCTIONFS };

enum { USB_BACKEND_MAX_FDS = 8, USB_BACKEND_NAME_MAX = 300, USB_BACKEND_USBIP_PORT = 3240 };

struct usb_backend_spec {
    enum usb_backend_type type;
    char address[64]; /* usbip, usbredir: numeric or name; empty: 127.0.0.1 */
    int port;         /* usbip, usbredir: 0 lets the system choose */
    char path[256];   /* usbredir: Unix socket, instead of address and port */
    char udc[64];     /* functionfs: name of the controller; empty: the first free one */
    int attach;       /* usbip: plug into this machine's vhci_hcd; usbredir: connect instead of listening */
    int retry_ms;     /* with attach: time between attempts to come back after the host has let go; 0: 1000 */
};

/* Faults of fault(). UNPLUG: the device and its endpoint are not there until PLUG. RESET: sessions end as by a reset of
 * the bus, or by an unplug and a plug where the back end can't make the host see a reset. */
enum usb_fault { USB_FAULT_UNPLUG, USB_FAULT_PLUG, USB_FAULT_RESET };

/* Injected faults of transfers and requests, which a back end may lack. All back ends can unplug and reset. */
enum { USB_CAN_STALL = 1, USB_CAN_SHORTEN = 2, USB_CAN_ENUMERATE_WRONG = 4 };

/* The owner of a back end, which handle() calls. */
struct usb_owner {
    int (*go_on)(void *ctx);                       /* 0: the owner has to report something before the next act */
    void (*say)(void *ctx, const char *text);      /* a line for its user; replaces an untold one */
    void (*refuse)(void *ctx, const char *client); /* it was turned away, for want of a descriptor */
    void *ctx;
};

struct usb_backend_ops {
    /* Opens as spec says. When it fails, nothing of it stays. The device is the caller's and outlives the
     * back end, which attaches and detaches it. */
    int (*open)(const struct usb_backend_spec *spec, struct usb_device *device, void **backend, struct sh_err *err);

    /* "usbip:127.0.0.1:3240" */
    void (*endpoint)(const void *backend, char *buf, size_t len);

    /* Fills descriptors to wait for (room for USB_BACKEND_MAX_FDS) and returns how many. */
    int (*prepare)(void *backend, struct pollfd *fds);

    /* To be called after poll(2) on exactly these descriptors. Carries out what the host has sent. After each of the
     * host's acts it asks owner->go_on, and stops where that is 0. The rest waits for the next call. Then `more`
     * returns 1, so the owner calls again even if no descriptor is ready. SH_EIO ends the back end for good. */
    int (*handle)(void *backend, const struct pollfd *fds, int n, const struct usb_owner *owner);
    int (*more)(const void *backend); /* NULL: a descriptor is ready whenever something waits */

    /* Sends what the core has completed, as far as the wire takes it. To be called after usb_device_write and
     * usb_device_read. */
    void (*flush)(void *backend);

    /* Monotonic time, in ns, at which handle() has work though no descriptor is ready; INT64_MAX: never. */
    int64_t (*due_ns)(const void *backend);

    /* Injected faults. `faults`: USB_CAN_… of those that the device core makes and that reach the host through this
     * back end. fault() returns 0, or SH_ESTATE: it can't be done now. */
    uint32_t faults;
    int (*fault)(void *backend, enum usb_fault what);

    /* Unplugs. */
    void (*close)(void *backend);
};

/* NULL for an unknown type. */
const struct usb_backend_ops *usb_backend_ops_get(enum usb_backend_type type);

/* backend_socket.c: opens a listening or (attach) connected socket, which does not block. The path of a Unix socket
 * whose process is gone is taken over. `what` names the socket in errors; name gets "127.0.0.1:3240" or the path. */
int usb_backend_socket(const struct usb_backend_spec *spec, const char *what, int *fd, char *name, size_t len,
                       struct sh_err *err);
/* Returns the next client's descriptor, which does not block; -1: none. reserve: socket_reserve()'s. The owner hears of
 * clients for whom there is no descriptor. */
int usb_backend_accept(int listener, int *reserve, const struct usb_owner *owner);

/* usb_backend_peer notes the address that a socket of usb_backend_socket is connected to. usb_backend_connect connects
 * to that address again, without waiting or looking up names. It returns 0: *fd is connected. EINPROGRESS: once poll(2)
 * finds *fd writable, usb_backend_connect_error says how it went. Any other errno: *fd is -1. */
struct socket_address; /* drivers/socket/socket.h */
void usb_backend_peer(const struct usb_backend_spec *spec, int fd, struct socket_address *out);
int usb_backend_connect(const struct socket_address *to, int *fd);
int usb_backend_connect_error(int fd);
/* To be called before closing. Sends nothing more, and reads what the peer still sends, eight times at most. Ends when
 * the peer has read everything and hung up, or when timeout_ms pass without a byte. Closing with unread requests of the
 * peer would throw away replies on their way. */
void usb_backend_hang_up(int fd, int timeout_ms);

#endif
