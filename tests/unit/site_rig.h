/* SPDX-License-Identifier: MIT */
/* For tests that load a site from a configuration: a folder of their own, and the warnings of the load. */
#ifndef TESTS_UNIT_SITE_RIG_H
#define TESTS_UNIT_SITE_RIG_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "firmware_sim/config/config.h"
#include "firmware_sim/config/load.h"
#include "firmware_sim/site/site.h"

extern char config_path[128]; /* test.yaml in the folder */
extern char warned[4096];     /* since the last clear_warned(), a line each */
extern struct config *cfg;
extern struct sh_err err;
extern const struct sh_report report; /* keeps warnings in warned */

/* Makes the folder, cfg, and the profiles of this tree. */
int site_rig_setup(void **state);
int site_rig_teardown(void **state);

/* Writes a file in the folder; the teardown removes it. */
void write_in(const char *name, const char *text);

void clear_warned(void);

#endif
