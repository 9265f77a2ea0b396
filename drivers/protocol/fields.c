/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/fields.h"

#include <math.h>
#include <string.h>

#include "core/bytes.h"
#include "core/err.h"
#include "drivers/protocol/native_waves.h"

#define UNIT_FIELD_8     1
#define UNIT_FIELD_16    2
#define UNIT_FIELD_32    4
#define UNIT_FIELD_64    8
#define UNIT_FIELD_FLOAT 4
#define UNIT_FIELD_REAL  8
#define UNIT_FIELD_TEXT  1
#define ROW(type, member, kind)                                                                            \
    {                                                                                                      \
        offsetof(struct type, member), kind, sizeof(((struct type *)0)->member) / UNIT_##kind, UNIT_##kind \
    }
#define TABLE(rows, type, wire, frame) PART(rows, 0, type, wire, frame)
/* A table without its last `less` rows. */
#define PART(rows, less, type, wire, frame)                                             \
    {                                                                                   \
        rows, sizeof(rows) / sizeof(rows)[0] - (less), wire, sizeof(struct type), frame \
    }

#define DESC(member, kind) ROW(native_descriptor, member, kind)
static const struct field descriptor[] = {
    DESC(idn, FIELD_TEXT),
    DESC(profile, FIELD_TEXT),
    DESC(layout, FIELD_32),
    DESC(isa, FIELD_32),
    DESC(prr_uhz, FIELD_64),
    DESC(lines_uhz, FIELD_64),
    DESC(pan_udeg_s, FIELD_64),
    DESC(fov_min_udeg, FIELD_64),
    DESC(sweep_udeg, FIELD_64),
    DESC(line_start_udeg, FIELD_64),
    DESC(line_stop_udeg, FIELD_64),
    DESC(pan_start_udeg, FIELD_64),
    DESC(pan_stop_udeg, FIELD_64),
    DESC(mirror_counts_per_turn, FIELD_REAL),
    DESC(pan_counts_per_turn, FIELD_REAL),
    DESC(range_scale_m, FIELD_REAL),
    DESC(range_min_m, FIELD_REAL),
    DESC(range_max_m, FIELD_REAL),
    DESC(max_echoes, FIELD_32),
    DESC(n_surfaces, FIELD_32),
    DESC(frames, FIELD_32),
    DESC(scan, FIELD_32),
    DESC(seed, FIELD_64),
    DESC(content, FIELD_32),
    DESC(reserved, FIELD_32),
};

#define ANCHOR(member, kind) ROW(native_anchor, member, kind)
static const struct field anchor[] = {
    ANCHOR(crs, FIELD_32),         ANCHOR(epsg, FIELD_32),       ANCHOR(station, FIELD_32),
    ANCHOR(moving, FIELD_32),      ANCHOR(anchor, FIELD_REAL),   ANCHOR(scale_m, FIELD_REAL),
    ANCHOR(lat_deg, FIELD_REAL),   ANCHOR(lon_deg, FIELD_REAL),  ANCHOR(height_m, FIELD_REAL),
    ANCHOR(station_m, FIELD_REAL), ANCHOR(rotation, FIELD_REAL), ANCHOR(scale, FIELD_REAL),
    ANCHOR(heights, FIELD_32),     ANCHOR(until_ms, FIELD_32),   ANCHOR(axes, FIELD_REAL),
    ANCHOR(frame, FIELD_REAL),
};

#define EMITTER(member, kind) ROW(native_emitter, member, kind)
static const struct field emitter[] = {
    EMITTER(kind, FIELD_32),
    EMITTER(n_beams, FIELD_32),
    EMITTER(steps, FIELD_32),
    EMITTER(first_step, FIELD_32),
    EMITTER(last_step, FIELD_32),
    EMITTER(front_step, FIELD_32),
    EMITTER(turn, FIELD_32),
    EMITTER(rings, FIELD_32),
    EMITTER(sequence_ns_num, FIELD_64),
    EMITTER(sequence_ns_den, FIELD_64),
    EMITTER(first_ring_udeg, FIELD_64),
    EMITTER(echoes, FIELD_32),
    EMITTER(gaps, FIELD_32),
};

