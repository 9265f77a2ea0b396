/* SPDX-License-Identifier: MIT */
/* This decodes the texts of a STEP file. */
#ifndef CORE_IMPORT_IFC_IFC_TEXT_H
#define CORE_IMPORT_IFC_IFC_TEXT_H

#include "core/text.h"

/* A text of a STEP file, its quotes around it, as UTF-8 from malloc: \X2\, \X4\, \X\, \S\, '' and raw bytes. Not a text
 * ($, *): empty. NULL: no memory. */
char *ifc_text(struct text_span quoted);

#endif
