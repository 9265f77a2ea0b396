/* SPDX-License-Identifier: MIT */
/* Styles of surfaces: IfcStyledItem, and the records that it refers to. The readers of bodies (README.md) give the
 * colour of a part, but not the name of its style. So the name is found here, by the colour. */
#include "core/import/ifc/ifc_styles.h"

#include <math.h>
#include <stdlib.h>

#include "core/grow.h"
#include "core/import/ifc/ifc_records.h"
#include "core/import/ifc/ifc_text.h"

enum { MAX_DEPTH = 4 };
#define SAME_COLOUR 0.004f /* a reader may have rounded to 8 bits */

static float limit(double share, bool *is_limited)
{
    *is_limited |= !(share >= 0.0 && share <= 1.0);
    return (float)fmin(fmax(share, 0.0), 1.0);
}

/* IfcSurfaceStyleShading and -Rendering: the first attribute is an IfcColourRgb(name, red, green, blue). */
static bool read_colour(const struct ifc_records *r, const struct step_record *shading, float colour[3],
                        bool *is_limited)
{
    struct text_span arg[4];
    double part;
    if (step_split(shading->args, arg, 1) < 1) return false;
    const struct step_record *rgb = ifc_index_follow(&r->index, arg[0], "IFCCOLOURRGB");
    if (rgb == NULL || step_split(rgb->args, arg, 4) != 4) return false;
    for (int k = 0; k < 3; k++) {
        if (!step_real(&r->index.text, arg[1 + k], &part)) return false;
        colour[k] = limit(part, is_limited);
    }
    return true;
}

/* Transparency is the second attribute, a share. IfcSurfaceStyleShading has it from IFC4 on. */
static float read_clear(const struct ifc_records *r, const struct step_record *shading, bool *is_limited)
{
    struct text_span arg[2];
    double share;
    if (step_split(shading->args, arg, 2) < 2 || !step_real(&r->index.text, arg[1], &share)) return 0.0f;
    return limit(share, is_limited);
}

/* IfcSurfaceStyle(name, side, styles). */
static bool add_style(struct ifc_records *r, uint64_t item, const struct step_record *surface_style)
{
    struct ifc_style style = {.item = item};
    struct text_span arg[1];
    bool has_colour = false, is_limited = false;
    const char *p = surface_style->args.p, *end = p + surface_style->args.n;
    for (uint64_t id; !has_colour && ifc_next_reference(&p, end, &id);) {
        const struct step_record *to = ifc_index_find(&r->index, id);
        if (to == NULL) continue;
        if (text_is(to->type, "IFCSURFACESTYLERENDERING") || text_is(to->type, "IFCSURFACESTYLESHADING"))
            has_colour = read_colour(r, to, style.colour, &is_limited);
        if (has_colour) style.clear = read_clear(r, to, &is_limited);
    }
    if (!has_colour || step_split(surface_style->args, arg, 1) < 1) return true;
    if (!grow(&r->style, &r->room_styles, r->n_styles + 1, sizeof style)) return false;
    style.name = ifc_text(arg[0]);
    if (style.name == NULL) return false;
    r->style[r->n_styles++] = style;
    r->n_limited += is_limited;
    return true;
}

/* Walks down to the surface styles; from IFC4 on they may stand in the styled item itself. */
static bool collect_from(struct ifc_records *r, uint64_t item, const struct step_record *from, int depth)
{
    bool done = true;
    const char *p = from->args.p, *end = p + from->args.n;
    for (uint64_t id; done && ifc_next_reference(&p, end, &id);) {
        const struct step_record *to = id != item ? ifc_index_find(&r->index, id) : NULL;
        if (to == NULL) continue;
        if (text_is(to->type, "IFCSURFACESTYLE"))
            done = add_style(r, item, to);
        else if (text_is(to->type, "IFCPRESENTATIONSTYLEASSIGNMENT") && depth < MAX_DEPTH)
            done = collect_from(r, item, to, depth + 1);
    }
    return done;
}

int ifc_styles_collect(struct ifc_records *r, struct sh_err *err)
{
    bool done = true;
    for (size_t i = 0; i < r->index.n && done; i++) {
        struct text_span arg[1];
        uint64_t item = 0;
        if (!text_is(r->index.record[i].type, "IFCSTYLEDITEM") || step_split(r->index.record[i].args, arg, 1) < 1)
            continue;
        if (!step_reference(arg[0], &item)) item = 0;
        done = collect_from(r, item, &r->index.record[i], 0);
    }
    if (!done) return ifc_no_memory(&r->index, err);
    if (r->n_styles > 0) qsort(r->style, r->n_styles, sizeof *r->style, ifc_compare);
    return SH_OK;
}

size_t ifc_styles_of(const struct ifc_records *r, uint64_t item, size_t *first)
{
    size_t end = *first = ifc_first(r->style, r->n_styles, sizeof *r->style, item);
    while (end < r->n_styles && r->style[end].item == item)
        end++;
    return end - *first;
}

static bool ifc_styles_is_same(const struct ifc_style *style, const float colour[4])
{
    for (int k = 0; k < 3; k++)
        if (fabsf(style->colour[k] - colour[k]) > SAME_COLOUR) return false;
    return true;
}

const struct ifc_style *ifc_style_by_colour(const struct ifc_records *r, const struct ifc_product *p,
                                            const float colour[4])
{
    for (size_t i = 0; i < p->n_styles; i++)
        if (ifc_styles_is_same(&r->style[p->style[i]], colour)) return &r->style[p->style[i]];
    /* A material's style has no item; the product's own come first. */
    for (size_t i = 0; i < r->n_styles && r->style[i].item == 0; i++)
        if (ifc_styles_is_same(&r->style[i], colour)) return &r->style[i];
    return NULL;
}
