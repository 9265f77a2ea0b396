/* SPDX-License-Identifier: MIT */
/* This finds the unit of length of an IFC file. */
#ifndef CORE_IMPORT_IFC_IFC_UNIT_H
#define CORE_IMPORT_IFC_IFC_UNIT_H

#include "core/import/ifc/ifc_index.h"

/* Sets *m to the metres per unit of length, as the IfcProject gives them. SH_EINPUT where the project gives none. */
int ifc_unit_find(const struct ifc_index *x, double *m, struct sh_err *err);
/* The same for a record that is a unit. */
int ifc_unit_of(const struct ifc_index *x, const struct step_record *unit, double *m, struct sh_err *err);

#endif
