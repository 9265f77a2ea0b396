/* SPDX-License-Identifier: MIT */
/* For tests of what a page asks of a head: a small scene, and questions by HTTP, as a browser sends them. */
#ifndef TESTS_WIRE_WATCH_RIG_H
#define TESTS_WIRE_WATCH_RIG_H

#include "tests/wire/wire.h"

/* Writes the scene and its configuration. */
void watch_prepare(struct wire *wire, char config[256]);
/* The whole answer. */
char *watch_ask(const struct head *head, const char *path, size_t *len);
/* The answer's content; it must be 200. */
char *watch_get(const struct head *head, const char *path, size_t *len);
/* Waits for a scan's end, and returns its quality. */
char *watch_quality(const struct head *head, unsigned station, unsigned scan);
/* Commands a scan from a station, as any client does, and returns its quality. */
char *watch_scan(const struct head *head, struct scanhead *sh, unsigned station, unsigned scan);
/* Runs the program with these arguments to its end, and returns what it wrote. set: of `--set`; NULL: none. */
char *watch_command(struct wire *wire, const char *const *first, const char *set);

#endif
