/* SPDX-License-Identifier: MIT */
/* Converts texts to values and stores them, by the rows of their keys; and says which values a row allows. */
#ifndef FIRMWARE_SIM_CONFIG_TABLE_VALUE_H
#define FIRMWARE_SIM_CONFIG_TABLE_VALUE_H

#include <stdint.h>

#include "firmware_sim/config/table/row.h"

struct cfg_reader;
struct config_profile;

/* Computes text * 10^decimals exactly, as a whole number. Grammar: [+-] digits [. digits] [e [+-] digits], no leading
 * zeros, which YAML 1.1 reads as octal. Returns what the text is instead ("not a number"), or NULL. */
const char *cfg_parse_decimal(const char *text, int decimals, __int128 *out);
/* Stores one scalar; base_dir (with its '/', may be empty) is put before relative paths. */
int cfg_store(struct cfg_reader *rd, const struct cfg_key *key, uint32_t item, int line, const char *text,
              const char *base_dir);
/* Stores one number of a key of CFG_VEC3, CFG_PAIR or CFG_POINTS into dst. */
int cfg_store_number(struct cfg_reader *rd, const struct cfg_key *key, uint32_t item, int line, double *dst,
                     const char *text);
/* Writes the values that a row takes: "allowed 1 to 5 Hz". profile gives the limits that depend on it; NULL: those of
 * all profiles. */
enum { CFG_ALLOWED_MAX = 900 }; /* room for the longest lists, the kinds of faults and the keys of a profile */
const char *cfg_allowed(const struct cfg_key *key, const struct config_profile *profile, char *buf);
/* Writes the directory part of a path, with its '/'; empty for a bare name. buf holds CONFIG_PATH_LEN. */
const char *cfg_dir_of(const char *path, char *buf);

/* Return a figure of a profile: one of type CFG_MICRO, in 1e-6 units; or one of type CFG_REAL. */
int64_t cfg_figure(const struct config_profile *profile, const char *path);
double cfg_real_figure(const struct config_profile *profile, const char *path);

/* Converts a figure of CFG_MICRO to its unit: the double nearest to the written number, so that errors and lists print
 * that number. */
static inline double from_micro(int64_t micro)
{
    return (double)micro / 1e6;
}

#endif
