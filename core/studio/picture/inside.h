/* SPDX-License-Identifier: MIT */
/* Private to core/studio/picture: glyphs and encoders. */
#ifndef CORE_STUDIO_PICTURE_INSIDE_H
#define CORE_STUDIO_PICTURE_INSIDE_H

#include "core/newfile.h"
#include "core/studio/picture.h"

/* Returns the strokes of a character, in 1/28 of a capital's height, y up from the baseline; NULL: there are none.
 *   x,y x,y ...   straight lines          ~x,y ...   a curve from the first to the last point
 *   o x,y ...     a closed curve          |          the next stroke
 * Curves are quadratic B-splines: a closed curve passes the middle of each side of its control polygon. An open curve
 * passes the middles of all sides but the first and the last one. */
const char *glyph_strokes(uint32_t code);
/* Returns the base letter of a letter with an accent, and the accent's strokes about x = 0 for a small letter. An
 * accent that begins with _ has the same height on a capital. Returns 0 for other characters. */
uint32_t glyph_base(uint32_t code, const char **accent);

/* Writes by newfile_write. what: the name of the picture in messages. */
int picture_write_file(newfile_put *encode, const void *source, const char *what, const char *path, struct sh_err *err);

/* Writes a struct picture_part as a PNG. */
int picture_encode_png(const void *part, FILE *file, struct sh_err *why);

#endif
