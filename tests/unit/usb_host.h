/* SPDX-License-Identifier: MIT */
/* Shared by the USB tests: a host's side of the device core. */
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

/* Vendor request 0x55 reads four bytes, and 0x66 writes. Others are refused. */
int host_request(void *ctx, const struct usb_ctrlrequest *setup, uint8_t *data);

struct host *host_new(const struct usb_model *model, enum usb_rate highest, enum usb_rate rate);

/* Plugs it in once more, as at first. */
void host_attach(struct host *host, enum usb_rate rate);

void host_free(struct host *host);

/* Makes a control transfer. out: wLength bytes for OUT. Received bytes are in host_in, whose further bytes must not
 * change. */
extern uint8_t host_in[70000];

int host_control(struct host *host, unsigned type, unsigned request, unsigned value, unsigned index, unsigned length,
                 const void *out);

/* The device goes from default to addressed to configured. */
void host_configure(struct host *host);

struct usb_transfer *host_submit(struct host *host, uint64_t id, uint8_t endpoint, const void *out, uint32_t length);

/* The next completed transfer must be this one, with these values. Frees it. */
void host_expect(struct host *host, uint64_t id, enum usb_status status, uint32_t actual);

#endif
