/* SPDX-License-Identifier: MIT */
#include "core/import/ifc/ifc_choose.h"

#include <math.h>

#include "core/import/ifc/ifc_product.h"

/* Facets of curves explain a difference of CURVED_SHARE in area or volume. A polygon of 24 sides has 1.1 % less area
 * than its circle. A sphere of 24 facets around and 12 from pole to pole has 2.8 % less volume. Without curves, only
 * rounding is allowed. */
#define CURVED_SHARE     0.03
#define PLAIN_SHARE      1e-4
#define BOX_M            0.01
#define CURVED_BOX_SHARE 0.01 /* of the box: 1 - cos(180 deg / 24) */

static double size_of(const struct ifc_figures *f)
{
    double size = 0.0;
    for (int k = 0; k < 3; k++)
        size = fmax(size, f->max_m[k] - f->min_m[k]);
    return size;
}

static bool boxes_differ(const struct ifc_figures *a, const struct ifc_figures *b, bool is_curved)
{
    const double allowed = BOX_M + (is_curved ? CURVED_BOX_SHARE * fmax(size_of(a), size_of(b)) : 0.0);
    for (int k = 0; k < 3; k++)
        if (fabs(a->min_m[k] - b->min_m[k]) > allowed || fabs(a->max_m[k] - b->max_m[k]) > allowed) return true;
    return false;
}

/* Compares areas, and volumes where both bodies are closed. The volume of an open body means nothing. */
static bool areas_differ(const struct ifc_figures *a, const struct ifc_figures *b, bool is_curved)
{
    const double share = is_curved ? CURVED_SHARE : PLAIN_SHARE;
    if (fabs(a->area_m2 - b->area_m2) > share * fmax(a->area_m2, b->area_m2)) return true;
    if (!ifc_is_closed(a) || !ifc_is_closed(b)) return false;
    return fabs(a->volume_m3 - b->volume_m3) > share * fmax(fabs(a->volume_m3), fabs(b->volume_m3));
}

/* Chooses between two closed bodies that differ, or two open ones. A failure that a reader reports counts against it.
 * ifc-lite rounds points beyond 1 km, web-ifc more often gets a profile or a cut wrong. */
static enum ifc_source preferred(const struct ifc_product *product, const struct ifc_body *web,
                                 const struct ifc_body *lite)
{
    if ((web->n_failures > 0) != (lite->n_failures > 0)) return web->n_failures > 0 ? IFC_LITE : IFC_WEB;
    return product->is_far ? IFC_WEB : IFC_LITE;
}

static struct ifc_choice choose_single(const struct ifc_body *web, const struct ifc_body *lite, bool is_checked)
{
    const struct ifc_body *body = web != NULL ? web : lite;
    const enum ifc_source source = web != NULL ? IFC_WEB : IFC_LITE;
    if (is_checked) return (struct ifc_choice){source, web != NULL ? IFC_ONLY_WEB : IFC_ONLY_LITE};
    if (body->n_failures > 0) return (struct ifc_choice){source, IFC_FAILED};
    return (struct ifc_choice){source, ifc_is_closed(&body->figures) ? IFC_AGREED : IFC_OPEN};
}

static enum ifc_finding finding_without_body(const struct ifc_product *product)
{
    if (product->has_body) return IFC_LOST;
    if (product->is_boxed) return IFC_BOXED;
    return product->is_unbodied ? IFC_UNBODIED : IFC_AGREED;
}

struct ifc_choice ifc_choose(const struct ifc_product *product, const struct ifc_body *web, const struct ifc_body *lite,
                             bool is_checked)
{
    if (web == NULL && lite == NULL) return (struct ifc_choice){IFC_NONE, finding_without_body(product)};
    if (web == NULL || lite == NULL) return choose_single(web, lite, is_checked);
    const struct ifc_figures *w = &web->figures, *l = &lite->figures;
    const bool web_closed = ifc_is_closed(w), lite_closed = ifc_is_closed(l);
    if (web_closed != lite_closed)
        return web_closed ? (struct ifc_choice){IFC_WEB, IFC_CLOSED_WEB}
                          : (struct ifc_choice){IFC_LITE, IFC_CLOSED_LITE};
    if (boxes_differ(w, l, product->is_curved)) return (struct ifc_choice){preferred(product, web, lite), IFC_BOX};
    if (areas_differ(w, l, product->is_curved)) return (struct ifc_choice){preferred(product, web, lite), IFC_AREA};
    if (!web_closed) return (struct ifc_choice){IFC_WEB, IFC_OPEN};
    if (web->n_failures > 0 && lite->n_failures > 0) return (struct ifc_choice){IFC_WEB, IFC_FAILED};
    /* The points of web-ifc are exact to a micrometre, also far from the origin. web-ifc's circles have as many sides
     * as the tolerance asks for. */
    return (struct ifc_choice){web->n_failures > 0 ? IFC_LITE : IFC_WEB, IFC_AGREED};
}

static const struct {
    const char *text;
    bool is_doubtful;
} findings[IFC_FINDINGS] = {
    [IFC_LOST] = {"its records have a body, but neither reader makes one, so it is not in the scene", true},
    [IFC_BOXED] = {"the only shape is a bounding box, which is no surface, so it is not in the scene", true},
    [IFC_UNBODIED] =
        {"IFC calls none of its representations a body (a clearance, for example, is none), so it is not in "
         "the scene",
         true},
    [IFC_BOX] = {"the two readers make bodies of different size or place", true},
    [IFC_AREA] = {"the two readers make bodies of different area or volume", true},
    [IFC_ONLY_WEB] = {"only web-ifc makes a body, and this body is used", true},
    [IFC_ONLY_LITE] = {"only ifc-lite makes a body, and this body is used", true},
    [IFC_CLOSED_WEB] = {"ifc-lite leaves the body open: the closed body of web-ifc is used", true},
    [IFC_CLOSED_LITE] = {"web-ifc leaves the body open: the closed body of ifc-lite is used", true},
    [IFC_OPEN] = {"the body is open", false},
    [IFC_FAILED] = {"the reader says that parts of the body failed", true},
    [IFC_ANALYSIS] = {"part of an analysis model, not of the building, so it is not in the scene", false},
    [IFC_UNCUT] = {"no IfcRelVoidsElement says what it opens, so it opens nothing", true},
};

const char *ifc_finding_text(enum ifc_finding finding)
{
    return findings[finding].text;
}

bool ifc_is_doubtful(enum ifc_finding finding)
{
    return findings[finding].is_doubtful;
}
