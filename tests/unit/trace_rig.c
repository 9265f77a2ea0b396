/* SPDX-License-Identifier: MIT */
#include "tests/unit/trace_rig.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

char trace[4096];
const char *fails, *fails_too;

void say(const char *format, ...)
{
    va_list args;
    va_start(args, format);
    const size_t n = strlen(trace);
    vsnprintf(trace + n, sizeof trace - n, format, args);
    va_end(args);
}

int attempt(struct sh_err *err, const char *name)
{
    const int is_bad =
        (fails != NULL && strcmp(fails, name) == 0) || (fails_too != NULL && strcmp(fails_too, name) == 0);
    return is_bad ? sh_fail(err, SH_EIO, "%s failed", name) : SH_OK;
}

int call(struct sh_err *err, const char *format, ...)
{
    char name[400];
    va_list args;
    va_start(args, format);
    vsnprintf(name, sizeof name, format, args);
    va_end(args);
    say("%s ", name);
    return attempt(err, name);
}
