/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/csv_file.h"

#include <math.h>
#include <string.h>

void csv_file_put_text(FILE *out, const char *text)
{
    if (text[strcspn(text, ",\"\r\n")] == '\0') {
        fputs(text, out);
        return;
    }
    putc('"', out);
    for (const char *p = text; *p != '\0'; p++) {
        if (*p == '"') putc('"', out);
        putc(*p, out);
    }
    putc('"', out);
}

const char *csv_file_colour(const struct scene_surface *s, char text[CSV_FILE_COLOUR_LEN])
{
    unsigned rgb[3];
    if (!s->has_colour) return "";
    for (int k = 0; k < 3; k++)
        rgb[k] = (unsigned)lround(255.0 * (double)s->colour[k]);
    snprintf(text, CSV_FILE_COLOUR_LEN, "#%02x%02x%02x", rgb[0], rgb[1], rgb[2]);
    return text;
}
