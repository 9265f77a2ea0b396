/* SPDX-License-Identifier: MIT */
/* Endpoints of FunctionFS. write(2) on them blocks until the host has taken the data, so they are driven by
 * the kernel's asynchronous I/O, whose completions an eventfd counts. glibc has no wrappers for these calls. */
#include <errno.h>
#include <fcntl.h>
#include <linux/usb/functionfs.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/ioctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "drivers/usb/functionfs_private.h"

static int is_in(const struct ffs_pipe *pipe)
{
    return (pipe->address & USB_DIR_IN) != 0;
}

static int open_pipe(struct ffs_pipe *pipe, const struct gadget *gadget, int number, uint8_t address,
                     struct sh_err *err)
{
    char path[96];
    snprintf(path, sizeof path, "%s/ep%d", gadget->mount, number);
    pipe->address = address;
    pipe->fd = open(path, O_RDWR | O_NONBLOCK | O_CLOEXEC);
    if (pipe->fd < 0) return sh_fail(err, SH_EIO, "functionfs: %s: %s", path, strerror(errno));
    for (int i = 0; i < FFS_SLOTS; i++) {
        pipe->slot[i].pipe = pipe;
        pipe->slot[i].buffer = malloc(FFS_SLOT_BYTES);
        if (pipe->slot[i].buffer == NULL) return sh_fail(err, SH_ENOMEM, "functionfs: no memory");
    }
    return SH_OK;
}

int ffs_pipes_open(struct ffs_pipes *pipes, struct usb_device *device, const struct gadget *gadget, struct sh_err *err)
{
    memset(pipes, 0, sizeof *pipes);
    pipes->device = device;
    pipes->event_fd = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    if (pipes->event_fd < 0) return sh_fail(err, SH_EIO, "functionfs: eventfd: %s", strerror(errno));
    int rc = SH_OK;
    if (syscall(SYS_io_setup, 2 * FFS_SLOTS * FFS_MAX_PIPES, &pipes->aio) != 0)
        rc = sh_fail(err, SH_EIO, "functionfs: asynchronous I/O: %s%s", strerror(errno),
                     errno == EAGAIN ? "; see /proc/sys/fs/aio-max-nr" : "");
    for (unsigned i = 0; i < gadget->part.n_interfaces && rc == SH_OK; i++)
        for (unsigned k = 0; k < gadget->row[i].n_endpoints && rc == SH_OK; k++) {
            if (pipes->n == FFS_MAX_PIPES) {
                rc = sh_fail(err, SH_EINPUT, "functionfs: too many endpoints; allowed are up to %d", FFS_MAX_PIPES);
                break;
            }
            struct ffs_pipe *pipe = &pipes->pipe[pipes->n++];
            rc = open_pipe(pipe, gadget, pipes->n, gadget->row[i].endpoint[k].address, err);
        }
    if (rc != SH_OK) ffs_pipes_close(pipes);
    return rc;
}

static int submit(struct ffs_pipes *pipes, struct ffs_pipe *pipe, struct ffs_slot *slot, struct iocb *io, size_t len)
{
    *io = (struct iocb){.aio_data = (uint64_t)(uintptr_t)slot,
                        .aio_lio_opcode = is_in(pipe) ? IOCB_CMD_PWRITE : IOCB_CMD_PREAD,
                        .aio_fildes = (uint32_t)pipe->fd,
                        .aio_buf = (uint64_t)(uintptr_t)slot->buffer,
                        .aio_nbytes = len,
                        .aio_flags = IOCB_FLAG_RESFD,
                        .aio_resfd = (uint32_t)pipes->event_fd};
    if (syscall(SYS_io_submit, pipes->aio, 1L, &io) != 1)
        return 0; /* the endpoint has gone down; it will come up again */
    slot->n_io++;
    return 1;
}

static void to_core(struct ffs_pipes *pipes, struct ffs_pipe *pipe, struct ffs_slot *slot, uint32_t length)
{
    slot->state = FFS_AT_CORE;
    slot->transfer = (struct usb_transfer){
        .id = (uint64_t)(uintptr_t)slot, .endpoint = pipe->address, .length = length, .data = slot->buffer};
    usb_device_submit(pipes->device, &slot->transfer);
}

static void to_kernel(struct ffs_pipes *pipes, struct ffs_pipe *pipe, struct ffs_slot *slot)
{
    const int in = is_in(pipe);
    slot->state = FFS_AT_KERNEL;
    slot->start = pipes->start;
    submit(pipes, pipe, slot, &slot->io, in ? slot->transfer.actual : FFS_SLOT_BYTES);
    if (in && slot->n_io != 0 && slot->transfer.zero_packet) submit(pipes, pipe, slot, &slot->zero, 0);
    if (slot->n_io == 0) slot->state = FFS_IDLE;
}

static void set_going(struct ffs_pipes *pipes, struct ffs_pipe *pipe, struct ffs_slot *slot)
{
    slot->state = FFS_IDLE;
    if (!pipes->running) return;
    if (is_in(pipe))
        to_core(pipes, pipe, slot, FFS_SLOT_BYTES);
    else
        to_kernel(pipes, pipe, slot);
}

