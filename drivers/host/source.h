/* SPDX-License-Identifier: MIT */
/* Where a handle's bytes come from: a descriptor, a device on USB, a captured file, or a head in this process. Private
 * to libscanhead.
 *
 * In: the name of a source. Out: its bytes, without blocking, and waits with a deadline. */
#ifndef DRIVERS_HOST_SOURCE_H
#define DRIVERS_HOST_SOURCE_H

#include <stdint.h>
#include <sys/types.h>

#include "core/err.h"

/* A kind of source: functions that move bytes without blocking. Descriptors, USB, captured files and a head in this
 * process have such a table each. */
struct host_source;
struct scanhead;
struct host_source_ops {
    /* read and write return the bytes moved, or -1 with errno, which is EAGAIN when none can be moved now. read returns
     * 0 at the end. */
    ssize_t (*read)(struct host_source *source, void *to, size_t len);
    /* In place of read: sets *bytes to whole frames and reply lines, as native_parser_lend() needs them. NULL: there is
     * only read. Returns as read does. The bytes stay until the next call of wait or close. */
    ssize_t (*lend)(struct host_source *source, const uint8_t **bytes);
    /* NULL where the source is a file: nothing is written to it. */
    ssize_t (*write)(struct host_source *source, const void *data, size_t len);
    /* poll() for POLLIN and POLLOUT until the deadline (host_deadline_ns): 1, 0 when it is over, -1 with
     * errno. */
    int (*wait)(struct host_source *source, short events, int64_t deadline_ns, short *revents);
    void (*close)(struct host_source *source);
};

struct host_source {
    const struct host_source_ops *ops;
    int fd;
    struct host_usb *usb;
    struct host_capture *capture; /* of a .pcapng; else NULL */
    void *ctx;                    /* of host_open()'s caller */
    int is_file, is_socket;
    int was_blocking; /* "fd:N": the caller's open file description was, and is again after close */
    int unsettled;    /* lines may come that answer no command of ours: on a new terminal, after a time-out */
    int asked;        /* *IDN? without an answer yet: sent to skip such lines, or by a command that was given up */
    char name[4112];  /* for messages, and to open it again: a path (PATH_MAX) after "tty:" */
};

/* host.c: a handle with a source that the caller has opened. NULL: no memory, and the source is still the caller's. */
struct scanhead *host_open(const struct host_source *source);
/* Closes the source. The handle gives nothing more, but keeps its state and counts. */
void host_hang_up(struct scanhead *sh);

/* Opens what `source` names. Reading and writing it don't block; opening waits up to 10 s for a TCP connection. */
int host_source_open(const char *source, struct host_source *out, struct sh_err *err);
int host_source_is_usb(const char *source);
/* usb_transfers.c: the same for "usb...". host_source_open() has set out's name, its fd to -1, and the rest to 0. */
int host_usb_open(const char *source, struct host_source *out, struct sh_err *err);
extern const struct host_source_ops host_fd_ops;
/* io.c: waits as host_source_ops.wait does, on the source's descriptor. */
int host_fd_wait(struct host_source *source, short events, int64_t deadline_ns, short *revents);
/* capture.c: source is an open .pcapng file. Where it fails, the descriptor is still the caller's. */
int host_capture_open(struct host_source *source, struct sh_err *err);

/* usb_watch.c: waits between two tries to open a source. NULL where a source is not on USB, or where the
 * system does not report devices that come: then the waits are short. Devices that come after this call are
 * not missed. */
struct host_usb_watch *host_usb_watch_open(const char *source);
void host_usb_watch_close(struct host_usb_watch *watch);
/* Waits before the next try. rc: why the last one failed. Returns 0: try again, or the deadline is over; -1: a signal
 * came. */
int host_usb_watch_wait(struct host_usb_watch *watch, int rc, int64_t deadline_ns);

/* Returns the time at which timeout_ms from now are over, in ns of the monotonic clock; INT64_MAX for a negative
 * timeout. */
int64_t host_deadline_ns(int timeout_ms);

#endif
