/* SPDX-License-Identifier: MIT */
/* Images through stb_image, and WebP through libwebp. Memory is counted, so that a hostile file can't ask for more than
 * a limit. */
#include "core/texture.h"

#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include <webp/decode.h>

#include "core/text.h"

/* Each block has its size in front of it, in this many bytes. */
enum { HEAD = 16 };
static _Thread_local size_t memory_left;
static _Thread_local int ran_out; /* memory was refused */

static void *counted_realloc(void *old, size_t size)
{
    char *block = old != NULL ? (char *)old - HEAD : NULL;
    size_t had = 0;
    if (block != NULL) memcpy(&had, block, sizeof had);
    ran_out = size > TEXTURE_MAX_MEMORY || (size > had && size - had > memory_left);
    if (ran_out) return NULL;
    block = realloc(block, HEAD + size);
    if (block == NULL) return NULL;
    memory_left = memory_left + had - size;
    memcpy(block, &size, sizeof size);
    return block + HEAD;
}

static void *counted_alloc(size_t size)
{
    return counted_realloc(NULL, size);
}

static void counted_free(void *p)
{
    size_t had;
    if (p == NULL) return;
    char *block = (char *)p - HEAD;
    memcpy(&had, block, sizeof had);
    memory_left += had;
    free(block);
}

/* Included as a system header, so that unused static functions give no warnings. */
#define STB_IMAGE_IMPLEMENTATION
#define STBI_NO_STDIO
#define STBI_NO_HDR
#define STBI_NO_LINEAR
#define STBI_ONLY_PNG
#define STBI_ONLY_JPEG
#define STBI_ONLY_TGA
#define STBI_ONLY_BMP
#define STBI_MAX_DIMENSIONS   TEXTURE_MAX_SIDE
#define STBI_MALLOC(size)     counted_alloc(size)
#define STBI_REALLOC(p, size) counted_realloc(p, size)
#define STBI_FREE(p)          counted_free(p)
#define STBI_ASSERT(x)        ((void)0) /* an assertion fails for 256 short codes, though the index is in range */
#ifdef __clang__ /* stb_image adds 0 to NULL, and copies 0 bytes from there; the address sanitizer stays on */
#pragma clang attribute push(__attribute__((no_sanitize("undefined"))), apply_to = function)
#endif
#include <stb/stb_image.h>
#ifdef __clang__
#pragma clang attribute pop
#endif

static int check_size(const char *file, uint32_t width, uint32_t height, struct sh_err *err)
{
    if (width > 0 && height > 0 && width <= TEXTURE_MAX_SIDE && height <= TEXTURE_MAX_SIDE &&
        (uint64_t)width * height <= TEXTURE_MAX_TEXELS)
        return SH_OK;
    return sh_fail(err, SH_EINPUT, "%s: %u x %u texels; allowed are 1 to %d a side, and up to %d in all", file, width,
                   height, TEXTURE_MAX_SIDE, TEXTURE_MAX_TEXELS);
}

static int fail_read(const char *file, const char *why, struct sh_err *err)
{
    return sh_fail(err, SH_EINPUT, "%s: the image can't be read (%s); allowed are PNG, JPEG, TGA, BMP and WebP", file,
                   why);
}

/* Turns blue, green, red, alpha into red, green, blue, alpha. */
static int unpack(const struct texture_source *s, struct texture_image *image, struct sh_err *err)
{
    size_t n = (size_t)s->raw_width * s->raw_height;
    int rc = check_size(s->file, s->raw_width, s->raw_height, err);
    if (rc != SH_OK) return rc;
    if (s->n_bytes < 4 * n) return fail_read(s->file, "it is cut off", err);
    memory_left = TEXTURE_MAX_MEMORY;
    image->rgba = counted_alloc(4 * n);
    if (image->rgba == NULL) return sh_fail(err, SH_ENOMEM, "%s: no memory", s->file);
    for (size_t i = 0; i < n; i++)
        for (size_t c = 0; c < 4; c++)
            image->rgba[4 * i + c] = s->bytes[4 * i + (c < 3 ? 2 - c : 3)];
    image->width = s->raw_width;
    image->height = s->raw_height;
    image->has_alpha = 1;
    return SH_OK;
}

