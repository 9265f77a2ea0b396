/* SPDX-License-Identifier: MIT */
#include <string.h>

#include "core/bytes.h"
#include "core/err.h"
#include "drivers/protocol/fields.h"
#include "drivers/protocol/native_waves.h"

int native_decode_descriptor(const uint8_t *payload, size_t len, struct native_descriptor *out)
{
    const int has_content = len >= fields_descriptor_content.wire_len;
    int rc = fields_decode(has_content ? &fields_descriptor_content : &fields_descriptor, payload, len, out);
    if (rc == 0 && out->layout != NATIVE_POLAR && out->layout != NATIVE_GEO) rc = SH_EFORMAT;
    return rc;
}

int native_decode_anchor(const uint8_t *payload, size_t len, struct native_anchor *out)
{
    int rc = fields_decode(&fields_anchor, payload, len, out);
    if (rc != 0) return rc;
    for (int i = 0; i < 3; i++)
        if (out->scale[i] == 0) out->scale[i] = out->scale_m;
    int turned = 0;
    for (int i = 0; i < 9; i++)
        turned |= out->axes[i] != 0;
    for (int i = 0; i < 3 && !turned; i++)
        out->axes[4 * i] = 1;
    if (out->crs > NATIVE_CRS_GEODETIC || out->heights > NATIVE_HEIGHTS_GEOID) return SH_EFORMAT;
    return 0;
}

int native_decode_emitter(const uint8_t *payload, size_t len, struct native_emitter *out)
{
    int rc = fields_decode(&fields_emitter, payload, len, out);
    if (rc != 0) return rc;
    if (out->kind > NATIVE_EMIT_DIRECTIONS || out->sequence_ns_den == 0 || (out->turn != 1 && out->turn != -1))
        return SH_EFORMAT;
    if (out->n_beams > NATIVE_MAX_BEAMS || out->n_beams > (len - NATIVE_EMITTER_HEAD_LEN) / NATIVE_BEAM_LEN)
        return SH_EFORMAT;
    return 0;
}

void native_decode_beam(const uint8_t *payload, uint32_t i, struct native_beam *out)
{
    const uint8_t *p = payload + NATIVE_EMITTER_HEAD_LEN + (size_t)i * NATIVE_BEAM_LEN;
    out->elevation_udeg = (int32_t)le_get32(p);
    out->azimuth_udeg = (int32_t)le_get32(p + 4);
    out->offset_ns = le_get32(p + 8);
}

int native_decode_points(const uint8_t *payload, size_t len, struct native_points *out)
{
    const int rc = fields_decode(&fields_points, payload, len, out);
    return rc == 0 && out->n_points > (len - NATIVE_POINTS_HEAD_LEN) / NATIVE_POINT_LEN ? SH_EFORMAT : rc;
}

/* The loop has no branches, and one load per point: some readers only count points, millions a second. */
void native_count_points(const uint8_t *payload, uint32_t n, uint32_t *n_empty, uint32_t *n_reflectances)
{
    const uint8_t *p = payload + NATIVE_POINTS_HEAD_LEN + 12;
    uint32_t empty = 0, without = 0;
    for (uint32_t i = 0; i < n; i++, p += NATIVE_POINT_LEN) {
        const uint64_t bits = le_get64(p); /* reflectance first, number of echoes last */
        const uint32_t is_empty = bits >> 60 == 0;
        empty += is_empty;
        without += is_empty | ((int16_t)bits == LINE_REFL_NONE);
    }
    *n_empty = empty;
    *n_reflectances = n - without;
}

/* Attributes and colours begin alike. each: the bytes of a record. */
static int decode_of_points(const uint8_t *payload, size_t len, size_t each, struct native_attributes *out)
{
    const int rc = fields_decode(&fields_attributes, payload, len, out);
    return rc == 0 && out->n_points > (len - NATIVE_ATTRIBUTES_HEAD_LEN) / each ? SH_EFORMAT : rc;
}

int native_decode_attributes(const uint8_t *payload, size_t len, struct native_attributes *out)
{
    return decode_of_points(payload, len, NATIVE_ATTRIBUTE_LEN, out);
}

int native_decode_colours(const uint8_t *payload, size_t len, struct native_attributes *out)
{
    return decode_of_points(payload, len, NATIVE_COLOUR_LEN, out);
}

int native_check_deviations(size_t len, uint32_t n_points)
{
    const size_t each = NATIVE_ATTRIBUTE_LEN + NATIVE_DEVIATION_LEN;
    return len >= NATIVE_ATTRIBUTES_HEAD_LEN + (size_t)n_points * each ? 0 : SH_EFORMAT;
}

