/* SPDX-License-Identifier: MIT */
/* Reads the records of a STEP file (ISO 10303-21), #id= TYPE(arguments);, one after the other from memory. */
#ifndef CORE_IMPORT_IFC_STEP_H
#define CORE_IMPORT_IFC_STEP_H

#include "core/text.h"

enum { STEP_MAX_ARGS = 32 };

struct step_record {
    uint64_t id, line;
    struct text_span type, args; /* arguments without their brackets */
};

/* Reads the file and takes its comments out. text_close is due in any case. */
int step_open(struct text *t, const char *path, struct sh_err *err);

/* The next record from t->p on: 1, 0 at the end, or a negative SH_E code. */
int step_next(struct text *t, struct step_record *record, struct sh_err *err);

/* Splits a list at commas outside of brackets and quotes, and cuts blanks off. Returns the number of parts; the first
 * max are stored. */
size_t step_split(struct text_span list, struct text_span *part, size_t max);

/* "(a, b)" -> "a, b"; 0 when it is no list. */
int step_list(struct text_span span, struct text_span *inside);
int step_reference(struct text_span span, uint64_t *id); /* "#5" -> 5; 0 when it is none */
int step_integer(struct text_span span, long *value);    /* 0 when it is none */
int step_real(const struct text *t, struct text_span span, double *value);

#endif
