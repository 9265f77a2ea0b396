/* SPDX-License-Identifier: MIT */
/* The places of the copies of a mesh, from the configuration or from a CSV file. */
#ifndef FIRMWARE_SIM_SITE_COPIES_H
#define FIRMWARE_SIM_SITE_COPIES_H

#include <stdint.h>

struct config;
struct scene_places;
struct sh_err;
struct sh_report;

/* Reads where the copies of a mesh stand. The caller frees places->place in any case; NULL: the mesh has no copies. */
int site_read_copies(const struct config *cfg, uint32_t number, const struct sh_report *report,
                     struct scene_places *places, struct sh_err *err);

#endif
