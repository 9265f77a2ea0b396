#include "core/surface/texture.h"

#include <math.h>
#include <png.h>
#include <stdlib.h>
#include <string.h>

/* Rows from the top; each texel as in the high bits of a label. Shared by labels of the same image and
 * colour. */
struct surface_texture {
    uint32_t width, height, users;
    const struct scene_texture *from;
    float colour[3];
    uint16_t texel[];
};

enum { MOST_SIDE = 16384, CHANNELS = 3 };

void surface_textures_free(struct surface_table *table)
{
    for (uint32_t i = 0; table->texture != NULL && i <= table->n; i++)
        if (table->texture[i] != NULL && --table->texture[i]->users == 0) free(table->texture[i]);
    free(table->texture);
    table->texture = NULL;
}

static uint16_t as_texel(double reflectance)
{
    return (uint16_t)(1 + lround(65534.0 * fmin(1.0, fmax(0.0, reflectance))));
}

static void fill(struct surface_texture *t, const uint8_t *rgb, const float colour[CHANNELS])
{
    static const double weight[CHANNELS] = {0.2126, 0.7152, 0.0722};
    double part[CHANNELS][256];
    for (int c = 0; c < CHANNELS; c++)
        for (int v = 0; v < 256; v++)
            part[c][v] = weight[c] * surface_linear((double)colour[c]) * surface_linear(v / 255.0);
    for (size_t i = 0; i < (size_t)t->width * t->height; i++)
        t->texel[i] = as_texel(part[0][rgb[3 * i]] + part[1][rgb[3 * i + 1]] + part[2][rgb[3 * i + 2]]);
}

/* The image as 8 bits of sRGB a channel, whatever the file holds; on black where it is transparent. */
static int decode(const struct scene_texture *from, png_image *image, uint8_t **rgb, struct sh_err *err)
{
    static const png_color black = {0, 0, 0};
    *rgb = NULL;
    int ok = from->bytes != NULL ? png_image_begin_read_from_memory(image, from->bytes, from->n_bytes)
                                 : png_image_begin_read_from_file(image, from->file);
    if (!ok) return sh_fail(err, SH_EINPUT, "%s: no PNG that can be read: %s", from->file, image->message);
    if (image->width > MOST_SIDE || image->height > MOST_SIDE)
        return sh_fail(err, SH_EINPUT, "%s: %u x %u texels; allowed are up to %d a side", from->file,
                       (unsigned)image->width, (unsigned)image->height, MOST_SIDE);
    image->format = PNG_FORMAT_RGB;
    *rgb = malloc(PNG_IMAGE_SIZE(*image));
    if (*rgb == NULL) return sh_fail(err, SH_ENOMEM, "%s: no memory", from->file);
    if (!png_image_finish_read(image, &black, *rgb, 0, NULL))
        return sh_fail(err, SH_EINPUT, "%s: no PNG that can be read: %s", from->file, image->message);
    return SH_OK;
}

static int load(const struct scene_texture *from, const float colour[CHANNELS], struct surface_texture **out,
                struct sh_err *err)
{
    png_image image = {.version = PNG_IMAGE_VERSION};
    uint8_t *rgb;
    int rc = decode(from, &image, &rgb, err);
    size_t n = (size_t)image.width * image.height;
    struct surface_texture *t = rc == SH_OK ? malloc(sizeof *t + n * sizeof *t->texel) : NULL;
    if (rc == SH_OK && t == NULL) rc = sh_fail(err, SH_ENOMEM, "%s: no memory", from->file);
    if (rc == SH_OK) {
        *t = (struct surface_texture){.width = image.width, .height = image.height, .from = from};
        memcpy(t->colour, colour, sizeof t->colour);
        fill(t, rgb, colour);
    }
    png_image_free(&image);
    free(rgb);
    *out = t;
    return rc;
}

static struct surface_texture *find(const struct surface_table *table, const struct scene_texture *from,
                                    const float colour[CHANNELS])
{
    for (uint32_t i = 0; i < table->n; i++) {
        struct surface_texture *t = table->texture[i];
        if (t != NULL && t->from == from && memcmp(t->colour, colour, sizeof t->colour) == 0) return t;
    }
    return NULL;
}

int surface_table_texture(struct surface_table *table, uint32_t label, const struct scene_surface *named,
                          const struct scene_texture *texture, struct sh_err *err)
{
    static const float white[CHANNELS] = {1.0f, 1.0f, 1.0f};
    const float *colour = named->has_colour ? named->colour : white;
    const struct surface *s = &table->surface[label];
    if (s->glass > 0.0 || s->mirror > 0.0) return SH_OK;
    if (table->texture == NULL) table->texture = calloc((size_t)table->n + 1, sizeof *table->texture);
    if (table->texture == NULL) return sh_fail(err, SH_ENOMEM, "no memory for textures");
    struct surface_texture *t = find(table, texture, colour);
    int rc = t == NULL ? load(texture, colour, &t, err) : SH_OK;
    if (rc != SH_OK) return rc;
    t->users++;
    table->texture[label] = t;
    return SH_OK;
}

uint32_t surface_texel(const struct surface_table *table, uint32_t label, const double uv[2])
{
    const struct surface_texture *t = table->texture[label];
    double u = uv[0] - floor(uv[0]), v = uv[1] - floor(uv[1]);
    uint32_t column = (uint32_t)(u * t->width), row = (uint32_t)((1.0 - v) * t->height);
    if (column >= t->width) column = t->width - 1; /* u or 1 - v rounded to 1 */
    if (row >= t->height) row = t->height - 1;
    return label | (uint32_t)t->texel[(size_t)row * t->width + column] << 16;
}
