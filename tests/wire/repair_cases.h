/* SPDX-License-Identifier: MIT */
/* The formats that a killed recorder or a full disk may leave, and what a repair has to make of them. A row for each; what is
 * checked knows nothing of the code that repairs. */
#ifndef TESTS_WIRE_REPAIR_CASES_H
#define TESTS_WIRE_REPAIR_CASES_H

#include "tests/wire/wire.h"

struct bytes {
    uint8_t *data; /* NUL behind its end */
    size_t len;
};

struct repair_row {
    const char *name;      /* of the file, without its ending */
    const char *ending;    /* with its dot */
    const char *option[8]; /* of `record`; ends with NULL */
    const char *
        reader[8]; /* a program of others that prints as many lines as the file has units; $F is the file. NULL: none */
    /* Of a complete recording of the same stream, of what was left and of what became of it: fails, or says how many units
     * the last one holds. All units that are whole in `left` must be in it, and it must begin as `whole` does. */
    uint64_t (*check)(const struct bytes *whole, const struct bytes *left, const struct bytes *repaired);
    /* 1: so little was left that there is nothing to repair. */
    int (*is_none)(const struct bytes *left);
};

extern const struct repair_row repair_cases[];

/* The ending of a file beside the recording, FILE + that, of which a repair makes the rest of it: on a full disk it needs more
 * room. The file goes with the repair. NULL: there is none. */
const char *repair_row_beside(const struct repair_row *row);
extern struct bytes repair_beside; /* what was left of that file */
extern const size_t n_repair_cases;

#endif
