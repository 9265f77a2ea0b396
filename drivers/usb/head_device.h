/* The scanner head as a USB device: a CDC-ACM console (interfaces 0 and 1) and a vendor interface (2) whose
 * bulk pair carries the native stream. Both are sessions of the head: commands in, replies and frames out.
 *
 * A console session begins when the host raises DTR (SET_CONTROL_LINE_STATE) and ends when it drops it. A
 * stream session begins with the vendor request SCANHEAD_USB_STREAM, wValue 1, or with the first data on the
 * OUT endpoint, and ends with wValue 0; wValue 1 while one is open ends it and begins another. Both end when
 * the interface goes away. */
#ifndef DRIVERS_USB_HEAD_DEVICE_H
#define DRIVERS_USB_HEAD_DEVICE_H

#include "drivers/usb/usb.h"

enum {
    SCANHEAD_USB_VID = 0x1209, /* pid.codes, and a product id it sets aside for private tests */
    SCANHEAD_USB_PID = 0x0001,
    SCANHEAD_USB_STREAM = 0x22, /* bRequest; bmRequestType 0x41, wIndex the vendor interface, wLength 0 */
    SCANHEAD_USB_SUBCLASS = 0x53,
    SCANHEAD_USB_PROTOCOL = 0x48,
};

enum { CONSOLE_INTERFACE, CONSOLE_DATA_INTERFACE, STREAM_INTERFACE };
enum { CONSOLE_NOTIFY = 0x82, CONSOLE_IN = 0x81, CONSOLE_OUT = 0x01, STREAM_IN = 0x83, STREAM_OUT = 0x03 };

extern const struct usb_model scanhead_usb_model;

enum { CONSOLE_SESSION, STREAM_SESSION, SCANHEAD_USB_SESSIONS };

/* A session as the host sees it. */
struct scanhead_usb_session {
    int open;
    int again;       /* opened again while open: opens once more when its end has been reported */
    uint8_t in, out; /* endpoints */
};

struct scanhead_usb {
    struct usb_device *device;
    struct scanhead_usb_session session[SCANHEAD_USB_SESSIONS];
    uint8_t line_coding[7];
    int cut_due; /* the bus has ended a session that its host had not; scanhead_usb_cut says why */
    enum usb_end cut;
    int state_due; /* the serial state is still to be sent: the console came to life, or DTR rose */
};

/* Makes the device of head, which must be zeroed and stay where it is. usb_device_free(head->device). */
int scanhead_usb_create(const struct usb_identity *id, struct scanhead_usb *head, struct sh_err *err);
/* What follows from the host's transfers rather than its requests: a stream that opens with data, the
 * console's notification. To be called after each of them. */
void scanhead_usb_update(struct scanhead_usb *head);
/* One line, each only once: what has cut sessions off. NULL: nothing. */
const char *scanhead_usb_cut(struct scanhead_usb *head);
/* The end of a session has been reported to whoever serves it. */
void scanhead_usb_ended(struct scanhead_usb *head, int session);

#endif