/* Many writers of TGA and BMP leave a fourth channel of zeros, which is no alpha. In a PNG zeros are alpha. */
static void drop_unused_alpha(const uint8_t *bytes, struct texture_image *image)
{
    size_t n = (size_t)image->width * image->height, i = 0;
    if (!image->has_alpha || bytes[0] == 0x89) return;
    while (i < n && image->rgba[4 * i + 3] == 0)
        i++;
    if (i < n) return;
    for (i = 0; i < n; i++)
        image->rgba[4 * i + 3] = 255;
    image->has_alpha = 0;
}

/* A PNG without an alpha channel may name a colour that is transparent. */
static int has_transparent_colour(const uint8_t *bytes, size_t n)
{
    const uint8_t *data = memmem(bytes, n, "IDAT", 4);
    return bytes[0] == 0x89 && memmem(bytes, data != NULL ? (size_t)(data - bytes) : n, "tRNS", 4) != NULL;
}

/* stb_image silently fills in what a TGA or BMP lacks. Unpacked files have a length that follows from the bits
 * of a texel. A packed TGA is refused only where no runs could make so many texels, a packed BMP never. */
static int is_cut_off(const uint8_t *bytes, size_t n, uint64_t texels)
{
    if (n < 18 || bytes[0] == 0x89 || (bytes[0] == 0xff && bytes[1] == 0xd8)) return 0;
    const int is_bmp = bytes[0] == 'B' && bytes[1] == 'M';
    if (is_bmp && n < 31) return 0;
    const int is_packed = is_bmp ? bytes[30] == 1 : bytes[2] > 3;
    const uint64_t first = is_bmp ? bytes[10] + 256U * bytes[11] : 18U + bytes[0]; /* byte of the texels */
    if (is_packed && !is_bmp) return texels > 64 * (uint64_t)n; /* two bytes of a run are up to 128 texels */
    return !is_packed && first + texels * bytes[is_bmp ? 28 : 16] / 8 > n;
}

/* Whether a JPEG has a table with more than 256 Huffman codes: stb_image 2.27 writes them all, past the
 * end of its array. Each place that looks like such a table is checked, since a decoder may get to any of
 * them. */
static int has_long_table(const uint8_t *bytes, size_t n)
{
    const uint8_t *end = bytes + n, *marker = bytes;
    if (bytes[0] != 0xff || bytes[1] != 0xd8) return 0;
    while ((marker = memmem(marker, (size_t)(end - marker), "\xff\xc4", 2)) != NULL) {
        const uint8_t *table = marker + 4; /* after the segment's length */
        for (ptrdiff_t codes = 0; end - table > 1 && table[0] >> 4 <= 1 && (table[0] & 15) <= 3; table += 17 + codes) {
            codes = 0;
            for (int i = 1; i <= 16 && i < end - table; i++) /* stb_image reads zeros beyond the end */
                codes += table[i];
            if (codes > 256) return 1;
            if (end - table <= 17 + codes) break;
        }
        marker += 2;
    }
    return 0;
}

/* Loads a JPEG as stb_image does, but clears the tables first. Tables that a file uses and does not define are
 * uninitialised in stb_image, which then reads past their ends. In this function such tables are empty, so that none of
 * their codes is known. */
static uint8_t *load_jpeg(stbi__context *s, int *width, int *height, int *channels)
{
    int no_codes[16] = {0};
    stbi__jpeg *jpeg = counted_alloc(sizeof *jpeg);
    if (jpeg == NULL) return stbi__errpuc("outofmem", "Out of memory");
    memset(jpeg, 0, sizeof *jpeg);
    for (int i = 0; i < 4; i++) {
        stbi__build_huffman(&jpeg->huff_dc[i], no_codes);
        stbi__build_huffman(&jpeg->huff_ac[i], no_codes);
    }
    jpeg->s = s;
    stbi__setup_jpeg(jpeg);
    uint8_t *rgba = load_jpeg_image(jpeg, width, height, channels, 4);
    counted_free(jpeg);
    return rgba;
}

/* Four channels, to be freed by counted_free; NULL: stbi_failure_reason(). */
static uint8_t *decode_load(const uint8_t *bytes, size_t n, int *width, int *height, int *channels)
{
    stbi__context s;
    stbi__start_mem(&s, bytes, (int)n);
    if (stbi__jpeg_test(&s)) return load_jpeg(&s, width, height, channels);
    return stbi_load_from_memory(bytes, (int)n, width, height, channels, 4);
}

