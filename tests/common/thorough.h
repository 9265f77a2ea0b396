/* SPDX-License-Identifier: MIT */
/* How deep a test goes: in full depth with THOROUGH=1 in the environment, less deep without. */
#ifndef TESTS_COMMON_THOROUGH_H
#define TESTS_COMMON_THOROUGH_H

#include <stdlib.h>
#include <string.h>

/* Sanitizers check the code, and need few turns for that: each takes up to ten times as long with them. Tests that need
 * the full count run as shipped, too (tests/shipped.sh). */
#ifdef SH_SANITIZE
enum { SANITIZED = 1 };
#else
enum { SANITIZED = 0 };
#endif

/* Returns a share of n turns in a build with sanitizers, at least one; else n. */
static inline int fewer(int n)
{
    return SANITIZED ? (n + 9) / 10 : n;
}

/* Returns `full` where THOROUGH=1 is in the environment, else `quick`: counts of cases, rays, seconds. Bounds that
 * depend on the count have to be computed from the returned value. Other threads may not change the environment
 * meanwhile. */
static inline int thorough(int full, int quick)
{
    const char *text = getenv("THOROUGH");

    return text != NULL && strcmp(text, "1") == 0 ? full : quick;
}

#endif
