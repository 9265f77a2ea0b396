/* SPDX-License-Identifier: MIT */
#include "drivers/record/las_header.h"

#include <stdio.h>
#include <string.h>

#include "core/bytes.h"
#include "core/date.h"

enum {
    ENCODING_GPS_STANDARD = 1 << 0,
    ENCODING_WKT = 1 << 4,
    GPS_EPOCH_UNIX_S = 315964800, /* 1980-01-06 */
    ADJUSTED_S = 1000000000,
    EXTRA_UINT16 = 3,
    EXTRA_INT16 = 4,
    EXTRA_HAS_NO_DATA = 1 << 0,
    EXTRA_HAS_SCALE = 1 << 3,
};

static const double MOST_S = 1e12; /* fits into an integer, and is after any date */

static void put_text(uint8_t *to, size_t room, const char *text)
{
    size_t n = strlen(text);
    memset(to, 0, room);
    memcpy(to, text, n < room ? n : room);
}

static uint8_t *put_vlr_head(uint8_t *to, const char *user, uint16_t record, size_t len, const char *description)
{
    le_put16(to, 0);
    put_text(to + 2, 16, user);
    le_put16(to + 18, record);
    le_put16(to + 20, (uint16_t)len);
    put_text(to + 22, 32, description);
    return to + LAS_VLR_HEAD_LEN;
}

/* Describes an extra field of 2 bytes, which stands after a point. no_data is the field's value at points that have no
 * figure. scale 0: the field has no scale. */
static uint8_t *put_extra(uint8_t *to, uint8_t type, const char *name, int64_t no_data, double scale, const char *text)
{
    memset(to, 0, LAS_EXTRA_LEN);
    to[2] = type;
    to[3] = (uint8_t)(EXTRA_HAS_NO_DATA | (scale != 0.0 ? EXTRA_HAS_SCALE : 0));
    put_text(to + 4, 32, name);
    le_put64(to + 40, (uint64_t)no_data);
    if (scale != 0.0) le_put_double(to + 112, scale);
    put_text(to + 160, 32, text);
    return to + LAS_EXTRA_LEN;
}

static uint8_t *put_extra_vlr(uint8_t *to, const struct track *t)
{
    const int attributes = t->has_attributes, n = 1 + (attributes ? 2 : 0) + (t->has_deviations ? 1 : 0);
    to = put_vlr_head(to, "LASF_Spec", 4, (uint16_t)(n * LAS_EXTRA_LEN), "extra bytes of a point");
    to = put_extra(to, EXTRA_UINT16, "label", 0xffff, 0.0, "surface hit; 65535: none");
    if (!attributes) return to;
    to = put_extra(to, EXTRA_INT16, "amplitude", -32768, 0.01, "dB above detection threshold");
    to = put_extra(to, EXTRA_UINT16, "width", 0, 0.01, "ns FWHM; 655.35: that or more");
    if (!t->has_deviations) return to;
    return put_extra(to, EXTRA_UINT16, "deviation", 0xffff, 0.001, "of shape; 65.534: that or more");
}

static uint8_t *put_note_vlr(uint8_t *to, const struct las_facts *f)
{
    char note[LAS_NOTE_MAX];
    int gps_time = f->gps_time, moving = f->track->moving;
    int n =
        snprintf(note, sizeof note,
                 "GPS time: %s. Intensity: 32768 + 100 times the reflectance in dB (0 dB: a white Lambertian "
                 "target), 0: not modelled. Scan angle: %s. Point source ID: station.%s%s",
                 gps_time ? "adjusted standard GPS time" : "seconds since the scan's start, of no absolute clock",
                 f->minor == 2 ? "not given"
                 : moving      ? "not given, the head moves"
                          : "in the head's frame, from straight down (0) over the horizon (90 degrees) to straight up "
                            "(180)",
                 f->minor == 2 ? "" : " Label: surface hit.",
                 !f->has_waves ? ""
                               : " Waveforms: digitizer offset + gain * sample is the signal in units of the detection "
                                 "threshold. Sample k of a packet lies at point + (location - k * spacing) * (dx, dy, "
                                 "dz): (dx, dy, dz) leads back to the head. A packet may end in samples without light, "
                                 "which fill it up.");
    to = put_vlr_head(to, "LASF_Spec", 3, (size_t)n + 1, "text area description");
    memcpy(to, note, (size_t)n + 1);
    return to + n + 1;
}

/* Writes the text of the CRS, which ends in a NUL. Without a CRS it writes nothing. */
static uint8_t *put_crs_vlr(uint8_t *to, int epsg, int geoid)
{
    char wkt[CRS_WKT_MAX];
    size_t n = crs_wkt(epsg, geoid, wkt);
    if (n == 0) return to;
    to = put_vlr_head(to, "LASF_Projection", 2112, n + 1, "OGC coordinate system WKT");
    memcpy(to, wkt, n + 1);
    return to + n + 1;
}

