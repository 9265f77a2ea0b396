/* The dissector in Wireshark beside libscanhead: frames of every kind over TCP, on USB and in captures of our own, value
 * by value; frames that were hurt; a stream with damage, in one pass and in two. */
#include "tests/wire/capture_rig.h"
#include "tests/wire/dissected.h"

#include "drivers/protocol/crc32c.h"
#include "drivers/protocol/native.h"

enum { EXPERT_CHAT = 2097152, EXPERT_NOTE = 4194304, EXPERT_WARN = 6291456, EXPERT_ERROR = 8388608 };
enum { N_HURT = 1000, LONG_POINTS = 3000, N_ROUNDS = 3 };

#define AT_BERLIN                                                                                       \
    " scene.anchor.source=explicit scene.anchor.lat_deg=52.3 scene.anchor.lon_deg=13.1"                 \
    " scene.anchor.height_m=80 scene.anchor.north_deg=17"
static const struct {
    const char *name, *keys;
    int moves;
} recording[] = {
    {"polar.shs", "output.attributes=on output.colour=height signal.model=on", 0},
    {"ride.shs", "output.attributes=off", 1},
    {"utm.shs", "output.layout=geo output.crs=utm" AT_BERLIN, 0},
    {"geodetic.shs", "output.layout=geo output.crs=geodetic" AT_BERLIN, 0},
};
enum { N_RECORDINGS = sizeof recording / sizeof recording[0] };
static const char *const stream_name[] = {"polar.shs", "ride.shs", "utm.shs", "geodetic.shs", "samples.shs", "long.shs"};
enum { N_STREAMS = sizeof stream_name / sizeof stream_name[0] };

/* ---- streams: recordings, the samples, and one frame of 3,000 points */

static void record_all(void)
{
    struct room_config still = {
        .prr_hz = 1000, .lines_hz = 50, .pan_deg_s = 100, .pan_stop_deg = 5, .frames = 1, .links = LINK_YAML_TCP};
    struct room_config ride = still;
    ride.more = "platform: {kind: trajectory, file: ride.csv}\n";
    pid_t pid[N_RECORDINGS];
    wire_write_text(wire, "ride.csv",
                    "t_s,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg\n0,0.1,-0.5,0,0,0,10\n0.05,0.3,-0.4,0,4,0,40\n"
                    "0.1,0.4,-0.2,0.1,4,-5,80\n0.2,0,0.2,0,0,0,10\n");
    ground_write(wire);
    for (int i = 0; i < N_RECORDINGS; i++) {
        char config[352], path[352], set[512], *rest = set, name[32];
        char *yaml = wire_read(room_config_write(wire, recording[i].moves ? &ride : &still), NULL);
        snprintf(name, sizeof name, "config%d.yaml", i);
        snprintf(config, sizeof config, "%s", wire_write_text(wire, name, yaml));
        free(yaml);
        snprintf(path, sizeof path, "%s", wire_path(wire, recording[i].name));
        snprintf(set, sizeof set, "%s", recording[i].keys);
        const char *args[32] = {"record", config, "-o", path, "--quiet"};
        for (int n = 5; (args[n + 1] = strtok_r(rest, " ", &rest)) != NULL; n += 2)
            args[n] = "--set";
        pid[i] = wire_spawn(wire, args, "head.out", "head.err", -1);
    }
    for (int i = 0; i < N_RECORDINGS; i++) {
        const int status = wire_wait(wire, pid[i]);
        if (status != 0) wire_show(wire, "head.err");
        assert_int_equal(status, 0);
    }
}

static void write_samples(void)
{
    char *page = wire_read("drivers/protocol/SAMPLES.md", NULL), *at = page;
    uint8_t bytes[8192];
    size_t len = 0;
    while ((at = strstr(at, "```text\nd5 ")) != NULL) {
        at += strlen("```text\n");
        for (unsigned byte; sscanf(at, "%2x", &byte) == 1; at += 3)
            bytes[len++] = (uint8_t)byte;
    }
    free(page);
    wire_write(wire, "samples.shs", bytes, len);
}

static void seal(uint8_t *frame)
{
    le_put32(frame + 12, crc32c(0, frame + NATIVE_HEADER_LEN, le_get32(frame + 4)));
    le_put32(frame + 24, crc32c(0, frame, 24));
}

