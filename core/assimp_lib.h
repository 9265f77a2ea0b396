/* SPDX-License-Identifier: MIT */
/* Assimp reads and writes the mesh formats for which the project has no code of its own. It is loaded late
 * (core/late.h). */
#ifndef CORE_ASSIMP_LIB_H
#define CORE_ASSIMP_LIB_H

#include <assimp/cexport.h>
#include <assimp/cimport.h>
#include <assimp/material.h>

#include "core/late.h"

#define ASSIMP_CALLS(CALL)             \
    CALL(aiAttachLogStream)            \
    CALL(aiCreatePropertyStore)        \
    CALL(aiDetachLogStream)            \
    CALL(aiExportSceneEx)              \
    CALL(aiGetErrorString)             \
    CALL(aiGetMaterialColor)           \
    CALL(aiGetMaterialFloatArray)      \
    CALL(aiGetMaterialString)          \
    CALL(aiGetMaterialTexture)         \
    CALL(aiGetMaterialUVTransform)     \
    CALL(aiImportFileExWithProperties) \
    CALL(aiReleaseImport)              \
    CALL(aiReleasePropertyStore)       \
    CALL(aiSetImportPropertyInteger)

LATE_LIBRARY(assimp, ASSIMP_CALLS)

#endif
