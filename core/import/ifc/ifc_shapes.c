/* SPDX-License-Identifier: MIT */
#include "core/import/ifc/ifc_shapes.h"

#include <math.h>
#include <string.h>

#include "core/import/ifc/ifc_items.h"
#include "core/import/ifc/ifc_product.h"

enum { MAX_REPS = STEP_MAX_ARGS };

/* IfcProductDefinitionShape(Name, Description, Representations) */
enum { SHAPE_REPS = 2, SHAPE_ARGS };
/* IfcGeometricRepresentationSubContext(ContextIdentifier, ContextType, *, *, *, *, ParentContext, TargetScale,
 * TargetView, UserDefinedTargetView) */
enum { VIEW_SCALE = 7, VIEW_TARGET, VIEW_NAME, VIEW_ARGS };

/* The representations of the best rank are the body. */
enum { NO_BODY, SHEET, FALLBACK, FACETS, BODY };

/* Identifiers by the table of IfcShapeRepresentation in IFC 4.3, and by IfcSite in IFC2x3. */
static const struct {
    const char *name;
    int rank;
} ranks[] = {
    {"'Body'", BODY},
    {"'Facetation'", FACETS},
    {"'Tessellation'", FACETS},
    {"'SurfaceModel'", FACETS},
    {"'Body-FallBack'", FALLBACK},
    {"'Surface'", SHEET},
    {"'CoG'", NO_BODY},
    {"'Box'", NO_BODY},
    {"'Annotation'", NO_BODY},
    {"'Axis'", NO_BODY},
    {"'FootPrint'", NO_BODY},
    {"'Profile'", NO_BODY},
    {"'Reference'", NO_BODY},
    {"'Clearance'", NO_BODY},
    {"'Lighting'", NO_BODY},
    {"'SurveyPoints'", NO_BODY},
};

/* The most detailed view first; views that are not named here have the place of NOTDEFINED. */
static const char *const views[] = {".MODEL_VIEW.",     ".NOTDEFINED.", ".USERDEFINED.",
                                    ".SKETCH_VIEW.",    ".GRAPH_VIEW.", ".SECTION_VIEW.",
                                    ".ELEVATION_VIEW.", ".PLAN_VIEW.",  ".REFLECTED_PLAN_VIEW."};
enum { VIEWS = sizeof views / sizeof views[0], VIEW_NOT_DEFINED = 1 };

struct rep {
    struct text_span reference, name;
    int rank, has;
    bool is_known; /* its name is one of the table's */
    bool is_kept;
    struct text_span user_view;
    size_t view;
    double scale;
};

struct shape {
    struct text_span list; /* of references, without its brackets */
    struct rep rep[MAX_REPS];
    size_t n;
    bool has_body, is_boxed, is_unbodied, is_level;
};

static int rank_of(struct text_span name, bool *is_known)
{
    for (size_t i = 0; i < sizeof ranks / sizeof ranks[0]; i++) {
        *is_known = name.n == strlen(ranks[i].name) && strncasecmp(name.p, ranks[i].name, name.n) == 0;
        if (*is_known) return ranks[i].rank;
    }
    return FACETS; /* IFC doesn't define every name */
}

/* A representation without a name has that of a representation which it maps, where that is a body. Of several, the
 * best rank counts, since the items stay together or not at all. Items that map nothing count as without a name. */
static struct text_span name_of(struct ifc_items *items, const struct text_span arg[REP_ARGS])
{
    struct text_span inner[REP_ARGS], best = arg[REP_NAME];
    const char *p = arg[REP_ITEMS].p, *end = p + arg[REP_ITEMS].n;
    const struct step_record *last = NULL; /* often all items map one, which may be long */
    int most = -1;
    if (best.n > 2) return best;
    for (uint64_t id; most < BODY && ifc_next_reference(&p, end, &id);) {
        const struct step_record *item = ifc_index_find(items->index, id), *rep;
        if (item == NULL || ifc_items_of(items, item) < HAS_UNKNOWN) continue;
        rep = ifc_items_mapped(items, item);
        if (rep != NULL && rep == last) continue;
        last = rep;
        const bool has_name = rep != NULL && step_split(rep->args, inner, REP_ARGS) == REP_ARGS;
        const struct text_span name = has_name ? inner[REP_NAME] : arg[REP_NAME];
        bool is_known;
        const int rank = rank_of(name, &is_known);
        if (rank <= most) continue;
        most = rank;
        best = name;
    }
    return best;
}

static void read_view(const struct ifc_index *x, struct text_span context, struct rep *rep)
{
    struct text_span arg[VIEW_ARGS];
    rep->view = VIEW_NOT_DEFINED;
    rep->scale = INFINITY; /* without a scale the view is good for all of them */
    const struct step_record *sub = ifc_index_follow(x, context, "IFCGEOMETRICREPRESENTATIONSUBCONTEXT");
    if (sub == NULL || step_split(sub->args, arg, VIEW_ARGS) != VIEW_ARGS) return;
    for (size_t i = 0; i < VIEWS; i++)
        if (text_is(arg[VIEW_TARGET], views[i])) rep->view = i;
    if (!step_real(&x->text, arg[VIEW_SCALE], &rep->scale)) rep->scale = INFINITY;
    rep->user_view = arg[VIEW_NAME];
}

static void read_rep(struct ifc_items *items, struct text_span reference, struct rep *rep)
{
    struct text_span arg[REP_ARGS];
    uint64_t id;
    *rep = (struct rep){.reference = reference, .is_kept = true, .user_view = {"", 0}};
    const struct step_record *record = step_reference(reference, &id) ? ifc_index_find(items->index, id) : NULL;
    if (record == NULL || step_split(record->args, arg, REP_ARGS) != REP_ARGS) return;
    rep->name = name_of(items, arg);
    rep->rank = rank_of(rep->name, &rep->is_known);
    rep->has = ifc_items_of_list(items, arg[REP_ITEMS]);
    read_view(items->index, arg[REP_CONTEXT], rep);
}

