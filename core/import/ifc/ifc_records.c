/* SPDX-License-Identifier: MIT */
#include "core/import/ifc/ifc_records.h"

#include <stdlib.h>
#include <string.h>

#include "core/grow.h"
#include "core/import/ifc/ifc_points.h"
#include "core/import/ifc/ifc_shapes.h"
#include "core/import/ifc/ifc_styles.h"
#include "core/import/ifc/ifc_text.h"
#include "core/import/ifc/ifc_unit.h"
#include "core/import/ifc/ifc_walk.h"

/* An IfcProduct has the attributes GlobalId, OwnerHistory, Name, Description, ObjectType, ObjectPlacement and
 * Representation. */
enum { PRODUCT_GUID = 0, PRODUCT_NAME = 2, PRODUCT_PLACEMENT = 5, PRODUCT_SHAPE = 6, PRODUCT_ARGS = 7 };

const struct ifc_product *ifc_records_product(const struct ifc_records *r, uint64_t id)
{
    return r->n_products > 0 ? bsearch(&id, r->product, r->n_products, sizeof *r->product, ifc_compare) : NULL;
}

/* Members, connections and loads of an analysis model, IfcStructuralItem and IfcStructuralActivity: the building's own
 * walls and slabs stand in the same places. */
static bool is_analysis(struct text_span type)
{
    static const char start[] = "IFCSTRUCTURAL";
    return type.n >= sizeof start - 1 && memcmp(type.p, start, sizeof start - 1) == 0;
}

/* Types without a surface: air, drawings, and connections. */
static bool is_air(struct text_span type)
{
    static const char *const air[] = {"IFCOPENINGELEMENT", "IFCOPENINGSTANDARDCASE", "IFCVOIDINGFEATURE",
                                      "IFCSPACE",          "IFCSPATIALZONE",         "IFCEXTERNALSPATIALELEMENT",
                                      "IFCGRID",           "IFCANNOTATION",          "IFCVIRTUALELEMENT",
                                      "IFCPORT",           "IFCDISTRIBUTIONPORT",    NULL};
    return text_is_one_of(type, air);
}

/* IfcLocalPlacement(PlacementRelTo, RelativePlacement): follows PlacementRelTo up to a placement that is absolute, or
 * that was checked for another product. A chain that comes back to one of its own placements has no end. */
static int check_placement(struct ifc_records *r, const struct ifc_product *p, struct text_span placement,
                           struct sh_err *err)
{
    const uint32_t own = ++r->stamp;
    uint64_t id;
    while (step_reference(placement, &id)) {
        const struct step_record *at = ifc_index_find(&r->index, id);
        if (at == NULL || !text_is(at->type, "IFCLOCALPLACEMENT") || step_split(at->args, &placement, 1) < 1)
            return SH_OK;
        uint32_t *mark = &r->mark[at - r->index.record];
        if (*mark == own)
            return text_fail(&r->index.text, at->line, SH_EINPUT, err,
                             "IFCLOCALPLACEMENT #%llu is relative to itself, so " IFC_PRODUCT_FORMAT " has no place",
                             (unsigned long long)at->id, IFC_PRODUCT_WORDS(p));
        if (*mark != 0) return SH_OK;
        *mark = own;
    }
    return SH_OK;
}

/* Recognises a product of any type: its first attribute is a GlobalId, and its seventh a shape. */
static int add_product(struct ifc_records *r, const struct step_record *record, struct sh_err *err)
{
    struct text_span arg[PRODUCT_ARGS];
    uint64_t shape;
    if (record->args.n < 2 || record->args.p[0] != '\'' || step_split(record->args, arg, PRODUCT_ARGS) < PRODUCT_ARGS ||
        !step_reference(arg[PRODUCT_SHAPE], &shape))
        return SH_OK;
    const struct step_record *to = ifc_index_find(&r->index, shape);
    if (to != NULL && !text_is(to->type, "IFCPRODUCTDEFINITIONSHAPE") && !text_is(to->type, "IFCPRODUCTREPRESENTATION"))
        return SH_OK;
    if (!grow(&r->product, &r->room_products, r->n_products + 1, sizeof *r->product))
        return ifc_no_memory(&r->index, err);
    struct ifc_product *p = &r->product[r->n_products++];
    *p = (struct ifc_product){.id = record->id,
                              .type = record->type,
                              .guid = ifc_text(arg[PRODUCT_GUID]),
                              .name = ifc_text(arg[PRODUCT_NAME]),
                              .shape = shape,
                              .is_analysis = is_analysis(record->type),
                              .is_air = is_air(record->type) || is_analysis(record->type)};
    if (p->guid == NULL || p->name == NULL) return ifc_no_memory(&r->index, err);
    return check_placement(r, p, arg[PRODUCT_PLACEMENT], err);
}

int ifc_records_open(struct ifc_records *r, const char *path, struct sh_err *err)
{
    *r = (struct ifc_records){.unit_m = 1.0};
    int rc = ifc_index_open(&r->index, path, err);
    if (rc != SH_OK) return rc;
    if (ifc_unit_find(&r->index, &r->unit_m, &r->no_unit) != SH_OK) r->unit_m = 1.0;
    r->mark = calloc(r->index.n + 1, sizeof *r->mark);
    if (r->mark == NULL) return ifc_no_memory(&r->index, err);
    for (size_t i = 0; i < r->index.n && rc == SH_OK; i++)
        rc = add_product(r, &r->index.record[i], err);
    if (rc == SH_OK) rc = ifc_shapes_choose(&r->index, r->product, r->n_products, &r->edits, err);
    if (rc == SH_OK) rc = ifc_points_resolve(&r->index, &r->edits, err);
    if (rc == SH_OK) rc = ifc_styles_collect(r, err);
    return rc == SH_OK ? ifc_walk(r, err) : rc;
}

bool ifc_records_hide_analysis(struct ifc_records *r)
{
    struct text_span arg[PRODUCT_ARGS];
    bool has = false;
    for (size_t i = 0; i < r->n_products; i++) {
        const struct ifc_product *p = &r->product[i];
        const struct step_record *record = p->is_analysis ? ifc_index_find(&r->index, p->id) : NULL;
        if (record == NULL || step_split(record->args, arg, PRODUCT_ARGS) < PRODUCT_ARGS) continue;
        const struct text_span shape = arg[PRODUCT_SHAPE]; /* a reference, so it has a byte for the $ */
        char *at = r->index.text.data + (shape.p - r->index.text.data);
        memset(at, ' ', shape.n);
        at[shape.n - 1] = '$';
        has = true;
    }
    return has;
}

void ifc_records_close(struct ifc_records *r)
{
    for (size_t i = 0; i < r->n_products; i++) {
        struct ifc_product *p = &r->product[i];
        free(p->style);
        free(p->guid);
        free(p->name);
    }
    free(r->product);
    free(r->mark);
    for (size_t i = 0; i < r->n_styles; i++)
        free(r->style[i].name);
    free(r->style);
    ifc_edits_free(&r->edits);
    ifc_index_close(&r->index);
}
