/* SPDX-License-Identifier: MIT */
/* LAS 1.2 to 1.4 (ASPRS), point formats 0 to 10, not compressed. */
#include "core/bytes.h"
#include "core/studio/analysis/cloud_readers.h"
#include "core/text.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    HEADER_MIN = 227,
    HEADER_13 = 235,
    HEADER_14 = 375,
    VLR_HEAD = 54,
    EVLR_HEAD = 60,
    EXTRA_LEN = 192,
    EXTRA_UINT16 = 3,
    N_FORMATS = 11
};

/* By format: the length of a point's record without extra bytes; where its GPS time and its colours are, 0: nowhere. */
static const unsigned standard_len[N_FORMATS] = {20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67};
static const unsigned time_at[N_FORMATS] = {0, 20, 0, 20, 20, 20, 22, 22, 22, 22, 22};
static const unsigned colours_at[N_FORMATS] = {0, 0, 20, 28, 0, 28, 0, 30, 30, 0, 30};

struct las {
    struct text t; /* the whole file */
    const uint8_t *data;
    struct cloud *cloud;
    const struct sh_report *report;
    uint64_t n, points_at; /* points, and where the first one begins */
    unsigned format, record_len;
    long label_at; /* in the record; -1: none */
    size_t n_no_station;
};

static int cloud_las_fail(const struct las *las, struct sh_err *err, const char *what)
{
    return text_fail(&las->t, 0, SH_EINPUT, err, "%s", what);
}

static int read_header(struct las *las, struct sh_err *err)
{
    const uint8_t *d = las->data;
    if (las->t.size < HEADER_MIN) return cloud_las_fail(las, err, "shorter than a LAS header");
    unsigned header_len = le_get16(d + 94);
    if (d[24] != 1 || d[25] < 2 || d[25] > 4) return cloud_las_fail(las, err, "not of LAS version 1.2 to 1.4");
    if ((d[104] & 0xc0) != 0) return cloud_las_fail(las, err, "compressed (LAZ), which is not read; write it as LAS");
    las->format = d[104];
    las->record_len = le_get16(d + 105);
    las->points_at = le_get32(d + 96);
    bool is_14 = d[25] == 4 && header_len >= HEADER_14 && las->t.size >= HEADER_14;
    las->n = is_14 ? le_get64(d + 247) : le_get32(d + 107);
    if (las->format >= N_FORMATS)
        return cloud_las_fail(las, err, "an unknown point data record format; known are 0 to 10");
    if (las->record_len < standard_len[las->format])
        return cloud_las_fail(las, err, "point records shorter than their format");
    if (las->points_at > las->t.size || las->n > (las->t.size - las->points_at) / las->record_len)
        return cloud_las_fail(las, err, "the file is cut off: it can't hold the points its header counts");
    return SH_OK;
}

/* Returns the EPSG code of a projected CRS, of ECEF, or of geodetic WGS 84 (EPSG has none for the order longitude,
 * latitude). UPS has other codes in LAS files, 5041 and 5042, since the easting comes first there. */
static int64_t epsg_of(const char *wkt)
{
    static const char mark[] = "AUTHORITY[\"EPSG\",\"";
    if (strncmp(wkt, "GEOCCS[", 7) == 0) return 4978;
    const char *at = strstr(wkt, "PROJCS["), *last = NULL;
    if (at == NULL && strstr(wkt, "GEOGCS[\"WGS 84\"") != NULL) return 4979;
    int depth = 0;
    for (; at != NULL && *at != 0; at++) {
        if (depth == 1 && strncmp(at, mark, sizeof mark - 1) == 0) last = at + sizeof mark - 1;
        depth += *at == '[' ? 1 : *at == ']' ? -1 : 0;
        if (*at == ']' && depth == 0) break;
    }
    if (last == NULL) return CLOUD_EPSG_UNKNOWN;
    long epsg = strtol(last, NULL, 10);
    return epsg == 5041 ? 32661 : epsg == 5042 ? 32761 : epsg;
}