/* Returns whether the list could be read whole. */
static bool read_shape(struct ifc_items *items, uint64_t id, struct shape *s)
{
    struct text_span arg[SHAPE_ARGS], reference[MAX_REPS];
    const struct step_record *record = ifc_index_find(items->index, id);
    s->n = 0;
    s->has_body = s->is_boxed = s->is_unbodied = s->is_level = false;
    if (record == NULL || step_split(record->args, arg, SHAPE_ARGS) != SHAPE_ARGS ||
        !step_list(arg[SHAPE_REPS], &s->list))
        return false;
    const size_t n = step_split(s->list, reference, MAX_REPS);
    if (n > MAX_REPS) return false;
    for (s->n = 0; s->n < n; s->n++)
        read_rep(items, reference[s->n], &s->rep[s->n]);
    return true;
}

static bool is_same_name(const struct rep *a, const struct rep *b)
{
    return a->name.n == b->name.n && strncasecmp(a->name.p, b->name.p, a->name.n) == 0;
}

static bool is_same_view(const struct rep *a, const struct rep *b)
{
    return a->view == b->view && !(a->scale < b->scale) && !(a->scale > b->scale) && a->user_view.n == b->user_view.n &&
           memcmp(a->user_view.p, b->user_view.p, a->user_view.n) == 0;
}

/* A view that a reader builds is better than one of a type that no reader is known to build. */
static bool is_better_view(const struct rep *a, const struct rep *b)
{
    const int builds = (a->has >= HAS_BODY) - (b->has >= HAS_BODY);
    if (builds != 0) return builds > 0;
    return a->view < b->view || (a->view == b->view && a->scale > b->scale);
}

/* Where bodies of one name are for several views, the best view stays: the model's, and that of the largest scale.
 * Bodies of one name and one view are parts of one body. */
static void choose_views(struct shape *s)
{
    for (size_t i = 0; i < s->n; i++) {
        const struct rep *best = &s->rep[i];
        if (!best->is_kept || best->has < HAS_UNKNOWN) continue;
        for (size_t k = 0; k < s->n; k++) {
            const struct rep *rep = &s->rep[k];
            if (rep->is_kept && rep->has >= HAS_UNKNOWN && is_same_name(rep, best) && is_better_view(rep, best))
                best = rep;
        }
        for (size_t k = 0; k < s->n; k++) {
            struct rep *rep = &s->rep[k];
            if (rep->has < HAS_UNKNOWN || !is_same_name(rep, best) || is_same_view(rep, best)) continue;
            rep->is_kept = false;
            s->is_level = true;
        }
    }
}

/* Returns the best rank of the representations whose items are at least of this kind. */
static int best_rank(const struct shape *s, int least)
{
    int best = NO_BODY;
    for (size_t i = 0; i < s->n; i++)
        if (s->rep[i].has >= least && s->rep[i].rank > best) best = s->rep[i].rank;
    return best;
}

static void choose_reps(struct shape *s)
{
    /* A Body that no reader builds gives way to another one, such as a Body-FallBack. */
    int best = best_rank(s, HAS_BODY), has = 0;
    if (best == NO_BODY) best = best_rank(s, HAS_UNKNOWN);
    for (size_t i = 0; i < s->n; i++) {
        struct rep *rep = &s->rep[i];
        has |= rep->has;
        if (rep->has < HAS_UNKNOWN) continue; /* neither reader builds it */
        rep->is_kept = !rep->is_known || (rep->rank == best && best > NO_BODY);
    }
    choose_views(s);
    s->has_body = best > NO_BODY;
    s->is_boxed = has == HAS_BOX;
    s->is_unbodied = best == NO_BODY && has >= HAS_UNKNOWN;
}

static bool take_out(struct ifc_index *x, const struct shape *s, struct ifc_edits *edits)
{
    struct text_span kept[MAX_REPS];
    size_t n = 0;
    for (size_t i = 0; i < s->n; i++)
        if (s->rep[i].is_kept) kept[n++] = s->rep[i].reference;
    return n == s->n || ifc_edits_keep(edits, &x->text, s->list, kept, n);
}

/* Products may share a shape, so shapes change only after all products have been looked at. A shape that was changed
 * has nothing more to take out. */
static bool take_all_out(struct ifc_index *x, struct ifc_items *items, const struct ifc_product *product,
                         size_t n_products, struct ifc_edits *edits)
{
    struct shape s;
    for (size_t i = 0; i < n_products; i++) {
        if (!read_shape(items, product[i].shape, &s)) continue;
        choose_reps(&s);
        if (!take_out(x, &s, edits)) return false;
    }
    return true;
}

int ifc_shapes_choose(struct ifc_index *x, struct ifc_product *product, size_t n_products, struct ifc_edits *edits,
                      struct sh_err *err)
{
    struct ifc_items items;
    struct shape s;
    bool done = ifc_items_open(&items, x);
    for (size_t i = 0; i < n_products && done; i++) {
        struct ifc_product *p = &product[i];
        const bool is_whole = read_shape(&items, p->shape, &s);
        choose_reps(&s);
        p->has_body = s.has_body || !is_whole;
        p->is_boxed = s.is_boxed;
        p->is_unbodied = s.is_unbodied;
        p->is_level = s.is_level;
    }
    done = done && take_all_out(x, &items, product, n_products, edits);
    ifc_items_close(&items);
    return done ? SH_OK : ifc_no_memory(x, err);
}
