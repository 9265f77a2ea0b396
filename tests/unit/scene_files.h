/* SPDX-License-Identifier: MIT */
/* For tests of the scene: files in a folder of their own, and a load that collects warnings. */
#ifndef TESTS_UNIT_SCENE_FILES_H
#define TESTS_UNIT_SCENE_FILES_H

#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "core/scene.h"

extern char folder[64];
extern char path[128];
extern char warnings[4096]; /* of the last load, a line each */
extern int n_warnings;

int make_folder(void **state);

int remove_folder(void **state);

/* Paths are good until the next call. */
const char *path_in(const char *name);
const char *write_file(const char *name, const void *data, size_t len);

const char *write_text(const char *name, const char *text);

void keep_warning(void *ctx, const char *text);

int load_spec(const struct scene_mesh_spec *spec, double tolerance_m, struct scene **out, struct sh_err *err);

/* Loads it unchanged: z up, metres, at the origin, float coordinates good to a millimetre. */
struct scene *load(const char *file);

struct scene *load_text(const char *name, const char *text);

/* Loading has to fail with a line of text that names the file and holds `expected`. */
void refuse(const char *name, const void *data, size_t len, const char *expected);

double triangle_area(const struct scene *s, uint32_t i);

double total_area(const struct scene *s);

/* Adds signed tetrahedra with the origin: they are above 0 where the faces look away from it. */
double total_volume(const struct scene *s);

#endif