static int is_png(const uint8_t *bytes, size_t n)
{
    return n > 24 && memcmp(bytes, "\x89PNG\r\n\x1a\n", 8) == 0;
}

static int is_jpeg(const uint8_t *bytes, size_t n)
{
    return n > 3 && bytes[0] == 0xff && bytes[1] == 0xd8;
}

/* The segment of a JPEG with its size (SOF), or NULL. The segment's markers are 0xc0 to 0xcf, except three. */
static const uint8_t *find_frame(const uint8_t *bytes, size_t n)
{
    for (size_t at = 2; at + 9 <= n && bytes[at] == 0xff;) {
        const uint8_t marker = bytes[at + 1];
        if ((marker & 0xf0) == 0xc0 && marker != 0xc4 && marker != 0xc8 && marker != 0xcc) return bytes + at;
        if (marker == 0xda || marker == 0xd9) return NULL; /* the texels begin, or the image ends */
        at += marker == 0xff ? 1 : 2 + 256U * bytes[at + 2] + bytes[at + 3];
    }
    return NULL;
}

/* stb_image itself refuses PNG and JPEG that are too large. But it then tries the other formats, and gives the reason
 * of the last one. */
static int check_header(const char *file, const uint8_t *bytes, size_t n, struct sh_err *err)
{
    const uint8_t *frame = is_jpeg(bytes, n) ? find_frame(bytes, n) : NULL;
    if (frame != NULL) return check_size(file, 256U * frame[7] + frame[8], 256U * frame[5] + frame[6], err);
    if (!is_png(bytes, n)) return SH_OK;
    uint32_t side[2] = {0, 0};
    for (int i = 0; i < 8; i++)
        side[i / 4] = side[i / 4] << 8 | bytes[16 + i];
    return check_size(file, side[0], side[1], err);
}

/* As stbi_info_from_memory, but a failure has the reason of the file's own format. A BMP's height is negative where
 * its rows begin at the top. */
static int get_info(const uint8_t *bytes, size_t n, int *width, int *height, int *channels)
{
    stbi__context s;
    stbi__start_mem(&s, bytes, (int)n);
    if (is_png(bytes, n)) return stbi__png_info(&s, width, height, channels);
    if (is_jpeg(bytes, n)) return stbi__jpeg_info(&s, width, height, channels);
    if (!stbi_info_from_memory(bytes, (int)n, width, height, channels)) return 0;
    if (*height < 0 && *height > INT_MIN) *height = -*height;
    return 1;
}

/* The names of formats that are recognised but not read here. */
static const char *unread_kind(const uint8_t *bytes, size_t n)
{
    if (n >= 12 && memcmp(bytes, "\xabKTX 20\xbb\r\n\x1a\n", 12) == 0) return "it is KTX2";
    if (n >= 12 && memcmp(bytes, "\xabKTX 11\xbb\r\n\x1a\n", 12) == 0) return "it is KTX";
    if (n >= 4 && memcmp(bytes, "DDS ", 4) == 0) return "it is DDS";
    return n >= 12 && memcmp(bytes + 4, "ftypavif", 8) == 0 ? "it is AVIF" : NULL;
}

static int is_webp(const uint8_t *bytes, size_t n)
{
    return n >= 12 && memcmp(bytes, "RIFF", 4) == 0 && memcmp(bytes + 8, "WEBP", 4) == 0;
}

/* The memory that libwebp itself takes depends on the image's size, which is checked before. */
static int decode_webp(const struct texture_source *source, const uint8_t *bytes, size_t n_bytes,
                       struct texture_image *image, struct sh_err *err)
{
    WebPBitstreamFeatures is;
    if (WebPGetFeatures(bytes, n_bytes, &is) != VP8_STATUS_OK)
        return fail_read(source->file, "its WebP header is incomplete", err);
    if (is.has_animation) return fail_read(source->file, "WebP with an animation", err);
    int rc = check_size(source->file, (uint32_t)is.width, (uint32_t)is.height, err);
    if (rc != SH_OK) return rc;
    const size_t row = 4 * (size_t)is.width, size = row * (size_t)is.height;
    image->width = (uint32_t)is.width;
    image->height = (uint32_t)is.height;
    image->has_alpha = is.has_alpha;
    if (source->alpha_only && !image->has_alpha) return SH_OK;
    image->rgba = counted_alloc(size);
    if (image->rgba == NULL) return sh_fail(err, SH_ENOMEM, "%s: no memory", source->file);
    if (WebPDecodeRGBAInto(bytes, n_bytes, image->rgba, size, (int)row) != NULL) return SH_OK;
    return fail_read(source->file, "the WebP data are damaged or cut off", err);
}

