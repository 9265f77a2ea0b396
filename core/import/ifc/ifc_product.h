/* SPDX-License-Identifier: MIT */
/* A product of an IFC file, as its records describe it. Marks say what its geometry consists of. */
#ifndef CORE_IMPORT_IFC_IFC_PRODUCT_H
#define CORE_IMPORT_IFC_IFC_PRODUCT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "core/text.h"

/* The words of a product in messages: a format for printf, and its arguments. */
#define IFC_PRODUCT_FORMAT "%.*s '%.40s' %.22s"
#define IFC_PRODUCT_WORDS(product) \
    (int)((product)->type.n < 48 ? (product)->type.n : 48), (product)->type.p, (product)->name, (product)->guid

struct ifc_product {
    uint64_t id;
    struct text_span type; /* as the file has it, in capitals */
    char *guid, *name;     /* UTF-8, whole; may be empty */
    uint64_t shape;        /* its IfcProductDefinitionShape; 0: none */
    bool is_air;        /* a type without a surface: air, a drawing or a connection, or is_analysis (ifc_records.c) */
    bool is_analysis;   /* part of an analysis model, which is not built */
    bool opens_nothing; /* an opening that no IfcRelVoidsElement names */
    bool has_body;      /* its shape has a solid or a surface that is a body */
    bool is_boxed;      /* its shape has a bounding box, and neither a solid nor a surface */
    bool is_unbodied;   /* its shape has solids or surfaces, but IFC calls none of them a body */
    bool is_level;      /* its shape has bodies for several views or scales, and one is taken */
    bool is_curved;
    int finding;                   /* enum ifc_finding, once its body is chosen */
    bool is_coarse;                /* curved, and the body is ifc-lite's, which cuts circles up by levels of its own */
    bool is_turned;                /* it has a solid that is turned about an axis */
    double points_m;               /* largest coordinate of its points */
    bool is_far;                   /* points_m is more than 1 km */
    struct text_span assimp_wrong; /* the first entity in it that Assimp is known to get wrong; n 0: none */
    uint32_t *style;               /* [n_styles] styles of its items, as indices into ifc_records.style */
    size_t n_styles, room_styles;
};

#endif
