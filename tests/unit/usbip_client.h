/* SPDX-License-Identifier: MIT */
/* This is a USB/IP client without a kernel, for a usb link. The test polls the link itself, so one thread plays both
 * ends. Numbers are written out from the kernel's Documentation/usb/usbip_protocol.rst. */
#ifndef TESTS_UNIT_USBIP_CLIENT_H
#define TESTS_UNIT_USBIP_CLIENT_H

#include "tests/unit/link_test.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include "core/bytes.h"
#include "drivers/usb/backend.h"

enum { HEADER = 48, DEVID = 0x10002 };

struct client {
    struct bench *bench;
    int fd;
    uint32_t seqnum;
};

struct reply {
    uint32_t command, seqnum, actual;
    int status;
    uint8_t data[1 << 17];
};

struct bench usbip_bench(const char *serial);

/* Reads all len bytes, while the link does its part. Returns 0 when the link hung up instead. */
int client_read(struct client *c, void *data, size_t len);

void client_write(struct client *c, const void *data, size_t len);

uint32_t client_submit(struct client *c, int in, uint32_t ep, const void *setup, const void *out, uint32_t len);

uint32_t client_unlink(struct client *c, uint32_t victim);

/* Reads a reply. in: the expected URB carries data. */
int client_reply(struct client *c, struct reply *r, int in);

void client_import(struct client *c, struct bench *bench);

/* Makes a control transfer and returns its status. The received bytes are in r. */
int client_control(struct client *c, struct reply *r, unsigned type, unsigned request, unsigned value, unsigned index,
                   unsigned length, const void *out);

void client_configure(struct client *c);

/* Begins the stream, and waits for its session. */
void client_open_stream(struct client *c);

#endif
