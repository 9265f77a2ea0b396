/* SPDX-License-Identifier: MIT */
/* Cases of test_config.c: edits that make a loading configuration fail. test_config_messages.c has those whose message
 * has numbers. */
#ifndef TESTS_UNIT_CONFIG_CASES_H
#define TESTS_UNIT_CONFIG_CASES_H

#include "tests/unit/config_rig.h"

struct bad {
    const char *old, *with; /* edit of base; old NULL: with is the whole file */
    int line;
    const char *key; /* NULL: the error is about the file */
    const char *fragment;
};

#define UTM_PLACE "utm_zone: 33\n    hemisphere: north\n    easting_m: 5e5\n    northing_m: 5e6\n    height_m: 0\n"
extern const struct bad bad[];
extern const size_t n_bad;
#endif
