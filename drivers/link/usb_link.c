/* SPDX-License-Identifier: MIT */
/* The usb link: the head as a USB device, with the sessions of its USB identity (drivers/usb/personalities.h): console
 * and stream, or one alone.
 *
 * The back end carries out the host's acts one at a time. An act that begins or ends a session stops the back end until
 * the begin or end has been reported. So a session begins or ends at most once between two polls. The end of a session
 * is reported after all its bytes have been read. */
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "core/monotonic.h"
#include "drivers/link/link_poll.h"
#include "drivers/usb/backend.h"
#include "drivers/usb/head_device.h"
#include "drivers/usb/own_identity.h"

struct usb_link {
    struct scanhead_usb head;
    const struct usb_backend_ops *ops;
    void *backend;
    int n;                          /* sessions of its USB identity */
    int reported[USB_MAX_SESSIONS]; /* the caller takes it to be open */
    uint32_t plugged;               /* attaches that the caller knows of */
    char news[200];                 /* to be reported; empty: none */
    char refused[64];               /* the client that was turned away last */
    int n_refused;                  /* clients turned away that are to be reported */
    struct usb_claims claims;       /* of the head's own identity */
};

static const struct usb_session_row *row_of(const struct usb_link *self, int i)
{
    return &self->head.personality->session[i];
}

static void free_link(struct usb_link *self)
{
    usb_device_free(self->head.device);
    usb_give_up(&self->claims);
    free(self);
}

static int usb_open(const struct link_spec *spec, void **link, struct sh_err *err)
{
    const struct usb_personality *personality = usb_personality_get((enum usb_personality_id)spec->personality);
    if (personality == NULL) return sh_fail(err, SH_EINPUT, "link usb: no such USB identity");
    struct usb_link *self = calloc(1, sizeof *self);
    if (self == NULL) return sh_fail(err, SH_ENOMEM, "link usb: no memory");
    struct usb_identity id = {
        .vid = (uint16_t)spec->vid, .pid = (uint16_t)spec->pid, .highest = (enum usb_rate)spec->speed};
    struct usb_backend_spec backend = {.type = (enum usb_backend_type)spec->backend,
                                       .port = spec->port,
                                       .attach = spec->attach,
                                       .retry_ms = spec->retry_ms};
    snprintf(id.serial, sizeof id.serial, "%s", spec->serial);
    snprintf(backend.address, sizeof backend.address, "%s", spec->address);
    snprintf(backend.path, sizeof backend.path, "%s", spec->path);
    snprintf(backend.udc, sizeof backend.udc, "%s", spec->udc);
    self->claims = USB_NO_CLAIMS;
    self->n = personality->n_sessions;
    self->ops = usb_backend_ops_get(backend.type);
    int rc = self->ops != NULL ? SH_OK : sh_fail(err, SH_EINPUT, "link usb: this build does not have that back end");
    if (rc == SH_OK && spec->own_serial) rc = usb_own_identity(&id, spec->whose, &self->claims, err);
    if (spec->own_serial && !personality->has_serial) id.serial[0] = '\0';
    if (rc == SH_OK) rc = scanhead_usb_create(personality, &id, &self->head, err);
    if (rc == SH_OK) rc = self->ops->open(&backend, self->head.device, &self->backend, err);
    if (rc == SH_OK)
        *link = self;
    else
        free_link(self);
    return rc;
}

static void usb_endpoint(const void *link, char *buf, size_t len)
{
    const struct usb_link *self = link;
    self->ops->endpoint(self->backend, buf, len);
}

/* Bulk, in bytes per second. Full speed: 19 packets of 64 bytes in a frame of 1 ms (USB 2.0, table 5-9). High
 * speed: 10 packets of 512 in a microframe of 125 us, which host controllers reach; table 5-10 allows 13 on
 * an otherwise idle bus. Super speed: what USB 3.0, 4.4.11, calls realistic for an application. */
static double usb_capacity(const void *link)
{
    static const double rate[USB_N_RATES] = {19 * 64 * 1e3, 10 * 512 * 8e3, 400e6};
    const struct usb_link *self = link;
    return rate[usb_facts(self->head.device)->id.highest];
}

/* Once a session is over, only bytes from before its end are read. */
static int is_readable(const struct usb_link *self, int i)
{
    const uint8_t out = row_of(self, i)->out;
    uint32_t epoch = 0;
    if (!self->reported[i] || usb_device_can_read(self->head.device, out, &epoch) == 0) return 0;
    return self->head.session[i].open || epoch != usb_device_epoch(self->head.device, out);
}

static int is_writable(const struct usb_link *self, int i)
{
    return self->reported[i] && self->head.session[i].open &&
           usb_device_can_write(self->head.device, row_of(self, i)->in);
}

static int has_to_report(const struct usb_link *self, int i)
{
    return self->reported[i] != self->head.session[i].open;
}

