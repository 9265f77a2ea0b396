/* SPDX-License-Identifier: MIT */
#include "core/import/ifc/ifc_points.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/grow.h"

enum { COORDINATES = 0, TRIANGLES = 3, FLAGS = 5, MAX_ARGS = 6 };

/* Each type with the place of its PnIndex (IFC4 ADD2). */
static const struct {
    const char *type;
    size_t pn_index;
} face_sets[] = {
    {"IFCTRIANGULATEDFACESET", 4},          /* Coordinates, Normals, Closed, CoordIndex, PnIndex */
    {"IFCTRIANGULATEDIRREGULARNETWORK", 4}, /* and Flags */
    {"IFCPOLYGONALFACESET", 3},             /* Coordinates, Closed, Faces, PnIndex */
};

/* Parts of a list, in the file's text. */
struct parts {
    struct text_span *part; /* [n] */
    size_t n, room;
};

enum { KEPT_LISTS = 4 };

/* The points of an IfcCartesianPointList3D. */
struct coordinates {
    const struct step_record *of; /* NULL: this has no list */
    struct parts list;
    bool has_tags;
};

struct points {
    struct ifc_index *x;
    struct ifc_edits *edits;
    struct coordinates last[KEPT_LISTS]; /* face sets with a PnIndex often share a few lists */
    size_t next;                         /* modulo KEPT_LISTS: that of `last` which the next list replaces */
    uint64_t next_id;
    struct sh_err *err;
};

/* Finds the next element of a list of numbers, or of lists of numbers. */
static bool next_element(const char **p, const char *end, struct text_span *element)
{
    static const char blanks[] = " \t\r\n";
    int depth = 0;
    while (*p < end && (strchr(blanks, **p) != NULL || **p == ','))
        ++*p;
    const char *start = *p, *stop = start;
    for (; *p < end && (depth > 0 || **p != ','); ++*p) {
        depth += (**p == '(') - (**p == ')');
        if (strchr(blanks, **p) == NULL) stop = *p + 1;
    }
    *element = (struct text_span){start, (size_t)(stop - start)};
    return stop > start;
}

static bool read_parts(struct text_span list, struct parts *parts)
{
    const char *p = list.p, *end = p + list.n;
    parts->n = 0;
    for (struct text_span element; next_element(&p, end, &element); parts->n++) {
        if (!grow(&parts->part, &parts->room, parts->n + 1, sizeof element)) return false;
        parts->part[parts->n] = element;
    }
    return true;
}

static struct coordinates *find_points(struct points *s, const struct step_record *of)
{
    for (size_t i = 0; of != NULL && i < KEPT_LISTS; i++)
        if (s->last[i].of == of) return &s->last[i];
    return NULL;
}

/* IfcCartesianPointList3D(CoordList); IFC 4.3 has a TagList after it. */
static int read_points(struct points *s, const struct step_record *from, struct text_span reference,
                       const struct coordinates **points)
{
    struct text_span arg[2], list;
    const struct step_record *of = ifc_index_follow(s->x, reference, "IFCCARTESIANPOINTLIST3D");
    *points = find_points(s, of);
    if (*points != NULL) return SH_OK;
    const size_t n = of != NULL ? step_split(of->args, arg, 2) : 0;
    if (n < 1 || !step_list(arg[0], &list))
        return ifc_index_fail(s->x, from, s->err, "its Coordinates are no IFCCARTESIANPOINTLIST3D");
    struct coordinates *c = &s->last[s->next++ % KEPT_LISTS];
    c->of = NULL;
    if (!read_parts(list, &c->list)) return ifc_no_memory(s->x, s->err);
    c->of = of;
    c->has_tags = n > 1;
    *points = c;
    return SH_OK;
}

/* Writes a record with the points in the order of PnIndex. */
static int write_points(struct points *s, const struct step_record *from, const struct coordinates *points,
                        struct text_span pn_index, FILE *out)
{
    struct text_span element;
    const char *p = pn_index.p, *end = p + pn_index.n;
    char what[128];
    long at;
    fprintf(out, "#%llu=IFCCARTESIANPOINTLIST3D((", (unsigned long long)s->next_id);
    for (size_t n = 0; next_element(&p, end, &element); n++) {
        if (!step_integer(element, &at) || at < 1 || (size_t)at > points->list.n) {
            snprintf(what, sizeof what, "PnIndex has %.*s; allowed 1 to %zu, the number of points of #%llu",
                     element.n < 20 ? (int)element.n : 20, element.p, points->list.n,
                     (unsigned long long)points->of->id);
            return ifc_index_fail(s->x, from, s->err, what);
        }
        const struct text_span *point = &points->list.part[at - 1];
        if (n > 0) fputc(',', out);
        fwrite(point->p, 1, point->n, out);
    }
    fputs(points->has_tags ? "),$);" : "));", out);
    return SH_OK;
}

