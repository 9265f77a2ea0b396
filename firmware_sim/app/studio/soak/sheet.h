/* SPDX-License-Identifier: MIT */
/* The results, as text and as JSON. */
#ifndef FIRMWARE_SIM_APP_STUDIO_SOAK_SHEET_H
#define FIRMWARE_SIM_APP_STUDIO_SOAK_SHEET_H

#include <stdio.h>

struct json;
struct sh_report;
struct soak;

/* Fills soak->failures. */
void soak_conclude(struct soak *soak);
/* Warns if hardly any fault could be noticed: the verdict says little then. */
void soak_warn_hidden(const struct soak *soak, const struct sh_report *report);
void soak_print(const struct soak *soak, FILE *out);
void soak_put(struct json *json, const void *soak);
/* Prints a line on standard error. */
void soak_say_progress(struct soak *soak, double s);

#endif
