/* SPDX-License-Identifier: MIT */
/* A source of bytes: the bulk endpoints of the head's vendor interface.
 *
 * Several reads are always under way, so that the bus never waits for this program. The reads are a ring of transfers,
 * which the kernel completes in order, and which are read and submitted again in order. There is no
 * thread: completions are taken in while the caller reads or waits, and between these calls the kernel fills
 * the transfers under way. */
#include "drivers/host/usb_inside.h"

#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/* A read is a multiple of every packet size (64, 512, 1024 bytes), so no packet is longer than the room that is
 * left. */
enum { IN_TRANSFERS = 16, IN_BYTES = 64 << 10, OUT_BYTES = 2048, CANCEL_MS = 1000 };
/* After FAILING_MS of failures the device counts as unplugged: transfers fail until the hub notices an unplug. */
enum { FAILING_MS = 1000, FAILING_PAUSE_MS = 20, RELAPSE_MS = 10000 };

struct in_transfer {
    struct libusb_transfer *transfer;
    int flying;
    int error;   /* errno of why it could not be sent off */
    size_t used; /* bytes that were read out of it */
};

struct failing {
    int n;              /* failures since something got through, or since RELAPSE_MS without one */
    int64_t give_up_ns; /* FAILING_MS after the first of them */
    int64_t relapse_ns; /* RELAPSE_MS after the last of them */
};

struct host_usb {
    libusb_context *ctx;
    struct usb_found head;
    struct in_transfer in[IN_TRANSFERS];
    int n_in, next; /* how many; the one to read from next */
    struct failing in_failing, out_failing;
    struct libusb_transfer *out;
    int out_flying, out_error; /* errno of the write before */
    uint8_t *in_data, out_data[OUT_BYTES];
};

static void LIBUSB_CALL in_done(struct libusb_transfer *transfer)
{
    ((struct in_transfer *)transfer->user_data)->flying = 0;
}

static int errno_of_status(enum libusb_transfer_status status)
{
    if (status == LIBUSB_TRANSFER_COMPLETED) return 0;
    if (status == LIBUSB_TRANSFER_NO_DEVICE) return ENODEV;
    if (status == LIBUSB_TRANSFER_CANCELLED) return ECANCELED;
    return status == LIBUSB_TRANSFER_TIMED_OUT ? ETIMEDOUT : EPROTO;
}

static void LIBUSB_CALL out_done(struct libusb_transfer *transfer)
{
    struct host_usb *usb = transfer->user_data;
    usb->out_flying = 0;
    usb->out_error = errno_of_status(transfer->status);
    if (usb->out_error == 0) usb->out_failing.n = 0;
}

/* Returns the errno for the result of a request. EPROTO: another try may succeed. */
static int errno_of_rc(int rc)
{
    return rc == 0 ? 0 : rc == LIBUSB_ERROR_NO_DEVICE ? ENODEV : EPROTO;
}

/* Takes in the transfers that have ended, waiting for at most timeout_ns. */
static int handle_events(struct host_usb *usb, int64_t timeout_ns)
{
    struct timeval wait = {.tv_sec = timeout_ns / 1000000000, .tv_usec = timeout_ns % 1000000000 / 1000};
    int rc = libusb_handle_events_timeout_completed(usb->ctx, &wait, NULL);
    if (rc == 0) return 0;
    errno = rc == LIBUSB_ERROR_INTERRUPTED ? EINTR : EIO;
    return -1;
}

static int count_reads(const struct host_usb *usb)
{
    int n = 0;
    for (int i = 0; i < usb->n_in; i++)
        n += usb->in[i].flying;
    return n;
}

/* Takes back the reads that are under way and, with_write, the write. Bytes that came in until then can still be
 * read. */
static void cancel(struct host_usb *usb, int with_write)
{
    for (int i = 0; i < usb->n_in; i++)
        if (usb->in[i].flying) libusb_cancel_transfer(usb->in[i].transfer);
    if (with_write && usb->out_flying) libusb_cancel_transfer(usb->out);
    const int64_t deadline_ns = host_deadline_ns(CANCEL_MS);
    while ((count_reads(usb) > 0 || (with_write && usb->out_flying)) && host_deadline_ns(0) < deadline_ns)
        handle_events(usb, 10000000);
}

