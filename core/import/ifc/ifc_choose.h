/* SPDX-License-Identifier: MIT */
/* Chooses each product's body from two readings, by the rules of core/import/ifc/README.md. */
#ifndef CORE_IMPORT_IFC_IFC_CHOOSE_H
#define CORE_IMPORT_IFC_IFC_CHOOSE_H

#include "core/import/ifc/ifc_bodies.h"

struct ifc_product;

enum ifc_source { IFC_NONE, IFC_WEB, IFC_LITE };

/* The reason why a product is named in a warning. */
enum ifc_finding {
    IFC_AGREED,
    IFC_LOST,        /* its records have a body, and no reader makes one */
    IFC_BOXED,       /* its only shape is a bounding box */
    IFC_UNBODIED,    /* IFC calls none of its representations a body */
    IFC_BOX,         /* both make one, of different size or place */
    IFC_AREA,        /* both make one, of different area or volume */
    IFC_ONLY_WEB,    /* only that reader makes one */
    IFC_ONLY_LITE,   /* likewise */
    IFC_CLOSED_WEB,  /* only that one's is closed */
    IFC_CLOSED_LITE, /* likewise */
    IFC_OPEN,        /* both make the same, or one was run; the body is open */
    IFC_FAILED,      /* the reader whose body is taken reports a failure */
    IFC_ANALYSIS,    /* its surfaces are those of an analysis model */
    IFC_UNCUT,       /* the records have an opening that cuts nothing */
    IFC_FINDINGS,
};

struct ifc_choice {
    enum ifc_source source;
    enum ifc_finding finding;
};

/* web, lite: NULL where that reader has none. is_checked: both readers gave an answer. */
struct ifc_choice ifc_choose(const struct ifc_product *product, const struct ifc_body *web, const struct ifc_body *lite,
                             bool is_checked);

/* The words for a finding, after "N products: "; NULL for IFC_AGREED. */
const char *ifc_finding_text(enum ifc_finding finding);
/* A finding that means the scene may be wrong. */
bool ifc_is_doubtful(enum ifc_finding finding);

#endif
