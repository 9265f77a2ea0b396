/* SPDX-License-Identifier: MIT */
/* Images: each format against the same picture, wrap modes against texels by hand, and hostile files that may do no
 * harm. BMP and TGA are written here byte by byte; the JPEG is libjpeg-turbo's of the same picture. */
#include "tests/unit/scene_files.h"

#include <math.h>
#include <png.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include "core/texture.h"

enum { SIDE = 16, TEXELS = SIDE * SIDE };

/* Four squares of 8 x 8 texels. */
static const uint8_t COLOUR[4][4] = {{200, 30, 40, 255}, {20, 180, 60, 128}, {10, 50, 220, 127}, {240, 240, 200, 0}};
static const uint8_t JPEG[] = {
    0xff, 0xd8, 0xff, 0xe0, 0x00, 0x10, 0x4a, 0x46, 0x49, 0x46, 0x00, 0x01, 0x01, 0x00, 0x00, 0x01, 0x00, 0x01, 0x00,
    0x00, 0xff, 0xdb, 0x00, 0x43, 0x00, 0x02, 0x01, 0x01, 0x01, 0x01, 0x01, 0x02, 0x01, 0x01, 0x01, 0x02, 0x02, 0x02,
    0x02, 0x02, 0x04, 0x03, 0x02, 0x02, 0x02, 0x02, 0x05, 0x04, 0x04, 0x03, 0x04, 0x06, 0x05, 0x06, 0x06, 0x06, 0x05,
    0x06, 0x06, 0x06, 0x07, 0x09, 0x08, 0x06, 0x07, 0x09, 0x07, 0x06, 0x06, 0x08, 0x0b, 0x08, 0x09, 0x0a, 0x0a, 0x0a,
    0x0a, 0x0a, 0x06, 0x08, 0x0b, 0x0c, 0x0b, 0x0a, 0x0c, 0x09, 0x0a, 0x0a, 0x0a, 0xff, 0xdb, 0x00, 0x43, 0x01, 0x02,
    0x02, 0x02, 0x02, 0x02, 0x02, 0x05, 0x03, 0x03, 0x05, 0x0a, 0x07, 0x06, 0x07, 0x0a, 0x0a, 0x0a, 0x0a, 0x0a, 0x0a,
    0x0a, 0x0a, 0x0a, 0x0a, 0x0a, 0x0a, 0x0a, 0x0a, 0x0a, 0x0a, 0x0a, 0x0a, 0x0a, 0x0a, 0x0a, 0x0a, 0x0a, 0x0a, 0x0a,
    0x0a, 0x0a, 0x0a, 0x0a, 0x0a, 0x0a, 0x0a, 0x0a, 0x0a, 0x0a, 0x0a, 0x0a, 0x0a, 0x0a, 0x0a, 0x0a, 0x0a, 0x0a, 0x0a,
    0x0a, 0x0a, 0x0a, 0x0a, 0x0a, 0x0a, 0xff, 0xc0, 0x00, 0x11, 0x08, 0x00, 0x10, 0x00, 0x10, 0x03, 0x01, 0x11, 0x00,
    0x02, 0x11, 0x01, 0x03, 0x11, 0x01, 0xff, 0xc4, 0x00, 0x15, 0x00, 0x01, 0x01, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
    0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x08, 0x0a, 0xff, 0xc4, 0x00, 0x14, 0x10, 0x01, 0x00, 0x00, 0x00,
    0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0xff, 0xc4, 0x00, 0x18, 0x01, 0x00,
    0x02, 0x03, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x08, 0x09, 0x06, 0x07,
    0x0a, 0xff, 0xc4, 0x00, 0x14, 0x11, 0x01, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
    0x00, 0x00, 0x00, 0x00, 0xff, 0xda, 0x00, 0x0c, 0x03, 0x01, 0x00, 0x02, 0x11, 0x03, 0x11, 0x00, 0x3f, 0x00, 0x23,
    0xa9, 0xf3, 0x50, 0x24, 0x11, 0xb6, 0x65, 0xc0, 0xb3, 0xf4, 0x12, 0x0a, 0xc8, 0x23, 0xf1, 0x28, 0xff, 0xd9,
};

static const uint8_t *colour_at(int x, int y)
{
    return COLOUR[(y / 8) * 2 + x / 8];
}

static void put(uint8_t *to, uint32_t value, int bytes)
{
    for (int i = 0; i < bytes; i++)
        to[i] = (uint8_t)(value >> 8 * i);
}

