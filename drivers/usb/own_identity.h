/* SPDX-License-Identifier: MIT */
/* A head's own USB identity, where none is configured. The identity has a serial number, which is the same whenever the
 * head starts again. It also has a number among the USB heads that run on this machine, for the bus id of USB/IP.
 *
 * The serial number is computed from the machine's id and from a text that names the head (`whose`). So it does not
 * depend on which other heads run. Where several of the same configuration run at a time, the second and later ones
 * have serial numbers of their own, in the order in which they start. The head's number is the lowest that is free. */
#ifndef DRIVERS_USB_OWN_IDENTITY_H
#define DRIVERS_USB_OWN_IDENTITY_H

#include "core/err.h"
#include "drivers/usb/model.h"

enum { USB_MAX_HEADS = 126 }; /* USB/IP shows them as devices 2 to 127 of one bus */

/* Descriptors that reserve a head's number and serial number until they are closed; -1: none. */
struct usb_claims {
    int number, place;
};
#define USB_NO_CLAIMS ((struct usb_claims){-1, -1})

/* Sets id->number, and appends to id->serial "-" and eight hexadecimal digits. whose: text that is the same when the
 * head starts again. Heads in different network namespaces don't see each other. SH_EINPUT: all numbers are taken;
 * SH_EIO. The caller gives up the claims in both cases. */
int usb_own_identity(struct usb_identity *id, const char *whose, struct usb_claims *claims, struct sh_err *err);
void usb_give_up(struct usb_claims *claims);

#endif
