/* SPDX-License-Identifier: MIT */
/* Libraries that few runs need, loaded at their first use. These libraries and their dependencies take twice as long to
 * load as everything that every run needs.
 *
 *   #define PROJ_CALLS(CALL) CALL(proj_create) CALL(proj_destroy)      the calls that the project uses
 *   LATE_LIBRARY(proj, PROJ_CALLS)
 *
 * makes `struct proj_lib`, whose members are these calls, and `int proj_lib_load(struct proj_lib *lib, struct sh_err
 * *err)`: SH_EINPUT where the library is not on this machine, or lacks a call; SH_ENOMEM. A call is
 * lib.proj_create(...), with the types of the library's own header. Any thread; the library stays until the process
 * ends. The Makefile takes the library's file name (SONAME_proj) from the installed one. */
#ifndef CORE_LATE_H
#define CORE_LATE_H

#include <stddef.h>

#include "core/err.h"

enum late_library { LATE_proj, LATE_assimp, LATE_tiff, LATE_websockets };

/* Fills calls[n], pointers to functions, by their names. With n = 0 it loads the library and no more. */
int late_load(enum late_library which, const char *const *name, void *calls, size_t n, struct sh_err *err);

#define LATE_MEMBER(call) __typeof__(call) *call;
#define LATE_NAME(call)   #call,
#define LATE_LIBRARY(library, CALLS)                                                    \
    struct library##_lib {                                                              \
        CALLS(LATE_MEMBER)                                                              \
    };                                                                                  \
    static inline int library##_lib_load(struct library##_lib *lib, struct sh_err *err) \
    {                                                                                   \
        static const char *const name[] = {CALLS(LATE_NAME)};                           \
        return late_load(LATE_##library, name, lib, sizeof name / sizeof name[0], err); \
    }

#endif
