/* SPDX-License-Identifier: MIT */
/* USB identities of a head, its personalities: its own, and those of the devices whose protocols it speaks. Each is
 * data: a model (model.h), ids, and the places of its sessions.
 *
 *   name     from protocol   what the host sees
 *   native   native          CDC-ACM console, and a vendor interface with a bulk pair for the stream
 *   hokuyo   scip            CDC-ACM alone, as URG series heads: the stock driver makes /dev/ttyACM0 of it
 *   sick     cola            one vendor interface with a bulk pair, as TiM heads: libusb reads it
 *
 * Sources. URG series: ids, strings and "no serial number" as heads of several years report them to Linux
 * (UrgNetwork/urg_library issue 29; udev rules in use name the strings). TiM: `lsusb -v` of a TiM571
 * (uos/sick_tim issue 29); endpoints as sick_tim uses them. The endpoints' numbers and sizes of the URG, and the power
 * that it asks for, are not known: they are taken from the native identity. */
#ifndef DRIVERS_USB_PERSONALITIES_H
#define DRIVERS_USB_PERSONALITIES_H

#include "drivers/usb/model.h"

enum usb_personality_id { USB_PERSONALITY_NATIVE, USB_PERSONALITY_HOKUYO, USB_PERSONALITY_SICK, USB_N_PERSONALITIES };

enum {
    SCANHEAD_USB_VID = 0x1209, /* pid.codes, and a product id it sets aside for private tests */
    SCANHEAD_USB_PID = 0x0001,
    SCANHEAD_USB_STREAM = 0x22, /* bRequest; bmRequestType 0x41 opens and closes, 0xc1 asks (USB.md) */
    SCANHEAD_USB_SUBCLASS = 0x53,
    SCANHEAD_USB_PROTOCOL = 0x48,
};

/* Numbers of the native identity. The port of the hokuyo identity has those of the console. */
enum { CONSOLE_INTERFACE, CONSOLE_DATA_INTERFACE, STREAM_INTERFACE };
enum { CONSOLE_NOTIFY = 0x82, CONSOLE_IN = 0x81, CONSOLE_OUT = 0x01, STREAM_IN = 0x83, STREAM_OUT = 0x03 };
/* Numbers of the sick identity. */
enum { TELEGRAM_INTERFACE = 0, TELEGRAM_IN = 0x81, TELEGRAM_OUT = 0x02 };

/* Events that begin a session. */
enum usb_begins {
    USB_BEGINS_DTR = 1 << 0,     /* of a CDC-ACM port: the host raises DTR; dropping it ends the session */
    USB_BEGINS_REQUEST = 1 << 1, /* SCANHEAD_USB_STREAM, wValue 1; wValue 0 ends it */
    USB_BEGINS_DATA = 1 << 2,    /* the first data on the OUT endpoint */
};

enum { USB_MAX_SESSIONS = 2 };

struct usb_session_row {
    const char *name;  /* for the log */
    uint8_t interface; /* the one that begins and ends the session */
    uint8_t also;      /* a second interface of the session, or the same */
    uint8_t in, out;   /* endpoints */
    uint8_t notify;    /* of a CDC-ACM port: its interrupt endpoint; 0: none */
    unsigned begins;   /* enum usb_begins */
};

struct usb_personality {
    uint16_t vid, pid;
    int has_serial; /* the device has a serial number string, also where none is configured */
    const struct usb_model *model;
    const struct usb_session_row *session;
    int n_sessions;
};

/* NULL for an unknown id. */
const struct usb_personality *usb_personality_get(enum usb_personality_id id);

extern const struct usb_model scanhead_usb_model; /* of the native identity */

#endif