/* Whether a host has got the device since the last report. The host can enumerate the device only once that is
 * reported. */
static int is_plugged_anew(const struct usb_link *self)
{
    return self->plugged != usb_facts(self->head.device)->attaches;
}

static int usb_link_go_on(void *ctx)
{
    struct usb_link *self = ctx;
    scanhead_usb_update(&self->head);
    if (is_plugged_anew(self)) return 0;
    for (int i = 0; i < self->n; i++)
        if (has_to_report(self, i)) return 0;
    return 1;
}

static void usb_link_say(void *ctx, const char *text)
{
    struct usb_link *self = ctx;
    snprintf(self->news, sizeof self->news, "%s", text);
}

static void usb_link_refuse(void *ctx, const char *client)
{
    struct usb_link *self = ctx;
    snprintf(self->refused, sizeof self->refused, "%s", client);
    self->n_refused++;
}

static void usb_link_report(struct usb_link *self, int i, uint32_t want_write, struct link_events *events)
{
    const struct scanhead_usb_session *session = &self->head.session[i];
    if (self->reported[i] && !session->open && !is_readable(self, i))
        self->reported[i] = !link_events_push(events, LINK_CLOSED, i, row_of(self, i)->name);
    if (!self->reported[i]) scanhead_usb_ended(&self->head, i);
    if (!self->reported[i] && session->open)
        self->reported[i] = link_events_push(events, LINK_OPENED, i, row_of(self, i)->name);
    if (is_readable(self, i)) link_events_push(events, LINK_READABLE, i, NULL);
    if ((want_write >> i & 1u) != 0 && is_writable(self, i)) link_events_push(events, LINK_WRITABLE, i, NULL);
}

/* The back end's message comes first. After an unplug the message of scanhead_usb_cut is left out, since it says
 * less. */
static void report_news(struct usb_link *self, struct link_events *events)
{
    if (self->news[0] != '\0' && self->head.cut == USB_END_UNPLUGGED) self->head.cut_due = 0;
    const char *cut = self->news[0] == '\0' ? scanhead_usb_cut(&self->head) : NULL;
    if (cut != NULL) usb_link_say(self, cut);
    if (self->news[0] != '\0' && link_events_push(events, LINK_NOTICE, 0, self->news)) self->news[0] = '\0';
    while (self->n_refused > 0 && link_events_push(events, LINK_REFUSED, 0, self->refused))
        self->n_refused--;
}

static int has_news(const struct usb_link *self, uint32_t want_write)
{
    int news = is_plugged_anew(self);
    news |= (self->ops->more != NULL && self->ops->more(self->backend)) || self->news[0] != '\0' ||
            self->n_refused > 0 || self->head.cut_due;
    for (int i = 0; i < self->n; i++)
        news |= has_to_report(self, i) || is_readable(self, i) || ((want_write >> i & 1u) != 0 && is_writable(self, i));
    return news;
}

/* Returns timeout_ms, or less where the back end has something to do before. */
static int wait_ms(const struct usb_link *self, int timeout_ms)
{
    const int64_t due_ns = self->ops->due_ns(self->backend);
    if (due_ns == INT64_MAX) return timeout_ms;
    const int64_t ms = (due_ns - monotonic_ns()) / 1000000 + 1;
    if (ms <= 0) return 0;
    return timeout_ms >= 0 && timeout_ms < ms ? timeout_ms : ms > 60000 ? 60000 : (int)ms;
}

static int usb_poll(void *link, int wake_fd, uint32_t want_write, int timeout_ms, struct link_event *event, int max)
{
    struct usb_link *self = link;
    struct link_events events = {event, 0, max};
    const struct usb_owner owner = {usb_link_go_on, usb_link_say, usb_link_refuse, self};
    struct pollfd fds[1 + USB_BACKEND_MAX_FDS] = {{.fd = wake_fd, .events = POLLIN}};
    int n = self->ops->prepare(self->backend, fds + 1);
    int rc = link_wait(fds, (nfds_t)(1 + n), has_news(self, want_write) ? 0 : wait_ms(self, timeout_ms));
    if (rc != SH_OK) return rc;
    link_take_wake(&fds[0], &events);
    rc = self->ops->handle(self->backend, fds + 1, n, &owner);
    if (rc != SH_OK) return rc;
    scanhead_usb_update(&self->head);
    self->ops->flush(self->backend);
    if (is_plugged_anew(self) && link_events_push(&events, LINK_PLUGGED, 0, NULL))
        self->plugged = usb_facts(self->head.device)->attaches;
    for (int i = 0; i < self->n; i++)
        usb_link_report(self, i, want_write, &events);
    report_news(self, &events);
    return events.n;
}

