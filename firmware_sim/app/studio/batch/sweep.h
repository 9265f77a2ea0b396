/* SPDX-License-Identifier: MIT */
/* The values that a campaign varies. In: the texts of --sweep and --stations. Out: the values of each key, every
 * combination of them by its number, and numbers of stations. Pure; errors are SH_EINPUT or SH_ENOMEM. */
#ifndef FIRMWARE_SIM_APP_STUDIO_BATCH_SWEEP_H
#define FIRMWARE_SIM_APP_STUDIO_BATCH_SWEEP_H

#include <stdint.h>

#include "core/err.h"
#include "firmware_sim/config/limits.h"

struct config;

enum { BATCH_MAX_SWEEPS = 16, BATCH_MAX_VALUES = 10000, BATCH_MAX_JOBS = 1000000 };

struct batch_sweep {
    char *key;
    char **set; /* KEY=VALUE, as --set takes it */
    uint32_t n;
};

struct batch_sweeps {
    struct batch_sweep sweep[BATCH_MAX_SWEEPS];
    uint32_t n;
};

/* Adds KEY=A,B,... or KEY=FIRST:LAST:STEP: whole steps from FIRST, not beyond LAST. Numbers are decimal, of up to
 * 15 digits; or whole, of up to 64 bits each. Commas within brackets, braces and quotes belong to a value. A key or a
 * value that is given twice is an error. */
int batch_sweeps_add(struct batch_sweeps *sweeps, const char *text, struct sh_err *err);
void batch_sweeps_free(struct batch_sweeps *sweeps);

/* Returns the text after a key with which `text` begins, in either spelling (a.0.b, a[0].b); NULL: it does not. */
const char *batch_after_key(const char *text, const char *key);

/* Counts the combinations: 1 without sweeps. SH_EINPUT: more than BATCH_MAX_JOBS. */
int batch_sweeps_count(const struct batch_sweeps *sweeps, uint32_t *n, struct sh_err *err);
/* The settings of a combination, from 0, in the order of the sweeps; the last sweep varies fastest. */
void batch_sweeps_at(const struct batch_sweeps *sweeps, uint32_t combination, const char *set[BATCH_MAX_SWEEPS]);

/* Numbers of stations, from 1. */
struct batch_stations {
    int all;
    uint32_t n, number[CONFIG_MAX_STOPS]; /* rising */
};

/* "all", or numbers and ranges as 1,3-5. */
int batch_stations_parse(const char *text, struct batch_stations *stations, struct sh_err *err);

/* Makes a job's name: its number with `digits` digits, the station's number, then the settings. Characters that are not
 * safe in names of files everywhere become _, and the end of a long name becomes a hash of the whole. */
enum { BATCH_NAME_LEN = 128 };
void batch_name(uint32_t number, int digits, uint32_t station, const char *const *set, uint32_t n,
                char name[BATCH_NAME_LEN]);

/* i/n, 1 <= i <= n. */
int batch_shard_parse(const char *text, uint32_t *i, uint32_t *n, struct sh_err *err);

#endif
