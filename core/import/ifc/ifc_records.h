/* SPDX-License-Identifier: MIT */
/* The records of an IFC file, by number, and what they say of its products. Readers of bodies don't give this. In: a
 * path. Out: products with type, GlobalId and name, metres per unit, and marks of what their geometry consists of. */
#ifndef CORE_IMPORT_IFC_IFC_RECORDS_H
#define CORE_IMPORT_IFC_IFC_RECORDS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "core/import/ifc/step.h"

/* A style of surfaces, and an item that has it. */
struct ifc_style {
    uint64_t item;   /* first, for ifc_first; 0: it is a material's */
    char *name;      /* may be empty */
    float colour[3]; /* 0..1 */
    float clear;     /* its transparency, 0..1 */
};

struct ifc_product {
    uint64_t id;
    struct text_span type; /* as the file has it, in capitals */
    char *guid, *name;     /* UTF-8, whole; may be empty */
    uint64_t shape;        /* its IfcProductDefinitionShape; 0: none */
    bool is_air;           /* an opening, a space, a grid or an annotation: no surface */
    bool opens_nothing;    /* an opening that no IfcRelVoidsElement names */
    bool has_body;         /* its shape, walked through, has a solid or a surface */
    bool is_curved;
    bool is_coarse;                /* curved, and the body is ifc-lite's, which cuts circles up by levels of its own */
    bool is_turned;                /* it has a solid that is turned about an axis */
    double points_m;               /* largest coordinate of its points */
    bool is_far;                   /* it has points beyond 1 km of their own origin */
    struct text_span assimp_wrong; /* the first entity in it that Assimp is known to get wrong; n 0: none */
    uint32_t *style;               /* [n_styles] of its items, places in the records' style */
    size_t n_styles, room_styles;
};

struct ifc_records {
    struct text text;
    struct step_record *record; /* [n] by id */
    size_t n, room;
    struct ifc_product *product; /* [n_products] in the order of ids */
    size_t n_products, room_products;
    double unit_m;
    struct sh_err no_unit;   /* why the file's unit of length is not known, so that unit_m is 1; code 0: it is */
    double radius_m;         /* of the largest circle that is cut into edges; 0: there is none */
    uint32_t *mark, stamp;   /* [n] of the last walk */
    struct ifc_style *style; /* [n_styles] by item */
    size_t n_styles, room_styles;
};

/* Reads the records alone; ifc_records_close is due in any case. Errors (SH_EINPUT) name file, line and record: a file
 * that is cut off, a number that two records have, a reference to a record that is not there. No reader of bodies
 * reports any of these. */
int ifc_records_index(struct ifc_records *r, const char *path, struct sh_err *err);
/* Reads the products, too. A placement that leads back to itself is an error as well, which names the product. */
int ifc_records_open(struct ifc_records *r, const char *path, struct sh_err *err);
void ifc_records_close(struct ifc_records *r);

/* The next record number in a list of attributes, from *p on; texts are passed over. 0: there is none. */
uint64_t ifc_next_reference(const char **p, const char *end);

/* "FILE, line N: TYPE #n: what": SH_EINPUT. */
int ifc_records_fail(const struct ifc_records *r, const struct step_record *at, struct sh_err *err, const char *what);

/* NULL: there is none of that number. */
const struct step_record *ifc_records_find(const struct ifc_records *r, uint64_t id);
const struct ifc_product *ifc_records_product(const struct ifc_records *r, uint64_t id);

/* For lists of entries whose first member is their number, and for such a number itself. */
int ifc_compare(const void *a, const void *b);
/* The place of the first entry of such a list, sorted, whose number is id or above; n: there is none. */
size_t ifc_first(const void *list, size_t n, size_t size, uint64_t id);

/* ---- ifc_walk.c: fills the marks of all products. */
int ifc_walk(struct ifc_records *r, struct sh_err *err);

/* ---- ifc_styles.c */
int ifc_styles_collect(struct ifc_records *r, struct sh_err *err);
/* Returns how many styles an item has; they stand from *first on. */
size_t ifc_styles_of(const struct ifc_records *r, uint64_t item, size_t *first);
/* The style that a reader means by a colour of a product's part; NULL: the colour is the reader's own. */
const struct ifc_style *ifc_style_by_colour(const struct ifc_records *r, const struct ifc_product *p,
                                            const float colour[4]);

/* ---- ifc_text.c */

/* A text of a STEP file, its quotes around it, as UTF-8 from malloc: \X2\, \X4\, \X\, \S\, '' and raw bytes. Not a text
 * ($, *): empty. NULL: no memory. */
char *ifc_text(struct text_span quoted);

/* ---- ifc_unit.c: metres per unit of length, as the project says; SH_EINPUT where it doesn't. *m is good on success. */
int ifc_unit_find(const struct ifc_records *r, double *m, struct sh_err *err);
/* Likewise of one record. */
int ifc_unit_of(const struct ifc_records *r, const struct step_record *unit, double *m, struct sh_err *err);

#endif