/* Writes blue, green, red and with `channels` 4 alpha. Rows go from the bottom, or with from_top from the top. */
static size_t pixels(uint8_t *to, int channels, int from_top)
{
    for (int row = 0; row < SIDE; row++)
        for (int x = 0; x < SIDE; x++) {
            const uint8_t *c = colour_at(x, from_top ? row : SIDE - 1 - row);
            const uint8_t bgra[4] = {c[2], c[1], c[0], c[3]};
            memcpy(to + channels * (row * SIDE + x), bgra, (size_t)channels);
        }
    return (size_t)(channels * TEXELS);
}

/* BITMAPFILEHEADER and BITMAPINFOHEADER (24 bits), or BITMAPV4HEADER with masks (32 bits). */
static size_t write_bmp(uint8_t *bmp, int channels)
{
    const uint32_t header = channels == 4 ? 108 : 40;
    memset(bmp, 0, 14 + header);
    memcpy(bmp, "BM", 2);
    put(bmp + 2, 14 + header + (uint32_t)(channels * TEXELS), 4);
    put(bmp + 10, 14 + header, 4);
    put(bmp + 14, header, 4);
    put(bmp + 18, SIDE, 4);
    put(bmp + 22, SIDE, 4);
    put(bmp + 26, 1, 2);
    put(bmp + 28, 8 * (uint32_t)channels, 2);
    if (channels == 4) {
        put(bmp + 30, 3, 4); /* BI_BITFIELDS */
        put(bmp + 54, 0xff0000, 4);
        put(bmp + 58, 0xff00, 4);
        put(bmp + 62, 0xff, 4);
        put(bmp + 66, 0xff000000, 4);
    }
    return 14 + header + pixels(bmp + 14 + header, channels, 0);
}

/* True colour, uncompressed; bit 5 of the descriptor: rows from the top. */
static size_t write_tga(uint8_t *tga, int channels, int from_top)
{
    memset(tga, 0, 18);
    tga[2] = 2;
    put(tga + 12, SIDE, 2);
    put(tga + 14, SIDE, 2);
    tga[16] = (uint8_t)(8 * channels);
    tga[17] = (uint8_t)((channels == 4 ? 8 : 0) | (from_top ? 0x20 : 0));
    return 18 + pixels(tga + 18, channels, from_top);
}

/* Runs have 8 texels, as the picture. */
static size_t write_packed_tga(uint8_t *tga)
{
    size_t n = 18;
    write_tga(tga, 3, 1);
    tga[2] = 10;
    for (int row = 0; row < SIDE; row++)
        for (int x = 0; x < SIDE; x += 8) {
            const uint8_t *c = colour_at(x, row), run[4] = {0x80 | 7, c[2], c[1], c[0]};
            memcpy(tga + n, run, sizeof run);
            n += sizeof run;
        }
    return n;
}

static const char *write_png(const char *name, int alpha)
{
    static uint8_t rgba[TEXELS][4];
    png_image image = {.version = PNG_IMAGE_VERSION,
                       .width = SIDE,
                       .height = SIDE,
                       .format = alpha ? PNG_FORMAT_RGBA : PNG_FORMAT_RGB};
    for (int i = 0; i < TEXELS; i++)
        memcpy((uint8_t *)rgba + (alpha ? 4 : 3) * i, colour_at(i % SIDE, i / SIDE), 4);
    write_file(name, "", 0);
    if (!png_image_write_to_file(&image, path, 0, rgba, 0, NULL)) fail_msg("%s", image.message);
    return path;
}

static void check_source(const struct texture_source *source, int alpha, int off)
{
    struct texture_image image;
    struct sh_err err;
    if (texture_read(source, &image, &err) != SH_OK) fail_msg("%s", err.text);
    assert_int_equal(image.width, SIDE);
    assert_int_equal(image.height, SIDE);
    assert_int_equal(image.has_alpha, alpha);
    for (int i = 0; i < TEXELS; i++)
        for (int c = 0; c < 4; c++) {
            int is = image.rgba[4 * i + c], want = c < 3 || alpha ? colour_at(i % SIDE, i / SIDE)[c] : 255;
            if (abs(is - want) > off) fail_msg("%s: texel %d, channel %d: %d, not %d", source->file, i, c, is, want);
        }
    texture_image_free(&image);
}