/* Whether a TGA has the columns of its rows from right to left: bit 4 of its descriptor. A TGA has no signature: it is
 * what is none of the others. */
static int is_right_to_left(const uint8_t *bytes, size_t n)
{
    return n > 18 && !is_png(bytes, n) && !is_jpeg(bytes, n) && memcmp(bytes, "BM", 2) != 0 && (bytes[17] & 0x10) != 0;
}

/* stb_image reads such rows as if they began at the left. */
static void reverse_rows(struct texture_image *image)
{
    for (size_t y = 0; y < image->height; y++) {
        uint8_t *row = image->rgba + 4 * y * image->width, texel[4];
        for (size_t i = 0, k = image->width - 1; i < k; i++, k--) {
            memcpy(texel, row + 4 * i, 4);
            memcpy(row + 4 * i, row + 4 * k, 4);
            memcpy(row + 4 * k, texel, 4);
        }
    }
}

static int decode(const struct texture_source *source, const uint8_t *bytes, size_t n_bytes,
                  struct texture_image *image, struct sh_err *err)
{
    const char *file = source->file;
    int width = 0, height = 0, channels = 0;
    if (n_bytes == 0) return fail_read(file, "it is empty", err);
    if (n_bytes > TEXTURE_MAX_FILE)
        return sh_fail(err, SH_EINPUT, "%s: an image of %zu bytes; allowed are up to %d", file, n_bytes,
                       TEXTURE_MAX_FILE);
    if (n_bytes > 1 && has_long_table(bytes, n_bytes)) return fail_read(file, "a table of more than 256 codes", err);
    memory_left = TEXTURE_MAX_MEMORY;
    ran_out = 0;
    if (is_webp(bytes, n_bytes)) return decode_webp(source, bytes, n_bytes, image, err);
    if (unread_kind(bytes, n_bytes) != NULL) return fail_read(file, unread_kind(bytes, n_bytes), err);
    int rc = check_header(file, bytes, n_bytes, err);
    if (rc != SH_OK) return rc;
    if (!get_info(bytes, n_bytes, &width, &height, &channels)) return fail_read(file, stbi_failure_reason(), err);
    rc = check_size(file, (uint32_t)width, (uint32_t)height, err);
    if (rc != SH_OK) return rc;
    if (is_cut_off(bytes, n_bytes, (uint64_t)width * (uint64_t)height)) return fail_read(file, "it is cut off", err);
    image->width = (uint32_t)width;
    image->height = (uint32_t)height;
    image->has_alpha = channels == 2 || channels == 4 || has_transparent_colour(bytes, n_bytes);
    if (source->alpha_only && !image->has_alpha) return SH_OK;
    image->rgba = decode_load(bytes, n_bytes, &width, &height, &channels);
    if (image->rgba == NULL && ran_out)
        return sh_fail(err, SH_EINPUT, "%s: needs more than the allowed %d MiB of memory to decode", file,
                       TEXTURE_MAX_MEMORY >> 20);
    if (image->rgba == NULL) return fail_read(file, stbi_failure_reason(), err);
    drop_unused_alpha(bytes, image);
    if (is_right_to_left(bytes, n_bytes)) reverse_rows(image);
    return SH_OK;
}

int texture_read(const struct texture_source *source, struct texture_image *image, struct sh_err *err)
{
    struct text t;
    struct stat st;
    *image = (struct texture_image){0};
    if (source->bytes != NULL && source->raw_height > 0) return unpack(source, image, err);
    if (source->bytes != NULL) return decode(source, source->bytes, source->n_bytes, image, err);
    /* The size is checked before the file is read, which would take as much memory. */
    if (stat(source->file, &st) == 0 && st.st_size > TEXTURE_MAX_FILE)
        return decode(source, NULL, (size_t)st.st_size, image, err);
    int rc = text_open(&t, source->file, NULL, NULL, err);
    if (rc == SH_OK) rc = decode(source, (const uint8_t *)t.data, t.size, image, err);
    text_close(&t);
    return rc;
}

void texture_image_free(struct texture_image *image)
{
    counted_free(image->rgba);
    image->rgba = NULL;
}