/* The samples' descriptor and anchor, and then points of every value that a point may have; two of three have echoes. */
static void write_long(void)
{
    size_t len, at = 0;
    char *bytes = wire_read(wire_path(wire, "samples.shs"), &len);
    for (; bytes[at + 1] != NATIVE_POINTS; at += native_frame_len((uint8_t *)bytes + at))
        ;
    uint8_t *all = malloc(at + NATIVE_MAX_FRAME), *frame = all + at, *payload = frame + NATIVE_HEADER_LEN;
    assert_non_null(all);
    memcpy(all, bytes, at + NATIVE_HEADER_LEN + NATIVE_POINTS_HEAD_LEN);
    free(bytes);
    const uint32_t n_bytes = NATIVE_POINTS_HEAD_LEN + LONG_POINTS * NATIVE_POINT_LEN;
    uint64_t random = 7;
    for (uint32_t i = NATIVE_POINTS_HEAD_LEN; i < n_bytes; i++)
        payload[i] = (uint8_t)capture_random(&random, 256);
    for (uint32_t i = 0; i < LONG_POINTS; i++)
        payload[NATIVE_POINTS_HEAD_LEN + NATIVE_POINT_LEN * i + 19] = i % 3 == 2 ? 0 : 0x11;
    le_put32(frame + 4, n_bytes);
    le_put32(payload + 32, LONG_POINTS);
    le_put32(payload + 36, LONG_POINTS);
    seal(frame);
    wire_write(wire, "long.shs", all, at + native_frame_len(frame));
    free(all);
}

/* Each stream has sequence numbers of its own, so that they can follow each other: a jump forward between two. */
static void number_all(void)
{
    for (int i = 0; i < N_STREAMS; i++) {
        size_t len;
        char *bytes = wire_read(wire_path(wire, stream_name[i]), &len);
        for (size_t at = 0; at < len; at += native_frame_len((uint8_t *)bytes + at)) {
            uint8_t *frame = (uint8_t *)bytes + at;
            if ((frame[3] & NATIVE_LOCAL) == 0) le_put32(frame + 8, le_get32(frame + 8) + 100000u * (uint32_t)i);
            seal(frame);
        }
        wire_write(wire, stream_name[i], bytes, len);
        free(bytes);
    }
}

static int setup(void **state)
{
    const int rc = wire_setup(state);
    if (rc != 0) return rc;
    wire = *state;
    record_all();
    write_samples();
    write_long();
    number_all();
    return 0;
}

/* ---- a capture of all streams over all carriers */

static void put_tcp(struct capture *c, uint32_t interface, int number, const uint8_t *bytes, size_t len)
{
    struct capture_tcp tcp = {.head_port = (uint16_t)(41000 + number), .client_port = 40000};
    uint64_t random = (uint64_t)number;
    static const char early[] = "*IDN?\nHEAD:STATe?\r\n", answers[] = "scanhead,test,1,scanhead native 1\r\nidle\r\n";
    static const char late[] = "ERR -222,\"Data out of range\"\r\nid";
    capture_segment(c, interface, &tcp, 1, answers, 10); /* what it answers to is before the capture */
    capture_segment(c, interface, &tcp, 1, answers + 10, sizeof answers - 11);
    for (size_t at = 0, n; at < len; at += n) {
        n = 1 + capture_random(&random, 1460);
        if (n > len - at) n = len - at;
        capture_segment(c, interface, &tcp, 1, bytes + at, n);
    }
    capture_segment(c, interface, &tcp, 0, early, 8);
    capture_segment(c, interface, &tcp, 0, early + 8, sizeof early - 9);
    capture_segment(c, interface, &tcp, 1, late, sizeof late - 1);
    capture_segment(c, interface, &tcp, 1, "le\r\n", 4);
}

static void put_usb(struct capture *c, uint32_t interface, int number, const uint8_t *bytes, size_t len)
{
    uint64_t random = (uint64_t)number;
    const uint8_t device = (uint8_t)(3 + number);
    for (size_t at = 0, n; at < len; at += n) {
        n = 1 + capture_random(&random, 16384);
        if (at == 0) n = 512; /* the first transfer has a header, so that the stream is known */
        if (n > len - at) n = len - at;
        capture_transfer(c, interface, device, 0x83, bytes + at, n);
    }
    capture_transfer(c, interface, device, 0x03, "TIME?\n", 6);
    capture_transfer(c, interface, device, 0x83, "123456\r\n", 8);
}

