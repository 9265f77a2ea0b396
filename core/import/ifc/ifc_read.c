/* SPDX-License-Identifier: MIT */
#include "core/import/ifc/ifc_read.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/import/ifc/ifc_records.h"
#include "core/import/ifc/ifc_styles.h"
#include "core/import/readers.h"
#include "core/scene/build_surfaces.h"

enum { LEAST_SEGMENTS = 24, MOST_SEGMENTS = 360 };
#define FINE_LEVEL_SEGMENTS 48 /* from this number on, ifc-lite is asked for its level "high" */

struct reading {
    struct scene_build *b;
    struct scene_import_limits limits;
    struct ifc_records records;
    struct ifc_readings readings;
    double largest_m; /* largest coordinate that was rounded to single precision */
    struct sh_err *err;
};

/* A chord of a circle of radius r lies up to r (1 - cos(pi / n)) from its arc, for n sides. */
static struct ifc_fineness fineness_for(const struct ifc_records *records, double tolerance_m)
{
    const double radius_m = records->radius_m, share = tolerance_m / radius_m;
    double segments = radius_m > 0.0 && share < 1.0 ? ceil(M_PI / acos(1.0 - share)) + 1.0 : LEAST_SEGMENTS;
    segments = fmin(fmax(segments, LEAST_SEGMENTS), MOST_SEGMENTS);
    return (struct ifc_fineness){.segments = (int)segments,
                                 .level = segments >= FINE_LEVEL_SEGMENTS ? "high" : "medium",
                                 .deviation_m = radius_m * (1.0 - cos(M_PI / (segments - 1.0)))};
}

/* Type, name and GlobalId make one word, so no two products have the same. Where it is too long, the name is cut, never
 * the GlobalId, and the cut is counted. */
static char *object_name(struct reading *r, const struct ifc_product *p, const struct ifc_body *body)
{
    const struct text_span type = body->type.n > 0 ? body->type : p->type;
    const char *name = p->name[0] != '\0' ? p->name : "Unnamed";
    const size_t others = type.n + strlen(p->guid) + 2, room = SCENE_NAME_LEN - 1;
    size_t n = strlen(name);
    char *object = NULL;
    if (others + n > room && others < room) {
        for (n = room - others; n > 0 && ((unsigned char)name[n] & 0xc0) == 0x80;)
            n--;
        r->b->counts.names_cut++;
    }
    return asprintf(&object, "%.*s_%.*s_%s", (int)type.n, type.p, (int)n, name, p->guid) >= 0 ? object : NULL;
}

static int ifc_read_add_part(struct reading *r, const struct ifc_part *part, uint16_t label)
{
    struct scene_build *b = r->b;
    b->mesh_vertex0 = b->scene->n_vertices;
    int rc = build_reserve(b, part->n_vertices, part->n_triangles, r->err);
    if (rc == SH_OK) rc = build_corners(b, 3, r->err);
    for (uint32_t i = 0; i < part->n_vertices && rc == SH_OK; i++)
        rc = build_vertex(b, part->vertex_m[i], r->err);
    for (uint32_t i = 0; i < part->n_triangles && rc == SH_OK; i++) {
        for (int k = 0; k < 3; k++)
            b->corner[k] = b->mesh_vertex0 + part->triangle[i][k];
        rc = build_polygon(b, 3, label, r->err);
    }
    r->largest_m = fmax(r->largest_m, part->largest_m);
    return rc;
}

/* An existing pair of object and material keeps its label, so all parts of one material are one surface. */
static int label_part(struct reading *r, const struct ifc_product *p, const struct ifc_body *body, const char *object,
                      const struct ifc_part *part, uint16_t *label)
{
    const struct text_span type = body->type.n > 0 ? body->type : p->type;
    const struct ifc_style *style = ifc_style_by_colour(&r->records, p, part->colour);
    const char *material = style != NULL ? style->name : "<IFCDefault>";
    int rc = build_label(r->b, text_span_of(object), text_span_of(material), label, r->err);
    if (rc != SH_OK) return rc;
    struct scene_surface *surface = &r->b->scene->surface[*label];
    scene_copy_name(surface->type, sizeof surface->type, type.p, type.n);
    snprintf(surface->guid, sizeof surface->guid, "%s", p->guid);
    if (style == NULL) return SH_OK;
    memcpy(surface->colour, part->colour, sizeof surface->colour);
    surface->has_colour = 1;
    surface->clear = style->clear;
    return SH_OK;
}

static int add_body(struct reading *r, const struct ifc_product *p, const struct ifc_bodies *of,
                    const struct ifc_body *body)
{
    char *name = object_name(r, p, body);
    if (name == NULL) return build_fail(r->b, SH_ENOMEM, r->err, "no memory for a name");
    int rc = SH_OK;
    r->b->mesh = name;
    for (size_t i = 0; i < body->n_parts && rc == SH_OK; i++) {
        const struct ifc_part *part = &of->part[body->first + i];
        uint16_t label;
        rc = label_part(r, p, body, name, part, &label);
        if (rc == SH_OK) rc = ifc_read_add_part(r, part, label);
    }
    r->b->scene->n_meshes++;
    r->b->mesh = NULL;
    free(name);
    return rc;
}

