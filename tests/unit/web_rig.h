/* SPDX-License-Identifier: MIT */
/* A web link, and its clients: bytes on a socket, in the form of RFC 9112 and RFC 6455. */
#ifndef TESTS_UNIT_WEB_RIG_H
#define TESTS_UNIT_WEB_RIG_H

#include "drivers/link/web.h"
#include "tests/unit/link_test.h"

enum { WEB_SESSIONS = 2 };

extern int web_n_released; /* bodies of /scene that the link gave back */

/* place: "127.0.0.1:40123". The link's owner answers /scene with 5 bytes, or 3 million for ?n=big. A path that begins
 * with /echo gets itself and its query. */
struct bench web_open(char place[64]);
int web_dial(const char *place);
/* Does the same from 127.0.0.LAST. */
int web_dial_from(const char *place, uint8_t last);
/* Lets the link work until the client has bytes, or its end. Returns the bytes read, or 0 at the end. */
size_t web_listen_to(struct bench *bench, int fd, void *buf, size_t len);
/* Reads the whole answer to a request with these fields. Returns its status, or 0 where the connection ended without a
 * byte. */
int web_ask(struct bench *bench, const char *place, const char *line, const char *fields, char **body, size_t *len);
/* Does the same with a right Host. */
int web_status_of(struct bench *bench, const char *place, const char *line, const char *fields);

/* Opens a WebSocket. Returns 0 where it was turned down. */
int web_upgrade(struct bench *bench, const char *place, const char *path, const char *fields);
/* Sends a frame from the client, masked with zeros. */
void web_send_frame(int fd, uint8_t first, const void *data, size_t len);
void web_take(struct bench *bench, int fd, uint8_t *to, size_t len);
/* Takes a frame from the link. Returns its first byte; writes the payload and its length. */
uint8_t web_take_frame(struct bench *bench, int fd, uint8_t *payload, size_t *len);

#endif
