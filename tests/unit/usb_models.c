/* SPDX-License-Identifier: MIT */
#include "tests/unit/usb_models.h"

/* This is a vendor class with only one bulk pair. */
static const struct usb_endpoint_row pair_endpoints[] = {
    {.address = 0x81, .type = USB_ENDPOINT_XFER_BULK, .packet = {64, 512, 1024}, .burst = 3},
    {.address = 0x02, .type = USB_ENDPOINT_XFER_BULK, .packet = {64, 512, 1024}}};

const struct usb_interface_row pair_interfaces[] = {
    {.class = 0xff, .subclass = 1, .protocol = 2, .string = 2, .endpoint = pair_endpoints, .n_endpoints = 2}};

static const struct usb_function_row pair_functions[] = {
    {.count = 1, .class = 0xff, .compatible_id = "WINUSB", .guid = "{01234567-89AB-CDEF-0123-456789ABCDEF}"}};

static const char *const pair_strings[] = {"Maker", "B\xc3\xa4r \xf0\x9f\x90\xbb", NULL};

const struct usb_model pair_model = {.bcd_device = 0x0234,
                                     .max_power_ma = 100,
                                     .string = pair_strings,
                                     .manufacturer = 1,
                                     .product = 2,
                                     .function = pair_functions,
                                     .interface = pair_interfaces,
                                     .n_functions = 1,
                                     .n_interfaces = 1,
                                     .ms_vendor_code = 0x42};

/* Two interfaces: one without endpoints, and one with a bulk endpoint. */
static const struct usb_endpoint_row other_endpoints[] = {
    {.address = 0x82, .type = USB_ENDPOINT_XFER_BULK, .packet = {64, 512, 1024}}};

static const struct usb_interface_row two_interfaces[] = {
    {.number = 0, .class = 0xff}, {.number = 1, .class = 0xff, .endpoint = other_endpoints, .n_endpoints = 1}};

static const struct usb_function_row two_functions[] = {{.first = 0, .count = 1}, {.first = 1, .count = 1}};

const struct usb_model two_model = {
    .function = two_functions, .interface = two_interfaces, .n_functions = 2, .n_interfaces = 2};