void ffs_pipes_start(struct ffs_pipes *pipes)
{
    pipes->running = 1;
    pipes->start++;
    for (int i = 0; i < pipes->n; i++) {
        struct ffs_pipe *pipe = &pipes->pipe[i];
        pipe->epoch = usb_device_epoch(pipes->device, pipe->address);
        for (int k = 0; k < FFS_SLOTS; k++) {
            pipe->slot[k].failures = 0;
            if (pipe->slot[k].state == FFS_IDLE) set_going(pipes, pipe, &pipe->slot[k]);
        }
    }
}

void ffs_pipes_stop(struct ffs_pipes *pipes)
{
    pipes->running = 0;
}

void ffs_pipes_complete(struct ffs_pipes *pipes, struct usb_transfer *transfer)
{
    struct ffs_slot *slot = (struct ffs_slot *)transfer;
    slot->state = FFS_IDLE;
    if (transfer->status == USB_OK && pipes->running) to_kernel(pipes, slot->pipe, slot);
}

/* Whether a slot that the kernel gave back unused has to rest. On an endpoint that is down the kernel would give it
 * back at once again. A slot from before the present start says nothing about the endpoint. After a failure for
 * another reason the slot is used again, unless FFS_MAX_FAILURES come in a row. */
static int has_to_rest(const struct ffs_pipes *pipes, struct ffs_slot *slot, int64_t result)
{
    const int is_down = result == -EAGAIN || result == -ESHUTDOWN || result == -ENODEV;
    if (slot->start != pipes->start) return 0;
    return is_down || ++slot->failures >= FFS_MAX_FAILURES;
}

int ffs_pipes_take(struct ffs_pipes *pipes)
{
    struct io_event event;
    struct timespec now = {0, 0};
    uint64_t count;
    if (read(pipes->event_fd, &count, sizeof count) < 0 && errno != EAGAIN) return 0;
    if (syscall(SYS_io_getevents, pipes->aio, 1L, 1L, &event, &now) != 1) return 0;
    struct ffs_slot *slot = (struct ffs_slot *)(uintptr_t)event.data;
    struct ffs_pipe *pipe = slot->pipe;
    if (--slot->n_io > 0) return 1; /* its zero-length packet is still on the way */
    if (event.res >= 0) slot->failures = 0;
    if (event.res < 0 && has_to_rest(pipes, slot, event.res))
        slot->state = FFS_IDLE;
    else if (!is_in(pipe) && event.res >= 0 && pipes->running)
        to_core(pipes, pipe, slot, (uint32_t)event.res);
    else
        set_going(pipes, pipe, slot);
    return 1;
}

void ffs_pipes_withdraw(struct ffs_pipes *pipes)
{
    struct io_event event;
    for (int i = 0; i < pipes->n; i++) {
        struct ffs_pipe *pipe = &pipes->pipe[i];
        const uint32_t epoch = usb_device_epoch(pipes->device, pipe->address);
        if (!is_in(pipe) || pipe->epoch == epoch) continue;
        pipe->epoch = epoch;
        for (int k = 0; k < FFS_SLOTS; k++) {
            struct ffs_slot *slot = &pipe->slot[k];
            if (slot->n_io == 0) continue;
            syscall(SYS_io_cancel, pipes->aio, &slot->io, &event);
            if (slot->n_io > 1) syscall(SYS_io_cancel, pipes->aio, &slot->zero, &event);
        }
    }
}

static int is_under_way(const struct ffs_pipes *pipes)
{
    for (int i = 0; i < pipes->n; i++)
        for (int k = 0; k < FFS_SLOTS && is_in(&pipes->pipe[i]); k++)
            if (pipes->pipe[i].slot[k].n_io > 0) return 1;
    return 0;
}

void ffs_pipes_drain(struct ffs_pipes *pipes, int timeout_ms)
{
    struct pollfd slot = {.fd = pipes->event_fd, .events = POLLIN};
    ffs_pipes_stop(pipes);
    while (is_under_way(pipes) && poll(&slot, 1, timeout_ms) > 0)
        while (ffs_pipes_take(pipes))
            continue;
}

uint8_t ffs_pipes_moved(const struct ffs_pipes *pipes, uint8_t *given)
{
    for (int i = 0; i < pipes->n; i++) {
        struct usb_endpoint_descriptor descriptor;
        const struct ffs_pipe *pipe = &pipes->pipe[i];
        if (ioctl(pipe->fd, FUNCTIONFS_ENDPOINT_DESC, &descriptor) != 0) continue;
        *given = descriptor.bEndpointAddress;
        if (*given != pipe->address) return pipe->address;
    }
    return 0;
}

uint8_t ffs_pipes_address(const struct ffs_pipes *pipes, unsigned number)
{
    return number >= 1 && number <= (unsigned)pipes->n ? pipes->pipe[number - 1].address : 0;
}

void ffs_pipes_close(struct ffs_pipes *pipes)
{
    if (pipes->aio != 0) syscall(SYS_io_destroy, pipes->aio); /* takes back what is at the kernel */
    for (int i = 0; i < pipes->n; i++) {
        if (pipes->pipe[i].fd >= 0) close(pipes->pipe[i].fd);
        for (int k = 0; k < FFS_SLOTS; k++)
            free(pipes->pipe[i].slot[k].buffer);
    }
    if (pipes->event_fd >= 0) close(pipes->event_fd);
    memset(pipes, 0, sizeof *pipes);
    pipes->event_fd = -1;
}
