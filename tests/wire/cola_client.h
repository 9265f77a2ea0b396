/* SPDX-License-Identifier: MIT */
/* A client in CoLa-A over TCP: requests, and their answers. */
#ifndef TESTS_WIRE_COLA_CLIENT_H
#define TESTS_WIRE_COLA_CLIENT_H

#include "tests/wire/wire.h"

/* All 0 but fd. */
struct cola_client {
    int fd;
    char bytes[1 << 16], text[1 << 16];
    size_t len;
};

/* Returns the next telegram without its marks; NULL: the connection has ended. */
const char *cola_client_next(struct cola_client *c);
void cola_client_send(struct cola_client *c, const char *request);
/* Returns the answer; NULL as cola_client_next. Scans that come before it are passed over. */
const char *cola_client_ask(struct cola_client *c, const char *request);
void cola_client_expect(struct cola_client *c, const char *request, const char *answer);
/* Reboots, and connects again. The client has to be logged in. */
void cola_client_reboot(struct cola_client *c, const struct head *head);

#endif
