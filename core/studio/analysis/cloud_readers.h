/* SPDX-License-Identifier: MIT */
/* Private to core/studio/analysis: the readers that cloud.c chooses from. In: the path of a PLY, LAS, PCD or text file.
 * Out: its points in the file's coordinates, with station, label and echo where the file has them. */
#ifndef CORE_STUDIO_ANALYSIS_CLOUD_READERS_H
#define CORE_STUDIO_ANALYSIS_CLOUD_READERS_H

#include <stdbool.h>

#include "core/studio/cloud.h"

struct text;

/* Notes that the file has coordinates in single precision. count_m becomes the rounding step of the largest coordinate,
 * unless count_m is larger already. Warns where the error may be above 0.1 mm. */
void cloud_note_single(struct cloud *cloud, const char *path, const struct sh_report *report);
/* Whether these are three finite numbers, or three times NaN: a shot without echo. */
bool cloud_is_position(const double p[3]);
/* Fails if p is no such position, with the line of the file in the message. line 0: the file has no lines. */
int cloud_check_position(const struct text *t, uint64_t line, const double p[3], struct sh_err *err);

/* As cloud_read_columns; on failure the caller frees out. */
int cloud_read_las(const char *path, unsigned columns, const struct sh_report *report, struct cloud *out,
                   struct sh_err *err);
int cloud_read_ply(const char *path, unsigned columns, const struct sh_report *report, struct cloud *out,
                   struct sh_err *err);
int cloud_read_pcd(const char *path, const struct sh_report *report, struct cloud *out, struct sh_err *err);
int cloud_read_text(const char *path, const struct sh_report *report, struct cloud *out, struct sh_err *err);

#endif
