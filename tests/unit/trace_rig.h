/* SPDX-License-Identifier: MIT */
/* The calls that a module makes of functions that a test has replaced: each of them notes itself here, and one may
 * fail. The test compares the notes as a whole, so a call that is missing, or in the wrong place, shows. */
#ifndef TESTS_UNIT_TRACE_RIG_H
#define TESTS_UNIT_TRACE_RIG_H

#include "core/err.h"

extern char trace[4096];
extern const char *fails, *fails_too; /* the calls that fail, as they are noted; NULL: none */

/* Adds to the trace. */
void say(const char *format, ...);
/* Returns SH_EIO with "NAME failed" where it is one of those that fail. */
int attempt(struct sh_err *err, const char *name);
/* Does both: notes the call, with a blank after it, and returns what attempt does. */
int call(struct sh_err *err, const char *format, ...);

#endif
