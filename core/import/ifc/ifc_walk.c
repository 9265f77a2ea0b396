/* SPDX-License-Identifier: MIT */
/* Finds the entities in the geometry of each product. The search walks through the product's shape, and those of its
 * openings, from record to record. */
#include "core/import/ifc/ifc_walk.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/grow.h"
#include "core/import/ifc/ifc_records.h"
#include "core/import/ifc/ifc_styles.h"

#define FAR_M 1000.0

enum kind {
    PLAIN = 0,
    STOP = 1,        /* no geometry follows from here */
    CURVED = 4,      /* it has circles or other curves, which readers cut up */
    ASSIMP_ERRS = 8, /* Assimp is known to get it wrong without a message */
    POINTS = 16,     /* points, which may be far */
    TURNED = 64,     /* a profile turned about an axis: its points bound the radius */
    RADIUS = 32,     /* a circle or the like: keep_radius knows the attribute */
};

struct type_kind {
    const char *type;
    int kind;
};

/* By name, for bsearch. */
static const struct type_kind kinds[] = {
    {"IFCADVANCEDBREP", CURVED | ASSIMP_ERRS},
    {"IFCADVANCEDBREPWITHVOIDS", CURVED | ASSIMP_ERRS},
    {"IFCARBITRARYPROFILEDEFWITHVOIDS", ASSIMP_ERRS},
    {"IFCASYMMETRICISHAPEPROFILEDEF", ASSIMP_ERRS},
    {"IFCBLOCK", ASSIMP_ERRS},
    {"IFCBOOLEANCLIPPINGRESULT", ASSIMP_ERRS},
    {"IFCBOOLEANRESULT", ASSIMP_ERRS},
    {"IFCBSPLINECURVEWITHKNOTS", CURVED},
    {"IFCBSPLINESURFACEWITHKNOTS", CURVED | ASSIMP_ERRS},
    {"IFCCARTESIANPOINT", POINTS},
    {"IFCCARTESIANPOINTLIST2D", POINTS},
    {"IFCCARTESIANPOINTLIST3D", POINTS},
    {"IFCCIRCLE", CURVED | RADIUS},
    {"IFCCIRCLEHOLLOWPROFILEDEF", CURVED | ASSIMP_ERRS},
    {"IFCCIRCLEPROFILEDEF", CURVED | RADIUS},
    {"IFCCSGSOLID", ASSIMP_ERRS},
    {"IFCCSHAPEPROFILEDEF", ASSIMP_ERRS},
    {"IFCCYLINDRICALSURFACE", CURVED | RADIUS},
    {"IFCELLIPSE", CURVED},
    {"IFCELLIPSEPROFILEDEF", CURVED | ASSIMP_ERRS},
    {"IFCEXTRUDEDAREASOLIDTAPERED", ASSIMP_ERRS},
    {"IFCFACETEDBREPWITHVOIDS", ASSIMP_ERRS},
    {"IFCFIXEDREFERENCESWEPTAREASOLID", CURVED | ASSIMP_ERRS},
    {"IFCGEOMETRICREPRESENTATIONCONTEXT", STOP},
    {"IFCGEOMETRICREPRESENTATIONSUBCONTEXT", STOP},
    {"IFCINDEXEDPOLYCURVE", CURVED | ASSIMP_ERRS},
    {"IFCLSHAPEPROFILEDEF", ASSIMP_ERRS},
    {"IFCOWNERHISTORY", STOP},
    {"IFCPOLYGONALFACESET", ASSIMP_ERRS},
    {"IFCRATIONALBSPLINECURVEWITHKNOTS", CURVED},
    {"IFCRATIONALBSPLINESURFACEWITHKNOTS", CURVED | ASSIMP_ERRS},
    {"IFCRECTANGLEHOLLOWPROFILEDEF", ASSIMP_ERRS},
    {"IFCRECTANGULARPYRAMID", ASSIMP_ERRS},
    {"IFCREVOLVEDAREASOLID", CURVED | TURNED},
    {"IFCREVOLVEDAREASOLIDTAPERED", CURVED | TURNED | ASSIMP_ERRS},
    {"IFCRIGHTCIRCULARCONE", CURVED | RADIUS | ASSIMP_ERRS},
    {"IFCRIGHTCIRCULARCYLINDER", CURVED | RADIUS | ASSIMP_ERRS},
    {"IFCROUNDEDRECTANGLEPROFILEDEF", CURVED | ASSIMP_ERRS},
    {"IFCSECTIONEDSOLIDHORIZONTAL", ASSIMP_ERRS},
    {"IFCSPHERE", CURVED | RADIUS | ASSIMP_ERRS},
    {"IFCSTYLEDITEM", STOP},
    {"IFCSURFACECURVESWEPTAREASOLID", CURVED | ASSIMP_ERRS},
    {"IFCSURFACEOFREVOLUTION", CURVED | TURNED | ASSIMP_ERRS},
    {"IFCSWEPTDISKSOLID", CURVED | RADIUS | ASSIMP_ERRS},
    {"IFCSWEPTDISKSOLIDPOLYGONAL", CURVED | ASSIMP_ERRS},
    {"IFCTOROIDALSURFACE", CURVED | ASSIMP_ERRS},
    {"IFCTRAPEZIUMPROFILEDEF", ASSIMP_ERRS},
    {"IFCTRIANGULATEDFACESET", ASSIMP_ERRS},
    {"IFCTRIANGULATEDIRREGULARNETWORK", ASSIMP_ERRS},
    {"IFCTSHAPEPROFILEDEF", ASSIMP_ERRS},
    {"IFCUSHAPEPROFILEDEF", ASSIMP_ERRS},
    {"IFCZSHAPEPROFILEDEF", ASSIMP_ERRS},
};

