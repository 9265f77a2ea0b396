/* SPDX-License-Identifier: MIT */
/* This puts the questions of chapter 9 of the USB specification to a head, over libusb and through a real kernel. The
 * tests try every standard request, wrong lengths and indices, halted endpoints, zero-length packets, transfers
 * cancelled at each stage, and resets back to back.
 *
 * After each test the head must still answer a command, with nothing lost or garbled. A device that survives a wrong
 * request but is out of step afterwards has failed. Expected values come from the specification and from the device's
 * own descriptors, compared with each other.
 *
 * With CHAPTER9_KERNEL=1 the device's kernel (composite gadget, FunctionFS) answers the standard requests, not the
 * program. The tests then do not ask what the specification leaves open. */
#ifndef TESTS_GUEST_CHAPTER9_H
#define TESTS_GUEST_CHAPTER9_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "drivers/host/usb_inside.h"

enum { MS = 1000, EP0_IN = 0x80, IF_IN = 0x81, EP_IN = 0x82, DEV_OUT = 0x00, IF_OUT = 0x01, EP_OUT = 0x02 };
enum { VENDOR_IF_OUT = 0x41, HALT = 0, STALL = LIBUSB_ERROR_PIPE, BUFFER = 64 << 10 };

/* The head under test. setup() opens it before each test; teardown() checks that it still answers, and closes it. */
struct usb_under_test {
    libusb_context *ctx;
    libusb_device_handle *dev;
    struct usb_interface interface;
    struct libusb_device_descriptor descriptor;
    struct libusb_config_descriptor *config;
    int speed, has_kernel;
};
extern struct usb_under_test usb;

extern uint8_t buf[BUFFER];

/* Makes a control transfer. Returns the number of bytes, or libusb's error; STALL means that the head refused it. */
int control(int type, int request, int value, int index, void *data, int len);
/* Does the same for a GET_DESCRIPTOR to the device. */
int get_descriptor(int type, int index, int lang, void *data, int len);

/* ---- the session: a command goes out, and its reply comes between the frames */

/* Opens or closes the session of the vendor interface. */
void session(int open);
void send_bytes(const void *data, int len);
/* Takes the next reply line, within some reads. Every frame before it must have right checksums. */
void expect_reply(const char *begin);
/* Opens the session with an empty parser. */
void open_session(void);
/* Asks for the identity and expects it. */
void ask(void);
int setup(void **state);
int teardown(void **state);

#endif
