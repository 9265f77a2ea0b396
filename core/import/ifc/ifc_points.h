/* SPDX-License-Identifier: MIT */
/* Resolves what readers of bodies pass over in tessellations: an index into the points (PnIndex), and triangles that
 * are holes (Flags of IfcTriangulatedIrregularNetwork). */
#ifndef CORE_IMPORT_IFC_IFC_POINTS_H
#define CORE_IMPORT_IFC_IFC_POINTS_H

#include "core/import/ifc/ifc_edits.h"
#include "core/import/ifc/ifc_index.h"

/* By edits, each face set with a PnIndex gets a list of points in the order of that index, and triangles with a
 * negative flag are left out. SH_EINPUT names the record whose index leads to no point. */
int ifc_points_resolve(struct ifc_index *x, struct ifc_edits *edits, struct sh_err *err);

#endif
