/* LAS files as clouds; the part of cloud_read that knows them. */
#ifndef CORE_ANALYSIS_CLOUD_LAS_H
#define CORE_ANALYSIS_CLOUD_LAS_H

#include <stdbool.h>

#include "core/cloud.h"
#include "core/text.h"

/* Does the file begin as a LAS file? */
bool cloud_is_las(const char *path);

/* As cloud_read, which see. */
int cloud_read_las(const char *path, const struct sh_report *report, struct cloud *out, struct sh_err *err);

#endif
