/* SPDX-License-Identifier: MIT */
/* The functionfs back end's own parts: endpoints with asynchronous I/O, and the console over the kernel's
 * tty. Private. */
#ifndef DRIVERS_USB_FUNCTIONFS_PRIVATE_H
#define DRIVERS_USB_FUNCTIONFS_PRIVATE_H

#include <linux/aio_abi.h>
#include <poll.h>

#include "drivers/usb/gadget.h"
#include "drivers/usb/usb.h"

enum { FFS_SLOTS = 8, FFS_SLOT_BYTES = 32768, FFS_MAX_PIPES = 8, FFS_MAX_FAILURES = 16 };

/* A slot is a buffer that goes back and forth between core and kernel. IN: it waits at the core as if a host
 * had asked for that much, is filled, and is written to the kernel. OUT: it is read from the kernel, and waits
 * at the core until the function has read it. On an endpoint that is down the kernel gives the buffer back at once;
 * then it is idle until the next configuration comes up. */
enum ffs_slot_state { FFS_IDLE, FFS_AT_CORE, FFS_AT_KERNEL };

struct ffs_slot {
    struct usb_transfer transfer;
    struct ffs_pipe *pipe;
    enum ffs_slot_state state;
    struct iocb io, zero; /* zero: the packet of no bytes after it */
    int n_io;             /* of these, at the kernel */
    uint32_t start;       /* pipes->start when they were submitted */
    int failures;         /* in a row */
    uint8_t *buffer;
};

struct ffs_pipe {
    int fd;
    uint8_t address; /* of the model */
    uint32_t epoch;  /* of what is at the kernel */
    struct ffs_slot slot[FFS_SLOTS];
};

struct ffs_pipes {
    struct usb_device *device;
    aio_context_t aio;
    int event_fd; /* counts completions */
    int running;
    uint32_t start; /* counts ffs_pipes_start */
    int n;
    struct ffs_pipe pipe[FFS_MAX_PIPES];
};

/* Opens the endpoints of gadget->part, in the order of its descriptors. */
int ffs_pipes_open(struct ffs_pipes *pipes, struct usb_device *device, const struct gadget *gadget, struct sh_err *err);
/* The configuration has come up: puts all slots to use. */
void ffs_pipes_start(struct ffs_pipes *pipes);
/* The configuration is over: slots that the kernel gives back stay idle. */
void ffs_pipes_stop(struct ffs_pipes *pipes);
/* Takes one completion; 0: there is none. */
int ffs_pipes_take(struct ffs_pipes *pipes);
/* Takes back what was handed to the kernel in a session that is over, so that the next one does not get it. */
void ffs_pipes_withdraw(struct ffs_pipes *pipes);
/* The core gives a transfer of a slot back. */
void ffs_pipes_complete(struct ffs_pipes *pipes, struct usb_transfer *transfer);
/* Waits until the host has taken what is at the kernel, as long as it takes something within timeout_ms. */
void ffs_pipes_drain(struct ffs_pipes *pipes, int timeout_ms);
void ffs_pipes_close(struct ffs_pipes *pipes);
/* Finds the first endpoint whose address the controller has changed. Returns its address in the model, and sets *given
 * to the address that the controller gave. 0: there is none, or the controller does not say. To be called while a
 * configuration is up. */
uint8_t ffs_pipes_moved(const struct ffs_pipes *pipes, uint8_t *given);
/* Returns the model's address of an endpoint by its number in FunctionFS, counted from 1; 0 where there is none. */
uint8_t ffs_pipes_address(const struct ffs_pipes *pipes, unsigned number);

/* The console. The kernel's f_acm does not report DTR. So a session begins with the first bytes of the host,
 * and ends when the host has taken none of the waiting bytes for one or two seconds. Bytes that the tty then still
 * holds can't be taken back, and may end within a stream frame. The next reader gets these bytes first, then an event
 * frame, from which on it reads frames and replies correctly. */
struct ffs_console {
    struct usb_device *device;
    int fd;          /* of the tty; -1: not plugged in, or no console */
    int64_t look_ns; /* monotonic time of the next look at the host; INT64_MAX: none */
    int number;
    int rx_busy, tx_at_core, session;
    uint32_t tx_len, tx_pos;
    int cut; /* a session was given up; the tty holds the rest of it */
    uint32_t lead_len, lead_pos;
    uint8_t lead[256];       /* the event frame; it goes before everything else */
    uint64_t written, taken; /* bytes written to the tty; how many of them had left its buffer at the last look */
    struct usb_transfer rx, tx;
    uint8_t rx_bytes[4096], tx_bytes[4096];
};

/* number: of the tty, -1 for none. Fails where the tty can't be used. */
int ffs_console_open(struct ffs_console *console, struct usb_device *device, int number, struct sh_err *err);
/* The configuration has come up: opens the tty. */
void ffs_console_start(struct ffs_console *console);
/* Closes the tty, and ends the session. */
void ffs_console_stop(struct ffs_console *console);
/* Returns the events of poll(2) to wait for on fd. */
short ffs_console_events(const struct ffs_console *console);
/* Moves bytes between the tty and the core, and looks at the host when it is time. */
void ffs_console_handle(struct ffs_console *console, short revents);
/* The core gives a transfer back. Returns 0: it is not one of the console. */
int ffs_console_complete(struct ffs_console *console, struct usb_transfer *transfer);

/* ---- the back end */

enum { FFS_MAX_DATA_STAGE = 4096 };

struct functionfs {
    struct usb_device *device;
    struct gadget gadget;
    int ep0;                       /* -1: nothing of the device is FunctionFS's */
    int has_said_moved;            /* some endpoint has another address than the device's */
    const struct usb_owner *owner; /* within handle() */
    char udc[256];                 /* the controller; stays the same, so that other threads may read it */
    int unplugged;                 /* by an injected fault */
    int backlog;                   /* stopped before everything was looked at */
    struct ffs_pipes pipes;
    struct ffs_console console;
    uint8_t data[FFS_MAX_DATA_STAGE];
};

#endif
