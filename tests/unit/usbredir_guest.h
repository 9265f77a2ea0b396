/* SPDX-License-Identifier: MIT */
/* A virtual machine's end of a usbredir channel, with the library's own guest-side parser and no virtual machine: the
 * test polls the link itself, so one thread plays both ends. */
#ifndef TESTS_UNIT_USBREDIR_GUEST_H
#define TESTS_UNIT_USBREDIR_GUEST_H

#include "tests/unit/link_test.h"

#include <errno.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <usbredirparser.h>

#include "drivers/usb/backend.h"

enum { MAX_SEEN = 64 };

/* The packets from the device, in order. */
struct seen {
    int type;
    uint64_t id;
    unsigned endpoint, status, length;
    uint8_t data[70000];
};

struct guest {
    struct bench *bench;
    struct usbredirparser *parser;
    int fd, ended;
    struct seen *seen;
    int n_seen;
    struct usb_redir_device_connect_header device;
    struct usb_redir_interface_info_header interfaces;
    struct usb_redir_ep_info_header eps;
    int connects, infos, disconnects, errors;
};

extern char *guest_dir, guest_path[100];

int guest_setup(void **state);

int guest_teardown(void **state);

struct bench redir_bench(int speed);

int guest_socket(void);

void guest_turn(struct guest *g, uint32_t want_write);

/* Waits until n packets have been seen. */
struct seen *guest_await(struct guest *g, int n);

/* Begins on a connected socket, which it takes over. The guest says hello with the next turns. */
struct guest *guest_begin(struct bench *bench, int fd);

/* The same, but the guest has the device when the call returns. */
struct guest *guest_on(struct bench *bench, int fd);

struct guest *guest_new(struct bench *bench);

void guest_free(struct guest *g);

void guest_configure(struct guest *g);

struct seen *guest_control(struct guest *g, unsigned type, unsigned request, unsigned value, unsigned index,
                           unsigned length, uint8_t *out);

/* Begins the stream, and waits for its session. */
void guest_open_stream(struct guest *g);

void guest_bulk(struct guest *g, uint64_t id, uint8_t endpoint, uint32_t length, uint8_t *out);

#endif
