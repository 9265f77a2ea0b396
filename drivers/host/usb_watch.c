/* SPDX-License-Identifier: MIT */
/* Waits for a head to be plugged in, by the system's hot-plug events where it has them. */
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

#include "drivers/host/usb_inside.h"

/* No event reports a permission that comes late, a configuration that the kernel sets, or another program
 * that closes the device. So tries come every PAUSE_MS for HURRY_MS after a device has come, and as long as a head is
 * there that can't be opened. Else they come every LOOK_MS. Without events of the system, tries always come every
 * PAUSE_MS. */
enum { PAUSE_MS = 50, HURRY_MS = 2000, LOOK_MS = 1000 };

struct host_usb_watch {
    libusb_context *ctx;
    int arrived;
    int64_t hurry_until_ns;
};

static int LIBUSB_CALL on_arrival(libusb_context *ctx, libusb_device *device, libusb_hotplug_event event, void *priv)
{
    (void)ctx, (void)device, (void)event;
    ((struct host_usb_watch *)priv)->arrived = 1;
    return 0;
}

/* Returns whether udev runs. libusb gets events of devices from udev, after udev's rules. Without udev (a container, a
 * small guest) it gets none, and does not know that. */
static int has_events(void)
{
    return libusb_has_capability(LIBUSB_CAP_HAS_HOTPLUG) && access("/run/udev/control", F_OK) == 0;
}

struct host_usb_watch *host_usb_watch_open(const char *source)
{
    struct usb_wanted wanted;
    struct sh_err err;
    if (!host_source_is_usb(source) || !has_events() || host_usb_parse(source, &wanted, &err) != SH_OK) return NULL;
    struct host_usb_watch *watch = calloc(1, sizeof *watch);
    if (watch == NULL || libusb_init(&watch->ctx) != 0) {
        free(watch);
        return NULL;
    }
    _Static_assert(LIBUSB_HOTPLUG_MATCH_ANY == -1, "as in struct usb_wanted");
    if (libusb_hotplug_register_callback(watch->ctx, LIBUSB_HOTPLUG_EVENT_DEVICE_ARRIVED, 0, wanted.vid, wanted.pid,
                                         LIBUSB_HOTPLUG_MATCH_ANY, on_arrival, watch, NULL) == 0)
        return watch;
    host_usb_watch_close(watch);
    return NULL;
}

void host_usb_watch_close(struct host_usb_watch *watch)
{
    if (watch == NULL) return;
    libusb_exit(watch->ctx); /* with its callback */
    free(watch);
}

static int64_t earlier_ns(int64_t a_ns, int64_t b_ns)
{
    return a_ns < b_ns ? a_ns : b_ns;
}

/* Sleeps until until_ns, less than a second from now. Returns -1 if a signal comes. */
static int sleep_until(int64_t until_ns)
{
    const int64_t left_ns = until_ns - host_deadline_ns(0);
    const struct timespec pause = {.tv_nsec = left_ns};
    return left_ns > 0 ? nanosleep(&pause, NULL) : 0;
}

static int await_arrival(struct host_usb_watch *watch, int64_t until_ns)
{
    for (int64_t left_ns; !watch->arrived && (left_ns = until_ns - host_deadline_ns(0)) > 0;) {
        struct timeval wait = {.tv_sec = left_ns / 1000000000, .tv_usec = left_ns % 1000000000 / 1000};
        int rc = libusb_handle_events_timeout_completed(watch->ctx, &wait, &watch->arrived);
        if (rc == LIBUSB_ERROR_INTERRUPTED) return -1;
        if (rc != 0 && sleep_until(earlier_ns(until_ns, host_deadline_ns(PAUSE_MS))) != 0) return -1;
    }
    if (watch->arrived) watch->hurry_until_ns = host_deadline_ns(HURRY_MS);
    watch->arrived = 0;
    return 0;
}

int host_usb_watch_wait(struct host_usb_watch *watch, int rc, int64_t deadline_ns)
{
    const int hurry = watch == NULL || rc != SH_ELOST || host_deadline_ns(0) < watch->hurry_until_ns;
    const int64_t until_ns = earlier_ns(deadline_ns, host_deadline_ns(hurry ? PAUSE_MS : LOOK_MS));
    return watch != NULL ? await_arrival(watch, until_ns) : sleep_until(until_ns);
}