static void put_user0(struct capture *c, uint32_t interface, const uint8_t *bytes, size_t len)
{
    for (size_t at = 0; at < len; at += native_frame_len(bytes + at))
        capture_packet(c, interface, bytes + at, native_frame_len(bytes + at));
}

/* The long one is on TCP alone: it takes as long as all others. */
static int n_streams(int carrier)
{
    return carrier == 0 ? N_STREAMS : N_STREAMS - 1;
}

static void write_clean(void)
{
    struct capture c = {0};
    capture_begin(&c);
    const uint32_t ethernet = capture_interface(&c, CAPTURE_ETHERNET), usb = capture_interface(&c, CAPTURE_USBMON);
    const uint32_t user0 = capture_interface(&c, CAPTURE_USER0);
    for (int carrier = 0; carrier < 3; carrier++)
        for (int i = 0; i < n_streams(carrier); i++) {
            size_t len;
            char *bytes = wire_read(wire_path(wire, stream_name[i]), &len);
            if (carrier == 0) put_tcp(&c, ethernet, i, (uint8_t *)bytes, len);
            if (carrier == 1) put_usb(&c, usb, i, (uint8_t *)bytes, len);
            if (carrier == 2) put_user0(&c, user0, (uint8_t *)bytes, len);
            free(bytes);
        }
    wire_write(wire, "clean.pcapng", c.bytes, c.len);
    free(c.bytes);
}

/* ---- each field of each type, as the columns of tshark and as libscanhead has it */

#define S "scanhead."
static const char *const all_fields[] = {
    "_ws.expert.severity", S "type", S "version", S "flags", S "flags.repeat", S "flags.local", S "length", S "seq",
    S "payload_crc", S "payload_crc.status", S "t_s", S "header_crc", S "header_crc.status", S "command", S "reply",
    S "reply.error", S "reply_in", S "command_in", S "bad_bytes", S "unknown", S "payload",
    S "descriptor.idn", S "descriptor.profile", S "descriptor.layout", S "descriptor.isa", S "descriptor.prr_hz",
    S "descriptor.lines_hz", S "descriptor.pan_deg_s", S "descriptor.fov_min_deg", S "descriptor.sweep_deg",
    S "descriptor.line_start_deg", S "descriptor.line_stop_deg", S "descriptor.pan_start_deg",
    S "descriptor.pan_stop_deg", S "descriptor.mirror_counts_per_turn", S "descriptor.pan_counts_per_turn",
    S "descriptor.range_scale_m", S "descriptor.range_min_m", S "descriptor.range_max_m", S "descriptor.max_echoes",
    S "descriptor.n_surfaces", S "descriptor.frames", S "descriptor.scan", S "descriptor.seed", S "descriptor.content",
    S "descriptor.content.attributes", S "descriptor.content.colours", S "descriptor.reserved",
    S "anchor.crs", S "anchor.epsg", S "anchor.station", S "anchor.moving", S "anchor.x", S "anchor.y", S "anchor.z",
    S "anchor.scale_m", S "anchor.lat_deg", S "anchor.lon_deg", S "anchor.height_m", S "anchor.station_x_m",
    S "anchor.station_y_m", S "anchor.station_z_m", S "anchor.rotation", S "anchor.scale", S "anchor.heights",
    S "anchor.until_s", S "anchor.axes", S "anchor.frame", S "points.frame", S "points.line", S "points.pulse0",
    S "points.t0_s", S "points.line_t0_s", S "points.n_pulses", S "points.n_points", S "point.pulse", S "point.t_s",
    S "point.echo", S "point.echo_count", S "point.label", S "point.reflectance_db", S "point.range_m",
    S "point.line_deg", S "point.pan_deg", S "point.x", S "point.y", S "point.z", S "line_end.frame", S "line_end.line",
    S "line_end.pulse0", S "line_end.t0_s", S "line_end.t1_s", S "line_end.n_fired", S "line_end.n_cast",
    S "line_end.n_echoes", S "line_end.mirror_count", S "line_end.pan_count", S "line_end.status",
    S "line_end.n_crowded", S "line_end.n_faint", S "line_end.n_unfit", S "telemetry.state", S "telemetry.scan",
    S "telemetry.pulses", S "telemetry.echoes", S "telemetry.lines", S "telemetry.lost_pulses",
    S "telemetry.late_blocks", S "telemetry.late_max_us", S "telemetry.errors_queued", S "telemetry.reader_lost_frames",
    S "telemetry.utc", S "telemetry.scan_fired", S "telemetry.scan_cast", S "telemetry.scan_lost", S "event.code",
    S "event.a", S "event.b", S "event.c", S "event.text", S "surfaces.first", S "surfaces.count", S "surface.label",
    S "surface.object", S "surface.material", S "poses.n", S "pose.t_s", S "pose.x_m", S "pose.y_m", S "pose.z_m",
    S "pose.qw", S "pose.qx", S "pose.qy", S "pose.qz", S "pose.frame", S "pose.flags", S "attributes.pulse0",
    S "attributes.line", S "attributes.n_points", S "attribute.amplitude_db", S "attribute.width_ns", S "emitter.kind",
    S "emitter.n_beams", S "emitter.steps", S "emitter.first_step", S "emitter.last_step", S "emitter.front_step",
    S "emitter.turn", S "emitter.rings", S "emitter.sequence_num", S "emitter.sequence_den", S "emitter.first_ring_deg",
    S "emitter.echoes", S "emitter.gaps", S "beam.elevation_deg", S "beam.azimuth_deg", S "beam.offset_ns",
    S "colours.pulse0", S "colours.line", S "colours.n_points", S "colour.red", S "colour.green", S "colour.blue",
    S "missing_pulses", S "line_end.lost_pulses", S "points_in", NULL};

