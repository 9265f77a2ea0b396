/* SPDX-License-Identifier: MIT */
#include "drivers/usb/personalities.h"

#include <linux/usb/cdc.h>

/* bInterfaceProtocol: not 1, which means AT commands. Modem managers send these to every port of protocol 1. */
enum { PORT_PROTOCOL = USB_CDC_PROTO_NONE };

/* ---- a CDC-ACM port, on interfaces 0 and 1: the console of the native identity, all of the hokuyo identity */

/* clang-format off */
static const uint8_t port_extra[] = {
    5, USB_DT_CS_INTERFACE, USB_CDC_HEADER_TYPE, 0x20, 0x01, /* CDC 1.20 */
    5, USB_DT_CS_INTERFACE, USB_CDC_CALL_MANAGEMENT_TYPE, 0, CONSOLE_DATA_INTERFACE, /* no call management */
    4, USB_DT_CS_INTERFACE, USB_CDC_ACM_TYPE, USB_CDC_CAP_LINE | USB_CDC_CAP_BRK, /* line coding and state, break */
    5, USB_DT_CS_INTERFACE, USB_CDC_UNION_TYPE, CONSOLE_INTERFACE, CONSOLE_DATA_INTERFACE, /* both interfaces */
};

#define BULK(number, bursts) \
    {.address = (number), .type = USB_ENDPOINT_XFER_BULK, .packet = {64, 512, 1024}, .burst = (bursts)}

/* The two interfaces of the port; control_string names the first. */
#define PORT_ROWS(control_string) \
    {.number = CONSOLE_INTERFACE, .class = USB_CLASS_COMM, .subclass = USB_CDC_SUBCLASS_ACM, \
     .protocol = PORT_PROTOCOL, .string = (control_string), .extra = port_extra, .extra_len = sizeof port_extra, \
     .endpoint = notify_endpoints, .n_endpoints = 1}, \
    {.number = CONSOLE_DATA_INTERFACE, .class = USB_CLASS_CDC_DATA, .endpoint = port_endpoints, .n_endpoints = 2}

#define PORT_FUNCTION(function_string) \
    {.first = CONSOLE_INTERFACE, .count = 2, .class = USB_CLASS_COMM, .subclass = USB_CDC_SUBCLASS_ACM, \
     .protocol = PORT_PROTOCOL, .string = (function_string)}
/* clang-format on */

/* An interrupt every 16 ms: in frames at full speed, as 2^(n-1) microframes above. */
static const struct usb_endpoint_row notify_endpoints[] = {
    {.address = CONSOLE_NOTIFY, .type = USB_ENDPOINT_XFER_INT, .packet = {16, 16, 16}, .interval = {16, 8, 8}}};
static const struct usb_endpoint_row port_endpoints[] = {BULK(CONSOLE_IN, 0), BULK(CONSOLE_OUT, 0)};

/* ---- native */

static const char *const native_strings[] = {"scanhead", "Laser scanner head", "Scanner console", "Scanner stream",
                                             NULL};
enum { STRING_MAKER = 1, STRING_PRODUCT, STRING_CONSOLE, STRING_STREAM };

static const struct usb_endpoint_row stream_endpoints[] = {BULK(STREAM_IN, 15), BULK(STREAM_OUT, 0)};

static const struct usb_interface_row native_interfaces[] = {
    PORT_ROWS(STRING_CONSOLE),
    {.number = STREAM_INTERFACE,
     .class = USB_CLASS_VENDOR_SPEC,
     .subclass = SCANHEAD_USB_SUBCLASS,
     .protocol = SCANHEAD_USB_PROTOCOL,
     .string = STRING_STREAM,
     .endpoint = stream_endpoints,
     .n_endpoints = 2},
};

static const struct usb_function_row native_functions[] = {
    PORT_FUNCTION(STRING_CONSOLE),
    {.first = STREAM_INTERFACE,
     .count = 1,
     .class = USB_CLASS_VENDOR_SPEC,
     .subclass = SCANHEAD_USB_SUBCLASS,
     .protocol = SCANHEAD_USB_PROTOCOL,
     .string = STRING_STREAM,
     .compatible_id = "WINUSB",
     .guid = "{6FBB5A1C-2E0D-4C55-9E0B-6C7B1D5A7A53}"},
};

