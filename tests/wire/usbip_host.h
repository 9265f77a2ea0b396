/* SPDX-License-Identifier: MIT */
/* A USB/IP host without a kernel, for heads that run: the list, the import, and one transfer at a time. Numbers on the
 * wire are those of the kernel's Documentation/usb/usbip_protocol.rst, version 1.1.1. */
#ifndef TESTS_WIRE_USBIP_HOST_H
#define TESTS_WIRE_USBIP_HOST_H

#include "tests/wire/wire.h"

enum { USBIP_DEVICE_LEN = 312, USBIP_BUS_ID = 256, USBIP_BUS_ID_LEN = 32, USBIP_MAX_INTERFACES = 8 };

struct usbip_host {
    int fd;
    uint8_t device[USBIP_DEVICE_LEN]; /* as the list has it */
    uint8_t interface[4 * USBIP_MAX_INTERFACES];
    uint32_t seqnum;
};

/* Imports the one device of the head's usb link. */
struct usbip_host usbip_host_open(const struct head *head);

/* The same, once a head listens there. */
struct usbip_host usbip_host_open_within(const struct head *head, int timeout_ms);

void usbip_host_close(struct usbip_host *host);

/* Makes a control transfer that reads up to len bytes. Returns how many, or the negative status. */
int usbip_host_control(struct usbip_host *host, unsigned type, unsigned request, unsigned value, unsigned index,
                       void *data, unsigned len);

/* Reads a string descriptor as text; "": there is none. */
void usbip_host_string(struct usbip_host *host, unsigned index, char *text, size_t len);

void usbip_host_send(struct usbip_host *host, unsigned endpoint, const void *data, uint32_t len);

/* Submits a transfer, and does not wait for it. */
void usbip_host_ask(struct usbip_host *host, unsigned endpoint, uint32_t len);

/* Makes one transfer of at most len bytes, and waits for it. Returns how many came. */
uint32_t usbip_host_receive(struct usbip_host *host, unsigned endpoint, void *data, uint32_t len);

#endif