static const struct ifc_body *with_parts(const struct ifc_bodies *bodies, bool has, uint64_t id)
{
    const struct ifc_body *body = has ? ifc_bodies_find(bodies, id) : NULL;
    return body != NULL && body->n_parts > 0 ? body : NULL;
}

/* The findings that need the records alone, of products that are air too. */
static int finding_of_records(const struct ifc_product *p)
{
    if (p->opens_nothing) return IFC_UNCUT;
    return p->is_analysis && (p->has_body || p->is_unbodied) ? IFC_ANALYSIS : IFC_AGREED;
}

static int add_products(struct reading *r)
{
    const struct ifc_readings *in = &r->readings;
    int rc = SH_OK;
    for (size_t i = 0; i < r->records.n_products && rc == SH_OK; i++) {
        struct ifc_product *p = &r->records.product[i];
        p->finding = finding_of_records(p);
        if (p->is_air) continue;
        const struct ifc_body *web = with_parts(&in->web, in->has_web, p->id),
                              *lite = with_parts(&in->lite, in->has_lite, p->id);
        const struct ifc_choice choice = ifc_choose(p, web, lite, in->has_web && in->has_lite);
        p->finding = (int)choice.finding;
        p->is_coarse = p->is_curved && choice.source == IFC_LITE;
        if (choice.source == IFC_WEB) rc = add_body(r, p, &in->web, web);
        if (choice.source == IFC_LITE) rc = add_body(r, p, &in->lite, lite);
        if (rc == SH_OK) rc = sh_check_stop(r->b->report, r->err);
    }
    return rc;
}

/* Warns of a reader that was run and gave no answer. */
static int say_missing(struct reading *r, const char *name, const struct sh_err *said)
{
    char why[IFC_REASON_LEN];
    if (said->code == 0) return SH_OK;
    ifc_reason(r->b, name, said, why);
    if (r->limits.ifc_strict)
        return build_fail(r->b, SH_EINPUT, r->err, "not cross-checked, but scene.ifc_strict demands both readers: %s",
                          why);
    build_warn(r->b, "not cross-checked: %s gave no answer: %s", name, why);
    return SH_OK;
}

/* The products are named by their findings, since the reader has no body for them. */
static void say_wrong(struct reading *r, const char *name, const struct ifc_bodies *bodies)
{
    if (bodies->n_wrong == 0) return;
    build_warn(r->b, "%s makes %zu bod%s with a wrong number, NaN for example: %s not used", name, bodies->n_wrong,
               bodies->n_wrong > 1 ? "ies" : "y", bodies->n_wrong > 1 ? "they are" : "it is");
}

/* A circle gets at most MOST_SEGMENTS sides. A file's largest circle may need more sides to stay within the
 * tolerance. */
static int say_facets(struct reading *r, const struct ifc_fineness *fineness)
{
    if (fineness->deviation_m <= r->b->tolerance_m) return SH_OK;
    if (r->limits.ifc_strict)
        return build_fail(
            r->b, SH_EINPUT, r->err,
            "facets of its curves, of radii up to %.3g m, are up to %.2g m away from the curves; allowed %.2g m "
            "(scene.tolerance_m)",
            r->records.radius_m, fineness->deviation_m, r->b->tolerance_m);
    build_warn(r->b,
               "facets of its curves, of radii up to %.3g m, are up to %.2g m away from the curves, more than %.2g m "
               "(scene.tolerance_m)",
               r->records.radius_m, fineness->deviation_m, r->b->tolerance_m);
    return SH_OK;
}

/* Each product with a body has at least one surface. The number of surfaces is checked before minutes are spent on
 * bodies. */
static int check_number(struct reading *r)
{
    size_t n = 0;
    for (size_t i = 0; i < r->records.n_products; i++)
        n += !r->records.product[i].is_air && r->records.product[i].has_body;
    if (n + r->b->scene->n_surfaces <= SCENE_MAX_SURFACES) return SH_OK;
    return build_fail(
        r->b, SH_EINPUT, r->err,
        "%zu products with bodies need at least a surface each, and the scene already has %u: it holds up to %d, "
        "since labels have 16 bits; export parts of the model to files of their own, and scan each part with a "
        "configuration of its own",
        n, r->b->scene->n_surfaces, SCENE_MAX_SURFACES);
}

