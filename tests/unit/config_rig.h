/* SPDX-License-Identifier: MIT */
/* For tests of the configuration: one that loads, edits of it in a folder of their own, and the results of loading
 * them. Run from the top of the source tree. */
#ifndef TESTS_UNIT_CONFIG_RIG_H
#define TESTS_UNIT_CONFIG_RIG_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <cmocka.h>

#include "firmware_sim/config/config.h"

extern const char base[];

#define PRR   "  prr_hz: 500000\n"
#define LINES "  lines_hz: 100\n"

extern char dir[64], config_path[128];
extern struct config *cfg;
extern struct sh_err err; /* the first of the diagnostics */
extern struct config_diagnostics diagnostics;

void write_file(const char *path, const void *bytes, size_t len);

void write_in(const char *name, const char *text);

int load_sets(const char *const *sets, int n);

int load_text(const char *text);

/* Returns text with its first `old` replaced by `with`; free it. */
char *replaced(const char *text, const char *old, const char *with);

/* Does the same with base. */
char *edited(const char *old, const char *with);

int load_edited(const char *old, const char *with);

int load_set(const char *set);

/* Loads base with another head, these settings of it ("  prr_hz: 5\n"), and `with` before the section output. */
int load_with_head(const char *profile, const char *settings, const char *with);

/* Reads a file of the source tree as a text; free it. */
char *read_source(const char *path);

/* Writes a shipped profile with its first `old` replaced as heads/mine.yaml, and loads base with that head. */
int load_changed(const char *profile, const char *old, const char *with);

/* Writes the beginning of a diagnostic of heads/mine.yaml: "FILE:LINE: KEY: ", with the line of the key, or of its item
 * in a list; for a key that is missing, that of the first key. */
void place_in_profile(const char *key, char *buf, size_t len);

void assert_loads(int code);

/* Exactly one diagnostic is there, and it is whole: place, key and text. place: "FILE:LINE: " or "--set ". */
void expect_only(const char *place, const char *key, const char *text);

void assert_says(const char *fragment);

int set_up(void **state);

int tear_down(void **state);

#endif