struct walk {
    struct ifc_records *r;
    struct ifc_product *product;
    uint32_t *stack; /* indices into ifc_index.record */
    size_t n, room;
    uint64_t *voids; /* pairs: product, opening; by product */
    size_t n_voids, room_voids;
};

static int compare_types(const void *key, const void *entry)
{
    const struct text_span *type = key;
    const struct type_kind *k = entry;
    const int order = strncmp(type->p, k->type, type->n);
    return order != 0 ? order : -(k->type[type->n] != '\0');
}

static int kind_of(struct text_span type)
{
    const struct type_kind *found =
        bsearch(&type, kinds, sizeof kinds / sizeof kinds[0], sizeof kinds[0], compare_types);
    return found != NULL ? found->kind : PLAIN;
}

static bool push(struct walk *w, uint64_t id)
{
    const struct step_record *to = ifc_index_find(&w->r->index, id);
    const size_t at = to != NULL ? (size_t)(to - w->r->index.record) : 0;
    if (to == NULL || w->r->mark[at] == w->r->stamp) return true;
    if (!grow(&w->stack, &w->room, w->n + 1, sizeof *w->stack)) return false;
    w->r->mark[at] = w->r->stamp;
    w->stack[w->n++] = (uint32_t)at;
    return true;
}

/* Returns the largest number in a list of lists, without its sign. */
static double largest_number(const struct text *t, struct text_span args)
{
    double largest = 0.0;
    for (const char *p = args.p, *end = p + args.n; p < end;) {
        const size_t skip = strspn(p, "(), \t\r\n$*"), n = strcspn(p + skip, "(), \t\r\n");
        double value;
        if (n == 0) break;
        if (step_real(t, (struct text_span){p + skip, n}, &value)) largest = fmax(largest, fabs(value));
        p += skip + n;
    }
    return largest;
}

static void keep_radius(struct ifc_records *r, const struct step_record *record)
{
    struct text_span arg[STEP_MAX_ARGS];
    const size_t n = step_split(record->args, arg, STEP_MAX_ARGS);
    /* IfcSweptDiskSolid(directrix, radius, inner radius, start, end) */
    const size_t at = text_is(record->type, "IFCSWEPTDISKSOLID") ? 1 : n - 1;
    double radius;
    if (at < n && n <= STEP_MAX_ARGS && step_real(&r->index.text, arg[at], &radius))
        r->radius_m = fmax(r->radius_m, radius * r->unit_m);
}

static void look_at(struct walk *w, const struct step_record *record, int kind)
{
    struct ifc_product *p = w->product;
    p->is_curved |= (kind & CURVED) != 0;
    if ((kind & ASSIMP_ERRS) && p->assimp_wrong.n == 0) p->assimp_wrong = record->type;
    if (kind & RADIUS) keep_radius(w->r, record);
    p->is_turned |= (kind & TURNED) != 0;
    if (kind & POINTS) p->points_m = fmax(p->points_m, largest_number(&w->r->index.text, record->args) * w->r->unit_m);
}

