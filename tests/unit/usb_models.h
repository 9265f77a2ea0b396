/* SPDX-License-Identifier: MIT */
/* Devices as tables, for tests. Other devices than the scanner head need no code. */
#ifndef TESTS_UNIT_USB_MODELS_H
#define TESTS_UNIT_USB_MODELS_H

#include "drivers/usb/usb.h"

extern const struct usb_interface_row pair_interfaces[];
extern const struct usb_model pair_model;

extern const struct usb_model two_model;

#endif
