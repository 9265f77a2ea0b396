/* SPDX-License-Identifier: MIT */
/* Streams of every kind, and the carriers of a capture, for the tests of the dissector. */
#ifndef TESTS_WIRE_WIRESHARK_RIG_H
#define TESTS_WIRE_WIRESHARK_RIG_H

#include "tests/wire/capture_rig.h"
#include "tests/wire/dissected.h"

#define S "scanhead."
enum { EXPERT_WARN = 6291456, EXPERT_ERROR = 8388608 }; /* values of _ws.expert.severity */

/* Files in the test's folder: recordings of the program, the samples of SAMPLES.md, the first recording from within a
 * frame on, and a frame of 3,000 points. */
enum { N_RECORDINGS = 4, JOINED = 5, N_STREAMS = 7, LONG_POINTS = 3000, JOINED_AT = 200 };
extern const char *const stream_name[N_STREAMS]; /* the recordings first */

/* Makes these files. Their sequence numbers differ, so that one stream may follow another with a jump forward. */
int wireshark_setup(void **state);

/* Makes both checksums of a frame right again. */
void seal_frame(uint8_t *frame);

/* Writes a stream cut at random: with two commands and their replies on TCP, with one on USB. */
void put_tcp(struct capture *capture, uint32_t interface, int number, const uint8_t *bytes, size_t len);
void put_usb(struct capture *capture, uint32_t interface, int number, const uint8_t *bytes, size_t len);

#endif
