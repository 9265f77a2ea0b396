/* SPDX-License-Identifier: MIT */
/* Finds out whether lists of items have a body: items of a representation, of those that it maps, and of sets. */
#ifndef CORE_IMPORT_IFC_IFC_ITEMS_H
#define CORE_IMPORT_IFC_IFC_ITEMS_H

#include "core/import/ifc/ifc_index.h"

/* IfcShapeRepresentation(ContextOfItems, RepresentationIdentifier, RepresentationType, Items) */
enum { REP_CONTEXT = 0, REP_NAME = 1, REP_ITEMS = 3, REP_ARGS };

/* The kinds of items that count: boxes, bodies of a type that no reader is known to build, and bodies. */
enum { HAS_BOX = 1, HAS_UNKNOWN = 2, HAS_BODY = 4 };

struct ifc_items {
    const struct ifc_index *index;
    unsigned char *seen; /* [index.n] what is known of a record; 0: it was not looked at */
};

/* false: there is no memory. ifc_items_close is due in any case. */
bool ifc_items_open(struct ifc_items *items, const struct ifc_index *x);
void ifc_items_close(struct ifc_items *items);

/* Returns the kinds that a list of references has: 0, or a sum. Each mapped representation, and each
 * set, is looked at once, however often it is mapped. */
int ifc_items_of_list(struct ifc_items *items, struct text_span list);
int ifc_items_of(struct ifc_items *items, const struct step_record *item); /* the same for one item */

/* The representation that an IfcMappedItem maps; NULL: the item is no such item, or maps nothing. */
const struct step_record *ifc_items_mapped(const struct ifc_items *items, const struct step_record *item);

#endif