static ssize_t usb_read(void *link, int session, void *buf, size_t len)
{
    struct usb_link *self = link;
    if (session < 0 || session >= self->n || !self->reported[session]) return SH_ECLOSED;
    if (!is_readable(self, session)) return 0;
    size_t n = usb_device_read(self->head.device, row_of(self, session)->out, buf, len);
    self->ops->flush(self->backend);
    return (ssize_t)n;
}

/* A caller that learns here that the session is over reads no more: what is left is dropped. */
static ssize_t usb_write(void *link, int session, const void *buf, size_t len)
{
    struct usb_link *self = link;
    if (session < 0 || session >= self->n || !self->reported[session]) return SH_ECLOSED;
    const struct usb_session_row *row = row_of(self, session);
    if (self->head.session[session].open) {
        size_t n = usb_device_write(self->head.device, row->in, buf, len);
        if (n != 0) self->ops->flush(self->backend);
        return (ssize_t)n;
    }
    usb_device_drop(self->head.device, row->out);
    self->ops->flush(self->backend);
    return SH_ECLOSED;
}

/* ---- injected faults */

enum {
    USB_FAULTS = LINK_FAULT_BIT(LINK_FAULT_UNPLUG) | LINK_FAULT_BIT(LINK_FAULT_BUS_RESET),
    STALLS = LINK_FAULT_BIT(LINK_FAULT_ENDPOINT_STALL),
    SHORTENS = LINK_FAULT_BIT(LINK_FAULT_SHORT_PACKETS),
    ENUMERATES = LINK_FAULT_BIT(LINK_FAULT_SLOW_ENUMERATION) | LINK_FAULT_BIT(LINK_FAULT_DESCRIPTOR_LENGTH),
};

static uint32_t usb_can(const struct link_spec *spec)
{
    const struct usb_backend_ops *ops = usb_backend_ops_get((enum usb_backend_type)spec->backend);
    if (ops == NULL || ops->fault == NULL) return 0;
    return USB_FAULTS | ((ops->faults & USB_CAN_STALL) != 0 ? STALLS : 0) |
           ((ops->faults & USB_CAN_SHORTEN) != 0 ? SHORTENS : 0) |
           ((ops->faults & USB_CAN_ENUMERATE_WRONG) != 0 ? ENUMERATES : 0);
}

/* Injects a fault of the endpoint that a session writes to. */
static int fault_endpoint(struct usb_link *self, enum link_fault what, int session, uint32_t n)
{
    if (session < 0 || session >= self->n || !self->head.session[session].open) return SH_ESTATE;
    const uint8_t in = row_of(self, session)->in;
    if (what == LINK_FAULT_SHORT_PACKETS)
        usb_device_shorten(self->head.device, in, n);
    else if (!usb_device_halt(self->head.device, in))
        return SH_ESTATE;
    self->ops->flush(self->backend);
    return SH_OK;
}

/* An idle reader has no transfer that ends with its session. So its next transfer ends as if it had been pending. */
static int fault_reset(struct usb_link *self)
{
    uint32_t idle = 0;
    for (int i = 0; i < self->n; i++)
        if (self->head.session[i].open && !usb_device_can_write(self->head.device, row_of(self, i)->in))
            idle |= 1u << i;
    const int rc = self->ops->fault(self->backend, USB_FAULT_RESET);
    for (int i = 0; i < self->n && rc == SH_OK; i++)
        if ((idle >> i & 1u) != 0) usb_device_set_gone_due(self->head.device, row_of(self, i)->in, 1);
    return rc;
}

static int usb_fault(void *link, enum link_fault what, int session, uint32_t n, double for_ms)
{
    struct usb_link *self = link;
    switch (what) {
    case LINK_FAULT_UNPLUG:
        return self->ops->fault(self->backend, USB_FAULT_UNPLUG);
    case LINK_FAULT_PLUG:
        return self->ops->fault(self->backend, USB_FAULT_PLUG);
    case LINK_FAULT_BUS_RESET:
        return fault_reset(self);
    case LINK_FAULT_ENDPOINT_STALL:
    case LINK_FAULT_SHORT_PACKETS:
        return fault_endpoint(self, what, session, n);
    case LINK_FAULT_SLOW_ENUMERATION:
        usb_device_set_slow(self->head.device, for_ms);
        return SH_OK;
    case LINK_FAULT_DESCRIPTOR_LENGTH:
        usb_device_lengthen(self->head.device, n);
        return SH_OK;
    default:
        return SH_ESTATE;
    }
}

static void usb_close(void *link)
{
    struct usb_link *self = link;
    self->ops->close(self->backend);
    free_link(self);
}

const struct link_ops link_usb = {
    .name = "usb",
    .open = usb_open,
    .endpoint = usb_endpoint,
    .faults = USB_FAULTS | STALLS | SHORTENS | ENUMERATES,
    .can = usb_can,
    .capacity = usb_capacity,
    .poll = usb_poll,
    .read = usb_read,
    .write = usb_write,
    .fault = usb_fault,
    .close = usb_close,
};
