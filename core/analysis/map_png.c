/* The image as a PNG file. */
#include <errno.h>
#include <png.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/analysis/map_inside.h"
#include "core/newfile.h"

/* libpng reports by a callback that must not return. */
static void on_error(png_structp png, png_const_charp text)
{
    sh_fail(png_get_error_ptr(png), SH_EIO, "%s", text);
    png_longjmp(png, 1);
}

static void on_warning(png_structp png, png_const_charp text)
{
    (void)png;
    (void)text; /* libpng's warnings concern chunks that we do not write */
}

/* Nothing here is changed between setjmp and longjmp but through pointers. */
static int encode(const struct map_image *image, FILE *file, png_structp png, png_infop info)
{
    if (setjmp(png_jmpbuf(png)) != 0) return SH_EIO;
    png_init_io(png, file);
    png_set_IHDR(png, info, image->width, image->height, 8, PNG_COLOR_TYPE_RGB, PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_set_sRGB(png, info, PNG_sRGB_INTENT_RELATIVE);
    png_write_info(png, info);
    for (uint32_t row = 0; row < image->height; row++)
        png_write_row(png, image->rgb + (size_t)row * image->width * 3);
    png_write_end(png, info);
    return SH_OK;
}

static int encode_file(const struct map_image *image, FILE *file, struct sh_err *why)
{
    png_infop info = NULL;
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, why, on_error, on_warning);
    if (png != NULL) info = png_create_info_struct(png);
    int rc = info != NULL ? encode(image, file, png, info) : sh_fail(why, SH_EIO, "no memory");
    png_destroy_write_struct(&png, &info);
    if (rc == SH_OK && fflush(file) != 0) rc = sh_fail(why, SH_EIO, "%s", strerror(errno));
    return rc;
}

/* fd is taken in any case. */
static int write_part(const struct map_image *image, const char *path, const char *part, int fd, struct sh_err *err)
{
    struct sh_err why = {0};
    FILE *file = fdopen(dup(fd), "wb");
    int rc = file != NULL ? encode_file(image, file, &why) : sh_fail(&why, SH_EIO, "%s", strerror(errno));
    if (file != NULL && fclose(file) != 0 && rc == SH_OK) rc = sh_fail(&why, SH_EIO, "%s", strerror(errno));
    if (rc == SH_OK) return newfile_keep(path, part, fd, err);
    newfile_drop(part, fd);
    return sh_fail(err, rc, "%s: cannot be written: %s", path, why.text);
}

int map_png_write(const struct map_image *image, const char *path, struct sh_err *err)
{
    struct sh_err why = {0};
    char *part;
    int fd;
    if (asprintf(&part, "%s.part", path) < 0) return sh_fail(err, SH_ENOMEM, "map %s: no memory", path);
    int rc = newfile_part(path, part, &fd, &why);
    if (rc == SH_OK) rc = write_part(image, path, part, fd, &why);
    free(part);
    return rc == SH_OK ? SH_OK : sh_fail(err, rc, "map %s", why.text);
}
