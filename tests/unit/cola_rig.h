/* SPDX-License-Identifier: MIT */
/* For tests of CoLa: a TiM571 or LMS111 in a rig, requests and answers, and a reader of LMDscandata that is written
 * from its public description alone. */
#ifndef TESTS_UNIT_COLA_RIG_H
#define TESTS_UNIT_COLA_RIG_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "tests/common/protocol_rig.h"

extern struct protocol_rig cola;

/* Opens a session, and closes the one before. The head has not described itself. */
void cola_open(const char *model);
/* Does the same with a scanner that scans; its geometry is known. TiM: 1080 steps a turn, 0 to 810 cast, 15 Hz.
 * LMS111: 1440, 0 to 1080 cast, 25 Hz. */
void cola_open_tim(const char *model);
void cola_open_lms(void);
/* Closes the session that a test has left open. */
int cola_teardown(void **state);
/* Sets the head's answers to SCPI lines: state is that of HEAD:STATE?. */
void cola_head_state(const char *state);

/* Sends one request in CoLa-A. Returns the one answer without its frame. */
const char *cola_ask(const char *request);
void cola_expect(const char *request, const char *answer);
/* Does the same in CoLa-B. The payloads have no marks, length and check byte. */
void cola_expect_b(const void *request, size_t len, const void *answer, size_t answer_len);
#define EXPECT_B(request, answer) cola_expect_b(request, sizeof(request) - 1, answer, sizeof(answer) - 1)
/* Adds marks, length and check byte. */
size_t cola_frame_b(uint8_t *dst, const void *payload, size_t len);
void cola_input(const void *bytes, size_t len);
void cola_authorise(void);
/* Sends sEN LMDscandata 1. */
void cola_stream(int is_b);

/* A telegram LMDscandata as read back. */
struct cola_channel {
    char name[6];
    double scale, offset;
    int32_t start_e4;
    uint32_t step_e4, n, value[3000];
};
struct cola_lmd {
    char verb[4];
    uint32_t serial, telegram, scan, scan_us, send_us, scan_chz, meas_100hz;
    uint32_t n_encoders;
    int32_t position;
    int16_t speed;
    uint32_t n_16, n_8;
    struct cola_channel channel[4]; /* those of 16 bit, then those of 8 bit */
    /* of the tail */
    uint32_t has_name, has_time;
    char name[40];
    uint32_t date[7]; /* year .. second, us */
};
/* Reads sent unit i, in its form. */
void cola_read_lmd(uint32_t unit, struct cola_lmd *out);

/* Feeds a turn whose ranges are `base_m` and 1 cm more with each step, with an amplitude of 20 dB. */
void cola_turn(uint32_t line, double base_m);
/* Does the same, and reads the first telegram that comes then. */
void cola_scan(uint32_t line, double base_m, struct cola_lmd *out);

#endif