static bool keep_styles(struct walk *w, uint64_t item)
{
    struct ifc_product *p = w->product;
    size_t first;
    const size_t n = ifc_styles_of(w->r, item, &first);
    if (!grow(&p->style, &p->room_styles, p->n_styles + n, sizeof *p->style)) return false;
    for (size_t i = 0; i < n; i++)
        p->style[p->n_styles++] = (uint32_t)(first + i);
    return true;
}

static bool walk_from(struct walk *w, uint64_t id)
{
    bool done = push(w, id);
    while (done && w->n > 0) {
        const struct step_record *record = &w->r->index.record[w->stack[--w->n]];
        const int kind = kind_of(record->type);
        if (kind & STOP) continue;
        look_at(w, record, kind);
        done = keep_styles(w, record->id);
        const char *p = record->args.p, *end = p + record->args.n;
        for (uint64_t to; done && ifc_next_reference(&p, end, &to);)
            done = push(w, to);
    }
    return done;
}

static int compare_pairs(const void *a, const void *b)
{
    const uint64_t *x = a, *y = b;
    return x[0] != y[0] ? (x[0] > y[0]) - (x[0] < y[0]) : (x[1] > y[1]) - (x[1] < y[1]);
}

/* IfcRelVoidsElement(..., RelatingBuildingElement, RelatedOpeningElement). */
static bool collect_voids(struct walk *w)
{
    for (size_t i = 0; i < w->r->index.n; i++) {
        struct text_span arg[6];
        uint64_t pair[2];
        if (!text_is(w->r->index.record[i].type, "IFCRELVOIDSELEMENT")) continue;
        if (step_split(w->r->index.record[i].args, arg, 6) != 6) continue;
        if (!step_reference(arg[4], &pair[0]) || !step_reference(arg[5], &pair[1])) continue;
        if (!grow(&w->voids, &w->room_voids, w->n_voids + 1, sizeof pair)) return false;
        memcpy(&w->voids[2 * w->n_voids++], pair, sizeof pair);
    }
    if (w->n_voids > 0) qsort(w->voids, w->n_voids, 2 * sizeof *w->voids, compare_pairs);
    return true;
}

static bool walk_product(struct walk *w, struct ifc_product *product)
{
    w->product = product;
    w->r->stamp++;
    bool done = walk_from(w, product->shape);
    for (size_t i = ifc_first(w->voids, w->n_voids, 2 * sizeof *w->voids, product->id);
         i < w->n_voids && w->voids[2 * i] == product->id && done; i++) {
        const struct ifc_product *opening = ifc_records_product(w->r, w->voids[2 * i + 1]);
        if (opening != NULL) done = walk_from(w, opening->shape);
    }
    product->is_far = product->points_m > FAR_M;
    /* The axis may lie on the other side of the origin, so the radius may be twice the largest coordinate. */
    if (product->is_turned && !product->is_far) w->r->radius_m = fmax(w->r->radius_m, 2.0 * product->points_m);
    return done;
}

/* Types that IfcRelVoidsElement subtracts. */
static bool is_opening(struct text_span type)
{
    static const char *const openings[] = {"IFCOPENINGELEMENT", "IFCOPENINGSTANDARDCASE", "IFCVOIDINGFEATURE", NULL};
    return text_is_one_of(type, openings);
}

static void mark_lost_openings(struct walk *w)
{
    for (size_t i = 0; i < w->r->n_products; i++)
        w->r->product[i].opens_nothing = is_opening(w->r->product[i].type);
    for (size_t k = 0; k < w->n_voids; k++) {
        const struct ifc_product *opening = ifc_records_product(w->r, w->voids[2 * k + 1]);
        if (opening != NULL) w->r->product[opening - w->r->product].opens_nothing = false;
    }
}

int ifc_walk(struct ifc_records *r, struct sh_err *err)
{
    struct walk w = {.r = r};
    bool done = collect_voids(&w);
    for (size_t i = 0; i < r->n_products && done; i++)
        if (!r->product[i].is_air) done = walk_product(&w, &r->product[i]);
    if (done) mark_lost_openings(&w);
    free(w.stack);
    free(w.voids);
    return done ? SH_OK : ifc_no_memory(&r->index, err);
}