/* Writes the CRS for LAS 1.2, as GeoTIFF's directory of keys (OGC 19-008). A key is four words: number, 0, 1, value. */
static uint8_t *put_keys_vlr(uint8_t *to, int epsg, int geoid)
{
    enum { MODEL = 1024, RASTER = 1025, GEODETIC = 2048, GEOCENTRIC_LENGTHS = 2052, ANGLES = 2054 };
    enum { PROJECTED = 3072, LENGTHS = 3076 };
    enum { VERTICAL = 4096, HEIGHTS = 4099, METRE = 9001, DEGREE = 9102 };
    const int model = epsg == 4978 ? 3 : epsg == 4979 ? 2 : 1;
    const int projected = epsg == 32661 ? 5041 : epsg == 32761 ? 5042 : epsg; /* UPS, the easting first */
    const int vertical = geoid ? 5773 : 5030;                                 /* EGM96; WGS 84's ellipsoid */
    const int key[][2] = {{MODEL, model},
                          {RASTER, 1},
                          {GEODETIC, model == 3   ? 4978
                                     : model == 2 ? 4326
                                                  : 0},
                          {GEOCENTRIC_LENGTHS, model == 3 ? METRE : 0},
                          {ANGLES, model == 2 ? DEGREE : 0},
                          {PROJECTED, model == 1 ? projected : 0},
                          {LENGTHS, model == 1 ? METRE : 0},
                          {VERTICAL, model != 3 ? vertical : 0},
                          {HEIGHTS, model != 3 ? METRE : 0}};
    if (epsg == 0) return to;
    uint8_t *directory = to + LAS_VLR_HEAD_LEN, *at = directory + 8;
    for (size_t i = 0; i < sizeof key / sizeof key[0]; i++) {
        const uint16_t word[4] = {(uint16_t)key[i][0], 0, 1, (uint16_t)key[i][1]};
        for (int k = 0; k < 4 && key[i][1] != 0; k++, at += 2)
            le_put16(at, word[k]);
    }
    const uint16_t head[4] = {1, 1, 0, (uint16_t)((at - directory) / 8 - 1)};
    for (int k = 0; k < 4; k++)
        le_put16(directory + 2 * k, head[k]);
    put_vlr_head(to, "LASF_Projection", 34735, (size_t)(at - directory), "GeoTIFF GeoKeyDirectoryTag");
    return at;
}

/* Puts the descriptors of packets. The descriptors' room is always the same; unused room lies between descriptors and
 * points. */
static uint8_t *put_kinds(uint8_t *to, const struct las_waves *waves)
{
    memset(to, 0, LAS_KINDS * LAS_KIND_LEN);
    for (uint32_t i = 0; i < waves->n_kinds; i++) {
        const struct las_kind *k = &waves->kind[i];
        uint8_t *at = put_vlr_head(to + i * LAS_KIND_LEN, "LASF_Spec", (uint16_t)(LAS_KIND_FIRST_RECORD + i),
                                   LAS_KIND_LEN - LAS_VLR_HEAD_LEN, "waveform packet descriptor");
        at[0] = (uint8_t)k->bits;
        le_put32(at + 2, k->n);
        le_put32(at + 6, k->sample_ps);
        le_put_double(at + 10, k->gain);
        le_put_double(at + 18, k->offset);
    }
    return to + LAS_KINDS * LAS_KIND_LEN;
}

/* Puts day of the year and year, in GPS time. GPS time differs from UTC by some seconds, so a day may begin that much
 * early. */
static void put_date(uint8_t *to, const struct las_facts *f)
{
    struct date_time at;
    const double posix_s = f->created_gps_s + ADJUSTED_S + GPS_EPOCH_UNIX_S;
    if (!f->gps_time || !(posix_s >= 0.0 && posix_s < MOST_S) || !date_of_posix((int64_t)posix_s, &at)) return;
    le_put16(to, (uint16_t)(date_days(at.year, at.month, at.day) - date_days(at.year, 1, 1) + 1));
    le_put16(to + 2, (uint16_t)at.year);
}

static uint8_t format_of(const struct las_facts *f)
{
    if (f->minor == 2) return f->track->has_colours ? 3 : 1;
    return (uint8_t)((f->has_waves ? 9 : 6) + (f->track->has_colours != 0));
}

