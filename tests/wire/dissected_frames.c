/* SPDX-License-Identifier: MIT */
#include "tests/wire/dissected_frames.h"
#include "tests/wire/dissected_waves.h"

#include "drivers/protocol/native.h"

static int64_t points_t0_ns; /* of the last points frame, since the scan's start */

static void expect_header(const uint8_t *frame)
{
    struct native_header h;
    native_read_header(frame, &h);
    expect_uint(S "type", h.type);
    expect_uint(S "version", h.version);
    expect_uint(S "flags", h.flags);
    expect_uint(S "flags.repeat", h.flags & 1), expect_uint(S "flags.local", h.flags >> 1 & 1);
    expect_uint(S "length", h.length);
    expect_uint(S "seq", h.seq);
    expect_uint(S "payload_crc", h.payload_crc);
    expect_uint(S "payload_crc.status", 1);
    expect_ns(S "t_s", h.t_ns);
    expect_uint(S "header_crc", le_get32(frame + 24));
    expect_uint(S "header_crc.status", 1);
}

#define UINT(prefix, member) expect_uint(S prefix "." #member, v.member)
#define INT(prefix, member)  expect_int(S prefix "." #member, v.member)
#define REAL(prefix, member) expect_real(S prefix "." #member, v.member, 0)
#define DEG(member)          expect_real(S "descriptor." #member "_deg", (double)v.member##_udeg / 1e6, 0)
static void expect_descriptor(const struct scanhead_frame *f)
{
    struct native_descriptor v;
    assert_int_equal(native_decode_descriptor(f->payload, f->payload_len, &v), 0);
    expect_text(S "descriptor.idn", v.idn);
    expect_text(S "descriptor.profile", v.profile);
    UINT("descriptor", layout), UINT("descriptor", isa);
    expect_real(S "descriptor.prr_hz", (double)v.prr_uhz / 1e6, 0);
    expect_real(S "descriptor.lines_hz", (double)v.lines_uhz / 1e6, 0);
    expect_real(S "descriptor.pan_deg_s", (double)v.pan_udeg_s / 1e6, 0);
    DEG(fov_min), DEG(sweep), DEG(line_start), DEG(line_stop), DEG(pan_start), DEG(pan_stop);
    REAL("descriptor", mirror_counts_per_turn), REAL("descriptor", pan_counts_per_turn);
    REAL("descriptor", range_scale_m), REAL("descriptor", range_min_m), REAL("descriptor", range_max_m);
    UINT("descriptor", max_echoes), UINT("descriptor", n_surfaces), UINT("descriptor", frames);
    UINT("descriptor", scan), UINT("descriptor", seed);
    if (f->payload_len < 280) return;
    UINT("descriptor", content), UINT("descriptor", reserved);
    expect_uint(S "descriptor.content.attributes", v.content & 1);
    expect_uint(S "descriptor.content.colours", v.content >> 1 & 1);
    expect_uint(S "descriptor.content.waveforms", v.content >> 2 & 1);
    expect_uint(S "descriptor.content.deviations", v.content >> 3 & 1);
}

static void expect_anchor(const struct scanhead_frame *f)
{
    struct native_anchor v;
    assert_int_equal(native_decode_anchor(f->payload, f->payload_len, &v), 0);
    UINT("anchor", crs), UINT("anchor", epsg), UINT("anchor", station), UINT("anchor", moving);
    for (int i = 0; i < 3; i++) {
        static const char *const at[] = {S "anchor.x", S "anchor.y", S "anchor.z"};
        static const char *const station[] = {S "anchor.station_x_m", S "anchor.station_y_m", S "anchor.station_z_m"};
        expect_real(at[i], v.anchor[i], 0);
        expect_real(station[i], v.station_m[i], 0);
        expect_real(S "anchor.scale", v.scale[i], 0);
    }
    REAL("anchor", scale_m), REAL("anchor", lat_deg), REAL("anchor", lon_deg), REAL("anchor", height_m);
    for (int i = 0; i < 9; i++) {
        expect_real(S "anchor.rotation", v.rotation[i], 0);
        expect_real(S "anchor.axes", v.axes[i], 0);
    }
    UINT("anchor", heights);
    expect_ns(S "anchor.until_s", 1000000 * (int64_t)v.until_ms);
    REAL("anchor", frame);
}

