/* SPDX-License-Identifier: MIT */
/* What the USB tests share: a host's side of the device core. */
#ifndef TESTS_UNIT_USB_HOST_H
#define TESTS_UNIT_USB_HOST_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/bytes.h"
#include "drivers/usb/usb.h"

enum { HOST_MAX_DONE = 64, GUARD = 0xa5 };

struct host {
    struct usb_device *device;
    struct usb_transfer *done[HOST_MAX_DONE];
    int n_done;
    /* the function's side */
    int active[USB_MAX_INTERFACES], n_changes;
    struct usb_ctrlrequest last;
    int n_requests;
};

/* Vendor request 0x55: reads four bytes, 0x66: writes. Others are refused. */
int host_request(void *ctx, const struct usb_ctrlrequest *setup, uint8_t *data);

struct host *host_new(const struct usb_model *model, enum usb_rate highest, enum usb_rate rate);

void host_free(struct host *host);

/* A control transfer. out: wLength bytes for OUT. What comes in is left in host_in, whose bytes behind wLength must
 * stay as they were. */
extern uint8_t host_in[70000];

int host_control(struct host *host, unsigned type, unsigned request, unsigned value, unsigned index, unsigned length,
                 const void *out);

/* Default -> addressed -> configured. */
void host_configure(struct host *host);

struct usb_transfer *host_submit(struct host *host, uint64_t id, uint8_t endpoint, const void *out, uint32_t length);

/* The next completed one must be this, so; frees it. */
void host_expect(struct host *host, uint64_t id, enum usb_status status, uint32_t actual);

#endif