static int submit(struct in_transfer *in)
{
    in->used = 0;
    in->transfer->actual_length = 0;
    int rc = libusb_submit_transfer(in->transfer);
    in->flying = rc == 0;
    in->error = errno_of_rc(rc);
    return rc;
}

/* Starts an endpoint again that has stalled, or whose last transfer was garbled on the bus. A device that is being
 * unplugged looks the same until the hub has noticed. So the second and later tries wait a moment. Returns 0: another
 * transfer may succeed; ENODEV: the device is gone, or no transfer has succeeded for too long. */
static int recover(struct host_usb *usb, struct failing *failing, uint8_t endpoint)
{
    const struct timespec pause = {.tv_nsec = FAILING_PAUSE_MS * 1000000};
    const int64_t now_ns = host_deadline_ns(0);
    if (failing->n > 0 && now_ns > failing->relapse_ns) failing->n = 0;
    if (failing->n++ == 0)
        failing->give_up_ns = host_deadline_ns(FAILING_MS);
    else if (now_ns > failing->give_up_ns)
        return ENODEV;
    else
        nanosleep(&pause, NULL);
    const int rc = libusb_clear_halt(usb->head.handle, endpoint);
    failing->relapse_ns = host_deadline_ns(RELAPSE_MS);
    return rc == LIBUSB_ERROR_NO_DEVICE ? ENODEV : 0;
}

/* The same for the reads: all are taken back first. Reads that failed along with this one count as cancelled, so that
 * they don't start the endpoint again. */
static int recover_reads(struct host_usb *usb)
{
    cancel(usb, 0);
    for (int i = 0; i < usb->n_in; i++) {
        struct in_transfer *in = &usb->in[i];
        if (!in->flying && errno_of_status(in->transfer->status) == EPROTO)
            in->transfer->status = LIBUSB_TRANSFER_CANCELLED;
        if (in->error == EPROTO) in->error = ECANCELED;
    }
    return recover(usb, &usb->in_failing, usb->head.interface.in);
}

/* The kernel ends transfers alike when a device goes and when another program or the system resets its bus. After a
 * reset the device still answers. */
static int gone_or_reset(struct host_usb *usb)
{
    uint8_t status[2];
    const uint8_t type = (uint8_t)LIBUSB_REQUEST_TYPE_STANDARD | LIBUSB_RECIPIENT_DEVICE | LIBUSB_ENDPOINT_IN;
    const int n = libusb_control_transfer(usb->head.handle, type, LIBUSB_REQUEST_GET_STATUS, 0, 0, status,
                                          sizeof status, USB_CONTROL_MS);
    return n == sizeof status ? ECONNRESET : ENODEV;
}

/* After a reset of the bus Linux may end transfers as if each had been answered with no bytes. New transfers are
 * accepted, but wait for ever, since the session is over. So session_is_over asks the head whether the session is open.
 * A head that doesn't know this request stalls it. */
static int session_is_over(struct host_usb *usb)
{
    const uint8_t type = (uint8_t)LIBUSB_REQUEST_TYPE_VENDOR | LIBUSB_RECIPIENT_INTERFACE | LIBUSB_ENDPOINT_IN;
    uint8_t open = 1;
    const int n = libusb_control_transfer(usb->head.handle, type, USB_REQUEST_SESSION, 0, usb->head.interface.number,
                                          &open, sizeof open, USB_CONTROL_MS);
    return n == sizeof open && !open;
}

/* The present transfer is used up: submits it again, and goes on to the next. */
static int usb_transfers_turn(struct host_usb *usb)
{
    struct in_transfer *in = &usb->in[usb->next];
    int error = in->error;
    if (error == 0 && (error = errno_of_status(in->transfer->status)) == ENODEV) error = gone_or_reset(usb);
    if (in->transfer->actual_length > 0)
        usb->in_failing.n = 0;
    else if (error == 0 && session_is_over(usb))
        error = ECONNRESET;
    if (error == EPROTO) error = recover_reads(usb);
    if (error == ENODEV || error == ECONNRESET) {
        in->error = error;
        return error;
    }
    usb->next = (usb->next + 1) % usb->n_in;
    submit(in); /* if it fails, in->error is seen when the ring comes round to it */
    return 0;
}