static void expect_header(const uint8_t *frame)
{
    struct native_header h;
    native_read_header(frame, &h);
    expect_uint(S "type", h.type);
    expect_uint(S "version", h.version);
    expect_uint(S "flags", h.flags);
    expect_uint(S "flags.repeat", h.flags & 1);
    expect_uint(S "flags.local", h.flags >> 1 & 1);
    expect_uint(S "length", h.length);
    expect_uint(S "seq", h.seq);
    expect_uint(S "payload_crc", h.payload_crc);
    expect_uint(S "payload_crc.status", 1);
    expect_ns(S "t_s", h.t_ns);
    expect_uint(S "header_crc", le_get32(frame + 24));
    expect_uint(S "header_crc.status", 1);
}

#define UINT(prefix, member) expect_uint(S prefix "." #member, v.member)
#define REAL(prefix, member) expect_real(S prefix "." #member, v.member, 0)
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
    expect_real(S "descriptor.fov_min_deg", (double)v.fov_min_udeg / 1e6, 0);
    expect_real(S "descriptor.sweep_deg", (double)v.sweep_udeg / 1e6, 0);
    expect_real(S "descriptor.line_start_deg", (double)v.line_start_udeg / 1e6, 0);
    expect_real(S "descriptor.line_stop_deg", (double)v.line_stop_udeg / 1e6, 0);
    expect_real(S "descriptor.pan_start_deg", (double)v.pan_start_udeg / 1e6, 0);
    expect_real(S "descriptor.pan_stop_deg", (double)v.pan_stop_udeg / 1e6, 0);
    REAL("descriptor", mirror_counts_per_turn), REAL("descriptor", pan_counts_per_turn);
    REAL("descriptor", range_scale_m), REAL("descriptor", range_min_m), REAL("descriptor", range_max_m);
    UINT("descriptor", max_echoes), UINT("descriptor", n_surfaces), UINT("descriptor", frames);
    UINT("descriptor", scan), UINT("descriptor", seed);
    if (f->payload_len < 280) return;
    UINT("descriptor", content), UINT("descriptor", reserved);
    expect_uint(S "descriptor.content.attributes", v.content & 1);
    expect_uint(S "descriptor.content.colours", v.content >> 1 & 1);
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

