/* SPDX-License-Identifier: MIT */
/* For tests of tables, this is a table of a few rows with a reader that fills its struct. */
#ifndef TESTS_UNIT_SHELF_RIG_H
#define TESTS_UNIT_SHELF_RIG_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "firmware_sim/config/load.h"
#include "firmware_sim/config/table/reader.h"

struct tin {
    double weight_kg;
    char name[8];
};

struct shelf {
    double high_m;
    struct tin tin[4];
    uint32_t n_tins;
    int locked;
};

enum { HEAD, HIGH, LOCKED, TINS, TIN, WEIGHT, NAME, LABEL, ROWS };
extern const struct cfg_key keys[ROWS];
extern const struct cfg_table table;

extern struct cfg_reader rd; /* of shelf.yaml */
extern struct shelf shelf;
extern struct config_diagnostics found;

/* Empties all of them. */
int begin(void **state);

/* The last of the diagnostics in their order is this text. */
void expect_last(const char *text);

#endif
