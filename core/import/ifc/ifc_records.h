/* SPDX-License-Identifier: MIT */
/* Reads the records of an IFC file. The records say more of the file's products than web-ifc and ifc-lite do, which
 * make the bodies. In: a path. Out: products with type, GlobalId and name, metres per unit, and marks of what their
 * geometry consists of. */
#ifndef CORE_IMPORT_IFC_IFC_RECORDS_H
#define CORE_IMPORT_IFC_IFC_RECORDS_H

#include <stddef.h>
#include <stdint.h>

#include "core/import/ifc/ifc_edits.h"
#include "core/import/ifc/ifc_index.h"
#include "core/import/ifc/ifc_product.h"

struct ifc_style;

struct ifc_records {
    struct ifc_index index;
    struct ifc_product *product; /* [n_products] in the order of ids */
    size_t n_products, room_products;
    double unit_m;
    struct sh_err no_unit; /* why the file's unit of length is not known, so that unit_m is 1; code 0: it is known */
    double radius_m;       /* of the largest circle that is cut into edges; 0: there is none */
    /* mark: [index.n] the walk that last came to a record, 0: none did. stamp: the last walk. Walks count from 1. */
    uint32_t *mark, stamp;
    struct ifc_style *style; /* [n_styles] by item */
    size_t n_styles, room_styles;
    struct ifc_edits edits; /* what the readers of bodies get in another form than the file has it */
    size_t n_limited;       /* styles whose colour or transparency was beyond 0..1, and is limited to it */
};

/* Reads records and products; ifc_records_close is due in any case. Errors are those of ifc_index_open. A placement
 * that leads back to itself is an error as well, which names the product. */
int ifc_records_open(struct ifc_records *r, const char *path, struct sh_err *err);
void ifc_records_close(struct ifc_records *r);

/* NULL: there is none of that number. */
const struct ifc_product *ifc_records_product(const struct ifc_records *r, uint64_t id);

/* Takes the shapes from the members of analysis models in the index's text. Returns whether there was one. */
bool ifc_records_hide_analysis(struct ifc_records *r);

#endif
