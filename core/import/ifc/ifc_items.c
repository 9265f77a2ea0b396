/* SPDX-License-Identifier: MIT */
#include "core/import/ifc/ifc_items.h"

#include <stdlib.h>
#include <string.h>

/* Nested deeper than this, a representation counts as empty. */
enum { MAX_DEPTH = 64 };
/* A record's mark, beside its kinds. Where a record leads back to itself, it has nothing more to add. */
enum { LOOKED_AT = 128 };

/* Beginnings of the types of items that have no surface. */
static const char *const thin[] = {
    "IFCPOLYLINE",
    "IFCINDEXEDPOLYCURVE",
    "IFCTRIMMEDCURVE",
    "IFCCOMPOSITECURVE",
    "IFCGEOMETRICCURVESET",
    "IFCBOUNDINGBOX",
    "IFCCIRCLE",
    "IFCELLIPSE",
    "IFCLINE",
    "IFCCARTESIANPOINT",
    "IFCBSPLINECURVE",
    "IFCRATIONALBSPLINEC",
    "IFCANNOTATION",
    "IFCTEXTLITERAL",
    "IFCLIGHTSOURCE",
    "IFCSTYLEDITEM",
    "IFCPLANAREXTENT",
    "IFCPLANARBOX",
    "IFCPOINTON",
    "IFCPOINTBY",
    "IFCEDGE",
    "IFCORIENTEDEDGE",
    "IFCSUBEDGE",
    "IFCVERTEX",
    "IFCPOLYLOOP",
    "IFCPATH",
    "IFCOFFSETCURVE",
    "IFCGRADIENTCURVE",
    "IFCSEGMENTEDREF",
    "IFCCURVESEGMENT",
    "IFCPOLYNOMIALC",
    "IFCCLOTHOID",
    "IFCCOSINESPIRAL",
    "IFCSINESPIRAL",
    "IFCSECONDORDERPOLY",
    "IFCTHIRDORDERPOLY",
    "IFCSEVENTHORDERPOLY",
    "IFCINTERSECTIONCURV",
    "IFCSEAMCURVE",
    "IFCPCURVE",
    "IFCDEFINEDSYMBOL",
    "IFCAXIS",
    "IFCDIRECTION",
    "IFCVECTOR",
    "IFCBOUNDARYCURVE",
    "IFCOUTERBOUNDARYC",
    "IFCDIMENSIONCURVE",
    "IFCPROJECTIONCURVE",
    "IFCTERMINATORSYMB",
    "IFCDRAUGHTINGCALL",
    "IFC2DCOMPOSITECURVE",
    "IFCBEZIERCURVE",
    "IFCRATIONALBEZIERCURVE",
    "IFCALIGNMENTCURVE",
    "IFCLINEARDIMENSION",
    "IFCANGULARDIMENSION",
    "IFCRADIUSDIMENSION",
    "IFCDIAMETERDIMENSION",
    "IFCSTRUCTUREDDIMENSIONC",
    "IFCFILLAREASTYLE",
    "IFCCIRCULARARCSEG",
    "IFCTRANSITIONCURVESEG",
    "IFCONEDIRECTIONREPEAT",
    "IFCTWODIRECTIONREPEAT",
};

/* Types with a surface that web-ifc or ifc-lite builds. */
static const char *const built[] = {
    "IFCEXTRUDEDAREASOLID",
    "IFCEXTRUDEDAREASOLIDTAPERED",
    "IFCREVOLVEDAREASOLID",
    "IFCREVOLVEDAREASOLIDTAPERED",
    "IFCFIXEDREFERENCESWEPTAREASOLID",
    "IFCSURFACECURVESWEPTAREASOLID",
    "IFCSWEPTDISKSOLID",
    "IFCSECTIONEDSOLIDHORIZONTAL",
    "IFCFACETEDBREP",
    "IFCFACETEDBREPWITHVOIDS",
    "IFCADVANCEDBREP",
    "IFCADVANCEDBREPWITHVOIDS",
    "IFCFACEBASEDSURFACEMODEL",
    "IFCSHELLBASEDSURFACEMODEL",
    "IFCCSGSOLID",
    "IFCBLOCK",
    "IFCSPHERE",
    "IFCRIGHTCIRCULARCYLINDER",
    "IFCRIGHTCIRCULARCONE",
    "IFCRECTANGULARPYRAMID",
    "IFCBOOLEANRESULT",
    "IFCBOOLEANCLIPPINGRESULT",
    "IFCTRIANGULATEDFACESET",
    "IFCTRIANGULATEDIRREGULARNETWORK",
    "IFCPOLYGONALFACESET",
    "IFCOPENSHELL",
    "IFCCLOSEDSHELL",
    "IFCCONNECTEDFACESET",
    NULL,
};