static int read_by_two(struct reading *r)
{
    const struct ifc_fineness fineness = fineness_for(&r->records, r->b->tolerance_m);
    size_t n_edits;
    int rc = check_number(r);
    if (rc != SH_OK) return rc;
    build_report(r->b, -1);
    char *edits = ifc_edits_write(&r->records.edits, &r->records.index.text, &n_edits);
    if (edits == NULL) return ifc_no_memory(&r->records.index, r->err);
    rc = ifc_run_readers(r->b, fineness, (struct text_span){edits, n_edits}, &r->readings, r->err);
    free(edits);
    if (rc == SH_OK) rc = say_missing(r, "web-ifc", &r->readings.web_said);
    if (rc == SH_OK) rc = say_missing(r, "ifc-lite", &r->readings.lite_said);
    say_wrong(r, "web-ifc", &r->readings.web);
    say_wrong(r, "ifc-lite", &r->readings.lite);
    if (rc == SH_OK) rc = add_products(r);
    if (rc == SH_OK) rc = say_facets(r, &fineness);
    if (rc == SH_OK) ifc_say_levels(r->b, r->records.product, r->records.n_products);
    if (rc == SH_OK) ifc_say_coarse(r->b, r->records.product, r->records.n_products);
    if (rc == SH_OK)
        rc = ifc_say_findings(r->b, r->records.product, r->records.n_products, r->limits.ifc_strict, r->err);
    if (rc == SH_OK) rc = build_single(r->b, r->largest_m, BUILD_SINGLE_ROUNDING * r->largest_m, true, r->err);
    return rc;
}

/* Assimp's bodies are not compared, so these findings need no reader. */
static int say_records(struct reading *r)
{
    for (size_t i = 0; i < r->records.n_products; i++) {
        struct ifc_product *p = &r->records.product[i];
        p->finding = finding_of_records(p);
        if (!p->is_air && !p->has_body) p->finding = (int)ifc_choose(p, NULL, NULL, false).finding;
    }
    return ifc_say_findings(r->b, r->records.product, r->records.n_products, false, r->err);
}

static int read_by_assimp(struct reading *r, const char *why)
{
    const bool asked = r->limits.ifc_reader == IFC_READER_ASSIMP;
    if (r->limits.ifc_strict)
        return build_fail(r->b, SH_EINPUT, r->err,
                          "%s, so nothing is cross-checked, but scene.ifc_strict demands both readers", why);
    if (!asked) build_warn(r->b, "%s: Assimp reads it", why);
    int rc = ifc_say_assimp(r->b, r->records.product, r->records.n_products, !asked, why, r->err);
    if (rc == SH_OK) rc = say_records(r);
    if (rc != SH_OK) return rc;
    /* The records' text lacks the representations that are no body, and those of analysis members. */
    if (ifc_records_hide_analysis(&r->records) || r->records.edits.n > 0)
        r->b->instead = (struct text_span){r->records.index.text.data, r->records.index.text.size};
    const int read = import_apart(r->b, r->err);
    r->b->instead = (struct text_span){NULL, 0};
    if (read == SH_OK) ifc_say_levels(r->b, r->records.product, r->records.n_products);
    return read;
}

/* Warns of an unknown unit: readers mostly take it for metres. */
static int say_unit(struct reading *r)
{
    const struct sh_err *said = &r->records.no_unit;
    if (said->code == 0) return SH_OK;
    if (r->limits.ifc_strict) return sh_fail(r->err, SH_EINPUT, "%.420s; scene.ifc_strict demands a unit", said->text);
    sh_warn(r->b->report, "%s; readers mostly take metres then: check its size (scene.meshes[].scale)", said->text);
    return SH_OK;
}

static int read_records(struct reading *r)
{
    char why[160] = "";
    int rc = ifc_records_open(&r->records, r->b->spec->file, r->err);
    if (rc != SH_OK) return rc;
    rc = say_unit(r);
    if (rc != SH_OK) return rc;
    if (r->limits.ifc_reader == IFC_READER_ASSIMP) return read_by_assimp(r, "scene.ifc_reader is assimp");
    if (r->limits.ifc_strict && r->limits.ifc_reader != IFC_READER_AUTO)
        return build_fail(r->b, SH_EINPUT, r->err,
                          "one reader alone is not cross-checked, but scene.ifc_strict demands both readers");
    if (ifc_readers_are_there(&r->limits, why, sizeof why))
        rc = read_by_two(r);
    else if (r->limits.ifc_reader == IFC_READER_AUTO)
        return read_by_assimp(r, why);
    else
        return build_fail(r->b, SH_EINPUT, r->err, "%s; to read without them set scene.ifc_reader: assimp", why);
    if (rc == SH_OK && r->records.n_limited > 0)
        build_warn(r->b, "%zu style%s of surfaces with a colour or transparency beyond 0 to 1, limited to it",
                   r->records.n_limited, r->records.n_limited > 1 ? "s" : "");
    r->b->scene->says = (struct scene_says){.unit_m = 1.0, .up = 2};
    return rc;
}

int read_ifc(struct scene_build *b, struct sh_err *err)
{
    struct reading r = {.b = b, .limits = build_limits(b), .err = err};
    const int rc = read_records(&r);
    ifc_readings_free(&r.readings);
    ifc_records_close(&r.records);
    return rc;
}
