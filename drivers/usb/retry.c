/* SPDX-License-Identifier: MIT */
#include "drivers/usb/retry.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/timerfd.h>
#include <unistd.h>

static int set_timer(struct usb_retry *retry, int ms)
{
    const struct timespec t = {ms / 1000, (long)(ms % 1000) * 1000000};
    const struct itimerspec every = {t, t};
    return timerfd_settime(retry->timer, 0, &every, NULL) == 0 ? SH_OK : SH_EIO;
}

int usb_retry_open(struct usb_retry *retry, const char *what, int pace_ms, struct sh_err *err)
{
    *retry = (struct usb_retry){.pace_ms = pace_ms > 0 ? pace_ms : USB_RETRY_MS};
    retry->timer = timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC);
    return retry->timer >= 0 ? SH_OK : sh_fail(err, SH_EIO, "%s: timerfd: %s", what, strerror(errno));
}

void usb_retry_close(struct usb_retry *retry)
{
    if (retry->timer >= 0) close(retry->timer);
    retry->timer = -1;
}

int usb_retry_start(struct usb_retry *retry, const struct usb_owner *owner)
{
    retry->reported = 0;
    owner->say(owner->ctx, "the host has detached the device; it will plug itself in again");
    return set_timer(retry, retry->pace_ms);
}

int usb_retry_is_due(struct usb_retry *retry, short revents)
{
    uint64_t count;
    return revents != 0 && read(retry->timer, &count, sizeof count) == sizeof count;
}

void usb_retry_failed(struct usb_retry *retry, const char *why, const struct usb_owner *owner)
{
    char text[200];
    snprintf(text, sizeof text, "not plugged in, will try again: %s", why);
    if (!retry->reported) owner->say(owner->ctx, text);
    retry->reported = 1;
}

int usb_retry_done(struct usb_retry *retry, const struct usb_owner *owner)
{
    owner->say(owner->ctx, "plugged in again");
    return set_timer(retry, 0);
}
