/* SPDX-License-Identifier: MIT */
#include "core/import/gltf/gltf_at.h"

#include <stdarg.h>
#include <stdio.h>

struct gltf_at gltf_at(const char *fmt, ...)
{
    struct gltf_at at;
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(at.text, sizeof at.text, fmt, ap);
    va_end(ap);
    return at;
}