static void check_file(const char *file, int alpha, int off)
{
    check_source(&(struct texture_source){.file = file}, alpha, off);
    unlink(file);
}

static void each_format_has_the_same_picture(void **state)
{
    (void)state;
    static uint8_t bytes[8192];
    check_file(write_png("a.png", 0), 0, 0);
    check_file(write_png("b.png", 1), 1, 0);
    check_file(write_file("c.bmp", bytes, write_bmp(bytes, 3)), 0, 0);
    check_file(write_file("d.bmp", bytes, write_bmp(bytes, 4)), 1, 0);
    check_file(write_file("e.tga", bytes, write_tga(bytes, 3, 0)), 0, 0);
    check_file(write_file("f.tga", bytes, write_tga(bytes, 4, 1)), 1, 0);
    check_file(write_file("g.tga", bytes, write_packed_tga(bytes)), 0, 0);
    /* A flat block has one coefficient a channel: 8 times its mean, rounded to a multiple of 2. So luma and chroma are
     * off by an eighth, and by a half as whole numbers: less than 0.7. That is 0.7 (1 + 1.772) in blue (JFIF), and
     * rounding adds one. */
    check_file(write_file("h.jpg", JPEG, sizeof JPEG), 0, 3);
}

/* Bit 4 of a TGA's descriptor: rows begin at the right. Their texels are written in that order here. */
static void rows_may_begin_at_the_right(void **state)
{
    (void)state;
    static uint8_t bytes[8192];
    for (int i = 0; i < 4; i++) {
        const int channels = 3 + i / 2;
        const size_t n = write_tga(bytes, channels, i % 2);
        bytes[17] |= 0x10;
        for (int row = 0; row < SIDE; row++)
            for (int x = 0; x < SIDE; x++) {
                const uint8_t *c = colour_at(SIDE - 1 - x, i % 2 ? row : SIDE - 1 - row);
                const uint8_t bgra[4] = {c[2], c[1], c[0], c[3]};
                memcpy(bytes + 18 + channels * (row * SIDE + x), bgra, (size_t)channels);
            }
        check_file(write_file("right.tga", bytes, n), channels == 4, 0);
    }
}

/* Assimp passes texels of a file's own images on unpacked. */
static void unpacked_texels_have_the_same_picture(void **state)
{
    (void)state;
    static uint8_t bytes[4 * TEXELS];
    struct texture_source source = {
        .file = "within", .bytes = bytes, .n_bytes = pixels(bytes, 4, 1), .raw_width = SIDE, .raw_height = SIDE};
    struct texture_image image;
    struct sh_err err;
    check_source(&source, 1, 0);
    source.n_bytes--;
    assert_int_equal(texture_read(&source, &image, &err), SH_EINPUT);
    texture_image_free(&image);
    source = (struct texture_source){.file = "within", .bytes = JPEG, .n_bytes = sizeof JPEG};
    check_source(&source, 0, 3);
}

/* A JPEG that lacks its quantisation tables is read with tables of zeros: each coefficient is 0, so it is even grey. */
static void a_jpeg_without_tables_is_grey(void **state)
{
    (void)state;
    uint8_t bytes[sizeof JPEG];
    struct texture_image image;
    struct sh_err err;
    memcpy(bytes, JPEG, sizeof JPEG);
    for (int i = 0; i < 2; i++) {
        uint8_t *table = memmem(bytes, sizeof JPEG, "\xff\xdb", 2);
        assert_non_null(table);
        table[1] = 0xfe; /* a comment */
    }
    const struct texture_source source = {.file = "within", .bytes = bytes, .n_bytes = sizeof bytes};
    if (texture_read(&source, &image, &err) != SH_OK) fail_msg("%s", err.text);
    for (int i = 0; i < 4 * TEXELS; i++)
        assert_int_equal(image.rgba[i], i % 4 == 3 ? 255 : 128);
    texture_image_free(&image);
}

/* Many programs write zeros in the fourth channel. */
static void a_channel_of_zeros_is_no_alpha(void **state)
{
    (void)state;
    static uint8_t bytes[8192];
    size_t n = write_tga(bytes, 4, 1);
    for (size_t i = 18 + 3; i < n; i += 4)
        bytes[i] = 0;
    check_file(write_file("zero.tga", bytes, n), 0, 0);
}

/* A texel is a hole where alpha is below the share that counts as solid; one that equals it is not. For an opacity map
 * the light counts by Rec. 601: 0.299, 0.587 and 0.114 of red, green and blue. Texels are in a row, and each is looked
 * at in its middle. */
