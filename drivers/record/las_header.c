#include "drivers/record/las_header.h"

#include <stdio.h>
#include <string.h>
#include <time.h>

#include "drivers/protocol/bytes.h"

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

/* Describes one of the extra fields after a point, of 2 bytes. scale 0: none; no_data as its type has it. */
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

static uint8_t *put_extra_vlr(uint8_t *to, int attributes)
{
    to = put_vlr_head(to, "LASF_Spec", 4, (attributes ? 3 : 1) * LAS_EXTRA_LEN, "extra bytes of a point");
    to = put_extra(to, EXTRA_UINT16, "label", 0xffff, 0.0, "surface hit; 65535: none");
    if (!attributes) return to;
    to = put_extra(to, EXTRA_INT16, "amplitude", -32768, 0.01, "dB above detection threshold");
    return put_extra(to, EXTRA_UINT16, "width", 0, 0.01, "ns FWHM; 655.35: that or more");
}

static uint8_t *put_note_vlr(uint8_t *to, int gps_time, int moving)
{
    char note[LAS_NOTE_MAX];
    int n =
        snprintf(note, sizeof note,
                 "GPS time: %s. Intensity: 32768 + 100 times the reflectance in dB (0 dB: a white Lambertian "
                 "target), 0: not modelled. Scan angle: %s. Point source ID: station. Label: surface hit.",
                 gps_time ? "adjusted standard GPS time" : "seconds since the scan's start, of no absolute clock",
                 moving ? "not given, the head moves"
                        : "in the head's frame, from straight down (0) over the horizon (90 degrees) to straight up "
                          "(180)");
    to = put_vlr_head(to, "LASF_Spec", 3, (size_t)n + 1, "text area description");
    memcpy(to, note, (size_t)n + 1);
    return to + n + 1;
}

/* The CRS's text ends in a NUL; there is none without a CRS. */
static uint8_t *put_crs_vlr(uint8_t *to, int epsg, int geoid)
{
    char wkt[CRS_WKT_MAX];
    size_t n = crs_wkt(epsg, geoid, wkt);
    if (n == 0) return to;
    to = put_vlr_head(to, "LASF_Projection", 2112, n + 1, "OGC coordinate system WKT");
    memcpy(to, wkt, n + 1);
    return to + n + 1;
}

/* Day of the year and year, in GPS time: leap seconds don't matter to a day but for seconds. */
static void put_date(uint8_t *to, const struct las_facts *f)
{
    struct tm day;
    time_t unix_s = (time_t)(f->created_gps_s + ADJUSTED_S) + GPS_EPOCH_UNIX_S;
    if (!f->gps_time || gmtime_r(&unix_s, &day) == NULL) return;
    le_put16(to, (uint16_t)(day.tm_yday + 1));
    le_put16(to + 2, (uint16_t)(day.tm_year + 1900));
}

static void put_header(uint8_t *to, const struct las_facts *f, size_t front_len, uint32_t n_vlrs)
{
    memset(to, 0, LAS_HEADER_LEN);
    memcpy(to, "LASF", 4);
    le_put16(to + 6, (uint16_t)(ENCODING_WKT | (f->gps_time ? ENCODING_GPS_STANDARD : 0)));
    to[24] = 1;
    to[25] = 4;
    put_text(to + 26, 32, f->profile);
    put_text(to + 58, 32, "scanhead");
    put_date(to + 90, f);
    le_put16(to + 94, LAS_HEADER_LEN);
    le_put32(to + 96, (uint32_t)front_len);
    le_put32(to + 100, n_vlrs);
    to[104] = 6;
    le_put16(to + 105, f->track->has_attributes ? LAS_POINT_LEN_MAX : LAS_POINT_LEN);
    /* the counts of 32 bits stay 0, as format 6 wants it */
    for (int i = 0; i < 3; i++) {
        le_put_double(to + 131 + 8 * i, f->scale[i]);
        le_put_double(to + 155 + 8 * i, f->offset[i]);
        if (f->n_points == 0) continue;
        le_put_double(to + 179 + 16 * i, f->max[i] * f->scale[i] + f->offset[i]);
        le_put_double(to + 187 + 16 * i, f->min[i] * f->scale[i] + f->offset[i]);
    }
    le_put64(to + 247, f->n_points);
    for (int i = 0; i < LAS_RETURNS; i++)
        le_put64(to + 255 + 8 * i, f->n_by_return[i]);
}

size_t las_front(const struct las_facts *f, uint8_t to[LAS_FRONT_MAX])
{
    uint8_t *end = put_extra_vlr(to + LAS_HEADER_LEN, f->track->has_attributes);
    end = put_note_vlr(end, f->gps_time, f->track->moving);
    uint8_t *crs = end;
    end = put_crs_vlr(end, f->track->epsg, f->track->geoid_heights);
    put_header(to, f, (size_t)(end - to), end > crs ? 3 : 2);
    return (size_t)(end - to);
}
