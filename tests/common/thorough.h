/* How deep a test goes: everything in full depth with THOROUGH=1 in the environment, less without. */
#ifndef TESTS_COMMON_THOROUGH_H
#define TESTS_COMMON_THOROUGH_H

#include <stdlib.h>
#include <string.h>

/* full where THOROUGH=1 is in the environment, else quick: counts of cases, rays, seconds. Bounds that depend on the
 * count have to be computed from what this returned. Beside other threads only while none of them changes the
 * environment. */
static inline int thorough(int full, int quick)
{
    const char *text = getenv("THOROUGH");

    return text != NULL && strcmp(text, "1") == 0 ? full : quick;
}

#endif
