/* SPDX-License-Identifier: MIT */
#include "drivers/usb/retry.h"

#include <stdio.h>

#include "core/monotonic.h"

void usb_retry_init(struct usb_retry *retry, int pace_ms)
{
    *retry = (struct usb_retry){.pace_ms = pace_ms > 0 ? pace_ms : USB_RETRY_MS, .due_ns = INT64_MAX};
}

static void wait_a_pace(struct usb_retry *retry)
{
    retry->due_ns = monotonic_ns() + (int64_t)retry->pace_ms * 1000000;
}

void usb_retry_start(struct usb_retry *retry, const struct usb_owner *owner)
{
    retry->reported = 0;
    owner->say(owner->ctx, "the host has detached the device; it will plug itself in again");
    wait_a_pace(retry);
}

int usb_retry_is_due(struct usb_retry *retry)
{
    if (retry->due_ns > monotonic_ns()) return 0;
    wait_a_pace(retry);
    return 1;
}

void usb_retry_failed(struct usb_retry *retry, const char *why, const struct usb_owner *owner)
{
    char text[200];
    snprintf(text, sizeof text, "not plugged in, will try again: %s", why);
    if (!retry->reported) owner->say(owner->ctx, text);
    retry->reported = 1;
}

void usb_retry_done(struct usb_retry *retry, const struct usb_owner *owner)
{
    owner->say(owner->ctx, "plugged in again");
    retry->due_ns = INT64_MAX;
}
