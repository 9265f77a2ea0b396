/* SPDX-License-Identifier: MIT */
/* The rows of the table: a header, and what it does. */
#ifndef FIRMWARE_SIM_COMMAND_ROW_H
#define FIRMWARE_SIM_COMMAND_ROW_H

#include <stddef.h>

struct command_call;
struct command_setting;

struct command_unit {
    const char *name;     /* as errors print it; "" for a plain count */
    int decimals;         /* the integer counts 10^-decimals of the unit */
    const char *suffixes; /* as errors list them */
    struct {
        const char *suffix;
        int shift; /* power of ten to the unit */
    } suffix[4];
    const char *takes; /* the parameters, as an error lists them; NULL: a number or a word */
};

struct command_row {
    const char *header;
    /* Both functions return 0, or -1 when the command failed. */
    int (*query)(struct command_call *call); /* NULL: no query form */
    int (*act)(struct command_call *call);   /* NULL: only a query */
    const struct command_unit *unit;         /* of act's one number; NULL: act takes none */
    const struct command_setting *setting;   /* NULL: MIN, MAX and DEF have no meaning */
    int open;                                /* act is open to all sessions */
    int pose;                                /* a pose may follow the number */
    int own;                                 /* both forms take their parameters themselves */
    int word;                                /* the query may have a word, in param */
    int event; /* of an action that depends on the state: enum head_event + 1; 0: it doesn't */
};

extern const struct command_row command_rows[]; /* up to one without a header */
/* Returns the row of a header in its short or long form; NULL: there is none. */
const struct command_row *command_find_row(const char *header, size_t len);

#endif
