/* SPDX-License-Identifier: MIT */
/* Writes an image as a PNG. Files of pictures appear under their names only when they are complete. */
#include <errno.h>
#include <png.h>
#include <string.h>

#include "core/studio/picture/inside.h"

/* libpng reports errors by a callback that must not return. Where a write fails libpng has only "Write Error", and the
 * system has the reason. */
static void on_error(png_structp png, png_const_charp text)
{
    const int why = errno;
    FILE *file = png_get_io_ptr(png);
    sh_fail(png_get_error_ptr(png), SH_EIO, "%s", file != NULL && ferror(file) && why != 0 ? strerror(why) : text);
    png_longjmp(png, 1);
}

static void on_warning(png_structp png, png_const_charp text)
{
    (void)png;
    (void)text; /* libpng's warnings concern chunks that we do not write */
}

/* Nothing that is used after longjmp changes between setjmp and longjmp. */
static int encode(const struct picture_part *part, FILE *file, png_structp png, png_infop info)
{
    if (setjmp(png_jmpbuf(png)) != 0) return SH_EIO;
    png_init_io(png, file);
    png_set_compression_level(png, 9);
    png_set_filter(png, PNG_FILTER_TYPE_BASE, PNG_FILTER_NONE); /* best for pictures of few colours */
    png_set_IHDR(png, info, part->width, part->height, 8, PNG_COLOR_TYPE_RGB, PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_set_sRGB(png, info, PNG_sRGB_INTENT_RELATIVE);
    if (part->clear != NULL) {
        const png_color_16 clear = {.red = part->clear[0], .green = part->clear[1], .blue = part->clear[2]};
        png_set_tRNS(png, info, NULL, 0, &clear);
    }
    png_write_info(png, info);
    for (uint32_t row = part->row; row < part->row + part->height; row++)
        png_write_row(png, part->picture->rgb + ((size_t)row * part->picture->width + part->column) * 3);
    png_write_end(png, info);
    return SH_OK;
}

int picture_encode_png(const void *part, FILE *file, struct sh_err *why)
{
    png_infop info = NULL;
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, why, on_error, on_warning);
    if (png != NULL) info = png_create_info_struct(png);
    int rc = info != NULL ? encode(part, file, png, info) : sh_fail(why, SH_ENOMEM, "no memory");
    png_destroy_write_struct(&png, &info);
    if (rc == SH_OK && fflush(file) != 0) rc = sh_fail(why, SH_EIO, "%s", strerror(errno));
    return rc;
}

int picture_write_file(newfile_put *encoder, const void *source, const char *what, const char *path, struct sh_err *err)
{
    struct sh_err why = {0};
    const int rc = newfile_write(path, encoder, source, &why);
    return rc == SH_OK ? SH_OK : sh_fail(err, rc, "%s %s", what, why.text);
}

int picture_put_png(FILE *out, const struct picture *picture, struct sh_err *err)
{
    const struct picture_part whole = {picture, 0, 0, picture->width, picture->height, NULL};
    return picture_encode_png(&whole, out, err);
}

int picture_write_png(const struct picture *picture, const char *what, const char *path, struct sh_err *err)
{
    const struct picture_part whole = {picture, 0, 0, picture->width, picture->height, NULL};
    return picture_write_file(picture_encode_png, &whole, what, path, err);
}