#define POINTS(member, kind) ROW(native_points, member, kind)
static const struct field points[] = {
    POINTS(frame, FIELD_32),      POINTS(line, FIELD_32),     POINTS(pulse0, FIELD_64),   POINTS(t0_ns, FIELD_64),
    POINTS(line_t0_ns, FIELD_64), POINTS(n_pulses, FIELD_32), POINTS(n_points, FIELD_32),
};

#define ATTRIBUTES(member, kind) ROW(native_attributes, member, kind)
static const struct field attributes[] = {
    ATTRIBUTES(pulse0, FIELD_64),
    ATTRIBUTES(line, FIELD_32),
    ATTRIBUTES(n_points, FIELD_32),
};

#define WAVES(member, kind) ROW(native_waves, member, kind)
static const struct field waves[] = {
    WAVES(pulse0, FIELD_64),      WAVES(line, FIELD_32), WAVES(n_windows, FIELD_32), WAVES(sample_ps, FIELD_32),
    WAVES(baseline_16, FIELD_16), WAVES(bits, FIELD_8),  WAVES(reserved, FIELD_8),   WAVES(count_signal, FIELD_FLOAT),
    WAVES(n_lost, FIELD_32),
};

#define END(member, kind) ROW(line_end, member, kind)
static const struct field line_end[] = {
    END(frame, FIELD_32),        END(line, FIELD_32),      END(pulse0, FIELD_64), END(t0_ns, FIELD_64),
    END(t1_ns, FIELD_64),        END(n_fired, FIELD_32),   END(n_cast, FIELD_32), END(n_echoes, FIELD_32),
    END(mirror_count, FIELD_32), END(pan_count, FIELD_32), END(status, FIELD_32), END(n_crowded, FIELD_32),
    END(n_faint, FIELD_32),      END(n_unfit, FIELD_32),
};

#define TELE(member, kind) ROW(native_telemetry, member, kind)
static const struct field telemetry[] = {
    TELE(state, FIELD_32),         TELE(scan, FIELD_32),
    TELE(pulses, FIELD_64),        TELE(echoes, FIELD_64),
    TELE(lines, FIELD_64),         TELE(lost_pulses, FIELD_64),
    TELE(late_blocks, FIELD_64),   TELE(late_max_us, FIELD_32),
    TELE(errors_queued, FIELD_32), TELE(reader_lost_frames, FIELD_64),
    TELE(utc_ns, FIELD_64),        TELE(scan_fired, FIELD_64),
    TELE(scan_cast, FIELD_64),     TELE(scan_lost, FIELD_64),
    TELE(lost_lines, FIELD_64),    TELE(ptp_port, FIELD_32),
    TELE(ptp_servo, FIELD_32),     TELE(ptp_offset_ns, FIELD_64),
    TELE(ptp_delay_ns, FIELD_64),  TELE(ptp_grandmaster, FIELD_64),
    TELE(ptp_class, FIELD_32),     TELE(ptp_accuracy, FIELD_32),
    TELE(ptp_flags, FIELD_32),     TELE(ptp_reserved, FIELD_32),
};
enum { N_PTP_FIELDS = 9 };

#define EVENT(member, kind) ROW(native_event, member, kind)
static const struct field event[] = {
    EVENT(code, FIELD_32), EVENT(reserved, FIELD_32), EVENT(a, FIELD_64),
    EVENT(b, FIELD_64),    EVENT(c, FIELD_64),        EVENT(text, FIELD_TEXT),
};

#define POSE(member, kind) ROW(native_pose, member, kind)
static const struct field pose[] = {
    POSE(t_ns, FIELD_64),    POSE(position_m, FIELD_REAL), POSE(quat, FIELD_REAL),
    POSE(frame, FIELD_REAL), POSE(flags, FIELD_32),        POSE(reserved, FIELD_32),
};

enum { N_CONTENT_FIELDS = 2 };
const struct field_table fields_descriptor =
    PART(descriptor, N_CONTENT_FIELDS, native_descriptor, 272, NATIVE_DESCRIPTOR);