/* Class triple EF 02 01: look for interface association descriptors. */
const struct usb_model scanhead_usb_model = {
    .class = USB_CLASS_MISC,
    .subclass = 2,
    .protocol = 1,
    .bcd_device = 0x0100,
    .string = native_strings,
    .manufacturer = STRING_MAKER,
    .product = STRING_PRODUCT,
    .function = native_functions,
    .interface = native_interfaces,
    .n_functions = 2,
    .n_interfaces = 3,
    .ms_vendor_code = 0x20,
};

static const struct usb_session_row native_sessions[] = {
    {"usb console", CONSOLE_INTERFACE, CONSOLE_DATA_INTERFACE, CONSOLE_IN, CONSOLE_OUT, CONSOLE_NOTIFY, USB_BEGINS_DTR},
    {"usb stream", STREAM_INTERFACE, STREAM_INTERFACE, STREAM_IN, STREAM_OUT, 0, USB_BEGINS_REQUEST | USB_BEGINS_DATA},
};

/* ---- hokuyo: a communications device of one function, without an association */

static const char *const hokuyo_strings[] = {"Hokuyo Data Flex for USB", "URG-Series USB Driver", NULL};

static const struct usb_interface_row hokuyo_interfaces[] = {PORT_ROWS(0)};
static const struct usb_function_row hokuyo_functions[] = {PORT_FUNCTION(0)};

static const struct usb_model hokuyo_model = {
    .class = USB_CLASS_COMM,
    .bcd_device = 0x0100,
    .string = hokuyo_strings,
    .manufacturer = 1,
    .product = 2,
    .function = hokuyo_functions,
    .interface = hokuyo_interfaces,
    .n_functions = 1,
    .n_interfaces = 2,
};

/* Data begin a session, too, for a host that does not raise DTR. */
static const struct usb_session_row hokuyo_sessions[] = {{"usb port", CONSOLE_INTERFACE, CONSOLE_DATA_INTERFACE,
                                                          CONSOLE_IN, CONSOLE_OUT, CONSOLE_NOTIFY,
                                                          USB_BEGINS_DTR | USB_BEGINS_DATA}};

/* ---- sick: a telegram is a transfer */

static const char *const sick_strings[] = {"Default Configuration", "TIM3xx", NULL};

static const struct usb_endpoint_row telegram_endpoints[] = {
    {.address = TELEGRAM_IN, .type = USB_ENDPOINT_XFER_BULK, .packet = {64, 512, 1024}, .units = 1},
    BULK(TELEGRAM_OUT, 0)};

static const struct usb_interface_row sick_interfaces[] = {
    {.number = TELEGRAM_INTERFACE, .class = USB_CLASS_VENDOR_SPEC, .endpoint = telegram_endpoints, .n_endpoints = 2}};
static const struct usb_function_row sick_functions[] = {
    {.first = TELEGRAM_INTERFACE, .count = 1, .class = USB_CLASS_VENDOR_SPEC}};

static const struct usb_model sick_model = {
    .bcd_device = 0x0109,
    .self_powered = 1,
    .max_power_ma = 2,
    .string = sick_strings,
    .configuration = 1,
    .product = 2,
    .function = sick_functions,
    .interface = sick_interfaces,
    .n_functions = 1,
    .n_interfaces = 1,
    .fixed_addresses = 1,
};

/* Only data begin a session, since a TiM's clients do not report when they come or go. */
static const struct usb_session_row sick_sessions[] = {
    {"usb telegrams", TELEGRAM_INTERFACE, TELEGRAM_INTERFACE, TELEGRAM_IN, TELEGRAM_OUT, 0, USB_BEGINS_DATA}};

/* ---- all of them */

static const struct usb_personality personalities[USB_N_PERSONALITIES] = {
    [USB_PERSONALITY_NATIVE] = {SCANHEAD_USB_VID, SCANHEAD_USB_PID, 1, &scanhead_usb_model, native_sessions, 2},
    [USB_PERSONALITY_HOKUYO] = {0x15d1, 0x0000, 0, &hokuyo_model, hokuyo_sessions, 1},
    [USB_PERSONALITY_SICK] = {0x19a2, 0x5001, 1, &sick_model, sick_sessions, 1},
};

const struct usb_personality *usb_personality_get(enum usb_personality_id id)
{
    return (unsigned)id < USB_N_PERSONALITIES ? &personalities[id] : NULL;
}
