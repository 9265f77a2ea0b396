/* SPDX-License-Identifier: MIT */
/* A USB device as data, and its descriptors.
 *
 * In: tables of interfaces, endpoints and strings. Out: descriptors as they go over the bus, for the core (usb.h) and
 * for back ends that hand them to a kernel. Formats: USB 2.0 and 3.2, chapter 9; Microsoft OS 2.0 Descriptors
 * Specification. Numbers in structs are in host order. Pure; any thread. */
#ifndef DRIVERS_USB_MODEL_H
#define DRIVERS_USB_MODEL_H

#include <linux/usb/ch9.h>
#include <stddef.h>
#include <stdint.h>

enum {
    USB_MAX_INTERFACES = 8,
    USB_MAX_CONFIG = 512,  /* bytes of a configuration with all its descriptors */
    USB_CONFIGURATION = 1, /* bConfigurationValue of the one configuration */
    USB_LANGID = 0x0409,   /* English, United States */
};

/* ---- a device as data */

enum usb_rate { USB_RATE_FULL, USB_RATE_HIGH, USB_RATE_SUPER, USB_N_RATES };

struct usb_endpoint_row {
    uint8_t address;              /* number, and USB_DIR_IN */
    uint8_t type;                 /* USB_ENDPOINT_XFER_BULK, USB_ENDPOINT_XFER_INT */
    uint16_t packet[USB_N_RATES]; /* wMaxPacketSize by rate */
    uint8_t interval[USB_N_RATES];
    uint8_t burst; /* super speed: bMaxBurst */
    uint8_t units; /* IN: the data of one write are a unit, whose end goes out at once */
};

/* An interface. Its only alternate setting is 0. */
struct usb_interface_row {
    uint8_t number; /* its place among the rows */
    uint8_t class, subclass, protocol;
    uint8_t string;       /* index into the model's strings, 0 none */
    const uint8_t *extra; /* class descriptors, as they go out between interface and endpoints */
    uint8_t extra_len;
    const struct usb_endpoint_row *endpoint;
    uint8_t n_endpoints;
};

/* Interfaces that one driver of the host serves. */
struct usb_function_row {
    /* The first interface, and how many there are. Two or more get an association descriptor in devices of class EF. */
    uint8_t first, count;
    uint8_t class, subclass, protocol;
    uint8_t string;
    const char *compatible_id; /* Microsoft OS 2.0, "WINUSB" for instance; NULL: none */
    const char *guid;          /* "{...}", DeviceInterfaceGUIDs; NULL: none */
};

struct usb_model {
    uint8_t class, subclass, protocol; /* of the device */
    uint16_t bcd_device;
    uint8_t self_powered; /* 1: self-powered, whatever max_power_ma is. With max_power_ma 0 a device always is so */
    uint16_t max_power_ma;
    const char *const *string;     /* by index from 1, UTF-8; NULL ends the list */
    uint8_t manufacturer, product; /* indices, 0 none; the serial number's is the one after the list */
    uint8_t configuration;         /* index of its name */
    const struct usb_function_row *function;
    const struct usb_interface_row *interface;
    uint8_t n_functions, n_interfaces;
    uint8_t fixed_addresses; /* its clients know its endpoints by their addresses, whatever descriptors say */
    uint8_t ms_vendor_code;  /* bRequest for the Microsoft OS 2.0 set; unused without compatible ids */
};

static inline int usb_is_self_powered(const struct usb_model *model)
{
    return model->self_powered || model->max_power_ma == 0;
}

/* Properties in which the devices of a model differ. */
struct usb_identity {
    uint16_t vid, pid;
    char serial[64];       /* UTF-8; empty: no serial number string */
    unsigned number;       /* of this head among those on the machine, from 1; 0: it has none */
    enum usb_rate highest; /* fastest rate it can do */
};

/* ---- descriptors. Each function writes at most `room` bytes and returns the length of the whole, or 0 where the
 * device has no such descriptor at this rate. */

size_t usb_describe_device(const struct usb_model *model, const struct usb_identity *id, enum usb_rate rate,
                           uint8_t *out, size_t room);
size_t usb_describe_qualifier(const struct usb_model *model, const struct usb_identity *id, enum usb_rate rate,
                              uint8_t *out, size_t room);
/* type: USB_DT_CONFIG, or USB_DT_OTHER_SPEED_CONFIG for the other one of full and high. */
size_t usb_describe_config(const struct usb_model *model, const struct usb_identity *id, enum usb_rate rate,
                           uint8_t type, uint8_t *out, size_t room);
size_t usb_describe_bos(const struct usb_model *model, const struct usb_identity *id, uint8_t *out, size_t room);
size_t usb_describe_string(const struct usb_model *model, const struct usb_identity *id, uint8_t index, uint8_t *out,
                           size_t room);
/* The Microsoft OS 2.0 descriptor set; 0 without compatible ids. */
size_t usb_describe_ms_os(const struct usb_model *model, uint8_t *out, size_t room);
/* Returns the index of an endpoint in tables: 0 to 15 OUT, 16 to 31 IN. */
static inline unsigned usb_endpoint_index(unsigned address)
{
    return (address & USB_ENDPOINT_NUMBER_MASK) + ((address & USB_DIR_IN) != 0 ? 16u : 0u);
}

#endif