/* The sine and cosine of angles come from another library here. The angle is below 7 rad and was rounded three times or
 * less: 3 x 7 x 2^-53 < 3e-15, or 2e-13 in degrees. libscanhead's sine and cosine are as exact.
 * In geodetic coordinates a range is a difference of numbers of 6.4e6 m, which have steps of 1e-9 m. */
static void expect_point(const struct scanhead_info *info, const struct scanhead_point *p)
{
    const double of_angle = 1e-14, deg = 180 / 3.14159265358979323846;
    expect_ns(S "point.t_s", p->t_ns);
    expect_uint(S "point.echo", p->echo);
    expect_uint(S "point.echo_count", p->echo_count);
    expect_uint(S "point.label", p->label);
    if (!isnan(p->reflectance_db)) expect_real(S "point.reflectance_db", p->reflectance_db, 0);
    if (!info->geo) {
        expect_real(S "point.line_deg", p->mirror_rad * deg, deg * of_angle);
        expect_real(S "point.pan_deg", p->pan_rad * deg, deg * of_angle);
    }
    if (!isnan(p->range_m)) expect_real(S "point.range_m", p->range_m, info->crs == 3 ? 1e-8 : 0);
    if (isnan(p->x)) return;
    const double error = info->geo ? 0 : of_angle * p->range_m;
    expect_real(S "point.x", p->x, error);
    expect_real(S "point.y", p->y, error);
    expect_real(S "point.z", p->z, error);
}

static void expect_points(struct scanhead *sh, const struct scanhead_frame *f)
{
    static struct scanhead_point point[NATIVE_MAX_POINTS];
    struct scanhead_info info;
    uint64_t pulse = f->pulse0 - 1;
    points_t0_ns = f->scan_t0_ns;
    expect_uint(S "points.frame", f->scan_frame);
    expect_uint(S "points.line", f->scan_line);
    expect_uint(S "points.pulse0", f->pulse0);
    expect_ns(S "points.t0_s", f->scan_t0_ns);
    expect_ns(S "points.line_t0_s", f->line_t0_ns);
    expect_uint(S "points.n_pulses", f->n_pulses);
    expect_uint(S "points.n_points", f->n_points);
    assert_int_equal(scanhead_get_info(sh, &info), 0);
    assert_int_equal(scanhead_points(sh, f, 0, point, NATIVE_MAX_POINTS), f->n_points);
    for (uint32_t i = 0; i < f->n_points; i++) {
        pulse += point[i].echo < 2;
        expect_uint(S "point.pulse", pulse);
        expect_point(&info, &point[i]);
    }
}

static void expect_line_end(struct scanhead *sh, const struct scanhead_frame *f)
{
    struct scanhead_line_end v;
    assert_int_equal(scanhead_line_end(sh, f, &v), 0);
    expect_uint(S "line_end.frame", v.scan_frame);
    expect_uint(S "line_end.line", v.scan_line);
    UINT("line_end", pulse0);
    expect_ns(S "line_end.t0_s", v.t0_ns);
    expect_ns(S "line_end.t1_s", v.t1_ns);
    UINT("line_end", n_fired), UINT("line_end", n_cast), UINT("line_end", n_echoes), UINT("line_end", mirror_count);
    UINT("line_end", pan_count), UINT("line_end", status), UINT("line_end", n_crowded), UINT("line_end", n_faint);
    UINT("line_end", n_unfit);
}

