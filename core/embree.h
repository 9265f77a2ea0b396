/* Embree 3 or 4, whichever is installed: the one place that includes it. Version 3 comes first where both
 * are, since the Makefile links it; point queries are the same in both. And what its errors mean. */
#ifndef CORE_EMBREE_H
#define CORE_EMBREE_H

#if __has_include(<embree3/rtcore.h>)
#include <embree3/rtcore.h>
#elif __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#error "Embree is missing: install libembree-dev"
#endif

#include "core/err.h"

/* The error that one of Embree's is. what: what was to be made. */
int embree_fail(enum RTCError code, const char *what, struct sh_err *err);

#endif
