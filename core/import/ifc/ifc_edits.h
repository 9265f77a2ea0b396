/* SPDX-License-Identifier: MIT */
/* Changes to the text of an IFC file that both readers of bodies get, so that neither builds what is no body. In:
 * places in the file, and the text that stands there instead. Out: the list of changes, as result.mjs reads it. */
#ifndef CORE_IMPORT_IFC_IFC_EDITS_H
#define CORE_IMPORT_IFC_IFC_EDITS_H

#include <stdbool.h>
#include <stddef.h>

#include "core/text.h"

/* The file's bytes from `at` on give way to a text. */
struct ifc_edit {
    size_t at, n;
    char *text; /* without line ends */
};

struct ifc_edits {
    struct ifc_edit *edit; /* [n]; no two overlap */
    size_t n, room;
};

/* Replaces part of a file's text, without a change of t->data. `text` is from malloc, and becomes the edits' in any
 * case; line ends in it become blanks. NULL counts as no memory. false: there is no memory. */
bool ifc_edits_add(struct ifc_edits *e, const struct text *t, struct text_span part, char *text);

/* Keeps n elements of a list (span: without its brackets), in the file and in t->data, where blanks follow. false:
 * there is no memory. */
bool ifc_edits_keep(struct ifc_edits *e, struct text *t, struct text_span list, const struct text_span *kept, size_t n);

/* Writes the list: a line with the file's size, and a line "place length text" for each change, in the order of places.
 * Returns it from malloc, with its length in *len; NULL: there is no memory. */
char *ifc_edits_write(struct ifc_edits *e, const struct text *t, size_t *len);
void ifc_edits_free(struct ifc_edits *e);

#endif