static void expect_telemetry(const struct scanhead_frame *f)
{
    struct native_telemetry v;
    struct tm utc = {0};
    int ns = 0, used = 0;
    assert_int_equal(native_decode_telemetry(f->payload, f->payload_len, &v), 0);
    UINT("telemetry", state), UINT("telemetry", scan), UINT("telemetry", pulses), UINT("telemetry", echoes);
    UINT("telemetry", lines), UINT("telemetry", lost_pulses), UINT("telemetry", late_blocks);
    UINT("telemetry", late_max_us), UINT("telemetry", errors_queued), UINT("telemetry", reader_lost_frames);
    UINT("telemetry", scan_fired), UINT("telemetry", scan_cast), UINT("telemetry", scan_lost);
    if (v.ptp_port != NATIVE_PTP_NONE) {
        UINT("telemetry", ptp_port), UINT("telemetry", ptp_servo), UINT("telemetry", ptp_grandmaster);
        UINT("telemetry", ptp_class), UINT("telemetry", ptp_accuracy), UINT("telemetry", ptp_flags);
        UINT("telemetry", ptp_reserved), INT("telemetry", ptp_offset_ns), INT("telemetry", ptp_delay_ns);
    }
    const char *text = take_text(S "telemetry.utc"), *rest = strptime(text, "%b %d, %Y %H:%M:%S", &utc);
    if (rest == NULL) rest = strptime(text, "%Y-%m-%dT%H:%M:%S", &utc); /* as later versions write it */
    assert_non_null(rest);
    assert_int_equal(sscanf(rest, ".%9d%n", &ns, &used), 1);
    assert_int_equal(timegm(&utc) * 1000000000LL + ns, v.utc_ns);
}

static void expect_event(const struct scanhead_frame *f)
{
    expect_uint(S "event.code", f->event);
    expect_uint(S "event.a", f->event_value[0]);
    expect_uint(S "event.b", f->event_value[1]);
    expect_uint(S "event.c", f->event_value[2]);
    if (f->event_text[0] != 0) expect_text(S "event.text", f->event_text);
}

static void expect_name(void *ctx, uint32_t label, const char *object, const char *material)
{
    (void)ctx;
    expect_uint(S "surface.label", label);
    expect_text(S "surface.object", object);
    expect_text(S "surface.material", material);
}

static void expect_poses(struct scanhead *sh, const struct scanhead_frame *f)
{
    static struct scanhead_pose pose[NATIVE_MAX_POSES];
    const int n = scanhead_poses(sh, f, 0, pose, NATIVE_MAX_POSES);
    expect_int(S "poses.n", n);
    for (int i = 0; i < n; i++) {
        static const char *const at[] = {S "pose.x_m", S "pose.y_m", S "pose.z_m"};
        static const char *const q[] = {S "pose.qw", S "pose.qx", S "pose.qy", S "pose.qz"};
        expect_ns(S "pose.t_s", pose[i].t_ns);
        for (int k = 0; k < 3; k++)
            expect_real(at[k], pose[i].position_m[k], 0);
        for (int k = 0; k < 4; k++)
            expect_real(q[k], pose[i].quat[k], 0);
        expect_real(S "pose.frame", pose[i].frame, 0);
        expect_int(S "pose.flags", pose[i].flags);
    }
}

static void expect_attributes(struct scanhead *sh, const struct scanhead_frame *f)
{
    static struct scanhead_attribute attribute[NATIVE_MAX_POINTS];
    static double deviation[NATIVE_MAX_POINTS];
    const int deviates = scanhead_has_deviations(sh) == 1;
    expect_uint(S "attributes.pulse0", f->pulse0);
    expect_uint(S "attributes.line", f->scan_line);
    expect_uint(S "attributes.n_points", f->n_points);
    take_text(S "points_in");
    assert_int_equal(scanhead_attributes(sh, f, 0, attribute, NATIVE_MAX_POINTS), f->n_points);
    if (deviates) assert_int_equal(scanhead_deviations(sh, f, 0, deviation, NATIVE_MAX_POINTS), f->n_points);
    for (uint32_t i = 0; i < f->n_points; i++) {
        const struct scanhead_attribute *a = &attribute[i];
        if (!isnan(a->amplitude_db)) expect_real(S "attribute.amplitude_db", a->amplitude_db, 0);
        if (!isnan(a->width_ns)) expect_real(S "attribute.width_ns", a->width_ns, 0);
        if (deviates) expect_real(S "attribute.deviation", deviation[i], 0);
    }
}