static bool is_thin(struct text_span type)
{
    for (size_t i = 0; i < sizeof thin / sizeof thin[0]; i++) {
        const size_t n = strlen(thin[i]);
        if (type.n >= n && memcmp(type.p, thin[i], n) == 0) return true;
    }
    return text_is(type, "IFCSURFACECURVE"); /* IfcSurfaceCurveSweptAreaSolid is a body */
}

static int look_at_list(struct ifc_items *items, struct text_span list, int depth);

/* A mapped representation may map others, each several times: the number of ways to them has no limit. */
static int look_once(struct ifc_items *items, const struct step_record *record, bool is_rep, int depth)
{
    struct text_span list = record->args, arg[REP_ARGS];
    unsigned char *seen = &items->seen[record - items->index->record];
    if ((*seen & LOOKED_AT) != 0 || depth >= MAX_DEPTH) return *seen & ~LOOKED_AT;
    *seen = LOOKED_AT;
    if (is_rep && step_split(record->args, arg, REP_ARGS) != REP_ARGS) return 0;
    if (is_rep) list = arg[REP_ITEMS];
    *seen = (unsigned char)(LOOKED_AT | look_at_list(items, list, depth + 1));
    return *seen & ~LOOKED_AT;
}

static int look_at(struct ifc_items *items, const struct step_record *item, int depth)
{
    if (text_is(item->type, "IFCMAPPEDITEM")) {
        const struct step_record *rep = ifc_items_mapped(items, item);
        return rep != NULL ? look_once(items, rep, true, depth) : 0;
    }
    if (text_is(item->type, "IFCGEOMETRICSET")) return look_once(items, item, false, depth);
    if (text_is(item->type, "IFCBOUNDINGBOX")) return HAS_BOX;
    if (is_thin(item->type)) return 0;
    return text_is_one_of(item->type, built) ? HAS_BODY : HAS_UNKNOWN;
}

static int look_at_list(struct ifc_items *items, struct text_span list, int depth)
{
    const char *p = list.p, *end = p + list.n;
    int has = 0;
    for (uint64_t id; !(has & HAS_BODY) && ifc_next_reference(&p, end, &id);) {
        const struct step_record *item = ifc_index_find(items->index, id);
        if (item != NULL) has |= look_at(items, item, depth);
    }
    return has;
}

bool ifc_items_open(struct ifc_items *items, const struct ifc_index *x)
{
    *items = (struct ifc_items){.index = x, .seen = calloc(x->n + 1, 1)};
    return items->seen != NULL;
}

void ifc_items_close(struct ifc_items *items)
{
    free(items->seen);
}

int ifc_items_of_list(struct ifc_items *items, struct text_span list)
{
    return look_at_list(items, list, 0);
}

int ifc_items_of(struct ifc_items *items, const struct step_record *item)
{
    return look_at(items, item, 0);
}

const struct step_record *ifc_items_mapped(const struct ifc_items *items, const struct step_record *item)
{
    /* IfcMappedItem(MappingSource, MappingTarget), IfcRepresentationMap(MappingOrigin, MappedRepresentation) */
    struct text_span arg[2];
    uint64_t id;
    if (!text_is(item->type, "IFCMAPPEDITEM") || step_split(item->args, arg, 2) != 2) return NULL;
    const struct step_record *map = ifc_index_follow(items->index, arg[0], "IFCREPRESENTATIONMAP");
    if (map == NULL || step_split(map->args, arg, 2) != 2 || !step_reference(arg[1], &id)) return NULL;
    return ifc_index_find(items->index, id);
}