static ssize_t usb_read(struct host_source *source, void *to, size_t len)
{
    struct host_usb *usb = source->usb;
    int looked = 0;
    for (;;) {
        struct in_transfer *in = &usb->in[usb->next];
        size_t have = in->flying || in->error != 0 ? 0 : (size_t)in->transfer->actual_length - in->used;
        if (have > 0) {
            size_t n = have < len ? have : len;
            memcpy(to, in->transfer->buffer + in->used, n);
            in->used += n;
            return (ssize_t)n;
        }
        int error = 0;
        if (!in->flying)
            error = usb_transfers_turn(usb);
        else if (looked++)
            error = EAGAIN;
        else if (handle_events(usb, 0) != 0)
            error = errno;
        if (error != 0) {
            errno = error;
            return -1;
        }
    }
}

/* A write that failed is not repeated, since the head may have got it. If it has not, the command times out. The next
 * command goes out after the endpoint has been started again. */
static ssize_t usb_write(struct host_source *source, const void *data, size_t len)
{
    struct host_usb *usb = source->usb;
    if (usb->out_flying && handle_events(usb, 0) != 0) return -1;
    int error = usb->out_flying ? EAGAIN : usb->out_error;
    if (error == ENODEV) error = gone_or_reset(usb);
    if (error == EPROTO) error = recover(usb, &usb->out_failing, usb->head.interface.out);
    if (error != 0) {
        errno = error;
        return -1;
    }
    size_t n = len < OUT_BYTES ? len : OUT_BYTES;
    memcpy(usb->out_data, data, n);
    usb->out->length = (int)n;
    usb->out_error = errno_of_rc(libusb_submit_transfer(usb->out));
    usb->out_flying = usb->out_error == 0;
    if (usb->out_flying) return (ssize_t)n;
    errno = usb->out_error == ENODEV ? ENODEV : EAGAIN;
    return -1;
}

static int usb_wait(struct host_source *source, short events, int64_t deadline_ns, short *revents)
{
    struct host_usb *usb = source->usb;
    int64_t left_ns = 0;
    for (;;) {
        if (handle_events(usb, left_ns) != 0) return -1;
        *revents = 0;
        if ((events & POLLIN) && !usb->in[usb->next].flying) *revents |= POLLIN;
        if ((events & POLLOUT) && !usb->out_flying) *revents |= POLLOUT;
        if (*revents != 0) return 1;
        left_ns = deadline_ns == INT64_MAX ? 60000000000 : deadline_ns - host_deadline_ns(0);
        if (left_ns <= 0) return 0;
    }
}

static int session(struct host_usb *usb, int open)
{
    return libusb_control_transfer(
        usb->head.handle, (uint8_t)LIBUSB_REQUEST_TYPE_VENDOR | LIBUSB_RECIPIENT_INTERFACE | LIBUSB_ENDPOINT_OUT,
        USB_REQUEST_SESSION, (uint16_t)open, usb->head.interface.number, NULL, 0, USB_CONTROL_MS);
}

static void usb_free(struct host_usb *usb)
{
    if (usb->head.handle != NULL) libusb_close(usb->head.handle); /* forgets transfers that would not end */
    for (int i = 0; i < IN_TRANSFERS; i++)
        libusb_free_transfer(usb->in[i].transfer);
    libusb_free_transfer(usb->out);
    if (usb->ctx != NULL) libusb_exit(usb->ctx);
    free(usb->in_data);
    free(usb);
}

/* Undoes usb_transfers_begin and submit_all. */
static void usb_end(struct host_usb *usb)
{
    session(usb, 0);
    cancel(usb, 1);
    libusb_release_interface(usb->head.handle, usb->head.interface.number);
}

