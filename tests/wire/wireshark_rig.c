/* SPDX-License-Identifier: MIT */
#include "tests/wire/wireshark_rig.h"

#include "drivers/protocol/crc32c.h"
#include "drivers/protocol/native.h"

#define AT_BERLIN                                                                       \
    " scene.anchor.source=explicit scene.anchor.lat_deg=52.3 scene.anchor.lon_deg=13.1" \
    " scene.anchor.height_m=80 scene.anchor.north_deg=17"
static const struct {
    const char *name, *keys;
    int moves;
} recording[N_RECORDINGS] = {
    {"polar.shs",
     "output.attributes=on output.colour=height signal.model=on waveform.send=on waveform.echoes=fraction noise.range=off",
     0},
    {"ride.shs", "output.attributes=off", 1},
    {"utm.shs", "output.layout=geo output.crs=utm time.epoch=2026-01-01T00:00:00Z time.ptp.follower=on" AT_BERLIN, 0},
    {"geodetic.shs", "output.layout=geo output.crs=geodetic signal.model=on waveform.send=on" AT_BERLIN, 0},
};
const char *const stream_name[N_STREAMS] = {"polar.shs",   "ride.shs",   "utm.shs", "geodetic.shs",
                                            "samples.shs", "joined.shs", "long.shs"};

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

void seal_frame(uint8_t *frame)
{
    le_put32(frame + 12, crc32c(0, frame + NATIVE_HEADER_LEN, le_get32(frame + 4)));
    le_put32(frame + 24, crc32c(0, frame, 24));
}

/* Writes the samples' descriptor and anchor, and then points with every value that a point may have. Two of three have
 * echoes. */
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
    seal_frame(frame);
    wire_write(wire, "long.shs", all, at + native_frame_len(frame));
    free(all);
}

/* Heights of an anchor are above a geoid that is 47.3 m higher than the ellipsoid. The ranges stay, as do all places. */
static void put_on_geoid(uint8_t *anchor)
{
    le_put_double(anchor + 32, le_get_double(anchor + 32) - 47.3);
    le_put32(anchor + 192, NATIVE_HEIGHTS_GEOID);
}

/* Each stream gets sequence numbers of its own, so that they can follow each other: between two there is a jump
 * forward. */
static void number_all(void)
{
    for (int i = 0; i < N_STREAMS; i++) {
        size_t len;
        if (i == JOINED) continue;
        char *bytes = wire_read(wire_path(wire, stream_name[i]), &len);
        for (size_t at = 0; at < len; at += native_frame_len((uint8_t *)bytes + at)) {
            uint8_t *frame = (uint8_t *)bytes + at;
            if ((frame[3] & NATIVE_LOCAL) == 0) le_put32(frame + 8, le_get32(frame + 8) + 100000u * (uint32_t)i);
            if (frame[1] == NATIVE_ANCHOR && strcmp(stream_name[i], "geodetic.shs") == 0)
                put_on_geoid(frame + NATIVE_HEADER_LEN);
            seal_frame(frame);
        }
        wire_write(wire, stream_name[i], bytes, len);
        free(bytes);
    }
}

static void write_joined(void)
{
    size_t len;
    char *bytes = wire_read(wire_path(wire, stream_name[0]), &len);
    wire_write(wire, stream_name[JOINED], bytes + JOINED_AT, len - JOINED_AT);
    free(bytes);
}

int wireshark_setup(void **state)
{
    const int rc = wire_setup(state);
    if (rc != 0) return rc;
    wire = *state;
    record_all();
    write_samples();
    write_long();
    number_all();
    write_joined();
    return 0;
}

/* ---- carriers */

void put_tcp(struct capture *c, uint32_t interface, int number, const uint8_t *bytes, size_t len)
{
    struct capture_tcp tcp = {.head_port = (uint16_t)(41000 + number), .client_port = 40000};
    uint64_t random = (uint64_t)number;
    static const char early[] = "*IDN?\nHEAD:STATe?\r\n", answers[] = "scanhead,test,1,scanhead native 1\r\nidle\r\n";
    static const char late[] = "ERR -222,\"Data out of range\"\r\nid";
    if (number != JOINED) { /* its command is before the capture */
        capture_segment(c, interface, &tcp, 1, answers, 10);
        capture_segment(c, interface, &tcp, 1, answers + 10, sizeof answers - 11);
    }
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

void put_usb(struct capture *c, uint32_t interface, int number, const uint8_t *bytes, size_t len)
{
    uint64_t random = (uint64_t)number;
    const uint8_t device = (uint8_t)(3 + number), out = number % 2 == 0 ? 3 : 1, in = out | 0x80; /* stream, console */
    for (size_t at = 0, n; at < len; at += n) {
        n = 1 + capture_random(&random, 16384);
        if (at == 0) n = 512; /* the first transfer has a header, so that the stream is known */
        if (n > len - at) n = len - at;
        capture_transfer(c, interface, device, in, bytes + at, n);
    }
    capture_transfer(c, interface, device, out, "TIME?\n", 6);
    capture_transfer(c, interface, device, in, "123456\r\n", 8);
}