/* Angles and what is computed of them: sine and cosine are other ones here, of an angle below 7 rad that was rounded
 * three times or less, 3 x 7 x 2^-53 < 3e-15; libscanhead's are as exact. In degrees that is 2e-13. In geodetic
 * coordinates a range is a difference of numbers of 6.4e6 m, which have steps of 1e-9 m. */
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
    expect_uint(S "attributes.pulse0", f->pulse0);
    expect_uint(S "attributes.line", f->scan_line);
    expect_uint(S "attributes.n_points", f->n_points);
    take_text(S "points_in");
    assert_int_equal(scanhead_attributes(sh, f, 0, attribute, NATIVE_MAX_POINTS), f->n_points);
    for (uint32_t i = 0; i < f->n_points; i++) {
        const struct scanhead_attribute *a = &attribute[i];
        if (!isnan(a->amplitude_db)) expect_real(S "attribute.amplitude_db", a->amplitude_db, 0);
        if (!isnan(a->width_ns)) expect_real(S "attribute.width_ns", a->width_ns, 0);
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
    expect_int(S "emitter.first_step", v.first_step);
    expect_int(S "emitter.last_step", v.last_step);
    expect_int(S "emitter.front_step", v.front_step);
    expect_int(S "emitter.turn", v.turn);
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
    if (f->type != SCANHEAD_SURFACES) return;
    expect_uint(S "surfaces.first", le_get32(f->payload));
    expect_uint(S "surfaces.count", le_get32(f->payload + 4));
    assert_int_equal(native_decode_surfaces(f->payload, f->payload_len, expect_name, NULL), 0);
}

/* Returns the types that there were, as bits. */
static unsigned expect_stream(const char *name)
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

/* The second answer has its command in this capture, and the first one's is before it. */
static void expect_tcp_lines(void)
{
    expect_text(S "reply", "est,1,scanhead native 1"); /* what is first in a segment of a stream that nobody knows yet */
    expect_text(S "reply", "idle");
    expect_text(S "command", "*IDN?");
    expect_text(S "command", "HEAD:STATe?");
    expect_text(S "reply", "ERR -222,\"Data out of range\"");
    expect_int(S "reply.error", -222);
    expect_text(S "reply", "idle");
}

static void expect_usb_lines(void)
{
    expect_text(S "command", "TIME?");
    expect_text(S "reply", "123456");
}

/* Nothing is malformed. Whole scans miss nothing; the line of the samples has 3 of its 400 pulses there. Warnings: the
 * LOCAL event of the samples, once on each carrier; the jumps from one stream to the next in packets of their own. */
static void expect_marks(void)
{
    int n_lost = 0;
    while (dissected_left(S "missing_pulses") > 0)
        expect_int(S "missing_pulses", 0);
    while (dissected_left(S "line_end.lost_pulses") > 0) {
        const char *lost = take_text(S "line_end.lost_pulses");
        n_lost += strcmp(lost, "397") == 0;
        assert_true(strcmp(lost, "0") == 0 || strcmp(lost, "397") == 0);
    }
    assert_int_equal(n_lost, 3);
    while (dissected_left(S "command_in") > 0)
        take_text(S "command_in");
    while (dissected_left(S "reply_in") > 0)
        take_text(S "reply_in");
    int n_warnings = 0;
    while (dissected_left("_ws.expert.severity") > 0) {
        const int severity = atoi(take_text("_ws.expert.severity"));
        n_warnings += severity == EXPERT_WARN;
        assert_true(severity < EXPERT_ERROR);
    }
    assert_int_equal(n_warnings, 3 + n_streams(2) - 1);
}

static void test_every_value(void **state)
{
    (void)state;
    write_clean();
    dissect("clean.pcapng", 1, all_fields);
    for (int carrier = 0; carrier < 3; carrier++) {
        unsigned types = 0;
        for (int i = 0; i < n_streams(carrier); i++) {
            types |= expect_stream(stream_name[i]);
            if (carrier == 0) expect_tcp_lines();
            if (carrier == 1) expect_usb_lines();
        }
        assert_int_equal(types, 0xffe); /* 1 to 11 */
    }
    expect_marks();
    expect_no_more();
}

/* ---- damage */

/* Each kind of damage to one frame, so that it differs from any whole frame; the new length. */
static size_t hurt(uint8_t *frame, size_t len, uint64_t *random)
{
    const uint32_t kind = capture_random(random, 5), at = capture_random(random, (uint32_t)len);
    const uint32_t n = 1 + capture_random(random, 20);
    if (kind == 0) frame[at] ^= (uint8_t)(1u << capture_random(random, 8));
    if (kind == 1)
        for (uint32_t i = at; i < at + n && i < len; i++)
            frame[i] ^= (uint8_t)(1 + capture_random(random, 255));
    if (kind == 2) return 1 + capture_random(random, (uint32_t)len - 1); /* the rest is missing */
    if (kind == 3 && n < len) {                                          /* a part is missing */
        const size_t from = capture_random(random, (uint32_t)(len - n));
        memmove(frame + from, frame + from + n, len - n - from);
        return len - n;
    }
    if (kind < 3) return len;
    memmove(frame + at + n, frame + at, len - at); /* bytes have come in, also where n did not fit */
    for (uint32_t i = at; i < at + n; i++)
        frame[i] = (uint8_t)capture_random(random, 256);
    return len + n;
}

