/* SPDX-License-Identifier: MIT */
/* The console of a gadget: the kernel's f_acm, whose other end is /dev/ttyGSn. */
#include <errno.h>
#include <fcntl.h>
#include <linux/usb/cdc.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include "core/bytes.h"
#include "core/monotonic.h"
#include "drivers/protocol/native_encode.h"
#include "drivers/usb/functionfs_private.h"
#include "drivers/usb/head_device.h"

enum { LOOK_EVERY_NS = 1000000000 };

static void tty_path(const struct ffs_console *console, char *path, size_t len)
{
    snprintf(path, len, "/dev/ttyGS%d", console->number);
}

int ffs_console_open(struct ffs_console *console, struct usb_device *device, int number, struct sh_err *err)
{
    char path[32];
    memset(console, 0, sizeof *console);
    console->device = device;
    console->number = number;
    console->fd = -1;
    console->look_ns = INT64_MAX;
    if (number < 0) return SH_OK;
    tty_path(console, path, sizeof path);
    if (access(path, R_OK | W_OK) != 0)
        return sh_fail(err, errno == EACCES ? SH_EPERM : SH_EIO, "functionfs: console %s: %s%s", path, strerror(errno),
                       errno == ENOENT ? "; is devtmpfs mounted on /dev?" : "");
    return SH_OK;
}

/* Opens or closes the session as a host's driver does by DTR, which the kernel's function does not report. */
static void set_session(struct ffs_console *console, int open)
{
    struct usb_ctrlrequest setup = {.bRequestType = USB_DIR_OUT | USB_TYPE_CLASS | USB_RECIP_INTERFACE,
                                    .bRequest = USB_CDC_REQ_SET_CONTROL_LINE_STATE};
    le_put16(&setup.wValue, (uint16_t)open);
    le_put16(&setup.wIndex, CONSOLE_INTERFACE);
    if (usb_device_control(console->device, &setup, NULL, 0) == 0) console->session = open;
}

static void offer_tx(struct ffs_console *console)
{
    if (console->tx_at_core) return;
    console->tx_at_core = 1;
    console->tx = (struct usb_transfer){
        .id = 1, .endpoint = CONSOLE_IN, .length = sizeof console->tx_bytes, .data = console->tx_bytes};
    usb_device_submit(console->device, &console->tx);
}

/* The tty passes its bytes on in up to 16 requests, one per write. Only when these are used up does its buffer
 * fill and show that nobody takes the bytes. So a small amount is written in many pieces. */
static void write_tx(struct ffs_console *console)
{
    if (console->lead_pos < console->lead_len) {
        ssize_t n = write(console->fd, console->lead + console->lead_pos, console->lead_len - console->lead_pos);
        if (n > 0) console->lead_pos += (uint32_t)n;
        if (n > 0) console->written += (uint64_t)n;
        if (console->lead_pos < console->lead_len) return;
    }
    enum { REQUESTS = 16, MUCH = 1024 };
    const uint32_t piece = console->tx_len < MUCH ? console->tx_len / (REQUESTS + 4) + 1 : console->tx_len;
    while (console->tx_pos < console->tx_len) {
        const uint32_t left = console->tx_len - console->tx_pos;
        ssize_t n = write(console->fd, console->tx_bytes + console->tx_pos, left < piece ? left : piece);
        if (n <= 0) return;
        console->tx_pos += (uint32_t)n;
        console->written += (uint64_t)n;
    }
    offer_tx(console);
}

/* Called every second. If bytes wait and the host has taken none of them since the last call, the host's port counts as
 * closed. Bytes that are not in the tty yet are then dropped. */
static void look_at_host(struct ffs_console *console)
{
    int waiting = 0;
    console->look_ns = monotonic_ns() + LOOK_EVERY_NS;
    if (ioctl(console->fd, TIOCOUTQ, &waiting) != 0) return;
    const uint64_t taken = console->written - (uint64_t)waiting;
    const int stuck = taken == console->taken && (waiting > 0 || console->tx_pos < console->tx_len);
    console->taken = taken;
    if (!stuck || !console->session) return;
    console->tx_pos = console->tx_len;
    console->lead_len = console->lead_pos = 0;
    console->cut = 1;
    set_session(console, 0);
    offer_tx(console);
}

/* Sends an event frame before the replies of a new session of the native protocol. The tty may still hold half a stream
 * frame of the session before, and after half a frame a reader takes text only once a whole one has come (LOSSES.md,
 * Resynchronisation). */
static void lead_in(struct ffs_console *console)
{
    const struct native_event event = {.code = NATIVE_EV_READER_LOST, .text = "the end of an earlier session"};
    console->cut = 0;
    console->lead_pos = 0;
    console->lead_len = (uint32_t)native_encode_event(console->lead, sizeof console->lead, &event, 0, NATIVE_LOCAL);
    write_tx(console);
}

void ffs_console_start(struct ffs_console *console)
{
    char path[32];
    struct termios raw;
    if (console->number < 0) return;
    tty_path(console, path, sizeof path);
    if (console->fd < 0) console->fd = open(path, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (console->fd < 0) return; /* ffs_console_open has checked the tty, and reported an error */
    if (tcgetattr(console->fd, &raw) == 0) {
        cfmakeraw(&raw);
        tcsetattr(console->fd, TCSANOW, &raw);
    }
    console->tx_len = console->tx_pos = console->lead_len = console->lead_pos = 0;
    console->written = console->taken = 0;
    console->cut = 0;
    console->look_ns = monotonic_ns() + LOOK_EVERY_NS;
    offer_tx(console);
}

/* To be called once the device is no longer configured: before that, close would wait for the host to read. */
void ffs_console_stop(struct ffs_console *console)
{
    if (console->fd >= 0) close(console->fd);
    console->fd = -1;
    console->session = 0;
    console->look_ns = INT64_MAX;
}

short ffs_console_events(const struct ffs_console *console)
{
    return (short)((console->rx_busy ? 0 : POLLIN) |
                   (console->tx_pos < console->tx_len || console->lead_pos < console->lead_len ? POLLOUT : 0));
}

static void read_rx(struct ffs_console *console)
{
    ssize_t n = read(console->fd, console->rx_bytes, sizeof console->rx_bytes);
    if (n <= 0) return;
    if (!console->session) {
        set_session(console, 1);
        if (console->cut && usb_facts(console->device)->model == &scanhead_usb_model) lead_in(console);
    }
    console->rx_busy = 1;
    console->rx =
        (struct usb_transfer){.id = 2, .endpoint = CONSOLE_OUT, .length = (uint32_t)n, .data = console->rx_bytes};
    usb_device_submit(console->device, &console->rx);
}

void ffs_console_handle(struct ffs_console *console, short revents)
{
    if (console->fd < 0) return;
    if ((revents & POLLIN) != 0 && !console->rx_busy) read_rx(console);
    if ((revents & POLLOUT) != 0) write_tx(console);
    if (monotonic_ns() >= console->look_ns) look_at_host(console);
}

int ffs_console_complete(struct ffs_console *console, struct usb_transfer *transfer)
{
    if (transfer == &console->rx) {
        console->rx_busy = 0;
        return 1;
    }
    if (transfer != &console->tx) return 0;
    console->tx_at_core = 0;
    if (transfer->status != USB_OK || console->fd < 0) return 1;
    console->tx_len = transfer->actual;
    console->tx_pos = 0;
    write_tx(console);
    return 1;
}
