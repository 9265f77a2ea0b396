/* SPDX-License-Identifier: MIT */
/* CSV files that commands write: RFC 4180 with line feeds, UTF-8, a first line that names the columns. */
#ifndef FIRMWARE_SIM_APP_CSV_FILE_H
#define FIRMWARE_SIM_APP_CSV_FILE_H

#include <stdio.h>

#include "core/scene.h"

/* Writes a text, in quotes where it needs them. */
void csv_file_put_text(FILE *out, const char *text);
/* Returns #rrggbb, or "" where the surface has no colour. */
enum { CSV_FILE_COLOUR_LEN = 40 };
const char *csv_file_colour(const struct scene_surface *surface, char text[CSV_FILE_COLOUR_LEN]);

#endif