/* 1,000 frames of all types, each hurt, in packets of their own. */
static void put_hurt(struct capture *c, uint32_t interface)
{
    static uint8_t copy[NATIVE_MAX_FRAME + 32];
    uint64_t random = 19;
    char *bytes[2];
    size_t len[2], at[2] = {0, 0};
    for (int i = 0; i < 2; i++)
        bytes[i] = wire_read(wire_path(wire, i == 0 ? "polar.shs" : "samples.shs"), &len[i]);
    for (int i = 0; i < N_HURT; i++) {
        const int of = i % 2;
        const uint8_t *frame = (uint8_t *)bytes[of] + at[of];
        const size_t n = native_frame_len(frame);
        memcpy(copy, frame, n);
        at[of] += n;
        if (at[of] == len[of]) at[of] = 0;
        size_t hurt_len = hurt(copy, n, &random);
        if (hurt_len == n && memcmp(copy, frame, n) == 0) copy[0] ^= 1; /* it was the same by chance */
        capture_packet(c, interface, copy, hurt_len);
    }
    free(bytes[0]);
    free(bytes[1]);
}

/* One frame, and what may happen to it; returns how many bytes there are. next: the frame after it, which comes first. */
static size_t put_one(uint8_t *out, const uint8_t *frame, const uint8_t *older, int what, uint64_t *random)
{
    size_t to = 0;
    if (what == 0) return 0;
    if (what == 2) { /* an older one once more */
        memcpy(out, older, native_frame_len(older));
        to += native_frame_len(older);
    }
    for (int g = 0; what == 4 && g < 40; g++)
        out[to++] = (uint8_t)capture_random(random, 256);
    memcpy(out + to, frame, native_frame_len(frame));
    return to + (what == 1 ? hurt(out + to, native_frame_len(frame), random) : native_frame_len(frame));
}

/* The recordings one after the other, N_ROUNDS times with other device times: each frame with a chance to be dropped, hurt,
 * to come after an older one or garbage, or after the next one. The last 30 are whole: nothing waits for bytes that never
 * come. */
static size_t put_damage(uint8_t *out)
{
    uint64_t random = 4;
    size_t to = 0, len;
    for (int i = 0; i < N_ROUNDS * N_RECORDINGS; i++) {
        char *bytes = wire_read(wire_path(wire, recording[i % N_RECORDINGS].name), &len);
        const uint8_t *older = (uint8_t *)bytes;
        for (size_t at = 0, n; at < len; at += n) {
            uint8_t *frame = (uint8_t *)bytes + at;
            n = native_frame_len(frame);
            frame[18] ^= (uint8_t)(i / N_RECORDINGS << 4); /* 0.8 ms and more */
            seal(frame);
            const int is_quiet = i + 1 == N_ROUNDS * N_RECORDINGS && at + 4000 > len;
            const int what = is_quiet ? 5 : (int)capture_random(&random, 24);
            if (what == 3 && at + n < len) { /* the next one first */
                uint8_t *next = frame + n;
                const size_t n_next = native_frame_len(next);
                next[18] ^= (uint8_t)(i / N_RECORDINGS << 4);
                seal(next);
                memcpy(out + to, next, n_next);
                to += n_next;
                n += n_next;
            }
            to += put_one(out + to, frame, older, what, &random);
            older = frame;
        }
        free(bytes);
    }
    return to;
}

static struct {
    size_t n[16], frames_missing;
} noticed;

static void keep_notice(void *ctx, const struct scanhead_notice *notice)
{
    (void)ctx;
    noticed.n[notice->kind]++;
    if (notice->kind == SCANHEAD_NOTICE_GAP) noticed.frames_missing += notice->n;
}

