/* SPDX-License-Identifier: MIT */
/* A mesh names files: libraries of materials, and textures. Folders are paths up to their last slash, and may be
 * empty. */
#ifndef CORE_SCENE_FIND_FILE_H
#define CORE_SCENE_FIND_FILE_H

#include "core/text.h"

struct text_span build_folder_of(const char *path);
/* Returns folder and name as one path, with / for each \ of the name. A name that begins with / is a path by itself.
 * The path is to be freed; NULL: there is no memory. */
char *build_join(struct text_span folder, struct text_span name);
/* Finds a file in one of the folders: by the whole name, or else by the name's last part. Where neither is there, the
 * case of letters is ignored with any_case, for the whole name (unless it begins with /) and then for its last part.
 * The path is to be freed; NULL: the file is nowhere, or there is no memory. */
char *build_find_file(const struct text_span *folder, size_t n, struct text_span name, int any_case);

#endif
