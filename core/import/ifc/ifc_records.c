/* SPDX-License-Identifier: MIT */
#include "core/import/ifc/ifc_records.h"

#include <stdlib.h>
#include <string.h>

#include "core/grow.h"

/* Attributes of an IfcProduct: GlobalId, OwnerHistory, Name, Description, ObjectType, ObjectPlacement, Representation. */
enum { PRODUCT_GUID = 0, PRODUCT_NAME = 2, PRODUCT_PLACEMENT = 5, PRODUCT_SHAPE = 6, PRODUCT_ARGS = 7 };

int ifc_compare(const void *a, const void *b)
{
    const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

const struct step_record *ifc_records_find(const struct ifc_records *r, uint64_t id)
{
    return r->n > 0 ? bsearch(&id, r->record, r->n, sizeof *r->record, ifc_compare) : NULL;
}

int ifc_records_fail(const struct ifc_records *r, const struct step_record *at, struct sh_err *err, const char *what)
{
    return text_fail(&r->text, at->line, SH_EINPUT, err, "%.*s #%llu: %s", (int)at->type.n, at->type.p,
                     (unsigned long long)at->id, what);
}

const struct ifc_product *ifc_records_product(const struct ifc_records *r, uint64_t id)
{
    return r->n_products > 0 ? bsearch(&id, r->product, r->n_products, sizeof *r->product, ifc_compare) : NULL;
}

size_t ifc_first(const void *list, size_t n, size_t size, uint64_t id)
{
    size_t low = 0, high = n;
    while (low < high) {
        const size_t middle = (low + high) / 2;
        uint64_t at;
        memcpy(&at, (const char *)list + middle * size, sizeof at);
        if (at < id)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

static int no_memory(const struct ifc_records *r, struct sh_err *err)
{
    return text_fail(&r->text, 0, SH_ENOMEM, err, "no memory for its records");
}

static int read_all(struct ifc_records *r, struct sh_err *err)
{
    struct step_record record;
    bool sorted = true;
    int rc;
    while ((rc = step_next(&r->text, &record, err)) == 1) {
        if (!grow(&r->record, &r->room, r->n + 1, sizeof *r->record)) return no_memory(r, err);
        sorted = sorted && (r->n == 0 || r->record[r->n - 1].id < record.id);
        r->record[r->n++] = record;
    }
    if (rc < 0) return rc;
    if (!sorted) qsort(r->record, r->n, sizeof *r->record, ifc_compare);
    for (size_t i = 1; i < r->n; i++)
        if (r->record[i].id == r->record[i - 1].id)
            return text_fail(&r->text, r->record[i].line, SH_EINPUT, err, "a second record #%llu; allowed one",
                             (unsigned long long)r->record[i].id);
    return SH_OK;
}

static int check_end(const struct ifc_records *r, struct sh_err *err)
{
    static const char last[] = "END-ISO-10303-21;";
    const size_t tail = r->text.size < 1024 ? r->text.size : 1024;
    if (memmem(r->text.data + r->text.size - tail, tail, last, sizeof last - 1) != NULL) return SH_OK;
    return text_fail(&r->text, 0, SH_EINPUT, err, "cut off: it doesn't end with %s", last);
}

uint64_t ifc_next_reference(const char **p, const char *end)
{
    for (int quoted = 0; *p < end; (*p)++) {
        if (**p == '\'') quoted = !quoted;
        if (quoted || **p != '#') continue;
        uint64_t id = 0;
        while (*p + 1 < end && (*p)[1] >= '0' && (*p)[1] <= '9' && id < UINT64_MAX / 20)
            id = 10 * id + (uint64_t)(*++*p - '0');
        ++*p;
        return id;
    }
    return 0;
}

static int check_references(const struct ifc_records *r, struct sh_err *err)
{
    for (size_t i = 0; i < r->n; i++) {
        const struct step_record *from = &r->record[i];
        const char *p = from->args.p, *end = p + from->args.n;
        for (uint64_t id; (id = ifc_next_reference(&p, end)) != 0;)
            if (ifc_records_find(r, id) == NULL)
                return text_fail(&r->text, from->line, SH_EINPUT, err,
                                 "%.*s #%llu refers to #%llu, but there is no such record", (int)from->type.n,
                                 from->type.p, (unsigned long long)from->id, (unsigned long long)id);
    }
    return SH_OK;
}

/* Types without a surface: air, drawings, and connections. */
static bool is_air(struct text_span type)
{
    static const char *const air[] = {"IFCOPENINGELEMENT", "IFCOPENINGSTANDARDCASE", "IFCVOIDINGFEATURE",
                                      "IFCSPACE",          "IFCSPATIALZONE",         "IFCEXTERNALSPATIALELEMENT",
                                      "IFCGRID",           "IFCANNOTATION",          "IFCVIRTUALELEMENT",
                                      "IFCPORT",           "IFCDISTRIBUTIONPORT"};
    for (size_t i = 0; i < sizeof air / sizeof air[0]; i++)
        if (text_is(type, air[i])) return true;
    return false;
}

/* IfcLocalPlacement(PlacementRelTo, RelativePlacement): up to one that is absolute, or that another product's chain has
 * passed. A chain that meets a link of its own has no end. */
static int check_placement(struct ifc_records *r, const struct ifc_product *p, struct text_span placement,
                           struct sh_err *err)
{
    const uint32_t own = ++r->stamp;
    uint64_t id;
    while (step_reference(placement, &id)) {
        const struct step_record *at = ifc_records_find(r, id);
        if (at == NULL || !text_is(at->type, "IFCLOCALPLACEMENT") || step_split(at->args, &placement, 1) < 1)
            return SH_OK;
        uint32_t *mark = &r->mark[at - r->record];
        if (*mark == own)
            return text_fail(&r->text, at->line, SH_EINPUT, err,
                             "IFCLOCALPLACEMENT #%llu is relative to itself, so %.*s '%.40s' %.22s has no place",
                             (unsigned long long)at->id, (int)(p->type.n < 48 ? p->type.n : 48), p->type.p, p->name,
                             p->guid);
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
    const struct step_record *to = ifc_records_find(r, shape);
    if (to != NULL && !text_is(to->type, "IFCPRODUCTDEFINITIONSHAPE") && !text_is(to->type, "IFCPRODUCTREPRESENTATION"))
        return SH_OK;
    if (!grow(&r->product, &r->room_products, r->n_products + 1, sizeof *r->product)) return no_memory(r, err);
    struct ifc_product *p = &r->product[r->n_products++];
    *p = (struct ifc_product){.id = record->id,
                              .type = record->type,
                              .guid = ifc_text(arg[PRODUCT_GUID]),
                              .name = ifc_text(arg[PRODUCT_NAME]),
                              .shape = shape,
                              .is_air = is_air(record->type)};
    if (p->guid == NULL || p->name == NULL) return no_memory(r, err);
    return check_placement(r, p, arg[PRODUCT_PLACEMENT], err);
}

int ifc_records_index(struct ifc_records *r, const char *path, struct sh_err *err)
{
    *r = (struct ifc_records){.unit_m = 1.0};
    int rc = step_open(&r->text, path, err);
    if (rc == SH_OK) rc = check_end(r, err);
    if (rc == SH_OK) rc = read_all(r, err);
    return rc == SH_OK ? check_references(r, err) : rc;
}

int ifc_records_open(struct ifc_records *r, const char *path, struct sh_err *err)
{
    int rc = ifc_records_index(r, path, err);
    if (rc != SH_OK) return rc;
    if (ifc_unit_find(r, &r->unit_m, &r->no_unit) != SH_OK) r->unit_m = 1.0;
    r->mark = calloc(r->n + 1, sizeof *r->mark);
    if (r->mark == NULL) return no_memory(r, err);
    for (size_t i = 0; i < r->n && rc == SH_OK; i++)
        rc = add_product(r, &r->record[i], err);
    if (rc == SH_OK) rc = ifc_styles_collect(r, err);
    return rc == SH_OK ? ifc_walk(r, err) : rc;
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
    free(r->record);
    free(r->mark);
    for (size_t i = 0; i < r->n_styles; i++)
        free(r->style[i].name);
    free(r->style);
    text_close(&r->text);
}
