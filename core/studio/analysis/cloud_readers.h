/* SPDX-License-Identifier: MIT */
/* Private to core/studio/analysis: the readers that cloud_read_columns chooses from. In: the path of a PLY or LAS file. Out:
 * its points in the file's coordinates, with station, label and echo where the file has them. */
#ifndef CORE_STUDIO_ANALYSIS_CLOUD_READERS_H
#define CORE_STUDIO_ANALYSIS_CLOUD_READERS_H

#include "core/studio/cloud.h"

/* Beside enum cloud_column. */
enum { CLOUD_HAS_STATION = 256, CLOUD_HAS_LABEL = 512, CLOUD_HAS_ECHO = 1024 };

/* Arrays for n points: positions, and those named in `has`. */
int cloud_reserve(struct cloud *cloud, size_t n, unsigned has, struct sh_err *err);

/* As cloud_read_columns; on failure the caller frees out. */
int cloud_read_las(const char *path, unsigned columns, const struct sh_report *report, struct cloud *out,
                   struct sh_err *err);
int cloud_read_ply(const char *path, unsigned columns, const struct sh_report *report, struct cloud *out,
                   struct sh_err *err);

#endif
