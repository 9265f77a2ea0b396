/* SPDX-License-Identifier: MIT */
/* The process that reads a mesh writes its scene into a file. The parent process reads that file, and checks it. */
#ifndef CORE_IMPORT_IMPORT_RESULT_H
#define CORE_IMPORT_IMPORT_RESULT_H

#include "core/scene.h"

struct scene_build;

/* Writes the scene to an empty file. The scene's arrays are released on the way. */
int import_result_write(struct scene *s, int fd, struct sh_err *err);

/* Adds the scene in the file to b, after b's other files. Nothing in it is trusted: SH_EINPUT says what is
 * wrong. The parts that have been read are cut out of the file, to free memory. */
int import_result_read(struct scene_build *b, int fd, struct sh_err *err);

#endif
