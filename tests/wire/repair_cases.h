/* SPDX-License-Identifier: MIT */
/* The formats that a killed recorder or a full disk may leave, and the required result of a repair. Each has a row. The
 * checks use nothing of the code that repairs. */
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
    /* Compares a complete recording of the same stream, the left file and the repaired one. The check fails, or returns
     * how many units the repaired file holds. All units that are whole in `left` must be in it, and it must begin as
     * `whole` does. */
    uint64_t (*check)(const struct bytes *whole, const struct bytes *left, const struct bytes *repaired);
    /* Returns 1 where so little was left that there is nothing to repair. */
    int (*is_none)(const struct bytes *left);
};

extern const struct repair_row repair_cases[];

/* Returns what follows FILE in the name of a second file, from which a repair makes the recording's rest. So the
 * repair needs free room on the disk. The second file is gone after the repair. NULL: there is none. */
const char *repair_row_beside(const struct repair_row *row);
extern struct bytes repair_beside; /* the second file as the killed recorder left it */
extern const size_t n_repair_cases;

#endif
