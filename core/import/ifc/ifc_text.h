/* SPDX-License-Identifier: MIT */
/* This decodes the texts of a STEP file. */
#ifndef CORE_IMPORT_IFC_IFC_TEXT_H
#define CORE_IMPORT_IFC_IFC_TEXT_H

#include "core/text.h"

/* Returns a quoted text of a STEP file as UTF-8, to be freed, with \X2\, \X4\, \X\, \S\, '' and raw bytes decoded.
 * Returns "" where the attribute is no text ($, *), and NULL without memory. */
char *ifc_text(struct text_span quoted);

#endif
