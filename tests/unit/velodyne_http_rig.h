/* SPDX-License-Identifier: MIT */
/* A session of VLP-16 settings: text goes in, and the answer is text. */
#ifndef TESTS_UNIT_VELODYNE_HTTP_RIG_H
#define TESTS_UNIT_VELODYNE_HTTP_RIG_H

#include "tests/common/protocol_rig.h"

#define END "\r\n"

/* The answer to a form that is done: 200 where the device has 204, since MRPT accepts only that. */
#define DONE(connection)                                                              \
    "HTTP/1.1 200 OK" END "Connection: " connection END "Cache-Control: no-store" END \
    "Content-Type: text/plain; charset=us-ascii" END "X-Content-Type-Options: nosniff" END "Content-Length: 0" END END

extern struct protocol_rig http_rig;
/* The head's answers: state, rate, echoes; the others are a test's own. The head scans at 10 Hz, with strongest
 * echoes. */
extern struct protocol_rig_reply http_replies[7];

int http_setup(void **state);
int http_teardown(void **state);
/* Opens another session. The rig itself is 4 MB, and stays. */
void http_renew(void);

/* Forgets earlier answers, and sends. */
void http_send(const char *text);
/* Sends as curl 7.88 does with --data. */
void http_post(const char *path, const char *form);
void http_get(const char *path);
/* Returns the whole answer, its first status, or the text after its head. */
const char *http_answer(void);
int http_status(void);
const char *http_body(void);
/* Asserts that one command since http_send changes something, this one; NULL: none does. */
void http_assert_command(const char *line);

#endif
