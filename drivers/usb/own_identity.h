/* A head's own USB identity, where none is configured: its number among the USB heads on this machine, and a
 * serial number that goes with it.
 *
 * A head has the lowest number that no other one has. It keeps it as long as it runs. So a head that ends and
 * starts again is the same one to its clients, and two that run at a time differ. */
#ifndef DRIVERS_USB_OWN_IDENTITY_H
#define DRIVERS_USB_OWN_IDENTITY_H

#include "drivers/usb/usb.h"

enum { USB_MAX_HEADS = 126 }; /* USB/IP shows them as devices 2 to 127 of one bus */

/* Sets id->number, and appends to id->serial "-" and eight hexadecimal digits of the machine and the number.
 * claim: a descriptor that holds the number until it is closed. Heads in different network namespaces don't
 * see each other's numbers. SH_EINPUT: all numbers are taken; SH_EIO. */
int usb_own_identity(struct usb_identity *id, int *claim, struct sh_err *err);

#endif
