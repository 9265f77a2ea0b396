/* SPDX-License-Identifier: MIT */
/* A USB gadget of the Linux kernel, made through configfs: identity, strings, one configuration, f_acm for a
 * CDC-ACM console, and FunctionFS for all other interfaces, if there are any. Private to the functionfs back
 * end.
 *
 * Why f_acm: FunctionFS takes no class-specific interface descriptors (type 24h), without which no host knows
 * a CDC console. f_acm has such descriptors. functionfs_private.h describes what f_acm lacks. */
#ifndef DRIVERS_USB_GADGET_H
#define DRIVERS_USB_GADGET_H

#include "core/err.h"
#include "drivers/usb/model.h"

struct gadget {
    char name[48];  /* scanhead-PID-START-N, in configfs, of both functions and of the mounted instance */
    char dir[128];  /* in configfs; empty: not made */
    char mount[64]; /* where FunctionFS is mounted; empty: nowhere */
    char udc[256];  /* empty: not bound */
    int tty_number; /* /dev/ttyGSn; -1: no console */
    int lock_fd;    /* of dir, as long as the gadget is in use; -1: none */
    int state_fd;   /* of its controller's state, where there is no FunctionFS to report it; -1: none */
    /* The part of the model that FunctionFS carries: all but the console, numbered from 0 as FunctionFS wants it. */
    struct usb_model part;
    struct usb_interface_row row[USB_MAX_INTERFACES];
    struct usb_function_row function[USB_MAX_INTERFACES];
    const char *string[2 * USB_MAX_INTERFACES + 1];
    uint8_t interface[USB_MAX_INTERFACES]; /* of the model, by number in the part */
};

/* Removes what dead processes left, then makes everything but the binding. Where the gadget has FunctionFS, ep0 in
 * gadget->mount is then ready to be opened. */
int gadget_create(struct gadget *gadget, const struct usb_model *model, const struct usb_identity *id,
                  struct sh_err *err);
/* Whether FunctionFS carries something of the gadget. */
static inline int gadget_has_functionfs(const struct gadget *gadget)
{
    return gadget->part.n_interfaces != 0;
}
/* Writes the descriptors and strings to ep0. */
int gadget_describe(const struct gadget *gadget, int ep0, const struct usb_identity *id, struct sh_err *err);
/* Plugs in: udc, or the first free controller where that is empty. */
int gadget_bind(struct gadget *gadget, const char *udc, struct sh_err *err);
/* Opens state_fd, on which poll(2) reports POLLPRI when the controller's state has changed. For gadgets without
 * FunctionFS, once they are bound. */
int gadget_watch_state(struct gadget *gadget, struct sh_err *err);
/* Whether the host has configured the gadget. before: the last answer, which still holds while the bus is suspended. */
int gadget_is_configured(const struct gadget *gadget, int before);
/* Returns "full", "high" or "super". */
const char *gadget_rate_name(enum usb_rate rate);
/* Whether the gadget's controller sees a host. */
int gadget_is_on_bus(const struct gadget *gadget);
/* Returns the rate of the bus that the gadget is on. */
enum usb_rate gadget_rate(const struct gadget *gadget);
/* Checks whether the gadget's controller is as fast as `wanted`. SH_EINPUT: it is not. */
int gadget_check_rate(const struct gadget *gadget, enum usb_rate wanted, struct sh_err *err);
void gadget_unbind(struct gadget *gadget);
/* Removes the gadget. To be called after ep0 and the endpoints are closed. */
void gadget_remove(struct gadget *gadget);

#endif
