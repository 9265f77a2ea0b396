/* SPDX-License-Identifier: MIT */
/* This is the tests' own reader of NMEA 0183: fields, checksum, angles. */
#ifndef TESTS_COMMON_NMEA_READER_H
#define TESTS_COMMON_NMEA_READER_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <stdlib.h>
#include <string.h>

struct nmea_line {
    char text[256];
    const char *field[32]; /* [0] is talker and type */
    int n;
};

/* Reads one sentence of len bytes with its CR LF. A type "" or n_fields 0 accepts any. */
void read_line(const char *text, size_t len, const char *type, int n_fields, struct nmea_line *line);

/* Returns the degrees of ddmm.mmm and its letter; `letters` are the two that are allowed. */
double read_angle(const char *text, const char *letter, int degree_digits, const char letters[2]);

#endif
