/* SPDX-License-Identifier: MIT */
/* This finds out what the geometry of each product consists of. */
#ifndef CORE_IMPORT_IFC_IFC_WALK_H
#define CORE_IMPORT_IFC_IFC_WALK_H

#include "core/err.h"

struct ifc_records;

/* Fills the marks of all products. Products that are air (is_air) get opens_nothing alone. */
int ifc_walk(struct ifc_records *r, struct sh_err *err);

#endif
