/* Checks of an IFC file that Assimp does not make: it crashes on such files. In: a path. Out: 0, or an error
 * with file, line and id. */
#ifndef CORE_SCENE_IFC_CHECK_H
#define CORE_SCENE_IFC_CHECK_H

#include "core/err.h"

/* Every reference #id must have its record: SH_EINPUT names file, line and id. References to records of a
 * type that the file's schema does not have are not found: Assimp takes those for missing. */
int ifc_check_references(const char *path, struct sh_err *err);

#endif
