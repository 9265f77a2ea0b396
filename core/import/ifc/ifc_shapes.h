/* SPDX-License-Identifier: MIT */
/* Chooses those representations of each product's shape that are its body. Both readers of bodies would build each
 * representation, a clearance as well as a wall. README.md has the rules. */
#ifndef CORE_IMPORT_IFC_IFC_SHAPES_H
#define CORE_IMPORT_IFC_IFC_SHAPES_H

#include "core/import/ifc/ifc_edits.h"

struct ifc_index;
struct ifc_product;

/* Fills has_body, is_boxed, is_unbodied and is_level of all products. Takes the other representations out of the
 * shapes, in the index's text and by edits. */
int ifc_shapes_choose(struct ifc_index *x, struct ifc_product *product, size_t n_products, struct ifc_edits *edits,
                      struct sh_err *err);

#endif