/* Looks for the label among the extra bytes. */
static void read_extra(struct las *las, const uint8_t *p, size_t len)
{
    static const unsigned size[11] = {0, 1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
    unsigned at = standard_len[las->format];
    for (; len >= EXTRA_LEN; p += EXTRA_LEN, len -= EXTRA_LEN) {
        unsigned type = p[2];
        if (type > 10) return; /* arrays, now deprecated: the place of later fields is not known */
        if (type == EXTRA_UINT16 && strncmp((const char *)p + 4, "label", 32) == 0 && at + 2 <= las->record_len)
            las->label_at = at;
        at += type == 0 ? p[3] : size[type];
    }
}

static int read_vlrs(struct las *las, struct sh_err *err)
{
    uint64_t at = le_get16(las->data + 94), n = le_get32(las->data + 100);
    for (; n > 0; n--) {
        const uint8_t *vlr = las->data + at;
        size_t len = at + VLR_HEAD <= las->points_at ? le_get16(vlr + 20) : 0;
        if (at + VLR_HEAD + len > las->points_at)
            return cloud_las_fail(las, err, "its variable length records run into the points");
        unsigned record = le_get16(vlr + 18);
        if (strncmp((const char *)vlr + 2, "LASF_Projection", 16) == 0 && record == 2112) {
            char *wkt = strndup((const char *)vlr + VLR_HEAD, len);
            if (wkt == NULL) return text_fail(&las->t, 0, SH_ENOMEM, err, "no memory for its CRS");
            las->cloud->epsg = epsg_of(wkt);
            free(wkt);
        }
        if (strncmp((const char *)vlr + 2, "LASF_Spec", 16) == 0 && record == 4) read_extra(las, vlr + VLR_HEAD, len);
        at += VLR_HEAD + len;
    }
    return SH_OK;
}

/* The intensity of our own files is a reflectance: 0.01 dB a count, 32768 is 0 dB; 0: not modelled. */
static float reflectance_db(unsigned intensity)
{
    return intensity == 0 ? (float)NAN : (float)(((double)intensity - 32768.0) / 100.0);
}

/* A point in a LAS file is an echo, so its shot has at least one. Writers that do not know the number of returns leave
 * 0: then the point counts as the only echo of its shot. */
static uint8_t known_return(int number)
{
    return number > 0 ? (uint8_t)number : 1;
}

static void read_columns(const struct las *las, size_t i, const uint8_t *p)
{
    struct cloud *c = las->cloud;
    if (c->time_s != NULL) c->time_s[i] = le_get_double(p + time_at[las->format]);
    if (c->reflectance_db != NULL) c->reflectance_db[i] = reflectance_db(le_get16(p + 12));
    if (c->echo_count != NULL) c->echo_count[i] = known_return(las->format >= 6 ? p[14] >> 4 : p[14] >> 3 & 7);
}

/* Files of ours name the program as their generating software. */
static int is_ours(const struct las *las)
{
    return strncmp((const char *)las->data + 58, "scanhead", 32) == 0;
}

/* Returns the columns that are asked for and that the file has. */
static unsigned columns_of(const struct las *las, unsigned asked)
{
    unsigned has = 1u << CLOUD_ECHO_COUNT;
    if (time_at[las->format] != 0) has |= 1u << CLOUD_TIME;
    if (colours_at[las->format] != 0) has |= 1u << CLOUD_RGB;
    if (is_ours(las)) has |= 1u << CLOUD_REFLECTANCE;
    return (asked & has) | 1u << CLOUD_STATION | 1u << CLOUD_ECHO | (las->label_at >= 0 ? 1u << CLOUD_LABEL : 0);
}

static double count_m(const struct las *las)
{
    const double to_m = las->cloud->epsg == 4979 ? 111320.0 : 1.0; /* a degree */
    double scale[3];
    for (int k = 0; k < 3; k++)
        scale[k] = le_get_double(las->data + 131 + 8 * k);
    return fmax(fmax(scale[0], scale[1]) * to_m, scale[2]);
}

static int read_points(struct las *las, struct sh_err *err)
{
    struct cloud *c = las->cloud;
    bool is_new = las->format >= 6;
    for (size_t i = 0; i < c->n; i++) {
        const uint8_t *p = las->data + las->points_at + i * las->record_len;
        for (int k = 0; k < 3; k++) {
            double scale = le_get_double(las->data + 131 + 8 * k), offset = le_get_double(las->data + 155 + 8 * k);
            c->xyz_m[i][k] = (int32_t)le_get32(p + 4 * k) * scale + offset;
            if (!isfinite(c->xyz_m[i][k])) return cloud_las_fail(las, err, "scales and offsets that give no position");
        }
        if (c->epsg == 4979) { /* x is longitude in a LAS file, latitude here */
            double lon_deg = c->xyz_m[i][0];
            c->xyz_m[i][0] = c->xyz_m[i][1];
            c->xyz_m[i][1] = remainder(lon_deg, 360);
        }
        c->echo[i] = known_return(p[14] & (is_new ? 15 : 7));
        c->station[i] = le_get16(p + (is_new ? 20 : 18));
        if (c->station[i] == 0) las->n_no_station++;
        if (c->label != NULL) c->label[i] = le_get16(p + las->label_at);
        for (unsigned k = 0; c->rgb != NULL && k < 3; k++)
            c->rgb[i][k] = p[colours_at[las->format] + 2 * k + 1];
        read_columns(las, i, p);
        if ((i & 0xffff) != 0) continue;
        sh_progress(las->report, "reading the points", (double)i / (double)c->n);
        if (sh_stopped(las->report)) return sh_fail_stopped(err);
    }
    if (las->n_no_station == c->n) { /* no ID at all */
        free(c->station);
        c->station = NULL;
    } else if (las->n_no_station > 0) {
        return cloud_las_fail(las, err,
                              "some points have the point source ID 0, which is not a station; others have a station");
    }
    return SH_OK;
}

/* Extended records follow the points: the last of them ends the file. Waveforms in the file are such a record, which
 * version 1.3 has without a count. */
static uint64_t end_of_records(const struct las *las)
{
    const uint8_t *d = las->data;
    const uint64_t size = las->t.size, header_len = le_get16(d + 94) < size ? le_get16(d + 94) : size;
    uint64_t end = las->points_at + las->n * las->record_len, at = 0, n = 0;
    if (d[25] >= 3 && header_len >= HEADER_13) at = le_get64(d + 227);
    if (at != 0) n = 1;
    if (d[25] == 4 && header_len >= HEADER_14 && le_get32(d + 243) != 0) {
        at = le_get64(d + 235);
        n = le_get32(d + 243);
    }
    for (; n > 0 && at < size && size - at >= EVLR_HEAD; n--) {
        const uint64_t room = size - at - EVLR_HEAD, len = le_get64(d + at + 20);
        at += EVLR_HEAD + (len < room ? len : room);
        if (at > end) end = at;
    }
    return end;
}

static int progress(void *ctx, double fraction, struct sh_err *err)
{
    const struct las *las = ctx;
    sh_progress(las->report, "reading the file", fraction);
    return sh_check_stop(las->report, err);
}

int cloud_read_las(const char *path, unsigned columns, const struct sh_report *report, struct cloud *out,
                   struct sh_err *err)
{
    struct las las = {.cloud = out, .report = report, .label_at = -1};
    int rc = text_open(&las.t, path, progress, &las, err);
    las.data = (const uint8_t *)las.t.data;
    if (rc == SH_OK) rc = read_header(&las, err);
    if (rc == SH_OK) rc = read_vlrs(&las, err);
    if (rc == SH_OK) rc = cloud_make_room(out, (size_t)las.n, columns_of(&las, columns), err);
    if (rc == SH_OK) {
        out->n = (size_t)las.n;
        out->count_m = count_m(&las);
        out->has_own_counts = is_ours(&las);
        rc = read_points(&las, err);
    }
    if (rc == SH_OK && end_of_records(&las) < las.t.size)
        sh_warn(report, "%s: %llu bytes after the last point ignored", path,
                (unsigned long long)(las.t.size - end_of_records(&las)));
    text_close(&las.t);
    return rc;
}
