/* SPDX-License-Identifier: MIT */
/* Small GeoTIFFs for tests, by libtiff. */
#ifndef TESTS_COMMON_TIF_H
#define TESTS_COMMON_TIF_H

#include <stddef.h>
#include <stdint.h>

/* Values of cells and of tags. A tag of zero isn't written, or has its usual value. */
struct tif {
    uint32_t width, height;
    const double *value;                                               /* [height][width] */
    uint16_t bits, format, compression, predictor, photometric, bands; /* format: 1 unsigned, 2 signed, 3 float */
    uint32_t tile;                                                     /* 16 x 16 and so on, 0: strips of 3 rows */
    double scale[3], tie[6], matrix[16]; /* matrix[0] or [1] not 0: in place of the other two */
    uint16_t key[8][2];                  /* GeoKeys with their codes, rising */
    const char *no_data, *metadata;
    const char *mode; /* of libtiff: "w", "w8" BigTIFF, "wb" big-endian */
    int with_mask;    /* a second image, which is a mask */
    uint32_t kind;    /* NewSubfileType of the first one */
};

/* Returns EPSG:32632 with cells of 2 x 3 m, the corner at 690000, 5336000, and 32-bit floats. */
struct tif tif_of(uint32_t width, uint32_t height, const double *value);
void tif_write(const char *path, const struct tif *tif);

#endif