/* The places of the counts differ by version; LAS 1.4 leaves the counts of 32 bits 0. */
static void put_numbers(uint8_t *to, const struct las_facts *f)
{
    if (f->minor != 2) le_put64(to + LAS_POINTS_AT, f->n_points);
    if (f->minor == 2) le_put32(to + 107, (uint32_t)f->n_points);
    for (int i = 0; i < (f->minor == 2 ? LAS_12_RETURNS : LAS_RETURNS); i++) {
        if (f->minor == 2)
            le_put32(to + 111 + 4 * i, (uint32_t)f->n_by_return[i]);
        else
            le_put64(to + 255 + 8 * i, f->n_by_return[i]);
    }
}

void las_put_counts(const struct las_facts *f, uint8_t *to)
{
    put_numbers(to, f);
    for (int i = 0; i < 3 && f->n_points != 0; i++) {
        le_put_double(to + 179 + 16 * i, f->max[i] * f->scale[i] + f->offset[i]);
        le_put_double(to + 187 + 16 * i, f->min[i] * f->scale[i] + f->offset[i]);
    }
}

void las_count_record(struct las_facts *f, const uint8_t *record)
{
    const unsigned echo = record[14] & (f->minor == 2 ? 7u : 15u);
    for (int i = 0; i < 3; i++) {
        const int32_t n = (int32_t)le_get32(record + 4 * i);
        if (f->n_points == 0 || n < f->min[i]) f->min[i] = n;
        if (f->n_points == 0 || n > f->max[i]) f->max[i] = n;
    }
    f->n_points++;
    if (echo >= 1) f->n_by_return[echo - 1]++;
}

size_t las_header_len(const struct las_facts *f)
{
    return f->minor == 2 ? LAS_HEADER_12_LEN : LAS_HEADER_LEN;
}

static int encoding_of(const struct las_facts *f)
{
    const int waves = !f->has_waves ? 0 : f->waves_at != 0 ? LAS_WAVES_INSIDE : LAS_WAVES_OUTSIDE;
    return (f->minor == 2 ? 0 : ENCODING_WKT) | (f->gps_time ? ENCODING_GPS_STANDARD : 0) | waves;
}

static void put_header(uint8_t *to, const struct las_facts *f, size_t front_len, uint32_t n_vlrs)
{
    memset(to, 0, las_header_len(f));
    memcpy(to, "LASF", 4);
    le_put16(to + LAS_ENCODING_AT, (uint16_t)encoding_of(f));
    to[24] = 1;
    to[25] = (uint8_t)f->minor;
    put_text(to + 26, 32, f->profile);
    put_text(to + LAS_SOFTWARE_AT, 32, f->incomplete ? LAS_SOFTWARE_INCOMPLETE : LAS_SOFTWARE);
    put_date(to + 90, f);
    le_put16(to + 94, (uint16_t)las_header_len(f));
    le_put32(to + 96, (uint32_t)front_len);
    le_put32(to + 100, n_vlrs);
    to[104] = format_of(f);
    le_put16(to + 105, (uint16_t)las_point_len(f));
    for (int i = 0; i < 3; i++) {
        le_put_double(to + 131 + 8 * i, f->scale[i]);
        le_put_double(to + 155 + 8 * i, f->offset[i]);
    }
    if (f->waves_at != 0) {
        le_put64(to + LAS_WAVES_AT, f->waves_at);
        le_put64(to + LAS_EVLRS_AT, f->waves_at);
        le_put32(to + LAS_EVLRS_AT + 8, 1);
    }
    if (!f->is_growing) las_put_counts(f, to);
}

size_t las_front(const struct las_facts *f, uint8_t to[LAS_FRONT_MAX])
{
    const struct track *t = f->track;
    uint8_t *end = to + las_header_len(f);
    if (f->minor != 2) end = put_extra_vlr(end, t);
    end = put_note_vlr(end, f);
    uint8_t *crs = end;
    end = f->minor == 2 ? put_keys_vlr(end, t->epsg, t->geoid_heights) : put_crs_vlr(end, t->epsg, t->geoid_heights);
    uint32_t n_records = (f->minor != 2) + 1u + (end > crs);
    if (f->has_waves) {
        end = put_kinds(end, f->waves);
        n_records += f->waves->n_kinds;
    }
    put_header(to, f, (size_t)(end - to), n_records);
    return (size_t)(end - to);
}

size_t las_format_len(int format)
{
    static const uint8_t own[] = {20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67};
    return own[format];
}

size_t las_own_len(const struct las_facts *f)
{
    return las_format_len(format_of(f));
}

size_t las_point_len(const struct las_facts *f)
{
    const struct track *t = f->track;
    size_t extra = LAS_LABEL_LEN + (t->has_attributes ? LAS_ATTRIBUTES_LEN : 0u);
    if (t->has_deviations) extra += LAS_DEVIATION_LEN;
    return las_own_len(f) + (f->minor == 2 ? 0 : extra);
}

size_t las_time_at(const struct las_facts *f)
{
    return f->minor == 2 ? 20 : 22;
}
