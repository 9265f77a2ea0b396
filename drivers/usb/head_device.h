/* SPDX-License-Identifier: MIT */
/* The head as a USB device, with one of its USB identities (personalities.h). Requests and data of the host begin and
 * end sessions; requests to a CDC-ACM port are answered.
 *
 * Native: both the console and the stream take commands and give replies and stream frames. Sessions end when their
 * interface goes away; personalities.h says what else ends them. The request that begins a stream session first ends a
 * session that is open. */
#ifndef DRIVERS_USB_HEAD_DEVICE_H
#define DRIVERS_USB_HEAD_DEVICE_H

#include "drivers/usb/personalities.h"
#include "drivers/usb/usb.h"

/* A session as the host sees it. */
struct scanhead_usb_session {
    int open;
    int again;     /* the host opened it while it was open: it opens again once its end has been reported */
    int state_due; /* the serial state is still to be sent: the port came to life, or DTR rose */
};

struct scanhead_usb {
    const struct usb_personality *personality;
    struct usb_device *device;
    struct scanhead_usb_session session[USB_MAX_SESSIONS]; /* [personality->n_sessions] */
    uint8_t line_coding[7];
    int cut_due; /* a reset, another configuration or an unplugging ended a session; scanhead_usb_cut says which */
    enum usb_end cut;
};

/* Makes the device of head, which must be zeroed and stay where it is. The caller frees the device with
 * usb_device_free(head->device). */
int scanhead_usb_create(const struct usb_personality *personality, const struct usb_identity *id,
                        struct scanhead_usb *head, struct sh_err *err);
/* Does what follows from the host's transfers rather than from the host's requests: begins a session by data, sends the
 * notification of a port. To be called after each transfer. */
void scanhead_usb_update(struct scanhead_usb *head);
/* Returns a line that says what has cut sessions off, once for each time; NULL: nothing has. */
const char *scanhead_usb_cut(struct scanhead_usb *head);
/* To be called once the end of a session has been reported to its owner. */
void scanhead_usb_ended(struct scanhead_usb *head, int session);

#endif