int native_decode_waves(const uint8_t *payload, size_t len, struct native_waves *out)
{
    size_t at = NATIVE_WAVES_HEAD_LEN;
    int rc = fields_decode(&fields_waves, payload, len, out);
    if (rc != 0) return rc;
    if (out->sample_ps == 0 || out->bits < NATIVE_MIN_BITS || out->bits > NATIVE_MAX_BITS || !(out->count_signal > 0))
        return SH_EFORMAT;
    for (uint32_t i = 0; i < out->n_windows; i++) {
        if (len - at < NATIVE_WAVE_LEN) return SH_EFORMAT;
        const uint32_t n = le_get16(payload + at + 12);
        const size_t window_len = native_wave_len(n);
        if (n == 0 || n > NATIVE_MAX_SAMPLES || len - at < window_len) return SH_EFORMAT;
        at += window_len;
    }
    return 0;
}

int native_decode_line_end(const uint8_t *payload, size_t len, struct line_end *out)
{
    return fields_decode(&fields_line_end, payload, len, out);
}

int native_decode_telemetry(const uint8_t *payload, size_t len, struct native_telemetry *out)
{
    const struct field_table *table = len >= fields_telemetry_ptp.wire_len     ? &fields_telemetry_ptp
                                      : len >= fields_telemetry_lines.wire_len ? &fields_telemetry_lines
                                                                               : &fields_telemetry;
    return fields_decode(table, payload, len, out);
}

int native_decode_event(const uint8_t *payload, size_t len, struct native_event *out)
{
    return fields_decode(&fields_event, payload, len, out);
}

int native_decode_poses(const uint8_t *payload, size_t len, uint32_t *n)
{
    if (len < NATIVE_POSES_HEAD_LEN) return SH_EFORMAT;
    *n = le_get32(payload);
    if (*n < 2 || *n > (len - NATIVE_POSES_HEAD_LEN) / NATIVE_POSE_LEN) return SH_EFORMAT;
    int64_t before_ns = 0;
    for (uint32_t i = 0; i < *n; i++) {
        struct native_pose pose;
        size_t at = NATIVE_POSES_HEAD_LEN + (size_t)i * NATIVE_POSE_LEN;
        if (fields_decode(&fields_pose, payload + at, len - at, &pose) != 0) return SH_EFORMAT;
        const double *q = pose.quat;
        double norm2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
        if (!(norm2 > 1.0 - 1e-9 && norm2 < 1.0 + 1e-9) || (i > 0 && pose.t_ns <= before_ns)) return SH_EFORMAT;
        before_ns = pose.t_ns;
    }
    return 0;
}

void native_decode_pose(const uint8_t *payload, uint32_t i, struct native_pose *out)
{
    fields_decode(&fields_pose, payload + NATIVE_POSES_HEAD_LEN + (size_t)i * NATIVE_POSE_LEN, NATIVE_POSE_LEN, out);
}

/* Copies the name at *at with a NUL, and moves *at to what follows it. */
static int take_name(const uint8_t *payload, size_t len, size_t *at, char name[256])
{
    if (*at >= len) return SH_EFORMAT;
    size_t n = payload[(*at)++];
    if (n > len - *at || memchr(payload + *at, 0, n) != NULL) return SH_EFORMAT;
    memcpy(name, payload + *at, n);
    name[n] = 0;
    *at += n;
    return 0;
}

int native_decode_surfaces(const uint8_t *payload, size_t len,
                           void (*fn)(void *ctx, uint32_t label, const char *object, const char *material), void *ctx)
{
    if (len < NATIVE_SURFACES_HEAD_LEN) return SH_EFORMAT;
    uint32_t first = le_get32(payload), count = le_get32(payload + 4);
    if (count > 0xffff || first > 0xffff - count) return SH_EFORMAT;
    /* The first pass only checks, so that a payload that is wrong somewhere has no effect at all. */
    for (int pass = 0; pass < 2; pass++) {
        size_t at = NATIVE_SURFACES_HEAD_LEN;
        for (uint32_t i = 0; i < count; i++) {
            char object[256], material[256];
            int rc = take_name(payload, len, &at, object);
            if (rc == 0) rc = take_name(payload, len, &at, material);
            if (rc != 0) return rc;
            if (pass == 1) fn(ctx, first + i, object, material);
        }
    }
    return 0;
}

void native_read_header(const uint8_t *frame, struct native_header *header)
{
    *header = (struct native_header){
        .type = frame[1],
        .version = frame[2],
        .flags = frame[3],
        .length = le_get32(frame + 4),
        .seq = le_get32(frame + 8),
        .payload_crc = le_get32(frame + 12),
        .t_ns = (int64_t)le_get64(frame + 16),
    };
}

int native_is_hashed(const struct native_header *header)
{
    if ((header->flags & (NATIVE_REPEAT | NATIVE_LOCAL)) != 0) return 0;
    return header->type == NATIVE_DESCRIPTOR || header->type == NATIVE_ANCHOR || header->type == NATIVE_POINTS ||
           header->type == NATIVE_LINE_END || header->type == NATIVE_POSES || header->type == NATIVE_ATTRIBUTES ||
           header->type == NATIVE_EMITTER || header->type == NATIVE_COLOURS || header->type == NATIVE_WAVES;
}