static void usb_close(struct host_source *source)
{
    usb_end(source->usb);
    usb_free(source->usb);
}

static const struct host_source_ops usb_ops = {
    .read = usb_read, .write = usb_write, .wait = usb_wait, .close = usb_close};

static int make_transfers(struct host_usb *usb, struct sh_err *err)
{
    usb->in_data = malloc((size_t)IN_TRANSFERS * IN_BYTES);
    usb->out = libusb_alloc_transfer(0);
    int missing = usb->in_data == NULL || usb->out == NULL;
    for (int i = 0; i < IN_TRANSFERS && !missing; i++) {
        usb->in[i].transfer = libusb_alloc_transfer(0);
        missing = usb->in[i].transfer == NULL;
        if (!missing)
            libusb_fill_bulk_transfer(usb->in[i].transfer, usb->head.handle, usb->head.interface.in,
                                      usb->in_data + i * IN_BYTES, IN_BYTES, in_done, &usb->in[i], 0);
    }
    if (missing) return sh_fail(err, SH_ENOMEM, "no memory for USB transfers");
    libusb_fill_bulk_transfer(usb->out, usb->head.handle, usb->head.interface.out, usb->out_data, 0, out_done, usb, 0);
    return SH_OK;
}

/* The system limits the bytes under way (usbfs_memory_mb): fewer transfers work, too, but slower. */
static int submit_all(struct host_usb *usb, const char *name, struct sh_err *err)
{
    int rc = 0;
    while (usb->n_in < IN_TRANSFERS && (rc = submit(&usb->in[usb->n_in])) == 0)
        usb->n_in++;
    if (usb->n_in >= 2) return SH_OK;
    return sh_fail(err, SH_EIO, "%s: cannot start reading: %s", name, libusb_strerror(rc));
}

static int usb_transfers_begin(struct host_usb *usb, const char *name, struct sh_err *err)
{
    int rc = libusb_claim_interface(usb->head.handle, usb->head.interface.number);
    if (rc == LIBUSB_ERROR_BUSY)
        return sh_fail(err, SH_EIO, "%s: another program has the head's interface %d", name,
                       usb->head.interface.number);
    if (rc == LIBUSB_ERROR_NO_DEVICE) return sh_fail(err, SH_ELOST, "%s: unplugged while it was opened", name);
    if (rc != 0) return sh_fail(err, SH_EIO, "%s: cannot claim the interface: %s", name, libusb_strerror(rc));
    rc = session(usb, 1);
    if (rc >= 0) return SH_OK;
    libusb_release_interface(usb->head.handle, usb->head.interface.number);
    return sh_fail(err, rc == LIBUSB_ERROR_NO_DEVICE ? SH_ELOST : SH_EIO, "%s: the head does not open the stream: %s",
                   name, libusb_strerror(rc));
}

int host_usb_open(const char *source, struct host_source *out, struct sh_err *err)
{
    struct usb_wanted wanted;
    int rc = host_usb_parse(source, &wanted, err);
    if (rc != SH_OK) return rc;
    struct host_usb *usb = calloc(1, sizeof *usb);
    if (usb == NULL) return sh_fail(err, SH_ENOMEM, "no memory for a USB source");
    int e = libusb_init(&usb->ctx);
    if (e != 0) rc = sh_fail(err, SH_EIO, "%s: no USB on this system: %s", source, libusb_strerror(e));
    if (rc == SH_OK) rc = host_usb_find(usb->ctx, source, &wanted, &usb->head, err);
    if (rc == SH_OK) snprintf(out->name, sizeof out->name, "%s", usb->head.name);
    if (rc == SH_OK) rc = make_transfers(usb, err);
    if (rc == SH_OK) rc = usb_transfers_begin(usb, out->name, err);
    if (rc == SH_OK && (rc = submit_all(usb, out->name, err)) != SH_OK) usb_end(usb);
    if (rc != SH_OK) {
        usb_free(usb);
        return rc;
    }
    out->usb = usb;
    out->ops = &usb_ops;
    return SH_OK;
}
