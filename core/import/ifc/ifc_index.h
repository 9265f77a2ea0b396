/* SPDX-License-Identifier: MIT */
/* This finds the records of an IFC file by number. In: a path. Out: records whose references lead to records. */
#ifndef CORE_IMPORT_IFC_IFC_INDEX_H
#define CORE_IMPORT_IFC_IFC_INDEX_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "core/import/ifc/step.h"

struct ifc_index {
    struct text text;
    struct step_record *record; /* [n] by id */
    size_t n, room;
};

/* ifc_index_close is due in any case. Errors (SH_EINPUT) name the file: a file that is cut off, a number that two
 * records have, a reference to a record that is not there. The last two also name line and record. The programs that
 * read the file's geometry (ifc_bodies.h) report none of these errors. */
int ifc_index_open(struct ifc_index *x, const char *path, struct sh_err *err);
void ifc_index_close(struct ifc_index *x);

/* NULL: there is none of that number. */
const struct step_record *ifc_index_find(const struct ifc_index *x, uint64_t id);

/* Finds the record that an attribute refers to. NULL: the attribute is no reference, or the record is of another type.
 */
const struct step_record *ifc_index_follow(const struct ifc_index *x, struct text_span ref, const char *type);

/* "FILE, line N: TYPE #n: what": SH_EINPUT. */
int ifc_index_fail(const struct ifc_index *x, const struct step_record *at, struct sh_err *err, const char *what);

/* SH_ENOMEM. */
int ifc_no_memory(const struct ifc_index *x, struct sh_err *err);

/* Finds the next record number in a list of attributes, from *p on; texts are passed over. A # without digits gives 0.
 * False: there is none. */
bool ifc_next_reference(const char **p, const char *end, uint64_t *id);

/* Compares two elements of a list by number, for qsort and bsearch. An element is a number, or has one as its first
 * member. */
int ifc_compare(const void *a, const void *b);
/* Finds the first element of such a sorted list whose number is id or above. Returns its place; n: there is none. */
size_t ifc_first(const void *list, size_t n, size_t size, uint64_t id);

#endif
