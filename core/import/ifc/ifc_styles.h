/* SPDX-License-Identifier: MIT */
/* Styles of surfaces give names and colours to items of an IFC file. */
#ifndef CORE_IMPORT_IFC_IFC_STYLES_H
#define CORE_IMPORT_IFC_IFC_STYLES_H

#include <stddef.h>
#include <stdint.h>

#include "core/err.h"

/* A style of surfaces, and an item that has it. */
struct ifc_style {
    uint64_t item;   /* stands first, as ifc_first demands; 0: the style is a material's */
    char *name;      /* may be empty */
    float colour[3]; /* 0..1 */
    float clear;     /* its transparency, 0..1 */
};

struct ifc_product;
struct ifc_records;

/* Fills the records' styles. */
int ifc_styles_collect(struct ifc_records *r, struct sh_err *err);
/* Returns how many styles an item has; they stand from *first on. */
size_t ifc_styles_of(const struct ifc_records *r, uint64_t item, size_t *first);
/* The style that a reader means by a colour of a product's part; NULL: the colour is the reader's own. */
const struct ifc_style *ifc_style_by_colour(const struct ifc_records *r, const struct ifc_product *p,
                                            const float colour[4]);

#endif