static void expect_colours(struct scanhead *sh, const struct scanhead_frame *f)
{
    static struct scanhead_colour colour[NATIVE_MAX_POINTS];
    expect_uint(S "colours.pulse0", f->pulse0);
    expect_uint(S "colours.line", f->scan_line);
    expect_uint(S "colours.n_points", f->n_points);
    take_text(S "points_in");
    assert_int_equal(scanhead_colours(sh, f, 0, colour, NATIVE_MAX_POINTS), f->n_points);
    for (uint32_t i = 0; i < f->n_points; i++) {
        expect_uint(S "colour.red", colour[i].red);
        expect_uint(S "colour.green", colour[i].green);
        expect_uint(S "colour.blue", colour[i].blue);
    }
}

static void expect_emitter(struct scanhead *sh, const struct scanhead_frame *f)
{
    struct native_emitter v;
    struct scanhead_emitter e;
    assert_int_equal(native_decode_emitter(f->payload, f->payload_len, &v), 0);
    assert_int_equal(scanhead_get_emitter(sh, &e), 0);
    UINT("emitter", kind), UINT("emitter", n_beams), UINT("emitter", steps), UINT("emitter", rings);
    UINT("emitter", echoes), UINT("emitter", gaps);
    INT("emitter", first_step), INT("emitter", last_step), INT("emitter", front_step), INT("emitter", turn);
    expect_uint(S "emitter.sequence_num", v.sequence_ns_num);
    expect_uint(S "emitter.sequence_den", v.sequence_ns_den);
    expect_real(S "emitter.first_ring_deg", (double)v.first_ring_udeg / 1e6, 0);
    for (uint32_t i = 0; i < e.n_beams; i++) {
        expect_real(S "beam.elevation_deg", e.beam[i].elevation_deg, 0);
        expect_real(S "beam.azimuth_deg", e.beam[i].azimuth_deg, 0);
        expect_uint(S "beam.offset_ns", e.beam[i].offset_ns);
    }
}

static void expect_frame(struct scanhead *sh, const struct scanhead_frame *f)
{
    expect_header(f->raw);
    if (f->type == SCANHEAD_DESCRIPTOR) expect_descriptor(f);
    if (f->type == SCANHEAD_ANCHOR) expect_anchor(f);
    if (f->type == SCANHEAD_POINTS) expect_points(sh, f);
    if (f->type == SCANHEAD_LINE_END) expect_line_end(sh, f);
    if (f->type == SCANHEAD_TELEMETRY) expect_telemetry(f);
    if (f->type == SCANHEAD_EVENT) expect_event(f);
    if (f->type == SCANHEAD_POSES) expect_poses(sh, f);
    if (f->type == SCANHEAD_ATTRIBUTES) expect_attributes(sh, f);
    if (f->type == SCANHEAD_COLOURS) expect_colours(sh, f);
    if (f->type == SCANHEAD_EMITTER) expect_emitter(sh, f);
    if (f->type == SCANHEAD_WAVES) expect_waves(sh, f, points_t0_ns);
    if (f->type != SCANHEAD_SURFACES) return;
    expect_uint(S "surfaces.first", le_get32(f->payload));
    expect_uint(S "surfaces.count", le_get32(f->payload + 4));
    assert_int_equal(native_decode_surfaces(f->payload, f->payload_len, expect_name, NULL), 0);
}

unsigned expect_stream(const char *name)
{
    unsigned types = 0;
    struct scanhead_frame frame;
    struct scanhead *sh = client_open(wire_path(wire, name));
    int rc;
    while ((rc = scanhead_next(sh, &frame, 0)) == 0) {
        types |= 1u << frame.type;
        expect_frame(sh, &frame);
    }
    assert_int_equal(rc, SCANHEAD_ECLOSED);
    scanhead_close(sh);
    return types;
}
