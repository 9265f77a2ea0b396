/* SPDX-License-Identifier: MIT */
/* Diagnostics while a file is read. Each call adds one to the list and returns its code: SH_EINPUT, or the one that the
 * caller gives. Reading goes on after it. (given.h has the diagnostics of checks.) */
#ifndef FIRMWARE_SIM_CONFIG_TABLE_DIAGNOSTICS_H
#define FIRMWARE_SIM_CONFIG_TABLE_DIAGNOSTICS_H

#include <stdint.h>

#include "firmware_sim/config/table/row.h"

struct cfg_reader;
struct config_diagnostics;

/* Adds "FILE:LINE: text", without LINE when it is 0. In a value of --set it is "--set KEY: character LINE of the value:
 * text". Returns code. */
int cfg_fail_file(struct cfg_reader *rd, int code, int line, const char *fmt, ...)
    __attribute__((format(printf, 4, 5)));
/* Adds "FILE:LINE: KEY: text", or "--set KEY: text" when line is CFG_FROM_SET. */
int cfg_fail(struct cfg_reader *rd, int line, const char *name, const char *fmt, ...)
    __attribute__((format(printf, 4, 5)));
/* Does the same for the value of a key, which is bad from now on. */
int cfg_fail_value(struct cfg_reader *rd, const struct cfg_key *key, uint32_t item, int line, const char *fmt, ...)
    __attribute__((format(printf, 5, 6)));
/* Reports an unknown key below the section parent ("" for the top), suggests a similar key and lists the known ones.
 * The similar key is marked bad, so that it is not reported as missing, too. */
int cfg_fail_unknown(struct cfg_reader *rd, int line, const char *parent, uint32_t item, const char *word);
/* Adds a diagnostic. The list is in the order of `place`: the source, then the line. Returns code. */
int cfg_add_diagnostic(struct config_diagnostics *diagnostics, uint64_t place, int code, const char *text);

#endif