static void what_makes_a_hole(void **state)
{
    (void)state;
    static uint8_t by_alpha[4][4] = {{9, 9, 9, 0}, {9, 9, 9, 50}, {9, 9, 9, 51}, {9, 9, 9, 255}};
    static uint8_t by_light[4][4] = {{0, 0, 0, 255}, {255, 0, 0, 255}, {0, 255, 0, 255}, {0, 0, 255, 255}};
    static const enum texture_wrap wrap[2] = {TEXTURE_REPEAT, TEXTURE_REPEAT};
    static const struct {
        double solid;
        int light, hole[4];
    } is[] = {{0.2, 0, {1, 1, 0, 0}},   {0.19, 0, {1, 0, 0, 0}},  {0.298, 1, {1, 0, 0, 1}}, {0.3, 1, {1, 1, 0, 1}},
              {0.586, 1, {1, 1, 0, 1}}, {0.588, 1, {1, 1, 1, 1}}, {0.113, 1, {1, 0, 0, 0}}};
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++) {
        const struct texture_image image = {
            .width = 4, .height = 1, .has_alpha = !is[i].light, .rgba = is[i].light ? by_light[0] : by_alpha[0]};
        struct texture_mask *mask;
        struct sh_err err;
        assert_int_equal(texture_mask_create(&image, wrap, is[i].solid, is[i].light, &mask, &err), SH_OK);
        for (int k = 0; k < 4; k++) {
            const double uv[2] = {(k + 0.5) / 4.0, 0.5};
            if (texture_is_hole(mask, uv) != is[i].hole[k]) fail_msg("solid %g, texel %d", is[i].solid, k);
        }
        free(mask);
    }
}

static void wrap_modes_by_hand(void **state)
{
    (void)state;
    /* An image of 4 x 2 texels. v grows upward, and rows count from the top. */
    static const struct {
        double u, v;
        int column[4], row[4]; /* repeat, clamp, mirror, decal */
    } at[] = {
        {0.1, 0.9, {0, 0, 0, 0}, {0, 0, 0, 0}},        {0.9, 0.1, {3, 3, 3, 3}, {1, 1, 1, 1}},
        {1.1, 0.9, {0, 3, 3, -1}, {0, 0, 0, 0}},       {1.4, 0.9, {1, 3, 2, -1}, {0, 0, 0, 0}},
        {-0.1, 0.9, {3, 0, 0, -1}, {0, 0, 0, 0}},      {2.3, 0.1, {1, 3, 1, -1}, {1, 1, 1, 1}},
        {0.1, 1.3, {0, 0, 0, 0}, {1, 0, 0, -1}},       {0.1, -0.3, {0, 0, 0, 0}, {0, 1, 1, -1}},
        {0.6, -1.2, {2, 2, 2, 2}, {0, 1, 0, -1}},      {-5.4, 7.8, {2, 0, 2, -1}, {0, 0, 1, -1}},
        {1e300, -1e300, {0, 3, 0, -1}, {1, 1, 1, -1}},
    };
    for (size_t i = 0; i < sizeof at / sizeof *at; i++)
        for (int w = TEXTURE_REPEAT; w <= TEXTURE_DECAL; w++) {
            const struct texture_frame frame = {4, 2, {(enum texture_wrap)w, (enum texture_wrap)w}};
            const double uv[2] = {at[i].u, at[i].v};
            int64_t want = at[i].column[w] < 0 || at[i].row[w] < 0 ? -1 : at[i].row[w] * 4 + at[i].column[w];
            if (texture_at(&frame, uv) != want)
                fail_msg("%g %g, wrap %d: %d, not %d", at[i].u, at[i].v, w, (int)texture_at(&frame, uv), (int)want);
        }
    /* Each direction has its own mode. */
    const struct texture_frame mixed = {4, 2, {TEXTURE_CLAMP, TEXTURE_REPEAT}};
    assert_int_equal(texture_at(&mixed, (const double[2]){3.0, 1.9}), 3);
}

static struct texture_mask *mask_of(const uint8_t *rgba, int alpha, double solid, int by_light, enum texture_wrap wrap)
{
    uint8_t copy[8];
    memcpy(copy, rgba, sizeof copy);
    const struct texture_image image = {2, 1, copy, alpha};
    struct texture_mask *mask;
    struct sh_err err;
    assert_int_equal(
        texture_mask_create(&image, (const enum texture_wrap[2]){wrap, wrap}, solid, by_light, &mask, &err), SH_OK);
    return mask;
}

