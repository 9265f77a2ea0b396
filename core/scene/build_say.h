/* SPDX-License-Identifier: MIT */
/* The builder of a scene says what is wrong in the file that is being read, and how much of it has been read. */
#ifndef CORE_SCENE_BUILD_SAY_H
#define CORE_SCENE_BUILD_SAY_H

#include "core/err.h"

struct scene_build;

/* Fails with "FILE, line N, mesh 'M': text". Returns code. */
int build_fail(struct scene_build *b, int code, struct sh_err *err, const char *fmt, ...)
    __attribute__((format(printf, 4, 5)));
/* Warns with "FILE: text". */
void build_warn(const struct scene_build *b, const char *fmt, ...) __attribute__((format(printf, 2, 3)));

/* Reports "reading FILE" about four times a second, once the load takes longer than a second.
 * Returns SH_ESTOPPED when the user has asked to stop. build: a struct scene_build. */
int build_progress(void *build, double fraction, struct sh_err *err);

/* Reports "reading FILE" at once. fraction: negative where it is unknown. */
void build_report(struct scene_build *b, double fraction);

#endif