/* The face set refers to the new list, which stands before it, and has no PnIndex. */
static int add_points(struct points *s, const struct step_record *face_set, const struct coordinates *points,
                      const struct text_span *arg, size_t at_index, struct text_span pn_index)
{
    const struct text *t = &s->x->text;
    char *record = NULL, *reference = NULL;
    size_t len;
    FILE *out = open_memstream(&record, &len);
    if (out == NULL) return ifc_no_memory(s->x, s->err);
    const int rc = write_points(s, face_set, points, pn_index, out);
    if (fclose(out) != 0 || rc != SH_OK) {
        free(record);
        return rc != SH_OK ? rc : ifc_no_memory(s->x, s->err);
    }
    const char *start = memrchr(t->data, '#', (size_t)(face_set->type.p - t->data));
    if (asprintf(&reference, "#%llu", (unsigned long long)s->next_id++) < 0) reference = NULL;
    bool done = ifc_edits_add(s->edits, t, (struct text_span){start, 0}, record);
    done = ifc_edits_add(s->edits, t, arg[COORDINATES], reference) && done;
    done = ifc_edits_add(s->edits, t, arg[at_index], strdup("$")) && done;
    return done ? SH_OK : ifc_no_memory(s->x, s->err);
}

static int resolve_index(struct points *s, const struct step_record *face_set, const struct text_span *arg,
                         size_t at_index)
{
    struct text_span pn_index, element;
    if (!step_list(arg[at_index], &pn_index)) return SH_OK;
    const char *p = pn_index.p;
    /* The first edition of IFC4 has lists at this place: the index of normals. */
    if (!next_element(&p, p + pn_index.n, &element) || element.p[0] == '(') return SH_OK;
    /* Both readers hold numbers of records in 32 bits. */
    if (s->next_id > UINT32_MAX)
        return ifc_index_fail(s->x, face_set, s->err,
                              "its PnIndex needs a record more, and the file has numbers up to 4294967295 or above");
    const struct coordinates *points;
    const int rc = read_points(s, face_set, arg[COORDINATES], &points);
    return rc == SH_OK ? add_points(s, face_set, points, arg, at_index, pn_index) : rc;
}

/* IFC 4.3: "applications should not display faces where flags are set as negative". */
static int leave_holes_out(struct points *s, const struct text_span *arg)
{
    struct text_span list, flags, element;
    struct parts triangles = {0};
    if (!step_list(arg[TRIANGLES], &list) || !step_list(arg[FLAGS], &flags)) return SH_OK;
    bool done = read_parts(list, &triangles);
    const char *p = flags.p, *end = p + flags.n;
    size_t n = 0;
    for (size_t i = 0; i < triangles.n; i++) {
        const bool has_flag = next_element(&p, end, &element);
        if (!has_flag || element.p[0] != '-') triangles.part[n++] = triangles.part[i];
    }
    if (done && n < triangles.n) done = ifc_edits_keep(s->edits, &s->x->text, list, triangles.part, n);
    free(triangles.part);
    return done ? SH_OK : ifc_no_memory(s->x, s->err);
}

static int resolve_face_set(struct points *s, const struct step_record *record)
{
    struct text_span arg[MAX_ARGS];
    for (size_t i = 0; i < sizeof face_sets / sizeof face_sets[0]; i++) {
        if (!text_is(record->type, face_sets[i].type)) continue;
        const size_t n = step_split(record->args, arg, MAX_ARGS);
        const int rc = n > face_sets[i].pn_index ? resolve_index(s, record, arg, face_sets[i].pn_index) : SH_OK;
        return rc == SH_OK && n == MAX_ARGS ? leave_holes_out(s, arg) : rc;
    }
    return SH_OK;
}

int ifc_points_resolve(struct ifc_index *x, struct ifc_edits *edits, struct sh_err *err)
{
    struct points s = {.x = x, .edits = edits, .err = err};
    int rc = SH_OK;
    s.next_id = x->n > 0 ? x->record[x->n - 1].id + 1 : 1;
    for (size_t i = 0; i < x->n && rc == SH_OK; i++)
        rc = resolve_face_set(&s, &x->record[i]);
    for (size_t i = 0; i < KEPT_LISTS; i++)
        free(s.last[i].list.part);
    return rc;
}