static void a_hole_is_what_is_below_the_half(void **state)
{
    (void)state;
    static const uint8_t cut[8] = {0, 0, 0, 127, 0, 0, 0, 128}, map[8] = {120, 120, 120, 255, 140, 140, 140, 255};
    static const double left[2] = {0.25, 0.5}, right[2] = {0.75, 0.5}, beyond[2] = {1.25, 0.5}, none[2] = {NAN, 0.5};
    struct texture_mask *mask = mask_of(cut, 1, 0.5, 0, TEXTURE_REPEAT);
    assert_true(texture_is_hole(mask, left) && !texture_is_hole(mask, right));
    assert_true(texture_is_hole(mask, beyond) && !texture_is_hole(mask, none));
    free(mask);
    mask = mask_of(cut, 1, 0.5, 0, TEXTURE_DECAL);
    assert_true(texture_is_hole(mask, left) && !texture_is_hole(mask, beyond));
    free(mask);
    mask = mask_of(map, 0, 0.5, 1, TEXTURE_REPEAT); /* an opacity map has no alpha of its own */
    assert_true(texture_is_hole(mask, left) && !texture_is_hole(mask, right));
    free(mask);
    assert_null(mask_of(map, 0, 0.5, 0, TEXTURE_REPEAT));
    assert_null(mask_of(cut, 1, 0.4, 0, TEXTURE_REPEAT));
}

/* Makes the signature and header of a PNG of that size, and the name of its data's chunk, which newer decoders look
 * for. Decoding ends before the checksums. */
static size_t png_of_size(uint8_t *png, uint32_t width, uint32_t height)
{
    static const uint8_t start[16] = {0x89, 'P', 'N', 'G', 13, 10, 26, 10, 0, 0, 0, 13, 'I', 'H', 'D', 'R'};
    memset(png, 0, 64);
    memcpy(png, start, sizeof start);
    for (int i = 0; i < 4; i++) {
        png[16 + i] = (uint8_t)(width >> 8 * (3 - i));
        png[20 + i] = (uint8_t)(height >> 8 * (3 - i));
    }
    png[24] = 8;
    png[25] = 6;
    memcpy(png + 37, "IDAT", 4);
    return 64;
}

static void fails(const char *file, const char *expected)
{
    struct texture_image image;
    struct sh_err err;
    assert_int_equal(texture_read(&(struct texture_source){.file = file}, &image, &err), SH_EINPUT);
    if (strstr(err.text, expected) == NULL || strstr(err.text, file) == NULL) fail_msg("%s", err.text);
    texture_image_free(&image);
    unlink(file);
}

/* Each format gives its size before the first texel, so images that are too large are reported as such. */
static void what_is_too_large_is_said_to_be(void **state)
{
    (void)state;
    static const char side[] = "allowed are 1 to 16384 a side, and up to 67108864 in all";
    static uint8_t bytes[8192];
    char says[160];
    const struct {
        uint32_t width, height;
    } png[] = {{16385, 1}, {1, 16385}, {60000, 60000}, {0x7fffffff, 5}, {0xffffffff, 5}, {0, 5}};
    for (size_t i = 0; i < sizeof png / sizeof png[0]; i++) {
        snprintf(says, sizeof says, "large.png: %u x %u texels; %s", png[i].width, png[i].height, side);
        fails(write_file("large.png", bytes, png_of_size(bytes, png[i].width, png[i].height)), says);
    }
    memcpy(bytes, JPEG, sizeof JPEG);
    uint8_t *frame = memmem(bytes, sizeof JPEG, "\xff\xc0", 2);
    assert_non_null(frame);
    memset(frame + 5, 0xea, 4);
    snprintf(says, sizeof says, "large.jpg: 60138 x 60138 texels; %s", side);
    fails(write_file("large.jpg", bytes, sizeof JPEG), says);
    size_t n = write_tga(bytes, 3, 1);
    put(bytes + 12, 60000, 2);
    snprintf(says, sizeof says, "large.tga: 60000 x 16 texels; %s", side);
    fails(write_file("large.tga", bytes, n), says);
    n = write_bmp(bytes, 3);
    put(bytes + 18, 60000, 4);
    snprintf(says, sizeof says, "large.bmp: 60000 x 16 texels; %s", side);
    fails(write_file("large.bmp", bytes, n), says);
    put(bytes + 22, (uint32_t)-SIDE, 4); /* rows from the top */
    fails(write_file("large.bmp", bytes, n), says);
    n = png_of_size(bytes, 16, 16);
    bytes[24] = 7; /* bits of a channel */
    fails(write_file("depth.png", bytes, n), "1/2/4/8/16-bit only");
}