const struct field_table fields_descriptor_content = TABLE(descriptor, native_descriptor, 280, NATIVE_DESCRIPTOR);
const struct field_table fields_anchor = TABLE(anchor, native_anchor, 280, NATIVE_ANCHOR);
const struct field_table fields_emitter = TABLE(emitter, native_emitter, NATIVE_EMITTER_HEAD_LEN, NATIVE_EMITTER);
const struct field_table fields_points = TABLE(points, native_points, NATIVE_POINTS_HEAD_LEN, NATIVE_POINTS);
const struct field_table fields_attributes =
    TABLE(attributes, native_attributes, NATIVE_ATTRIBUTES_HEAD_LEN, NATIVE_ATTRIBUTES);
const struct field_table fields_waves = TABLE(waves, native_waves, NATIVE_WAVES_HEAD_LEN, NATIVE_WAVES);
const struct field_table fields_line_end = TABLE(line_end, line_end, 68, NATIVE_LINE_END);
const struct field_table fields_telemetry = PART(telemetry, N_PTP_FIELDS + 1, native_telemetry, 96, NATIVE_TELEMETRY);
const struct field_table fields_telemetry_lines =
    PART(telemetry, N_PTP_FIELDS, native_telemetry, 104, NATIVE_TELEMETRY);
const struct field_table fields_telemetry_ptp = TABLE(telemetry, native_telemetry, 152, NATIVE_TELEMETRY);
const struct field_table fields_event = TABLE(event, native_event, 128, NATIVE_EVENT);
const struct field_table fields_pose = TABLE(pose, native_pose, NATIVE_POSE_LEN, NATIVE_POSES);

/* Turns a number of 1, 2, 4 or 8 bytes between the machine's order and the wire's; both ways are the same. */
static void fields_turn(void *to, const void *from, size_t unit)
{
    if (unit == 1) {
        memcpy(to, from, 1);
    } else if (unit == 2) {
        uint16_t v = le_get16(from);
        memcpy(to, &v, sizeof v);
    } else if (unit == 4) {
        uint32_t v = le_get32(from);
        memcpy(to, &v, sizeof v);
    } else {
        uint64_t v = le_get64(from);
        memcpy(to, &v, sizeof v);
    }
}

static size_t encode_field(const struct field *field, const char *from, uint8_t *wire)
{
    if (field->kind == FIELD_TEXT) {
        /* The rest is zeroed here: what follows the NUL in the struct must not reach the wire. */
        size_t len = strnlen(from, field->count - 1u);
        memcpy(wire, from, len);
        memset(wire + len, 0, field->count - len);
        return field->count;
    }
    const size_t unit = field->unit;
    for (size_t i = 0; i < field->count; i++)
        fields_turn(wire + i * unit, from + i * unit, unit);
    return unit * field->count;
}

static int is_finite(const struct field *field, const char *value)
{
    double real = 0;
    float small = 0;
    if (field->kind == FIELD_REAL) memcpy(&real, value, sizeof real);
    if (field->kind == FIELD_FLOAT) memcpy(&small, value, sizeof small);
    return isfinite(real) && isfinite(small);
}

static int decode_field(const struct field *field, const uint8_t *wire, char *to)
{
    if (field->kind == FIELD_TEXT) {
        size_t len = strnlen((const char *)wire, field->count);
        if (len == field->count) return SH_EFORMAT;
        memcpy(to, wire, len);
        return field->count;
    }
    const size_t unit = field->unit;
    for (size_t i = 0; i < field->count; i++) {
        fields_turn(to + i * unit, wire + i * unit, unit);
        if (!is_finite(field, to + i * unit)) return SH_EFORMAT;
    }
    return (int)unit * field->count;
}

void fields_encode(const struct field_table *table, const void *from, uint8_t *wire)
{
    for (size_t i = 0; i < table->n_fields; i++)
        wire += encode_field(&table->field[i], (const char *)from + table->field[i].offset, wire);
}

int fields_decode(const struct field_table *table, const uint8_t *wire, size_t len, void *to)
{
    if (len < table->wire_len) return SH_EFORMAT;
    memset(to, 0, table->struct_len);
    for (size_t i = 0; i < table->n_fields; i++) {
        int n = decode_field(&table->field[i], wire, (char *)to + table->field[i].offset);
        if (n < 0) return n;
        wire += n;
    }
    return 0;
}
