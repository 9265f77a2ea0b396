/* SPDX-License-Identifier: MIT */
/* Reports findings as lines that name their products. */
#include <stdio.h>

#include "core/import/ifc/ifc_read.h"
#include "core/import/ifc/ifc_product.h"

enum { MAX_NAMED = 100, LINE_ROOM = 420 /* the rest of a line has room for ", and N more" */ };

/* Groups of products that are no findings. */
enum { COARSE = IFC_FINDINGS, LEVELS, MISREAD };

/* The products of a group are named line by line. */
struct lines {
    struct scene_build *b;
    const struct ifc_product *product; /* [n_products] */
    size_t n_products;
    int group; /* a finding, COARSE, LEVELS or MISREAD */
    const char *text;
    size_t n;        /* products of the group */
    size_t n_listed; /* on this line and before */
    size_t n_lines;
    char line[512];
    size_t len;
};

static void end_line(struct lines *l)
{
    if (l->len > 0) sh_warn(l->b->report, "%s", l->line);
    l->n_lines += l->len > 0;
    l->len = 0;
}

static void add_name(struct lines *l, const struct ifc_product *p)
{
    char name[160];
    const int len = snprintf(name, sizeof name, IFC_PRODUCT_FORMAT, IFC_PRODUCT_WORDS(p));
    if (l->n_listed++ >= MAX_NAMED) return;
    if (l->len + (size_t)len + 4 > LINE_ROOM) end_line(l);
    if (l->len == 0 && l->n_lines == 0)
        l->len = (size_t)snprintf(l->line, sizeof l->line, "%.100s: %zu product%s: %s: %s", l->b->name, l->n,
                                  l->n > 1 ? "s" : "", l->text, name);
    else if (l->len == 0)
        l->len = (size_t)snprintf(l->line, sizeof l->line, "%.100s: likewise: %s", l->b->name, name);
    else
        l->len += (size_t)snprintf(l->line + l->len, sizeof l->line - l->len, ", %s", name);
}

static bool is_in_group(const struct lines *l, const struct ifc_product *p)
{
    if (l->group == MISREAD) return !p->is_air && p->assimp_wrong.n > 0;
    if (l->group == LEVELS) return !p->is_air && p->is_level;
    return l->group == COARSE ? p->is_coarse : p->finding == l->group;
}

/* Counts the products of the group. Returns the first one; NULL: there is none. */
static const struct ifc_product *count_group(struct lines *l)
{
    const struct ifc_product *first = NULL;
    for (size_t i = l->n_products; i-- > 0;)
        if (is_in_group(l, &l->product[i])) {
            first = &l->product[i];
            l->n++;
        }
    return first;
}

static void say_group(struct lines *l)
{
    for (size_t i = 0; i < l->n_products; i++)
        if (is_in_group(l, &l->product[i])) add_name(l, &l->product[i]);
    if (l->n_listed > MAX_NAMED)
        l->len +=
            (size_t)snprintf(l->line + l->len, sizeof l->line - l->len, ", and %zu more", l->n_listed - MAX_NAMED);
    end_line(l);
}

int ifc_say_findings(struct scene_build *b, const struct ifc_product *product, size_t n_products, bool strict,
                     struct sh_err *err)
{
    for (int f = IFC_AGREED + 1; f < IFC_FINDINGS; f++) {
        struct lines l = {b, product, n_products, f, .text = ifc_finding_text((enum ifc_finding)f)};
        const struct ifc_product *first = count_group(&l);
        if (first == NULL) continue;
        if (strict && ifc_is_doubtful((enum ifc_finding)f))
            return build_fail(b, SH_EINPUT, err,
                              "%zu product%s: %s: " IFC_PRODUCT_FORMAT "%s; allowed none (scene.ifc_strict)", l.n,
                              l.n > 1 ? "s" : "", l.text, IFC_PRODUCT_WORDS(first), l.n > 1 ? " and others" : "");
        say_group(&l);
    }
    return SH_OK;
}

void ifc_say_levels(struct scene_build *b, const struct ifc_product *product, size_t n_products)
{
    struct lines l = {b, product, n_products, LEVELS,
                      .text = "with bodies for several views or scales, of which the most detailed one is used"};
    count_group(&l);
    say_group(&l);
}

void ifc_say_coarse(struct scene_build *b, const struct ifc_product *product, size_t n_products)
{
    struct lines l = {b, product, n_products, COARSE,
                      .text = "curved, with the body of ifc-lite, whose facets don't keep scene.tolerance_m"};
    count_group(&l);
    say_group(&l);
}

int ifc_say_assimp(struct scene_build *b, const struct ifc_product *product, size_t n_products, bool refuse,
                   const char *why, struct sh_err *err)
{
    struct lines l = {b, product, n_products, MISREAD,
                      .text = "Assimp is known to read their shapes wrong, without a message"};
    const struct ifc_product *first = count_group(&l);
    if (first != NULL && refuse)
        return build_fail(
            b, SH_EINPUT, err,
            "%s, and Assimp is known to read %.*s wrong, which %zu products use, the first '%.40s' %.22s; "
            "scene.ifc_reader: assimp reads them in spite of that",
            why, (int)(first->assimp_wrong.n < 48 ? first->assimp_wrong.n : 48), first->assimp_wrong.p, l.n,
            first->name, first->guid);
    say_group(&l);
    return SH_OK;
}