/* A height below 0 means that the rows come from the top. */
static void a_bmp_from_the_top_is_read(void **state)
{
    (void)state;
    static uint8_t bytes[8192];
    const size_t n = write_bmp(bytes, 3);
    put(bytes + 22, (uint32_t)-SIDE, 4);
    pixels(bytes + 54, 3, 1);
    check_file(write_file("top.bmp", bytes, n), 0, 0);
}

static void hostile_files_take_no_gigabytes(void **state)
{
    (void)state;
    static uint8_t tga[8192];
    uint8_t bytes[64];
    struct rusage before, after;
    getrusage(RUSAGE_SELF, &before);
    fails(write_file("wide.png", bytes, png_of_size(bytes, 16385, 1)), "");
    fails(write_file("huge.png", bytes, png_of_size(bytes, 16384, 16384)), "allowed are 1 to 16384 a side");
    fails(write_file("most.png", bytes, png_of_size(bytes, 16384, 4096)), "the image can't be read");
    fails(write_text("text.png", "no image"), "allowed are PNG, JPEG, TGA, BMP and WebP");
    fails(write_text("empty.png", ""), "it is empty");
    fails(write_file("cut.png", JPEG, 40), "the image can't be read");
    fails(write_file("cut.tga", tga, write_tga(tga, 4, 1) - 1), "it is cut off");
    size_t n = write_packed_tga(tga);
    put(tga + 12, 16384, 2); /* 2^26 texels of some bytes: seconds of zeros */
    put(tga + 14, 4096, 2);
    fails(write_file("packed.tga", tga, n), "it is cut off");
    fails(write_file("short.tga", tga, 29), "it is cut off");
    fails(write_file("cut.bmp", tga, write_bmp(tga, 3) - 60), "it is cut off");
    memcpy(tga, JPEG, sizeof JPEG);
    uint8_t *table = memmem(tga, sizeof JPEG, "\xff\xc4", 2);
    assert_non_null(table);
    memset(table + 5, 0xff, 16); /* 16 times 255 codes: the decoder's array has 257 entries */
    fails(write_file("table.jpg", tga, sizeof JPEG), "a table of more than 256 codes");
    fails(write_file("end.jpg", tga, (size_t)(table + 9 - tga)), "a table of more than 256 codes");
    table[2] = 1; /* the segment is longer than 255 bytes */
    fails(write_file("long.jpg", tga, sizeof JPEG), "a table of more than 256 codes");
    memcpy(tga, JPEG, sizeof JPEG);
    table = memmem(tga, sizeof JPEG, "\xff\xc4\0\x14\x10", 5);
    assert_non_null(table);
    table[4] = 0x12; /* the table becomes the third of its kind, but the scan names the first */
    fails(write_file("lacks.jpg", tga, sizeof JPEG), "the image can't be read");
    snprintf(path, sizeof path, "%s/none.png", folder);
    fails(path, "No such file");
    snprintf(path, sizeof path, "%s/pipe.png", folder);
    assert_int_equal(mkfifo(path, 0600), 0);
    fails(path, "a FIFO, not a file");
    getrusage(RUSAGE_SELF, &after);
    assert_true(after.ru_maxrss - before.ru_maxrss < 64 << 10); /* KiB */
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(each_format_has_the_same_picture),
                                       cmocka_unit_test(rows_may_begin_at_the_right),
                                       cmocka_unit_test(unpacked_texels_have_the_same_picture),
                                       cmocka_unit_test(a_jpeg_without_tables_is_grey),
                                       cmocka_unit_test(a_channel_of_zeros_is_no_alpha),
                                       cmocka_unit_test(wrap_modes_by_hand),
                                       cmocka_unit_test(what_makes_a_hole),
                                       cmocka_unit_test(a_hole_is_what_is_below_the_half),
                                       cmocka_unit_test(what_is_too_large_is_said_to_be),
                                       cmocka_unit_test(a_bmp_from_the_top_is_read),
                                       cmocka_unit_test(hostile_files_take_no_gigabytes)};
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