/* The next header with a good checksum; 1: its payload is good, too. The others have no payload status. */
static int take_good_header(size_t *n_bad_payloads)
{
    while (dissected_left(S "header_crc.status") > 0) {
        const int is_header = atoi(take_text(S "header_crc.status"));
        const int is_good = is_header && atoi(take_text(S "payload_crc.status"));
        if (is_good) return 1;
        *n_bad_payloads += (size_t)is_header;
        take_text(S "seq");
        take_text(S "type");
    }
    return 0;
}

/* Frames of a damaged stream are libscanhead's, in order. */
static void expect_frames(const char *name, size_t *n_bad)
{
    struct scanhead_frame frame;
    struct scanhead *sh = client_open(wire_path(wire, name));
    size_t n_dropped = 0, n = 0;
    memset(&noticed, 0, sizeof noticed);
    scanhead_on_notice(sh, keep_notice, NULL);
    for (; scanhead_next(sh, &frame, 0) == 0; n++) {
        const size_t dropped = noticed.n[SCANHEAD_NOTICE_REPEATED] + noticed.n[SCANHEAD_NOTICE_LATE];
        for (; n_dropped < dropped; n_dropped++) {
            assert_true(take_good_header(n_bad));
            take_text(S "seq");
            take_text(S "type");
        }
        assert_true(take_good_header(n_bad));
        expect_uint(S "seq", frame.seq);
        expect_int(S "type", frame.type);
    }
    scanhead_close(sh);
    assert_true(n > 100);
}

/* And so are the notices. The stream is there twice, on two carriers. */
static void expect_damaged(const char *name)
{
    size_t n_bad = 0, kinds[5] = {0}, missing = 0;
    expect_frames(name, &n_bad);
    expect_frames(name, &n_bad);
    while (dissected_left(S "seq.notice") > 0)
        kinds[atoi(take_text(S "seq.notice"))]++;
    while (dissected_left(S "seq.lost") > 0)
        missing += strtoull(take_text(S "seq.lost"), NULL, 10);
    for (int kind = SCANHEAD_NOTICE_GAP; kind <= SCANHEAD_NOTICE_RESTARTED; kind++) {
        assert_int_equal(kinds[kind], 2 * noticed.n[kind]);
        assert_true(kinds[kind] > 0);
    }
    assert_int_equal(missing, 2 * noticed.frames_missing);
    assert_int_equal(n_bad, 2 * noticed.n[SCANHEAD_NOTICE_BAD_PAYLOAD]);
    assert_true(n_bad > 3);
}

static void test_damage(void **state)
{
    (void)state;
    static const char *const marks[] = {"_ws.expert.severity", NULL};
    static const char *const fields[] = {S "header_crc.status", S "payload_crc.status", S "seq", S "type",
                                         S "seq.notice", S "seq.lost", "_ws.expert.message", S "point.range_m", NULL};
    static uint8_t damaged[1 << 20];
    struct capture c = {0}, d = {0};
    capture_begin(&c);
    put_hurt(&c, capture_interface(&c, CAPTURE_USER0));
    wire_write(wire, "hurt.pcapng", c.bytes, c.len);
    free(c.bytes);
    const size_t len = put_damage(damaged);
    wire_write(wire, "damaged.shs", damaged, len);
    capture_begin(&d);
    put_tcp(&d, capture_interface(&d, CAPTURE_ETHERNET), 0, damaged, len);
    put_usb(&d, capture_interface(&d, CAPTURE_USBMON), 1, damaged, len);
    wire_write(wire, "damaged.pcapng", d.bytes, d.len);
    free(d.bytes);

    dissect("hurt.pcapng", 1, marks);
    int n_packets = 0, n_marked = 0;
    char text[16];
    snprintf(text, sizeof text, "%d", EXPERT_ERROR);
    char *all = strdup(dissected_text()), *rest = all;
    for (char *line; (line = strsep(&rest, "\n")) != NULL && rest != NULL; n_packets++)
        n_marked += strstr(line, text) != NULL;
    free(all);
    assert_int_equal(n_packets, N_HURT);
    assert_int_equal(n_marked, N_HURT);

    dissect("damaged.pcapng", 1, fields);
    all = strdup(dissected_text());
    dissect("damaged.pcapng", 2, fields);
    assert_string_equal(dissected_text(), all);
    free(all);
    expect_damaged("damaged.shs");
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_every_value), cmocka_unit_test(test_damage)};
    return cmocka_run_group_tests(tests, setup, getenv("KEEP") ? NULL : wire_teardown);
}
